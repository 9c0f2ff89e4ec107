"""The command `qvi-contact`: options, reports, outlines of problems."""

from solvers.basics.front import front

__getattr__ = front(__name__)
