"""Entry point of ``python -m comparisons``."""

from comparisons.cli import group
from qvi_contact.basics.terminal import run

run(group, "python -m comparisons")
