"""`python -m qvi_contact` is the command `qvi-contact`."""

import sys


def main() -> None:
    """Load and run the command; an interrupt from the keyboard while it is loaded ends it without a traceback."""
    try:
        from qvi_contact.command.cli import main as command

        command()
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
