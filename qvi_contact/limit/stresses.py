"""Limit loads from below: stresses in equilibrium whose Bernstein coefficients lie in the yield cones.

The program is (D36). Its unknowns are z, the functions y inside a triangle, and the load factor α. Contact laws hold on
whole edges, (D24). A strength a that is affine over a part of a triangle counts from below with its own coefficients.
From above it counts with its means ∫ a B_i/∫ B_i, since ∫ a |ε| ≤ Σ |ε_i| ∫ a B_i. Any other strength counts with its
least value from below and its largest from above, as far as samples show them.

The friction bound of a bilateral contact grows with |σ_N|. So one sign of σ_N is chosen on each edge, or no sign, and
then friction does not count. Where no body yields, only contacts limit tractions, and the program is linear.

In `docs/theory.md`: (D24), (D36), (D41).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import chain, product
from typing import Any, Final, TypeAlias

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, evaluate
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import ContactRows, joined
from qvi_contact.element.triangle import exponents
from qvi_contact.errors import InputError, SolveError
from qvi_contact.limit.check_proof import quotient
from qvi_contact.limit.conic import APART, HELD, LATE, ROUNDING, UNBOUNDED, Answer, ConicProgram, beside
from qvi_contact.limit.conic import INFEASIBLE as NO_ANSWER
from qvi_contact.limit.split import SAMPLES, coefficients_of, lattice, nodes_along, part_corners, sampled
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import SHEAR_LAW, Contact, Traction
from qvi_contact.problem.material import Material, MohrCoulomb, YieldCone
from qvi_contact.problem.problem import ContactProblem
from solvers.basics.progress import deadline
from solvers.inner.linear_program import INFEASIBLE, TIME_LIMIT, solved
from solvers.inner.linear_program import UNBOUNDED as NO_LIMIT

_Limits: TypeAlias = tuple[YieldCone, FloatArray, FloatArray | float]

_AFFINE: Final = 1e-10  # misfit, relative to the largest value, up to which a field counts as affine
_TIGHTER: Final = 1e-8  # relative reduction of limits, so that rounding of the solver breaks no cone

PRESSURE, TENSION, EITHER, ROUGH = -1, 1, 0, 2
"""Signs of σ_N on an edge of a bilateral contact; `EITHER`: no friction counts, `ROUGH`: friction has no limit."""

ALONG: Final = np.linspace(0.0, 1.0, 33)
"""Points on an edge, 0 to 1, at which fields of contacts are evaluated."""

_DROP: Final = 0.1  # gap of the factor to its bound, relative, or price of violations, which shows that cones are rays

WIDER: Final = HELD / 4.0
"""Width of limits, relative to the size of their rows, that is nothing but rounding."""

CERTIFIED: Final = 1e-7
"""Largest accepted violation of the rows, and largest gap of the bounds relative to 1 + factor."""

_MOST: Final = 1e6  # upper bound of the factor in a second try, if the program without a bound was not solved
_FREE: Final = 1e-10  # stress across a side, relative to that of the loads, that is rounding where it should be 0
_WEAK: Final = 1e-4  # fixed loads relative to multiplied ones, or the reverse, that have their own rounding
_LOST: Final = 1e-13  # stress by an unknown, relative to that of others in the same rows, that is rounding
_TRIALS: Final = 40  # largest number of programs with different signs of bilateral pressure
_COST: Final = 1e4  # cost of the factor, which makes absolute tolerances of multipliers smaller by this factor

_AT_LIMIT: Final = (
    "limit load: the loads that are not multiplied are themselves at the limit of what this mesh carries, to within "
    "rounding: whether they are carried cannot be told. Change these loads, or the friction, by a millionth"
)


@dataclass(frozen=True, eq=False)
class Carried:
    """Stresses that a mesh carries, dimensionless."""

    factor: float  # α; infinity if there is no limit, minus infinity if no multiple is carried
    violation: float = 0.0  # largest violation of a row, relative to the size of the rows
    tractions: FloatArray | None = None  # (2 m,) rows [σ_N; σ_T] of the contacts; None if α is not finite
    bound: float = np.inf  # the dual bound of α; where bodies yield, by the solver's own multipliers
    # (2 m,) where no body yields: multipliers, moments of w and −[v]_T of the mesh's collapse, with unit work of loads
    motion: FloatArray | None = None
    unknowns: FloatArray | None = None  # (n,): (z, y, α); None if α is not finite
    # (cells, 3, count, 3) where bodies yield: coefficients of (σ_xx, σ_yy, σ_xy), with the body potential φ
    stress: FloatArray | None = None
    price: float = 0.0  # by how much violated rows may have raised α, by the solver's own multipliers
    farthest: float = 0.0  # factor at which the loads alone are as large as the rows, where bodies yield


def _is_more(factor: float, than: float, relative: float) -> bool:
    """Whether a load factor exceeds another one, of any size or infinite, by more than a relative amount."""
    return factor > (than + relative * (1.0 + abs(than)) if np.isfinite(than) else than)


def limited(discretization: Discretization) -> list[tuple[ContactRows, Contact]]:
    """Rows and conditions of the contacts that limit tractions."""
    pairs = zip(discretization.contacts, discretization.problem.contacts, strict=True)
    return [(rows, contact) for rows, contact in pairs if rows.law != "tied"]


def shear_laws(problem: ContactProblem) -> list[FloatArray]:
    """μ, c and t_max [stress] (3, e, 33) along the edges of each contact that limits tractions; without a cap ∞."""
    laws = list[FloatArray]()
    for contact in problem.contacts:
        if contact.law != "tied":
            places = problem.mesh.points_along(problem.mesh.edges(contact.edges), ALONG)
            fields = {name: getattr(contact, name) for name in SHEAR_LAW}
            laws.append(np.stack([np.full(places[0].shape, np.inf) if field is None else
                                  evaluate(f"Contact.{name}", field, *places, minimum=0.0)
                                  for name, field in fields.items()]))  # fmt: skip
    return laws


def whole_edge_rows(discretization: Discretization, signs: IntArray) -> tuple[sparse.csr_array, FloatArray]:
    """Rows H [σ_N; σ_T] ≤ limit of (D24), for the rows of N and T of (D2), dimensionless.

    The `signs` (e,) of σ_N on all contact edges count on the edges of `both_signs`.
    """
    stress, m, q = discretization.scales.stress, discretization.qvi.m, discretization.rule.count
    no_edges = np.zeros((3, 0, len(ALONG)))
    friction, cohesion, cap = np.concatenate([no_edges, *shear_laws(discretization.problem)], axis=1)
    slope, is_undecided, is_bilateral = _below(friction), both_signs(discretization), _bilateral(discretization)
    sign = np.where(is_undecided, signs, np.where(is_bilateral, EITHER, PRESSURE))
    one_sided, has_limit, capped = map(np.flatnonzero, (abs(sign) == 1, sign != ROUGH, np.isfinite(cap).all(axis=1)))
    # edges, blocks on their q rows of σ_N and of σ_T, and limits
    rise, level = _times(-sign[:, None] * slope, q)[has_limit], _times(np.ones((len(has_limit), 2)), q)
    most, held = (_affine(_below(each), degree) / stress for each, degree in ((cap[capped], q - 1), (cohesion, q)))
    pressed, whole = -sign[one_sided, None, None] * np.eye(q), np.broadcast_to(np.eye(q), (len(capped), q, q))
    groups = [(one_sided, pressed, 0.0 * pressed, np.zeros((len(one_sided), q)))]
    groups += [(has_limit, rise, way * level, held[has_limit]) for way in (1.0, -1.0)]
    groups += [(capped, 0.0 * whole, way * whole, most) for way in (1.0, -1.0)]
    blocks, limits = [sparse.csr_array((0, 2 * m))], [np.zeros(0)]
    for edges, *parts, limit in groups:
        if len(edges):
            shape, starts = (limit.size, m), np.arange(len(edges) + 1)
            sides = (sparse.bsr_array((part, edges, starts), shape=shape) for part in parts)
            blocks.append(sparse.csr_array(sparse.hstack(list(sides))))
            limits.append(limit.ravel())
    rows = sparse.csr_array(sparse.vstack(blocks))
    rows.eliminate_zeros()
    return rows, joined(limits)


def both_signs(discretization: Discretization) -> BoolArray:
    """Contact edges (e,) on which friction depends on a σ_N that may have either sign."""
    frictions = [(_below(law[0]) > 0.0).any(axis=1) for law in shear_laws(discretization.problem)]
    return np.asarray(_bilateral(discretization) & np.concatenate([np.zeros(0, dtype=bool), *frictions]))


def _bilateral(discretization: Discretization) -> BoolArray:
    """Whether the contact of each edge is bilateral (e,)."""
    laws = [np.full(len(rows.points.edges), rows.law == "bilateral") for rows, _ in limited(discretization)]
    return np.concatenate([np.zeros(0, dtype=bool), *laws])


def _times(ends: FloatArray, q: int) -> FloatArray:
    """Matrices (e, q + 1, q) that multiply polynomials of q coefficients by affine functions of end values (e, 2)."""
    k = np.arange(q + 1)[:, None]
    same_index, index_before = (q - k) * np.eye(q + 1, q), k * np.eye(q + 1, q, -1)
    return np.asarray((ends[:, :1, None] * same_index + ends[:, 1:, None] * index_before) / q)


def _affine(ends: FloatArray, degree: int) -> FloatArray:
    """Bernstein coefficients (e, degree + 1) of affine functions with end values (e, 2)."""
    return np.asarray(ends[:, :1] + np.diff(ends, axis=1) * np.linspace(0.0, 1.0, degree + 1))


def _below(values: FloatArray) -> FloatArray:
    """End values (e, 2) ≥ 0 of affine functions below values (e, 33) along edges: the lowered chord, else the least."""
    ends = values[:, [0, -1]]
    lowered = ends - np.maximum(_affine(ends, len(ALONG) - 1) - values, 0.0).max(axis=1)[:, None]
    is_nonnegative = (lowered >= 0.0).all(axis=1)[:, None]
    return np.asarray(np.where(is_nonnegative, lowered, values.min(axis=1)[:, None]))


@dataclass(frozen=True, eq=False)
class YieldCones:
    """Rows |(γ S, σ_xx − σ_yy, 2σ_xy)| ≤ a − β S on coefficients, S = σ_xx + σ_yy, for one side of the limit load.

    The cones of a friction angle that varies are in `docs/theory.md`, "Bodies that yield".
    """

    mesh: TriangleMesh
    degree: int  # k
    coefficient: IntArray  # (r,) number of the row's coefficient: ((triangle · 3) + part) · count + its number there
    first: BoolArray  # (r,) whether it is the first cone of its coefficient
    limit: FloatArray  # (r,) a [stress]; for stresses at most the true one, for dissipation at least
    pressure: FloatArray  # (r,) β
    mean: FloatArray  # (r,) γ
    strong: BoolArray  # (cells,) triangles without a strength: they carry any stress, and move as rigid bodies
    least: float  # of the strengths of materials and contacts, each by its largest value; infinity if there are none
    most: float  # the largest of these strengths

    @classmethod
    def of(cls, problem: ContactProblem, degree: int, *, above: bool) -> YieldCones:
        """The cones for stresses of a degree; with `above`, for the dissipation of flow."""
        count, number = len(exponents(degree)), problem.cell_materials
        blocks = [(np.zeros(0), np.zeros(0, dtype=bool), *np.zeros((3, 0)))]
        of_contacts = (float(values.max()) for law in shear_laws(problem) for values in law[1:])
        strengths = [each for each in of_contacts if each < np.inf]
        for index, material in enumerate(problem.materials):
            cells = np.flatnonzero(number == index)
            if material.strength is None or not len(cells):
                continue
            numbers = 3 * count * cells[:, None, None] + np.arange(3 * count).reshape(3, count)
            for rank, (cone, a, pressure) in enumerate(_limits(problem, cells, degree, material, above)):
                parts = np.broadcast_arrays(numbers, rank == 0, a, pressure, cone.mean)
                blocks.append(tuple(part.ravel() for part in parts))
                strengths.append(float(np.max(a)))
        coefficient, first, limit, pressure, mean = (np.concatenate(part) for part in zip(*blocks, strict=True))
        strong = np.array([material.strength is None for material in problem.materials])[number]
        least = min((each for each in strengths if each > 0.0), default=np.inf)
        of_rows = coefficient.astype(np.int64), first, limit, pressure, mean
        return cls(problem.mesh, degree, *of_rows, strong, least, max(strengths, default=0.0))

    def nearer(self) -> YieldCones:
        """The cones with a at most 1e2 times the least strength; parts of the body without such a cone are rigid."""
        largest = APART * self.least
        is_kept = self.limit <= largest
        is_strong = self.strong | (np.bincount(self.cell[is_kept], minlength=len(self.strong)) == 0)
        # a coefficient of a weak triangle keeps a cone, however strong
        is_kept |= ~(is_strong[self.cell] | np.isin(self.coefficient, self.coefficient[is_kept]))
        fields_kept = {name: getattr(self, name)[is_kept] for name in ("coefficient", "limit", "pressure", "mean")}
        is_first = np.isin(np.arange(is_kept.sum()), np.unique(fields_kept["coefficient"], return_index=True)[1])
        return replace(self, strong=is_strong, first=is_first, most=largest, **fields_kept)

    @property
    def count(self) -> int:
        """Coefficients on a part of a triangle."""
        return len(exponents(self.degree))

    @property
    def cell(self) -> IntArray:
        """The triangle (r,) of each row."""
        return self.coefficient // (3 * self.count)

    @cached_property
    def rays(self) -> FloatArray:
        """Directions û (r, k, 2 or 3) of u in cones (t, u) of uniaxial stress along, or strain across, an edge nearby.

        These edges are the sides of the part of the triangle, and all directions of edges that have a name.
        """
        parts = part_corners(self.mesh.corners)
        sides = (np.roll(parts, -1, axis=2) - parts).reshape(-1, 3, 2)
        named = np.concatenate([self.mesh.edges(name).tangent for name in self.mesh.edge_names])
        upright = np.where(named[:, :1] < 0.0, -named, named)
        named = named[np.unique(upright.round(9), axis=0, return_index=True)[1]]
        x, y = np.moveaxis(np.concatenate([sides, np.broadcast_to(named, (len(sides), *named.shape))], axis=1), -1, 0)
        directions = np.stack([y**2 - x**2, -2.0 * x * y, *[0.0 * x] * bool(self.mean.any())], axis=-1)
        return np.asarray(directions / (x**2 + y**2)[..., None])[self.coefficient // self.count]


def excess(problem: ContactProblem, x: FloatArray, y: FloatArray, stress: FloatArray) -> FloatArray:
    """By how much stresses exceed the strength (cells, g) [stress] at points x, y (cells, g); 0 if they do not.

    `stress` (cells, g, 3) is (σ_xx, σ_yy, σ_xy) [stress].
    """
    over = np.zeros(x.shape)
    trace, difference = stress[..., 0] + stress[..., 1], stress[..., 0] - stress[..., 1]
    for index, material in enumerate(problem.materials):
        here = problem.cell_materials == index
        for cone in _cones(material, x[here], y[here]):
            S = trace[here]
            radius = np.sqrt(difference[here] ** 2 + 4.0 * stress[here, :, 2] ** 2 + (cone.mean * S) ** 2)
            strength = evaluate(cone.name, cone.field, x[here], y[here], minimum=0.0)
            over[here] = np.maximum(over[here], (radius + cone.pressure * S) / cone.factor - strength)
    return over


def _cones(material: Material, x: FloatArray, y: FloatArray, extreme: Any = None) -> list[YieldCone]:
    """The yield cones of a material at points; `extreme`, np.min or np.max, takes that friction angle of each row."""
    strength = material.strength
    if isinstance(strength, MohrCoulomb) and callable(strength.phi):
        phi = strength.angles(x, y)
        return list(strength.cones(material.plane, extreme(phi, axis=-1, keepdims=True) if extreme else phi))
    return [] if strength is None else list(strength.cones(material.plane))


def _limits(
    problem: ContactProblem, cells: IntArray, degree: int, material: Material, above: bool
) -> Iterator[_Limits]:
    """Cones with a and β (n, 3, count): for stresses, of the least and the largest angle; for flow, one around all."""
    x, y = sampled(problem, cells)
    flattest, steepest = (_cones(material, x, y, extreme) for extreme in (np.min, np.max))
    strengths = [_on_parts(problem, cells, degree, cone) for cone in flattest]
    reach = np.full((len(cells), 3, 1), np.inf)  # the largest S, the least a/β of all cones
    for cone, (*_, most) in zip(flattest, strengths, strict=True):
        beta = np.broadcast_to(np.asarray(cone.pressure), reach.shape)
        reach = np.minimum(reach, np.divide(cone.factor * most, beta, out=np.full_like(reach, np.inf), where=beta > 0))
    for flat, steep, (carried, dissipated, _) in zip(flattest, steepest, strengths, strict=True):
        if not above:
            yield flat, flat.factor * carried, flat.pressure
            if np.ndim(flat.factor) or np.ndim(flat.pressure):
                yield flat, steep.factor * carried, steep.pressure
            continue
        slope_change = np.broadcast_to(np.asarray(steep.pressure) - np.asarray(flat.pressure), reach.shape)
        if not np.isfinite(reach[slope_change > 0.0]).all():
            remedy = "give it a tension cut-off (tension=…), or a region of their own to parts without friction"
            raise InputError("MohrCoulomb.phi", 0.0, f"is zero beside places where it is not: {remedy}")
        extra = np.multiply(reach, slope_change, out=np.zeros_like(reach), where=slope_change > 0.0)
        yield flat, np.maximum(flat.factor, steep.factor) * dissipated + extra, steep.pressure


def _on_parts(
    problem: ContactProblem, cells: IntArray, degree: int, cone: YieldCone
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The strength by coefficient (n, 3, count), for stresses and for dissipation, and its largest value (n, 3, 1)."""
    samples = lattice(SAMPLES)
    values = evaluate(cone.name, cone.field, *sampled(problem, cells), minimum=0.0)
    least, most = values.min(axis=-1, keepdims=True), values.max(axis=-1, keepdims=True)
    corners = values[..., [int(np.flatnonzero(samples[:, i] == 1.0)[0]) for i in range(3)]]
    is_affine = np.abs(values - corners @ samples.T).max(axis=-1, keepdims=True) <= _AFFINE * np.abs(values).max()
    coefficients = corners @ lattice(degree).T
    means = corners @ ((exponents(degree) + 1.0) / (degree + 3.0)).T
    return np.where(is_affine, coefficients, least), np.where(is_affine, means, most), most


@dataclass(frozen=True, eq=False)
class StressProgram:
    """The cone program (D36) of a problem, discretized at the load factors 1 and 2."""

    low: Discretization  # the problem at both factors, in the same units and degrees of freedom
    high: Discretization

    @cached_property
    def cones(self) -> YieldCones:
        """The yield cones of the body."""
        return YieldCones.of(self.low.problem, self.low.space.element.traction_degree, above=False)

    def carried(self, share: float = 0.0) -> Carried:
        """The largest factor, with stresses moved the given share of the way to a state inside all limits.

        Where no body yields, and no share is asked for, the simplex method solves the program. Else its limits are
        reduced by 1e-8, so that rounding breaks none.
        """
        of_cones = self.low.problem.yields or share > 0.0
        solve = partial(self._within_limits, share=share) if of_cones else self._by_simplex
        return self._with_signs(solve, CERTIFIED + 2.0 * share)  # the state inside may carry −α: then α falls by 2 α

    def _within_limits(self, signs: IntArray, share: float) -> Carried:
        """The answer for signs of bilateral pressure.

        Cones without room are replaced by faces that hold all stresses: first where a strength is 0, else if an answer
        is in doubt. Without room, limits that are 1e-13 wider may carry much more, or anything at all: then multipliers
        are large. So an answer is in doubt if what it violates may have raised its factor much, by its multipliers.
        """
        full, answers, trusted, failure = self.program(signs), list[Carried](), list[Carried](), SolveError(_AT_LIMIT)
        for on_faces in (False, True) if self.cones.limit.all() else (True, False):
            try:
                program = full.on_faces(self.cones.rays) if on_faces else full
                if program is None:
                    continue
                found = self._of_program(program, share)
            except SolveError as error:  # the other answer stays valid
                failure = error
                continue
            if found.unknowns is not None:  # equations of faces hold up to rounding: what counts is the full program
                held = self._held(full, found.unknowns, found.violation)
                found = replace(held, bound=found.bound, price=found.price)
            answers.append(found)
            carries, spare = found.factor > -np.inf, max(_DROP * abs(found.factor), CERTIFIED)
            if found.price <= spare and (carries or found.bound == -np.inf):
                trusted.append(found)
            is_doubtful = found.bound - found.factor + found.price > spare if carries else found.bound > -np.inf
            is_valid = found.violation <= ROUNDING  # else the other answer may be better
            if is_doubtful and is_valid and np.isfinite(found.factor) and program.falls:
                return Carried(np.inf)
            if not is_doubtful and is_valid and (carries or not on_faces):
                return found
        if not answers:
            raise failure
        # a proof on faces that nothing is carried counts more than a factor that violations may have raised much
        return max(trusted or answers, key=lambda one: one.factor - one.price)

    def _of_program(self, program: ConicProgram, share: float) -> Carried:
        """The solver's answer, corrected."""
        answer = program.solve(share=_TIGHTER)
        if answer == NO_ANSWER:  # also of limits that are wider by rounding
            with suppress(SolveError):
                if program.solve(room=-WIDER * program.size(0.0 * program.q)) == NO_ANSWER:
                    return Carried(-np.inf, bound=-np.inf)
        if isinstance(answer, Answer):
            carried = self._held(program, *program.repaired(answer.x, share))
            if carried.unknowns is not None:
                price = program.price(carried.unknowns, answer.multipliers)
                return replace(carried, bound=-answer.least, price=price)
        return self._without_room(program, share, grows=answer == UNBOUNDED)

    def _held(self, program: ConicProgram, x: FloatArray, violation: float) -> Carried:
        """The load factor of an answer x with its stresses; minus infinity if x breaks limits by more than `HELD`."""
        violation = max(violation, -float(program.margins(x).min(initial=0.0)))
        (N, n), (S, s) = self._tractions, self._stress
        tractions, stress = N @ x + n, (S @ x + s).reshape(-1, 3, self.cones.count, 3)
        size = max(program.size(x), float(np.abs(tractions).max(initial=0.0)))  # may exceed that of loads and limits
        if violation * max(1.0, size / max(1.0, program.size(0.0 * x))) > HELD:
            return Carried(-np.inf)
        farthest = program.size(x) / (float(np.abs(program.A[:, [-1]].toarray()).max(initial=0.0)) or 1.0)
        return Carried(float(x[-1]), violation, tractions, unknowns=x, stress=stress, farthest=farthest)

    def _without_room(self, program: ConicProgram, share: float, *, grows: bool) -> Carried:
        """The load itself, or infinity, where the solver gives up because stresses grow along the tips of cones.

        Growth needs a state within the limits: of the load itself, or of the least multiple that is carried. The last
        resort is no load at all, which is carried where all loads are multiplied.
        """
        for each in (program.up_to(1.0), *[replace(program, q=-program.q)] * grows):
            with suppress(SolveError):  # the next one may have an answer
                answer = each.solve()
                if isinstance(answer, Answer):
                    carried = self._held(program, *each.repaired(answer.x, share))
                    if carried.unknowns is not None:
                        price = each.price(carried.unknowns, answer.multipliers)
                        return Carried(np.inf) if grows or program.falls else replace(carried, price=price)
        if deadline.over:
            raise SolveError(LATE)
        return self._held(program, *program.repaired(np.zeros_like(program.q), share))

    def _with_signs(self, solve: Callable[[IntArray], Carried], lost: float) -> Carried:
        """The best answer over signs of bilateral pressure, at first those of programs without friction or its limit.

        Then signs of single edges are changed, in `_TRIALS` programs at most, until none can carry `lost` more.
        """
        undecided = both_signs(self.low)
        signs, most, error = np.full(len(undecided), EITHER), Carried(np.inf), None
        if not undecided.any():
            return solve(signs)
        best = Carried(-np.inf)
        try:
            best = solve(signs)
        except SolveError as failure:  # other answers stay valid
            error = failure
        with suppress(SolveError):  # its bound holds for all signs; without it they are tried
            most = solve(np.full(len(undecided), ROUGH))
        starts = [np.full(len(undecided), sign) for sign in (PRESSURE, TENSION)]
        for tractions in (each.tractions for each in (best, most) if each.tractions is not None):
            normal = tractions[: self.low.qvi.m].reshape(-1, self.low.rule.count).sum(axis=1)
            starts.append(np.where(normal > HELD * np.abs(normal).max(), TENSION, PRESSURE))  # σ_N = 0: pressure
        single_edges = list(product(np.flatnonzero(undecided), (PRESSURE, TENSION)))
        tried = {signs.tobytes()}
        while len(tried) < _TRIALS and _is_more(most.bound, best.factor, lost):
            changes = (np.where(np.arange(len(signs)) == edge, sign, signs) for edge, sign in single_edges)
            trial = next((each for each in chain(starts, changes) if each.tobytes() not in tried), None)
            if trial is None or (deadline.over and len(tried) > len(starts)):
                break
            tried.add(trial.tobytes())
            try:
                found = solve(trial)
            except SolveError as failure:
                error = failure
                continue
            if _is_more(found.factor, best.factor, CERTIFIED):
                best, signs = found, trial
        if error is not None and best.factor == -np.inf:
            raise error
        return best

    def _by_simplex(self, signs: IntArray) -> Carried:
        """The largest factor where no body yields: max α  s.t.  G z ≤ h + α h',  A z = b + α b'.

        Multipliers d ≥ 0 and ν with Gᵀd + Aᵀν = 0 give a bound: from Σ d (h + α h' − G z) ≥ 0 follows α ≤ (h·d +
        b·ν) / −(h'·d + b'·ν), with rounding added.
        """
        H, limit = whole_edge_rows(self.low, signs)
        if not len(limit):
            return Carried(np.inf)
        # rows scaled so that their largest entry, times forces, is 1: tractions grow where edges are short
        weights = joined([rows.row_weights for rows, _ in limited(self.low)])
        forces = np.tile(weights.max() / weights, 2)
        largest = abs(H @ sparse.diags_array(forces)).max(axis=1).toarray().ravel()
        H, limit = sparse.csr_array(sparse.diags_array(1.0 / largest) @ H), limit / largest
        # G x ≤ h and E x = b in (z, α), with columns of norm 1, as tolerances suppose, but for α and rounding
        (N, n), (A, b), kept = self._tractions, self._equations, np.append(np.arange(self.low.qvi.n), -1)
        unknowns, N = np.zeros(N.shape[1]), N[:, kept]
        rows, h = sparse.csr_array(H @ N), limit - H @ n
        heights, columns = (np.asarray(sparse.linalg.norm(rows, axis=axis)) for axis in (1, 0))
        row_heights = (sparse.diags_array(heights) @ abs(rows).sign()).max(axis=0).toarray().ravel()
        columns[columns <= _LOST * row_heights] = columns[-1] = 1.0
        units = sparse.diags_array(1.0 / columns)
        G, E = sparse.csc_array(rows @ units), sparse.csc_array(A[:, kept] @ units)
        cost, free = np.append(np.zeros(G.shape[1] - 1), -_COST), [(None, None)] * G.shape[1]
        equations: dict[str, Any] = {"A_eq": E, "b_eq": b} if len(b) else {}
        answer = solved(cost, A_ub=G, b_ub=h, bounds=free, **equations)
        if not (answer.solved or answer.status in (INFEASIBLE, TIME_LIMIT)):  # HiGHS may say "unbounded" by rounding
            bounded = solved(cost, A_ub=G, b_ub=h, bounds=[*free[:-1], (None, _MOST)], **equations)
            is_unbounded = bounded.solved and bounded.x[-1] >= _MOST * (1.0 - CERTIFIED)
            is_decided = bounded.solved or bounded.status in (INFEASIBLE, TIME_LIMIT)
            if answer.status == NO_LIMIT and (is_unbounded or not is_decided):
                return Carried(np.inf)
            if is_unbounded:
                raise SolveError(f"limit load: {_MOST:g} times the loads are carried, and no limit was found beyond")
            answer = bounded
        if answer.status == INFEASIBLE:  # the least t ≥ 0 with G x ≤ h + t tells infeasibility from rounding
            least, equal = (sparse.csc_array(sparse.hstack([part, sparse.csc_array(np.full((part.shape[0], 1), t))]))
                           for part, t in ((G, -1.0), (E, 0.0)))  # fmt: skip
            equations |= {"A_eq": equal} if len(b) else {}
            nearest = solved(np.append(0.0 * cost, 1.0), A_ub=least, b_ub=h, bounds=[*free, (0.0, None)], **equations)
            if nearest.solved and nearest.x[-1] > CERTIFIED * max(1.0, float(np.abs(h).max())):
                return Carried(-np.inf, bound=-np.inf)
            raise SolveError(_AT_LIMIT)
        if answer.status == TIME_LIMIT:
            raise SolveError(LATE)
        if not answer.solved:
            raise SolveError(f"limit load: the linear program was not solved, use less grading ({answer.message})")
        # violation of the answer, and the bound of its multipliers
        x, factor = answer.x, float(answer.x[-1])
        unknowns[kept] = np.asarray(units @ x)
        tractions = np.asarray(N @ unknowns[kept] + n)
        least_size = CERTIFIED * float(np.abs(tractions / forces).max())  # if all limits are rounding beside these
        size = max(float(np.abs(h).max()), abs(factor) * float(abs(G[:, [-1]]).max()), least_size, 1e-300)
        violation = max(float(np.maximum(G @ x - h, 0.0).max()), float(np.abs(E @ x - b).max(initial=0.0)))
        d, nu = np.maximum(-answer.inequalities, 0.0) / _COST, -answer.equations / _COST
        *rest, rate = (G.T @ d + E.T @ nu).tolist()
        rounding = float(np.abs(rest) @ np.abs(x[:-1]))
        bound = (float(h @ d + b @ nu) + rounding) / rate if rate > 0.0 else np.inf
        return Carried(factor, violation / size, tractions, bound, np.asarray(H.T @ d), unknowns)

    def program(self, signs: IntArray | None = None) -> ConicProgram:
        """The cone program for signs (e,) of σ_N on contact edges, see `whole_edge_rows`; by default without signs."""
        (N, n), (S, s) = self._tractions, self._stress
        H, limit = whole_edge_rows(self.low, np.full(len(both_signs(self.low)), EITHER) if signs is None else signs)
        # rows of t = a − β S and u = (σ_xx − σ_yy, 2σ_xy, γ S) of each cone
        cones, (S, s, first_rows) = self.cones, self._divided(S, s)
        xx, yy, xy = (S[first_rows + i] for i in range(3))
        c_xx, c_yy, c_xy = (s[first_rows + i] for i in range(3))
        trace, constant, limits = xx + yy, c_xx + c_yy, cones.limit / self.low.scales.stress
        t_rows = sparse.diags_array(cones.pressure) @ trace, limits - cones.pressure * constant
        parts: list[tuple[Any, FloatArray]] = [t_rows, (yy - xx, c_xx - c_yy), (-2.0 * xy, 2.0 * c_xy)]
        if cones.mean.any():
            parts.append((sparse.diags_array(-cones.mean) @ trace, cones.mean * constant))
        q = np.append(np.zeros(S.shape[1] - 1), -1.0)  # max α; strong cones and rows relative to their own strength
        # cones with a = 0 have no size of their own: rows are weighted relative to loads that are not multiplied, too
        is_loaded = any(np.abs(values).max(initial=0.0) > ROUNDING for values in (s, n, self._equations[1]))
        least = min(cones.least / self.low.scales.stress, 1.0 if is_loaded and not cones.limit.all() else np.inf)
        edge_scale, cone_scale = (sparse.diags_array(1.0 / beside(each, least)) for each in (limit, limits))
        edges = edge_scale @ H @ N, np.asarray(edge_scale @ (limit - H @ n))
        parts = [(cone_scale @ matrix, np.asarray(cone_scale @ constant)) for matrix, constant in parts]
        program = ConicProgram.of(q, self._equations, edges, parts)
        # unknowns that act on strong parts alone enter the rows as rounding: these columns become zero
        rows, all_stresses = (sparse.linalg.norm(matrix, axis=0) for matrix in (program.A, S))
        is_used = np.append((rows > _LOST * all_stresses)[:-1], True)
        return replace(program, A=sparse.csr_array(program.A @ sparse.diags_array(is_used.astype(float))))

    def _divided(self, S: sparse.csr_array, s: FloatArray) -> tuple[sparse.csr_array, FloatArray, IntArray]:
        """Coefficients of σ, below them those of σ' of (D41) beside free sides, and the first row (r,) of each cone.

        Cones R ≤ −S have the coefficients of σ' there, all others those of σ. A straight side is free if its traction
        is given as zero, without body force across it: then σ_nn/λ² and σ_nt/λ are polynomials.
        """
        cones, k, count = self.cones, self.cones.degree, self.cones.count
        # rows are ordered by cone, and then by part
        part, first_rows, whole = cones.coefficient // count, 3 * cones.coefficient, cones.limit.reshape(-1, count)
        is_tip = (cones.pressure == 1.0) & (cones.mean == 0.0) & ~whole.any(axis=1).repeat(count)
        sides = [nodes_along(self.low.problem, k, each.edges)[:, 0] for each in self.low.problem.prescribed(Traction)]
        loaded, directions = np.unique(joined(sides).astype(int) // count, return_counts=True)
        parts = np.intersect1d(part[is_tip & ~cones.mesh.curved[cones.cell]], loaded[directions == 2])
        if not len(parts):
            return S, s, first_rows
        # dyads t ⊗ t, n ⊗ t and n ⊗ n, symmetric, as (xx, yy, xy): parts of σ along them are divided by 1, λ and λ²
        a, b, _ = np.moveaxis(part_corners(cones.mesh.corners).reshape(-1, 3, 2)[parts], 1, 0)
        t = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
        n = np.column_stack([t[:, 1], -t[:, 0]])
        dyads = [np.column_stack([u * v, (u * v[:, ::-1]).sum(axis=1) / 2.0]) for u, v in ((t, t), (n, t), (n, n))]
        rows = [dyad * [1.0, 1.0, 2.0] for dyad in dyads]

        def on_parts(numbers: IntArray, blocks: FloatArray) -> sparse.csr_array:
            """Blocks (parts, r, 3 count) of numbered parts, as rows on all stress coefficients."""
            shape = len(numbers) * blocks.shape[1], len(s)
            return sparse.csr_array(sparse.bsr_array((blocks, numbers, np.arange(len(numbers) + 1)), shape=shape))

        # a side with given tractions is free where loads leave zero what has to be zero there
        alpha, unit = exponents(k), np.eye(count)
        zero = [np.einsum("ij,pc->pijc", unit[alpha[:, 2] < power], rows[power]) for power in (1, 2)]
        Z = on_parts(parts, np.concatenate(zero, axis=1).reshape(len(parts), -1, 3 * count))
        loads = np.column_stack([s, S[:, [-1]].toarray()])
        of_loads = np.maximum(np.abs(loads).max(axis=0), _WEAK * np.abs(loads).max())
        is_free = (np.abs(Z @ loads).reshape(len(parts), -1, 2).max(axis=1) <= _FREE * of_loads).all(axis=1)
        free, blocks = parts[is_free], np.zeros((len(parts), count, 3, count, 3))
        Q = np.array([*quotient(dict(zip(map(tuple, alpha.tolist()), unit, strict=True)), 2).values()], dtype=float)
        for power, times in enumerate((1.0, 2.0, 1.0)):
            blocks += np.einsum("ij,pc,pd->picjd", times * np.linalg.matrix_power(Q, power), dyads[power], rows[power])
        D = on_parts(free, blocks.reshape(len(parts), 3 * count, 3 * count)[is_free])
        is_divided = is_tip & np.isin(part, free)
        places = np.searchsorted(free, part[is_divided]) * count + cones.coefficient[is_divided] % count
        first_rows[is_divided] = len(s) + 3 * places
        return sparse.csr_array(sparse.vstack([S, D @ S])), np.append(s, D @ s), first_rows

    @property
    def _tractions(self) -> tuple[sparse.csr_array, FloatArray]:
        """[σ_N; σ_T] as rows on (z, y, α), and their values at zero; dimensionless."""
        first, second = (np.concatenate([part.qvi.n0, part.qvi.t0]) for part in (self.low, self.high))
        return self._wide(self.low.qvi.contact_rows, second - first), 2.0 * first - second

    @property
    def _equations(self) -> tuple[sparse.csr_array, FloatArray]:
        """Rows A x = b on x = (z, y, α)."""
        b, b_slope = self.low.qvi.b, self.high.qvi.b - self.low.qvi.b
        return self._wide(self.low.qvi.A, -b_slope), b - b_slope

    def _wide(self, matrix: Any, last: FloatArray) -> sparse.csr_array:
        """Rows on (z, y, α) from rows on z and the column of α."""
        space = self.low.space
        inner = sparse.csr_array((len(last), len(space.triangles) * space.element.interior))
        return sparse.csr_array(sparse.hstack([matrix, inner, sparse.csr_array(last[:, None])]))

    @cached_property
    def _stress(self) -> tuple[sparse.csr_array, FloatArray]:
        """Stress coefficients, three numbers each, as rows on (z, y, α), and their values at zero; dimensionless."""
        space = self.low.space
        element, triangles, k = space.element, space.triangles, space.element.shared - 3
        n, inner = len(triangles), element.interior
        reference = np.einsum("nab,sbcd->nscad", triangles.stress_maps, element.derivatives[2][..., 3:])
        reference = reference.reshape(n, -1, element.dimension - 3)
        w = reference[..., :k] @ element.transformations(triangles)[:, 3:, 3:]
        y = reference[..., k:].copy()
        if len(space.curved.numbers):
            curved_cells = space.curved.numbers
            own_part = reference[curved_cells] @ space.curved.functions[:, 3:, 3:]
            w[curved_cells], y[curved_cells] = own_part[..., :k], own_part[..., k:]
        rows, shared = w.shape[1], space.differences.all_rows(w)
        columns = np.repeat(np.arange(n * inner).reshape(n, inner), rows, axis=0)
        starts = inner * np.arange(n * rows + 1)
        own_part = sparse.csr_array((y.ravel(), columns.ravel(), starts), shape=(n * rows, n * inner))
        loaded = [each.problem for each in (self.low, self.high)]
        potentials = [coefficients_of(each, self.cones.degree, each.body_potential)[0].ravel() for each in loaded]

        def combined(low: float, high: float) -> FloatArray:
            """Stress coefficients at zero unknowns under a combination of the loads at both factors."""
            particular = low * self.low.root.particular + high * self.high.root.particular
            phi = (low * potentials[0] + high * potentials[1]) / self.low.scales.stress
            return np.asarray(shared @ particular + np.column_stack([phi, phi, 0.0 * phi]).ravel())

        slope = sparse.csr_array(combined(-1.0, 1.0)[:, None])
        parts = [shared @ self.low.supports.basis.matrix, own_part, slope]
        return sparse.csr_array(sparse.hstack(parts)), combined(2.0, -1.0)
