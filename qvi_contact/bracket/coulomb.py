"""Bounds of errors and of contact forces under Coulomb's law, wherever the solution sticks, slips or opens.

For the forces (D31), z solves the dual problem with the displacement elements of the companion, and ζ is the stress
nearest to C ε(z). Both are cut to 0 where their ratios m to the pressure, slip, opening or unused friction are large.

In `docs/theory.md`: (D26), (D27), (D28), (D31).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Final, NamedTuple

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.basics.schema import WithFields
from qvi_contact.bracket.norms import (
    LARGEST,
    FrictionNorm,
    amplification,
    coercivity,
    error_bound,
    friction_norm,
    likely_norm,
)
from qvi_contact.bracket.parts import EDGE_POINTS, LOOSEST, Bounds, CellFields, EdgeTractions, edge_parts
from qvi_contact.bracket.share import AWAY, Share, SharedStress, joined
from qvi_contact.companion import CompanionResult, CompanionState
from qvi_contact.companion.contact import LeastChange
from qvi_contact.companion.model import MOST, BodyAtRest, solutions
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.element.edge import gauss_legendre, product_integrals
from qvi_contact.problem.conditions import bears_shear
from qvi_contact.problem.problem import by_cell
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.stress import rest_on_arcs


@dataclass(frozen=True, eq=False, repr=False)
class CoulombBounds(WithFields):
    """Bounds of the errors under Coulomb's law.

    Let u, σ be any solution of the problem stated, τ the stress of the result and v the displacement of the bracket. In
    the energy norms |τ|² = ∫ τ : c : τ and |v|² = ∫ ε(v) : C : ε(v),

        |σ − τ| ≤ F + |η|,    |u − v| ≤ F.

    Where contacts alone hold a body, this is so only for solutions with |σ − τ| ≤ `reach` |τ + η|.
    """

    shares: Mapping[str, Share]
    """s = −τ_T/(c + μ|τ_N|) by contact with Coulomb friction, continuous along it."""
    norm: FrictionNorm
    """The norm of R for s and μ, and whether it is proved."""
    residual: float
    """ρ = |τ + η − Cε(v)| [√energy], with springs ∫ (τ + k d)²/k ds in its square."""
    defect: float
    """δ = ∫ |τ_N| (g − v_N) ds, with the work of violations that the solver left [stress × length²]."""
    within: float
    """F [√energy]; infinite where the norm is not below 2."""
    moved: float
    """|η| of the change of the stress that makes s continuous [√energy]."""
    size: float
    """|τ + η| [√energy], or the norm of the stress that the data suggest if the body has no stress but rounding."""
    cells: FloatArray
    """(cells,): f²ρ² + δ/α by cell [stress × length²], the indicator of refinement."""
    reasons: tuple[str, ...]
    """Why the bounds are not guaranteed; empty if they are."""
    places: tuple[str, ...]
    """A sentence for each vertex where s had to be 0 although the contact slips there."""
    stress: ContactResult
    displacement: CompanionResult
    """The results with the stress τ + η and the displacement v."""

    def __repr__(self) -> str:
        return f"<CoulombBounds {self.message}>"

    @cached_property
    def forces(self) -> Mapping[str, Bounds]:
        """T3: bounds [stress × length] of "NAME.normal_force" and "NAME.tangential_force" of contacts not tied.

        A dual problem is solved on first use. A force without a dual pair is left out: that of a contact which ends
        where a support, or another contact that sticks, holds its displacement, and all forces if a contact has
        cohesion with a limit of the shear stress. If the norm for s is proved, the dual one must be, too. See (D31).
        """
        stress, companion = self.stress, self.displacement
        problem, known, state, found = stress.problem, stress.discretization, companion.state, dict[str, Bounds]()
        is_capped = any(bears_shear(each) and each.shear_limit is not None for each in problem.contacts)
        if is_capped or not np.isfinite(self.within) or state is None or 2 * state.contacts.count > MOST:
            return {}
        defect = self.norm.slack(self.shares, self.residual, self.defect, self.within)
        fields = CellFields.of(known, stress.dofs, companion.degree)
        body = BodyAtRest.of(problem, companion.degree)
        changes = LeastChange.of(known.qvi.K, sparse.csr_array(sparse.vstack([known.qvi.N, known.qvi.T, known.qvi.A])))
        for cut in _CUTS:
            pairs = _Pairs(self, defect, known, state, body, fields, changes, cut)
            for trace in body.contacts.traces:
                parts = np.stack([np.full(trace.count, -1.0), trace.senses])  # a of the one force, b of the other
                one_way = not np.ptp(trace.turned * trace.senses[trace.columns], axis=1).any()
                wanted = {"normal": trace.contact.law != "tied", "tangential": one_way and bears_shear(trace.contact)}
                for row, direction in enumerate(wanted):
                    goal, name = np.zeros((2, body.contacts.count)), f"{trace.name}.{direction}_force"
                    goal[row, trace.here] = parts[row]
                    bounds = pairs.bounds(goal) if wanted[direction] else None
                    if bounds is not None:
                        lower, upper = found.get(name, (-np.inf, np.inf))
                        found[name] = Bounds(max(lower, bounds.lower), min(upper, bounds.upper))
        # the law's own bounds: no tension, and friction up to its bound
        unit, contacts = self.displacement.scales.stress * self.displacement.scales.length, body.contacts
        for trace in contacts.traces:
            across, along = f"{trace.name}.normal_force", f"{trace.name}.tangential_force"
            if across in found and trace.contact.law == "unilateral":
                (lower, upper), fluid = found[across], unit * float(contacts.fluid[trace.here].sum())
                found[across] = Bounds(max(lower, min(fluid, upper)), upper)
                if along in found:
                    friction = self.shares[trace.name].friction if trace.name in self.shares else 0.0
                    most = friction * max(upper - fluid, 0.0)
                    most += unit * float(contacts.law[1, trace.here] @ trace.weights)  # cohesion
                    found[along] = Bounds(max(found[along].lower, -most), min(found[along].upper, most))
        return found

    @cached_property
    def likely(self) -> CoulombBounds | None:
        """The estimated bounds by the norm of finite elements; None unless F is guaranteed, and 1.5 times as large."""
        if not self.guaranteed or self.within <= _WIDER * error_bound(self.residual, self.defect, 0.0):
            return None  # a norm below 0 there is not
        norm = likely_norm(self.stress.problem, self.shares)
        within = error_bound(self.residual, self.defect, norm.value)
        is_wider = self.within > _WIDER * within
        return replace(self, norm=norm, within=within, reasons=(norm.reason,)) if is_wider else None

    @property
    def error(self) -> float:
        """F + |η| [√energy], a bound of the errors of the result's stress and of the displacement."""
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
        return self.error / self.size

    @property
    def apart(self) -> float:
        """2F/|τ + η|: the largest distance of any two solutions, in the energy norm of stresses."""
        return 2.0 * self.within / self.size

    @property
    def reach(self) -> float:
        """The bounds hold for solutions within this distance of τ, over |τ + η|; infinite if they hold for all."""
        return max(self.norm.reach - self.moved, 0.0) / self.size

    @property
    def scope(self) -> str:
        """The solutions for which the bounds hold, after the word "solutions"; empty if they hold for all."""
        if self.reach < _FAR:
            return f" within {100.0 * self.reach:.3g} % of this one"
        return f" with less than {self.reach - 1.0:.2g} times these stresses" if np.isfinite(self.reach) else ""

    @property
    def message(self) -> str:
        """The bound of the stresses, its condition, and the reasons why it is not guaranteed."""
        if not np.isfinite(self.within):
            return f"No bound under friction. {self.norm.reason}"
        error = f"stresses within {100.0 * self.relative_error:.2g} % of their energy norm."
        if self.relative_error > 1.0:
            error = "the error of the stresses may be as large as they are. Refine the mesh."
        if self.size == np.sqrt(2.0 * reference_energy(self.stress, 0.0)):
            error = "the stresses are rounding."
        scope = f"It holds for solutions{self.scope}, as {self.norm.stopped[0].energies.cause}." if self.scope else ""
        bound = f"{self.kind.capitalize()} bound under friction: {error}"
        likely = "" if self.likely is None else f"An estimate is {100.0 * self.likely.relative_error:.2g} %."
        return " ".join(filter(None, [bound, likely, scope, *self.reasons, *self.places[:1]]))


_WIDER: Final = 1.5  # a guaranteed F over an estimated one, from which on users get both
_FAR: Final = 10.0  # norms of the stress: a distance from there on is told by the size of the other stresses


def reference_energy(result: ContactResult, strain: float) -> float:
    """The reference of errors: the energy `strain` of a stress, or that of the unit if the stress is rounding."""
    unit = result.discretization.scales.energy * max(1.0, result.certificate.scales.get("energy", 0.0))
    return strain if strain > _AT_REST * unit else unit


def coulomb_bounds(
    stress: SharedStress, companion: CompanionResult, reasons: tuple[str, ...] = ()
) -> CoulombBounds | str:
    """T5 with T2: bounds from a stress with continuous shares and a displacement that slips as they allow, or why not.

    The given `reasons` and those of the companion say why the stress or the displacement is not exactly admissible.
    """
    reasons = tuple(dict.fromkeys((*reasons, *companion.reasons)))
    result, shares, known = stress.result, stress.shares, stress.result.discretization
    tractions, unit, problem = EdgeTractions.of(known, result.dofs), known.scales.stress, known.problem
    excess, tension = tractions.violations(tractions.bound)
    # the size of rounding counts too: without loads there is nothing else
    allowed = LOOSEST * max(tractions.size, result.certificate.scales.get("stress", 0.0))
    for rows in known.contacts:
        if rows.law != "tied" and max(excess[rows.edges].max(), tension[rows.edges].max()) > allowed:
            return f"The stress does not obey the law of contact {rows.name!r} on whole edges."
    if companion.state is None:
        return f"No admissible displacement was found: {companion.message}"
    if companion.state.contradiction:
        return companion.state.contradiction
    state = companion.state
    rounding = _ROUNDING * max(1.0, float(np.abs(state.c).max(initial=0.0)))
    if (_opening(state, shares) < -rounding).any():
        return "No displacement was found that is as far from an obstacle as the bound needs where contact is open."
    # ½ρ² by cell, with springs, and δ by contact edge
    fields, earlier = (CellFields.of(known, each.dofs, companion.degree) for each in (result, stress.before))
    edges, slack = edge_parts(fields, known, tractions, tractions.bound, companion)
    half_square = fields.bulk(companion)
    half_square += by_cell(problem, {name: part.springs for name, part in edges.items()})
    defects = {name: np.maximum(part.contact, 0.0) + np.maximum(part.friction, 0.0) for name, part in edges.items()}
    residual = float(np.sqrt(2.0 * half_square.sum()))
    arcs = [lines.take(lines.bent).length for lines in (problem.mesh.boundary, problem.mesh.interior) if lines.curved]
    if arcs:  # estimated norm of the tractions that are left on arcs: k h √c, k their mean square root on an edge
        rest, compliance = rest_on_arcs(known, result.dofs), float(problem.compliances[:, 0, 0].max())
        squares = rest**2 @ gauss_legendre(rest.shape[1])[1]
        residual += float(np.sqrt(compliance * squares @ np.concatenate(arcs) ** 2))
    defect = slack + float(sum(part.sum() for part in defects.values()))
    error_of = partial(error_bound, residual, defect)
    size = float(np.sqrt(2.0 * reference_energy(result, fields.energy)))
    pressures, distance = dict[str, FloatArray](), np.abs(state.c - state.contacts.obstacle)
    for trace, rows in zip(state.contacts.traces, known.contacts, strict=True):
        if trace.contact.law == "unilateral":
            is_closed = distance[trace.start + trace.columns].max(axis=1, keepdims=True) <= rounding
            pressures[trace.name] = np.where(is_closed, np.maximum(-tractions.normal[rows.edges], 0.0), 0.0)
    norm = friction_norm(problem, shares, unit, pressures, error_of, size)
    r, indicator, eta_size = norm.value, 0.0 * half_square, float(np.sqrt(2.0 * fields.less(earlier).energy))
    error = error_of(r) if error_of(r) < norm.reach else np.inf
    if r < LARGEST:
        indicator = 2.0 * amplification(r) ** 2 * half_square + by_cell(problem, defects) / coercivity(r)
    all_reasons = reasons if norm.proved else (*reasons, norm.reason)
    parts = (norm, residual, defect, error, eta_size, size, indicator, all_reasons, stress.places)
    return CoulombBounds(shares, *parts, result, companion)


def _either_way(state: CompanionState, shares: Mapping[str, Share]) -> FloatArray:
    """3 μ at the coefficients (n,) of edges far from the obstacle, where v may slip either way; 0 at others."""
    factors = np.zeros(state.contacts.count)
    for trace in state.contacts.traces:
        if trace.name in shares:
            share = shares[trace.name]
            factors[trace.start + trace.columns[np.isnan(share.slipping)]] = AWAY * share.friction
    return factors


def _opening(state: CompanionState, shares: Mapping[str, Share]) -> FloatArray:
    """The opening in Σ at coefficients (n,), dimensionless: g − v_N, less 3 μ |v_T − w| where v may slip either way."""
    across, along = (state.c - state.contacts.obstacle).reshape(2, -1)
    return np.asarray(-across - _either_way(state, shares) * np.abs(along))


_CUTS: Final = (1e-6, 3e-2, 0.1, 0.3)
"""Cuts, relative to the largest opening, slip, pressure or unused friction of a contact: smaller values count as 0.

Every cut gives valid bounds, and the narrowest are taken. With a small cut, m is large where edges at the end of stick
are short: |ζ_T| grows towards the end and κ(τ) falls. With a large cut, the dual pair is poor.
"""

_NOISE: Final = 1e-7  # relative to the largest displacement or traction: smaller values are zero up to solvers' errors
_MOVED: Final = 1e-5  # of the body's largest displacement: the least reference for displacements on a contact
_LOADED: Final = 1e-2  # of the largest stress: the least reference for pressures on a contact
_AT_REST: Final = 1e-18  # of the energy of the unit of stress: smaller stresses are rounding
_ROUNDED: Final = 1e-12  # of the terms of a force: the rounding of their sum
_ROUNDING: Final = 1e-9  # of the largest value: rounding where the dual pair or the opening must vanish
_FAINT: Final = 1e-3  # of the unit of stress: the least reference for ζ, which is rounding if balance gives the force


class _Zones(NamedTuple):
    """Opening, slip, pressure and unused friction on contacts: 0 below the cut, infinite where no condition is set."""

    opening: FloatArray  # (n,): coefficients of g − v_N [length]
    slip: FloatArray  # (n,): coefficients of |v_T − w| [length]
    pressure: FloatArray  # (e, q): coefficients of |τ_N| [stress], on edges of contacts that are not tied
    room: FloatArray  # (e, q): of m (c + μ|τ_N|) [stress] there, m of `Share.room`; of c − |τ_T| under Tresca's law
    closed: BoolArray  # (n,): coefficients of edges that touch the obstacle somewhere
    stuck: BoolArray  # (n,): coefficients of edges with friction that stick somewhere
    loose: BoolArray  # (e,): edges without pressure somewhere, where ζ_N = 0
    smooth: BoolArray  # (e,): loose edges, edges at the bound somewhere, and edges without friction, where ζ_T = 0


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Dual pairs z, ζ of (D31) on the mesh of a result, for goals (2, n): a and b at the coefficients of contacts."""

    errors: CoulombBounds
    defect: float  # a bound of Σ [stress × length²]
    known: Discretization  # of the stress τ
    state: CompanionState  # of the displacement v
    body: BodyAtRest  # displacements that vanish on supports, in the discretization's unit of displacement
    fields: CellFields  # of τ
    changes: LeastChange  # least changes of stress under given changes of all tractions
    cut: float

    def bounds(self, goal: FloatArray) -> Bounds | None:
        """Bounds of Q = ∫ a σ_N + b σ_T ds by (D31); None if no z meets its conditions."""
        known, error, units = self.known, self.errors.within, self.errors.displacement.scales
        length = known.scales.displacement  # of a and b; each step of a history has its own units
        c, z = self._displacement(goal)
        change, shares = self._continuous(self._stress(c))
        m = self._ratio(goal, c, change)
        sizes = self.errors.residual, self.errors.defect, error
        second = np.inf if m is None else self.errors.norm.work(known.problem, shares, *sizes)
        if m is None or not np.isfinite(second):
            return None
        dofs, changed_dofs = self.errors.stress.dofs, self.errors.stress.dofs + known.supports.basis.expanded(change)
        dual = CellFields.of(known, changed_dofs, self.errors.displacement.degree).less(self.fields)
        work, residual = self._work(z * (length / units.displacement), dual)
        work += known.work(changed_dofs) - known.work(dofs)
        contacts = self.body.contacts
        adhesion = contacts.weights[: contacts.count] * contacts.law[1] * self._senses  # s k in (D31), where v slips
        load = self.state.load @ z - adhesion @ (c - goal)[1]
        force = units.stress * units.length * float(load + goal.ravel() @ contacts.fluid)
        # rounding is relative to the sum of the sizes of loads and tractions, which may cancel
        size = np.abs(self.state.load).sum() * np.abs(z).max() + contacts.weights @ np.abs(self.state.tractions)
        middle, terms = work / length - force, abs(work / length) + units.stress * units.length * float(size)
        rest = (error * residual + m * self.defect + second) / length + _ROUNDED * terms
        return Bounds(float(middle - rest), float(middle + rest))

    @cached_property
    def _zones(self) -> _Zones:
        state, unit, own = self.state, self.known.scales.stress, EdgeTractions.of(self.known, self.errors.stress.dofs)
        n, openings = state.contacts.count, _opening(state, self.errors.shares)
        any_way = np.isnan(state.contacts.slipping)
        moved, relative = state.c.reshape(2, n), (state.c - state.contacts.obstacle).reshape(2, n)
        pressure, room = np.full((2, *own.normal.shape), np.inf)
        zones, zero = np.full((2, n), np.inf), np.zeros((2, n), dtype=bool)
        # displacements of a contact that is closed and sticks everywhere are rounding, as are pressures of an open one
        least_displacement = _MOVED * float(np.abs(state.v).max(initial=0.0))
        faint = _LOADED * unit * max(own.size, self.errors.stress.certificate.scales.get("stress", 0.0))

        def cut_values(values: FloatArray, whole: FloatArray, least: float) -> FloatArray:
            """The values, or 0 where they are below the cut or are rounding of the field `whole`."""
            size = max(float(np.abs(whole).max(initial=0.0)), least)
            return np.where(values > max(self.cut * float(values.max(initial=0.0)), _NOISE * size), values, 0.0)

        for trace, rows in zip(state.contacts.traces, self.known.contacts, strict=True):
            if trace.contact.law == "tied":
                continue
            here, edges, share = trace.here, rows.edges, self.errors.shares.get(trace.name)
            parts = [openings[here]]
            pressure[edges] = cut_values(-unit * own.normal[edges], unit * own.normal[edges], faint)
            if bears_shear(trace.contact):
                bound = own.bound[edges]
                unused = bound - np.abs(own.shear[edges]) if share is None else bound * share.room
                room[edges] = cut_values(unit * unused, unit * own.normal[edges], faint)
                parts.append(self._senses[here] * relative[1, here])
            on_edges = trace.start + trace.columns
            for row, part in enumerate(parts):
                zones[row, here] = cut_values(part, moved[:, here], least_displacement)
                if row and share is not None:
                    zones[row, here][any_way[here]] = np.inf
                zero[row, on_edges[(zones[row, on_edges] == 0.0).any(axis=1)]] = True
        loose, smooth = (np.asarray(part.any(axis=1)) for part in (pressure == 0.0, (room == 0.0) | np.isinf(room)))
        opening, slip = self.errors.displacement.scales.displacement * zones
        return _Zones(opening, slip, pressure, room, zero[0], zero[1], loose, loose | smooth)

    @cached_property
    def _senses(self) -> FloatArray:
        """1 or −1 at coefficients (n,) where v slips along the tangent or against it, or may; else 0.

        Under Tresca's law it is the sign of the slip, where this has one sign on all edges of a coefficient.
        """
        contacts, senses = self.state.contacts, np.nan_to_num(self.state.contacts.slipping)
        slip = (self.state.c - contacts.obstacle)[contacts.count :]
        slip = np.where(np.abs(slip) > _NOISE * np.abs(self.state.c).max(initial=0.0), slip, 0.0)  # else it is rounding
        for trace in contacts.traces:
            if bears_shear(trace.contact) and trace.name not in self.errors.shares:
                along = trace.on_edges(slip[trace.here], slip[trace.here])[1]
                signs = np.sign(along.sum(axis=1))
                has_one_sign = (signs[:, None] * along >= 0.0).all(axis=1)
                senses[trace.here] = trace.slipping_on(np.where(has_one_sign, signs, 0.0))
        return senses

    @cached_property
    def _turned(self) -> FloatArray:
        """μ s at coefficients (n,) where v slips; else 0."""
        return np.asarray(self.body.contacts.law[0] * self._senses)

    @cached_property
    def _spaces(self) -> tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray]:
        """The coefficients where z is prescribed and the spaces of z and its tests: closed, stuck, P, Z, tests · S.

        At closed coefficients z_N + μ s z_T is prescribed, at stuck ones z_T. The unknowns w that meet these conditions
        with the right-hand side d, and vanish where contacts are tied, are P d + Z y. They do not depend on a and b.
        """
        body, n = self.body, self.body.contacts.count
        closed = np.flatnonzero(self._zones.closed & body.live[:n])
        stuck = np.flatnonzero(self._zones.stuck & body.live[n:])
        normal, shear, tied = body.B[closed], body.B[n + stuck], body.B[np.tile(body.contacts.tied, 2) & body.live]
        trial = np.vstack([normal + self._turned[closed, None] * body.B[n + closed], shear, tied])
        return closed, stuck, *solutions(trial), solutions(np.vstack([normal, shear, tied]))[1].T @ body.body.S

    def _displacement(self, goal: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Coefficients c (2, n) of z on the contacts, and z (size,), dimensionless; a and b count as lengths of 1."""
        body, (closed, stuck, particular, free_w, energies) = self.body, self._spaces
        prescribed = np.concatenate([goal[0, closed] + self._turned[closed] * goal[1, closed], goal[1, stuck]])
        particular_w = particular[:, : len(prescribed)] @ prescribed
        w = particular_w - free_w @ np.linalg.lstsq(energies @ free_w, energies @ particular_w, rcond=1e-13)[0]
        z = body.body.expand(w)
        return (body.contacts.rows @ z).reshape(goal.shape), z

    def _stress(self, c: FloatArray) -> FloatArray:
        """ζ as a change of the stress unknowns: nearest to C ε(z), with zero traction where (D31) demands it."""
        qvi, work, (held_rows, changes) = self.known.qvi, np.zeros((2, self.known.qvi.m)), self._held
        products = product_integrals(self.known.rule.count - 1, self.errors.displacement.degree)
        for trace, rows_of_contact in zip(self.body.contacts.traces, self.known.contacts, strict=True):
            if trace.contact.law != "tied":
                local = np.stack(trace.on_edges(*c[:, trace.here]))
                work[:, rows_of_contact.rows] = (trace.lengths[:, None] * (local @ products.T)).reshape(2, -1)
        x = changes.solved(np.zeros(held_rows.shape[0]), qvi.N.T @ work[0] + qvi.T.T @ work[1])
        for _ in range(2):  # corrections of the rounding of the rows, where tractions must vanish exactly
            x = x - changes.solved(held_rows @ x)
        return x

    @cached_property
    def _held(self) -> tuple[sparse.csr_array, LeastChange]:
        """Rows of tractions that must vanish, and the least changes under given values of these rows."""
        qvi, is_held = self.known.qvi, (np.repeat(part, self.known.rule.count) for part in self._zones[-2:])
        blocks = [sparse.csr_array(part)[chosen] for part, chosen in zip((qvi.N, qvi.T), is_held, strict=True)]
        rows = sparse.csr_array(sparse.vstack([*blocks, qvi.A]))
        return rows, LeastChange.of(qvi.K, rows)

    def _continuous(self, change: FloatArray) -> tuple[FloatArray, dict[str, Share]]:
        """ζ after the least change that makes the share p = ζ_T/B(τ) continuous, and these shares."""
        if not self.errors.shares:
            return change, {}
        qvi, zones, raw = self.known.qvi, self._zones, dict[str, Share]()
        shear, wanted = (qvi.T @ change).reshape(zones.room.shape), np.zeros(zones.room.shape)
        rough = [rows for rows in self.known.contacts if rows.name in self.errors.shares]
        for rows in rough:
            share, held = self.errors.shares[rows.name], zones.smooth[rows.edges]
            bound = np.where(held[:, None], 1.0, share.weights)
            values = np.where(held[:, None], 0.0, shear[rows.edges] / bound)
            slipping = held.astype(np.float64)  # `joined` keeps the value 0 of these edges, as of edges that slip
            raw[rows.name] = replace(share, values=values, weights=bound, slipping=slipping)
        continuous, _ = joined(self.known.problem, raw, np.zeros(len(self.known.problem.mesh.vertices), dtype=bool))
        for rows in rough:
            before, after = raw[rows.name], continuous[rows.name]
            wanted[rows.edges] = (after.values - before.values) * before.weights
        if wanted.any():
            right = np.concatenate([np.zeros(qvi.m), wanted.ravel(), np.zeros(qvi.A.shape[0])])
            change = change + self.changes.solved(right)
        return change, continuous

    def _ratio(self, goal: FloatArray, c: FloatArray, change: FloatArray) -> float | None:
        """The largest of m₁ to m₄ in (D31); None if there is no such number."""
        qvi, zones, scales, largest = self.known.qvi, self._zones, self.known.scales, 0.0
        across, slip = c - goal
        slope = _either_way(self.state, self.errors.shares)
        pushed = np.where(slope > 0.0, np.abs(across) + slope * np.abs(slip), np.abs(across + self._turned * slip))
        misfits = (scales.displacement * dual_part for dual_part in (pushed, slip))
        normal, shear = (scales.stress * (rows @ change).reshape(zones.room.shape) for rows in (qvi.N, qvi.T))
        units = np.repeat([scales.displacement, max(float(np.abs(normal).max()), _FAINT * scales.stress)], 2)
        for dual_part, primal, unit in zip((*misfits, normal, shear), zones[:4], units, strict=True):
            is_zero = primal == 0.0
            if np.abs(dual_part[is_zero]).max(initial=0.0) > _ROUNDING * unit:
                return None
            largest = max(largest, float((np.abs(dual_part[~is_zero]) / primal[~is_zero]).max(initial=0.0)))
        return largest

    def _work(self, z: FloatArray, dual: CellFields) -> tuple[float, float]:
        """∫ τ : (ε(z) − cζ) − ε⁰ : ζ dx and |ε(z) − cζ|, both with springs."""
        fields, companion = self.fields, self.errors.displacement
        strain = companion.cell_strain(fields.t, z)
        misfit = strain - np.einsum("ckl,cgl->cgk", fields.compliances, dual.stress)
        size = float(dual.apart(strain).sum())
        work = float(np.einsum("cg,cgk,cgk->", fields.weights, fields.stress, misfit))
        work += fields.work(dual.stress, fields.at_rest)
        stretch, t = self.body.contacts.stretched(z), gauss_legendre(EDGE_POINTS)[0]
        for spring, dual_spring in zip(fields.springs, dual.springs, strict=True):
            gap = dual_spring.missed(companion.along(dual_spring.name, stretch, t))  # k d + ζ: springs bear −τ and −ζ
            size += float((dual_spring.weights * gap**2).sum())
            work -= float((dual_spring.weights * spring.traction * gap).sum())
        return work, float(np.sqrt(size))
