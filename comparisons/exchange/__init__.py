"""Problems in formats of other programs (`qpbenchmark`, FCLIB, NumPy archives), and their files solved here."""

from solvers.basics.front import front

__getattr__ = front(__name__, {"quadratic_programs": ("programs_of", "standard_problems")})
