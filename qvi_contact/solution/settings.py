"""How problems are discretised and solved: said and checked once for all functions that solve, files and commands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

from qvi_contact.errors import RETIRED, InputError
from solvers.settings import Settings as Method

LawOn: TypeAlias = Literal["edges", "points"]
"""As `discretization.space` has it, which files and commands do without."""


@dataclass(frozen=True, kw_only=True)
class Settings(Method):
    """How a problem is discretised and solved: what is below, and all fields of `solvers.settings.Settings`.

    All functions that solve take such settings, or their fields and options of the method as keyword arguments:
    ``solve(problem, degree=5)`` is ``solve(problem, Settings(degree=5))``, and ``solve(problem, settings, degree=5)``
    changes one field.

    Parameters
    ----------
    degree : int, optional
        Degree of the element, from 3 to 12; 4 by default: `degree = 5`.
    law_on : "edges" or "points", optional
        Where the contact law holds: on whole edges, or at points. edges by default; points where friction varies along
        an edge, on bilateral contacts with friction, and for uzawa: `law_on = "points"`.
    initial : ContactResult or array_like, optional
        An earlier result, such as that of a smaller load: on the same mesh and element the condensed method starts from
        it if two iterations find it near, and on the same contact points the fixed point starts from its pressure. An
        array of pressures over all contact points [stress], effective where a fluid presses, is for the fixed point
        only; negative values count as zero. It chooses no method.

    Raises
    ------
    InputError
        If one of them is wrong; `degree` and `law_on` when a problem is discretised.
    SolverUnavailableError
        If method, inner solver or factorisation is unknown or not installed.

    """

    degree: int | None = None
    law_on: LawOn | None = None

    def __post_init__(self) -> None:
        if isinstance(self.options, Mapping):
            for name in RETIRED.keys() & self.options.keys():
                raise InputError(name, self.options[name], RETIRED[name])
        super().__post_init__()
        if self.initial is not None:
            from qvi_contact.solution.result import ContactResult  # files and commands do without

            if not isinstance(self.initial, ContactResult):
                _ = pressures(self.initial)

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
        own = {name: value for name in names if (value := getattr(self, name)) is not getattr(type(self), name)}
        return {**own, **self.options}


def pressures(initial: object) -> Any:
    """Pressures over all contact points as they are given."""
    import numpy as np

    from qvi_contact.basics.checks import real_array

    pressure = real_array("initial", initial, "give a ContactResult or an array of pressures")
    if not np.isfinite(pressure).all():
        raise InputError("initial", initial, "give finite pressures, or a ContactResult")
    return pressure
