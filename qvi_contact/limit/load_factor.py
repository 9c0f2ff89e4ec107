"""Limit analysis: the largest multiple of a load that contacts and bodies that yield can carry, from both sides."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from qvi_contact import __version__
from qvi_contact.basics.checks import FloatArray, acts, instance_of, names_among, positive_number
from qvi_contact.basics.schema import WithFields
from qvi_contact.discretization.discretization import Discretization, discretize
from qvi_contact.discretization.scaling import Scales
from qvi_contact.errors import InputError, SolveError, refuse_arguments
from qvi_contact.limit.conic import APART, LATE, ROUNDING
from qvi_contact.limit.flow import BodyMotion, Flow, FlowProgram, slipping_supports
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

OPTIONS: Final = ("degree", "time_limit")  # options of every limit analysis
_SAMPLES = (1.0, 2.0)  # load factors at which the problem is discretized; its data are affine in the factor
_FOLLOWED = 1e-9  # relative misfit of a body force up to which stresses follow it exactly
_MET: Final = 1e-5  # of 1 + |upper|: a lower side above the upper one by less is rounding, of small loads
_NO_FLOW: Final = (
    "no velocities of this mesh give an upper bound, as where a flow that increases its volume meets a held edge: "
    "there may be one. Put a contact in place of that edge, with friction tan(phi) and cohesion c of the material"
)
_FARTHEST: Final = math.log(1e4)  # larger factors of strength count as infinite, below the inverse as zero
_STEP: Final = math.log(2.0)  # between the factors of strength that are tried first
_MOST: Final = 1e6  # load factors above this or below its inverse count as this or its inverse
_LEAST: Final = 1e-15  # least logarithm of a load factor ≥ 1, so that a search never meets zero
_CLOSE: Final = 1e-6  # logarithm of the factor's width at which a search may end without the accuracy asked for


@dataclass(eq=False, repr=False)
class LimitLoad(float, WithFields):
    """Result of a limit analysis: `lower`, the load factor that the mesh carries, as a number with further fields.

    Where stresses of the mesh cannot follow prescribed tractions point by point, `lower` belongs to tractions with the
    same resultants on every edge.
    """

    lower: float
    """The largest multiple that stresses of the mesh carry within contact laws and strengths; the value of the number
    itself. Infinity if every multiple is carried, minus infinity if no multiple is."""
    upper: float
    """No stress of the body carries a larger multiple, on any mesh. Infinity if the loads can grow without limit, that
    is, if their work on mechanisms is below 1e-7 of their work on other motions; −∞ if no multiple is carried."""
    mechanism: Mechanism | None
    """The motion of rigid blocks that proves `upper`; None if `upper` is infinite or proved by flow."""
    bound: float
    """This mesh carries no larger multiple, by the multipliers found. On bilateral contacts with friction
    it holds for the signs of σ_N at `lower` only."""
    violation: float
    """Largest violation of the contact laws and strengths at `lower`, relative to the largest limit of tractions, on
    parts stronger than 1e2 times the least strength relative to their own."""
    collapse: Collapse | None = None
    """The collapse of a body that yields; None if no part of it has a strength, or if a side is not finite."""
    in_time: bool = True
    """Whether both sides ended within the time limit."""
    missing: str = ""
    """Why a side was not found, which is then infinite, or that of rigid blocks alone; empty if both were found."""
    guaranteed: bool = True
    """Whether the sides are bounds, not estimates: stresses follow the body force exactly, sides of bodies that yield
    are straight, or only rigid blocks bound the factor."""

    def __new__(cls, lower: float, *_: object, **__: object) -> LimitLoad:
        """The number `lower`, to which the fields are added."""
        return super().__new__(cls, lower + 0.0)

    def __post_init__(self) -> None:
        self.lower, self.upper = self.lower + 0.0, self.upper + 0.0  # zero has no sign

    def to_frame(self) -> DataFrame:
        """One row as a pandas table: "lower", "upper", "bound", "violation", "slides" and "opens".

        The last two are names of contacts of the mechanism, joined by ", ". `InputError` without pandas (``frame``).
        """
        motions = {} if self.mechanism is None else self.mechanism.contacts
        numbers = {name: [getattr(self, name)] for name in ("lower", "upper", "bound", "violation")}
        slides = ", ".join(name for name, motion in motions.items() if motion.slides)
        opens = ", ".join(name for name, motion in motions.items() if motion.opens)
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
    **unknown: Any,
) -> LimitLoad:
    """Largest multiple of the named loads that contacts and body can carry while all other loads stay, from both sides.

        max α   s.t.  equilibrium with the loads α T,   σ_N ≤ 0,   |σ_T| ≤ min(c − μσ_N, t_max) on the contacts,
                      σ within the strength of the material where it has one

    Where parts of the body have a `Material.strength`, both sides are second-order cone programs. From below, the
    Bernstein coefficients of stresses lie in the yield cones; from above, velocities may jump on the contacts. Each
    number is computed from the stresses or velocities found, not taken from the solver. Without any strength, bodies
    are infinitely strong: `lower` is a linear program in the Airy coefficients, with the contact law on whole edges,
    and `upper` comes from the work of the loads on rigid motions of the blocks, see `Mechanism`: the exact limit.

    No solution carries more than `upper`. Below the limit a solution need not exist for Coulomb's law, whose slip is
    not associated: only `solve` can tell. Displacements, gaps and elastic constants do not enter. Bilateral contacts
    with friction count as able to carry any shear up to their cap.

    Parameters
    ----------
    problem : ContactProblem
        The problem.
    loads : sequence of str
        Names of the loads to multiply: of `Traction` conditions, of contacts whose `RigidPlate` prescribes forces, or
        "body" for the body force, or names of `BodyForces`.
    time_limit : float, optional
        Seconds for all programs together; a linear program has at most 300.
    degree : int, optional
        Degree of the element, see `discretize`.
    verbose : bool
        Print the loads, and both sides with the time.
    **unknown
        Unknown arguments: an `InputError` names the known ones.

    Returns
    -------
    LimitLoad
        Both sides.

    Raises
    ------
    InputError
        If a name is unknown, or the loads are out of balance.
    SolveError
        If the program from below is not solved, a linear one to a relative accuracy of 1e-7, or no side is found.

    """
    refuse_arguments(unknown, (*OPTIONS, "verbose"))
    with deadline(time_limit), Log(f"qvi_contact {__version__}: limit_load_factor", verbose, {}) as log:
        analysis = LimitProblem.of(problem, checked_loads(problem, loads), degree)
        log.begin({"loads": ", ".join(analysis.names), "unknowns": analysis.low.qvi.n})
        limit = analysis.limit
        is_bounded = problem.yields or limit.bound - limit.lower <= CERTIFIED * (1.0 + abs(limit))
        if np.isfinite(limit.lower) and not (is_bounded and limit.violation <= CERTIFIED):
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
        """The analysis of checked loads, with contact laws on whole edges."""
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
        """Programs from above of a body that yields: the full one last, before it one with very strong parts rigid."""
        all_cones = YieldCones.of(self.problem, self.low.space.element.traction_degree, above=True)
        loads = np.inf if all_cones.limit.all() else self.low.scales.stress
        near = replace(all_cones, least=min(all_cones.least, loads))  # a strength of 0 has no size, the loads have one
        cone_sets = [near.nearer(), all_cones] if all_cones.most > APART * near.least else [all_cones]
        return [FlowProgram(self.problem, self.names, cones, self.low.scales) for cones in cone_sets]

    def _programs(self) -> Iterator[FlowProgram]:
        """The programs to be tried in turn: `flows`, then, for finite loads, the full one with slip on held edges."""
        yield from self.flows
        problem = slipping_supports(self.problem)
        if problem is not self.problem and self.carried.factor < np.inf:
            cones = YieldCones.of(problem, self.low.space.element.traction_degree, above=True)
            yield FlowProgram(problem, self.names, cones, self.low.scales)

    def _flow(self) -> tuple[Flow, FlowProgram]:
        """The flow with the least bound, and its program; an infinite bound with the reason if programs fail."""
        doubted = self.carried.factor == -np.inf  # the mesh carries no multiple, so perhaps no stress does
        found = list[tuple[Flow, FlowProgram]]()
        for program in self._programs():
            try:
                found.append((program.solved(doubted=doubted), program))
            except SolveError as error:
                found.append((Flow(np.inf, missing=str(error)), program))
            least = min(flow.bound for flow, _ in found)
            if least == -np.inf or (least < np.inf and program not in self.flows[:-1]):
                break
        # of equal bounds the last; of infinite ones that with a reason, as a program that failed leaves the side open
        return min(reversed(found), key=lambda each: (each[0].bound, not each[0].missing))

    @cached_property
    def of_blocks(self) -> tuple[float, Mechanism | None]:
        """The upper bound by motions of rigid blocks, and the mechanism."""
        return upper_bound(self.problem, self.names)

    @cached_property
    def carried(self) -> Carried:
        """The stresses that carry the lower bound."""
        if self.of_blocks[0] == -np.inf:  # no stress carries the loads, so this mesh does not, which rounding may hide
            return Carried(-np.inf, bound=-np.inf)
        return self.stresses.carried()

    @cached_property
    def limit(self) -> LimitLoad:
        """Both sides. The upper side of a body that yields is the smaller bound of flow and of rigid blocks.

        A side that is not found, in time or at all, is infinite; `SolveError` if neither is found.
        """
        low, (of_blocks, mechanism) = self.low, self.of_blocks
        is_straight, collapse, missing = not self.problem.mesh.curved.any(), None, ""
        try:
            carried = self.carried
        except SolveError:
            if not deadline.over or of_blocks == np.inf:
                raise
            return LimitLoad(-np.inf, of_blocks, mechanism, of_blocks, 0.0, in_time=False, missing=LATE)
        if of_blocks == -np.inf or not self.problem.yields:
            lower = _checked(carried, of_blocks, is_straight)
            return LimitLoad(lower, of_blocks, mechanism, carried.bound, carried.violation)
        flow, program = self._flow()
        upper, by_blocks = min(flow.bound, of_blocks), of_blocks <= flow.bound
        if carried.factor < np.inf and (upper == np.inf or deadline.over):  # else both sides are found
            missing = flow.missing
        if upper == np.inf == -carried.factor and missing:
            raise SolveError(missing)
        if upper == np.inf > carried.factor > -np.inf:
            missing = missing or _NO_FLOW
        lower = _checked(carried, upper, is_straight)
        if np.isfinite(lower) and carried.stress is not None and flow.motion is not None:
            gaps, stress = program.gap_in_cells(low, carried, flow.motion), carried.stress * low.scales.stress
            collapse = Collapse(flow.motion, stress, gaps)
        misfit = coefficients_of(self.problem, low.space.element.traction_degree, self.problem.body_potential)[1]
        is_guaranteed = (is_straight and misfit <= _FOLLOWED) or (by_blocks and lower == -np.inf)
        return LimitLoad(
            lower, upper, mechanism if by_blocks else None, upper, max(carried.violation, flow.violation), collapse,
            not (missing and deadline.over), missing, is_guaranteed,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Collapse:
    """The collapse of a body that yields at its limit load."""

    motion: BodyMotion
    """The velocities that prove `LimitLoad.upper` if rigid blocks do not, and their dissipation."""
    stress: FloatArray
    """(cells, 3, count, 3): coefficients of (σ_xx, σ_yy, σ_xy) at `lower` on the parts of each triangle [stress]."""
    gap: FloatArray
    """(cells,): the parts of upper − lower by (D38), ≥ 0; the part of a contact edge is shared by its triangles."""


def _checked(carried: Carried, upper: float, straight: bool) -> float:
    """The lower side; the upper one if that is less by rounding. −∞, or `SolveError`, if they contradict each other."""
    lower = carried.factor
    if upper < lower <= upper + _MET * (1.0 + abs(upper)) + WIDER * carried.farthest:
        return upper
    if lower > upper and carried.violation > ROUNDING:
        return -np.inf  # stresses that break limits, if only by rounding, do not contradict a motion
    if straight and lower > upper:
        raise SolveError(
            f"limit load: stresses that carry {lower:.9g} times the loads contradict a motion at {upper:.9g}: use "
            "another degree, or a mesh that is less graded"
        )
    return lower


def loads_of(problem: ContactProblem) -> list[str]:
    """The names of the loads that can be multiplied."""
    forces = problem.body_forces
    names = [BODY, *forces] if any(map(acts, forces.values())) else []
    names += [condition.name for condition in problem.conditions if isinstance(condition, Traction)]
    names += [contact.name for contact in problem.contacts if contact.plate is not None and contact.plate.driven]
    return list(dict.fromkeys(names))


def checked_loads(problem: ContactProblem, loads: Sequence[str], field: str = "loads") -> tuple[str, ...]:
    """The named loads, if they can be multiplied; else an `InputError` that lists the loads of the problem."""
    instance_of(ContactProblem, "problem", problem)
    names = names_among(field, loads, "loads", loads_of(problem))
    if BODY in names:  # all body forces
        names += tuple(problem.body_forces)
    return tuple(dict.fromkeys(names))


def multiplied(problem: ContactProblem, names: Sequence[str], factor: float) -> ContactProblem:
    """The problem with the named loads times a factor."""

    def scaled(condition: Condition) -> Any:
        """The condition with a named traction, a named plate's forces, or the pressure of fluids times the factor."""
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
    """A condition or a strength with the given ones of its named fields times the factor."""
    values = {name: getattr(owner, name) for name in names}
    return replace(owner, **{name: times(value, factor) for name, value in values.items() if value is not None})


@dataclass(frozen=True)
class StrengthReduction(WithFields):
    """Both sides of the factor of safety on strength."""

    lower: float
    """Strengths divided by this carry the loads, as stresses of the mesh show. Zero if no factor was found."""
    upper: float
    """Strengths divided by this do not on any mesh, as a mechanism or a flow shows. Infinity if no factor was found."""
    in_time: bool = True
    """Whether the searches ended within the time limit. If not, both bounds hold all the same."""
    guaranteed: bool = True
    """Whether the sides are bounds, not estimates, as in `LimitLoad`."""


def strength_reduction_factor(
    problem: ContactProblem,
    *,
    of: Sequence[str] | None = None,
    accuracy: float = 1e-3,
    degree: int | None = None,
    time_limit: float | None = None,
    verbose: bool = False,
    **unknown: Any,
) -> StrengthReduction:
    """The factor by which strengths may be divided until the loads are just carried, from both sides.

        μ/F,   c/F,   t_max/F   on contacts,       tan φ/F,   c/F   and other strengths of bodies

    Flow and slip are associated, as in `limit_load_factor`.

    Parameters
    ----------
    problem : ContactProblem
        The problem, with all its loads.
    of : sequence of str, optional
        Contacts and regions whose strengths are divided, "body" for the body's own material; all by default.
    accuracy : float
        Relative width at which the searches for both sides end, below 1.
    degree, time_limit, verbose, **unknown
        As for `limit_load_factor`; `verbose` prints both limits at each factor. At the time limit the searches end with
        the bounds that they have.

    Raises
    ------
    InputError
        If a name is unknown, or the accuracy is out of range.
    SolveError
        If a program is not solved, or not even the first one in time.

    """
    refuse_arguments(unknown, ("of", "accuracy", "verbose", *OPTIONS))
    instance_of(ContactProblem, "problem", problem)
    if not positive_number("accuracy", accuracy) < 1.0:
        raise InputError("accuracy", accuracy, "give a relative width below 1, such as 1e-3")
    with_strength = [contact.name for contact in problem.contacts if contact.law != "tied"]
    with_strength += [BODY, *(region.name for region in problem.regions if region.name is not None)]
    chosen = frozenset(with_strength if of is None else names_among("of", of, "contacts and regions", with_strength))
    all_loads = (*loads_of(problem), FLUID)

    limits: dict[float, LimitLoad] = {}  # by logarithms of factors

    def spare(u: float, side: int) -> float:
        """The logarithm of the load factor with strengths over e^u; positive if the loads are carried."""
        if u not in limits:
            if limits and deadline.over:  # else each program of one more factor would take its least time
                raise SolveError(LATE)
            limits[u] = LimitProblem.of(_reduced(problem, chosen, math.exp(u)), all_loads, degree).limit
            log.line(math.exp(u), limits[u].lower, limits[u].upper)
        share = (limits[u].lower, limits[u].upper)[side]
        return max(math.log(min(share, _MOST)), _LEAST) if share >= 1.0 else math.log(max(share, 1.0 / _MOST))

    def ends(side: int) -> tuple[float, float]:
        """The largest u at which the loads are known to be carried, and the smallest u at which they are not."""
        is_carried = {u: spare(u, side) > 0.0 for u in limits}
        largest = max((u for u, carried in is_carried.items() if carried), default=-math.inf)
        return largest, min((u for u, carried in is_carried.items() if not carried), default=math.inf)

    columns = {"divided by": ">12.6g", "lower limit": ">12.6g", "upper limit": ">12.6g"}
    title = f"qvi_contact {__version__}: strength_reduction_factor"
    with deadline(time_limit), Log(title, verbose, columns, iterations=False) as log:
        log.begin({"strengths": ", ".join(sorted(chosen)), "accuracy": accuracy})
        carried, fallen = (_searched(spare, ends, side, math.log1p(accuracy)) for side in (0, 1))
        guaranteed = all(limits[u].guaranteed for u in (carried[0], fallen[1]) if u in limits)
        factor = StrengthReduction(math.exp(carried[0]), math.exp(fallen[1]), not deadline.over, guaranteed)
        if factor.lower == 0.0 and factor.upper == math.inf and not factor.in_time:
            raise SolveError(LATE)
        log.end("solved", f"carried up to {factor.lower:.6g}, not beyond {factor.upper:.6g}", {}, solved=True)
        return factor


def _searched(
    spare: Callable[[float, int], float], ends: Callable[[int], tuple[float, float]], side: int, width: float
) -> tuple[float, float]:
    """The `ends` of a side once they are nearer than `width`, or as near as rounding lets them be told apart."""
    from scipy.optimize import brentq  # slow to import, and solves do not need it

    spare(0.0, side)
    try:
        while math.isinf((span := ends(side))[1] - span[0]):
            u = span[0] + _STEP if math.isfinite(span[0]) else span[1] - _STEP
            if abs(u) > _FARTHEST:
                return span
            spare(u, side)
        brentq(spare, *span, args=(side,), xtol=width)
    except SolveError:  # rounding decides near the limit or far below it: the factors found so far are right
        carried, fallen = ends(side)
        is_far_below = math.isfinite(carried) and math.isinf(fallen)
        if fallen - carried > _CLOSE and not (is_far_below or deadline.over):
            raise
    return ends(side)


def _reduced(problem: ContactProblem, chosen: frozenset[str], factor: float) -> ContactProblem:
    """The problem with the chosen strengths divided by a factor; regions without a name count as the body."""

    def flatter(angle: Any) -> Any:
        """The angle whose tangent is smaller by the factor."""
        return np.arctan(np.tan(angle) / factor)

    def weakened(material: Material) -> Material:
        law = material.strength
        if law is None:
            return material
        reduced = _with_times(law, (each.name for each in fields(law) if each.name != "phi"), 1.0 / factor)
        if isinstance(law, MohrCoulomb):
            phi = law.phi
            reduced = replace(reduced, phi=(lambda x, y: flatter(phi(x, y))) if callable(phi) else float(flatter(phi)))
        return replace(material, strength=reduced)

    regions = [
        replace(region, material=weakened(region.material)) if (region.name or BODY) in chosen else region
        for region in problem.regions
    ]
    material = weakened(problem.material) if BODY in chosen else problem.material
    reduced = replace(problem, material=material, regions=regions)
    return with_contacts(
        reduced, lambda each: _with_times(each, SHEAR_LAW, 1.0 / factor) if each.name in chosen else each
    )
