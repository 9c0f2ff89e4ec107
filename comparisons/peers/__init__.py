"""The compressed plate by displacement codes in the same run: accuracy for its cost beside this package."""

from typing import Final

from solvers.basics.front import front

LEVELS: Final = 8
"""Members of the families of meshes that are graded to corner and transition, counted from 0."""


__getattr__ = front(
    __name__,
    {
        "figures": ("COSTS", "heights", "limits", "plots_of", "ticks"),
        "measures": (
            "RESOLUTION",
            "TARGETS",
            "beside_of",
            "compared_of",
            "contradictory",
            "costs_of",
            "intervals_of",
            "known_of",
            "reference",
            "runs_of",
            "values_of",
        ),
        "meshes": ("FAMILIES", "TRANSITIONS", "plain_mesh", "ratio"),
        "models": ("BRACKET", "CODES", "MODELS", "NAMED", "TRIANGLES"),
        "report": ("FORMS", "SCHEMA", "document_of", "tables_of"),
        "study": ("GETFEM", "ProcessError", "answer_of", "missing_codes", "peers_study", "plate", "run"),
    },
)
