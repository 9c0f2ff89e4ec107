"""The command `qvi-contact`, as entry points name it."""

from qvi_contact.command.cli import group, main

__all__ = ["group", "main"]

if __name__ == "__main__":
    main()
