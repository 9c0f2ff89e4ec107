"""The verification manual: problems whose answer is known otherwise, row by row beside what the package computes."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "balance": ("of_displacements", "of_stresses"),
        "elements": ("Chapter", "Element", "QUINTIC", "TRIANGLES"),
        "exhibits": ("EXHIBITS", "conservation", "figure", "overview", "pictures", "results"),
        "known": ("Answer", "KNOWN"),
        "measures": (
            "between_points",
            "edge_states",
            "energy_apart",
            "point_states",
            "runs",
            "stress_deviation",
            "value_at",
            "zone_ends",
        ),
        "proof": ("Proof", "both", "bounded", "by_hand", "certified", "certified_companion", "infeasible"),
        "report": ("as_json",),
        "row": ("Kind", "absolute", "at_least", "at_most", "crash", "enclosed", "relative", "word"),
        "study": ("CHAPTERS", "as_record", "choose", "run"),
        "tables": ("HEADINGS", "cells", "number"),
    },
)
