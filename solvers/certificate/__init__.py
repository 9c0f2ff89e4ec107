"""What is true of a state: the certificate, its measures, feasibility and uniqueness."""

from solvers.basics.front import front

__getattr__ = front(__name__)
