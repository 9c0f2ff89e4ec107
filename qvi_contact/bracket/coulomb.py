"""Bounds of errors and of contact forces under Coulomb's law, whatever sticks, slips or opens.

For any displacement z of W and any stress ζ without loads the resultant Q = ∫ a σ_N + b σ_T ds differs from a number
that z, ζ, the stress τ and the data give by at most F |ε(z) − cζ| + m (δ + ρ²/(4α)) + r F². z solves the dual
problem on the displacements of the companion, ζ is the stress nearest to it. Both are cut: z_T = b also beside what
sticks, and ζ_T = 0 also beside what slips, so that m is not large. r is the norm of R with ζ_T/(c + μ|τ_N|), made
continuous, in place of s.

In `docs/theory.md`: (D26), (D27), (D28), (D31).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Final

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.bracket.norms import (
    LARGEST,
    UNHELD,
    FrictionNorm,
    amplification,
    coercivity,
    defect_bound,
    error_bound,
    friction_norm,
)
from qvi_contact.bracket.parts import (
    EDGE_POINTS,
    LOOSEST,
    Bounds,
    CellFields,
    EdgeTractions,
    bulk,
    by_cell,
    edge_parts,
    strain_energy,
)
from qvi_contact.bracket.share import LeastChange, Share, SharedStress
from qvi_contact.companion import CompanionResult
from qvi_contact.companion.contact import DisplacementContact
from qvi_contact.companion.model import MOST, BodyAtRest, solutions
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import ContactRows
from qvi_contact.element import bernstein
from qvi_contact.element.legendre import gauss_legendre
from qvi_contact.problem.conditions import bears_shear, has_coulomb
from qvi_contact.solution.contact_line import leads_one_way
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.stress import obstacle_work, rest_on_arcs, support_work
from solvers.basics.records import dataclass


@dataclass(frozen=True, eq=False, repr=False)
class CoulombBounds:
    """Bounds of the errors under Coulomb's law.

    For every solution u, σ of the problem stated, with the stress τ of the result and the displacement v of a bracket,
    in energy norms |τ|² = ∫ τ : c : τ and |v|² = ∫ ε(v) : C : ε(v),

        |σ − τ| ≤ F + |η|,    |u − v| ≤ F.

    Where friction alone holds a body along its contacts that is so for solutions with |σ − τ| ≤ `reach` |τ + η| only.

    Attributes
    ----------
    shares : mapping
        s = −τ_T/(c + μ|τ_N|) by contact with Coulomb friction, continuous along it.
    norm : FrictionNorm
        The norm of R for s and μ, and whether it is proved.
    residual : float
        ρ = |τ + η − Cε(v)| [√energy], what springs miss included.
    defect : float
        δ = ∫ |τ_N| (g − v_N) ds, what the solver left of violations included [stress × length²].
    within : float
        F [√energy]; infinite where the norm is not below 2.
    moved : float
        |η| of the change of the stress that makes s continuous [√energy].
    size : float
        |τ + η| [√energy].
    cells : (cells,) array
        f²ρ² + δ/α by cell [stress × length²], what to refine by.
    reasons : tuple of str
        Why the bounds are not guaranteed; empty if they are.
    places : tuple of str
        Where no R exists but for s = 0, although the contact slips there; a sentence for each.
    stress, displacement : ContactResult, CompanionResult
        τ + η and v.

    """

    shares: Mapping[str, Share]
    norm: FrictionNorm
    residual: float
    defect: float
    within: float
    moved: float
    size: float
    cells: FloatArray
    reasons: tuple[str, ...]
    places: tuple[str, ...]
    stress: ContactResult
    displacement: CompanionResult

    def __repr__(self) -> str:
        return f"<CoulombBounds {self.message}>"

    @cached_property
    def forces(self) -> Mapping[str, Bounds]:
        """The bounds of "NAME.normal_force" and "NAME.tangential_force" of contacts between bounds [stress × length].

        A dual problem is solved on first use. A force is left out where that gives none, see (D31).
        """
        missed, stopped = defect_bound(self.residual, self.defect, self.norm.value), self.norm.stopped
        if stopped is not None and np.isfinite(self.within):
            missed += stopped.work(self.shares, self.within, missed)
        return coulomb_force_bounds(self, missed)

    @property
    def error(self) -> float:
        """F + |η| [√energy], which bounds the errors of the result's stress and of the displacement."""
        return self.within + self.moved

    @property
    def guaranteed(self) -> bool:
        """Whether the bounds are proved, up to rounding and the tolerance; "estimated" otherwise."""
        return not self.reasons

    @property
    def kind(self) -> str:
        """The word "guaranteed" or "estimated"."""
        return "guaranteed" if self.guaranteed else "estimated"

    @property
    def relative_error(self) -> float:
        """(F + |η|)/|τ + η|."""
        return self._relative(self.error)

    @property
    def apart(self) -> float:
        """2F/|τ + η|: any two solutions are at most that far from each other, in the energy norm of stresses."""
        return self._relative(2.0 * self.within)

    @property
    def reach(self) -> float:
        """How far from τ solutions are of which the bounds hold, over |τ + η|; infinite where they hold for all."""
        stopped = self.norm.stopped
        return float("inf") if stopped is None else self._relative(max(stopped.reach - self.moved, 0.0))

    def _relative(self, error: float) -> float:
        return error / self.size if self.size > 0.0 else float("inf") if error > 0.0 else 0.0

    @property
    def message(self) -> str:
        """What is bounded, how well, and why it is not guaranteed, if it is not."""
        known, error = self.kind.capitalize(), 100.0 * self.relative_error
        bound = f"{known} bound under friction: stresses within {error:.2g} % of their energy norm."
        if not np.isfinite(self.within):
            return f"No bound under friction. {self.norm.reason}"
        near = ""
        if np.isfinite(self.reach):
            near = f"It holds for solutions within {100.0 * self.reach:.3g} %, as friction alone holds a body."
        return " ".join(filter(None, [bound, near, *self.reasons, *self.places[:1]]))


def coulomb_bounds(
    stress: SharedStress, companion: CompanionResult, reasons: tuple[str, ...] = ()
) -> CoulombBounds | str:
    """T5 with T2: the bounds from a stress and a displacement, or why these two say nothing.

    The stress τ + η has Bernstein coefficients as rows; the displacement v is one of the same problem on the same mesh,
    and slips as the shares allow. Reasons say why neither is exactly admissible.
    """
    result, shares, known = stress.result, stress.shares, stress.result.discretization
    own, unit = EdgeTractions.of(known, result.dofs), known.scales.stress
    excess, tension = own.violations(own.bound)
    for rows in known.contacts:
        if rows.law != "tied" and max(excess[rows.edges].max(), tension[rows.edges].max()) > LOOSEST * own.size:
            return f"The stress does not obey the law of contact {rows.name!r} on whole edges."
    assert companion.state is not None
    if companion.state.contradiction:
        return companion.state.contradiction
    problem = known.problem
    fields, before = (CellFields.of(known, each.dofs, companion.degree) for each in (result, stress.before))
    edges, slack, _ = edge_parts(fields, known, own, own.bound, companion)
    inside = bulk(fields, problem.compliances, companion.cell_strain(*fields.t[:, -2:].T))
    inside += by_cell(problem, {name: part.springs for name, part in edges.items()})
    missed = {name: np.maximum(part.contact, 0.0) + np.maximum(part.friction, 0.0) for name, part in edges.items()}
    norm = friction_norm(problem, shares, unit)
    residual = float(np.sqrt(2.0 * inside.sum()))
    arcs = [lines.take(lines.bent).length for lines in (problem.mesh.boundary, problem.mesh.interior) if lines.curved]
    if arcs:  # an estimate of the energy norm of what is left there: a traction k on an edge h has k h √c
        rest, soft = rest_on_arcs(known, result.dofs), float(problem.compliances[:, 0, 0].max())
        residual += rest * float(np.sqrt(soft * (np.concatenate(arcs) ** 2).sum()))
    defect = slack + float(sum(part.sum() for part in missed.values()))
    s, cells = norm.value, 0.0 * inside
    error = error_bound(residual, defect, s)
    size = float(np.sqrt(2.0 * strain_energy(fields, problem.compliances)))
    if norm.stopped is not None and error >= norm.stopped.reach:
        near, apart = (100.0 * value / size for value in (norm.stopped.reach, error))
        what = f"what sticks stops it for solutions within {near:.2g} % of this one, less than the bound {apart:.2g} %"
        norm, error = replace(norm, reason=UNHELD.format(what)), np.inf
    if s < LARGEST:
        cells = 2.0 * amplification(s) ** 2 * inside + by_cell(problem, missed) / coercivity(s)
    return CoulombBounds(
        shares,
        norm,
        residual,
        defect,
        error,
        float(np.sqrt(2.0 * strain_energy(fields.less(before), problem.compliances))),
        size,
        cells,
        (*reasons, *(() if norm.proved else (norm.reason,))),
        stress.places,
        result,
        companion,
    )


_CUTS: Final = (1e-6, 1e-1)
"""Shares of the largest opening, slip, pressure or room below the bound of a contact that count as none.

Any share gives bounds. A small one makes m large where edges at the end of stick are short: |ζ_T| grows there towards
the end, as κ(τ) falls. A large one makes the dual pair poor. The bounds of both hold.
"""

_NOISE: Final = 1e-7  # of the largest displacement or traction: what solvers leave of zero
_MOVED: Final = 1e-5  # of the largest displacement of the body: no less is the largest one on a contact
_ROUNDED: Final = 1e-12  # of a force: rounding of its sums
_ROUNDING: Final = 1e-9  # of the largest: what is left where the dual pair must vanish


@dataclass(frozen=True, eq=False)
class _Line:
    """One contact that is not tied: what of it is open, slips and presses; 0 where that counts as none."""

    trace: DisplacementContact
    rows: ContactRows
    share: Share | None  # s; None without Coulomb friction
    slipping: FloatArray  # (n,): 1 or −1 where v may slip along the tangent or against it, else 0
    opening: FloatArray  # (n,): coefficients of g − v_N ≥ 0 [length]
    slip: FloatArray  # (n,): of |v_T − w| ≥ 0 [length]
    pressure: FloatArray  # (e, q): of |τ_N| ≥ 0 [stress]
    room: FloatArray  # (e, q): of m (c + μ|τ_N|) ≥ 0, m of `Share.room` [stress]
    # (n,): coefficients on edges of which some coefficient touches the obstacle; does not slip, without friction none
    closed: BoolArray
    stuck: BoolArray
    # (e,): edges of which some coefficient bears no pressure, and reaches the friction bound, without friction all:
    # ζ_N = 0, and ζ_T = 0 there
    loose: BoolArray
    sliding: BoolArray

    @property
    def friction(self) -> float:
        """Coulomb's coefficient μ."""
        return 0.0 if self.share is None else self.share.friction


def coulomb_force_bounds(errors: CoulombBounds, defect: float) -> dict[str, Bounds]:
    """T3: bounds of "NAME.normal_force" and "NAME.tangential_force" [stress × length] of contacts that are not tied.

    Those are left out of which no dual pair is found: the resultant of friction on a contact that ends where a support
    holds its tangential displacement, or whose tangents turn back, and all where a contact has Tresca's law. Σ is at
    most `defect` [stress × length²]. Where the norm for s is proved, those of the dual problems must be, too.
    """
    stress, companion = errors.stress, errors.displacement
    contacts = stress.problem.contacts
    if not np.isfinite(errors.within) or any(bears_shear(each) and not has_coulomb(each) for each in contacts):
        return {}
    assert companion.state is not None
    if 2 * companion.state.contacts.count > MOST:
        return {}
    qvi, mesh, found = stress.discretization.qvi, stress.problem.mesh, dict[str, Bounds]()
    fields = CellFields.of(stress.discretization, stress.dofs, companion.degree)
    body = BodyAtRest.of(stress.problem, companion.degree)
    changes = LeastChange.of(qvi, sparse.csr_array(sparse.vstack([qvi.N, qvi.T, qvi.A])))
    for cut in _CUTS:
        pairs = _Pairs(errors, defect, body, fields, changes, list(_lines(errors, cut)))
        for line in pairs.lines:
            targets = {"normal_force": (-1.0, 0.0)}
            if line.share and leads_one_way(mesh.vertices, mesh.edges(line.trace.contact.edges)):
                targets["tangential_force"] = (0.0, 1.0)
            for name, (a, b) in targets.items():
                bounds = pairs.bounds(line, a, b)
                if bounds is not None:
                    key = f"{line.trace.name}.{name}"
                    lower, upper = found.get(key, (-np.inf, np.inf))
                    found[key] = Bounds(max(lower, bounds.lower), min(upper, bounds.upper))
    return found


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Dual pairs z, ζ on the mesh of a result: displacements at rest, τ, and changes of all its tractions."""

    errors: CoulombBounds
    defect: float
    body: BodyAtRest
    fields: CellFields
    changes: LeastChange
    lines: list[_Line]

    @property
    def known(self) -> Discretization:
        """The discretisation of the stress."""
        return self.errors.stress.discretization

    @property
    def unit(self) -> float:
        """D: z is that large where its dimensionless coefficients are 1 [length]."""
        return self.known.scales.displacement

    def bounds(self, line: _Line, a: float, b: float) -> Bounds | None:
        """Bounds of ∫ a σ_N + b σ_T ds on one contact; None if no z meets the conditions of (D31)."""
        goals = {each.trace.name: (a, b) if each is line else (0.0, 0.0) for each in self.lines}
        c, z, plates = self._displacement(goals)
        change, parts = self._continuous(self._stress(c))
        ratio = self._ratio(goals, c, change)
        if ratio is None:
            return None
        error = self.errors.within
        second = self.errors.norm.work(self.known.problem, parts, error, self.defect)
        if not np.isfinite(second):
            return None
        middle, residual = self._value(goals, c, z, plates, change)
        middle -= (
            a
            * float(self.body.contacts.fluid[line.trace.here].sum())
            * self.known.scales.stress
            * self.known.scales.length
        )
        rest = (error * residual + ratio * self.defect + second) / self.unit
        rest += _ROUNDED * abs(middle)
        return Bounds(float(middle - rest), float(middle + rest))

    @cached_property
    def _spaces(self) -> tuple[list[tuple[FloatArray, int]], FloatArray, FloatArray, FloatArray]:
        """Where z and its tests may move, whatever a and b: held, P, Z, and the energies with the tests as rows.

        By contact `held` has μ s where conditions hold z as it is closed, and how many hold it as it sticks. All w of
        the interface that meet them with right-hand side d are P d + Z y.
        """
        body, n = self.body, self.body.contacts.count
        tied = body.B[np.tile(body.contacts.tied, 2) & body.live]
        held, trial, test = [], [tied], [tied]
        for line in self.lines:
            closed, stuck = (line.trace.start + np.flatnonzero(part) for part in (line.closed, line.stuck))
            closed, stuck = closed[body.live[closed]], stuck[body.live[n + stuck]]
            normal, shear = body.B[closed], body.B[n + stuck]
            turned = line.friction * line.slipping[closed - line.trace.start]
            trial += [normal + turned[:, None] * body.B[n + closed], shear]
            test += [normal, shear]
            held.append((turned, len(stuck)))
        return held, *solutions(np.vstack(trial)), solutions(np.vstack(test))[1].T @ body.S

    def _displacement(self, goals: Mapping[str, tuple[float, float]]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Coefficients c (2, n) of z on the contacts, z (size,) and its plates, dimensionless: a and b of length 1."""
        body, (held, particular, free, energies) = self.body, self._spaces
        wanted = [np.zeros(len(particular.T) - sum(len(closed) + stuck for closed, stuck in held))]  # of tied ones
        for line, (closed, stuck) in zip(self.lines, held, strict=True):
            a, b = goals[line.trace.name]
            wanted += [a + closed * b, np.full(stuck, b)]
        start = particular @ np.concatenate(wanted)
        w = start - free @ np.linalg.lstsq(energies @ free, energies @ start, rcond=1e-13)[0]
        z, plates = body.expand(w)
        c = body.contacts.rows @ z - body.contacts.motions @ plates
        return c.reshape(2, body.contacts.count), z, plates

    def _stress(self, c: FloatArray) -> FloatArray:
        """ζ, as a change of the unknowns of the stress: the nearest to Cε(z), with no traction where none may be."""
        qvi, q = self.known.qvi, self.known.rule.count
        work = np.zeros((2, qvi.m))
        products = bernstein.product_integrals(q - 1, self.errors.displacement.degree)
        for line in self.lines:
            local = np.stack(line.trace.on_edges(*c[:, line.trace.here]))
            work[:, line.rows.rows] = (line.trace.lengths[:, None] * (local @ products.T)).reshape(2, -1)
        rows, changes = self._held
        none = np.zeros(rows.shape[0])
        x = changes.solved(none, qvi.N.T @ work[0] + qvi.T.T @ work[1])
        for _ in range(2):  # what is left of the rows is rounding, which must not count
            x = x - changes.solved(rows @ x)
        return x

    @cached_property
    def _held(self) -> tuple[sparse.csr_array, LeastChange]:
        """Rows of tractions that are to vanish, and changes that leave them as they are told."""
        qvi, q = self.known.qvi, self.known.rule.count
        held = np.zeros((2, qvi.m), dtype=bool)
        for line in self.lines:
            held[0, line.rows.rows] = np.repeat(line.loose, q)
            held[1, line.rows.rows] = np.repeat(line.loose | line.sliding, q)
        parts = [sparse.csr_array(part)[chosen] for part, chosen in zip((qvi.N, qvi.T), held, strict=True)]
        rows = sparse.csr_array(sparse.vstack([*parts, qvi.A]))
        return rows, LeastChange.of(qvi, rows)

    def _continuous(self, change: FloatArray) -> tuple[FloatArray, dict[str, Share]]:
        """ζ with a ζ_T whose share of the bound is continuous, by the least change, and these shares."""
        qvi, q = self.known.qvi, self.known.rule.count
        shear, wanted, parts = qvi.T @ change, np.zeros(qvi.m), dict[str, Share]()
        rough = [line for line in self.lines if line.share is not None]
        total, mass, still = np.zeros((3, len(self.known.problem.mesh.vertices)))
        for line in rough:
            assert line.share is not None
            held, edges = line.sliding | line.loose, line.trace.edges
            bound = np.where(held[:, None], 1.0, line.share.weights)
            values = np.where(held[:, None], 0.0, shear[line.rows.rows].reshape(-1, q) / bound)
            for end, vertices in enumerate((edges.first, edges.second)):
                np.add.at(total, vertices, (values * bound)[:, -end])
                np.add.at(mass, vertices, bound[:, -end])
                np.add.at(still, vertices, held)
            parts[line.trace.name] = replace(
                line.share, values=values, weights=bound, slipping=np.zeros(len(edges.first))
            )
        common = np.where(still > 0.0, 0.0, total / np.maximum(mass, 1e-300))
        for line in rough:
            share, edges = parts[line.trace.name], line.trace.edges
            own = share.values * share.weights
            share.values[:, 0], share.values[:, -1] = common[edges.first], common[edges.second]
            wanted[line.rows.rows] = (share.values * share.weights - own).ravel()
        if wanted.any():
            right = np.concatenate([np.zeros(qvi.m), wanted, np.zeros(qvi.A.shape[0])])
            change = change + self.changes.solved(right)
        return change, parts

    def _ratio(self, goals: Mapping[str, tuple[float, float]], c: FloatArray, change: FloatArray) -> float | None:
        """The largest of m₁ to m₄; None if there is none."""
        stress, q, found = self.known.scales.stress, self.known.rule.count, 0.0
        normal, shear = (stress * (rows @ change) for rows in (self.known.qvi.N, self.known.qvi.T))
        size = float(np.abs(normal).max())
        for line in self.lines:
            (a, b), here = goals[line.trace.name], line.trace.here
            slip = c[1, here] - b if line.share else 0.0 * c[1, here]
            across = c[0, here] - a + line.friction * line.slipping * slip
            pairs = [(self.unit * slip, line.slip, self.unit), (self.unit * across, line.opening, self.unit)]
            pairs.append((normal[line.rows.rows].reshape(-1, q), line.pressure, size))
            if line.share:
                pairs.append((shear[line.rows.rows].reshape(-1, q), line.room, size))
            for part, whole, unit in pairs:
                none = whole == 0.0
                if np.abs(part[none]).max(initial=0.0) > _ROUNDING * unit:
                    return None
                found = max(found, float((np.abs(part[~none]) / whole[~none]).max(initial=0.0)))
        return found

    def _value(
        self,
        goals: Mapping[str, tuple[float, float]],
        c: FloatArray,
        z: FloatArray,
        plates: FloatArray,
        change: FloatArray,
    ) -> tuple[float, float]:
        """The resultant as far as it is known [stress × length], and |ε(z) − cζ| of z with the unit of length D."""
        known, scales, companion = self.known, self.known.scales, self.errors.displacement
        assert companion.state is not None
        u = self.errors.stress.dofs
        other = u + known.basis @ change
        fields = self.fields
        dual = CellFields.of(known, other, companion.degree).less(fields)
        strain = self.body.body.body.strain(z, slice(None), fields.t[:, -2:]) * (self.unit / scales.length)
        compliance = known.problem.compliances
        apart = strain - np.einsum("ckl,cgl->cgk", compliance, dual.stress)
        size = float(np.einsum("cg,cgk,ckl,cgl->", fields.weights, apart, np.linalg.inv(compliance), apart))
        inside = float(np.einsum("cg,cgk,cgk->", fields.weights, fields.stress, apart))
        inside += float(np.einsum("cg,cgk,ckl,cgl->", fields.weights, dual.stress, compliance, fields.at_rest))  # ε⁰
        stretched, t = self.body.contacts.stretched(z), gauss_legendre(EDGE_POINTS)[0]
        for own, each in zip(fields.springs, dual.springs, strict=True):
            missed = each.missed(companion.along(each.name, stretched, t))  # k (d + ζ/k): springs bear −τ and −ζ
            size += float((each.weights * missed**2).sum())
            inside -= float((each.weights * own.traction * missed).sum())
        loads = float(companion.state.load @ z + self.body.contacts.resultants @ plates)
        work = inside - loads * scales.energy
        for along in (support_work, obstacle_work):
            work += along(known, other) - along(known, u)
        for line in self.lines:
            if line.share:
                b, here = goals[line.trace.name][1], line.trace.here
                assert not callable(line.trace.contact.cohesion)
                slipped = float(line.trace.weights @ (line.slipping * (c[1, here] - b))) * self.unit * scales.length
                work += line.trace.contact.cohesion * slipped
        return work / self.unit, float(np.sqrt(size))


def _lines(errors: CoulombBounds, cut: float) -> Iterator[_Line]:
    stress, shares, state = errors.stress, errors.shares, errors.displacement.state
    known = stress.discretization
    assert state is not None
    beyond = (state.c - state.contacts.obstacle).reshape(2, -1)
    length, unit, tractions = known.scales.displacement, known.scales.stress, EdgeTractions.of(known, stress.dofs)
    # where all of a contact is closed and sticks its displacements are the rounding of those of the body
    least = _MOVED * float(np.abs(state.v).max(initial=0.0))

    def shown(values: FloatArray, size: float) -> FloatArray:
        """The values, 0 where they count as none beside the size of what they are part of."""
        return np.where(values > max(cut * float(values.max(initial=0.0)), _NOISE * size), values, 0.0)

    def spread(chosen: BoolArray, columns: IntArray) -> BoolArray:
        """All coefficients of edges of which some are chosen."""
        found = np.zeros_like(chosen)
        found[columns[chosen[columns].any(axis=1)]] = True
        return found

    for trace, rows in zip(state.contacts.traces, known.contacts, strict=True):
        if trace.contact.law == "tied":
            continue
        share, own = shares.get(trace.name), beyond[:, trace.here]
        slipping = np.zeros(trace.count) if share is None else trace.slipping_on(share.slipping)
        normal, bound = unit * tractions.normal[rows.edges], unit * tractions.bound[rows.edges]
        moved = max(float(np.abs(state.c.reshape(2, -1)[:, trace.here]).max(initial=0.0)), least)
        pressed = float(np.abs(normal).max(initial=0.0))
        opening, slip = (length * shown(part, moved) for part in (-own[0], slipping * own[1]))
        pressure, room = shown(-normal, pressed), shown(0.0 * bound if share is None else share.room * bound, pressed)
        yield _Line(
            trace, rows, share, slipping, opening, slip, pressure, room,
            closed=spread(opening == 0.0, trace.columns),
            stuck=spread(slip == 0.0, trace.columns) & (share is not None),
            loose=np.asarray((pressure == 0.0).any(axis=1)),
            sliding=np.asarray((room == 0.0).any(axis=1)),
        )  # fmt: skip
