"""The verification manual: problems whose answer is known otherwise, row by row beside what the package computes."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "known": ("Answer", "KNOWN"),
        "measures": (
            "edge_states", "left_by_stresses", "point_states", "runs",
            "stress_deviation", "value_at", "zone_ends",
        ),
        "report": (
            "CHAPTERS", "HEADINGS", "POSED", "cells", "choose", "drawings", "number", "overview", "run",
        ),
        "rows": (
            "Chapter", "Check", "Kind", "Proof", "both", "bounded", "by_hand", "certified", "certified_companion",
            "crash", "infeasible",
        ),
    },
)  # fmt: skip
