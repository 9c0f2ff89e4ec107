"""Sweeps: one problem for several values of friction, load, gap or offset, without what all of them have in common.

Values are independent problems, unlike the steps of a history. Matrices, factorisation and Schur complement are made
once, and each value starts from the state of the one before, if that is near.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, Literal, TypeAlias, get_args

import numpy as np

from qvi_contact import __version__
from qvi_contact.basics.checks import Field, one_of, real_array
from qvi_contact.discretization.basis import RowKind
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.families import ElementName, with_element
from qvi_contact.errors import InputError
from qvi_contact.problem.conditions import Condition, Contact
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.contact_line import summary_units
from qvi_contact.solution.limit import checked_loads, loads_of, multiplied
from qvi_contact.solution.result import ContactResult, overall_status
from qvi_contact.solution.solver import posed, solve
from solvers import Status
from solvers.basics.frames import columns_of, frame
from solvers.basics.narration import narrated
from solvers.basics.watch import expired, watched
from solvers.solve import takes_state

if TYPE_CHECKING:
    from pandas import DataFrame

    from qvi_contact.basics.units import Units

Parameter: TypeAlias = Literal["friction", "load", "gap", "offset"]
"""What a sweep changes."""

_COLUMNS: Final = {"step": ">5", "value": ">12g", "status": "<20", "iterations": ">10", "accuracy": ">9.1e"}


@dataclass(frozen=True, eq=False)
class Sweep:
    """Results of a sweep, one for each value that was done.

    Attributes
    ----------
    parameter : "friction", "load", "gap" or "offset"
        What was changed.
    values : tuple of float
        All values asked for.
    steps : tuple of ContactResult
        The results of the first of them, all unless the time ran out.

    """

    parameter: Parameter
    values: tuple[float, ...]
    steps: tuple[ContactResult, ...]

    @property
    def statuses(self) -> tuple[Status, ...]:
        """The status of each value done."""
        return tuple(step.status for step in self.steps)

    @property
    def status(self) -> Status:
        """Solved if all values were; else the status of the first that was not, "time_limit" if some are missing."""
        return overall_status(self.statuses, len(self.values))

    @property
    def message(self) -> str:
        """One sentence about the outcome."""
        for value, step in zip(self.values, self.steps, strict=False):
            if step.status is not Status.SOLVED:
                failed = sum(each.status is not Status.SOLVED for each in self.steps)
                others = f" ({failed - 1} more not solved)" if failed > 1 else ""
                return f"{self.parameter} = {value:g}: {step.message}{others}"
        if len(self.steps) < len(self.values):
            return f"time limit after {len(self.steps)} of {len(self.values)} values. {Status.TIME_LIMIT.advice}"
        return f"all {len(self.values)} values solved" if len(self.values) > 1 else "the value is solved"

    def to_frame(self, units: Units | None = None) -> DataFrame:
        """One row for each value and contact as a pandas table; needs the extra ``frame`` (pandas).

        Columns are the parameter, "status", "iterations", "contact", and those of `ContactResult.forces_frame`. Values
        without a state have no rows.

        Parameters
        ----------
        units : Units, optional
            If given, names of columns end in their unit, as in "largest_slip [mm]".

        Raises
        ------
        InputError
            If pandas is missing.

        """
        rows = [
            {
                self.parameter: value,
                "status": str(step.status),
                "iterations": step.iterations,
                "contact": name,
                **line.summary(),
            }
            for value, step in zip(self.values, self.steps, strict=False)
            if step.has_state
            for name, line in step.contacts.items()
        ]
        length = units.displacement if units is not None and self.parameter in ("gap", "offset") else None
        return frame(columns_of(rows), {**summary_units(units), **({self.parameter: length} if length else {})})


def solve_sweep(
    problem: ContactProblem,
    parameter: Parameter,
    values: Sequence[float],
    of: Sequence[str] | None = None,
    callback: Callable[[int, ContactResult], object] | None = None,
    *,
    time_limit: float | None = None,
    element: ElementName | None = None,
    degree: int | None = None,
    contact_rows: RowKind | None = None,
    warm_start: bool = True,
    verbose: bool = False,
    **options: Any,  # checked by solve
) -> Sweep:
    """Solve a problem for several values of one of its data.

    Each value is a problem of its own: nothing is remembered but what saves time. Where the law of friction leaves
    several solutions, the one found may depend on the value before; sort the values as the body would be loaded.

    Parameters
    ----------
    problem : ContactProblem
        The problem.
    parameter : "friction", "load", "gap" or "offset"
        "friction": the coefficient μ of contacts, in place of theirs; "load": a factor of loads; "gap", "offset": what
        is added to these data of contacts [length].
    values : sequence of float
        Its values, in the order in which they are solved.
    of : sequence of str, optional
        Names of the contacts that are changed, all but tied ones by default; for "load" names of the loads, as for
        `limit_load_factor`, all by default.
    callback : callable, optional
        Called with the number of each value, from 1, and its result.
    time_limit : float, optional
        Seconds for all values together. Those done until then are kept.
    element, degree, contact_rows
        As for `solve`.
    warm_start : bool
        Whether methods that take a start begin at the state of the value before.
    verbose : bool
        Print a header, a line a value, and a footer with status and time.
    **options
        As for `solve`.

    Returns
    -------
    Sweep
        A value that is not solved does not end it.

    Raises
    ------
    InputError
        If a value or a name is wrong.

    """
    title = f"qvi_contact {__version__}: solve_sweep"
    if not isinstance(problem, ContactProblem):
        raise InputError("problem", problem, "give a ContactProblem")
    with watched(time_limit), narrated(title, verbose, _COLUMNS, iterations=False) as story:
        problem = with_element(problem, element)
        numbers = _checked_values(parameter, values)
        problems = [changed(problem, parameter, value, of) for value in numbers]
        story.begin({"values": len(numbers), "parameter": parameter, "cells": problem.mesh.cell_count})

        def told(number: int, result: ContactResult) -> None:
            story.line(number, numbers[number - 1], str(result.status), result.iterations, result.certificate.accuracy)
            if callback is not None:
                callback(number, result)

        space = {"element": element, "degree": degree, "contact_rows": contact_rows}
        sweep = Sweep(parameter, numbers, tuple(_solved(problems, space, told, options, warm_start)))
        story.end(str(sweep.status), sweep.message, {}, sweep.status is Status.SOLVED)
        return sweep


def changed(problem: ContactProblem, parameter: Parameter, value: float, of: Sequence[str] | None) -> ContactProblem:
    """The problem with another value of a parameter, see `solve_sweep`."""
    if parameter == "load":
        return multiplied(problem, loads_of(problem) if of is None else checked_loads(problem, of, "of"), value)
    names = _checked_contacts(problem, of)
    return replace(problem, conditions=[_changed(each, parameter, value, names) for each in problem.conditions])


def _changed(condition: Condition, parameter: Parameter, value: float, names: Sequence[str]) -> Condition:
    if not isinstance(condition, Contact) or condition.name not in names:
        return condition
    new = value if parameter == "friction" else _plus(getattr(condition, parameter), value)
    data: dict[str, Any] = {parameter: new}
    return replace(condition, **data)


def _plus(field: Field, value: float) -> Field:
    if not callable(field):
        return field + value
    function: Callable[..., object] = field
    return lambda x, y: np.asarray(function(x, y), dtype=float) + value


def _checked_values(parameter: object, values: object) -> tuple[float, ...]:
    one_of("parameter", parameter, get_args(Parameter), f"give one of {', '.join(get_args(Parameter))}")
    numbers = real_array("values", values, "give a list of at least one number")
    if numbers.ndim != 1 or not len(numbers) or not np.isfinite(numbers).all():
        raise InputError("values", values, "give a list of at least one finite number")
    if parameter == "friction" and numbers.min() < 0.0:
        raise InputError("values", float(numbers.min()), "give coefficients of friction ≥ 0")
    return tuple(numbers.tolist())


def _checked_contacts(problem: ContactProblem, of: Sequence[str] | None) -> tuple[str, ...]:
    """Names of contacts whose data may change."""
    known = [contact.name for contact in problem.contacts if contact.law != "tied"]
    if not known:
        raise InputError("parameter", "friction, gap or offset", "the problem has no contact that could open or slip")
    if of is None:
        return tuple(known)
    if isinstance(of, str) or not isinstance(of, Sequence) or not of:
        raise InputError("of", of, f"give a list of names out of {', '.join(known)}")
    remedy = f"there is no such contact that could open or slip; there are {', '.join(known)}"
    return tuple(one_of("of", name, known, remedy) for name in of)


def _solved(
    problems: Sequence[ContactProblem],
    space: dict[str, Any],
    callback: Callable[[int, ContactResult], object],
    options: dict[str, Any],
    warm: bool,
) -> list[ContactResult]:
    """The results, until the time is over."""
    warm = warm and takes_state(options)
    results: list[ContactResult] = []
    before: Discretization | None = None
    state: ContactResult | None = None
    for number, problem in enumerate(problems, 1):
        if results and expired():
            break
        before = posed(problem, before=before, **space, **options)
        start: dict[str, Any] = {"initial": state} if state is not None and warm else {}
        results.append(solve(before, **{**options, **start}))
        state = results[-1] if results[-1].status is Status.SOLVED else state
        callback(number, results[-1])
    return results
