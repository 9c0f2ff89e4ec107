"""`python -m qvi_contact` is the command `qvi-contact`."""

from qvi_contact.cli import main

main()
