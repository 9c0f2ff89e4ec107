"""The data of the inequality (D2), its linear algebra, and the residuals of its laws."""

from solvers.basics.front import front

__getattr__ = front(__name__)
