"""How often estimates held, from the stored rows alone."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from pandas import DataFrame

from comparisons.lab.study import Row, frame_of
from qvi_contact.basics.certainty import Certainty

DOUBTFUL: Final = 0.2
"""Doubt of a reference, over the larger of estimate and error, from which it is in doubt."""

ROUNDING: Final = 1e-9
"""Relative error that is none: solves are as accurate as this."""

SAFETY: Final = 1.5
"""What `refine` multiplies the difference from a closer look by."""

_NUMBERS: Final = ("target", "error", "off", "doubt", "unknowns", "rounds")


def runs_of(rows: Sequence[Row]) -> DataFrame:
    """One line a run: the numbers of `study.solve_case`, and what follows.

    "judged", whether it reached its target and there is a reference; "held", whether |value − reference| is within the
    error that was told; "ratio", that error over it; "estimated", whether it was an estimate, no bound; "doubtful",
    whether the reference itself is in doubt. Such runs are judged all the same: to leave them out would hide misses.
    """
    runs = frame_of(rows, _NUMBERS, ("status", "certainty", "quantity", "message"))
    off = runs.off.abs()
    judged = (runs.status == "reached") & runs.off.notna()
    doubtful = judged & (runs.doubt > DOUBTFUL * np.maximum(off, runs.error)) & (runs.doubt > ROUNDING)
    held = judged & ((off <= runs.error) | (off <= ROUNDING))
    ratio = (runs.error / off.where(off > ROUNDING)).where(judged)
    estimated = runs.certainty == str(Certainty.ESTIMATE)
    return runs.assign(judged=judged, doubtful=doubtful, held=held, ratio=ratio, estimated=estimated)


def values_of(runs: DataFrame) -> dict[str, Any]:
    """The numbers in sentences."""
    estimates, bounds = (runs[runs.judged & (runs.estimated == which)] for which in (True, False))
    ratios = estimates.ratio.dropna()
    quantiles = {f"q{level:02d}": float(ratios.quantile(level / 100.0)) for level in (5, 50, 95)}
    return {
        "runs": len(runs), "reached": int((runs.status == "reached").sum()), "doubtful": int(runs.doubtful.sum()),
        "least": int((estimates.held & ~estimates.doubtful).sum()),
        "estimates": len(estimates), "held": int(estimates.held.sum()),
        "share": float(estimates.held.mean()) if len(estimates) else None,
        "bounds": len(bounds), "bounds_held": int(bounds.held.sum()),
        "worst": float(ratios.min()), "plain": float((ratios >= SAFETY).mean()),
        "rounds": float(estimates.rounds.mean()) if len(estimates) else None, **quantiles,
    }  # fmt: skip
