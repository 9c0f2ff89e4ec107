"""Limit loads from above: velocities of the body, continuous on the split triangles, with jumps on its contacts.

The program is (D37), and the difference of both sides (D38). With Bernstein coefficients ε_i of the strain rate, of
degree k = p − 2 for velocities of degree p − 1, what a body of cones |(γ_j S, σ_xx − σ_yy, 2σ_xy)| ≤ a_j − β_j S
dissipates is bounded by

    ∫ π(ε) dx  ≤  Σ |part| mean_i π(ε_i),     π(ε) = min Σ_j a_j s_j   s.t.   |(ρ_j, r_j)| ≤ s_j,
                                              Σ_j r_j = ((ε_xx − ε_yy)/2, ε_xy),   Σ_j (β_j s_j + γ_j ρ_j) = tr ε/2

Jumps on contacts dissipate by the associated law (D23), coefficient by coefficient. A part of the body without strength
moves as a rigid body.

In `docs/theory.md`: (D37), (D38).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, Field, FloatArray, IntArray, evaluate
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.scaling import Scales
from qvi_contact.element.edge import product_integrals
from qvi_contact.element.triangle import bernstein as bernstein_values
from qvi_contact.element.triangle import gradient, quadrature
from qvi_contact.errors import SolveError
from qvi_contact.limit.conic import APART, FACES, HELD, INFEASIBLE, ROUNDING, UNBOUNDED, ConicProgram, beside
from qvi_contact.limit.split import coefficients_of, lattice, nodes_along, numbered, part_corners
from qvi_contact.limit.stresses import ALONG, PASSES, Carried, YieldCones, limited
from qvi_contact.mechanism import RigidMotion
from qvi_contact.mechanism.bodies import FLUID, whole_edges
from qvi_contact.mesh.edges import Edges, cross
from qvi_contact.problem.conditions import DRIVES, SHEAR_LAW, Contact, Displacement, Traction
from qvi_contact.problem.fields import along_edges
from qvi_contact.problem.problem import ContactProblem, by_cell
from solvers.basics.linked import linked
from solvers.basics.progress import deadline

_MUCH: Final = 1e-4  # dissipation, relative, that a flow which holds costs more than the one found


@dataclass(frozen=True, eq=False)
class Flow:
    """The upper bound of the load factor that a velocity field proves."""

    bound: float  # the bound; infinity if no velocity has power, minus infinity if the other loads alone are too much
    violation: float = 0.0  # what the conditions on the velocities are missed by, relative: rounding
    motion: BodyMotion | None = None  # the velocities; None if the bound is not finite
    # (r, 3) what each row of the cones has of (tr ε, ε_xx − ε_yy, 2ε_xy) at its coefficient; lengths over that
    # of the mesh
    shares: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class BodyMotion:
    """A velocity field with which the body gives way, of power 1 of the loads that are multiplied."""

    velocities: FloatArray
    """(cells, 3, ·, 2): Bernstein coefficients of v on the three parts of each triangle, of one degree more than those
    of strain."""
    strain: FloatArray
    """(cells, 3, count, 3): coefficients of (ε_xx, ε_yy, 2ε_xy) on the parts of each triangle, lengths over that of the
    mesh."""
    dissipation: FloatArray
    """(cells,): ∫ π(ε) dx, or the bound of it, in units of the load factor."""
    contacts: Mapping[str, ContactFlow]
    """What happens on each contact."""
    plates: Mapping[str, RigidMotion]
    """Motions of plates driven by force about their pivots, by the names of their contacts."""


@dataclass(frozen=True, eq=False)
class ContactFlow:
    """Jumps of v along a contact."""

    opening: FloatArray
    """(edges, p): coefficients of w = −[v]_N from the first end of each edge to its second."""
    slip: FloatArray
    """(edges, p): those of [v]_T."""
    dissipation: FloatArray
    """(edges,): ∫ π([v]) ds, or the bound of it, in units of the load factor."""


class Velocities:
    """The velocities that rigid parts leave free, v = P q; lengths over that of the mesh.

    Attributes
    ----------
    table : (cells, 3, count) int array
        Numbers of the coefficients of each part; triangles share those on edges that are no open joint.
    plates : list
        Contacts with plates driven by force. They are the first bodies, rigid parts the others.
    rigid : (N,) int array
        The body that each coefficient moves with, −1 for none.
    hinges : (2, h) int array
        Coefficients at vertices in which rigid parts meet without a common edge, and the bodies they belong to as well.
    basis : (2 N + 3 bodies, n) sparse array
        P: first x and y of all coefficients, then the motions (a, b, θ) of plates about their pivots, of rigid parts
        about their middles.

    """

    def __init__(self, problem: ContactProblem, degree: int, strong: BoolArray) -> None:
        self.problem, self.mesh, self.degree = problem, problem.mesh, degree
        mesh, edges, self.table = self.mesh, whole_edges(problem), numbered(problem, degree)
        self.count = int(self.table.max()) + 1
        self.points = np.empty((self.count, 2))
        self.points[self.table] = lattice(degree) @ part_corners((mesh.corners - mesh.origin) / mesh.length)
        self.plates = [contact for contact in problem.contacts if contact.plate is not None and contact.plate.driven]
        first, second = edges.cells[strong[edges.cells].all(axis=1)].T
        part = np.unique(linked(first, second, mesh.cell_count)[strong], return_inverse=True)[1]
        pairs = np.broadcast_arrays(self.table[strong], part[:, None, None])
        node, body = np.unique([each.ravel() for each in pairs], axis=1)
        body, again = body + len(self.plates), np.diff(node, prepend=-1) == 0
        self.rigid = np.full(self.count, -1)
        self.rigid[node[~again]] = body[~again]
        self.hinges = np.stack([node, body])[:, again]
        sums = np.stack([np.bincount(body, along) for along in self.points[node].T], axis=1)
        middles = (sums / np.maximum(np.bincount(body), 1)[:, None])[len(self.plates) :]
        pivots = [(np.array(each.plate.pivot) - mesh.origin) / mesh.length for each in self.plates if each.plate]
        self.centres = np.array([*pivots, *middles]).reshape(-1, 2)
        self.size = 2 * self.count + 3 * len(self.centres)
        self.basis = self._basis()

    def along(self, edges: Edges, side: int = 0) -> IntArray:
        """The coefficients (e, p) along edges from their first end to the second, among all."""
        return np.asarray(self.table.ravel()[nodes_along(self.problem, self.degree, edges, side)])

    def rows(self, nodes: IntArray, direction: FloatArray, body: IntArray | None = None) -> sparse.csr_array:
        """d·v at coefficients (r,) along d (r, 2), or of bodies (r,) there, as rows on coefficients and bodies."""
        columns, values = np.column_stack([2 * nodes, 2 * nodes + 1]), direction
        if body is not None:
            arm = self.points[nodes] - self.centres[body]
            columns = 2 * self.count + 3 * body[:, None] + np.arange(3)
            values = np.column_stack([direction, cross(arm, direction)])
        at = np.repeat(np.arange(len(nodes)), columns.shape[1])
        return sparse.csr_array((values.ravel(), (at, columns.ravel())), shape=(len(nodes), self.size))

    def jumps(self, contact: Contact) -> tuple[sparse.csr_array, sparse.csr_array]:
        """W = −[v]_N and [v]_T at the coefficients of all edges of a contact as rows on coefficients and bodies."""
        edges, found = self.mesh.edges(contact.edges), []
        first = self.along(edges).ravel()
        for vector in (-edges.normal, edges.tangent):
            along = np.repeat(vector, self.degree + 1, axis=0)
            rows = self.rows(first, along)
            if contact in self.problem.joints:
                rows = rows - self.rows(self.along(edges, 1).ravel(), along)
            elif contact in self.plates:
                rows = rows - self.rows(first, along, np.full(len(first), self.plates.index(contact)))
            found.append(rows)
        return found[0], found[1]

    def held(self) -> sparse.csr_array:
        """Velocities that supports, hinges and what is tied rule out, as such rows."""
        found = [self.rows(self.hinges[0], axes) - self.rows(self.hinges[0], axes, self.hinges[1])
                 for axes in np.repeat(np.eye(2)[:, None], self.hinges.shape[1], axis=1)]  # fmt: skip
        for given in self.problem.prescribed(Displacement):
            nodes = self.along(given.edges)
            found.append(self.rows(nodes.ravel(), np.repeat(given.direction, nodes.shape[1], axis=0)))
        for contact in self.problem.contacts:
            if contact.law == "tied" and contact not in self.problem.joints:
                found += self.jumps(contact)
        return sparse.csr_array(sparse.vstack(found))

    def _basis(self) -> sparse.csr_array:
        """P: the coefficients of no rigid part, motions of plates by forces, and of rigid parts."""
        loose, stiff = np.flatnonzero(self.rigid < 0), np.flatnonzero(self.rigid >= 0)
        forces = [getattr(contact.plate, name) for contact in self.plates for name in DRIVES]
        free = [force is not None for force in forces] + [True] * (3 * len(self.centres) - len(forces))
        chosen = np.concatenate([2 * loose, 2 * loose + 1, 2 * self.count + np.flatnonzero(free)])
        found = sparse.eye_array(self.size, format="csc")
        for axes in np.repeat(np.eye(2)[:, None], len(stiff), axis=1):
            found = found + self.rows(stiff, axes).T @ self.rows(stiff, axes, self.rigid[stiff])
        return sparse.csr_array(sparse.csc_array(found)[:, chosen])


class FlowProgram:
    """The program of a problem; stresses over S, lengths over that of the mesh."""

    def __init__(self, problem: ContactProblem, names: Sequence[str], cones: YieldCones, scales: Scales) -> None:
        self.problem, self.names, self.scales, self.k, self.cones = problem, tuple(names), scales, cones.degree, cones
        self.space = Velocities(problem, self.k + 1, self.cones.strong)
        mesh = problem.mesh
        parts = part_corners((mesh.corners - mesh.origin) / mesh.length)
        a, b = (parts[..., i, :] - parts[..., 0, :] for i in (1, 2))
        self._areas = np.abs(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]) / 2.0  # (cells, 3) of the parts
        # gradients (cells, 3, 3, 2) of their barycentric coordinates, and ∫ B_i of all coefficients of strain
        corners = np.concatenate([parts, np.ones((*parts.shape[:3], 1))], axis=-1)
        self._slopes = np.swapaxes(np.linalg.inv(corners)[..., :2, :], -1, -2)
        self._weights = np.repeat(self._areas.ravel() / self.cones.count, self.cones.count)

    def solved(self, share: float = 0.0, *, known: bool = False, doubted: bool = False) -> Flow:
        """The flow with the least bound that is found; `SolveError` if the one found breaks its conditions.

        Infinity instead if a bound is `known`, of rigid blocks, or that there is none, since any multiple is carried.
        A bound that is `doubted` is kept only if no flow without power of these loads is found that falls for ever.

        It goes a share of the way towards a flow inside all limits, as far as they leave room. Without such a share,
        strain of what has no tension that nothing can open otherwise is across an edge, by equations.
        """
        n, cones = self.space.basis.shape[1], self.cones
        (live, dead), of_cones = np.zeros((2, n)), beside(cones.limit, cones.least, 1.0 / APART)
        for name, row in self._powers():
            (live if name in self.names else dead)[:] += row @ self.space.basis
        # velocities of size 1 have a power of the size 1
        program = every = self._program(live / (float(np.abs(live).sum()) or 1.0), dead)
        solve = cache(ConicProgram.solve)  # programs on faces may be equal
        found = solve(program)
        if isinstance(found, str):
            return Flow(-np.inf if found == UNBOUNDED or every.falls else np.inf)

        def raised(x: FloatArray) -> FloatArray:
            """The same with s of cones that no trace is tied to as large as need be, and no larger."""
            x, free = program.projected(x), np.flatnonzero(cones.pressure == 0.0)
            blocks = every.blocks(x)[free]
            x[n + free] -= (blocks[:, 0] - np.linalg.norm(blocks[:, 1:], axis=1)) / of_cones[free]
            return x

        start = raised(found.x)
        x, violation = program.repaired(start, share)
        x = raised(x)
        first = found
        lost = float(every.q @ (x - start)) / (float(np.abs(every.q) @ np.abs(start)) or 1.0)
        several = FACES if not cones.limit.all() else FACES[: int(lost > _MUCH)]
        for faces in () if share else several:
            program, found = every, first
            for _ in range(PASSES):
                missed = -float(program.margins(raised(found.x)).min(initial=0.0))
                narrower = program.on_faces(cones.rays, *faces) if missed > ROUNDING and not deadline.over else None
                found = solve(narrower) if narrower else INFEASIBLE
                if found == UNBOUNDED:  # what flows on faces keeps the cones
                    return Flow(-np.inf)
                if narrower is None or isinstance(found, str):
                    break
                program = narrower
                other, off = program.repaired(raised(found.x))
                other = raised(other)
                off = max(off, -float(every.margins(other).min(initial=0.0)))
                gained = float(every.q @ (x - other)) / (float(np.abs(every.q) @ np.abs(start)) or 1.0)
                # all have one power
                x, violation = (other, off) if off < violation + HELD * gained else (x, violation)
        power = float(live @ x[:n])
        held = violation <= HELD and power > 0.0
        beyond = not (held and every.q @ x >= 0.0 and not doubted) and any(each.falls for each in (every, program))
        if beyond or (known and not held):  # the others do too much work where these loads do none
            return Flow(-np.inf if beyond else np.inf)
        if not held:
            raise SolveError(
                f"limit load: the velocities found break their conditions by {violation:.1e}: use another degree, or a "
                "mesh that is less graded"
            )
        x = x / power
        s, r, *rho = np.split(every.blocks(x) / of_cones[:, None], [1, 3], axis=1)
        trace = cones.pressure * s[:, 0] + sum(cones.mean * part[:, 0] for part in rho if part.size)
        shares = np.column_stack([trace, r]) * (2.0 / self._weights[cones.coefficient, None])
        bound = max(float(every.q @ x), -float(dead @ x[:n]))  # dissipation is not negative but by rounding
        return Flow(bound, violation, self._motion(x), shares)

    def _program(self, live: FloatArray, dead: FloatArray) -> ConicProgram:
        """Unknown are q, then s of the cones, both components of r of later ones, ρ, then the slips of contacts.

        The first cone of a coefficient has the r that the later ones leave.
        """
        cones, slips, n, rows = self.cones, self._slips, len(live), len(self.cones.coefficient)
        later, mean = np.flatnonzero(~cones.first), np.flatnonzero(cones.mean)
        ends = np.cumsum([0, n, rows, len(later), len(later), len(mean), len(slips.costs)])
        unknowns = sparse.eye_array(ends[-1], format="csr")
        Q, S, R1, R2, RHO, Y = (unknowns[a:b] for a, b in pairwise(ends))
        at, number = np.unique(cones.coefficient, return_inverse=True)  # coefficients that yield
        of_rows = sparse.eye_array(len(at), format="csr")[number]
        sums, first = of_rows.T, sparse.diags_array(cones.first.astype(float)) @ of_rows
        each = sparse.eye_array(rows, format="csc")
        later_ones, mean_ones = each[:, later], each[:, mean]
        own = later_ones - first @ (sums @ later_ones)
        # strain times weights: (ε_xx − ε_yy)/2, ε_xy, tr ε/2
        strain, half = self._strain @ self.space.basis, sparse.diags_array(self._weights[at] / 2.0)
        xx, yy, xy = (half @ strain[3 * at + i] @ Q for i in range(3))
        traces = sums @ (
            sparse.diags_array(cones.pressure) @ S + mean_ones @ sparse.diags_array(cones.mean[mean]) @ RHO
        )
        parts = [-S, -(first @ (xx - yy) + own @ R1), -(first @ xy + own @ R2)]
        parts += [-(mean_ones @ RHO)] if len(mean) else []
        held = self.space.held() @ self.space.basis
        E = sparse.vstack([xx + yy - traces, sparse.csr_array(live[None]) @ Q, held @ Q, slips.E @ Q])
        e = np.zeros(E.shape[0])
        e[len(at)] = 1.0
        strengths = (beside(each, cones.least, 1.0 / APART) for each in (slips.strengths, cones.limit))
        of_slips, of_cones = map(sparse.diags_array, strengths)  # in whole ones solvers lose digits
        L = of_slips @ (slips.L @ Q + slips.own @ Y)
        q = np.concatenate([-dead, cones.limit / self.scales.stress, np.zeros(ends[-2] - ends[2]), slips.costs])
        zeros = [(of_cones @ part, np.zeros(rows)) for part in parts]
        return ConicProgram.of(q, (E, e), (L, np.zeros(L.shape[0])), zeros, dependent=True)

    @cached_property
    def _strain(self) -> sparse.csr_array:
        """Coefficients of (ε_xx, ε_yy, 2ε_xy), three numbers each, as rows on coefficients of v and bodies."""
        space = self.space
        slopes = np.einsum("npax,acf->xnpcf", self._slopes, gradient(space.degree, np.eye(3)))
        _, cells, _, count, width = slopes.shape
        columns = np.repeat(space.table, count, axis=1)
        starts, shape = width * np.arange(3 * cells * count + 1), (3 * cells * count, space.count)
        along_x, along_y = (sparse.csr_array((part.ravel(), columns.ravel(), starts), shape=shape) for part in slopes)
        found = sparse.kron(along_x, [[1, 0], [0, 0], [0, 1]]) + sparse.kron(along_y, [[0, 0], [0, 1], [1, 0]])
        return sparse.csr_array(sparse.hstack([found, sparse.csr_array((found.shape[0], 3 * len(space.centres)))]))

    def _powers(self) -> Iterator[tuple[str, FloatArray]]:
        """The power of the loads, by their names, as rows on coefficients of v and bodies, dimensionless."""
        space, mesh, S = self.space, self.space.mesh, self.scales.stress
        for given in self.problem.prescribed(Traction):
            if isinstance(given.condition, Traction):
                weights = self._edge_weights(given.edges, given.name, given.value)
                direction = np.repeat(given.direction, space.degree + 1, axis=0)
                yield given.condition.name, weights @ space.rows(space.along(given.edges).ravel(), direction)
        for contact in self.problem.contacts:
            if contact.plate is not None and contact in space.plates:
                plate, row = contact.plate, np.zeros(space.size)
                start = 2 * space.count + 3 * space.plates.index(contact)
                forces = [plate.force_x or 0.0, plate.force_y or 0.0, (plate.moment or 0.0) / mesh.length]
                row[start : start + 3] = np.array(forces) / (S * mesh.length)
                yield contact.name, row
            if contact.has_fluid:
                edges = mesh.edges(contact.edges)
                weights = self._edge_weights(edges, "Contact.pore_pressure", contact.pore_pressure)
                yield FLUID, weights @ space.jumps(contact)[0]
        for name, potential in self.problem.body_forces.items():
            if callable(potential):
                yield name, self._body(potential)

    def _edge_weights(self, edges: Edges, name: str, field: Field) -> FloatArray:
        """∫ f B_i ds (e · p,), dimensionless, from the first end of each edge on."""
        mesh, degree = self.space.mesh, self.space.degree
        found = along_edges(mesh, edges, name, field)
        return (found.moments(degree) * edges.length[:, None] / (self.scales.stress * mesh.length)).ravel()

    def _body(self, field: Field) -> FloatArray:
        """−∫ ∇φ·v dx, with the polynomial that stresses take for φ."""
        space, k = self.space, self.k
        potential = coefficients_of(self.problem, k, field)[0]
        slopes = np.einsum("npax,acf,npf->npcx", self._slopes, gradient(k, np.eye(3)), potential)
        force = -np.einsum("npcx,cf,np->npfx", slopes, _products(k - 1, space.degree), self._areas)
        row = np.zeros(space.size)
        for axis in (0, 1):
            np.add.at(row, 2 * space.table + axis, force[..., axis] / self.scales.stress)
        return row

    @cached_property
    def _slips(self) -> _Slips:
        """Jumps, rows and costs of the contacts that limit tractions.

        |[v]_T| ≤ d + u with the slip d that dilates, w ≥ μ d, at the price of c, and u that does not, at that of t_max.
        """
        mesh, space, p = self.space.mesh, self.space, self.space.degree + 1
        contacts = [contact for contact in self.problem.contacts if contact.law != "tied"]
        jumps, numbers = [[sparse.csr_array((0, space.size))] * 2], [np.zeros((5, 0))]
        for contact in contacts:
            edges, places = mesh.edges(contact.edges), mesh.points_along(mesh.edges(contact.edges), ALONG)
            laws = [
                edges.length / (mesh.length * p * self.scales.stress),
                np.full(len(edges), contact.law == "unilateral"),
            ]
            for name in SHEAR_LAW:  # the largest value along each edge
                field = getattr(contact, name)
                values = np.inf if field is None else evaluate(f"Contact.{name}", field, *places, minimum=0.0)
                laws.append(np.broadcast_to(values, places[0].shape).max(axis=1))
            numbers.append(np.repeat(laws, p, axis=1))
            jumps.append(list(space.jumps(contact)))
        weight, one_sided, mu, c, cap = np.concatenate(numbers, axis=1)
        opening, slip = (sparse.csr_array(sparse.vstack(rows) @ space.basis) for rows in zip(*jumps, strict=True))
        unilateral, rough, capped, count = one_sided > 0.0, mu > 0.0, np.isfinite(cap), len(mu)
        more = np.flatnonzero(unilateral & rough & capped)
        price = np.where(~unilateral & rough & capped, cap, np.minimum(c, cap))  # these carry any shear up to the cap
        prices, at = np.append(price, cap[more]), np.append(np.arange(count), more)
        paid = np.flatnonzero(prices <= self.cones.most)
        prices, at = prices[paid], at[paid]
        both, slides = sparse.eye_array(count, format="csr")[at].T.tocsr(), np.isin(np.arange(count), at)
        size, sticks = len(at), ~slides | (~unilateral & rough & ~capped)
        L = sparse.vstack([slip[slides], -slip[slides], sparse.csr_array((size, slip.shape[1])), -opening[unilateral]])
        dilates = (both @ sparse.diags_array(np.where(paid < count, mu[at], 0.0))).tocsr()[unilateral]
        own = sparse.vstack([-both[slides], -both[slides], -sparse.eye_array(size), dilates])
        equal = sparse.vstack([opening[~unilateral], slip[sticks]])
        most = np.zeros(count)
        np.maximum.at(most, at, prices)
        strengths = np.concatenate([most[slides], most[slides], prices, np.zeros(unilateral.sum())])
        lengths = {contact.name: len(mesh.edges(contact.edges)) for contact in contacts}
        return _Slips(lengths, opening, slip, L, own, equal, strengths, weight[at] * prices, at)

    def _motion(self, x: FloatArray) -> BodyMotion:
        """In the form of a result."""
        space, cones, slips, p = self.space, self.cones, self._slips, self.space.degree + 1
        n, rows = space.basis.shape[1], len(cones.coefficient)
        v = space.basis @ x[:n]
        velocities = np.stack([v[2 * space.table], v[2 * space.table + 1]], axis=-1)
        strain = (self._strain @ v).reshape(-1, 3, cones.count, 3)
        spent = x[n : n + rows] * cones.limit / self.scales.stress
        dissipation = np.asarray(np.bincount(cones.cell, spent, space.mesh.cell_count), dtype=np.float64)
        opening, slip = slips.opening @ x[:n], slips.slip @ x[:n]
        paid = slips.costs * x[len(x) - len(slips.at) :]
        cost = np.asarray(np.bincount(slips.at, paid, len(opening)), dtype=np.float64)
        ends = np.cumsum([0, *slips.lengths.values()])[1:]
        parts = (np.split(part.reshape(-1, p), ends) for part in (opening, slip, cost))  # the last of each is empty
        found = {name: ContactFlow(w, t, spent.sum(axis=1))
                 for name, w, t, spent in zip(slips.lengths, *parts, strict=False)}  # fmt: skip
        plates = {
            contact.name: RigidMotion(a, b, turn / space.mesh.length, contact.plate.pivot)
            for contact, (a, b, turn) in zip(space.plates, v[2 * space.count :].reshape(-1, 3).tolist(), strict=False)
            if contact.plate is not None
        }
        return BodyMotion(velocities, strain, dissipation, found, plates)

    def gap_in_cells(self, discretization: Discretization, carried: Carried, motion: BodyMotion) -> FloatArray:
        """Parts of the triangles (cells,), with those of contact edges in equal shares for triangles beside them."""
        assert carried.stress is not None
        assert carried.tractions is not None
        degree = self.k
        work = np.einsum("npic,ij,npjc,np->n", carried.stress, _products(degree, degree), motion.strain, self._areas)
        found: FloatArray = motion.dissipation - np.where(self.cones.strong, 0.0, work)
        table, on_edges = product_integrals(degree, degree + 1), dict[str, FloatArray]()
        for rows, contact in limited(discretization):
            moved, edges, q = motion.contacts[contact.name], rows.points.edges, rows.rule.count
            normal, shear = (half[rows.rows].reshape(-1, q) for half in np.split(carried.tractions, 2))
            worked = np.einsum("ei,ij,ej->e", normal, table, moved.opening)
            worked -= np.einsum("ei,ij,ej->e", shear, table, moved.slip)
            on_edges[contact.name] = moved.dissipation - worked * edges.length / self.space.mesh.length
        return np.maximum(found + by_cell(self.problem, on_edges), 0.0)


class _Slips(NamedTuple):
    """Contacts: jumps as rows on q, L q + own y ≤ 0 and E q = 0 with slips y, and their costs, at which jumps."""

    lengths: dict[str, int]  # how many edges each has
    opening: sparse.csr_array
    slip: sparse.csr_array
    L: Any
    own: Any
    E: Any
    strengths: FloatArray  # of the rows of L, which these slips cost [stress]
    costs: FloatArray
    at: IntArray


def _products(first: int, second: int) -> FloatArray:
    """∫ B_i B_j over a triangle of area 1, of two degrees."""
    points, weights = quadrature(first + second)
    return np.asarray((bernstein_values(first, points) * weights[:, None]).T @ bernstein_values(second, points))
