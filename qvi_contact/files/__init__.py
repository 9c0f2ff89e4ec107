"""Documents in and out: problem files, archives of results, VTU."""

from solvers.basics.front import front

__getattr__ = front(__name__)
