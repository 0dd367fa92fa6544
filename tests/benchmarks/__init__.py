"""Published tables, trials and comparisons, beside our own figures.

They are no part of what is installed. In a checkout this folder is `femupdate.benchmarks`: the
benchmark NAME runs as `femupdate benchmark NAME`, and from the checkout's root folder also as
`python -m femupdate.benchmarks NAME`. `commands` says how to add one.
"""
