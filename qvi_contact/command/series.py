"""Several results of one problem file: load steps of a history, or values of a sweep."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any, Final, NamedTuple

import numpy as np

from qvi_contact.basics.units import Units
from qvi_contact.command.progress_line import solving
from qvi_contact.errors import InputError
from qvi_contact.files.problem_file import ProblemFile, SweepPlan
from qvi_contact.files.stores import StoredSweep, read_sweep
from qvi_contact.solution.history import History, solve_history
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.solver import solve
from qvi_contact.solution.sweep import Sweep, solve_sweep
from solvers.basics.names import known_name
from solvers.basics.progress import deadline

_MOST: Final = 1_000_000  # values that are asked for at once
_PARAMETERS: Final = ("friction", "load", "gap", "offset")
_OWN: Final = ("parameter", "values", "of")  # arguments of `solve_sweep`, and keys of [sweep]


class Series(NamedTuple):
    """Several results of one file: "t" or the parameter, and its values, also of results that are missing."""

    results: History | Sweep
    label: str
    values: tuple[float, ...]

    def document(self, summaries: Sequence[dict[str, Any]], units: Units) -> dict[str, Any]:
        """What JSON holds of them beside the summaries of results; of a history also the energy lost in friction."""
        if isinstance(self.results, Sweep):
            return {self.label: list(self.values), "steps": list(summaries)}
        lost = self.results.dissipated
        dissipated = {
            "total": {"value": float(lost.sum()), "unit": units.energy},
            "steps": {"value": lost.tolist(), "unit": units.energy},
        }
        return {"times": list(self.values), "dissipated": dissipated, "steps": list(summaries)}


def solved_series(
    file: ProblemFile, plan: SweepPlan | None, options: dict[str, Any], verbose: bool, store: str | None = None
) -> tuple[Series | None, Sequence[ContactResult]]:
    """The results of a file: of its history, of a sweep if there is a plan, or one."""
    if store is not None and not file.times:
        remedy = "keeps steps of a history or rows of a sweep: give --set, or a file with a [history] or a [sweep]"
        raise InputError("--store", store, remedy)
    if plan is not None and plan.parameter in _PARAMETERS:
        sweep = swept(file, plan, options, verbose)
        return Series(sweep, plan.parameter, plan.values), sweep.steps
    values = file.times if plan is None else plan.values
    title = file.title or ("sweep" if plan is not None else "history" if values else "solve")
    with solving(title, max(len(values), 1), verbose=verbose) as advance:
        if plan is not None:  # of a constant: each value is a problem of its own
            limit = options.pop("time_limit", None)
            steps: list[ContactResult] = []
            with deadline(limit):
                for value in values:
                    if steps and deadline.over:
                        break
                    steps.append(
                        solve(file.with_constants({plan.parameter: value}).problem, **options, verbose=verbose)
                    )
                    advance()
            return Series(Sweep(plan.parameter, values, tuple(steps)), plan.parameter, values), steps
        if not values:
            return None, (solve(file.problem, **options, verbose=verbose),)
        done = 0

        def told(number: int, _result: ContactResult) -> None:
            nonlocal done
            while done < number:  # the first that is told need not be the first of all
                advance()
                done += 1

        history = solve_history(file.problems, told, store=store, **options, verbose=verbose)
        return Series(history, "t", values), history.steps


def swept(file: ProblemFile, plan: SweepPlan, options: dict[str, Any], verbose: bool, **stored: Any) -> Any:
    """The sweep of a file; `stored` are a store, where its rows are kept then, and those who share it."""
    solved: Any = solve_sweep  # with a store or without
    with solving(file.title or "sweep", len(plan.values), verbose=verbose) as advance:
        if stored:
            with suppress(InputError):  # what is no store will be told
                for _ in read_sweep(stored["store"]).statuses:
                    advance()
        asked = plan.parameter, plan.values, plan.of
        try:
            return solved(file.problem, *asked, lambda *_: advance(), **stored, **options, verbose=verbose)
        except InputError as error:
            if error.field not in _OWN:
                raise
            place = f"sweep.{error.field}" if plan is file.sweep else "--set"
            raise type(error)(place, error.value, error.remedy) from error


def check_asked(plan: SweepPlan | None, store: str | None, asked: Mapping[str, Any]) -> None:
    """Refuse options, by name, that have no sense without a sweep that goes to a file, or with one."""
    streams = plan is not None and store is not None
    if streams and plan is not None and plan.parameter not in _PARAMETERS:
        raise InputError("--store", store, f"keeps rows of {', '.join(_PARAMETERS)}: sweep a constant without it")
    for name in ("workers", "dask"):
        if not streams and asked[name] is not None:
            remedy = "is for values of a sweep: give --store FILE with --set, or with a [sweep] in the problem file"
            raise InputError(f"--{name}", asked[name], remedy)
    for name in ("plot", "vtk", "npz", "report"):
        if streams and asked[name]:
            remedy = "needs a result, and a sweep with --store keeps rows of numbers alone: leave one of them out"
            raise InputError(f"--{name}", asked[name], remedy)


def stored_lines(sweep: StoredSweep) -> Iterator[str]:
    """What people read of a sweep in a store."""
    few, many = min(sweep.values), max(sweep.values)
    yield f"{sweep.parameter}: {len(sweep.values)} values from {few:g} to {many:g}"
    yield ", ".join(f"{count} {status.words}" for status, count in Counter(sweep.statuses).items()) or "none done"
    if sweep.status != "solved":
        yield sweep.message
    yield f"rows: {sweep.path}"


def stored_document(file: ProblemFile, sweep: StoredSweep) -> dict[str, Any]:
    """The same for programs."""
    statuses = Counter(map(str, sweep.statuses))
    return {
        "title": file.title, "solved": sweep.status == "solved", "store": str(sweep.path), "parameter": sweep.parameter,
        "values": len(sweep.values), "statuses": dict(statuses), "message": sweep.message,
    }  # fmt: skip


def asked(file: ProblemFile, given: Sequence[str]) -> tuple[ProblemFile, SweepPlan | None]:
    """The file with constants that options --set give one value, and the sweep that another one or the file asks for.

    Each is `NAME=V1,V2,…`, or `NAME=START:STOP:COUNT`. The name is that of a constant of the file, of a parameter of
    sweeps, or `CONTACT.PARAMETER`, `load.NAME` or `constants.NAME`.
    """
    plans, constants = list[SweepPlan](), dict[str, float]()
    for text in given:
        name, separator, listed = text.partition("=")
        owner, _, parameter = name.strip().rpartition(".")
        if owner == "load" and parameter not in _PARAMETERS:
            owner, parameter = parameter, owner
        values: tuple[float, ...] = ()
        with suppress(ValueError, TypeError):
            start, colon, rest = listed.partition(":")
            stop, _, count = rest.partition(":")
            if not colon:
                values = tuple(float(part) for part in listed.split(","))
            elif int(count) <= _MOST:
                values = tuple(np.linspace(float(start), float(stop), int(count)).tolist())
        if not (separator and parameter and values):
            remedy = (
                "write friction=0.1,0.2,0.3 (or load, gap, offset, a constant of the file), friction=0.1:0.3:21 for 21 "
                "values, or with a name base.friction=0.1,0.2 or load.thrust=1.2"
            )
            raise InputError("--set", text, remedy)
        known = {} if owner == "constants" else {"parameters": _PARAMETERS}
        known_name("--set", parameter, {**known, "constants": () if owner not in ("", "constants") else file.constants})
        if owner == "constants" or parameter not in _PARAMETERS:
            if len(values) == 1:
                constants[parameter] = values[0]
                continue
            owner = ""
        plans.append(SweepPlan(parameter, values, (owner,) if owner else None))
    if len(plans) > 1:
        remedy = "one number can be swept at a time: give one value of constants, and one option for something else"
        raise InputError("--set", " ".join(given), remedy)
    if plans and file.times:
        raise InputError("--set", given[0], "a file with a [history] cannot be swept: give one without")
    return file.with_constants(constants) if constants else file, plans[0] if plans else file.sweep
