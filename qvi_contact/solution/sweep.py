"""Sweeps: one problem for several values of friction, load, gap or offset, without what all of them have in common.

Values are independent problems, unlike the steps of a history. Matrices, factorisation and Schur complement are made
once, and each value starts from the state of the one before, if that is near.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from qvi_contact import __version__
from qvi_contact.discretization.basis import RowKind
from qvi_contact.discretization.families import ElementName
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.result import ContactResult, overall_status
from qvi_contact.solution.sweep_rows import COLUMNS, Parameter, SweepRow, outcome_of, table_of
from qvi_contact.solution.sweep_run import SweepRun, SweepTask, checked_values
from solvers import Status
from solvers.basics.checks import function_or_none
from solvers.basics.narration import narrated
from solvers.basics.watch import expired, watched

if TYPE_CHECKING:
    from pandas import DataFrame

    from qvi_contact.basics.units import Units


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
        done = list(zip(self.values, self.steps, strict=False))
        failures = [(value, step.message) for value, step in done if step.status is not Status.SOLVED]
        return outcome_of(self.parameter, failures, len(done), len(self.values))

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
        done = enumerate(zip(self.values, self.steps, strict=False), 1)
        rows = (SweepRow.of(number, value, step) for number, (value, step) in done)
        return table_of(self.parameter, rows, units)


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
    several solutions, the one found may depend on the value before; sort the values as the body would be loaded. For
    thousands of values `stream_sweep` keeps rows of numbers in a file.

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
    function_or_none("callback", callback)
    title = f"qvi_contact {__version__}: solve_sweep"
    with watched(time_limit), narrated(title, verbose, COLUMNS, iterations=False) as story:
        task = SweepTask.of(
            problem, parameter, of,
            element=element, degree=degree, contact_rows=contact_rows, warm_start=warm_start, **options,
        )  # fmt: skip
        numbers = checked_values(parameter, values)
        story.begin({"values": len(numbers), "parameter": parameter, "cells": task.problem.mesh.cell_count})

        def told(number: int, result: ContactResult) -> None:
            story.line(number, numbers[number - 1], str(result.status), result.iterations, result.certificate.accuracy)
            if callback is not None:
                callback(number, result)

        sweep = Sweep(parameter, numbers, tuple(_solved(task, numbers, told)))
        story.end(str(sweep.status), sweep.message, {}, sweep.status is Status.SOLVED)
        return sweep


def _solved(
    task: SweepTask, values: Sequence[float], callback: Callable[[int, ContactResult], object]
) -> list[ContactResult]:
    """The results, until the time is over."""
    run, results = SweepRun(task), list[ContactResult]()
    for number, value in enumerate(values, 1):
        if results and expired():
            break
        results.append(run.result(value))
        callback(number, results[-1])
    return results
