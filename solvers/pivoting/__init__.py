"""Solutions as vertices, by pivoting: exact where nothing is strict, and needs no start."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "lemke": ("solve_lcp",),
        "method": ("LARGEST", "affordable", "solve_pivoting"),
    },
)
