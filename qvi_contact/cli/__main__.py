"""`python -m qvi_contact.cli` is the command `qvi-contact`."""

from qvi_contact.command.cli import main

main()
