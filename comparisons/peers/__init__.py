"""The compressed plate by displacement codes beside this package: accuracy for its cost."""

from typing import Final

from solvers.basics.front import front

LEVELS: Final = 8
"""Members of the families of meshes that are graded to corner and transition, counted from 0."""


__getattr__ = front(
    __name__,
    {
        "meshes": ("FAMILIES", "TRANSITIONS", "plain_mesh", "ratio"),
        "report": ("compared_of", "costs_of", "runs_of"),
        "study": ("BRACKET", "CODES", "GETFEM", "MODELS", "ProcessError", "TRIANGLES", "missing_codes", "plate", "run"),
    },
)
