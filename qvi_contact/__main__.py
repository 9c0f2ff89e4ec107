"""`python -m qvi_contact` is the command `qvi-contact`."""

from qvi_contact.command.cli import main

main()
