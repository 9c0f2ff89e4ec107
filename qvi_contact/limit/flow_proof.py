"""Proofs of upper bounds: velocities in rational numbers, for `check_proof`.

They are zero in the directions in which no traction is prescribed. Rigid blocks have three numbers each; for them that
is a set of linear equations, and so is what holds contacts at the limits at which they are. Bodies that keep their
volume flow by a stream function ψ, v = (ψ_y, −ψ_x), C1 on each of them. Of others the numbers at nodes are free. What a
contact or a body that dilates must keep holds with room, by a share of a flow inside all limits.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.element.triangle import EDGES, exponents
from qvi_contact.errors import InputError, SolveError
from qvi_contact.limit.proof import Statement, ends, law_of
from qvi_contact.limit.rational import Given, Row, Vector, cross, dot, less, middle, smooth, solved, vertex_values
from qvi_contact.limit.split import part_corners
from qvi_contact.mechanism import Mechanism
from qvi_contact.problem.conditions import Contact

if TYPE_CHECKING:
    from qvi_contact.limit.flow import Flow, FlowProgram, Velocities

KEPT_BACK: Final = 1e-9
"""Share of the way to a flow inside, which may dissipate much more, that a proof keeps back for rounding."""

_Held: TypeAlias = list[tuple[int, tuple[int, int], list[Vector]]]

_ACTIVE: Final = 1e-9  # speed of opening, over the largest one, within which a contact of rigid blocks is at its limit
_ZERO: Final = Fraction(0)
_AXES: Final[list[Vector]] = [(Fraction(1), _ZERO), (_ZERO, Fraction(1))]


def exceeded(stated: Statement, program: FlowProgram, flow: Flow | Mechanism) -> dict[str, Any]:
    """The part of a proof that says what no stress carries, from velocities of blocks or of the program."""
    cones, shares = program.cones, dict[str, Any]()
    degree = 1 if isinstance(flow, Mechanism) else cones.degree + 1
    if isinstance(flow, Mechanism):
        parts = _of_blocks(stated, flow)
    else:
        changes = (cones.pressure != 0.0) | (cones.mean != 0.0)
        keeps = ~cones.strong
        keeps[cones.coefficient[changes] // (3 * cones.count)] = False
        parts = _of_nodes(stated, program.space, flow, cones.strong, keeps)
        shares = _shares(program, flow, changes)
    velocities = [[[[str(x), str(y)] for x, y in part] for part in cell] for cell in parts]
    return {"flow": {"degree": degree, "velocities": velocities, "shares": shares}}


def _shares(program: FlowProgram, flow: Flow, changes: BoolArray) -> dict[str, Any]:
    """What each of several cones has of a strain rate, by its number; the first that may change volume has the rest.

    Velocities are lengths over that of the mesh, and so are strain rates here: of lengths they are as much less.
    """
    assert flow.shares is not None
    coefficient, strain = program.cones.coefficient, flow.shares / program.space.mesh.length
    small, found = _ACTIVE * float(np.abs(strain).max(initial=0.0)), dict[str, Any]()
    order = np.argsort(coefficient, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(coefficient[order])) + 1):
        if len(rows) > 1 and np.abs(strain[rows]).max() > small:
            numbers = [[str(Fraction(x)) for x in strain[row].tolist()] for row in rows]
            rest = int(np.flatnonzero(changes[rows])[0])
            found[str(int(coefficient[rows[0]]))] = [*numbers[:rest], None, *numbers[rest + 1 :]]
    return found


def _held(stated: Statement) -> _Held:
    """Directions d with d·v = 0 along edges of the boundary, with the cell beside them and their ends."""
    boundary, found = stated.mesh.boundary, dict[tuple[int, int], list[Vector]]()
    pairs: list[tuple[int, int]] = list(zip(boundary.first.tolist(), boundary.second.tolist(), strict=True))
    for i, j in pairs:
        given = [load.direction for load in stated.loads.get((i, j), stated.loads.get((j, i), []))]
        found[i, j] = [_AXES, [(-d[1], d[0]) for d in given], []][len(given)]
    for contact in stated.problem.contacts:
        if contact not in stated.problem.joints and contact.law != "tied":
            for i, j in ends(stated, contact):
                e = less(stated.points[j], stated.points[i])
                mu, _, cap = law_of(stated.problem, contact)
                axes = [(e[1], -e[0]), *([e] if mu > 0 and cap is None else [])]
                found[(i, j) if (i, j) in found else (j, i)] = axes if contact.law == "bilateral" else []
    return [(int(cell), pair, found[pair]) for cell, pair in zip(boundary.cells[:, 0], pairs, strict=True)]


def _rigid(motion: Sequence[Fraction], at: Vector) -> Vector:
    """The velocity (a − θ y, b + θ x) of a motion (a, b, θ)."""
    return motion[0] - motion[2] * at[1], motion[1] + motion[2] * at[0]


def _rigid_row(body: int, d: Vector, at: Vector, sign: int = 1) -> dict[int, Fraction]:
    """± d·v at a place as a row on the motions of bodies; without a body an empty one."""
    parts = (d[0], d[1], d[1] * at[0] - d[0] * at[1])
    return {3 * body + i: sign * part for i, part in enumerate(parts) if part != 0} if body >= 0 else {}


def _of_blocks(stated: Statement, mechanism: Mechanism) -> Iterator[list[list[Vector]]]:
    """Velocities of rigid blocks, for which contacts that are at their limit stay there exactly."""
    blocks, motions = mechanism.blocks, list[Fraction]()
    for block in mechanism.motions:
        x, y = block.centre
        motions += map(Fraction, (block.x + block.rotation * y, block.y - block.rotation * x, block.rotation))
    rows = [_rigid_row(int(blocks[cell]), d, stated.points[end])
            for cell, pair, directions in _held(stated) for d in directions for end in pair]  # fmt: skip
    for contact in stated.problem.contacts:
        if contact.law != "tied":
            rows += _at_limits(stated, contact, blocks, motions)
    motions = solved([(row, _ZERO) for row in rows], motions)
    for cell, block in zip(stated.mesh.cells.tolist(), blocks.tolist(), strict=True):
        points = [stated.points[v] for v in cell]
        yield [[_rigid(motions[3 * block : 3 * block + 3], at) for at in (points[a], points[b], middle(points))]
               for a, b in EDGES]  # fmt: skip


def _at_limits(
    stated: Statement, contact: Contact, blocks: IntArray, motions: Sequence[Fraction]
) -> Iterator[dict[int, Fraction]]:
    """Rows of what a contact must hold that a motion holds with equality, within rounding, at the ends of its edges."""
    joint, (mu, _, cap) = contact in stated.problem.joints, law_of(stated.problem, contact)
    edges = stated.mesh.edges(contact.edges)
    dilates = contact.law == "unilateral" and cap is None and mu > 0
    for n, (i, j) in enumerate(ends(stated, contact)):
        first, second = int(blocks[edges.cells[n, 0]]), int(blocks[edges.cells[n, 1]]) if joint else -1
        e = less(stated.points[j], stated.points[i])
        out = 1 if dot((e[1], -e[0]), [Fraction(x) for x in edges.normal[n].tolist()]) > 0 else -1
        small = _ACTIVE * float(dot(e, e)) ** 0.5
        for at in (stated.points[i], stated.points[j]):
            opening, slip = (
                {**_rigid_row(first, d, at, sign), **_rigid_row(second, d, at, -sign)} if first != second else {}
                for d, sign in (((e[1], -e[0]), -out), (e, 1))
            )
            w, t = (float(sum(c * motions[number] for number, c in row.items())) for row in (opening, slip))
            if contact.law == "bilateral" or w - dilates * float(mu) * abs(t) <= small:
                share = mu if t > 0 else -mu
                stuck = not dilates or abs(t) <= small
                yield opening if stuck else {number: opening.get(number, _ZERO) - share * slip.get(number, _ZERO)
                                             for number in {**opening, **slip}}  # fmt: skip
                if stuck and mu > 0 and cap is None:
                    yield slip


def _stream_nodes(stated: Statement, space: Velocities, flow: Flow, keeps: BoolArray, held: _Held) -> dict[int, Vector]:
    """Velocities (ψ_y, −ψ_x) of nodes of parts that keep their volume, with a stream function that is C1 on each."""
    p, mesh, sides = space.degree + 1, stated.mesh, space.nodes.of_sides  # opposite to each corner
    tips = np.array([sides[2, 0], sides[2, -1], sides[1, -1]])
    corners, cells = space.global_[:, tips], np.flatnonzero(keeps)
    nodes, at = np.unique(corners[cells], return_index=True)  # of corners, which blocks do not share
    ids = np.where(np.isin(corners, nodes), np.searchsorted(nodes, corners), -1)
    points = [stated.points[v] for v in mesh.cells[cells].ravel()[at].tolist()]
    given, rows = _kept(stated, ids, keeps, points, p, held)
    values, rough = _stream_function(space, _velocities(flow), tips, ids, cells)
    exact = vertex_values(points, p, given, rows, values)
    number = {tuple(alpha): n for n, alpha in enumerate(exponents(p).tolist())}
    found, smoothed = dict[int, Vector](), smooth(points, ids[cells].tolist(), p, given, exact, rough)
    for cell, ordinates in zip(cells.tolist(), smoothed, strict=True):
        ends = [points[i] for i in ids[cell].tolist()]
        for c, (a, b), own in zip(ordinates, EDGES, space.nodes.of_parts, strict=True):
            one, other = less(ends[b], ends[a]), less(middle(ends), ends[a])
            for node, alpha in zip(space.global_[cell, own].tolist(), exponents(p - 1).tolist(), strict=True):
                c0, c1, c2 = (c[number[tuple(alpha[m] + (m == n) for m in range(3))]] for n in range(3))
                u, w = (p * (each - c0) / cross(one, other) for each in (c1, c2))  # ∇ψ·one and ∇ψ·other over the area
                found[node] = w * one[0] - u * other[0], w * one[1] - u * other[1]
    return found


def _velocities(flow: Flow) -> FloatArray:
    assert flow.motion is not None
    return flow.motion.velocities


def _kept(
    stated: Statement, ids: IntArray, keeps: BoolArray, points: Sequence[Vector], p: int, held: _Held
) -> tuple[Given, list[Row]]:
    """What held edges say of ψ along them, and of its slopes at their ends."""
    given, rows = dict[tuple[int, int], list[list[Fraction] | None]](), list[Row]()
    for cell, pair, directions in held:
        i, j = (int(ids[cell, stated.mesh.cells[cell].tolist().index(v)]) for v in pair)
        if directions and keeps[cell]:
            e = less(points[j], points[i])
            axes = [any(dot(d, axis) != 0 for d in directions) for axis in ((e[1], -e[0]), e)]
            if sum(axes) != len(directions):
                raise InputError(
                    "Traction", stated.mesh.edge_names, "on slanted edges proof files hold no x or y alone"
                )
            given[i, j] = [[_ZERO] * (p - 1) if each else None for each in axes]
        for d in directions:
            for end in (i, j):
                if end >= 0:
                    row = {3 * end + 2: d[0], 3 * end + 1: -d[1]}
                    rows.append(({column: value for column, value in row.items() if value != 0}, _ZERO))
    return given, rows


def _stream_function(
    space: Velocities, v: FloatArray, tips: IntArray, ids: IntArray, cells: IntArray
) -> tuple[FloatArray, FloatArray]:
    """(ψ, ψ_x, ψ_y) at corners, and ordinates (n, 3, count) of ψ on parts of some cells, in floating point."""
    p, corners, count, ids, v = space.degree + 1, space.mesh.corners[cells], int(ids.max()) + 1, ids[cells], v[cells]
    # along edges ψ_j − ψ_i = e × mean v; one corner of each block has ψ = 0
    step = np.zeros((len(ids), 3))
    for s, (a, b) in enumerate(EDGES):
        e, mean = corners[:, b] - corners[:, a], v[:, space.nodes.of_sides[s]].mean(axis=1)
        step[:, s] = mean[:, 0] * e[:, 1] - mean[:, 1] * e[:, 0]
    first, second = (ids[:, [edge[end] for edge in EDGES]].ravel() for end in (0, 1))
    at = np.arange(len(first))
    A = sparse.csr_array((np.repeat([-1.0, 1.0], len(at)), (np.tile(at, 2), np.concatenate([first, second]))),
                         shape=(len(at), count))  # fmt: skip
    label = csgraph.connected_components(A.T @ A, directed=False)[1]
    fixed = np.unique(label, return_index=True)[1]
    anchors = sparse.csr_array((np.ones(len(fixed)), (fixed, fixed)), shape=(count, count))
    values = np.zeros((count, 3))
    values[:, 0] = sparse.linalg.spsolve(sparse.csc_array(A.T @ A + anchors), A.T @ step.ravel())
    values[ids, 1], values[ids, 2] = -v[:, tips, 1], v[:, tips, 0]
    # p (c_(α + e_i) − c_(α + e_0)) = (x_i − x_0) × v_α
    alphas = [tuple(alpha) for alpha in exponents(p).tolist()]
    number = {alpha: n for n, alpha in enumerate(alphas)}
    lower = {tuple(alpha): n for n, alpha in enumerate(exponents(p - 1).tolist())}
    rough, arms = np.zeros((len(ids), 3, len(alphas))), part_corners(corners)
    for s, (a, _) in enumerate(EDGES):
        rough[:, s, 0] = values[ids[:, a], 0]
        for n, (k, first_k, second_k) in enumerate(alphas[1:], start=1):
            i = 1 if first_k else 2
            below = (k, first_k - (i == 1), second_k - (i == 2))
            arm, w = arms[:, s, i] - arms[:, s, 0], v[:, space.nodes.of_parts[s, lower[below]]]
            before = rough[:, s, number[k + 1, below[1], below[2]]]
            rough[:, s, n] = before + (w[:, 0] * arm[:, 1] - w[:, 1] * arm[:, 0]) / p
    return values, rough


def _of_nodes(
    stated: Statement, space: Velocities, flow: Flow, strong: BoolArray, keeps: BoolArray
) -> Iterator[list[list[Vector]]]:
    """Velocities by numbers at nodes, in the directions that are free.

    Those of rigid parts, and of parts that keep their volume, follow from their motions and stream functions.
    """
    if np.intersect1d(space.global_[strong], space.global_[keeps]).size:
        raise SolveError("proof: no part of a body may keep its volume beside one that is rigid")
    edges, held = _held(stated), dict[int, list[Vector]]()
    for cell, pair, directions in edges:
        opposite = int(np.flatnonzero(~np.isin(stated.mesh.cells[cell], pair))[0])
        for n in space.global_[cell, space.nodes.of_sides[opposite]].tolist():
            held.setdefault(n, []).extend(directions)
    rounded = np.zeros((space.count, 2))
    rounded[space.global_] = _velocities(flow)
    found = _rigid_nodes(stated, space, rounded, strong, held)
    if keeps.any():
        found |= _stream_nodes(stated, space, flow, keeps, edges)
    for n, (x, y) in enumerate(rounded.tolist()):
        if n not in found:
            v = (Fraction(x), Fraction(y))
            for d in held.get(n, []):
                v = less(v, [dot(d, v) / dot(d, d) * each for each in d])
            found[n] = v if all(dot(d, v) == 0 for d in held.get(n, [])) else (_ZERO, _ZERO)
    for cell in space.global_.tolist():
        yield [[found[cell[n]] for n in part] for part in space.nodes.of_parts.tolist()]


def _rigid_nodes(
    stated: Statement, space: Velocities, rounded: FloatArray, strong: BoolArray, held: Mapping[int, list[Vector]]
) -> dict[int, Vector]:
    """The velocities of nodes of rigid parts."""
    nodes, places, found = space.global_[strong], dict[int, Vector](), dict[int, Vector]()
    for cell in np.flatnonzero(strong).tolist():
        corners = [stated.points[v] for v in stated.mesh.cells[cell].tolist()]
        for n, (*weights, centre) in zip(space.global_[cell].tolist(), space.nodes.keys.tolist(), strict=True):
            shares = [Fraction(3 * weight + centre, 3 * space.degree) for weight in weights]
            x, y = (
                sum((a * b for a, b in zip(shares, part, strict=True)), _ZERO) for part in zip(*corners, strict=True)
            )
            places[n] = x, y
    links = np.repeat(nodes[:, 0], nodes.shape[1]), nodes.ravel()
    label = csgraph.connected_components(
        sparse.csr_array((np.ones(nodes.size), links), shape=(space.count, space.count)), directed=False
    )[1]
    for part in np.unique(label[nodes]).tolist():
        own = [n for n in places if label[n] == part]
        x, y = np.array([[float(each) for each in places[n]] for n in own]).T
        one, none = np.ones(len(own)), np.zeros(len(own))
        A = np.concatenate([np.column_stack([one, none, -y]), np.column_stack([none, one, x])])
        rough = np.linalg.lstsq(A, rounded[own].T.ravel(), rcond=None)[0]
        rows = [(_rigid_row(0, d, places[n]), _ZERO) for n in own for d in held.get(n, [])]
        moved = solved(rows, [Fraction(each) for each in rough.tolist()])
        found |= {n: _rigid(moved, places[n]) for n in own}
    return found
