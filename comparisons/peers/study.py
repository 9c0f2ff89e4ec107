"""The run: each model on each mesh in a process of its own, one at a time; what comes back is plain data."""

import math
from datetime import UTC, datetime
from typing import Any, Final

from comparisons.benchmark import reference
from comparisons.benchmark.ratios import median, spread
from comparisons.machine import machine, versions
from comparisons.peers import measure
from comparisons.peers.cases import Plan
from comparisons.peers.findings import findings
from comparisons.peers.models import CODES, EQUILIBRIUM, Model
from comparisons.study.children import Child, Terms
from comparisons.study.outcome import DONE, Outcome
from qvi_contact.terminal import Advance

Record = dict[str, Any]

_ANSWER: Final = ("half_force", "unknowns", "iterations", "residual", "version", "before", "peak")
_TIMES: Final = ("setup", "solve")


def run(plan: Plan, advance: Advance) -> Record:
    """Measure everything in the plan, `advance` after each process; the whole report as plain data for JSON."""
    document: Record = {
        "schema": "qvi-contact/peers/1",
        "began": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": plan.command,
        "machine": machine(),
        "versions": versions(),
        "threads": 1,
        "units": {"half_force": "MPa × length", "seconds": "s, wall time", "memory": "bytes"},
        "settled": [_settled(mu) for mu in plan.friction],
        "missing": [{"code": CODES[key].name, "remedy": CODES[key].remedy} for key in plan.missing],
        "models": [{"name": model.name, "code": model.code, "mesh": model.mesh} for model in plan.models],
        "rows": [],
        "reported": _reported(plan),
    }
    for mu in plan.friction:
        for model in plan.models:
            for cells in plan.cells:
                document["rows"].append(_row(plan, model, mu, cells))
                advance(f"{model.name}, {cells}², μ = {mu:g}")
    peers = [row for row in document["rows"] if row["code"] != EQUILIBRIUM and row["version"]]
    document["versions"] |= {CODES[row["code"]].name: row["version"] for row in peers}
    return {**document, "findings": findings(document)}


def _row(plan: Plan, model: Model, friction: float, cells: int) -> Record:
    """One model on one mesh, whatever comes of it."""
    order = plan.order(model, friction, cells)
    child = Child(Terms(measure.TASK, (), timeout=plan.limit))
    try:
        outcome = child.run(order)
    finally:
        child.close()
    place = {
        "friction": friction, "model": model.name, "code": model.code, "mesh": model.mesh, "cells": cells,
        "grading": order["case"]["grading"],
    }  # fmt: skip
    return {**place, **row_of(outcome, friction)}


def row_of(outcome: Outcome, friction: float) -> Record:
    """Status, answer, error and medians of what a process returned; a failure is a row with its reason.

    The error is that of P/2 relative to what displacement codes settle on; None where that is not known, or without a
    solution. Times are medians of the repetitions, "whole" of set-up and solve together.
    """
    result = outcome.result if outcome.status == DONE else {"status": outcome.status, "message": outcome.reason}
    answer = {name: _finite(result.get(name)) for name in _ANSWER}
    solved = result["status"] == "solved"
    times = {name: list(result.get(name, ())) for name in _TIMES}
    whole = [sum(pair) for pair in zip(times["setup"], times["solve"], strict=True)]
    return {
        "status": result["status"],
        "message": result["message"],
        **answer,
        "error": reference.settled_error(answer["half_force"], friction) if solved else None,
        "setup": median(times["setup"]),
        "solve": median(times["solve"]),
        "whole": median(whole),
        "spread": spread(whole),
        "repetitions": len(whole),
        "seconds": times,
    }


def _finite(value: Any) -> Any:
    """The value, None for infinite numbers and NaN, which JSON does not have."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _settled(friction: float) -> Record:
    """The value that errors are relative to, and the relative error below which they mean nothing."""
    value = reference.SETTLED.get(friction)
    meaningless = None if value is None else reference.SETTLED_UNCERTAINTY / value
    return {"friction": friction, "half_force": value, "meaningless": meaningless}


def _reported(plan: Plan) -> list[Record]:
    """What other codes reported on another day at μ = 0.2, of those that are not in this run."""
    if reference.CONVERGED_FRICTION not in plan.friction:
        return []
    measured = {CODES[model.code].name for model in plan.models}
    return [
        {**peer._asdict(), "error": reference.settled_error(peer.half_force, reference.CONVERGED_FRICTION)}
        for peer in reference.PEERS
        if peer.code.split(",")[0] not in measured
    ]
