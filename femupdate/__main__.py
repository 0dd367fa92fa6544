"""`python -m femupdate` is the command `femupdate`."""

from femupdate.cli.main import main

main()
