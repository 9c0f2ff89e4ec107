"""Settings of discretisation and solution, declared and checked once for all functions, files and commands."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any, Final, Literal, TypeAlias, get_args

from qvi_contact.basics.schema import Inline, WithFields
from qvi_contact.errors import InputError
from solvers.settings import CondensedOptions, FixedPointOptions, UzawaOptions
from solvers.settings import Settings as Method

LawOn: TypeAlias = Literal["edges", "points"]
"""The type of `discretization.space.LawOn`, without importing that module in files and commands."""

Parameter: TypeAlias = Literal["friction", "load", "gap", "offset"]
"""The datum that a sweep changes."""
PARAMETERS: Final = get_args(Parameter)


@dataclass(frozen=True, kw_only=True)
class Settings(WithFields, Method):
    """How a problem is discretised and solved: the fields below, and all fields of `solvers.settings.Settings`.

    All functions that solve accept these settings, or fields and options of the method as keyword arguments:
    ``solve(problem, degree=5)`` is ``solve(problem, Settings(degree=5))``, and ``solve(problem, settings, degree=5)``
    changes one field.

    Raises
    ------
    InputError
        If a setting is wrong; `degree` and `law_on` are checked when a problem is discretised.
    SolverUnavailableError
        If method, inner solver or factorisation is unknown or not installed.

    """

    degree: int | None = None
    """Degree of the element, from 3 to 12; 4 by default: `degree = 5`."""
    law_on: LawOn | None = None
    """Where the contact law holds: on whole edges, or at points. By default it holds on edges, but at points if
    friction varies along an edge, on bilateral contacts with friction, and for uzawa: `law_on = "points"`."""
    initial: Any = field(default=None, hash=False)
    """An earlier result to start from, such as that of a smaller load. On the same mesh and element the condensed
    method starts from its state, if two iterations show that it is near. On the same contact points the fixed point
    starts from its pressure. The fixed point also accepts an array of pressures at all contact points [stress],
    effective where a fluid presses; negative values count as zero. This setting does not choose the method."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.initial is not None:
            from qvi_contact.solution.result import ContactResult  # not needed by files and commands

            if not isinstance(self.initial, ContactResult):
                object.__setattr__(self, "initial", pressures(self.initial).tolist())  # lists can be compared

    @property
    def law(self) -> LawOn | None:
        """`law_on`, or "points" if the method needs that; None for the default of the problem."""
        if self.law_on is None and self.method == "uzawa":
            return "points"  # its steps are divided by |σ_T|, and coefficients may vanish where σ_T does not
        return self.law_on

    @property
    def stated(self) -> dict[str, object]:
        """The settings that answers depend on and that differ from their defaults, for digests of runs."""
        names = ("degree", "law_on", "method", "inner", "tolerance", "factorisation", "initial")
        changed = {name: value for name in names if (value := getattr(self, name)) is not getattr(type(self), name)}
        if self.initial is not None and not isinstance(self.initial, list | float):  # no pressures
            changed["initial"] = _exactly(self.initial)  # the repr of a result has six digits
        return {**changed, **self.options}


def _exactly(start: Any) -> tuple[object, ...]:
    """All bits of the state of a result, and of its units, element and mesh; `InputError` without a state."""
    solution, mesh, form = start.solution, start.problem.mesh, start.discretization
    units = float(form.scales.stress), float(form.scales.displacement)
    arrays = mesh.vertices, mesh.cells, start.dofs, solution.normal_multiplier, solution.tangential_multiplier
    return (form.space.degree, form.rule.law_on, *units, *(array.tobytes() for array in arrays))


def pressures(initial: object) -> Any:
    """Given pressures at all contact points as an array; `InputError` if they are not finite real numbers."""
    import numpy as np

    from qvi_contact.basics.checks import real_array

    pressure = real_array("initial", initial, "give a ContactResult or an array of pressures")
    if not np.isfinite(pressure).all():
        raise InputError("initial", initial, "give finite pressures, or a ContactResult")
    return pressure


# Settings in files and commands.


_OF_ALL = ("max_iterations", "initial", "callback")  # options that all methods have


@dataclass(frozen=True, kw_only=True)
class SolveOptions:
    """Defaults for `qvi_contact.solve`: its settings, and the options of the methods."""

    settings: Annotated[Any, Inline(Settings, ("verbose", "throw", "callback", "initial", "options"))] = None
    condensed: Annotated[Any, Inline(CondensedOptions, _OF_ALL)] = None
    fixed_point: Annotated[Any, Inline(FixedPointOptions, (*_OF_ALL, "inner_options"))] = None
    uzawa: Annotated[Any, Inline(UzawaOptions, _OF_ALL)] = None
    max_iterations: int | None = None
    """Iterations at most; each method has its own default: `max_iterations = 200`."""


@dataclass(frozen=True, kw_only=True)
class RefineOptions:
    """Defaults for `qvi_contact.refine`, beside those for `qvi_contact.solve`."""

    target: float | None = None
    """Relative error asked for; 1e-3 by default: `target = 1e-4`."""
    quantity: str | None = None
    """energy (by default) or dissipation. Of a contact: NAME.normal_force, NAME.tangential_force, NAME.slip(x, y), or
    NAME.largest_pressure, which is infinite at sharp corners. Of a plate or pin: NAME.force_x, force_y, moment, or its
    motion x, y, rotation. Stress at a point: xx(x, y), yy, xy, von_mises, or first and second for principal stresses;
    where triangles meet, of their mean stress. Extreme of such a stress along a named edge: EDGES.largest_von_mises,
    EDGES.smallest_second: `quantity = "base.normal_force"`."""
    max_unknowns: int | None = None
    """Largest number of unknowns; 20000 by default: `max_unknowns = 50_000`."""
    max_rounds: int | None = None
    """Largest number of rounds; 60 by default: `max_rounds = 10`."""
    guaranteed: bool | None = None
    """For the force of a contact: refine until its guaranteed bounds are within the target. By default an estimate is
    enough: `guaranteed = true`."""
