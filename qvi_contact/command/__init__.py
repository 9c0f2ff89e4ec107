"""The command `qvi-contact`: options and help, the work of each command, printed text, and HTML reports."""

from solvers.basics.front import front

__getattr__ = front(__name__)
