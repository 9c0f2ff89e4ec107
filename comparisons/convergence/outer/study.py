"""The study: problems × meshes × μ × loops, what the loops are, and what is done for a case: residuals and theory."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, Literal, NamedTuple

import numpy as np

from comparisons.convergence.bodies import Reference, ending, exact_contraction, reference, timed
from comparisons.convergence.linearised import rate_of
from comparisons.lab.studies import Study
from qvi_contact.plots import BLUE, GREEN, GREY, ORANGE, VERMILLION
from qvi_contact.plots.style import PURPLE
from solvers.certificate import uniqueness_bound

INNER: Final = "direct:clarabel"
"""Inner solver of all loops."""

TOLERANCE: Final = 1e-8
"""That of the residual and of the certificate."""

MAX_ITERATIONS: Final = 200

PATIENCE: Final = 60
"""Iterations without progress after which a loop is given up; long, so that slow convergence is seen for what it is."""


class Loop(NamedTuple):
    """A loop: `variant` of the fixed point (None: the condensed method) and step θ, and how it is drawn."""

    variant: Literal["plain", "damped", "anderson"] | None
    damping: float
    colour: str
    marker: str
    line: Any

    def options(self) -> dict[str, Any]:
        """Keyword arguments of `solve_qvi`."""
        if self.variant is None:
            return {"method": "condensed", "tolerance": TOLERANCE}
        return {
            "method": "fixed-point", "inner": INNER, "tolerance": TOLERANCE, "variant": self.variant,
            "damping": self.damping, "max_iterations": MAX_ITERATIONS, "patience": PATIENCE,
        }  # fmt: skip


PLAIN: Final = "plain"
ANDERSON: Final = "Anderson"
CONDENSED: Final = "condensed"

LOOPS: Final[Mapping[str, Loop]] = {
    PLAIN: Loop("plain", 1.0, VERMILLION, "o", "-"),
    "damped 0.75": Loop("damped", 0.75, ORANGE, "^", "--"),
    "damped 0.5": Loop("damped", 0.5, GREEN, "s", "-."),
    "damped 0.25": Loop("damped", 0.25, PURPLE, "v", ":"),
    ANDERSON: Loop("anderson", 0.5, BLUE, "D", (0, (5, 1))),
    CONDENSED: Loop(None, 1.0, GREY, "*", (0, (1, 1))),
}
"""All loops, in the order of tables and legends."""

Meshes = Mapping[tuple[str, int], tuple[float, ...]]

FULL: Final[Meshes] = {
    ("contacts", 0): (0.25, 0.5, 1.0, 1.1, 1.2, 1.3, 1.5, 2.0, 3.0, 4.0),
    ("plate", 4): (0.05, 0.1, 0.15, 0.2, 0.25),
    ("plate", 8): (0.05, 0.1, 0.15, 0.2, 0.25),
    ("plate", 16): (0.05, 0.1, 0.15, 0.2, 0.25),
    ("plate", 32): (0.1, 0.2),
    ("block", 4): (0.12, 0.15, 0.2, 0.3),
    ("block", 8): (0.105, 0.11, 0.12, 0.15, 0.2, 0.3),
    ("block", 16): (0.12, 0.2),
    ("ssnv128", 4): (0.3, 0.5, 1.0),
    ("ssnv128", 8): (0.3, 0.5, 1.0, 2.0),
    ("ssnv128", 16): (0.1, 0.3, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0),
    ("ssnv128", 24): (0.3, 0.5, 1.0),
    ("three", 0): (2.0,),
}
"""(Problem, cells a side) → μ."""

QUICK: Final[Meshes] = {
    ("contacts", 0): (0.5, 1.0, 2.0),
    ("plate", 4): (0.1,),
    ("plate", 8): (0.1,),
    ("ssnv128", 8): (0.3, 1.0, 4.0),
    ("three", 0): (2.0,),
}

STARTS: Final = (0.0, 1.7, 10.0)
"""Pressures that loops start from where there are several solutions."""


def study(quick: bool) -> Study:
    """The study, or a few coarse meshes of it."""
    return Study("convergence-outer", 2, "comparisons.convergence.outer.study:run", [*cases(QUICK if quick else FULL)])


def cases(meshes: Meshes, loops: Sequence[str] = tuple(LOOPS)) -> Iterator[dict[str, Any]]:
    """All loops from the bonded state; on "three" each from several starts, but for the method that takes none."""
    for (problem, cells), frictions in meshes.items():
        for friction in frictions:
            for loop in loops:
                several = problem == "three" and LOOPS[loop].variant is not None
                for start in STARTS if several else (None,):
                    yield {"problem": problem, "cells": cells, "friction": friction, "loop": loop, "start": start}


def run(case: Mapping[str, Any]) -> dict[str, Any]:
    """Task of the study: solve a problem by a loop.

    Returns
    -------
    dict
        status, message, iterations : how it ended
        seconds : wall times of repeated solves, factorisation included
        residuals : of every outer iteration (of the interior point method where there is no loop)
        course, factor, low, high : see `rates.Rate`
        linearised : contraction by `linearised` at the solution of the condensed method; None without one
        exact : that known in closed form, None where none is
        sharper, kappa : 1/γ and κ^(−1/2) of `solvers.certificate`, None where they were not computed
        normal, tangential : resultants of σ_N and σ_T, in the unit of the problem's data × length
        slipping, open, points : numbers of contact points, slipping and open ones of the reference
        certificate : see `plain_certificate`

    """
    loop, place = LOOPS[case["loop"]], (case["problem"], case["cells"], case["friction"])
    start = {} if case["start"] is None else {"initial": np.full(1, case["start"])}
    known = reference(*place)
    solution, seconds = timed(place, **loop.options(), **start)
    residuals = [entry.residual for entry in solution.history]
    rate = rate_of(residuals, TOLERANCE)
    qvi, unit = solution.problem, known.body.force
    return {
        **ending(solution), "seconds": seconds, "residuals": residuals,
        "course": rate.course, "factor": rate.factor, "low": rate.low, "high": rate.high,
        **_theory(case, loop, known),
        "normal": unit * qvi.resultant(solution.z), "tangential": unit * float(qvi.W @ qvi.tangential(solution.z)),
    }  # fmt: skip


def _theory(case: Mapping[str, Any], loop: Loop, known: Reference) -> dict[str, Any]:
    step = loop.damping if loop.variant in ("plain", "damped") else None
    local, bound = known.linearised, uniqueness_bound(known.body.qvi)
    exact = case["problem"] == "contacts" and step is not None
    return {
        "linearised": None if local is None or step is None else local.outer_contraction(step),
        "exact": exact_contraction(case["friction"], step) if exact and step is not None else None,
        "sharper": bound.sharper, "kappa": bound.bound,
        "slipping": None if local is None else int(local.slipping.sum()),
        "open": None if local is None else int(local.open.sum()),
        "points": known.body.qvi.m,
    }  # fmt: skip
