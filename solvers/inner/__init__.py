"""Back ends for the inner problem: the QVI with the friction bound given."""

from solvers.basics.front import front

__getattr__ = front(__name__)
