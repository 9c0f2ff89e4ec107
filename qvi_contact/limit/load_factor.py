"""Limit analysis: how much of a load friction and unilateral contact can carry, by a mesh and by the body at all."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from qvi_contact import __version__
from qvi_contact.basics.checks import FloatArray, instance_of, names_among, positive_number
from qvi_contact.discretization.discretization import Discretization, discretize
from qvi_contact.discretization.scaling import Scales
from qvi_contact.errors import InputError, SolveError, refuse_arguments
from qvi_contact.limit.conic import APART, ROUNDING
from qvi_contact.limit.flow import BodyMotion, Flow, FlowProgram
from qvi_contact.limit.split import coefficients_of
from qvi_contact.limit.stresses import CERTIFIED, WIDER, Carried, StressProgram, YieldCones
from qvi_contact.mechanism import Mechanism, upper_bound
from qvi_contact.mechanism.bodies import BODY, FLUID
from qvi_contact.problem.conditions import DRIVES, SHEAR_LAW, Condition, Contact, Traction, components
from qvi_contact.problem.fields import BodyForces, times
from qvi_contact.problem.material import Material, MohrCoulomb
from qvi_contact.problem.problem import ContactProblem, with_contacts
from solvers.basics.progress import Log, deadline
from solvers.basics.types import frame

if TYPE_CHECKING:
    from pandas import DataFrame

OPTIONS: Final = ("degree", "time_limit")  # of all limit analyses
_SAMPLES = (1.0, 2.0)  # load factors at which the problem is discretised; it is affine in between and beyond
_FOLLOWED = 1e-9  # misfit of a body force, relative, that is rounding
_MET: Final = 1e-5  # of the upper side: small loads make so much of tractions that are rounding
_FARTHEST: Final = math.log(1e4)  # factors of strength beyond count as infinite, and below the inverse as zero
_STEP: Final = math.log(2.0)  # between the first of them that are tried
_MOST: Final = 1e6  # shares of loads beyond, or below the inverse, count as so much
_LEAST: Final = 1e-15
_FAR: Final = 1e5  # times the least strength: what is larger does not help flows where stresses from below are small,
_SPARED: Final = 3e1  # up to so many times the least
_CLOSE: Final = 1e-6  # logarithm of the width of a bisection that may end there, however little is asked for


@dataclass(eq=False, repr=False)
class LimitLoad(float):
    """Result of a limit analysis: a number, the load factor that the mesh carries, and what is known besides.

    Notes
    -----
    With prescribed tractions that stresses of the mesh cannot follow point by point, `lower` is that of tractions with
    the same resultants on every edge. On bodies that yield and have sides that are arcs both numbers are estimates:
    strengths hold on the straight triangles.

    """

    lower: float
    """The largest multiple for which the mesh has stresses that keep contact laws and strengths; the value of the
    number itself. Infinity if any multiple can be carried, minus infinity if none can."""
    upper: float
    """No stress of the body carries a larger multiple, whatever the mesh. Infinity if the loads can grow without limit,
    that is if they can do no work on mechanisms but 1e-7 of what they could do on other motions; minus infinity if no
    multiple can be carried."""
    mechanism: Mechanism | None
    """The motion of the blocks that proves `upper`; None where that is infinite."""
    bound: float
    """No multiple above this can be carried by this mesh: the dual bound of the multipliers found."""
    violation: float
    """Largest violation of the contact laws and strengths at `lower`, relative to the largest limit of tractions.
    Strengths above 1e3 times the least one count beside their own."""
    collapse: Collapse | None = None
    """How a body that yields gives way; None if no part of it has a strength, or a side is not finite."""

    def __new__(cls, lower: float, *_: object, **__: object) -> LimitLoad:
        """The number `lower`, to which the fields are added."""
        return super().__new__(cls, lower + 0.0)

    def __post_init__(self) -> None:
        self.lower, self.upper = self.lower + 0.0, self.upper + 0.0  # zero has no sign

    def to_frame(self) -> DataFrame:
        """One row as a pandas table: "lower", "upper", "bound", "violation", and which contacts slide or open.

        "slides" and "opens" are the names of the contacts that do so in the mechanism, joined by ", ". Needs the extra
        ``frame`` (pandas); without it an `InputError` says so.
        """
        moved = {} if self.mechanism is None else self.mechanism.contacts
        numbers = {name: [getattr(self, name)] for name in ("lower", "upper", "bound", "violation")}
        slides = ", ".join(name for name, motion in moved.items() if motion.slides)
        opens = ", ".join(name for name, motion in moved.items() if motion.opens)
        return frame({**numbers, "slides": [slides], "opens": [opens]})

    def __repr__(self) -> str:
        return f"LimitLoad(lower={self.lower:.9g}, upper={self.upper:.9g})"

    def __str__(self) -> str:
        return repr(float(self))


def limit_load_factor(
    problem: ContactProblem,
    loads: Sequence[str],
    *,
    time_limit: float | None = None,
    degree: int | None = None,
    verbose: bool = False,
    **retired: Any,
) -> LimitLoad:
    """Largest multiple of the named loads that contacts and body can carry while all other loads stay, from both sides.

        max α   s.t.  equilibrium with the loads α T,   σ_N ≤ 0,   |σ_T| ≤ min(c − μσ_N, t_max) on the contacts,
                      σ within the strength of the material where it has one

    Where parts of the body have a `Material.strength`, both sides are second-order cone programs: stresses whose
    Bernstein coefficients lie in the yield cones, and velocities with jumps on the contacts. Each number is computed
    from the stresses or velocities found, not taken from the solver. Where no part has one, bodies are infinitely
    strong: `lower` is a linear program in the Airy coefficients, with the law on whole edges, and `upper` the work of
    the loads on rigid motions of the blocks, see `Mechanism`, the limit itself on any mesh.

    Every solution lies in the set above, so beyond `upper` there is none. For Coulomb's law, whose slip is not
    associated, the converse does not hold in general: below a solution may, but need not exist, which only `solve` can
    tell. Displacements, gaps and elastic constants do not enter, and bilateral contacts with friction count as able to
    carry any shear up to their cap.

    Parameters
    ----------
    problem : ContactProblem
        The problem.
    loads : sequence of str
        Names of the loads to multiply: of `Traction` conditions, of contacts whose `RigidPlate` prescribes forces, or
        "body" for the body force, or names of `BodyForces`.
    time_limit : float, optional
        Seconds for the linear programs, at most 300 for each of them in any case.
    degree : int, optional
        Degree of the element, see `discretize`.
    verbose : bool
        Print what is asked for, and both sides with the time.
    **retired
        Nothing: unknown arguments, and those of version 0.1, are refused with what to do instead. Contact laws hold on
        whole edges always.

    Returns
    -------
    LimitLoad
        Both sides.

    Raises
    ------
    InputError
        If a name is unknown, or the loads are out of balance.
    SolveError
        If a linear program is not solved, that of the mesh to a relative accuracy of 1e-7, or not in time.

    """
    refuse_arguments(retired, (*OPTIONS, "verbose"))
    with deadline(time_limit), Log(f"qvi_contact {__version__}: limit_load_factor", verbose, {}) as log:
        posed = LimitProblem.of(problem, checked_loads(problem, loads), degree)
        log.begin({"loads": ", ".join(posed.names), "unknowns": posed.low.qvi.n})
        limit = posed.limit
        gap = limit.bound - posed.carried.factor
        agree = problem.yields or gap <= CERTIFIED * (1.0 + abs(limit))
        if np.isfinite(limit.lower) and not (agree and limit.violation <= CERTIFIED):
            raise SolveError(
                f"limit load: factor {limit.lower:.9g} and bound {limit.bound:.9g} do not agree (violation "
                f"{limit.violation:.1e}): use a coarser or less graded mesh"
            )
        sides = f"this mesh carries {limit.lower:.9g} times the loads, no stress more than {limit.upper:.9g} times"
        log.end("solved", sides, {}, solved=True)
    return limit


@dataclass(frozen=True, eq=False)
class LimitProblem:
    """A limit analysis on one mesh: the problem with the named loads times 1 and times 2."""

    problem: ContactProblem  # the problem
    names: tuple[str, ...]  # the loads that are multiplied
    low: Discretization  # the problem at both factors, in the same units and degrees of freedom
    high: Discretization

    @classmethod
    def of(cls, problem: ContactProblem, names: tuple[str, ...], degree: int | None = None) -> LimitProblem:
        """The analysis of checked loads. Contact laws hold on whole edges."""
        multiples = [multiplied(problem, names, factor) for factor in _SAMPLES]
        scales = Scales.of(multiples[1])
        low = discretize(multiples[0], degree=degree, law_on="edges", scales=scales)
        return cls(problem, names, low, low.with_data(multiples[1], scales))

    @property
    def stresses(self) -> StressProgram:
        """The program from below."""
        return StressProgram(self.low, self.high)

    @cached_property
    def flows(self) -> list[FlowProgram]:
        """Programs from above of a body that yields: one that leaves alone what is far stronger, and that of all."""
        every = YieldCones.of(self.problem, self.low.space.element.traction_degree, above=True)
        loads = np.inf if every.limit.all() else self.carried.loads * self.low.scales.stress
        near = replace(every, least=min(every.least, loads))  # no tension has no size, loads have
        several = [near.nearer(), every] if every.most > APART * near.least else [every]
        return [FlowProgram(self.problem, self.names, cones, self.low.scales) for cones in several]

    def _flow(self, *, known: bool) -> tuple[Flow, FlowProgram]:
        """The flow with the least bound, and its program; that of all only if what is far stronger may help."""
        *nearer, every = self.flows
        doubted = self.carried.factor == -np.inf  # the mesh carries no multiple: perhaps no stress does
        found = list[tuple[Flow, FlowProgram]]()
        for program in nearer:
            with suppress(SolveError):  # that of all says why
                found.append((program.solved(known=True, doubted=doubted), program))
        cones, stress = every.cones, self.carried.stress
        spared = stress is not None and float(np.abs(stress).max()) * self.low.scales.stress < _SPARED * cones.least
        spared &= cones.most > _FAR * cones.least
        if any(flow.bound == -np.inf or (spared and flow.bound < np.inf) for flow, _ in found):
            return found[0]
        known |= any(flow.bound < np.inf for flow, _ in found)
        return min([*found, (every.solved(known=known, doubted=doubted), every)], key=lambda each: each[0].bound)

    @cached_property
    def of_blocks(self) -> tuple[float, Mechanism | None]:
        """The upper bound of rigid blocks."""
        return upper_bound(self.problem, self.names)

    @cached_property
    def carried(self) -> Carried:
        """What carries the lower bound."""
        if self.of_blocks[0] == -np.inf:  # what no stress carries no mesh does, although rounding may hide it
            return Carried(-np.inf, bound=-np.inf)
        return self.stresses.carried() if self.problem.yields else self.stresses.carried_by_contacts()

    @cached_property
    def limit(self) -> LimitLoad:
        """Both sides. Rigid blocks are one way in which a body gives way; where it yields others may be easier."""
        carried, low, (of_blocks, mechanism) = self.carried, self.low, self.of_blocks
        straight, collapse = not self.problem.mesh.curved.any(), None
        if of_blocks == -np.inf or not self.problem.yields:
            lower = _checked(carried, of_blocks, straight)
            return LimitLoad(lower, of_blocks, mechanism, carried.bound, carried.violation)
        flow, program = self._flow(known=of_blocks < np.inf or carried.factor == np.inf)
        upper = min(flow.bound, of_blocks)
        lower = _checked(carried, upper, straight)
        if np.isfinite(lower) and carried.stress is not None and flow.motion is not None:
            missed = coefficients_of(self.problem, low.space.element.traction_degree, self.problem.body_potential)[1]
            parts, stress = program.gap_in_cells(low, carried, flow.motion), carried.stress * low.scales.stress
            collapse = Collapse(flow.motion, stress, parts, straight and missed <= _FOLLOWED)
        violation, of_blocks_only = max(carried.violation, flow.violation), of_blocks <= flow.bound
        return LimitLoad(lower, upper, mechanism if of_blocks_only else None, upper, violation, collapse)


@dataclass(frozen=True, eq=False)
class Collapse:
    """How a body that yields gives way at its limit load."""

    motion: BodyMotion
    """The velocities that prove `LimitLoad.upper` where no rigid blocks do, and what they dissipate."""
    stress: FloatArray
    """(cells, 3, count, 3): Bernstein coefficients of (σ_xx, σ_yy, σ_xy) at `LimitLoad.lower` on the three parts of
    each triangle [stress]."""
    gap: FloatArray
    """(cells,): Parts of upper − lower, none of them negative; those of contact edges are shared by the triangles
    beside them."""
    guaranteed: bool
    """Whether both numbers are bounds: sides are straight, and the body force is a polynomial that stresses follow."""


def _checked(carried: Carried, upper: float, straight: bool) -> float:
    """The lower side: the upper one if only rounding takes it beyond. `SolveError` if more does on straight sides."""
    lower = carried.factor
    if upper < lower <= upper + _MET * (1.0 + abs(upper)) + WIDER * carried.farthest:
        return upper
    if lower > upper and carried.violation > ROUNDING:
        return -np.inf  # what keeps limits but for rounding is nothing beside a motion
    if straight and lower > upper:
        raise SolveError(
            f"limit load: stresses that carry {lower:.9g} times the loads contradict a motion at {upper:.9g}: use "
            "another degree, or a mesh that is less graded"
        )
    return lower


def loads_of(problem: ContactProblem) -> list[str]:
    """The names of loads that can be multiplied."""
    known = list(dict.fromkeys([BODY, *problem.body_forces]))
    known += [condition.name for condition in problem.conditions if isinstance(condition, Traction)]
    known += [contact.name for contact in problem.contacts if contact.plate is not None and contact.plate.driven]
    return list(dict.fromkeys(known))


def checked_loads(problem: ContactProblem, loads: Sequence[str], field: str = "loads") -> tuple[str, ...]:
    """The names of loads that can be multiplied; `InputError` lists those there are."""
    instance_of(ContactProblem, "problem", problem)
    named = names_among(field, loads, "loads", loads_of(problem))
    if BODY in named:  # all body forces
        named += tuple(problem.body_forces)
    return tuple(dict.fromkeys(named))


def multiplied(problem: ContactProblem, names: Sequence[str], factor: float) -> ContactProblem:
    """The problem with the named loads times a factor."""

    def scaled(condition: Condition) -> Any:
        """A named traction, a named plate's forces, or what fluids press with, times the factor."""
        if isinstance(condition, Contact) and FLUID in names:
            condition = _with_times(condition, ["pore_pressure"], factor)
        if isinstance(condition, Traction) and condition.name in names:
            return _with_times(condition, components(condition), factor)
        if isinstance(condition, Contact) and condition.name in names and condition.plate is not None:
            return replace(condition, plate=_with_times(condition.plate, DRIVES, factor))
        return condition

    parts = {name: times(part, factor) if {name, BODY} & {*names} else part
             for name, part in problem.body_forces.items()}  # fmt: skip
    potential = BodyForces(parts) if isinstance(problem.body_potential, BodyForces) else parts[BODY]
    return replace(problem, conditions=[scaled(each) for each in problem.conditions], body_potential=potential)


def _with_times(owner: Any, names: Iterable[str], factor: float) -> Any:
    """A condition or a strength with those of these fields that are given times the factor."""
    given = {name: getattr(owner, name) for name in names}
    return replace(owner, **{name: times(value, factor) for name, value in given.items() if value is not None})


@dataclass(frozen=True)
class StrengthReduction:
    """Both sides of the factor of safety on strength."""

    lower: float
    """Strengths divided by this carry the loads: stresses of the mesh show it. Zero if no factor was found."""
    upper: float
    """Strengths divided by this do not, on any mesh: a mechanism or a flow shows it. Infinity if no factor was
    found."""
    in_time: bool = True
    """Whether the searches ended within the time limit. If not, both bounds hold all the same."""


def strength_reduction_factor(
    problem: ContactProblem,
    *,
    of: Sequence[str] | None = None,
    accuracy: float = 1e-3,
    degree: int | None = None,
    time_limit: float | None = None,
    **retired: Any,
) -> StrengthReduction:
    """The factor by which strengths may be divided until the loads are just carried, from both sides.

        μ/F,   c/F,   t_max/F   on contacts,       tan φ/F,   c/F   and other strengths of bodies

    Flow and slip are associated, as in `limit_load_factor`.

    Parameters
    ----------
    problem : ContactProblem
        The problem, with all its loads.
    of : sequence of str, optional
        What is divided: names of contacts, of regions, and "body" for the body's own material. By default everything.
    accuracy : float
        Relative width at which the searches for both sides end, below 1.
    degree, time_limit, **retired
        As for `limit_load_factor`. At the time limit the searches end with the bounds that they have.

    Raises
    ------
    InputError
        If a name is unknown, or the accuracy is out of range.
    SolveError
        If a program is not solved, or not even the first one in time.

    """
    refuse_arguments(retired, ("of", "accuracy", *OPTIONS))
    instance_of(ContactProblem, "problem", problem)
    if not positive_number("accuracy", accuracy) < 1.0:
        raise InputError("accuracy", accuracy, "give a relative width below 1, such as 1e-3")
    weak = [contact.name for contact in problem.contacts if contact.law != "tied"]
    weak += [BODY, *(region.name for region in problem.regions if region.name is not None)]
    chosen = frozenset(weak if of is None else names_among("of", of, "contacts and regions", weak))
    names = (*loads_of(problem), FLUID)

    known: dict[float, tuple[float, float]] = {}  # by logarithms of factors

    def spare(u: float, side: int) -> float:
        """The logarithm of the share of the loads that is carried with strengths over e^u, and never zero."""
        if u not in known:
            if known and deadline.over:  # or each program of one more factor would take its least time
                raise SolveError("limit load: the time limit was reached")
            limit = LimitProblem.of(_reduced(problem, chosen, math.exp(u)), names, degree).limit
            known[u] = limit.lower, limit.upper
        share = known[u][side]
        return max(math.log(min(share, _MOST)), _LEAST) if share >= 1.0 else math.log(max(share, 1.0 / _MOST))

    def ends(side: int) -> tuple[float, float]:
        """The largest u with which the loads are known to be carried, and the least with which they are not."""
        carried = {u: spare(u, side) > 0.0 for u in known}
        holds = max((u for u, enough in carried.items() if enough), default=-math.inf)
        return holds, min((u for u, enough in carried.items() if not enough), default=math.inf)

    with deadline(time_limit):
        carried, fallen = (_searched(spare, ends, side, math.log1p(accuracy)) for side in (0, 1))
        return StrengthReduction(math.exp(carried[0]), math.exp(fallen[1]), not deadline.over)


def _searched(
    spare: Callable[[float, int], float], ends: Callable[[int], tuple[float, float]], side: int, width: float
) -> tuple[float, float]:
    """The `ends` of a side where they are this near to each other, or as near as they can be told apart."""
    from scipy.optimize import brentq  # slow to import, and solves do not need it

    spare(0.0, side)
    try:
        while math.isinf((span := ends(side))[1] - span[0]):
            u = span[0] + _STEP if math.isfinite(span[0]) else span[1] - _STEP
            if abs(u) > _FARTHEST:
                return span
            spare(u, side)
        brentq(spare, *span, args=(side,), xtol=width)
    except SolveError:  # rounding decides where loads are all but at the limit, or far below: what is known is right
        holds, falls = ends(side)
        far_below = math.isfinite(holds) and math.isinf(falls)
        if falls - holds > _CLOSE and not (far_below or deadline.over):
            raise
    return ends(side)


def _reduced(problem: ContactProblem, chosen: frozenset[str], factor: float) -> ContactProblem:
    """The problem with strengths of what is chosen over the factor; regions without a name count as the body."""

    def flatter(angle: Any) -> Any:
        """The angle with a tangent that is less."""
        return np.arctan(np.tan(angle) / factor)

    def weakened(material: Material) -> Material:
        law = material.strength
        if law is None:
            return material
        weaker = _with_times(law, (each.name for each in fields(law) if each.name != "phi"), 1.0 / factor)
        if isinstance(law, MohrCoulomb):
            phi = law.phi
            weaker = replace(weaker, phi=(lambda x, y: flatter(phi(x, y))) if callable(phi) else float(flatter(phi)))
        return replace(material, strength=weaker)

    regions = [
        replace(region, material=weakened(region.material)) if (region.name or BODY) in chosen else region
        for region in problem.regions
    ]
    material = weakened(problem.material) if BODY in chosen else problem.material
    weaker = replace(problem, material=material, regions=regions)
    return with_contacts(
        weaker, lambda each: _with_times(each, SHEAR_LAW, 1.0 / factor) if each.name in chosen else each
    )
