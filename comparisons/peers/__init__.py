"""The compressed plate by a displacement code, NGSolve, beside this package: accuracy for its cost."""

from typing import Final

from solvers.basics.front import front

LEVELS: Final = 8
"""Members of each family of meshes, counted from 0."""


__getattr__ = front(
    __name__,
    {
        "meshes": ("FAMILIES", "TRANSITIONS", "plain_mesh"),
        "report": ("costs_of", "runs_of"),
        "study": ("BRACKET", "CODES", "MODELS", "NGSOLVE", "TRIANGLES", "plate", "run"),
    },
)
