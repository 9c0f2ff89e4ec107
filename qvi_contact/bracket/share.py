"""The share s of its friction bound that a stress uses, and a stress near the computed one with a continuous share.

    s = −τ_T / (c + μ|τ_N|),    |s| ≤ 1.

Tractions of triangles jump at vertices, and so does s. A stress η without loads makes the share continuous:
(τ + η)_T = −s B(τ + η), B the friction bound.

Joints divide the problem into bodies. For each body the others are rigid obstacles. Operators R of (D26) of the single
bodies make one of the whole problem, and its norm is the largest of theirs.

In `docs/theory.md`: (D26), (D27).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import comb
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, evaluate
from qvi_contact.bracket.parts import EdgeTractions
from qvi_contact.companion.contact import LeastChange
from qvi_contact.companion.model import prescribed_slip
from qvi_contact.discretization.discretization import Discretization, discretize
from qvi_contact.discretization.displacements import ALIKE, PARALLEL
from qvi_contact.element.edge import SAMPLES, bernstein_basis
from qvi_contact.mechanism.bodies import blocks_of_cells
from qvi_contact.mesh.edges import cross, frames_along
from qvi_contact.problem.conditions import SPRINGS, Contact, Displacement, bears_shear, has_coulomb
from qvi_contact.problem.problem import ContactProblem, with_contacts
from qvi_contact.solution.result import ContactResult
from solvers import solve_qvi

_OPEN = 1e-6  # of the largest friction bound on a contact: an edge is open if its bound is nowhere above this
_NOTHING = 1e-9  # of the largest stress: an edge is also open below this, as solvers leave tractions of this size
_BEARS = 0.02  # of the largest bound on an edge: coefficients with less do not count for the value of s at an end
AWAY = 3.0
"""Where displacements slip although |s| < 1, the opening is at least this times μ |v_T − w|, see `docs/theory.md`."""
_FAR = 2.0  # times that opening, in the solution: edges on which displacements may slip either way
_SLIPS = 1e-6  # relative distance of friction from its bound, below which it has reached the bound
_TRIALS = 8  # sets of inner coefficients of s and of pressure that may change; in the last trial the set is empty
_SAME = 1e-14  # of a datum: smaller differences are rounding
_MET = 1e-8  # of the largest bound: misfit of the shear up to which the share counts as met


@dataclass(frozen=True, eq=False)
class Body:
    """One body of a problem as a problem of its own."""

    problem: ContactProblem  # its mesh and the conditions on its edges
    beyond: Mapping[str, str]  # contacts that are joints seen from the side their normal points to: joint names
    cells: IntArray  # its triangles in the whole mesh, in ascending order, as are its edges


def bodies_of(problem: ContactProblem) -> tuple[Body, ...]:
    """The bodies of a problem, each alone; a joint between two bodies becomes a contact with an obstacle on each.

    Tied joints do not divide. There are none if a joint that is not tied has one body on both sides.
    """
    joints = tuple(joint for joint in problem.joints if joint.law != "tied")
    if problem not in _PARTED:
        body = blocks_of_cells(problem)
        sides = (body[problem.mesh.edges(joint.edges).cells] for joint in joints)
        is_cracked = any((near == far).any() for near, far in (each.T for each in sides))
        parts = (np.flatnonzero(body == number) for number in range(0 if is_cracked else int(body.max()) + 1))
        _PARTED[problem] = tuple(_alone(problem, cells, joints) for cells in parts)
    return _PARTED[problem]


_PARTED: WeakKeyDictionary[ContactProblem, tuple[Body, ...]] = WeakKeyDictionary()
"""The bodies of each problem that is alive: one bracket asks for them three times."""


def _alone(problem: ContactProblem, cells: IntArray, joints: tuple[Contact, ...]) -> Body:
    """The body of the triangles `cells` with the conditions on its edges."""
    edge_sets, beyond, contacts = dict(problem.mesh.edge_sets), {}, []
    for joint in joints:
        edges, name_beyond = problem.mesh.edges(joint.edges), f"{joint.name}, beyond"
        vertex_pairs = np.column_stack([edges.first, edges.second])
        del edge_sets[joint.edges]
        for side, name in enumerate((joint.name, name_beyond)):
            is_on_body = np.isin(edges.cells[:, side], cells)
            if is_on_body.any():
                edge_sets[name] = vertex_pairs[is_on_body]
                contacts.append(replace(joint, edges=name, name=name))
        if name_beyond in edge_sets:
            beyond[name_beyond] = joint.name
    mesh = problem.mesh.part(cells, edge_sets)
    conditions = [each for each in problem.conditions if each not in problem.joints and each.edges in mesh.edge_sets]
    regions_here = problem.cell_materials[cells] - 1  # by name or by ranges
    regions = [each for number, each in enumerate(problem.regions) if number in regions_here]
    return Body(replace(problem, mesh=mesh, conditions=[*conditions, *contacts], regions=regions), beyond, cells)


@dataclass(frozen=True, eq=False)
class Share:
    """The share s of the friction bound on one contact with Coulomb friction."""

    contact: Contact
    """The contact."""
    values: FloatArray
    weights: FloatArray
    """(edges, q): s_i, and ω_i ≥ 0 in any unit: s = Σ s_i ω_i B_i / Σ ω_i B_i."""
    slipping: FloatArray
    """(edges,): 1 or −1 where s is 1 or −1 on the whole edge, so that displacements may slip along its tangent or
    against it; NaN on edges far from the obstacle, where they may slip either way; 0 on edges where they stick."""
    room: FloatArray
    """(edges, q): m_i ≥ 0 of a continuous m ≤ 1 − |s|, the unused part of friction, m = Σ m_i ω_i B_i / Σ ω_i B_i.
    m_i is 1 − |s_i|, but 0 where s must vanish."""

    @property
    def friction(self) -> float:
        """Coulomb's coefficient μ."""
        assert not callable(self.contact.friction)
        return self.contact.friction

    def at(self, t: FloatArray) -> FloatArray:
        """Values of s at points t (k,) of the edges, 0 to 1 along the tangent, (edges, k)."""
        shapes = bernstein_basis(self.values.shape[1] - 1, t)
        least = 1e-30 * max(float(self.weights.max(initial=0.0)), 1e-270)
        weights = np.maximum(self.weights, least)  # equal weights on an open edge
        return np.asarray((self.values * weights) @ shapes.T / (weights @ shapes.T))

    def steepest(self) -> FloatArray:
        """A bound of |ds/dt| on each of 16 equal parts of the edges, with t from 0 to 1 on the part, (edges, 16).

        On a part let P_i be the values and ω_i the weights, n the degree. Then
        |ds/dt| ≤ n (max ω/min ω) (max |P_{i+1} − P_i| + ½ (κ − 1) (max P − min P)), with κ the largest ω_{i+1}/ω_i over
        the smallest: de Casteljau's last step has s' = n w₀ w₁/w² (p₁ − p₀), with w between w₀ and w₁.
        """
        n = self.values.shape[1] - 1
        weights = np.where(self.weights.any(axis=1, keepdims=True), self.weights, 1.0)
        parts = np.stack([self.values * weights, weights])[:, :, None]  # (2, edges, parts, n + 1)
        to_left_half = np.array([[comb(i, j) / 2.0**i for j in range(n + 1)] for i in range(n + 1)])
        for _ in range(4):
            halves = np.stack([parts @ to_left_half.T, parts @ to_left_half[::-1, ::-1].T], axis=3)
            parts = halves.reshape(2, len(self.values), -1, n + 1)
        weighted_values, weights = parts
        is_bounded = weights.min(axis=2) > 1e-12 * weights.max(axis=2)
        weights = np.where(is_bounded[..., None], weights, 1.0)
        points, ratios = weighted_values / weights, weights[..., 1:] / weights[..., :-1]
        step, spread = np.abs(np.diff(points)).max(axis=2), ratios.max(axis=2) / ratios.min(axis=2)
        slopes = n * weights.max(axis=2) / weights.min(axis=2) * (step + 0.5 * (spread - 1.0) * np.ptp(points, axis=2))
        is_constant = np.ptp(self.values, axis=1, keepdims=True) == 0.0
        return np.where(is_constant, 0.0, np.where(is_bounded, slopes, np.inf))


def shares_on(body: Body, whole: ContactProblem, shares: Mapping[str, Share]) -> dict[str, Share]:
    """Shares on one body; beyond a joint the normal is reversed and the tangent is not, so that s changes its sign."""
    shares_of_body = dict[str, Share]()
    for contact in body.problem.contacts:
        is_beyond = contact.name in body.beyond
        share = shares.get(body.beyond[contact.name] if is_beyond else contact.name)
        if share is not None:
            is_on_body = np.isin(whole.mesh.edges(share.contact.edges).cells[:, int(is_beyond)], body.cells)
            sign = -1.0 if is_beyond else 1.0
            fields = (sign * share.values, share.weights, sign * share.slipping, share.room)
            shares_of_body[contact.name] = Share(contact, *(part[is_on_body] for part in fields))
    return shares_of_body


@dataclass(frozen=True, eq=False)
class SharedStress:
    """A stress τ + η with continuous shares."""

    result: ContactResult  # it carries the stress τ + η
    shares: Mapping[str, Share]  # s, by contact with Coulomb friction
    places: tuple[str, ...]  # a sentence for each vertex where s must vanish although the contact slips or is open
    before: ContactResult  # it carries τ


def with_numbers(result: ContactResult) -> ContactResult:
    """The result with numbers for friction and cohesion that are given as functions but constant on a contact."""
    problem = result.problem
    if not any(callable(each.friction) or callable(each.cohesion) for each in problem.contacts):
        return result

    def constant(contact: Contact) -> Contact:
        points, numbers = problem.mesh.points_along(problem.mesh.edges(contact.edges), SAMPLES), dict[str, Any]()
        for name in ("friction", "cohesion"):
            values = evaluate(f"Contact.{name}", getattr(contact, name), *points, minimum=0.0)
            if np.ptp(values) <= _SAME * np.abs(values).max():
                numbers[name] = float(values.flat[0])
        return replace(contact, **numbers)

    discretization = replace(result.discretization, problem=with_contacts(problem, constant))
    return ContactResult(discretization, result.solution)


def outside_scope(problem: ContactProblem) -> str:
    """Why the data of a problem rule out bounds of its errors under Coulomb's law; empty if they do not."""
    for contact in filter(has_coulomb, problem.contacts):
        name = repr(contact.name)
        if contact.law != "unilateral":
            return f"Bounds under friction are for contacts that may open: {name} is bilateral."
        if callable(contact.friction) or callable(contact.cohesion):
            return f"Bounds under friction need constant friction and cohesion: those of {name} vary."
        if contact.shear_limit is not None:
            return f"Bounds under friction are for Coulomb's law without a limit of the shear stress: {name} has one."
        if contact.tangential_stiffness is not None and contact.normal_stiffness is None:
            remedy = f"give {name} a normal stiffness, or no tangential one."
            return f"Bounds under friction are not for springs along a contact without springs across it: {remedy}"
    return ""


def with_bernstein_rows(known: Discretization) -> Discretization:
    """The discretization with Bernstein rows, which hold the contact law on whole edges."""
    if known.rule.law_on == "edges":
        return known
    return discretize(known.problem, degree=known.space.degree, law_on="edges", scales=known.scales)


def with_shares(result: ContactResult, known: Discretization, tolerance: float) -> SharedStress | str:
    """(H4): a stress with continuous shares near that of a result, or a reason why its errors are not bounded.

    The rows of `known` hold Coulomb's law on whole edges; a result with others is solved anew. At a vertex s is 1 or −1
    if an edge slips there. Where no edge slips, s is the mean of the edges, weighted by their bounds. Where no R of
    (D26) exists otherwise, s is 0. On each edge only the first and the last coefficient that count change.
    Displacements may slip either way on edges far from an obstacle.
    """
    reason, raw_shares = outside_scope(result.problem), dict[str, Share]()
    if reason:
        return reason
    if known is not result.discretization:
        result = ContactResult(known, solve_qvi(known.qvi, tolerance=tolerance))
    if not result.has_state:
        return f"No stress that obeys the contact law on whole edges was found: {result.solution.message}"
    tractions, prescribed_senses = EdgeTractions.of(known, result.dofs), prescribed_slip(known.problem)
    for rows, contact in zip(known.contacts, known.problem.contacts, strict=True):
        if has_coulomb(contact):
            slip = result.contacts[contact.name].slip
            least = _NOTHING * max(tractions.size, result.certificate.scales.get("stress", 0.0))
            data = tractions.bound[rows.edges], tractions.shear[rows.edges], slip, prescribed_senses[contact.name]
            raw_shares[contact.name] = _raw(contact, *data, least)
    shares, places = joined(known.problem, raw_shares, _vanishing(known.problem), prescribed_senses)
    changed = _moved(result, {name: _free_far_away(result, share) for name, share in shares.items()})
    return changed if isinstance(changed, str) else SharedStress(*changed, places, result)


def _free_far_away(result: ContactResult, share: Share) -> Share:
    """The share with either way of slip allowed far from the obstacle. There s falls to 0 within one edge.

    A share that slips one way on straight edges stays as it is, since a norm may be proved for it.
    """
    line, edges = result.contacts[share.contact.name], result.problem.mesh.edges(share.contact.edges)
    least_ratio = _FAR * AWAY * share.friction
    is_near = (line.gap <= least_ratio * np.abs(line.slip)).reshape(len(edges), -1)
    is_away: BoolArray = np.asarray(~np.hstack([is_near, share.weights > 0.0]).any(axis=1))
    if share.contact.cohesion or not (edges.curved or (share.slipping[is_away] == 0.0).any()):
        return share
    rough_edges = [result.problem.mesh.edges(each.edges) for each in filter(has_coulomb, result.problem.contacts)]
    rough_count = np.bincount(np.concatenate([ends for each in rough_edges for ends in (each.first, each.second)]))
    away_count = np.bincount(np.concatenate([edges.first[is_away], edges.second[is_away]]), minlength=len(rough_count))
    factors = np.zeros_like(share.values)
    factors[:, 0], factors[:, -1] = (rough_count[ends] > away_count[ends] for ends in (edges.first, edges.second))
    factors = np.where(is_away[:, None], factors, 1.0)
    slipping = np.where(is_away, np.nan, share.slipping)
    return replace(share, values=factors * share.values, slipping=slipping, room=factors * share.room)


def _raw(
    contact: Contact, bound: FloatArray, shear: FloatArray, slip: FloatArray, prescribed_sense: FloatArray, least: float
) -> Share:
    """The share of a stress, edge by edge, not continuous yet; ±1 on open edges, as the body slips there.

    An edge is open if its bound is nowhere above `least`. Where supports prescribe slip at an end of an edge, with the
    sense `prescribed_sense` (e,), s is ±1 in that sense, since displacements must slip there.
    """
    largest = bound.max(axis=1, keepdims=True)
    is_open = largest[:, 0] <= max(_OPEN * float(largest.max(initial=0.0)), least)
    values = np.clip(-shear / np.maximum(bound, 1e-300), -1.0, 1.0)
    backwards = slip.reshape(len(bound), -1).sum(axis=1) < 0.0
    values[is_open] = np.where(backwards, -1.0, 1.0)[is_open, None]
    does_count = bound > _BEARS * largest
    # coefficients with small bounds take the nearest value that counts, or the mean of the two nearest
    for edge in np.flatnonzero(~is_open & ~does_count.all(axis=1)).tolist():
        counting = np.flatnonzero(does_count[edge])
        distance = np.abs(np.arange(bound.shape[1])[:, None] - counting)
        is_nearest = distance == distance.min(axis=1, keepdims=True)
        values[edge] = is_nearest @ values[edge, counting] / is_nearest.sum(axis=1)
    values = np.where(prescribed_sense[:, None] == 0.0, values, prescribed_sense[:, None])
    values = np.where(np.abs(values) >= 1.0 - _SLIPS, np.sign(values), values)
    is_slipping = np.abs(values.sum(axis=1)) == values.shape[1]
    weights, slipping = np.where(is_open[:, None], 0.0, bound), np.where(is_slipping, values[:, 0], 0.0)
    return Share(contact, values, weights, slipping, 1.0 - np.abs(values))


def joined(
    problem: ContactProblem, raw: Mapping[str, Share], zeros: BoolArray, given: Mapping[str, FloatArray] | None = None
) -> tuple[dict[str, Share], tuple[str, ...]]:
    """Shares made continuous, with 0 at the vertices `zeros`, and a sentence for each place where that 0 costs much.

    At a vertex it is that of edges whose sense is `given`, else that slip, else that are open, else the mean of all.
    """
    edges_of = {name: problem.mesh.edges(share.contact.edges) for name, share in raw.items()}
    raw = {name: _turned(problem, share) for name, share in raw.items()}
    # by end of an edge, first ends before second ones: vertex, value, weight, whether the edge slips and bears
    end_vertex = np.concatenate([vertices for edges in edges_of.values() for vertices in (edges.first, edges.second)])
    end_value, end_weight = (
        np.concatenate([getattr(share, part)[:, [0, -1]].T.ravel() for share in raw.values()])
        for part in ("values", "weights")
    )
    slips = np.concatenate([np.tile(share.slipping != 0.0, 2) for share in raw.values()])
    bears = np.concatenate([np.tile(share.weights.any(axis=1), 2) for share in raw.values()])

    is_given = np.concatenate([np.tile(given[name] != 0.0, 2) for name in raw]) if given else np.zeros_like(slips)
    rank, highest = np.select([is_given, slips & bears, ~bears], [3, 2, 1]), np.zeros(len(zeros), dtype=np.int64)
    np.maximum.at(highest, end_vertex, rank)
    decides = rank == highest[end_vertex]
    # the common value at each vertex: that of the ends that decide, 0 if they differ; the mean where none has a rank
    least, most = np.full(len(zeros), np.inf), np.full(len(zeros), -np.inf)
    np.minimum.at(least, end_vertex[decides], end_value[decides])
    np.maximum.at(most, end_vertex[decides], end_value[decides])
    end_weight = np.maximum(end_weight, 1e-100)  # equal weights where all are 0
    total, mass = (np.bincount(end_vertex, part, len(zeros)) for part in (end_weight * end_value, end_weight))
    common = np.where(highest == 0, total / np.where(mass > 0.0, mass, 1.0), np.where(least == most, least, 0.0))
    common[zeros] = 0.0
    joined_shares, places = dict[str, Share](), list[str]()
    for name, share in raw.items():
        # coefficients up to the first one that counts take the value at the vertex
        does_count = share.weights > _BEARS * share.weights.max(axis=1, keepdims=True)
        does_count |= does_count.sum(axis=1, keepdims=True) < 2
        before, after = (np.cumsum(does_count[:, ::way], axis=1)[:, ::way] - does_count for way in (1, -1))
        values, slipping, room = share.values.copy(), share.slipping.copy(), np.ones_like(share.values)
        for vertices, near in ((edges_of[name].first, before == 0), (edges_of[name].second, after == 0)):
            vertex_value, must_vanish = common[vertices], zeros[vertices]
            is_changed = (share.slipping != vertex_value) | (vertex_value == 0.0)
            values = np.where(near & is_changed[:, None], vertex_value[:, None], values)
            slipping[is_changed] = 0.0
            room[near & must_vanish[:, None]] = 0.0
            places += [
                f"At ({x:.6g}, {y:.6g}) {name!r} has a kink, or meets other friction or a support that holds its "
                "normal displacement. No slip is allowed there, which makes the bound wide."
                for x, y in problem.mesh.vertices[vertices[must_vanish & (share.slipping != 0.0)]]
            ]
        joined_share = replace(share, values=values, slipping=slipping, room=room * (1.0 - np.abs(values)))
        joined_shares[name] = _turned(problem, joined_share)
    return joined_shares, tuple(dict.fromkeys(places))


def _turned(problem: ContactProblem, share: Share) -> Share:
    """The share for tangents that are normals turned counterclockwise: continuous where tangents turn back on arcs."""
    edges = problem.mesh.edges(share.contact.edges)
    senses = np.rint(cross(edges.normal, edges.tangent))
    return replace(share, values=senses[:, None] * share.values, slipping=senses * share.slipping)


def _moved(result: ContactResult, shares: Mapping[str, Share]) -> tuple[ContactResult, dict[str, Share]] | str:
    """The result with the shear −s B of continuous shares, by a change η of least energy, and these shares.

    On inner coefficients of sticking edges s is free, as long as |s| ≤ 1: there η balances the changes at the ends. If
    that is not enough, pressure changes too, and the bound with it. The rows are (τ + η)_T = −s B(τ + η), or
    η_T − μ s η_N = −s B(τ) − τ_T.
    """
    known, qvi = result.discretization, result.discretization.qvi
    m, rough_rows = qvi.m, [rows for rows in known.contacts if rows.name in shares]
    own = EdgeTractions.of(known, result.dofs)
    # by coefficient: the change of shear, μ s, whether pressure and the share may change
    target, signed_friction, may_change = np.zeros(m), np.zeros(m), np.zeros((2, m), dtype=bool)
    for rows in rough_rows:
        share, at_rows, pressure = shares[rows.name], rows.rows, -own.normal[rows.edges]
        bound, shear = own.bound[rows.edges], own.shear[rows.edges]
        does_count = share.weights > _BEARS * bound.max(axis=1, keepdims=True)
        target[at_rows] = (-share.values * bound - shear).ravel()
        signed_friction[at_rows] = share.friction * share.values.ravel()
        before, after = (np.cumsum(does_count[:, ::way], axis=1)[:, ::way] for way in (1, -1))
        is_inner = (share.slipping == 0.0)[:, None] & does_count & (before > 1) & (after > 1)
        may_change[:, at_rows] = (pressure > _BEARS * pressure.max(initial=0.0)).ravel(), is_inner.ravel()
    size = max(float(np.abs(target).max()), *(float(share.weights.max(initial=0.0)) for share in shares.values()))
    shear_rows = sparse.csr_array(qvi.T - sparse.diags_array(signed_friction) @ qvi.N)
    all_rows = sparse.csr_array(sparse.vstack([qvi.N, shear_rows, qvi.A]))
    all_right = np.concatenate([np.zeros(m), target, np.zeros(qvi.A.shape[0])])
    for pressure_changes in (False, True):
        is_free = may_change & np.array([[pressure_changes], [True]])
        for trial in range(_TRIALS):
            is_free &= trial < _TRIALS - 1
            kept = np.flatnonzero(np.append(~is_free.ravel(), np.ones(qvi.A.shape[0], dtype=bool)))
            rows_kept, right = all_rows[kept], all_right[kept]
            change = LeastChange.of(qvi.K, rows_kept).solved(right)
            moved = ContactResult(known, replace(result.solution, z=result.solution.z + change))
            # free coefficients must obey the law, σ_N ≤ 0 and |s| ≤ 1; the others are fixed in the next trial
            moved_shares, new = dict(shares), EdgeTractions.of(known, moved.dofs)
            is_wrong = np.zeros((2, m), dtype=bool)
            for rows in rough_rows:
                share, at_rows = shares[rows.name], rows.rows
                bound, shear = new.bound[rows.edges], new.shear[rows.edges]
                is_free_here = is_free[1, at_rows].reshape(bound.shape)
                values = np.where(is_free_here, -shear / np.maximum(bound, 1e-300), share.values)
                is_wrong[:, at_rows] = (new.normal[rows.edges] > 0.0).ravel(), (np.abs(values) > 1.0).ravel()
                room = np.where(is_free_here, 1.0 - np.abs(values), share.room)
                weights = np.where(share.weights > 0.0, bound, 0.0)
                moved_shares[rows.name] = replace(share, values=values, room=room, weights=weights)
            is_wrong &= is_free
            if not is_wrong.any():
                break
            is_free &= ~is_wrong
        misfit = np.abs(rows_kept @ change - right)
        if misfit.max() <= _MET * size:
            return moved, moved_shares
    row = int(kept[misfit.argmax()])  # the place of the largest misfit
    row_number = row % m if row < 2 * m else 0
    rows = next(each for each in known.contacts if each.rows.start <= row_number < each.rows.stop)
    x, y = known.problem.mesh.vertices[rows.points.edges.first[(row_number - rows.rows.start) // known.rule.count]]
    return f"No stress on this mesh has a continuous share of friction on {rows.name!r} near ({x:.6g}, {y:.6g})."


def held_subspaces(problem: ContactProblem) -> FloatArray:
    """By boundary edge the projector (2, 2) onto directions that supports and tied contacts, but not springs, hold."""
    boundary = problem.mesh.boundary
    supports = problem.prescribed(Displacement)
    held = [(problem.mesh.edge_set(each.condition.edges), each.direction) for each in supports]
    for contact in problem.contacts:
        if contact.law == "tied" and contact not in problem.joints:
            edges = problem.mesh.edge_set(contact.edges)
            frame = zip(SPRINGS, (boundary.normal, boundary.tangent), strict=True)
            held += [(edges, directions[edges]) for spring, directions in frame if getattr(contact, spring) is None]
    squares = np.zeros((len(boundary), 2, 2))  # the sum of d dᵀ over the directions d
    for edges, directions in held:
        squares[edges] += directions[:, :, None] * directions[:, None]
    sizes, axes = np.linalg.eigh(squares)
    return np.asarray(axes * (sizes > PARALLEL)[:, None] @ axes.swapaxes(1, 2))


def _vanishing(problem: ContactProblem) -> BoolArray:
    """Vertices (n,) where s must be 0: kinks, and where a neighbour holds the normal part of Rv.

    For w = Rv with s = 1 the contact laws demand C w = D v, and a held direction h demands h · v = h · w = 0. There is
    a w for every v if the rank of all rows is the rank of the rows in w alone plus that of the rows in v alone. Springs
    across a contact take up μ s v_T. On a joint both bodies have the same rows.
    """
    must_vanish = np.zeros(len(problem.mesh.vertices), dtype=bool)
    for body in bodies_of(problem) or [Body(problem, {}, np.arange(problem.mesh.cell_count))]:
        boundary, rough = body.problem.mesh.boundary, [np.empty(0, dtype=np.int64)]
        zero, held = np.zeros((len(boundary), 2)), held_subspaces(body.problem).swapaxes(0, 1)
        # vertices, and rows in (w, v) there: those of h · w = 0 and h · v = 0, then those of the laws
        parts = [
            (vertices, np.hstack(row))
            for vertices in (boundary.first, boundary.second)
            for h in held
            for row in ([h, zero], [zero, h])
        ]
        for law in filter(lambda contact: contact.law != "tied", body.problem.contacts):
            edges, friction = body.problem.mesh.edges(law.edges), law.friction if has_coulomb(law) else 0.0
            assert not callable(friction)
            normals = frames_along(edges, np.array([0.0, 1.0]))[0].swapaxes(0, 1)
            for vertices, normal in zip((edges.first, edges.second), normals, strict=True):
                tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
                parts += [(vertices, np.hstack([normal, -friction * tangent]))]
                parts += [(vertices, np.hstack([tangent, 0.0 * tangent]))] * bears_shear(law)
                rough += [vertices] * (has_coulomb(law) and law.normal_stiffness is None)
        vertex, row = (np.concatenate(each) for each in zip(*parts, strict=True))
        number = np.unique(problem.mesh.cells[body.cells])  # of the body's vertices in the whole mesh
        for place in np.unique(np.concatenate(rough)):
            rows = row[vertex == place]
            on_w, on_v = rows[:, :2], rows[~rows[:, :2].any(axis=1)]
            ranks = (int(np.linalg.matrix_rank(part, ALIKE)) for part in (rows, on_w, on_v))
            must_vanish[number[place]] |= next(ranks) > sum(ranks)
    return must_vanish
