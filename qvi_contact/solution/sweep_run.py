"""The values of a sweep one after the other, each with what those before have in common with it."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, get_args

import numpy as np

from qvi_contact.basics.checks import Field, one_of, real_array, true_or_false
from qvi_contact.discretization.basis import RowKind
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.families import ElementName, with_element
from qvi_contact.errors import InputError
from qvi_contact.limit.load_factor import checked_loads, loads_of, multiplied
from qvi_contact.problem.conditions import Condition, Contact
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.solver import check_options, posed, solve
from qvi_contact.solution.sweep_rows import Parameter
from solvers import Status
from solvers.basics.names import known_name
from solvers.solve import takes_state


@dataclass(frozen=True, eq=False)
class SweepTask:
    """What is to be done for each value.

    Attributes
    ----------
    problem : ContactProblem
        The problem; `of` puts it on its element.
    parameter : "friction", "load", "gap" or "offset"
        What changes.
    names : tuple of str
        The contacts or loads that are changed.
    space, options
        Arguments of `posed` and `solve`.
    warm : bool
        Whether to start from the value before.

    """

    problem: ContactProblem
    parameter: Parameter
    names: tuple[str, ...]
    space: dict[str, Any] = field(default_factory=dict)
    options: dict[str, Any] = field(default_factory=dict)
    warm: bool = False

    @classmethod
    def of(
        cls,
        problem: ContactProblem,
        parameter: Parameter,
        names: Sequence[str] | None,
        *,
        element: ElementName | None = None,
        degree: int | None = None,
        contact_rows: RowKind | None = None,
        warm_start: bool = True,
        **options: Any,
    ) -> SweepTask:
        """The task of checked arguments of `solve_sweep`."""
        if not isinstance(problem, ContactProblem):
            raise InputError("problem", problem, "give a ContactProblem")
        one_of("parameter", parameter, get_args(Parameter), f"give one of {', '.join(get_args(Parameter))}")
        space = {"element": element, "degree": degree, "contact_rows": contact_rows}
        check_options(options)
        chosen = _checked_names(problem, parameter, names)
        warm = true_or_false("warm_start", warm_start) and takes_state(options)
        return cls(with_element(problem, element), parameter, chosen, space, options, warm)

    def changed(self, value: float) -> ContactProblem:
        """The problem with this value."""
        if self.parameter == "load":
            return multiplied(self.problem, self.names, value)
        conditions = [_changed(each, self.parameter, value, self.names) for each in self.problem.conditions]
        return replace(self.problem, conditions=conditions)


class SweepRun:
    """One value after the other, on one factorisation.

    Attributes
    ----------
    seconds : float
        How long the last one took.

    """

    def __init__(self, task: SweepTask) -> None:
        self._task = task
        self._before: Discretization | None = None
        self._start = _Start(task.warm)
        self.seconds = 0.0

    def result(self, value: float) -> ContactResult:
        """The result of a value."""
        began, task = time.perf_counter(), self._task
        self._before = posed(task.changed(value), before=self._before, **task.space, **task.options)
        found = solve(self._before, **{**task.options, **self._start.options})
        self._start.hear(found)
        self.seconds = time.perf_counter() - began
        return found


class _Start:
    """What a value starts from: the state of the one before.

    To find that a state is not near costs an iteration or two. After that a value starts as usual, after the next time
    two, then four, and so on: where the contact grows with each value, states are seldom near.
    """

    def __init__(self, wanted: bool) -> None:
        self._wanted = wanted
        self._state: ContactResult | None = None
        self._pause, self._left = 0, 0

    @property
    def options(self) -> dict[str, Any]:
        """Arguments of `solve`."""
        begins = self._wanted and self._state is not None and not self._left
        return {"initial": self._state} if begins else {}

    def hear(self, result: ContactResult) -> None:
        """The result that came of it."""
        near = result.solution.near
        if near is None:
            self._left = max(self._left - 1, 0)
        else:
            self._pause = 0 if near else max(2 * self._pause, 1)
            self._left = self._pause
        if result.status is Status.SOLVED:
            self._state = result


def checked_values(parameter: Parameter, values: object) -> tuple[float, ...]:
    """All values of a sweep."""
    numbers = real_array("values", values, "give a list of at least one number")
    if numbers.ndim != 1 or not len(numbers) or not np.isfinite(numbers).all():
        raise InputError("values", values, "give a list of at least one finite number")
    if parameter == "friction" and numbers.min() < 0.0:
        raise InputError("values", float(numbers.min()), "give coefficients of friction ≥ 0")
    return tuple(numbers.tolist())


def _checked_names(problem: ContactProblem, parameter: Parameter, of: Sequence[str] | None) -> tuple[str, ...]:
    """Names of contacts or loads whose data change."""
    if parameter == "load":
        return tuple(loads_of(problem)) if of is None else checked_loads(problem, of, "of")
    known = [contact.name for contact in problem.contacts if contact.law != "tied"]
    if not known:
        raise InputError("parameter", "friction, gap or offset", "the problem has no contact that could open or slip")
    if of is None:
        return tuple(known)
    if isinstance(of, str) or not isinstance(of, Sequence) or not of:
        raise InputError("of", of, f"give a list of names out of {', '.join(known)}")
    return tuple(known_name("of", name, {"contacts that could open or slip": known}) for name in of)


def _changed(condition: Condition, parameter: Parameter, value: float, names: Sequence[str]) -> Condition:
    if not isinstance(condition, Contact) or condition.name not in names:
        return condition
    new = value if parameter == "friction" else _plus(getattr(condition, parameter), value)
    data: dict[str, Any] = {parameter: new}
    return replace(condition, **data)


def _plus(given: Field, value: float) -> Field:
    if not callable(given):
        return given + value
    function: Callable[..., object] = given
    return lambda x, y: np.asarray(function(x, y), dtype=float) + value
