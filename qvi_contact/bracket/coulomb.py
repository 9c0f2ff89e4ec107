"""Bounds of errors and of contact forces under Coulomb's law, whatever sticks, slips or opens.

Of (D31) z solves the dual problem on the displacements of the companion, ζ is the stress nearest to it, both cut so
that m is not large.

In `docs/theory.md`: (D26), (D27), (D28), (D31).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, NamedTuple

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
from qvi_contact.bracket.parts import EDGE_POINTS, LOOSEST, Bounds, CellFields, EdgeTractions, edge_parts
from qvi_contact.bracket.share import AWAY, Share, SharedStress, joined
from qvi_contact.companion import CompanionResult, CompanionState
from qvi_contact.companion.contact import LeastChange
from qvi_contact.companion.model import MOST, BodyAtRest, solutions
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.element.edge import gauss_legendre, product_integrals
from qvi_contact.problem.conditions import bears_shear, has_coulomb
from qvi_contact.problem.problem import by_cell
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.stress import rest_on_arcs


@dataclass(frozen=True, eq=False, repr=False)
class CoulombBounds:
    """Bounds of the errors under Coulomb's law.

    For every solution u, σ of the problem stated, with the stress τ of the result and the displacement v of a bracket,
    in energy norms |τ|² = ∫ τ : c : τ and |v|² = ∫ ε(v) : C : ε(v),

        |σ − τ| ≤ F + |η|,    |u − v| ≤ F.

    Where contacts alone hold a body that is so for solutions with |σ − τ| ≤ `reach` |τ + η| only.
    """

    shares: Mapping[str, Share]
    """s = −τ_T/(c + μ|τ_N|) by contact with Coulomb friction, continuous along it."""
    norm: FrictionNorm
    """The norm of R for s and μ, and whether it is proved."""
    residual: float
    """ρ = |τ + η − Cε(v)| [√energy], what springs miss included."""
    defect: float
    """δ = ∫ |τ_N| (g − v_N) ds, what the solver left of violations included [stress × length²]."""
    within: float
    """F [√energy]; infinite where the norm is not below 2."""
    moved: float
    """|η| of the change of the stress that makes s continuous [√energy]."""
    size: float
    """|τ + η| [√energy]."""
    cells: FloatArray
    """(cells,): f²ρ² + δ/α by cell [stress × length²], what to refine by."""
    reasons: tuple[str, ...]
    """Why the bounds are not guaranteed; empty if they are."""
    places: tuple[str, ...]
    """Where no R exists but for s = 0, although the contact slips there; a sentence for each."""
    stress: ContactResult
    displacement: CompanionResult
    """What carry τ + η and v."""

    def __repr__(self) -> str:
        return f"<CoulombBounds {self.message}>"

    @cached_property
    def forces(self) -> Mapping[str, Bounds]:
        """The bounds of "NAME.normal_force" and "NAME.tangential_force" of contacts between bounds [stress × length].

        A dual problem is solved on first use. A force is left out where that gives none, see (D31).
        """
        return coulomb_force_bounds(self)

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
        return np.inf if stopped is None else self._relative(max(stopped.reach - self.moved, 0.0))

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
            near = f"It holds for solutions within {100.0 * self.reach:.3g} %, as contacts alone hold a body."
        return " ".join(filter(None, [bound, near, *self.reasons, *self.places[:1]]))


TOO_NEAR: Final = "No displacement was found that is as far from an obstacle as the stress lets it be."
"""Displacements that may slip far from an obstacle come too near to it."""


def coulomb_bounds(
    stress: SharedStress, companion: CompanionResult, reasons: tuple[str, ...] = ()
) -> CoulombBounds | str:
    """T5 with T2: the bounds from a stress and a displacement that slips as its shares allow, or why they say nothing.

    Those and reasons that are given say why the two are not exactly admissible.
    """
    reasons = tuple(dict.fromkeys((*reasons, *companion.reasons)))
    result, shares, known = stress.result, stress.shares, stress.result.discretization
    own, unit, problem = EdgeTractions.of(known, result.dofs), known.scales.stress, known.problem
    excess, tension = own.violations(own.bound)
    # without loads all is rounding, of which no share is small
    most = LOOSEST * max(own.size, known.scales.loaded * result.certificate.scales.get("stress", 0.0))
    for rows in known.contacts:
        if rows.law != "tied" and max(excess[rows.edges].max(), tension[rows.edges].max()) > most:
            return f"The stress does not obey the law of contact {rows.name!r} on whole edges."
    if companion.state is None:
        return f"No admissible displacement was found: {companion.message}"
    if companion.state.contradiction:
        return companion.state.contradiction
    state = companion.state
    rounding = _ROUNDING * max(1.0, float(np.abs(state.c).max(initial=0.0)))
    if (_opening(state, shares) < -rounding).any():
        return TOO_NEAR
    fields, before = (CellFields.of(known, each.dofs, companion.degree) for each in (result, stress.before))
    edges, slack = edge_parts(fields, known, own, own.bound, companion)
    inside = fields.bulk(companion)
    inside += by_cell(problem, {name: part.springs for name, part in edges.items()})
    missed = {name: np.maximum(part.contact, 0.0) + np.maximum(part.friction, 0.0) for name, part in edges.items()}
    norm = friction_norm(problem, shares, unit, _pressures(state, own, known, rounding))
    residual = float(np.sqrt(2.0 * inside.sum()))
    arcs = [lines.take(lines.bent).length for lines in (problem.mesh.boundary, problem.mesh.interior) if lines.curved]
    if arcs:  # an estimate of the energy norm of what is left there: a traction k on an edge h has k h √c
        rest, soft = rest_on_arcs(known, result.dofs), float(problem.compliances[:, 0, 0].max())
        residual += rest * float(np.sqrt(soft * (np.concatenate(arcs) ** 2).sum()))
    defect = slack + float(sum(part.sum() for part in missed.values()))
    s, cells, moved = norm.value, 0.0 * inside, float(np.sqrt(2.0 * fields.less(before).energy))
    error = error_bound(residual, defect, s)
    size = float(np.sqrt(2.0 * fields.energy))
    if norm.stopped is not None and norm.stopped.reach <= error < np.inf:
        near, apart = (100.0 * value / size for value in (norm.stopped.reach, error))
        what = (
            f"what sticks or presses holds it only if the error is below {near:.2g} %, and the bound is {apart:.2g} %"
        )
        norm, error = replace(norm, reason=UNHELD.format(what)), np.inf
    if s < LARGEST:
        cells = 2.0 * amplification(s) ** 2 * inside + by_cell(problem, missed) / coercivity(s)
    why = reasons if norm.proved else (*reasons, norm.reason)
    parts = (norm, residual, defect, error, moved, size, cells, why, stress.places)
    return CoulombBounds(shares, *parts, result, companion)


def _pressures(
    state: CompanionState, own: EdgeTractions, known: Discretization, rounding: float
) -> dict[str, FloatArray]:
    """The `pressures` of `friction_norm`, in the unit of stress."""
    found, away = dict[str, FloatArray](), np.abs(state.c - state.contacts.obstacle)
    for trace, rows in zip(state.contacts.traces, known.contacts, strict=True):
        if trace.contact.law == "unilateral":
            touches = away[trace.start + trace.columns].max(axis=1, keepdims=True) <= rounding
            found[trace.name] = np.where(touches, np.maximum(-own.normal[rows.edges], 0.0), 0.0)
    return found


def _either_way(state: CompanionState, shares: Mapping[str, Share]) -> FloatArray:
    """3 μ at coefficients (n,) of edges far from the obstacle, where v may slip either way with friction, else 0."""
    found = np.zeros(state.contacts.count)
    for trace in state.contacts.traces:
        if trace.name in shares:
            share = shares[trace.name]
            found[trace.start + trace.columns[np.isnan(share.slipping)]] = AWAY * share.friction
    return found


def _opening(state: CompanionState, shares: Mapping[str, Share]) -> FloatArray:
    """What Σ has of g − v_N at coefficients (n,), dimensionless: less 3 μ |v_T − w| where v may slip either way."""
    across, along = (state.c - state.contacts.obstacle).reshape(2, -1)
    return np.asarray(-across - _either_way(state, shares) * np.abs(along))


_CUTS: Final = (1e-6, 3e-2, 0.1, 0.3)
"""Shares of the largest opening, slip, pressure or room below the bound of a contact that count as none.

Any share gives bounds. A small one makes m large where edges at the end of stick are short: |ζ_T| grows there towards
the end, as κ(τ) falls. A large one makes the dual pair poor. The bounds of all hold.
"""

_NOISE: Final = 1e-7  # of the largest displacement or traction: what solvers leave of zero
_MOVED: Final = 1e-5  # of the largest displacement of the body: no less is the largest one on a contact
_LOADED: Final = 1e-2  # of the largest stress: no less is the largest pressure on a contact
_ROUNDED: Final = 1e-12  # of a force: rounding of its sums
_ROUNDING: Final = 1e-9  # of the largest: what is left where the dual pair must vanish
_FAINT: Final = 1e-3  # of the unit of stress: a dual pair of no more, as where balance gives the force, is rounding


def coulomb_force_bounds(errors: CoulombBounds) -> dict[str, Bounds]:
    """T3: bounds of "NAME.normal_force" and "NAME.tangential_force" [stress × length] of contacts that are not tied.

    Those are left out of which no dual pair is found: the resultant of friction on a contact that ends where a support
    holds its tangential displacement, and all where a contact has Tresca's law. Where the norm for s is proved, those
    of the dual problems must be, too.
    """
    stress, companion = errors.stress, errors.displacement
    problem, known, state, found = stress.problem, stress.discretization, companion.state, dict[str, Bounds]()
    bonded = any(bears_shear(each) and not has_coulomb(each) for each in problem.contacts)
    if bonded or not np.isfinite(errors.within) or state is None or 2 * state.contacts.count > MOST:
        return {}
    defect, stopped = defect_bound(errors.residual, errors.defect, errors.norm.value), errors.norm.stopped
    if stopped is not None:
        defect += stopped.work(errors.shares, errors.within, defect)
    fields = CellFields.of(known, stress.dofs, companion.degree)
    body = BodyAtRest.of(problem, companion.degree)
    changes = LeastChange.of(known.qvi.K, sparse.csr_array(sparse.vstack([known.qvi.N, known.qvi.T, known.qvi.A])))
    for cut in _CUTS:
        pairs = _Pairs(errors, defect, known, state, body, fields, changes, cut)
        for trace in body.contacts.traces:
            whole = np.stack([np.full(trace.count, -1.0), trace.senses])  # a of the one force, b of the other
            one_way = not np.ptp(trace.turned * trace.senses[trace.columns], axis=1).any()
            asked = {"normal": trace.contact.law != "tied", "tangential": one_way and trace.name in errors.shares}
            for half, direction in enumerate(asked):
                goal, name = np.zeros((2, body.contacts.count)), f"{trace.name}.{direction}_force"
                goal[half, trace.here] = whole[half]
                bounds = pairs.bounds(goal) if asked[direction] else None
                if bounds is not None:
                    lower, upper = found.get(name, (-np.inf, np.inf))
                    found[name] = Bounds(max(lower, bounds.lower), min(upper, bounds.upper))
    # no wider than the law allows: without tension, and with no more friction than its bound
    unit, contacts = errors.displacement.scales.stress * errors.displacement.scales.length, body.contacts
    for trace in contacts.traces:
        across, along = f"{trace.name}.normal_force", f"{trace.name}.tangential_force"
        if across in found and trace.contact.law == "unilateral":
            (lower, upper), fluid = found[across], unit * float(contacts.fluid[trace.here].sum())
            found[across] = Bounds(max(lower, min(fluid, upper)), upper)
            if along in found:
                most = errors.shares[trace.name].friction * max(upper - fluid, 0.0)
                most += unit * float(contacts.law[1, trace.here] @ trace.weights)  # of cohesion
                found[along] = Bounds(max(found[along].lower, -most), min(found[along].upper, most))
    return found


class _Zones(NamedTuple):
    """Where contacts are open, slip and press: what is less than a cut is 0, what nothing asks for infinite."""

    # opening, slip, (n,): coefficients of g − v_N and of |v_T − w| [length]; pressure, room, (e, q): of |τ_N| and of
    # m (c + μ|τ_N|), m of `Share.room`, on edges of contacts that are not tied [stress]
    opening: FloatArray
    slip: FloatArray
    pressure: FloatArray
    room: FloatArray
    # (n,): coefficients on edges of which some coefficient touches the obstacle; does not slip, without friction none
    closed: BoolArray
    stuck: BoolArray
    # (e,): edges of which some coefficient bears no pressure, where ζ_N = 0; and these with those of which some reaches
    # the friction bound, without friction all, where ζ_T = 0
    loose: BoolArray
    smooth: BoolArray


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Dual pairs z, ζ on the mesh of a result, for goals (2, n): a and b at the coefficients of contacts."""

    errors: CoulombBounds
    defect: float  # no less than Σ [stress × length²]
    known: Discretization  # that of the stress
    state: CompanionState  # that of the displacement
    body: BodyAtRest  # displacements at rest; they have the unit of length D of the discretisation
    fields: CellFields  # τ
    changes: LeastChange  # of all tractions
    cut: float

    def bounds(self, goal: FloatArray) -> Bounds | None:
        """Bounds of ∫ a σ_N + b σ_T ds; None if no z meets the conditions of (D31)."""
        known, error, own = self.known, self.errors.within, self.errors.displacement.scales
        length = known.scales.displacement  # a and b; steps of a history have units of their own
        c, z = self._displacement(goal)
        change, parts = self._continuous(self._stress(c))
        ratio = self._ratio(goal, c, change)
        second = np.inf if ratio is None else self.errors.norm.work(known.problem, parts, error, self.defect)
        if ratio is None or not np.isfinite(second):
            return None
        u, other = self.errors.stress.dofs, self.errors.stress.dofs + known.supports.basis.expanded(change)
        dual = CellFields.of(known, other, self.errors.displacement.degree).less(self.fields)
        work, residual = self._work(z * (length / own.displacement), dual)
        work += known.work(other) - known.work(u)
        contacts = self.body.contacts
        adhesion = contacts.weights[: contacts.count] * contacts.law[1] * self._senses  # of cohesion, where v slips
        load = self.state.load @ z - adhesion @ (c - goal)[1]
        force = own.stress * own.length * float(load + goal.ravel() @ contacts.fluid)
        # what has been rounded: loads and tractions may cancel each other
        largest = np.abs(self.state.load).sum() * np.abs(z).max() + contacts.weights @ np.abs(self.state.tractions)
        middle, terms = work / length - force, abs(work / length) + own.stress * own.length * float(largest)
        rest = (error * residual + ratio * self.defect + second) / length + _ROUNDED * terms
        return Bounds(float(middle - rest), float(middle + rest))

    @cached_property
    def _zones(self) -> _Zones:
        state, unit, own = self.state, self.known.scales.stress, EdgeTractions.of(self.known, self.errors.stress.dofs)
        n, left, free = state.contacts.count, _opening(state, self.errors.shares), np.isnan(state.contacts.slipping)
        moved, beyond = state.c.reshape(2, n), (state.c - state.contacts.obstacle).reshape(2, n)
        pressure, room = np.empty_like(own.normal), np.full_like(own.normal, np.inf)
        away, held = np.full((2, n), np.inf), np.zeros((2, n), dtype=bool)
        # where all of a contact is closed and sticks its displacements are the rounding of those of the body
        least = _MOVED * float(np.abs(state.v).max(initial=0.0))
        # and the pressure of one that is open that of solvers
        faint = _LOADED * unit * max(own.size, self.errors.stress.certificate.scales.get("stress", 0.0))

        def shown(values: FloatArray, whole: FloatArray, least: float) -> FloatArray:
            """The values, 0 where they count as none beside what they are part of."""
            size = max(float(np.abs(whole).max(initial=0.0)), least)
            return np.where(values > max(self.cut * float(values.max(initial=0.0)), _NOISE * size), values, 0.0)

        for trace, rows in zip(state.contacts.traces, self.known.contacts, strict=True):
            if trace.contact.law == "tied":
                continue
            here, e, share = trace.here, rows.edges, self.errors.shares.get(trace.name)
            parts = [left[here]]
            pressure[e] = shown(-unit * own.normal[e], unit * own.normal[e], faint)
            if share is not None:
                room[e] = shown(unit * own.bound[e] * share.room, unit * own.normal[e], faint)
                parts.append(self._senses[here] * beyond[1, here])
            on_edges = trace.start + trace.columns
            for half, part in enumerate(parts):
                away[half, here] = shown(part, moved[:, here], least)
                if half:
                    away[half, here][free[here]] = np.inf
                held[half, on_edges[(away[half, on_edges] == 0.0).any(axis=1)]] = True
        loose, sliding = (np.asarray(part.any(axis=1)) for part in (pressure == 0.0, (room == 0.0) | np.isinf(room)))
        opening, slip = self.errors.displacement.scales.displacement * away
        return _Zones(opening, slip, pressure, room, held[0], held[1], loose, loose | sliding)

    @cached_property
    def _senses(self) -> FloatArray:
        """1 or −1 where v may slip along the tangent or against it, else 0 (n,)."""
        return np.nan_to_num(self.state.contacts.slipping)

    @cached_property
    def _turned(self) -> FloatArray:
        """Of coefficients (n,): μ s where v slips, else 0."""
        return np.asarray(self.body.contacts.law[0] * self._senses)

    @cached_property
    def _spaces(self) -> tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray]:
        """Where z and its tests may move, whatever a and b: closed, stuck, P, Z, and the energies with tests as rows.

        At closed coefficients z_N + μ s z_T is given, at stuck ones z_T. All w of the interface that meet these
        conditions with right-hand side d, and 0 where contacts are tied, are P d + Z y.
        """
        body, n = self.body, self.body.contacts.count
        closed = np.flatnonzero(self._zones.closed & body.live[:n])
        stuck = np.flatnonzero(self._zones.stuck & body.live[n:])
        normal, shear, tied = body.B[closed], body.B[n + stuck], body.B[np.tile(body.contacts.tied, 2) & body.live]
        trial = np.vstack([normal + self._turned[closed, None] * body.B[n + closed], shear, tied])
        return closed, stuck, *solutions(trial), solutions(np.vstack([normal, shear, tied]))[1].T @ body.body.S

    def _displacement(self, goal: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Coefficients c (2, n) of z on the contacts, and z (size,), dimensionless: a and b of length 1."""
        body, (closed, stuck, particular, free, energies) = self.body, self._spaces
        wanted = np.concatenate([goal[0, closed] + self._turned[closed] * goal[1, closed], goal[1, stuck]])
        start = particular[:, : len(wanted)] @ wanted
        w = start - free @ np.linalg.lstsq(energies @ free, energies @ start, rcond=1e-13)[0]
        z = body.body.expand(w)
        return (body.contacts.rows @ z).reshape(goal.shape), z

    def _stress(self, c: FloatArray) -> FloatArray:
        """ζ, as a change of the unknowns of the stress: the nearest to Cε(z), with no traction where none may be."""
        qvi, work, (rows, changes) = self.known.qvi, np.zeros((2, self.known.qvi.m)), self._held
        products = product_integrals(self.known.rule.count - 1, self.errors.displacement.degree)
        for trace, own in zip(self.body.contacts.traces, self.known.contacts, strict=True):
            if trace.contact.law != "tied":
                local = np.stack(trace.on_edges(*c[:, trace.here]))
                work[:, own.rows] = (trace.lengths[:, None] * (local @ products.T)).reshape(2, -1)
        x = changes.solved(np.zeros(rows.shape[0]), qvi.N.T @ work[0] + qvi.T.T @ work[1])
        for _ in range(2):  # what is left of the rows is rounding, which must not count
            x = x - changes.solved(rows @ x)
        return x

    @cached_property
    def _held(self) -> tuple[sparse.csr_array, LeastChange]:
        """Rows of tractions that are to vanish, and changes that leave them as they are told."""
        qvi, held = self.known.qvi, (np.repeat(part, self.known.rule.count) for part in self._zones[-2:])
        parts = [sparse.csr_array(part)[chosen] for part, chosen in zip((qvi.N, qvi.T), held, strict=True)]
        rows = sparse.csr_array(sparse.vstack([*parts, qvi.A]))
        return rows, LeastChange.of(qvi.K, rows)

    def _continuous(self, change: FloatArray) -> tuple[FloatArray, dict[str, Share]]:
        """ζ with a ζ_T whose share of the bound is continuous, by the least change, and these shares."""
        qvi, zones, parts = self.known.qvi, self._zones, dict[str, Share]()
        shear, wanted = (qvi.T @ change).reshape(zones.room.shape), np.zeros(zones.room.shape)
        rough = [rows for rows in self.known.contacts if rows.name in self.errors.shares]
        for rows in rough:
            share, held = self.errors.shares[rows.name], zones.smooth[rows.edges]
            bound = np.where(held[:, None], 1.0, share.weights)
            values = np.where(held[:, None], 0.0, shear[rows.edges] / bound)
            slipping = held.astype(np.float64)  # these keep their value, as what slips does
            parts[rows.name] = replace(share, values=values, weights=bound, slipping=slipping)
        found, _ = joined(self.known.problem, parts, np.zeros(len(self.known.problem.mesh.vertices), dtype=bool))
        for rows in rough:
            before, after = parts[rows.name], found[rows.name]
            wanted[rows.edges] = (after.values - before.values) * before.weights
        if wanted.any():
            right = np.concatenate([np.zeros(qvi.m), wanted.ravel(), np.zeros(qvi.A.shape[0])])
            change = change + self.changes.solved(right)
        return change, found

    def _ratio(self, goal: FloatArray, c: FloatArray, change: FloatArray) -> float | None:
        """The largest of m₁ to m₄; None if there is none."""
        qvi, zones, scales, found = self.known.qvi, self._zones, self.known.scales, 0.0
        across, slip = c - goal
        either = _either_way(self.state, self.errors.shares)
        pushed = np.where(either > 0.0, np.abs(across) + either * np.abs(slip), np.abs(across + self._turned * slip))
        moved = (scales.displacement * part for part in (pushed, slip))
        normal, shear = (scales.stress * (rows @ change).reshape(zones.room.shape) for rows in (qvi.N, qvi.T))
        units = np.repeat([scales.displacement, max(float(np.abs(normal).max()), _FAINT * scales.stress)], 2)
        for part, whole, unit in zip((*moved, normal, shear), zones[:4], units, strict=True):
            none = whole == 0.0
            if np.abs(part[none]).max(initial=0.0) > _ROUNDING * unit:
                return None
            found = max(found, float((np.abs(part[~none]) / whole[~none]).max(initial=0.0)))
        return found

    def _work(self, z: FloatArray, dual: CellFields) -> tuple[float, float]:
        """∫ τ : (ε(z) − cζ) + ε⁰ : ζ dx, and |ε(z) − cζ|, with springs."""
        fields, companion = self.fields, self.errors.displacement
        strain = companion.cell_strain(fields.t, z)
        apart = strain - np.einsum("ckl,cgl->cgk", fields.compliances, dual.stress)
        size = float(dual.apart(strain).sum())
        work = float(np.einsum("cg,cgk,cgk->", fields.weights, fields.stress, apart))
        work += fields.work(dual.stress, fields.at_rest)
        stretched, t = self.body.contacts.stretched(z), gauss_legendre(EDGE_POINTS)[0]
        for own, each in zip(fields.springs, dual.springs, strict=True):
            missed = each.missed(companion.along(each.name, stretched, t))  # k (d + ζ/k): springs bear −τ and −ζ
            size += float((each.weights * missed**2).sum())
            work -= float((each.weights * own.traction * missed).sum())
        return work, float(np.sqrt(size))
