"""`python -m femupdate.benchmarks NAME`, in a checkout."""

from femupdate.cli.main import main

from .commands import group

main(commands=group, name="python -m femupdate.benchmarks")
