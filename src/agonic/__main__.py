"""`python -m agonic`."""

from agonic.cli import main

main()
