"""`python -m femupdate.benchmarks NAME` is `femupdate benchmark NAME`."""

import sys

from femupdate.cli.main import main

main(["benchmark", *sys.argv[1:]])
