"""From (D2) back to mechanics: solve, result, contact line, stresses and tractions, sweeps and histories."""

from solvers.basics.front import front

__getattr__ = front(__name__)
