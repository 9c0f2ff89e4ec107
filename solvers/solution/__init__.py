"""What every method returns, and how its end is judged."""

from solvers.basics.front import front
from solvers.solution.solution import Iteration, QVISolution

__all__ = ["Iteration", "QVISolution"]

__getattr__ = front(
    __name__,
    {
        "contraction": ("observed_contraction",),
        "finish": ("LOOSEST", "Outcome"),
        "start": ("Start",),
    },
)
