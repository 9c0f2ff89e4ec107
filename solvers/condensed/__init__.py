"""The quasi-variational inequality on the unknowns that the contact feels, solved directly."""

from solvers.basics.front import front

__getattr__ = front(__name__)
