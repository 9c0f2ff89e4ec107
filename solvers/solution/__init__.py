"""What every method returns, and how its end is judged."""

from solvers.solution.solution import Iteration, QVISolution

__all__ = ["Iteration", "QVISolution"]
