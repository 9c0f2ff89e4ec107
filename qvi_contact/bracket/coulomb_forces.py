"""Two-sided bounds of contact forces under Coulomb's law, by a dual problem.

For any displacement z of W and any stress ζ without loads the resultant Q = ∫ a σ_N + b σ_T ds differs from a number
that z, ζ, the stress τ and the data give by at most F |ε(z) − cζ| + m (δ + ρ²/(4α)) + r F². z solves the dual
problem on the displacements of the companion, ζ is the stress nearest to it. Both are cut: z_T = b also beside what
sticks, and ζ_T = 0 also beside what slips, so that m is not large. r is the norm of R with ζ_T/(c + μ|τ_N|), made
continuous, in place of s.

In `docs/theory.md`: (D31).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from qvi_contact.basics.checks import BoolArray, FloatArray
from qvi_contact.bracket.friction_norm import FrictionNorm
from qvi_contact.bracket.parts import EDGE_POINTS, Bounds, CellFields, tractions_on
from qvi_contact.bracket.share import LeastChange, Share
from qvi_contact.companion import CompanionResult
from qvi_contact.companion.solver import MOST, BodyAtRest, solutions
from qvi_contact.companion.traces import DisplacementContact
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import ContactRows
from qvi_contact.element import bernstein
from qvi_contact.element.legendre import gauss_legendre
from qvi_contact.problem.conditions import Contact, bears_shear, has_coulomb
from qvi_contact.solution.contact_line import leads_one_way
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.work import obstacle_work, support_work

_CUTS: Final = (1e-6, 1e-1)
"""Shares of the largest opening, slip, pressure or room below the bound of a contact that count as none.

Any share gives bounds. A small one makes m large where edges at the end of stick are short: |ζ_T| grows there towards
the end, as κ(τ) falls. A large one makes the dual pair poor. The bounds of both hold.
"""

_NOISE: Final = 1e-7  # of the largest displacement or traction: what solvers leave of zero
_ROUNDED: Final = 1e-12  # of a force: rounding of its sums
_ROUNDING: Final = 1e-9  # of the largest: what is left where the dual pair must vanish


@dataclass(frozen=True, eq=False)
class _Line:
    """One contact that is not tied: what of it is open, slips and presses.

    Attributes
    ----------
    contact, trace, rows
        The contact in the problem, in the displacements and in the stresses.
    share : Share or None
        s; None without Coulomb friction.
    slipping : (n,) array
        1 or −1 where v may slip along the tangent or against it, else 0.
    start : int
        Its first coefficient among those of all traces.
    opening, slip : (n,) arrays
        Coefficients of g − v_N and |v_T − w| ≥ 0 [length].
    pressure, room : (e, q) arrays
        Coefficients of |τ_N| and m (c + μ|τ_N|) ≥ 0, m of `Share.room` [stress].
    cut : float
        Share of the largest of each that counts as none.
    sizes : (float, float)
        Largest displacement [length] and traction [stress] on the contact.

    """

    contact: Contact
    trace: DisplacementContact
    rows: ContactRows
    share: Share | None
    slipping: FloatArray
    start: int
    opening: FloatArray
    slip: FloatArray
    pressure: FloatArray
    room: FloatArray
    cut: float
    sizes: tuple[float, float]

    @property
    def friction(self) -> float:
        """Coulomb's coefficient μ."""
        return 0.0 if self.share is None else self.share.friction

    @cached_property
    def closed(self) -> BoolArray:
        """Coefficients (n,) on edges of which some coefficient touches the obstacle."""
        return self._spread(self.none(self.opening))

    @cached_property
    def stuck(self) -> BoolArray:
        """Coefficients (n,) on edges of which some coefficient does not slip; none without friction."""
        return self._spread(self.none(self.slip)) & (self.share is not None)

    @cached_property
    def loose(self) -> BoolArray:
        """Edges (e,) of which some coefficient bears no pressure: ζ_N = 0 there."""
        return np.asarray(self.none(self.pressure).any(axis=1))

    @cached_property
    def sliding(self) -> BoolArray:
        """Edges (e,) of which some coefficient reaches the friction bound: ζ_T = 0 there; all without friction."""
        return np.asarray(self.none(self.room).any(axis=1)) | (self.share is None)

    def none(self, values: FloatArray) -> BoolArray:
        """Which coefficients of one of the four count as none."""
        size = self.sizes[int(values is self.pressure or values is self.room)]
        return np.asarray(values <= max(self.cut * float(values.max(initial=0.0)), _NOISE * size))

    def ratio(self, part: FloatArray, whole: FloatArray, size: float) -> float | None:
        """The largest |part|/whole; None if a part is more than rounding of a size where the whole counts as none."""
        none = self.none(whole)
        if np.abs(part[none]).max(initial=0.0) > _ROUNDING * size:
            return None
        return float((np.abs(part[~none]) / whole[~none]).max(initial=0.0))

    def _spread(self, chosen: BoolArray) -> BoolArray:
        found = np.zeros_like(chosen)
        found[self.trace.columns[chosen[self.trace.columns].any(axis=1)]] = True
        return found


def coulomb_force_bounds(
    stress: ContactResult,
    companion: CompanionResult,
    shares: Mapping[str, Share],
    error: float,
    defect: float,
    norm: FrictionNorm,
) -> dict[str, Bounds]:
    """T3: bounds of "NAME.normal_force" and "NAME.tangential_force" [stress × length] of contacts that are not tied.

    Those are left out of which no dual pair is found: the resultant of friction on a contact that ends where a support
    holds its tangential displacement, or whose tangents turn back, and all where a contact has Tresca's law.

    Parameters
    ----------
    stress, companion, shares
        τ + η, v and s, see `coulomb_bounds`.
    error : float
        F [√energy].
    defect : float
        The bound of Σ [stress × length²].
    norm : FrictionNorm
        That of s; where it is proved, those of the dual problems must be, too.

    """
    contacts = stress.problem.contacts
    if not np.isfinite(error) or any(bears_shear(each) and not has_coulomb(each) for each in contacts):
        return {}
    assert companion.state is not None
    if 2 * companion.state.contacts.count > MOST:
        return {}
    model, mesh = _Model.of(stress, companion), stress.problem.mesh
    found: dict[str, Bounds] = {}
    for cut in _CUTS:
        pairs = _Pairs(model, stress, companion, list(_lines(stress, companion, shares, cut)))
        for line in pairs.lines:
            targets = {"normal_force": (-1.0, 0.0)}
            if line.share and leads_one_way(mesh.vertices, mesh.edges(line.contact.edges)):
                targets["tangential_force"] = (0.0, 1.0)
            for name, (a, b) in targets.items():
                bounds = pairs.bounds(line, a, b, error, defect, norm)
                if bounds is not None:
                    key = f"{line.contact.name}.{name}"
                    lower, upper = found.get(key, (-np.inf, np.inf))
                    found[key] = Bounds(max(lower, bounds.lower), min(upper, bounds.upper))
    return found


@dataclass(frozen=True, eq=False)
class _Model:
    """What all dual pairs of a mesh share: displacements at rest, τ, and the factors of the energy of stresses."""

    body: BodyAtRest
    fields: CellFields
    scale: FloatArray
    factors: Any
    changes: LeastChange

    @classmethod
    def of(cls, stress: ContactResult, companion: CompanionResult) -> _Model:
        K = stress.discretization.qvi.K
        scale = 1.0 / np.sqrt(K.diagonal())
        scaled = sparse.csc_array(sparse.diags_array(scale) @ K @ sparse.diags_array(scale))
        fields = CellFields.of(stress.discretization, stress.dofs, companion.degree)
        body, qvi = BodyAtRest.of(stress.problem, companion.degree), stress.discretization.qvi
        changes = LeastChange.of(qvi, sparse.csr_array(sparse.vstack([qvi.N, qvi.T, qvi.A])))
        return cls(body, fields, scale, splu(scaled), changes)

    def solved(self, K: sparse.csc_array, right: FloatArray) -> FloatArray:
        """K⁻¹ · right (n, j), once corrected."""
        scale = self.scale[:, None]
        found = self.factors.solve(scale * right)
        found += self.factors.solve(scale * (right - K @ (scale * found)))
        return np.asarray(scale * found)


@dataclass(frozen=True, eq=False)
class _Spaces:
    """Displacements w of the interface that meet the conditions of z, and those that test it.

    Attributes
    ----------
    held : list of (array, int)
        By contact μ s where conditions hold z as it is closed, and how many hold it as it sticks.
    particular, free : arrays
        All w that meet them with right-hand side d are particular · d + free · y.
    others : array
        Basis of the tests.
    matrix : array
        Energy of tests and y.

    """

    held: list[tuple[FloatArray, int]]
    particular: FloatArray
    free: FloatArray
    others: FloatArray
    matrix: FloatArray


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Dual pairs z, ζ on the mesh of a result."""

    model: _Model
    stress: ContactResult
    companion: CompanionResult
    lines: list[_Line]

    @property
    def known(self) -> Discretization:
        """The discretisation of the stress."""
        return self.stress.discretization

    @property
    def body(self) -> BodyAtRest:
        """The displacements."""
        return self.model.body

    @property
    def unit(self) -> float:
        """D: z is that large where its dimensionless coefficients are 1 [length]."""
        return self.known.scales.displacement

    def bounds(self, line: _Line, a: float, b: float, error: float, defect: float, norm: FrictionNorm) -> Bounds | None:
        """Bounds of ∫ a σ_N + b σ_T ds on one contact; None if no z meets the conditions of (D31)."""
        goals = {each.contact.name: (a, b) if each is line else (0.0, 0.0) for each in self.lines}
        c, z, plates = self._displacement(goals)
        moved = self._ratio_of_displacements(goals, c)
        if moved is None:
            return None
        change, parts = self._continuous(self._stress(c))
        pressed = self._ratio_of_stresses(change)
        if pressed is None:
            return None
        second = norm.work(self.stress.problem, parts, error, defect)
        if not np.isfinite(second):
            return None
        middle, residual = self._value(goals, c, z, plates, change)
        middle -= a * float(line.trace.fluid.sum()) * self.known.scales.stress * self.known.scales.length
        rest = (error * residual + max(moved, pressed) * defect + second) / self.unit
        rest += _ROUNDED * abs(middle)
        return Bounds(float(middle - rest), float(middle + rest))

    @cached_property
    def _spaces(self) -> _Spaces:
        """Where z and its tests may move, whatever a and b."""
        body, n = self.body, self.body.contacts.count
        held, trial, test = [], [], []
        for line in self.lines:
            closed, stuck = (line.start + np.flatnonzero(part) for part in (line.closed, line.stuck))
            closed, stuck = closed[body.live[closed]], stuck[body.live[n + stuck]]
            normal, shear = body.B[closed], body.B[n + stuck]
            turned = line.friction * line.slipping[closed - line.start]
            trial += [normal + turned[:, None] * body.B[n + closed], shear]
            test += [normal, shear]
            held.append((turned, len(stuck)))
        particular, free = solutions(np.vstack(trial))
        _, others = solutions(np.vstack(test))
        return _Spaces(held, particular, free, others, others.T @ body.S @ free)

    def _displacement(self, goals: Mapping[str, tuple[float, float]]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Coefficients c (2, n) of z on the contacts, z (size,) and its plates, dimensionless: a and b of length 1."""
        body, spaces = self.body, self._spaces
        wanted = []
        for line, (closed, stuck) in zip(self.lines, spaces.held, strict=True):
            a, b = goals[line.contact.name]
            wanted += [a + closed * b, np.full(stuck, b)]
        start = spaces.particular @ np.concatenate(wanted)
        right = -spaces.others.T @ (body.S @ start)
        w = start + spaces.free @ np.linalg.lstsq(spaces.matrix, right, rcond=1e-13)[0]
        z, plates = body.expand(w)
        c = body.contacts.rows @ z - body.contacts.motions @ plates
        return c.reshape(2, body.contacts.count), z, plates

    def _stress(self, c: FloatArray) -> FloatArray:
        """ζ, as a change of the unknowns of the stress: the nearest to Cε(z), with no traction where none may be."""
        qvi, q = self.known.qvi, self.known.rule.count
        work = np.zeros((2, qvi.m))
        products = bernstein.product_integrals(q - 1, self.companion.degree)
        for line in self.lines:
            local = np.stack(line.trace.on_edges(*c[:, line.start : line.start + line.trace.count]))
            work[:, line.rows.rows] = (line.trace.lengths[:, None] * (local @ products.T)).reshape(2, -1)
        load = qvi.N.T @ work[0] + qvi.T.T @ work[1]
        x = self.model.solved(qvi.K, load[:, None])[:, 0]
        rows, influence, reached, square = self._held
        if not rows.shape[0]:
            return np.asarray(x)
        x = x - influence @ np.linalg.lstsq(reached, rows @ x, rcond=1e-13)[0]
        for _ in range(2):  # what is left of the rows is rounding, which must not count
            x = x - rows.T @ np.linalg.lstsq(square, rows @ x, rcond=1e-13)[0]
        return np.asarray(x)

    @cached_property
    def _held(self) -> tuple[sparse.csr_array, FloatArray, FloatArray, FloatArray]:
        """Rows of tractions that are to vanish, what they do, K⁻¹ rowsᵀ, and rows times that and times rowsᵀ."""
        qvi, q = self.known.qvi, self.known.rule.count
        held = np.zeros((2, qvi.m), dtype=bool)
        for line in self.lines:
            held[0, line.rows.rows] = np.repeat(line.loose, q)
            held[1, line.rows.rows] = np.repeat(line.loose | line.sliding, q)
        parts = [sparse.csr_array(part)[chosen] for part, chosen in zip((qvi.N, qvi.T), held, strict=True)]
        rows = sparse.csr_array(sparse.vstack([*parts, qvi.A]))
        influence = self.model.solved(qvi.K, rows.T.toarray())
        return rows, influence, rows @ influence, (rows @ rows.T).toarray()

    def _ratio_of_displacements(self, goals: Mapping[str, tuple[float, float]], c: FloatArray) -> float | None:
        """The larger of m₁ and m₄; None if there is none."""
        found = 0.0
        for line in self.lines:
            a, b = goals[line.contact.name]
            here = slice(line.start, line.start + line.trace.count)
            slip = c[1, here] - b if line.share else 0.0 * c[1, here]
            across = c[0, here] - a + line.friction * line.slipping * slip
            for part, whole in ((slip, line.slip), (across, line.opening)):
                ratio = line.ratio(self.unit * part, whole, self.unit)
                if ratio is None:
                    return None
                found = max(found, ratio)
        return found

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
            parts[line.contact.name] = replace(
                line.share, values=values, weights=bound, slipping=np.zeros(len(edges.first))
            )
        common = np.where(still > 0.0, 0.0, total / np.maximum(mass, 1e-300))
        for line in rough:
            share, edges = parts[line.contact.name], line.trace.edges
            own = share.values * share.weights
            share.values[:, 0], share.values[:, -1] = common[edges.first], common[edges.second]
            wanted[line.rows.rows] = (share.values * share.weights - own).ravel()
        if wanted.any():
            right = np.concatenate([np.zeros(qvi.m), wanted, np.zeros(qvi.A.shape[0])])
            change = change + self.model.changes.solved(right)
        return change, parts

    def _ratio_of_stresses(self, change: FloatArray) -> float | None:
        """The larger of m₂ and m₃; None if there is none."""
        scales, q, found = self.known.scales, self.known.rule.count, 0.0
        normal, shear = (scales.stress * (rows @ change) for rows in (self.known.qvi.N, self.known.qvi.T))
        size = float(np.abs(normal).max())
        for line in self.lines:
            pairs = ((normal, line.pressure), *(((shear, line.room),) if line.share else ()))
            for part, whole in pairs:
                ratio = line.ratio(part[line.rows.rows].reshape(-1, q), whole, size)
                if ratio is None:
                    return None
                found = max(found, ratio)
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
        known, scales, companion = self.known, self.known.scales, self.companion
        assert companion.state is not None
        u = self.stress.dofs
        other = u + known.basis @ change
        fields = self.model.fields
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
                b, here = goals[line.contact.name][1], slice(line.start, line.start + line.trace.count)
                assert not callable(line.contact.cohesion)
                slipped = float(line.trace.weights @ (line.slipping * (c[1, here] - b))) * self.unit * scales.length
                work += line.contact.cohesion * slipped
        return work / self.unit, float(np.sqrt(size))


def _lines(
    stress: ContactResult, companion: CompanionResult, shares: Mapping[str, Share], cut: float
) -> Iterator[_Line]:
    known, state = stress.discretization, companion.state
    assert state is not None
    c = state.c.reshape(2, -1) * known.scales.displacement
    start = 0
    for contact, trace, rows in zip(known.problem.contacts, state.contacts.traces, known.contacts, strict=True):
        here = slice(start, start + trace.count)
        if contact.law != "tied":
            share = shares.get(contact.name)
            slipping = np.zeros(trace.count) if share is None else trace.slipping_on(share.slipping)
            found = tractions_on(known, stress.dofs, rows)
            normal, shear = (known.scales.stress * part for part in found)
            opening = trace.gap * known.scales.displacement - c[0, here]
            slip = slipping * (c[1, here] - trace.offset * known.scales.displacement)
            room = np.zeros_like(shear)
            if share is not None:
                assert not callable(contact.cohesion)
                room = share.room * (share.friction * np.maximum(-normal, 0.0) + contact.cohesion)
            sizes = float(np.abs(c[:, here]).max(initial=0.0)), float(np.abs(normal).max(initial=0.0))
            opening, slip, pressure, room = (np.maximum(part, 0.0) for part in (opening, slip, -normal, room))
            yield _Line(contact, trace, rows, share, slipping, start, opening, slip, pressure, room, cut, sizes)
        start += trace.count
