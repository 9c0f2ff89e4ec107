"""Sweeps whose rows go to a file, on the command line; what they need is loaded for them alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from qvi_contact.command.series import named_errors
from qvi_contact.command.solve_line import solving
from qvi_contact.errors import InputError
from qvi_contact.files.problem_file import ProblemFile, SweepPlan

if TYPE_CHECKING:
    from qvi_contact.files.sweep_store import StoredSweep
    from qvi_contact.solution.sweep_rows import SweepRow


def check_asked(plan: SweepPlan | None, store: str | None, asked: Mapping[str, Any]) -> None:
    """Refuse options, by name, that have no sense without a sweep that goes to a file, or with one."""
    streams = plan is not None and store is not None
    for name in ("workers", "dask"):
        if not streams and asked[name] is not None:
            remedy = "is for values of a sweep: give --store FILE with --set, or with a [sweep] in the problem file"
            raise InputError(f"--{name}", asked[name], remedy)
    for name in ("plot", "deformed", "vtk", "npz", "report", "certificate"):
        if streams and asked[name]:
            remedy = "needs a result, and a sweep with --store keeps rows of numbers alone: leave one of them out"
            raise InputError(f"--{name}", asked[name], remedy)


def streamed(
    file: ProblemFile, plan: SweepPlan, options: dict[str, Any], verbose: bool, store: str, spread: dict[str, Any]
) -> StoredSweep:
    """The sweep of a file in a store, done as far as the time allows; `spread` are the workers."""
    from qvi_contact.solution.sweep_stream import stream_sweep

    with named_errors(plan, file), solving(file.title or "sweep", len(plan.values), verbose=verbose) as advance:
        for _ in range(_done(store)):
            advance()

        def told(_number: int, _row: SweepRow) -> None:
            advance()

        return stream_sweep(
            file.problem, plan.parameter, plan.values, store, plan.of, told, **spread, **options, verbose=verbose
        )


def lines(sweep: StoredSweep) -> Iterator[str]:
    """What people read."""
    few, many = min(sweep.values), max(sweep.values)
    yield f"{sweep.parameter}: {len(sweep.values)} values from {few:g} to {many:g}"
    yield ", ".join(f"{count} {status.words}" for status, count in Counter(sweep.statuses).items()) or "none done"
    if sweep.status != "solved":
        yield sweep.message
    yield f"rows: {sweep.path}"


def document(file: ProblemFile, sweep: StoredSweep) -> dict[str, Any]:
    """The same for programs."""
    statuses = Counter(map(str, sweep.statuses))
    return {
        "title": file.title, "solved": sweep.status == "solved", "store": str(sweep.path), "parameter": sweep.parameter,
        "values": len(sweep.values), "statuses": dict(statuses), "message": sweep.message,
    }  # fmt: skip


def _done(store: str) -> int:
    """Values that are done already; none where the store is not one, which will be told."""
    from qvi_contact.files.sweep_store import read_sweep

    try:
        return len(read_sweep(store).statuses)
    except InputError:
        return 0
