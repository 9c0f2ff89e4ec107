"""Convergence: in the mesh, of the outer loop, and of the paper's Uzawa iteration.

Each study is a package: `study` declares it by a function ``study(quick) -> Study``, says what is compared and does a
case, `measures` and `figures` make numbers, tables and pictures of rows, `report.md` is the template of the
report, and `report` fills it in from the stored rows alone by a function ``report(rows, quick) -> Document``.
"""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "bodies": (
            "COUPLINGS",
            "PLACE",
            "POINTS",
            "SLIDING_LIMIT",
            "body",
            "contacts",
            "dragged_block",
            "exact_contraction",
            "reference",
        ),
        "rates": ("first_lasting", "growth_order", "rate_of"),
    },
)
