"""Limit loads from below: stresses in equilibrium whose Bernstein coefficients lie in the yield cones.

The program is (D36), in unknowns z, the functions y inside a triangle, and the load factor α;
contact laws hold on whole edges, (D24). What varies over a part counts from below by its own coefficients if it is
affine there, from above by its means ∫ a B_i/∫ B_i, since ∫ a |ε| ≤ Σ |ε_i| ∫ a B_i; else by its least and its largest
value, as far as samples show them.

Bilateral contacts with friction have a bound that grows with |σ_N|: on each edge one sign of σ_N is chosen, or none,
and then friction does not count. Where no body yields contacts alone limit tractions, and the program is linear.

In `docs/theory.md`: (D24), (D36).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from itertools import islice
from typing import Any, Final, TypeAlias

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, Field, FloatArray, IntArray, evaluate
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import ContactRows, joined
from qvi_contact.element.triangle import exponents
from qvi_contact.errors import InputError, SolveError
from qvi_contact.limit.conic import APART, FACES, HELD, REGULAR, ROUNDING, UNBOUNDED, Answer, ConicProgram, beside
from qvi_contact.limit.split import SAMPLES, coefficients_of, lattice, part_corners, sampled
from qvi_contact.mesh.edges import Edges
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import Contact
from qvi_contact.problem.material import Material, MohrCoulomb, YieldCone
from qvi_contact.problem.problem import ContactProblem
from solvers.basics.progress import deadline
from solvers.inner.linear_program import INFEASIBLE, TIME_LIMIT, solved
from solvers.inner.linear_program import UNBOUNDED as NO_LIMIT

_Limits: TypeAlias = tuple[YieldCone, FloatArray, FloatArray | float]

_AFFINE: Final = 1e-10  # share of a field's size that is rounding
_TIGHTER: Final = 1e-8  # share of strengths that is kept back, so that rounding of the solver breaks no cone

PRESSURE, TENSION, EITHER, ROUGH = -1, 1, 0, 2
"""Signs of σ_N on an edge of a bilateral contact; `EITHER` without friction, `ROUGH` as if that had no limit."""

ALONG: Final = np.linspace(0.0, 1.0, 33)
"""Places of an edge where fields of contacts are looked at."""

PASSES: Final = 4
"""Times that cones without room are taken for rays, after which others may have none."""

_DROP: Final = 0.1  # share of what is carried, but for rounding, that passes lose where they take rooms for none

WIDER: Final = HELD / 4.0
"""Of sizes: room that is nothing but rounding."""

CERTIFIED: Final = 1e-7
"""Violation of the rows, and gap of the bounds relative to 1 + factor, that is accepted."""

_MOST: Final = 1e6  # factor that is asked for where a program without such a bound was not solved
_LOST: Final = 1e-13  # stress of an unknown over those that stand in the same rows, which is rounding
_COST: Final = 1e4  # of the factor, so that absolute tolerances of multipliers are as much smaller

_AT_LIMIT: Final = (
    "limit load: the loads that are not multiplied are themselves at the limit of what this mesh carries, to within "
    "rounding: whether they are carried cannot be told. Change these loads, or the friction, by a millionth"
)


@dataclass(frozen=True, eq=False)
class Carried:
    """What a mesh carries, dimensionless."""

    factor: float  # α; infinity if there is no limit, minus infinity if no multiple is carried
    violation: float = 0.0  # the most by which a row is missed, over what stands in them
    tractions: FloatArray | None = None  # (2 m,) rows [σ_N; σ_T] of the contacts; None if α is not finite
    bound: float = np.inf  # the dual bound of α, where bodies yield as the solver's multipliers have it
    # (2 m,) then, too: multipliers of tractions, moments of the opening w and of the slip −[v]_T in the motion with
    # which the mesh gives way, on which the loads do the work 1
    motion: FloatArray | None = None
    unknowns: FloatArray | None = None  # (n,): (z, y, α); None if α is not finite
    # (cells, 3, count, 3) where bodies yield: coefficients of (σ_xx, σ_yy, σ_xy), φ included
    stress: FloatArray | None = None
    farthest: float = 0.0  # with which the loads alone, where bodies yield, are as large as what stands in the rows

    @property
    def loads(self) -> float:
        """How large stresses are that loads suggest; infinity where they grow without end."""
        return 1.0 if self.factor == -np.inf else max(1.0, abs(self.factor))


def limited(discretization: Discretization) -> list[tuple[ContactRows, Contact]]:
    """The contacts that limit tractions."""
    pairs = zip(discretization.contacts, discretization.problem.contacts, strict=True)
    return [(rows, contact) for rows, contact in pairs if rows.law != "tied"]


def whole_edge_rows(discretization: Discretization, signs: IntArray) -> tuple[sparse.csr_array, FloatArray]:
    """Rows H [σ_N; σ_T] ≤ limit for the rows of N and T of (D2), dimensionless.

    The `signs` (e,) are those of σ_N on all edges, and count where `both_signs`.
    """
    problem, stress, m = discretization.problem, discretization.scales.stress, discretization.qvi.m
    found, limits, first = [sparse.csr_array((0, 2 * m))], [np.zeros(0)], 0
    for rows, contact in limited(discretization):
        edges, q = rows.points.edges, rows.rule.count
        friction, cohesion = (
            _below(problem, edges, f"Contact.{name}", getattr(contact, name)) for name in ("friction", "cohesion")
        )
        sign = np.full(len(edges), PRESSURE)
        if rows.law == "bilateral":
            sign = np.where((friction > 0.0).any(axis=1), signs[first : first + len(edges)], EITHER)
        first += len(edges)
        plain = np.broadcast_to(np.eye(q), (len(edges), q, q))
        rubbed, elevated = _times(-sign[:, None] * friction, q), _times(np.ones((len(edges), 2)), q)
        one_sided, every, rubs = abs(sign) == 1, np.ones(len(edges), dtype=bool), sign != ROUGH
        pressed = -sign[one_sided, None, None] * np.eye(q)
        groups = [(one_sided, pressed, 0.0 * pressed, np.zeros(len(pressed) * q))]
        held = _affine(cohesion[rubs], q) / stress
        groups += [(rubs, rubbed[rubs], one * elevated[rubs], held) for one in (1.0, -1.0)]
        if contact.shear_limit is not None:
            cap = _affine(_below(problem, edges, "Contact.shear_limit", contact.shear_limit), q - 1) / stress
            groups += [(every, 0.0 * plain, one * plain, cap) for one in (1.0, -1.0)]
        for chosen, normal, shear, limit in groups:
            numbers = rows.rows.start + q * np.flatnonzero(chosen)[:, None, None] + np.arange(q)
            at = np.arange(len(limit)).reshape(*normal.shape[:2], 1)
            values, columns = np.concatenate([normal, shear], axis=2), np.concatenate([numbers, m + numbers], axis=2)
            at, columns = np.broadcast_arrays(at, columns)
            part = sparse.csr_array((values.ravel(), (at.ravel(), columns.ravel())), shape=(len(limit), 2 * m))
            part.eliminate_zeros()
            found.append(part)
            limits.append(limit)
    return sparse.csr_array(sparse.vstack(found)), joined(limits)


def both_signs(discretization: Discretization) -> BoolArray:
    """Contact edges (e,) where σ_N may have either sign and friction depends on it."""
    found = [np.zeros(0, dtype=bool)]
    for rows, contact in limited(discretization):
        friction = _below(discretization.problem, rows.points.edges, "Contact.friction", contact.friction)
        found.append(np.asarray((friction > 0.0).any(axis=1) & (rows.law == "bilateral")))
    return np.concatenate(found)


def _times(ends: FloatArray, q: int) -> FloatArray:
    """Matrices (e, q + 1, q) that multiply polynomials of q coefficients by affine functions of end values (e, 2)."""
    k = np.arange(q + 1)[:, None]
    own, before = (q - k) * np.eye(q + 1, q), k * np.eye(q + 1, q, -1)
    return np.asarray((ends[:, :1, None] * own + ends[:, 1:, None] * before) / q)


def _affine(ends: FloatArray, degree: int) -> FloatArray:
    """Coefficients of affine functions of end values (e, 2), edge by edge."""
    return np.asarray(ends[:, :1] + np.diff(ends, axis=1) * np.linspace(0.0, 1.0, degree + 1)).ravel()


def _of_contacts(problem: ContactProblem) -> Iterator[float]:
    """The largest cohesion and cap of each contact."""
    for contact in problem.contacts:
        places = problem.mesh.points_along(problem.mesh.edges(contact.edges), ALONG)
        for name in ("cohesion", "shear_limit"):
            if (field := getattr(contact, name)) is not None:
                yield float(evaluate(f"Contact.{name}", field, *places, minimum=0.0).max())


def _below(problem: ContactProblem, edges: Edges, name: str, field: Field) -> FloatArray:
    """End values (e, 2) ≥ 0 of affine functions not above a field: its chord, lowered, or its least value."""
    values = evaluate(name, field, *problem.mesh.points_along(edges, ALONG), minimum=0.0)
    ends = values[:, [0, -1]]
    chord = ends[:, :1] + np.diff(ends, axis=1) * ALONG
    lowered = ends - np.maximum(chord - values, 0.0).max(axis=1)[:, None]
    usable = (lowered >= 0.0).all(axis=1)[:, None]
    return np.asarray(np.where(usable, lowered, values.min(axis=1)[:, None]))


@dataclass(frozen=True, eq=False)
class YieldCones:
    """Rows |(γ S, σ_xx − σ_yy, 2σ_xy)| ≤ a − β S on coefficients, S = σ_xx + σ_yy, for one side of the limit load.

    What becomes of angles of friction that vary says "Friction that varies" in `docs/theory.md`.
    """

    mesh: TriangleMesh
    degree: int  # k
    coefficient: IntArray  # (r,) which coefficient each row is about: ((triangle · 3) + part) · count + its number
    first: BoolArray  # (r,) whether it is the first cone of its coefficient
    limit: FloatArray  # (r,) a, for stresses not above the truth, and for dissipation not below it [stress]
    pressure: FloatArray  # (r,) β and γ
    mean: FloatArray
    strong: BoolArray  # (cells,) triangles without a strength: they carry any stress, and move as rigid bodies
    least: float  # of the largest values that strengths have in each material and on each contact; infinity for none
    most: float  # of them; what is larger does not give way

    @classmethod
    def of(cls, problem: ContactProblem, degree: int, *, above: bool) -> YieldCones:
        """Those of a problem for stresses of a degree, or `above`, for what flow dissipates."""
        count, number = len(exponents(degree)), problem.cell_materials
        found = [(np.zeros(0), np.zeros(0, dtype=bool), *np.zeros((3, 0)))]
        strengths = list(_of_contacts(problem))
        for index, material in enumerate(problem.materials):
            cells = np.flatnonzero(number == index)
            if material.strength is None or not len(cells):
                continue
            at = 3 * count * cells[:, None, None] + np.arange(3 * count).reshape(3, count)
            for place, (cone, a, pressure) in enumerate(_limits(problem, cells, degree, material, above)):
                parts = np.broadcast_arrays(at, place == 0, a, pressure, cone.mean)
                found.append(tuple(part.ravel() for part in parts))
                strengths.append(float(np.max(a)))
        coefficient, first, limit, pressure, mean = (np.concatenate(part) for part in zip(*found, strict=True))
        strong = np.array([material.strength is None for material in problem.materials])[number]
        least = min((each for each in strengths if each > 0.0), default=np.inf)
        of_rows = coefficient.astype(np.int64), first, limit, pressure, mean
        return cls(problem.mesh, degree, *of_rows, strong, least, max(strengths, default=0.0))

    def nearer(self) -> YieldCones:
        """Without those above 1e3 times the least, for flows that leave them alone; what has no other one is rigid."""
        most = APART * self.least
        kept = self.limit <= most
        strong = self.strong | (np.bincount(self.cell[kept], minlength=len(self.strong)) == 0)
        kept |= ~(strong[self.cell] | np.isin(self.coefficient, self.coefficient[kept]))  # or nothing would limit these
        names = ("coefficient", "limit", "pressure", "mean")
        parts = {name: getattr(self, name)[kept] for name in names}
        first = np.isin(np.arange(kept.sum()), np.unique(parts["coefficient"], return_index=True)[1])
        return replace(self, strong=strong, first=first, most=most, **parts)

    @property
    def count(self) -> int:
        """Coefficients of a part."""
        return len(exponents(self.degree))

    @property
    def cell(self) -> IntArray:
        """The triangle (r,) of each row."""
        return self.coefficient // (3 * self.count)

    @cached_property
    def rays(self) -> FloatArray:
        """Directions û (r, k, 2 or 3) of u in cones (t, u) where stress is along, or strain across, an edge nearby.

        That is a side of the part of the triangle, or any that is parallel to one with a name.
        """
        parts = part_corners(self.mesh.corners)
        sides = (np.roll(parts, -1, axis=2) - parts).reshape(-1, 3, 2)
        named = np.concatenate([self.mesh.edges(name).tangent for name in self.mesh.edge_names])
        upright = np.where(named[:, :1] < 0.0, -named, named)
        named = named[np.unique(upright.round(9), axis=0, return_index=True)[1]]
        x, y = np.moveaxis(np.concatenate([sides, np.broadcast_to(named, (len(sides), *named.shape))], axis=1), -1, 0)
        units = np.stack([y**2 - x**2, -2.0 * x * y, *[0.0 * x] * bool(self.mean.any())], axis=-1)
        return np.asarray(units / (x**2 + y**2)[..., None])[self.coefficient // self.count]


def excess(problem: ContactProblem, x: FloatArray, y: FloatArray, stress: FloatArray) -> FloatArray:
    """By how much stresses at points of all triangles exceed the strength there, in its unit (cells, g) [stress].

    Parameters
    ----------
    problem : ContactProblem
        The problem.
    x, y : (cells, g) arrays
        The points [length].
    stress : (cells, g, 3) array
        (σ_xx, σ_yy, σ_xy) [stress].

    """
    found = np.zeros(x.shape)
    total, difference = stress[..., 0] + stress[..., 1], stress[..., 0] - stress[..., 1]
    for index, material in enumerate(problem.materials):
        chosen = problem.cell_materials == index
        for cone in _cones(material, x[chosen], y[chosen]):
            S = total[chosen]
            radius = np.sqrt(difference[chosen] ** 2 + 4.0 * stress[chosen, :, 2] ** 2 + (cone.mean * S) ** 2)
            strength = evaluate(cone.name, cone.field, x[chosen], y[chosen], minimum=0.0)
            found[chosen] = np.maximum(found[chosen], (radius + cone.pressure * S) / cone.factor - strength)
    return found


def _cones(material: Material, x: FloatArray, y: FloatArray, extreme: Any = None) -> list[YieldCone]:
    """The cones of a material's strength at points, or with the least or the largest angle of friction of each row."""
    law = material.strength
    if isinstance(law, MohrCoulomb) and callable(law.phi):
        phi = law.angles(x, y)
        return list(law.cones(material.plane, extreme(phi, axis=-1, keepdims=True) if extreme else phi))
    return [] if law is None else list(law.cones(material.plane))


def _limits(
    problem: ContactProblem, cells: IntArray, degree: int, material: Material, above: bool
) -> Iterator[_Limits]:
    """Cones with a and β (n, 3, count): for stresses those of both extreme angles, else one around those of all."""
    x, y = sampled(problem, cells)
    least, largest = (_cones(material, x, y, extreme) for extreme in (np.min, np.max))
    strengths = [_on_parts(problem, cells, degree, cone) for cone in least]
    reach = np.full((len(cells), 3, 1), np.inf)  # the largest S is the least a/β
    for cone, (*_, most) in zip(least, strengths, strict=True):
        beta = np.broadcast_to(np.asarray(cone.pressure), reach.shape)
        reach = np.minimum(reach, np.divide(cone.factor * most, beta, out=np.full_like(reach, np.inf), where=beta > 0))
    for one, other, (carried, dissipated, _) in zip(least, largest, strengths, strict=True):
        if not above:
            yield one, one.factor * carried, one.pressure
            if np.ndim(one.factor) or np.ndim(one.pressure):
                yield one, other.factor * carried, other.pressure
            continue
        steeper = np.broadcast_to(np.asarray(other.pressure) - np.asarray(one.pressure), reach.shape)
        if not np.isfinite(reach[steeper > 0.0]).all():
            remedy = "give it a tension cut-off (tension=…), or a region of its own to what has no friction"
            raise InputError("MohrCoulomb.phi", 0.0, f"is zero beside places where it is not: {remedy}")
        more = np.multiply(reach, steeper, out=np.zeros_like(reach), where=steeper > 0.0)
        yield one, np.maximum(one.factor, other.factor) * dissipated + more, other.pressure


def _on_parts(
    problem: ContactProblem, cells: IntArray, degree: int, cone: YieldCone
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Its field for each coefficient (n, 3, count), for stresses and for what flow dissipates; the most (n, 3, 1)."""
    samples = lattice(SAMPLES)
    seen = evaluate(cone.name, cone.field, *sampled(problem, cells), minimum=0.0)
    least, most = seen.min(axis=-1, keepdims=True), seen.max(axis=-1, keepdims=True)
    corners = seen[..., [int(np.flatnonzero(samples[:, i] == 1.0)[0]) for i in range(3)]]
    affine = np.abs(seen - corners @ samples.T).max(axis=-1, keepdims=True) <= _AFFINE * np.abs(seen).max()
    own = corners @ lattice(degree).T
    means = corners @ ((exponents(degree) + 1.0) / (degree + 3.0)).T
    return np.where(affine, own, least), np.where(affine, means, most), most


@dataclass(frozen=True, eq=False)
class StressProgram:
    """The program of a problem discretised at the load factors 1 and 2."""

    low: Discretization  # the problem at both factors, in the same units and degrees of freedom
    high: Discretization
    most: float = np.inf  # what the least strength counts for at most, dimensionless

    @cached_property
    def cones(self) -> YieldCones:
        """What its body can carry."""
        return YieldCones.of(self.low.problem, self.low.space.element.traction_degree, above=False)

    def carried(self, share: float = 0.0) -> Carried:
        """The largest factor. The stresses go a share of the way towards a state inside all limits, as far as can be.

        They are those of the program in which 1e-8 of all limits is kept back, if it has an answer: where limits leave
        no room, rounding decides of that. Where no body yields they are those of the simplex method, if it has one.
        """

        def solve(signs: IntArray) -> Carried:
            program, known, find = self.program(signs), None, cache(partial(self._of_program, share=share))
            with suppress(SolveError):
                known = None if self.low.problem.yields else self._by_simplex(signs).unknowns
            first = best = self._of_program(program, share, known)
            left = iter(FACES)
            for faces in islice(left, 2):  # the finer one, if rooms are known so well
                best = self._on_faces(program, first, find, faces)
                if best is not first:
                    break
            if first.violation <= ROUNDING:  # and is only not known to be the most
                best = max(first, best, key=lambda one: one.factor)
            for faces in left:
                least = first.factor - max(_DROP * abs(first.factor), CERTIFIED)
                if best is first or best.factor >= least or deadline.over:
                    break
                with suppress(SolveError):  # what is known is right without it
                    found = self._on_faces(program, first, find, faces)
                    larger = best.violation > ROUNDING or found.factor > best.factor
                    best = found if found.violation <= ROUNDING and larger else best
            return best

        found, least = self._with_signs(solve), self.cones.least / self.low.scales.stress
        if APART * found.loads >= least or self.most < np.inf or self.cones.limit.all():
            return found
        return replace(self, most=found.loads).carried(share)  # no tension has no size, loads have

    def _on_faces(
        self, program: ConicProgram, found: Carried, find: Callable[[ConicProgram], Carried], faces: tuple[float, float]
    ) -> Carried:
        """What is carried once cones without room are rays, from what was found of the program."""
        for _ in range(PASSES):
            doubt = abs(found.bound - found.factor) > max(_DROP * abs(found.factor), CERTIFIED)
            if doubt and found.violation <= ROUNDING and np.isfinite(found.factor) and program.falls:
                return Carried(np.inf)
            unsure = found.violation > ROUNDING or found.factor == -np.inf or doubt
            narrower = program.on_faces(self.cones.rays, *faces, found.unknowns) if unsure else None
            if narrower is None:
                break
            program, found = narrower, find(narrower)  # in which others may have none
        return found

    def _of_program(self, program: ConicProgram, share: float, known: FloatArray | None = None) -> Carried:
        """What the first point shows that keeps a program but for rounding: one that is known, or of the solver."""
        best, tighter, last = Carried(-np.inf), program.tightened(_TIGHTER), REGULAR[::-1]
        for each, regular in ((None, REGULAR), (tighter, REGULAR), (program, REGULAR), (program, last)):
            if regular is last and np.isfinite(best.factor):
                break
            answer = each.solve(regular) if each else known
            if isinstance(answer, str) or answer is None:
                if answer == UNBOUNDED:  # from any state that keeps the limits; the load itself may have none
                    return self._without_room(program, share, grows=True)
                continue
            x = answer.x if isinstance(answer, Answer) else answer
            carried = self._held(program, *program.repaired(x, share))
            carried = replace(carried, bound=-answer.least if isinstance(answer, Answer) else carried.factor)
            if np.isfinite(carried.factor) and carried.violation <= ROUNDING:
                return carried
            best = best if regular is last else max(best, carried, key=lambda one: one.factor)
        return best if np.isfinite(best.factor) else self._without_room(program, share)

    def _held(self, program: ConicProgram, x: FloatArray, violation: float) -> Carried:
        """What stresses carry; minus infinity if the solver has given up."""
        violation = max(violation, -float(program.margins(x).min(initial=0.0)))
        (N, n), (S, s) = self._tractions, self._stress
        tractions, stress = N @ x + n, (S @ x + s).reshape(-1, 3, self.cones.count, 3)
        size = max(program.size(x), float(np.abs(tractions).max(initial=0.0)))  # beyond loads and limits
        if violation * max(1.0, size / max(1.0, program.size(0.0 * x))) > HELD:
            return Carried(-np.inf)
        farthest = program.size(x) / (float(np.abs(program.A[:, [-1]].toarray()).max(initial=0.0)) or 1.0)
        return Carried(float(x[-1]), violation, tractions, unknowns=x, stress=stress, farthest=farthest)

    def _without_room(self, program: ConicProgram, share: float, *, grows: bool = False) -> Carried:
        """The load itself, or more without end: the solver gives up where stresses grow along the tips of cones.

        Growth may begin at the least multiple that is carried. The solver may take limits without room for none. Only
        if nothing keeps wider ones, no multiple is carried.
        """
        modest, wider = program.up_to(1.0), program.tightened(room=-WIDER * program.size(0.0 * program.q))
        least, carried = replace(program, q=-program.q), Carried(-np.inf)
        for each in (modest, *[least] * grows, wider.up_to(1.0), wider):
            with suppress(SolveError):  # what is known is right without it
                answer = each.solve()
                if not isinstance(answer, str):
                    carried = self._held(program, *each.repaired(answer.x, share))
                if np.isfinite(carried.factor) and each in (modest, least) and (grows or program.falls):
                    return Carried(np.inf)
            if np.isfinite(carried.factor):
                break
        return carried

    def carried_by_contacts(self) -> Carried:
        """The largest factor where no body yields: max α  s.t.  G z ≤ h + α h',  A z = b + α b'.

        By the simplex method, with a bound from its multipliers: from Σ d (h + α h' − G z) ≥ 0 with Gᵀd + Aᵀν = 0
        follows α ≤ (h·d + b·ν) / −(h'·d + b'·ν), rounding added. `SolveError` if the linear program is not solved, or
        not in time.
        """
        return self._with_signs(self._by_simplex)

    def _with_signs(self, solve: Callable[[IntArray], Carried]) -> Carried:
        """The best with signs of bilateral pressure that programs without friction there, and with any, suggest."""
        undecided = both_signs(self.low)
        first, most = solve(np.full(len(undecided), EITHER)), Carried(np.inf)
        if not undecided.any():
            return first
        with suppress(SolveError):  # it need not be solved
            most = solve(np.full(len(undecided), ROUGH))
        if most.factor <= first.factor:
            return first
        trials = [np.full(len(undecided), PRESSURE)]
        for tractions in (each.tractions for each in (first, most) if each.tractions is not None):
            normal = tractions[: self.low.qvi.m].reshape(-1, self.low.rule.count).sum(axis=1)
            trials.append(np.where(normal > HELD * np.abs(normal).max(), TENSION, PRESSURE))  # none is no tension
        return max([first, *map(solve, np.unique(trials, axis=0))], key=lambda each: each.factor)

    def _by_simplex(self, signs: IntArray) -> Carried:
        H, limit = whole_edge_rows(self.low, signs)
        if not len(limit):
            return Carried(np.inf)
        weights = joined([rows.row_weights for rows, _ in limited(self.low)])
        forces = np.tile(weights.max() / weights, 2)  # they do not grow where edges are short, as tractions do
        largest = abs(H @ sparse.diags_array(forces)).max(axis=1).toarray().ravel()
        H, limit = sparse.csr_array(sparse.diags_array(1.0 / largest) @ H), limit / largest
        (N, n), (A, b), kept = self._tractions, self._equations, np.append(np.arange(self.low.qvi.n), -1)
        wide, N = np.zeros(N.shape[1]), N[:, kept]
        rows, h = sparse.csr_array(H @ N), limit - H @ n
        heights, columns = (np.sqrt(np.asarray(rows.multiply(rows).sum(axis=axis))).ravel() for axis in (1, 0))
        beside = (sparse.diags_array(heights) @ abs(rows).sign()).max(axis=0).toarray().ravel()
        columns[columns <= _LOST * beside] = columns[-1] = 1.0  # no stress there, which as unit would become one
        units = sparse.diags_array(1.0 / columns)  # tolerances are for numbers near 1
        G, E = sparse.csc_array(rows @ units), sparse.csc_array(A[:, kept] @ units)
        cost, free = np.append(np.zeros(G.shape[1] - 1), -_COST), [(None, None)] * G.shape[1]
        equations: dict[str, Any] = {"A_eq": E, "b_eq": b} if len(b) else {}
        answer = solved(cost, A_ub=G, b_ub=h, bounds=free, **equations)
        if not (answer.solved or answer.status in (INFEASIBLE, TIME_LIMIT)):  # HiGHS finds no limit by rounding, too
            below = solved(cost, A_ub=G, b_ub=h, bounds=[*free[:-1], (None, _MOST)], **equations)
            grows = below.solved and below.x[-1] >= _MOST * (1.0 - CERTIFIED)
            decided = below.solved or below.status in (INFEASIBLE, TIME_LIMIT)
            if answer.status == NO_LIMIT and (grows or not decided):
                return Carried(np.inf)
            if grows:
                raise SolveError(f"limit load: {_MOST:g} times the loads are carried, and no limit was found beyond")
            answer = below
        if answer.status == INFEASIBLE:  # the least t ≥ 0 with G x ≤ h + t says by how much
            least, equal = (sparse.csc_array(sparse.hstack([part, sparse.csc_array(np.full((part.shape[0], 1), t))]))
                           for part, t in ((G, -1.0), (E, 0.0)))  # fmt: skip
            equations |= {"A_eq": equal} if len(b) else {}
            nearest = solved(np.append(0.0 * cost, 1.0), A_ub=least, b_ub=h, bounds=[*free, (0.0, None)], **equations)
            if nearest.solved and nearest.x[-1] > CERTIFIED * max(1.0, float(np.abs(h).max())):
                return Carried(-np.inf, bound=-np.inf)
            raise SolveError(_AT_LIMIT)
        if answer.status == TIME_LIMIT:
            raise SolveError("limit load: the time limit was reached: allow more (time_limit=…), or take fewer cells")
        if not answer.solved:
            raise SolveError(f"limit load: the linear program was not solved, use less grading ({answer.message})")
        x, factor = answer.x, float(answer.x[-1])
        size = max(float(np.abs(h).max()), abs(factor) * float(abs(G[:, [-1]]).max()), 1e-300)
        missed = max(float(np.maximum(G @ x - h, 0.0).max()), float(np.abs(E @ x - b).max(initial=0.0)))
        d, nu = np.maximum(-answer.inequalities, 0.0) / _COST, -answer.equations / _COST
        *rest, rate = (G.T @ d + E.T @ nu).tolist()
        rounding = float(np.abs(rest) @ np.abs(x[:-1]))
        bound = (float(h @ d + b @ nu) + rounding) / rate if rate > 0.0 else np.inf
        wide[kept] = np.asarray(units @ x)
        return Carried(factor, missed / size, np.asarray(N @ wide[kept] + n), bound, np.asarray(H.T @ d), wide)

    def program(self, signs: IntArray | None = None) -> ConicProgram:
        """The cone program for signs (e,) of σ_N on contact edges, see `whole_edge_rows`; by default for none."""
        (N, n), (S, s) = self._tractions, self._stress
        H, limit = whole_edge_rows(self.low, np.full(len(both_signs(self.low)), EITHER) if signs is None else signs)
        cones, at = self.cones, 3 * self.cones.coefficient
        xx, yy, xy = (S[at + i] for i in range(3))
        c_xx, c_yy, c_xy = (s[at + i] for i in range(3))
        total, constant, limits = xx + yy, c_xx + c_yy, cones.limit / self.low.scales.stress
        parts: list[tuple[Any, FloatArray]] = [
            (sparse.diags_array(cones.pressure) @ total, limits - cones.pressure * constant),
            (yy - xx, c_xx - c_yy),
            (-2.0 * xy, 2.0 * c_xy),
        ]
        if cones.mean.any():
            parts.append((sparse.diags_array(-cones.mean) @ total, cones.mean * constant))
        q = np.append(np.zeros(S.shape[1] - 1), -1.0)
        least = min(cones.least / self.low.scales.stress, self.most)
        on_edges, in_cones = (sparse.diags_array(1.0 / beside(each, least)) for each in (limit, limits))
        edges = on_edges @ H @ N, np.asarray(on_edges @ (limit - H @ n))
        parts = [(in_cones @ matrix, np.asarray(in_cones @ constant)) for matrix, constant in parts]
        program = ConicProgram.of(q, self._equations, edges, parts)
        rows, all_stresses = (sparse.linalg.norm(matrix, axis=0) for matrix in (program.A, S))
        seen = np.append((rows > _LOST * all_stresses)[:-1], True)  # not rounding of stresses of rigid parts
        return replace(program, A=sparse.csr_array(program.A @ sparse.diags_array(seen.astype(float))))

    @property
    def _tractions(self) -> tuple[sparse.csr_array, FloatArray]:
        """[σ_N; σ_T] as rows on (z, y, α), and what they are at zero; dimensionless."""
        first, second = (np.concatenate([part.qvi.n0, part.qvi.t0]) for part in (self.low, self.high))
        return self._wide(self.low.qvi.contact_rows, second - first), 2.0 * first - second

    @property
    def _equations(self) -> tuple[sparse.csr_array, FloatArray]:
        """Rows A x = b on x = (z, y, α)."""
        b, b_slope = self.low.qvi.b, self.high.qvi.b - self.low.qvi.b
        return self._wide(self.low.qvi.A, -b_slope), b - b_slope

    def _wide(self, matrix: Any, last: FloatArray) -> sparse.csr_array:
        """Rows on z and, with the last column, on α."""
        space = self.low.space
        inner = sparse.csr_array((len(last), len(space.triangles) * space.element.interior))
        return sparse.csr_array(sparse.hstack([matrix, inner, sparse.csr_array(last[:, None])]))

    @cached_property
    def _stress(self) -> tuple[sparse.csr_array, FloatArray]:
        """Stress coefficients, three numbers each, as rows on (z, y, α), and what they are at zero; dimensionless."""
        space = self.low.space
        element, triangles, k = space.element, space.triangles, space.element.shared - 3
        n, inner = len(triangles), element.interior
        reference = np.einsum("nab,sbcd->nscad", triangles.stress_maps, element.derivatives[2][..., 3:])
        reference = reference.reshape(n, -1, element.dimension - 3)
        w = reference[..., :k] @ element.transformations(triangles)[:, 3:, 3:]
        y = reference[..., k:].copy()
        if len(space.curved.numbers):
            at = space.curved.numbers
            own = reference[at] @ space.curved.functions[:, 3:, 3:]
            w[at], y[at] = own[..., :k], own[..., k:]
        rows, shared = w.shape[1], space.differences.all_rows(w)
        columns = np.repeat(np.arange(n * inner).reshape(n, inner), rows, axis=0)
        starts = inner * np.arange(n * rows + 1)
        own = sparse.csr_array((y.ravel(), columns.ravel(), starts), shape=(n * rows, n * inner))
        loaded = [each.problem for each in (self.low, self.high)]
        potentials = [coefficients_of(each, self.cones.degree, each.body_potential)[0].ravel() for each in loaded]

        def combined(low: float, high: float) -> FloatArray:
            """What a multiple of the lower factor's and one of the higher factor's loads give."""
            particular = low * self.low.root.particular + high * self.high.root.particular
            phi = (low * potentials[0] + high * potentials[1]) / self.low.scales.stress
            return np.asarray(shared @ particular + np.column_stack([phi, phi, 0.0 * phi]).ravel())

        slope = sparse.csr_array(combined(-1.0, 1.0)[:, None])
        parts = [shared @ self.low.supports.basis.matrix, own, slope]
        return sparse.csr_array(sparse.hstack(parts)), combined(2.0, -1.0)
