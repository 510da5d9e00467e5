"""`python -m acqd`."""

from acqd.cli.main import main

main()
