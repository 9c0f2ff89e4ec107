"""Limit loads from above: velocities of the body, continuous on the split triangles, with jumps on its contacts.

The support function π(ε) = sup {σ·ε : σ ∈ G} of a yield criterion is convex and positively homogeneous. So with the
Bernstein coefficients ε_i of degree k = p − 2 of the strain rate of velocities v of degree p − 1 on the three parts of
every triangle

    ∫ π(ε) dx  ≤  Σ |part| mean_i π(ε_i),     π(ε) = min Σ_j a_j s_j   s.t.   |(ρ_j, r_j)| ≤ s_j,
                                              Σ_j r_j = ((ε_xx − ε_yy)/2, ε_xy),   Σ_j (β_j s_j + γ_j ρ_j) = tr ε/2

for cones |(γ_j S, σ_xx − σ_yy, 2σ_xy)| ≤ a_j − β_j S. On contacts jumps of v dissipate by the associated law (D23),
coefficient by coefficient. A part of the body without strength moves as a rigid body. Normalised to one unit of power
of the loads that are multiplied,

    min  ∫ π(ε) + ∫ π([v]) ds − P_dead(v)   s.t.   P(v) = 1

is an upper bound of the limit load for every v that the supports allow. On split triangles such velocities without
change of volume are the rotated gradients of C1 stream functions of degree p, so that nothing locks.

With the stress that carries α and the flow of power 1 both sides are apart by

    upper − lower  =  Σ_T [ Σ w_i π(ε_i) − ∫_T σ·ε ]  +  Σ_E [ π_E − ∫_E (σ_N' w − σ_T [v]_T) ds ],

and no part is negative, since σ is admissible at every point and π bounds what it can dissipate.

In `docs/theory.md`: (D37), (D38).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Final, NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from qvi_contact.basics.checks import BoolArray, Field, FloatArray, IntArray, evaluate
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.scaling import Scales
from qvi_contact.element import bernstein
from qvi_contact.element.triangle import EDGES, exponents, gradient, quadrature
from qvi_contact.element.triangle import bernstein as bernstein_values
from qvi_contact.errors import SolveError
from qvi_contact.limit.conic import HELD, INFEASIBLE, Cones, ConicProgram
from qvi_contact.limit.linear import edge_coefficients
from qvi_contact.limit.stresses import CarriedStress, YieldCones, coefficients_of, part_corners
from qvi_contact.mechanism.bodies import FLUID
from qvi_contact.mesh.edges import Edges
from qvi_contact.problem.conditions import Contact, Displacement, Traction, components
from qvi_contact.problem.fields import along_edges
from qvi_contact.problem.problem import ContactProblem, direction_of

_ALONG: Final = np.linspace(0.0, 1.0, 33)  # places of an edge where fields of contacts are looked at
_FREE: Final = 1e-12  # of squared unit vectors, in which nothing is prescribed
_NULL: Final = 1e-10  # of the largest singular value of conditions on rigid parts


@dataclass(frozen=True, eq=False)
class Flow:
    """The upper bound of the load factor that a velocity field proves.

    Attributes
    ----------
    bound : float
        The bound; infinity if no velocity has power, minus infinity if the other loads alone are too much.
    violation : float
        What the conditions on the velocities are missed by, relative: rounding.
    motion : BodyMotion or None
        The velocities; None if the bound is not finite.
    shares : (r, 3) array or None
        What each row of the cones has of (tr ε, ε_xx − ε_yy, 2ε_xy) at its coefficient; lengths over that of the mesh.

    """

    bound: float
    violation: float
    motion: BodyMotion | None = None
    shares: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class BodyMotion:
    """A velocity field with which the body gives way, of power 1 of the loads that are multiplied.

    Attributes
    ----------
    velocities : (cells, m, 2) array
        Bernstein coefficients of v on each triangle. Each is the velocity near the point that it belongs to.
    places : (m, 3) array
        Barycentric places of these coefficients in the triangle.
    strain : (cells, 3, count, 3) array
        Coefficients of (ε_xx, ε_yy, 2ε_xy) on the parts of each triangle, lengths over that of the mesh.
    dissipation : (cells,) array
        ∫ π(ε) dx, or the bound of it, in units of the load factor.
    contacts : mapping of str to ContactFlow
        What happens on each contact.

    """

    velocities: FloatArray
    places: FloatArray
    strain: FloatArray
    dissipation: FloatArray
    contacts: Mapping[str, ContactFlow]


@dataclass(frozen=True, eq=False)
class ContactFlow:
    """Jumps of v along a contact.

    Attributes
    ----------
    opening, slip : (edges, p) arrays
        Coefficients of w = −[v]_N and of [v]_T from the first end of each edge to its second.
    dissipation : (edges,) array
        ∫ π([v]) ds, or the bound of it, in units of the load factor.

    """

    opening: FloatArray
    slip: FloatArray
    dissipation: FloatArray


@dataclass(frozen=True, eq=False)
class Nodes:
    """Coefficients of velocities on a split triangle.

    Attributes
    ----------
    keys : (m, 4) int array
        Weights of the three corners and of the barycentre, times the degree.
    of_parts : (3, count) int array
        The coefficients of each part.
    of_sides : (3, p) int array
        Those along each side, from its lower corner to the higher one.

    """

    keys: IntArray
    of_parts: IntArray
    of_sides: IntArray

    @property
    def places(self) -> FloatArray:
        """Barycentric places (m, 3)."""
        return np.asarray((self.keys[:, :3] + self.keys[:, 3:] / 3.0) / self.keys[0].sum())

    @classmethod
    def of(cls, degree: int) -> Nodes:
        """For velocities of a degree."""
        index: dict[tuple[int, int, int, int], int] = {}
        parts = np.empty((3, len(exponents(degree))), dtype=np.int64)
        for s, (a, b) in enumerate(EDGES):
            for j, (first, second, inner) in enumerate(exponents(degree).tolist()):
                key = [0, 0, 0, inner]
                key[a], key[b] = first, second
                parts[s, j] = index.setdefault((key[0], key[1], key[2], key[3]), len(index))
        keys = np.array(list(index))
        sides = np.empty((3, degree + 1), dtype=np.int64)
        for s, (a, b) in enumerate(EDGES):
            for i in range(degree + 1):
                key = [0, 0, 0, 0]
                key[a], key[b] = degree - i, i
                sides[s, i] = index[key[0], key[1], key[2], 0]
        return cls(keys, parts, sides)


class Velocities:
    """The velocities that supports and rigid parts leave free, v = P q; lengths over that of the mesh.

    Attributes
    ----------
    nodes : Nodes
        Coefficients of a triangle.
    global_ : (cells, m) int array
        Which of all coefficients they are.
    basis : (2 N + 3 plates, n) sparse array
        P: first x and y of all coefficients, then the motions (a, b, θ) of plates driven by force about their pivots.

    """

    def __init__(self, problem: ContactProblem, degree: int, strong: BoolArray) -> None:
        self.problem, self.mesh, self.degree = problem, problem.mesh, degree
        self.nodes = Nodes.of(degree)
        self.global_ = self._numbered()
        self.count = int(self.global_.max()) + 1
        corners = (self.mesh.corners - self.mesh.origin) / self.mesh.length
        self.points = np.empty((self.count, 2))
        self.points[self.global_] = self.nodes.places @ corners
        self.plates = [contact for contact in problem.contacts if contact.plate is not None and contact.plate.driven]
        self.size = 2 * self.count + 3 * len(self.plates)
        self.basis = self._basis(strong)

    def _numbered(self) -> IntArray:
        """Coefficients that triangles share across edges that are no open joint are one."""
        mesh, m = self.mesh, len(self.nodes.places)
        cut = np.zeros(len(mesh.interior), dtype=bool)
        for joint in self.problem.joints:
            if joint.law != "tied":
                cut[mesh.joint_set(joint.edges)] = True
        edges = mesh.interior.take(~cut)
        first, second = (self.local(edges, side) for side in (0, 1))
        total = mesh.cell_count * m
        graph = sparse.csr_array((np.ones(first.size), (first.ravel(), second.ravel())), shape=(total, total))
        _, label = csgraph.connected_components(graph, directed=False)
        return np.asarray(label, dtype=np.int64).reshape(mesh.cell_count, m)

    def local(self, edges: Edges, side: int) -> IntArray:
        """Numbers cell · m + place of the coefficients (e, p) along edges, lower vertex first.

        They are those of the first cell (side 0), or of the one beyond (side 1).
        """
        cells = edges.cells[:, side]
        ends = np.sort(np.stack([edges.first, edges.second], axis=1), axis=1)
        corners = self.mesh.cells[cells]
        opposite = np.argmax((corners[:, :, None] != ends[:, None, :]).all(axis=2), axis=1)
        return np.asarray(cells[:, None] * len(self.nodes.places) + self.nodes.of_sides[opposite])

    def along(self, edges: Edges, side: int = 0) -> IntArray:
        """The coefficients (e, p) along edges from their first end to the second, among all."""
        found = self.global_.ravel()[self.local(edges, side)]
        flipped = edges.first > edges.second
        found[flipped] = found[flipped, ::-1]
        return found

    def rows(self, nodes: IntArray, direction: FloatArray) -> sparse.csr_array:
        """d·v at coefficients (r,) along d (r, 2), as rows on coefficients and plates."""
        r = len(nodes)
        at = np.arange(r)
        values, columns = np.concatenate(direction.T), np.concatenate([2 * nodes, 2 * nodes + 1])
        return sparse.csr_array((values, (np.tile(at, 2), columns)), shape=(r, self.size))

    def plate_rows(self, contact: Contact, points: FloatArray, direction: FloatArray) -> sparse.csr_array:
        """d·v of the plate behind a contact at points (r, 2); zero without one driven by force."""
        if contact not in self.plates:
            return sparse.csr_array((len(points), self.size))
        assert contact.plate is not None
        pivot = (np.array(contact.plate.pivot) - self.mesh.origin) / self.mesh.length
        arm = points - pivot
        turn = arm[:, 0] * direction[:, 1] - arm[:, 1] * direction[:, 0]
        start = 2 * self.count + 3 * self.plates.index(contact)
        values = np.concatenate([direction[:, 0], direction[:, 1], turn])
        at, columns = np.tile(np.arange(len(points)), 3), np.repeat(start + np.arange(3), len(points))
        return sparse.csr_array((values, (at, columns)), shape=(len(points), self.size))

    def _basis(self, strong: BoolArray) -> sparse.csr_array:
        """P, from supports at single coefficients, and from rigid parts."""
        N, conditions = self.count, np.zeros((self.count, 2, 2))
        held: list[tuple[IntArray, FloatArray]] = []
        for given in self.problem.prescribed(Displacement):
            nodes = self.along(given.edges)
            held.append((nodes.ravel(), np.repeat(given.direction, nodes.shape[1], axis=0)))
        for contact in self.problem.contacts:
            if contact.law == "tied" and contact not in self.problem.joints and contact not in self.plates:
                nodes = self.along(self.mesh.edges(contact.edges)).ravel()
                held += [(nodes, np.tile(axis, (len(nodes), 1))) for axis in np.eye(2)]
        for nodes, direction in held:
            np.add.at(conditions, nodes, direction[:, :, None] * direction[:, None, :])
        rigid = np.full(N, -1)
        of_strong = self.global_[strong]
        if len(of_strong):
            m = of_strong.shape[1]
            graph = sparse.csr_array(
                (np.ones(of_strong.size), (np.repeat(of_strong[:, 0], m), of_strong.ravel())), shape=(N, N)
            )
            label = csgraph.connected_components(graph, directed=False)[1]
            rigid[np.unique(of_strong)] = np.unique(label[np.unique(of_strong)], return_inverse=True)[1]
        free = np.flatnonzero(rigid < 0)
        values, vectors = np.linalg.eigh(conditions[free])
        node, which = np.nonzero(values <= _FREE)
        rows = np.concatenate([2 * free[node], 2 * free[node] + 1])
        data = np.concatenate([vectors[node, 0, which], vectors[node, 1, which]])
        columns = np.tile(np.arange(len(node)), 2)
        blocks = [sparse.csr_array((data, (rows, columns)), shape=(self.size, len(node)))]
        stiff = np.flatnonzero(rigid >= 0)
        if len(stiff):
            blocks.append(self._rigid_columns(stiff, rigid[stiff], held, rigid))
        for index, contact in enumerate(self.plates):
            plate = contact.plate
            assert plate is not None
            moves = np.flatnonzero([part is not None for part in (plate.force_x, plate.force_y, plate.moment)])
            rows = 2 * N + 3 * index + moves
            blocks.append(
                sparse.csr_array((np.ones(len(moves)), (rows, np.arange(len(moves)))), shape=(self.size, len(moves)))
            )
        return sparse.csr_array(sparse.hstack(blocks))

    def _rigid_columns(
        self, nodes: IntArray, part: IntArray, held: Sequence[tuple[IntArray, FloatArray]], rigid: IntArray
    ) -> sparse.csr_array:
        """Motions of rigid parts that supports leave free, as columns."""
        parts = int(part.max()) + 1
        sums = np.stack([np.bincount(part, self.points[nodes, i]) for i in (0, 1)], axis=1)
        centre = sums / np.bincount(part)[:, None]
        arm = self.points[nodes] - centre[part]
        ones = np.ones(len(nodes))
        rows = np.concatenate([2 * nodes, 2 * nodes + 1, 2 * nodes, 2 * nodes + 1])
        columns = np.concatenate([3 * part, 3 * part + 1, 3 * part + 2, 3 * part + 2])
        data = np.concatenate([ones, ones, -arm[:, 1], arm[:, 0]])
        motions = sparse.csr_array((data, (rows, columns)), shape=(self.size, 3 * parts))
        conditions = [np.zeros((0, 3 * parts))]
        for at, direction in held:
            chosen = rigid[at] >= 0
            if chosen.any():
                conditions.append(np.unique((self.rows(at[chosen], direction[chosen]) @ motions).toarray(), axis=0))
        C = np.concatenate(conditions)
        _, values, right = (
            np.linalg.svd(np.linalg.qr(C, mode="r")) if len(C) else (None, np.zeros(0), np.eye(3 * parts))
        )
        rank = int((values > _NULL * values.max(initial=0.0)).sum())
        return sparse.csr_array(motions @ np.where(np.abs(right[rank:].T) > 1e-15, right[rank:].T, 0.0))


class FlowProgram:
    """The program of a problem; stresses over S, lengths over that of the mesh."""

    def __init__(self, problem: ContactProblem, names: Sequence[str], degree: int, scales: Scales) -> None:
        self.problem, self.names, self.scales, self.k = problem, tuple(names), scales, degree
        self.cones = YieldCones.of(problem, degree, above=True)
        self.space = Velocities(problem, self.k + 1, self.cones.strong)

    def solved(self, share: float = 0.0) -> Flow:
        """The flow with the least bound that is found; `SolveError` if the one found breaks its conditions.

        It goes a share of the way towards a flow inside all limits, as far as they leave room.
        """
        works = {name: row @ self.space.basis for name, row in self.powers().items()}
        size = self.space.basis.shape[1]
        live = sum((works[name] for name in works if name in self.names), np.zeros(size))
        dead = sum((works[name] for name in works if name not in self.names), np.zeros(size))
        unit = float(np.abs(live).max(initial=0.0)) or 1.0  # the velocities found have the power of a load of size 1
        program, layout = self._program(np.asarray(live) / unit, np.asarray(dead))
        found = program.solve()
        if isinstance(found, str):
            return Flow(np.inf if found == INFEASIBLE else -np.inf, 0.0)
        x, violation = program.repaired(self._raised(program, found, size), share)
        x = self._raised(program, x, size)
        power = float(live @ x[:size])
        if not violation <= HELD or not power > 0.0:
            raise SolveError(
                f"limit load: the velocities found break their conditions by {violation:.1e}: use another degree, or a "
                "mesh that is less graded"
            )
        x = x / power
        return Flow(float(program.q @ x), violation, self._motion(layout, x), self._shares(x, size))

    def _shares(self, x: FloatArray, n: int) -> FloatArray:
        """Parts of the strain rate that the cones have, see `Flow`."""
        cones, rows = self.cones, len(self.cones.coefficient)
        later, mean = np.flatnonzero(~cones.first), np.flatnonzero(cones.mean != 0.0)
        found = np.zeros((rows, 3))
        found[:, 0] = cones.pressure * x[n : n + rows]
        found[later, 1:] = x[n + rows : n + rows + 2 * len(later)].reshape(-1, 2)
        found[mean, 0] += cones.mean[mean] * x[n + rows + 2 * len(later) :][: len(mean)]
        found *= 2.0 / self._weights[cones.coefficient, None]
        strain = (self._strain @ (self.space.basis @ x[:n])).reshape(-1, 3)
        taken = np.zeros_like(strain[:, :2])
        np.add.at(taken, cones.coefficient[later], found[later, 1:])
        at = cones.coefficient[cones.first]
        found[cones.first, 1:] = np.column_stack([strain[at, 0] - strain[at, 1], strain[at, 2]]) - taken[at]
        return found

    def _program(self, live: FloatArray, dead: FloatArray) -> tuple[ConicProgram, _Layout]:
        """Unknown are q, then s, r and ρ of the cones, then the slips of contacts."""
        strain, cones = self._strain @ self.space.basis, self.cones
        weight = self._weights
        n, rows = strain.shape[1], len(cones.coefficient)
        later = np.flatnonzero(~cones.first)
        mean = np.flatnonzero(cones.mean != 0.0)
        start_r, start_m = n + rows, n + rows + 2 * len(later)
        contacts = self._contact_rows(start_m + len(mean))
        size = contacts.size
        q = np.zeros(size)
        q[:n] = -dead
        q[n : n + rows] = cones.limit / self.scales.stress
        q[start_m + len(mean) :] = contacts.costs
        # strain rows of the coefficients that yield, times their weights: (ε_xx − ε_yy)/2, ε_xy, tr ε/2
        at = cones.yielding
        xx, yy, xy = (sparse.diags_array(weight[at] / 2.0) @ strain[3 * at + i] for i in range(3))
        place = np.searchsorted(at, cones.coefficient)
        deviators = [xx - yy, xy]
        trace = sparse.csr_array(xx + yy)
        shares = sparse.csr_array((cones.pressure, (place, np.arange(rows))), shape=(len(at), rows))
        through = sparse.csr_array((cones.mean[mean], (place[mean], np.arange(len(mean)))), shape=(len(at), len(mean)))
        between = sparse.csr_array((len(at), 2 * len(later)))
        beyond = sparse.csr_array((len(at), size - start_m - len(mean)))
        E = [sparse.hstack([trace, -shares, between, -through, beyond]), _one_row(live, size), contacts.E]
        e = np.concatenate([np.zeros(len(at)), [1.0], np.zeros(contacts.E.shape[0])])
        # cones (s, r) with the first r of a coefficient what the others leave
        place_later, order = place[later], np.arange(len(later))
        found = []
        for has_mean in (False, True):
            chosen = np.flatnonzero((cones.mean != 0.0) == has_mean)
            if not len(chosen):
                continue
            b, first = len(chosen), cones.first[chosen]
            parts = [sparse.csr_array((-np.ones(b), (np.arange(b), n + chosen)), shape=(b, size))]
            for component in (0, 1):
                own = sparse.diags_array(first.astype(float)) @ deviators[component][place[chosen]]
                own = sparse.hstack([own, sparse.csr_array((b, size - n))])
                taken = sparse.csr_array(
                    (np.ones(len(later)), (place_later, start_r + 2 * order + component)), shape=(len(at), size)
                )
                rest = sparse.diags_array(first.astype(float)) @ taken[place[chosen]]
                number = np.searchsorted(later, chosen[~first])
                single = sparse.csr_array(
                    (np.ones(len(number)), (np.flatnonzero(~first), start_r + 2 * number + component)), shape=(b, size)
                )
                parts.append(-(own - rest + single))
            if has_mean:
                number = np.searchsorted(mean, chosen)
                parts.append(-sparse.csr_array((np.ones(b), (np.arange(b), start_m + number)), shape=(b, size)))
            d = len(parts)
            order_rows = np.arange(d * b).reshape(d, b).T.ravel()
            G = sparse.csr_array(sparse.csr_array(sparse.vstack(parts))[order_rows])
            found.append(Cones(G, np.zeros((b, d))))
        limits = np.zeros(contacts.L.shape[0])
        program = ConicProgram(
            q, sparse.csr_array(sparse.vstack(E)), e, contacts.L, limits, tuple(found), dependent=True
        )
        return program, _Layout(n, rows, start_m + len(mean), contacts)

    def _raised(self, program: ConicProgram, x: FloatArray, n: int) -> FloatArray:
        """The same with s of cones that no trace is tied to as large as need be, and no larger."""
        x = program.projected(x)
        cones, start = self.cones, 0
        for has_mean in (False, True):
            chosen = np.flatnonzero((cones.mean != 0.0) == has_mean)
            if len(chosen):
                cone = program.cones[start]
                free = chosen[cones.pressure[chosen] == 0.0]
                x[n + free] -= cone.margins(x)[cones.pressure[chosen] == 0.0]
                start += 1
        return x

    @cached_property
    def _parts(self) -> FloatArray:
        """Dimensionless corners (cells, 3, 3, 2) of the parts of all triangles."""
        mesh = self.space.mesh
        return part_corners((mesh.corners - mesh.origin) / mesh.length)

    @cached_property
    def _slopes(self) -> FloatArray:
        """Gradients (cells, 3, 3, 2) of the barycentric coordinates of the parts."""
        corners = np.concatenate([self._parts, np.ones((*self._parts.shape[:3], 1))], axis=-1)
        return np.asarray(np.swapaxes(np.linalg.inv(corners)[..., :2, :], -1, -2))

    @cached_property
    def _areas(self) -> FloatArray:
        """Areas (cells, 3) of the parts."""
        a, b = (self._parts[..., i, :] - self._parts[..., 0, :] for i in (1, 2))
        return np.asarray(np.abs(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]) / 2.0)

    @cached_property
    def _weights(self) -> FloatArray:
        """∫ B_i of all coefficients of strain."""
        return np.repeat(self._areas.ravel() / self.cones.count, self.cones.count)

    @cached_property
    def _strain(self) -> sparse.csr_array:
        """Coefficients of (ε_xx, ε_yy, 2ε_xy), three numbers each, as rows on coefficients of v and plates."""
        space, nodes = self.space, self.space.nodes
        lowered = gradient(space.degree, np.eye(3))  # ∂/∂λ_a
        slopes = np.einsum("npax,acf->npxcf", self._slopes, lowered)
        cells, _, _, count, width = slopes.shape
        columns = space.global_[:, nodes.of_parts]
        zero = np.zeros_like(slopes[:, :, 0])
        x, y = slopes[:, :, 0], slopes[:, :, 1]
        values = np.stack([np.stack([x, zero, y], axis=3), np.stack([zero, y, x], axis=3)], axis=-1)
        at = np.stack([2 * columns, 2 * columns + 1], axis=-1)
        at = np.broadcast_to(at[:, :, None, None], (cells, 3, count, 3, width, 2))
        rows = cells * 3 * count * 3
        starts = 2 * width * np.arange(rows + 1)
        found = sparse.csr_array((values.ravel(), at.ravel(), starts), shape=(rows, space.size))
        found.eliminate_zeros()
        return found

    def powers(self) -> dict[str, FloatArray]:
        """The power of each load as rows on coefficients of v and plates, dimensionless."""
        found: dict[str, FloatArray] = {}

        def add(name: str, row: FloatArray) -> None:
            found[name] = found[name] + row if name in found else row

        space, mesh, S = self.space, self.space.mesh, self.scales.stress
        for condition in self.problem.conditions:
            if isinstance(condition, Traction):
                edges = mesh.edges(condition.edges)
                for name, value in components(condition).items():
                    weights = self._edge_weights(edges, f"Traction.{name}", value)
                    direction = np.repeat(direction_of(name, edges), space.degree + 1, axis=0)
                    add(condition.name, weights.ravel() @ space.rows(space.along(edges).ravel(), direction))
            elif isinstance(condition, Contact) and condition in space.plates:
                plate, row = condition.plate, np.zeros(space.size)
                assert plate is not None
                start = 2 * space.count + 3 * space.plates.index(condition)
                row[start : start + 2] = [part or 0.0 for part in (plate.force_x, plate.force_y)]
                row[start + 2] = (plate.moment or 0.0) / mesh.length
                add(condition.name, row / (S * mesh.length))
        for contact in self.problem.contacts:
            if contact.has_fluid:
                edges = mesh.edges(contact.edges)
                weights = self._edge_weights(edges, "Contact.pore_pressure", contact.pore_pressure)
                add(FLUID, weights.ravel() @ self._jumps(contact)[0])
        for name, potential in self.problem.body_forces.items():
            if callable(potential):
                add(name, self._body(potential))
        return found

    def _edge_weights(self, edges: Edges, name: str, field: Field) -> FloatArray:
        """∫ f B_i ds (e, p), dimensionless, from the first end of each edge on."""
        mesh, degree = self.space.mesh, self.space.degree
        found = along_edges(mesh, edges, name, field)
        values = bernstein.basis(degree, found.t.ravel()).reshape(*found.t.shape, degree + 1)
        return found.integrals(values) * edges.length[:, None] / (self.scales.stress * mesh.length)

    def _body(self, field: Field) -> FloatArray:
        """−∫ ∇φ·v dx, with the polynomial that stresses take for φ."""
        space, k = self.space, self.k
        cells = np.arange(space.mesh.cell_count)
        potential = coefficients_of(self.problem, cells, k, "ContactProblem.body_potential", field)[0]
        slopes = np.einsum("npax,acf,npf->npcx", self._slopes, gradient(k, np.eye(3)), potential)
        points, weights = quadrature(2 * k)
        products = (bernstein_values(k - 1, points) * weights[:, None]).T @ bernstein_values(space.degree, points)
        force = -np.einsum("npcx,cf,np->npfx", slopes, products, self._areas) / self.scales.stress
        row = np.zeros(space.size)
        columns = space.global_[:, space.nodes.of_parts]
        for axis in (0, 1):
            np.add.at(row, 2 * columns + axis, force[..., axis])
        return row

    def _jumps(self, contact: Contact) -> tuple[sparse.csr_array, sparse.csr_array]:
        """W = −[v]_N and [v]_T at the coefficients of all edges of a contact as rows on coefficients and plates."""
        space, edges = self.space, self.space.mesh.edges(contact.edges)
        first = space.along(edges).ravel()
        found = []
        for vector in (-edges.normal, edges.tangent):
            along = np.repeat(vector, space.degree + 1, axis=0)
            rows = space.rows(first, along)
            if contact in self.problem.joints:
                rows = rows - space.rows(space.along(edges, 1).ravel(), along)
            else:
                rows = rows - space.plate_rows(contact, space.points[first], along)
            found.append(rows)
        return found[0], found[1]

    def _contact_rows(self, start: int) -> _ContactRows:
        """Rows, equations and costs of all contacts, with slips t and dilatant slips a from column `start` on."""
        n, costs = self.space.basis.shape[1], list[FloatArray]()
        less: list[tuple[sparse.csr_array, list[tuple[IntArray, FloatArray]]]] = []
        equal: list[sparse.csr_array] = []
        parts: dict[str, _Columns] = {}
        column = start
        for contact in self.problem.contacts:
            if contact.law == "tied" and (contact in self.problem.joints or contact not in self.space.plates):
                continue
            opening, slip = (sparse.csr_array(rows @ self.space.basis) for rows in self._jumps(contact))
            if contact.law == "tied":
                equal += [opening, slip]
                continue
            edges = self.space.mesh.edges(contact.edges)
            p = self.space.degree + 1
            mu, c, cap = (np.repeat(part, p) for part in self._largest(contact, edges))
            weight = np.repeat(edges.length / self.space.mesh.length / p, p)
            count = len(weight)
            unilateral = contact.law == "unilateral"
            rough = mu > 0.0
            if not unilateral:
                equal.append(opening)
                stuck = rough & ~np.isfinite(cap)
                if stuck.any():
                    equal.append(sparse.csr_array(slip[stuck]))
            t = column + np.arange(count)
            price = np.where(rough & np.isfinite(cap), cap, np.minimum(c, cap))
            costs.append(weight * price / self.scales.stress)
            column += count
            less += [(sparse.csr_array(sign * slip), [(t, -np.ones(count))]) for sign in (1.0, -1.0)]
            spent = t
            capped = unilateral and bool((rough & np.isfinite(cap)).any())
            if capped:  # edges without friction or without a cap have all of their slip dilatant, or none of it
                spent = column + np.arange(count)
                saved = np.where(rough & np.isfinite(cap), np.maximum(cap - c, 0.0), 0.0)
                costs.append(-weight * saved / self.scales.stress)
                column += count
                none = sparse.csr_array((count, n))
                less += [(none, [(spent, np.ones(count)), (t, -np.ones(count))]), (none, [(spent, -np.ones(count))])]
            if unilateral:
                less.append((sparse.csr_array(-opening), [(spent, mu)]))
            parts[contact.name] = _Columns(opening, slip, t, spent if capped else None, len(edges))
        size = column
        L = [_extended(rows, more, size) for rows, more in less]
        E = [_extended(rows, [], size) for rows in equal]
        none = sparse.csr_array((0, size))
        joined = np.concatenate([np.zeros(0), *costs])
        return _ContactRows(
            sparse.csr_array(sparse.vstack([none, *L])),
            sparse.csr_array(sparse.vstack([none, *E])),
            joined,
            size,
            parts,
        )

    def _largest(self, contact: Contact, edges: Edges) -> tuple[FloatArray, FloatArray, FloatArray]:
        """μ, c and t_max (e,), the largest value along each edge."""
        x, y = self.space.mesh.points_along(edges, _ALONG)
        found = [
            evaluate(f"Contact.{name}", getattr(contact, name), x, y, minimum=0.0).max(axis=1)
            for name in ("friction", "cohesion")
        ]
        cap = np.full(len(edges), np.inf)
        if contact.shear_limit is not None:
            cap = evaluate("Contact.shear_limit", contact.shear_limit, x, y, minimum=0.0).max(axis=1)
        return found[0], found[1], cap

    def _motion(self, layout: _Layout, x: FloatArray) -> BodyMotion:
        """In the form of a result."""
        n, rows, start, contacts = layout
        space, cones = self.space, self.cones
        v = space.basis @ x[:n]
        velocities = np.stack([v[2 * space.global_], v[2 * space.global_ + 1]], axis=-1)
        strain = (self._strain @ v).reshape(-1, 3, cones.count, 3)
        spent = x[n : n + rows] * cones.limit / self.scales.stress
        cell = cones.coefficient // (3 * cones.count)
        dissipation = np.asarray(np.bincount(cell, spent, space.mesh.cell_count), dtype=np.float64)
        found = {}
        for name, columns in contacts.parts.items():
            p = space.degree + 1
            cost = contacts.costs[columns.slip_columns - start] * x[columns.slip_columns]
            if columns.dilatant is not None:
                cost = cost + contacts.costs[columns.dilatant - start] * x[columns.dilatant]
            shape = (columns.edges, p)
            found[name] = ContactFlow(
                (columns.opening @ x[:n]).reshape(shape),
                (columns.slip @ x[:n]).reshape(shape),
                cost.reshape(shape).sum(axis=1),
            )
        return BodyMotion(velocities, space.nodes.places, strain, dissipation, found)


class _Layout(NamedTuple):
    """The unknowns of the program: n of q, one for each cone row, from `start` on those of contacts."""

    n: int
    rows: int
    start: int
    contacts: _ContactRows


@dataclass(frozen=True, eq=False)
class _Columns:
    """The columns of one contact."""

    opening: sparse.csr_array
    slip: sparse.csr_array
    slip_columns: IntArray
    dilatant: IntArray | None
    edges: int


@dataclass(frozen=True, eq=False)
class _ContactRows:
    """L x ≤ 0 and E x = 0 of all contacts, the costs of their columns, and how many columns there are in all."""

    L: sparse.csr_array
    E: sparse.csr_array
    costs: FloatArray
    size: int
    parts: Mapping[str, _Columns]


def _extended(rows: sparse.csr_array, more: Sequence[tuple[IntArray, FloatArray]], size: int) -> sparse.csr_array:
    """Rows on the first unknowns as rows on all, with values (r,) in further columns (r,)."""
    r = rows.shape[0]
    found = sparse.csr_array(sparse.hstack([rows, sparse.csr_array((r, size - rows.shape[1]))]))
    for columns, values in more:
        found = found + sparse.csr_array((values, (np.arange(r), columns)), shape=(r, size))
    return sparse.csr_array(found)


def _one_row(row: FloatArray, size: int) -> sparse.csr_array:
    """A row on the first unknowns."""
    columns = np.flatnonzero(row)
    return sparse.csr_array((row[columns], (np.zeros(len(columns), dtype=np.int64), columns)), shape=(1, size))


def gap_in_cells(discretization: Discretization, carried: CarriedStress, motion: BodyMotion, degree: int) -> FloatArray:
    """Parts of the triangles (cells,), with those of contact edges in equal shares for the triangles beside them."""
    assert carried.stress is not None
    assert carried.tractions is not None
    problem, mesh = discretization.problem, discretization.problem.mesh
    corners = part_corners(mesh.vertices[mesh.cells] / mesh.length)
    a, b = (corners[..., i, :] - corners[..., 0, :] for i in (1, 2))
    areas = np.abs(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]) / 2.0
    work = np.einsum("npic,ij,npjc,np->n", carried.stress, _products(degree), motion.strain, areas)
    found: FloatArray = motion.dissipation - np.where(motion.dissipation > 0.0, work, 0.0)
    m = discretization.qvi.m
    for rows, contact in zip(discretization.contacts, problem.contacts, strict=True):
        if rows.law == "tied" or contact.name not in motion.contacts:
            continue
        moved, edges, q = motion.contacts[contact.name], rows.points.edges, rows.rule.count
        table = bernstein.product_integrals(degree, degree + 1)
        normal, shear = (
            carried.tractions[start : start + m][rows.rows].reshape(-1, q) @ edge_coefficients(rows).T
            for start in (0, m)
        )
        worked = np.einsum("ei,ij,ej->e", normal, table, moved.opening)
        worked -= np.einsum("ei,ij,ej->e", shear, table, moved.slip)
        part = moved.dissipation - worked * edges.length / mesh.length
        inside = edges.cells >= 0
        for side in (0, 1):
            chosen = inside[:, side]
            np.add.at(found, edges.cells[chosen, side], part[chosen] / inside.sum(axis=1)[chosen])
    return np.maximum(found, 0.0)


@cache
def _products(degree: int) -> FloatArray:
    """∫ B_i B_j over a triangle of area 1."""
    points, weights = quadrature(2 * degree)
    values = bernstein_values(degree, points)
    return np.asarray((values * weights[:, None]).T @ values)
