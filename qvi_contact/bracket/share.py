"""The share s of its bound that friction uses, as a continuous function along the contacts, and the stress that has it.

    s = −τ_T / (c + μ|τ_N|),    |s| ≤ 1.

Tractions of triangles jump at vertices, and so does s. A stress η without loads makes it continuous: τ + η has the
shear −s times its own bound.

Joints part bodies, each a problem of its own: to it the others are rigid obstacles. Operators R of (D26) of all bodies
make one of the whole, and its norm is the largest of theirs.

In `docs/theory.md`: (D26), (D27).
"""

from collections.abc import Iterator, Mapping
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
from qvi_contact.errors import InputError
from qvi_contact.mechanism.bodies import blocks_of_cells
from qvi_contact.mesh.edges import Edges, cross, frames_along
from qvi_contact.problem.conditions import Contact, Displacement, bears_shear, has_coulomb
from qvi_contact.problem.problem import ContactProblem, with_contacts
from qvi_contact.solution.result import ContactResult
from solvers import solve_qvi

_OPEN = 1e-6  # of the largest bound on a contact: an edge where it is nowhere above that bears nothing
_NOTHING = 1e-9  # of the largest stress: nor where it is nowhere above that, which solvers leave
_BEARS = 0.02  # of the largest bound on an edge: coefficients below that do not count for the value of s at an end
AWAY = 3.0
"""Times μ |v_T − w| an opening is at least where displacements slip although |s| < 1."""
_FAR = 2.0  # times that which solutions have where displacements are free to
_SLIPS = 1e-6  # of the bound: friction that is as near to it has reached it
_TRIALS = 4  # of what may change inside edges; in the last one nothing
_SAME = 1e-14  # of a datum: differences that are rounding
_MET = 1e-8  # of the largest bound: what may be left of the shear that is wanted


@dataclass(frozen=True, eq=False)
class Body:
    """A body alone."""

    problem: ContactProblem  # its mesh and the conditions on its edges
    beyond: Mapping[str, str]  # by contact that is a joint seen from the side its normal points to: the joint's name
    cells: IntArray  # its triangles among those of the whole, in ascending order, as its edges are


def bodies_of(problem: ContactProblem) -> tuple[Body, ...]:
    """Each body alone, a joint that parts it from another one being a contact with an obstacle; tied joints part none.

    The same problem gives the same bodies again. `InputError` if a joint that is not tied has one body on both sides.
    """
    joints = tuple(joint for joint in problem.joints if joint.law != "tied")
    if problem not in _PARTED:
        body = blocks_of_cells(problem)
        for joint in joints:
            near, far = problem.mesh.edges(joint.edges).cells.T
            if (body[near] == body[far]).any():
                raise InputError("Contact.edges", joint.name, "has one body on both sides: let it part two bodies")
        parts = (np.flatnonzero(body == number) for number in range(int(body.max()) + 1))
        _PARTED[problem] = tuple(_alone(problem, cells, joints) for cells in parts)
    return _PARTED[problem]


_PARTED: WeakKeyDictionary[ContactProblem, tuple[Body, ...]] = WeakKeyDictionary()
"""What problems have been parted into, as long as these are there: one bracket asks for the bodies three times."""


def _alone(problem: ContactProblem, cells: IntArray, joints: tuple[Contact, ...]) -> Body:
    """One body with the conditions on its edges; what a tied joint bonds is one body."""
    sets, beyond, contacts = dict(problem.mesh.edge_sets), {}, []
    for joint in joints:
        edges, other = problem.mesh.edges(joint.edges), f"{joint.name}, beyond"
        ends = np.column_stack([edges.first, edges.second])
        del sets[joint.edges]
        for side, name in enumerate((joint.name, other)):
            here = np.isin(edges.cells[:, side], cells)
            if here.any():
                sets[name] = ends[here]
                contacts.append(replace(joint, edges=name, name=name))
        if other in sets:
            beyond[other] = joint.name
    mesh = problem.mesh.part(cells, sets)
    kept = [each for each in problem.conditions if each not in problem.joints and each.edges in mesh.edge_sets]
    own = problem.cell_materials[cells] - 1  # by name or by ranges
    regions = [each for number, each in enumerate(problem.regions) if number in own]
    return Body(replace(problem, mesh=mesh, conditions=[*kept, *contacts], regions=regions), beyond, cells)


@dataclass(frozen=True, eq=False)
class Share:
    """s on one contact with Coulomb friction."""

    contact: Contact
    """The contact."""
    values: FloatArray
    weights: FloatArray
    """(edges, q): s_i, and ω_i ≥ 0 in a unit of its own: s = Σ s_i ω_i B_i / Σ ω_i B_i."""
    slipping: FloatArray
    """(edges,): 1 or −1 where s is that on the whole edge, so that displacements may slip along the tangent or against
    it; NaN on edges far from the obstacle, where they may slip either way; 0 on other edges."""
    room: FloatArray
    """(edges, q): m_i ≥ 0 of a continuous m ≤ 1 − |s|, made of them as s of the s_i: 1 − |s_i|, but 0 where s must
    vanish."""

    @property
    def friction(self) -> float:
        """Coulomb's coefficient μ."""
        assert not callable(self.contact.friction)
        return self.contact.friction

    def at(self, t: FloatArray) -> FloatArray:
        """Values of s at points t (k,) of the edges, 0 to 1 along the tangent, (edges, k)."""
        shapes = bernstein_basis(self.values.shape[1] - 1, t)
        least = 1e-30 * max(float(self.weights.max(initial=0.0)), 1e-270)
        weights = np.maximum(self.weights, least)  # of an open edge all alike
        return np.asarray((self.values * weights) @ shapes.T / (weights @ shapes.T))

    def steepest(self) -> FloatArray:
        """No less than |ds/dt| on each of 16 equal parts of the edges, t from 0 to 1 on the part.

        With the points P_i = s_i and weights ω_i of a part of degree n, s is a quotient of convex combinations, and
        |ds/dt| ≤ n (max ω/min ω) (max |P_{i+1} − P_i| + ½ (r − 1) (max P − min P)), r the largest over the smallest
        of ω_{i+1}/ω_i: de Casteljau's last step has s' = n w₀ w₁/w² (p₁ − p₀), w between w₀ and w₁.
        """
        n = self.values.shape[1] - 1
        weights = np.where(self.weights.any(axis=1, keepdims=True), self.weights, 1.0)
        parts = np.stack([self.values * weights, weights])[:, :, None]  # (2, edges, parts, n + 1)
        left = np.array([[comb(i, j) / 2.0**i for j in range(n + 1)] for i in range(n + 1)])
        for _ in range(4):
            halves = np.stack([parts @ left.T, parts @ left[::-1, ::-1].T], axis=3)
            parts = halves.reshape(2, len(self.values), -1, n + 1)
        work, weights = parts
        even = np.ptp(self.values, axis=1) == 0.0
        if not n or not len(weights):
            return np.zeros(weights.shape[:2])
        bears = weights.min(axis=2) > 1e-12 * weights.max(axis=2)
        weights = np.where(bears[..., None], weights, 1.0)
        points, ratios = work / weights, weights[..., 1:] / weights[..., :-1]
        steps, turn = np.abs(np.diff(points)).max(axis=2), ratios.max(axis=2) / ratios.min(axis=2)
        found = n * weights.max(axis=2) / weights.min(axis=2) * (steps + 0.5 * (turn - 1.0) * np.ptp(points, axis=2))
        return np.where(even[:, None], 0.0, np.where(bears, found, np.inf))


def shares_on(body: Body, whole: ContactProblem, shares: Mapping[str, Share]) -> dict[str, Share]:
    """Shares on one body from those of all: beyond a joint the normal of a contact is another, the tangent is not."""
    found = dict[str, Share]()
    for contact in body.problem.contacts:
        beyond = contact.name in body.beyond
        share = shares.get(body.beyond[contact.name] if beyond else contact.name)
        if share is not None:
            own = np.isin(whole.mesh.edges(share.contact.edges).cells[:, int(beyond)], body.cells)
            sign = -1.0 if beyond else 1.0
            parts = (sign * share.values, share.weights, sign * share.slipping, share.room)
            found[contact.name] = Share(contact, *(part[own] for part in parts))
    return found


@dataclass(frozen=True, eq=False)
class SharedStress:
    """A stress with continuous shares."""

    result: ContactResult  # it carries the stress τ + η
    shares: Mapping[str, Share]  # s, by contact with Coulomb friction
    # where a contact reaches its bound of friction, or is open, but s must vanish; a sentence for each
    places: tuple[str, ...]
    before: ContactResult  # it carries τ

    @property
    def slipping(self) -> dict[str, FloatArray]:
        """`Share.slipping` by contact."""
        return {name: share.slipping for name, share in self.shares.items()}


def with_numbers(result: ContactResult) -> ContactResult:
    """The result with friction and cohesion as numbers where functions have one value on all of a contact."""
    problem = result.problem
    if not any(callable(each.friction) or callable(each.cohesion) for each in problem.contacts):
        return result

    def constant(contact: Contact) -> Contact:
        points, given = problem.mesh.points_along(problem.mesh.edges(contact.edges), SAMPLES), dict[str, Any]()
        for name in ("friction", "cohesion"):
            values = evaluate(f"Contact.{name}", getattr(contact, name), *points)
            if np.ptp(values) <= _SAME * np.abs(values).max():
                given[name] = float(values.flat[0])
        return replace(contact, **given)

    known = replace(result.discretization, problem=with_contacts(problem, constant))
    return ContactResult(known, result.solution)


def outside_scope(problem: ContactProblem) -> str:
    """Why nothing is known of the errors of a problem under Coulomb's law, as far as its data show; else empty."""
    for contact in filter(has_coulomb, problem.contacts):
        name = repr(contact.name)
        if contact.law != "unilateral":
            return f"Bounds under friction are for contacts that may open: {name} keeps its distance."
        if callable(contact.friction) or callable(contact.cohesion):
            return f"Bounds under friction need constant friction and cohesion: those of {name} vary."
        if contact.shear_limit is not None:
            return f"Bounds under friction are for Coulomb's law without a limit of the shear stress: {name} has one."
        if contact.tangential_stiffness is not None and contact.normal_stiffness is None:
            return (
                f"Bounds under friction are not for springs along a contact without springs across it: give {name} a "
                "normal stiffness, or no tangential one."
            )
    return ""


def with_bernstein_rows(known: Discretization) -> Discretization:
    """The same problem on the same elements and in the same units, with rows that hold the law on whole edges."""
    if known.rule.law_on == "edges":
        return known
    return discretize(known.problem, degree=known.space.degree, law_on="edges", scales=known.scales)


def with_shares(result: ContactResult, tolerance: float, *, far: bool = True) -> SharedStress | str:
    """(H4): a stress with continuous shares near that of a result, or why nothing is known of its errors.

    A result with rows that do not hold Coulomb's law on whole edges is solved anew. At a vertex between edges of which
    one slips, s is 1 or −1 as there; where nothing slips it is the mean, weighted by the bounds; where no R of (D26)
    exists else, it is 0. Of each edge only the first and the last coefficient of the shear that counts are changed.
    Displacements may slip either way on edges `far` from an obstacle.
    """
    reason, found = outside_scope(result.problem), dict[str, Share]()
    if reason:
        return reason
    known, solution = with_bernstein_rows(result.discretization), result.solution
    if known is not result.discretization:
        solution = solve_qvi(known.qvi, tolerance=tolerance)
    result = ContactResult(known, solution)
    if not result.has_state:
        return f"No stress that obeys the contact law on whole edges was found: {solution.message}"
    own, senses = EdgeTractions.of(known, result.dofs), prescribed_slip(known.problem)
    for rows, contact in zip(known.contacts, known.problem.contacts, strict=True):
        if has_coulomb(contact):
            slip = result.contacts[contact.name].slip
            least = _NOTHING * max(own.size, result.certificate.scales.get("stress", 0.0))
            parts = own.bound[rows.edges], own.shear[rows.edges], slip, senses[contact.name]
            found[contact.name] = _raw(contact, *parts, least)
    shares, places = joined(known.problem, found, _vanishing(known.problem), senses)
    if far:
        shares = {name: _free_far_away(result, share) for name, share in shares.items()}
    moved = _moved(result, shares)
    return moved if isinstance(moved, str) else SharedStress(*moved, places, result)


def _free_far_away(result: ContactResult, share: Share) -> Share:
    """The same where displacements may slip either way far from the obstacle, and s is 0 there but beside other edges.

    Not where all slips one way on straight edges: there a norm may be proved.
    """
    line, edges = result.contacts[share.contact.name], result.problem.mesh.edges(share.contact.edges)
    least = _FAR * AWAY * share.friction
    near = (line.gap <= least * np.abs(line.slip)).reshape(len(edges), -1)
    away: BoolArray = np.asarray(~np.hstack([near, share.weights > 0.0]).any(axis=1))
    if share.contact.cohesion or not (edges.curved or (share.slipping[away] == 0.0).any()):
        return share
    shares = [result.problem.mesh.edges(each.edges) for each in filter(has_coulomb, result.problem.contacts)]
    met = np.bincount(np.concatenate([ends for each in shares for ends in (each.first, each.second)]))
    among = np.bincount(np.concatenate([edges.first[away], edges.second[away]]), minlength=len(met))
    kept = np.zeros_like(share.values)
    kept[:, 0], kept[:, -1] = (met[ends] > among[ends] for ends in (edges.first, edges.second))
    kept = np.where(away[:, None], kept, 1.0)
    slipping = np.where(away, np.nan, share.slipping)
    return replace(share, values=kept * share.values, slipping=slipping, room=kept * share.room)


def _raw(
    contact: Contact, bound: FloatArray, shear: FloatArray, slip: FloatArray, given: FloatArray, least: float
) -> Share:
    """What s is by the stress, edge by edge; on open edges ±1 as the body slips there. A bound of `least` is none.

    Where supports prescribe slip at an end it is ±1 in that sense (e,): displacements must slip there.
    """
    most = bound.max(axis=1, keepdims=True)
    is_open = most[:, 0] <= max(_OPEN * float(most.max(initial=0.0)), least)
    values = np.clip(-shear / np.maximum(bound, 1e-300), -1.0, 1.0)
    backwards = slip.reshape(len(bound), -1).sum(axis=1) < 0.0
    values[is_open] = np.where(backwards, -1.0, 1.0)[is_open, None]
    bears = bound > _BEARS * most
    for chosen in np.flatnonzero(~is_open & ~bears.all(axis=1)).tolist():  # what bears little is as what is next to it
        counts = np.flatnonzero(bears[chosen])
        away = np.abs(np.arange(bound.shape[1])[:, None] - counts)
        nearest = away == away.min(axis=1, keepdims=True)  # on both sides where they are as near, and then the mean
        values[chosen] = nearest @ values[chosen, counts] / nearest.sum(axis=1)
    values = np.where(given[:, None] == 0.0, values, given[:, None])
    values = np.where(np.abs(values) >= 1.0 - _SLIPS, np.sign(values), values)
    slips = np.abs(values.sum(axis=1)) == values.shape[1]
    weights, slipping = np.where(is_open[:, None], 0.0, bound), np.where(slips, values[:, 0], 0.0)
    return Share(contact, values, weights, slipping, 1.0 - np.abs(values))


def joined(
    problem: ContactProblem, raw: Mapping[str, Share], zeros: BoolArray, given: Mapping[str, FloatArray] | None = None
) -> tuple[dict[str, Share], tuple[str, ...]]:
    """The same made continuous at vertices, 0 at some (vertices,), and where that costs much.

    Edges that meet take the value of those whose sense is `given`, else that slip, else of open ones, else the mean.
    """
    lines = {name: problem.mesh.edges(share.contact.edges) for name, share in raw.items()}
    raw = {name: _turned(problem, share) for name, share in raw.items()}
    vertex = np.concatenate([vertices for edges in lines.values() for vertices in (edges.first, edges.second)])
    value, weight = (
        np.concatenate([getattr(share, part)[:, [0, -1]].T.ravel() for share in raw.values()])
        for part in ("values", "weights")
    )
    slips = np.concatenate([np.tile(share.slipping != 0.0, 2) for share in raw.values()])
    bears = np.concatenate([np.tile(share.weights.any(axis=1), 2) for share in raw.values()])

    def beside(chosen: BoolArray) -> BoolArray:
        """Ends at vertices where some of the chosen ones meet."""
        found = np.zeros_like(zeros)
        found[vertex[chosen]] = True
        return np.asarray(found[vertex])

    chosen = np.where(beside(slips & bears), slips & bears, ~bears)
    forced = np.concatenate([np.tile(given[name] != 0.0, 2) for name in raw]) if given else np.zeros_like(slips)
    chosen = np.where(beside(forced), forced, chosen)
    least, most = np.full(len(zeros), np.inf), np.full(len(zeros), -np.inf)
    np.minimum.at(least, vertex[chosen], value[chosen])
    np.maximum.at(most, vertex[chosen], value[chosen])
    weight = np.where(beside(weight > 0.0), weight, 1.0)
    total, mass = (np.bincount(vertex, part, len(zeros)) for part in (weight * value, weight))
    common = np.where(least > most, total / np.where(mass > 0.0, mass, 1.0), np.where(least == most, least, 0.0))
    common[zeros] = 0.0
    found, places = dict[str, Share](), list[str]()
    for name, share in raw.items():
        counts = share.weights > _BEARS * share.weights.max(axis=1, keepdims=True)
        counts |= counts.sum(axis=1, keepdims=True) < 2
        before, after = (np.cumsum(counts[:, ::way], axis=1)[:, ::way] - counts for way in (1, -1))
        values, slipping, room = share.values.copy(), share.slipping.copy(), np.ones_like(share.values)
        for vertices, near in ((lines[name].first, before == 0), (lines[name].second, after == 0)):
            wanted, vanishes = common[vertices], zeros[vertices]
            changes = (share.slipping != wanted) | (wanted == 0.0)
            values = np.where(near & changes[:, None], wanted[:, None], values)
            slipping[changes] = 0.0
            room[near & vanishes[:, None]] = 0.0
            places += [
                f"At ({x:.6g}, {y:.6g}) {name!r} has a kink, or meets other friction or what holds its normal "
                "displacement. Nothing may slip there, which makes the bound wide."
                for x, y in problem.mesh.vertices[vertices[vanishes & (share.slipping != 0.0)]]
            ]
        own = replace(share, values=values, slipping=slipping, room=room * (1.0 - np.abs(values)))
        found[name] = _turned(problem, own)
    return found, tuple(dict.fromkeys(places))


def _turned(problem: ContactProblem, share: Share) -> Share:
    """The same along tangents that lead counterclockwise from normals: it is continuous where tangents turn back."""
    edges = problem.mesh.edges(share.contact.edges)
    senses = np.rint(cross(edges.normal, edges.tangent))
    return replace(share, values=senses[:, None] * share.values, slipping=senses * share.slipping)


def _moved(result: ContactResult, shares: Mapping[str, Share]) -> tuple[ContactResult, dict[str, Share]] | str:
    """The result with the shear that the shares say, by the least energy of a change, and these shares.

    Inside edges that stick s may be any other: what the ends ask for is balanced there as far as |s| ≤ 1 allows. Where
    that is not enough pressure changes too, and the bound with it: the rows are (τ + η)_T = −s B(τ + η).
    """
    known, qvi = result.discretization, result.discretization.qvi
    m, rough = qvi.m, [rows for rows in known.contacts if rows.name in shares]
    own = EdgeTractions.of(known, result.dofs)
    wanted, turned, free, bears = np.zeros(m), np.zeros(m), np.zeros(m, dtype=bool), np.zeros(m, dtype=bool)
    for rows in rough:
        share, at, bound, shear = shares[rows.name], rows.rows, own.bound[rows.edges], own.shear[rows.edges]
        counts = share.weights > _BEARS * bound.max(axis=1, keepdims=True)
        wanted[at], turned[at] = (-share.values * bound - shear).ravel(), share.friction * share.values.ravel()
        before, after = (np.cumsum(counts[:, ::way], axis=1)[:, ::way] for way in (1, -1))
        free[at] = ((share.slipping == 0.0)[:, None] & counts & (before > 1) & (after > 1)).ravel()  # the ends' are not
        pressure = -own.normal[rows.edges]
        bears[at] = (pressure > _BEARS * pressure.max(initial=0.0)).ravel()
    size = max(float(np.abs(wanted).max()), *(float(share.weights.max(initial=0.0)) for share in shares.values()))
    if not np.abs(wanted).max(initial=0.0) > 0.0:
        return result, dict(shares)
    free &= np.abs(wanted) <= _MET * size  # not what an end has asked for
    shears = sparse.csr_array(qvi.T - sparse.diags_array(turned) @ qvi.N)
    for pressure_changes in (False, True):
        inside, pressed = free, bears & pressure_changes
        for trial in range(_TRIALS):
            inside, pressed = inside & (trial < _TRIALS - 1), pressed & (trial < _TRIALS - 1)
            kept = np.flatnonzero(np.concatenate([~pressed, ~inside, np.ones(qvi.A.shape[0], dtype=bool)]))
            rows_kept = sparse.csr_array(sparse.vstack([qvi.N, shears, qvi.A]))[kept]
            right = np.concatenate([np.zeros(m), wanted, np.zeros(qvi.A.shape[0])])[kept]
            change = LeastChange.of(qvi.K, rows_kept).solved(right)
            moved = ContactResult(known, replace(result.solution, z=result.solution.z + change))
            found, wrong, new = dict(shares), np.zeros((2, m), dtype=bool), EdgeTractions.of(known, moved.dofs)
            for rows in rough:
                share, at, bound, shear = shares[rows.name], rows.rows, new.bound[rows.edges], new.shear[rows.edges]
                here = inside[at].reshape(bound.shape)
                values = np.where(here, -shear / np.maximum(bound, 1e-300), share.values)
                wrong[0, at] = pressed[at] & (new.normal[rows.edges] > 0.0).ravel()
                wrong[1, at] = (np.abs(values) > 1.0).ravel()
                room = np.where(here, 1.0 - np.abs(values), share.room)
                weights = np.where(share.weights > 0.0, bound, 0.0)
                found[rows.name] = replace(share, values=values, room=room, weights=weights)
            if not wrong.any():
                break
            pressed, inside = pressed & ~wrong[0], inside & ~wrong[1]
        left = np.abs(rows_kept @ change - right)
        if left.max() <= _MET * size:
            return moved, found
    row = int(kept[left.argmax()])  # where no stress of the elements has the shear that is wanted
    number = row % m if row < 2 * m else 0
    rows = next(each for each in known.contacts if each.rows.start <= number < each.rows.stop)
    x, y = known.problem.mesh.vertices[rows.points.edges.first[(number - rows.rows.start) // known.rule.count]]
    return f"No stress on this mesh has a continuous share of friction on {rows.name!r} near ({x:.6g}, {y:.6g})."


def held_directions(problem: ContactProblem) -> list[FloatArray]:
    """Directions (k, 2) in which each boundary edge holds displacements; tied contacts hold both, but for springs."""
    found: list[list[FloatArray]] = [[] for _ in range(len(problem.mesh.boundary))]
    for given in problem.prescribed(Displacement):
        for edge, direction in zip(given.index.tolist(), given.direction, strict=True):
            found[edge].append(direction)
    for contact in problem.contacts:
        if contact.law == "tied" and contact not in problem.joints:
            rigid = [each is None for each in (contact.normal_stiffness, contact.tangential_stiffness)]
            for edge in problem.mesh.edge_set(contact.edges).tolist():
                both = np.stack([problem.mesh.boundary.normal[edge], problem.mesh.boundary.tangent[edge]])
                found[edge] += list(np.eye(2) if all(rigid) else both[rigid])
    return [np.array(directions).reshape(-1, 2) for directions in found]


def spans(directions: FloatArray, wanted: FloatArray) -> bool:
    """Whether a direction is a combination of given ones (k, 2)."""
    if not len(directions):
        return False
    known = np.linalg.lstsq(directions.T, wanted, rcond=PARALLEL)[0] @ directions
    return bool(np.abs(known - wanted).max() <= PARALLEL)


def _sides(problem: ContactProblem) -> Iterator[tuple[Edges, IntArray, Contact | None]]:
    """Edges, the bodies (e,) they belong to, and their law: all of the boundary without one, joints on both sides.

    A joint with one body on both sides is a crack: then all is one body, and joints have one side.
    """
    mesh, body = problem.mesh, blocks_of_cells(problem)
    laws = [(each, mesh.edges(each.edges)) for each in problem.contacts if each.law != "tied"]
    joined = [edges.cells for each, edges in laws if each in problem.joints]
    cracked = any((body[cells[:, 0]] == body[cells[:, 1]]).any() for cells in joined)
    if cracked:
        body = np.zeros_like(body)
    yield mesh.boundary, body[mesh.boundary.cells[:, 0]], None
    for law, edges in laws:
        for side in (0, 1) if law in problem.joints and not cracked else (0,):
            yield edges, body[edges.cells[:, side]], law


def _vanishing(problem: ContactProblem) -> BoolArray:
    """Vertices (n,) where s must be 0: kinks, and where what meets a contact holds the normal part of R v.

    With rows C w = D v of laws, for s = 1, and h · v = h · w = 0 of what is held, there is a w = R v for every v of a
    body where the rank of all rows is that of those in w alone and of those in v alone. Springs across a contact take
    μ s v_T upon themselves. On a joint both bodies have the same rows.
    """
    none, held, lines = np.zeros(2), held_directions(problem), list(_sides(problem))
    demands = dict[tuple[int, int], tuple[list[FloatArray], list[FloatArray]]]()  # by body and vertex
    for edges, bodies, law in lines:
        if law is not None and has_coulomb(law) and law.normal_stiffness is None:
            for vertices in (edges.first, edges.second):
                places = zip(bodies.tolist(), vertices.tolist(), strict=True)
                demands |= {place: ([none], [np.zeros(4)]) for place in places}
    for edges, bodies, law in lines:
        frames = frames_along(edges, np.array([0.0, 1.0]))[0]
        for end, vertices in enumerate((edges.first, edges.second)):
            for edge, place in enumerate(zip(bodies.tolist(), vertices.tolist(), strict=True)):
                fixed, rows = demands.get(place, ([], []))
                if law is None:
                    fixed += list(held[edge])
                    rows += [np.append(each, none) for each in held[edge]]
                    continue
                normal, tangent = frames[edge, end], np.array([-1.0, 1.0]) * frames[edge, end, ::-1]
                friction = law.friction if has_coulomb(law) else 0.0
                assert not callable(friction)
                rows += [np.append(normal, -friction * tangent)] + [np.append(tangent, none)] * bears_shear(law)
    found = np.zeros(len(problem.mesh.vertices), dtype=bool)
    for (_, vertex), (fixed, rows) in demands.items():
        both = [*rows, *(np.append(none, each) for each in fixed)]
        ranks = (int(np.linalg.matrix_rank(part, ALIKE)) for part in (both, np.array(rows)[:, :2], fixed))
        found[vertex] |= next(ranks) > sum(ranks)
    return found
