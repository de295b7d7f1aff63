"""`python -m backdrive`: the command line."""

from backdrive.cli import main

main()
