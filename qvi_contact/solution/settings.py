"""How problems are discretised and solved: said and checked once for all functions that solve."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from qvi_contact.basics.checks import FloatArray, real_array
from qvi_contact.basics.retired import RETIRED, refuse_arguments
from qvi_contact.discretization.space import LawOn
from qvi_contact.errors import InputError
from qvi_contact.solution.result import ContactResult
from solvers import Iteration
from solvers.basics.types import PicklesFields
from solvers.solve import Settings as Method

Listener: TypeAlias = Callable[[Iteration], object]


@dataclass(frozen=True, kw_only=True)
class Settings(PicklesFields):
    """How a problem is discretised and solved.

    All functions that solve take such settings, or their fields and options of the method as keyword arguments:
    ``solve(problem, degree=5)`` is ``solve(problem, Settings(degree=5))``, and ``solve(problem, settings, degree=5)``
    changes one field.

    Parameters
    ----------
    degree : int, optional
        Degree of the element, from 3 to 12, 4 by default; see `discretize`.
    law_on : "edges" or "points", optional
        Where the contact law holds, on whole edges or at Gauss points; see `discretize` for what is taken by default.
        "uzawa" takes points.
    method : str, optional
        "condensed" (the inequality solved directly on what the contact feels, by an interior point method),
        "fixed-point" (outer iteration on the friction bound, convex inner problems) or "uzawa" (the paper's iteration
        (4.1)-(4.4)), or "pivoting" (from vertex to vertex, for small contacts). By default "condensed"; where that
        fails "pivoting" and "fixed-point", as far as the contact is small enough for them, for as long again as the
        first took at most, or 15 seconds if that is more; another method if an inner solver or options are given that
        only that one takes.
    inner : str, optional
        How the fixed point solves its inner problems: "qp:<qpsolvers name>", "direct:clarabel" or
        "socp:<cvxpy name>"; `solvers.available()` lists what is installed. By default "qp:clarabel".
    tolerance : float
        Accuracy that the certificate must confirm, dimensionless.
    factorisation : str
        "pardiso", "superlu" or "dense"; "auto" takes "dense" for small problems, else the first that is installed.
    threads : int, optional
        For factorisations and dense linear algebra; by default one for small problems, else all cores.
    time_limit : float, optional
        Seconds for everything together: all steps or values, methods, retries and inner problems. When they are over
        the best state so far is returned, with the status "time_limit" unless its certificate passes. A factorisation
        under way, and an inner solver that takes no limit, are not interrupted. A factorisation that is estimated to
        take more than twice the time left, or twice the memory of the machine, is not begun; the message has the
        estimate.
    verbose : bool
        Print a header, a line an iteration, step or value, and a footer with status and times.
    throw : bool
        Raise `SolveError` where a solve does not end with the status "solved".
    callback : callable, optional
        Called with every `solvers.Iteration` of any method. Histories, sweeps and refinement have another one.
    initial : ContactResult or array_like, optional
        An earlier result, such as that of a smaller load: on the same mesh and element the condensed method starts from
        it if two iterations find it near, and on the same contact points the fixed point starts from its pressure. An
        array of pressures over all contact points [stress], effective where a fluid presses, is for the fixed point
        only; negative values count as zero. It chooses no method.
    options : mapping
        Options of the method, by name; see `solvers.solve_qvi`.

    Raises
    ------
    InputError
        If one of them is wrong; `degree` and `law_on` when a problem is discretised.
    SolverUnavailableError
        If method or inner solver is unknown or not installed.

    """

    degree: int | None = None
    law_on: LawOn | None = None
    method: str | None = None
    inner: str | None = None
    tolerance: float = 1e-8
    factorisation: str = "auto"
    threads: int | None = None
    time_limit: float | None = None
    verbose: bool = False
    throw: bool = False
    callback: Listener | None = None
    initial: Any = None
    options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        refuse_arguments({name: value for name, value in self.options.items() if name in RETIRED})
        _ = self.how
        if not isinstance(self.initial, ContactResult | None):
            _ = pressures(self.initial)

    @classmethod
    def of(cls, settings: Settings | None, changes: Mapping[str, Any]) -> Settings:
        """These settings, or the usual ones, with changes of fields and of options of the method; checked."""
        if settings is not None and not isinstance(settings, Settings):
            raise InputError("settings", settings, "give Settings, or their fields by name, such as method='uzawa'")
        own, options = dict[str, Any](), dict[str, Any]({} if settings is None else settings.options)
        for name, value in changes.items():
            (own if name in _FIELDS else options)[name] = value
        if "options" in own:
            options.update(own.pop("options"))
        return cls(**own, options=options) if settings is None else replace(settings, **own, options=options)

    @cached_property
    def how(self) -> Method:
        """What `solvers` takes of them; the start is added with the problem."""
        given: dict[str, Any] = {name: getattr(self, name) for name in _OF_SOLVERS}
        if self.callback is not None:
            given["callback"] = self.callback
        return Method.of(**given, **self.options)

    @property
    def law(self) -> LawOn | None:
        """Where the law is asked for, or has to be for the method; None if it takes either."""
        if self.law_on is None and self.method == "uzawa":
            return "points"  # its steps, divided by |σ_T|, are those of tractions: coefficients may vanish
        return self.law_on

    @property
    def stated(self) -> dict[str, object]:
        """What is not as by default, of what answers depend on, for digests of runs."""
        names = ("degree", "law_on", "method", "inner", "tolerance", "factorisation", "initial")
        own = {name: value for name in names if (value := getattr(self, name)) is not _DEFAULTS[name]}
        return {**own, **self.options}


def pressures(initial: object) -> FloatArray:
    """Pressures over all contact points as they are given."""
    pressure = real_array("initial", initial, "give a ContactResult or an array of pressures")
    if not np.isfinite(pressure).all():
        raise InputError("initial", initial, "give finite pressures, or a ContactResult")
    return pressure


_OF_SOLVERS = ("method", "inner", "tolerance", "factorisation", "threads", "time_limit", "verbose", "throw")
_DEFAULTS = {each.name: each.default for each in fields(Settings)}
_FIELDS = frozenset(_DEFAULTS)
