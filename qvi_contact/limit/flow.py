"""Limit loads from above: velocities of the body, continuous on the split triangles, with jumps on its contacts.

The program is (D37), and the difference of both sides (D38). Velocities have the degree p − 1, and the strain rate has
Bernstein coefficients ε_i of the degree k = p − 2. A body with cones |(γ_j S, σ_xx − σ_yy, 2σ_xy)| ≤ a_j − β_j S
dissipates

    ∫ π(ε) dx  ≤  Σ |part| mean_i π(ε_i),     π(ε) = min Σ_j a_j s_j   s.t.   |(ρ_j, r_j)| ≤ s_j,
                                              Σ_j r_j = ((ε_xx − ε_yy)/2, ε_xy),   Σ_j (β_j s_j + γ_j ρ_j) = tr ε/2

Jumps on contacts dissipate by the associated law (D23), coefficient by coefficient. Parts without strength are rigid.

In `docs/theory.md`: (D37), (D38).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, Field, FloatArray, IntArray
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.scaling import Scales
from qvi_contact.element.edge import product_integrals
from qvi_contact.element.triangle import bernstein as bernstein_values
from qvi_contact.element.triangle import quadrature
from qvi_contact.errors import SolveError
from qvi_contact.limit.conic import APART, HELD, INFEASIBLE, ROUNDING, UNBOUNDED, Answer, ConicProgram, beside
from qvi_contact.limit.split import coefficients_of, derivatives, lattice, nodes_along, numbered, part_corners
from qvi_contact.limit.stresses import Carried, YieldCones, limited, shear_laws
from qvi_contact.mechanism import RigidMotion
from qvi_contact.mechanism.bodies import FLUID, whole_edges
from qvi_contact.mesh.edges import Edges, cross
from qvi_contact.problem.conditions import DRIVES, Condition, Contact, Displacement, Traction, components
from qvi_contact.problem.fields import along_edges, times
from qvi_contact.problem.material import Mises, Tresca
from qvi_contact.problem.problem import ContactProblem, by_cell
from solvers.basics.linked import linked

_ROOMIER: Final = 4.0  # times the largest violation of a flow: room for a second one
_MUCH: Final = 1e-4  # relative increase of dissipation by `repaired` above which flows on faces are tried


@dataclass(frozen=True, eq=False)
class Flow:
    """The upper bound of the load factor that a velocity field proves."""

    bound: float  # infinity if no velocity has power, minus infinity if the other loads alone are not carried
    violation: float = 0.0  # largest relative violation of the conditions on the velocities, by rounding
    motion: BodyMotion | None = None  # the velocities; None if the bound is not finite
    # (r, 3) part of (tr ε, ε_xx − ε_yy, 2ε_xy) that each cone takes at its coefficient; lengths relative to the mesh's
    shares: FloatArray | None = None
    missing: str = ""  # why no flow was found


@dataclass(frozen=True, eq=False)
class BodyMotion:
    """The velocities with which a body collapses, scaled so that the loads that are multiplied have the power 1."""

    velocities: FloatArray
    """(cells, 3, ·, 2): Bernstein coefficients of v on the three parts of each triangle, one degree above strain."""
    strain: FloatArray
    """(cells, 3, count, 3): coefficients of (ε_xx, ε_yy, 2ε_xy) on these parts, lengths relative to the mesh's."""
    dissipation: FloatArray
    """(cells,): the bound of ∫ π(ε) dx, in units of the load factor."""
    contacts: Mapping[str, ContactFlow]
    """Jumps on each contact, by name."""
    plates: Mapping[str, RigidMotion]
    """Motions of plates driven by force about their pivots, by the names of their contacts."""


@dataclass(frozen=True, eq=False)
class ContactFlow:
    """Jumps of v along a contact."""

    opening: FloatArray
    """(edges, p): coefficients of w = −[v]_N from the first end of each edge to its second."""
    slip: FloatArray
    """(edges, p): coefficients of [v]_T."""
    dissipation: FloatArray
    """(edges,): the bound of ∫ π([v]) ds, in units of the load factor."""


class Velocities:
    """The velocities v = P q that rigid parts of the body leave free; lengths relative to that of the mesh.

    Attributes
    ----------
    table : (cells, 3, count) int array
        Numbers of the coefficients of each part; triangles share coefficients on edges that are no open joint.
    plates : list
        Contacts with plates driven by force. Bodies are numbered with these plates first, then the rigid parts.
    rigid : (N,) int array
        The body that each coefficient moves with, −1 for none.
    hinges : (2, h) int array
        Coefficients at vertices where rigid parts meet without a common edge, and the further bodies there.
    basis : (2 N + 3 bodies, n) sparse array
        P: x and y of all coefficients, then motions (a, b, θ) of plates about pivots, of rigid parts about centres.

    """

    def __init__(self, problem: ContactProblem, degree: int, strong: BoolArray) -> None:
        self.problem, self.mesh, self.degree = problem, problem.mesh, degree
        mesh, edges, self.table = self.mesh, whole_edges(problem), numbered(problem, degree)
        self.count = int(self.table.max()) + 1
        self.points = np.empty((self.count, 2))
        self.points[self.table] = lattice(degree) @ part_corners((mesh.corners - mesh.origin) / mesh.length)
        self.plates = [contact for contact in problem.contacts if contact.plate is not None and contact.plate.driven]
        first, second = edges.cells[strong[edges.cells].all(axis=1)].T
        part_of_cell = np.unique(linked(first, second, mesh.cell_count)[strong], return_inverse=True)[1]
        pairs = np.broadcast_arrays(self.table[strong], part_of_cell[:, None, None])
        node, body = np.unique([each.ravel() for each in pairs], axis=1)
        body, is_further = body + len(self.plates), np.diff(node, prepend=-1) == 0
        self.rigid = np.full(self.count, -1)
        self.rigid[node[~is_further]] = body[~is_further]
        self.hinges = np.stack([node, body])[:, is_further]
        sums = np.stack([np.bincount(body, along) for along in self.points[node].T], axis=1)
        middles = (sums / np.maximum(np.bincount(body), 1)[:, None])[len(self.plates) :]
        pivots = [(np.array(each.plate.pivot) - mesh.origin) / mesh.length for each in self.plates if each.plate]
        self.centres = np.array([*pivots, *middles]).reshape(-1, 2)
        self.size = 2 * self.count + 3 * len(self.centres)
        self.basis = self._basis()

    def along(self, edges: Edges, side: int = 0) -> IntArray:
        """The numbers (e, p) of the coefficients along edges, from their first end to the second."""
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
        """The opening w = −[v]_N and [v]_T at all coefficients of a contact, as rows on coefficients and bodies."""
        edges, jump_rows = self.mesh.edges(contact.edges), []
        first = self.along(edges).ravel()
        for vector in (-edges.normal, edges.tangent):
            direction = np.repeat(vector, self.degree + 1, axis=0)
            rows = self.rows(first, direction)
            if contact in self.problem.joints:
                rows = rows - self.rows(self.along(edges, 1).ravel(), direction)
            elif contact in self.plates:
                rows = rows - self.rows(first, direction, np.full(len(first), self.plates.index(contact)))
            jump_rows.append(rows)
        return jump_rows[0], jump_rows[1]

    def held(self) -> sparse.csr_array:
        """Velocities that supports, hinges and tied contacts rule out, as rows on coefficients and bodies."""
        blocks = [self.rows(self.hinges[0], axes) - self.rows(self.hinges[0], axes, self.hinges[1])
                 for axes in np.repeat(np.eye(2)[:, None], self.hinges.shape[1], axis=1)]  # fmt: skip
        for support in self.problem.prescribed(Displacement):
            nodes = self.along(support.edges)
            blocks.append(self.rows(nodes.ravel(), np.repeat(support.direction, nodes.shape[1], axis=0)))
        for contact in self.problem.contacts:
            if contact.law == "tied" and contact not in self.problem.joints:
                blocks += self.jumps(contact)
        return sparse.csr_array(sparse.vstack(blocks))

    def _basis(self) -> sparse.csr_array:
        """P: columns of coefficients in no rigid part, of motions of plates driven by force, and of rigid parts."""
        free_nodes, rigid = np.flatnonzero(self.rigid < 0), np.flatnonzero(self.rigid >= 0)
        forces = [getattr(contact.plate, name) for contact in self.plates for name in DRIVES]
        is_free = [force is not None for force in forces] + [True] * (3 * len(self.centres) - len(forces))
        columns = np.concatenate([2 * free_nodes, 2 * free_nodes + 1, 2 * self.count + np.flatnonzero(is_free)])
        P = sparse.eye_array(self.size, format="csc")
        for axes in np.repeat(np.eye(2)[:, None], len(rigid), axis=1):
            P = P + self.rows(rigid, axes).T @ self.rows(rigid, axes, self.rigid[rigid])
        return sparse.csr_array(sparse.csc_array(P)[:, columns])


def slipping_supports(problem: ContactProblem) -> ContactProblem:
    """The problem with held edges as contacts of the cohesion a/2 where |(σ_xx − σ_yy, 2σ_xy)| ≤ a limits stresses.

    Stresses within the strength are within this law, so that bounds from above hold for the problem itself. Without
    slip there, no plate could move beside a held edge, as velocities are continuous. Without such edges, the problem.
    """
    mesh, conditions, sets = problem.mesh, list[Condition](), dict(problem.mesh.edge_sets)
    for condition in problem.conditions:
        edges = mesh.edges(condition.edges)
        if not isinstance(condition, Displacement) or len(components(condition)) < 2 or edges.bent.any():
            conditions.append(condition)
            continue
        pairs, material_of = np.column_stack([edges.first, edges.second]), problem.cell_materials[edges.cells[:, 0]]
        del sets[condition.edges]
        for index in np.unique(material_of).tolist():
            material, name = problem.materials[index], f"{condition.edges}, {index}"
            sets[name] = pairs[material_of == index]
            if isinstance(material.strength, Tresca | Mises):
                cone = next(material.strength.cones(material.plane))
                cohesion = times(cone.field, 0.5 * float(cone.factor))
                conditions.append(Contact(name, 0.0, cohesion=cohesion, law="bilateral"))
            else:
                conditions.append(replace(condition, edges=name))
    relaxed = replace(problem, mesh=replace(mesh, edge_sets=sets), conditions=conditions)
    return relaxed if len(relaxed.contacts) > len(problem.contacts) else problem


class FlowProgram:
    """The program (D37) of a problem; stresses relative to S, lengths to that of the mesh."""

    def __init__(self, problem: ContactProblem, names: Sequence[str], cones: YieldCones, scales: Scales) -> None:
        self.problem, self.names, self.scales, self.k, self.cones = problem, tuple(names), scales, cones.degree, cones
        self.space = Velocities(problem, self.k + 1, self.cones.strong)
        mesh = problem.mesh
        parts = part_corners((mesh.corners - mesh.origin) / mesh.length)
        a, b = (parts[..., i, :] - parts[..., 0, :] for i in (1, 2))
        self._areas = np.abs(cross(a, b)) / 2.0  # (cells, 3) of the parts
        self._parts = parts.reshape(-1, 3, 2)
        # ∫ B_i of all coefficients of strain
        self._weights = np.repeat(self._areas.ravel() / self.cones.count, self.cones.count)

    def solved(self, share: float = 0.0, *, doubted: bool = False) -> Flow:
        """The flow with the least bound found; `SolveError` if it breaks its conditions.

        A `doubted` bound counts only if `falls` finds no motion in which the other loads do positive work.

        The flow moves a share of the way to a flow inside all limits, as far as they leave room. With a share of 0,
        strain of parts without tension that have no room is, by equations, across an edge.
        """
        # power of the loads that are multiplied (1 for velocities of size 1) and of the others; a first answer
        n, cones = self.space.basis.shape[1], self.cones
        (live, dead), cone_scale = np.zeros((2, n)), beside(cones.limit, cones.least, 1.0 / APART)
        for name, row in self._powers():
            (live if name in self.names else dead)[:] += row @ self.space.basis
        full = self._program(live / (float(np.abs(live).sum()) or 1.0), dead)
        answer = full.solve()
        if isinstance(answer, str):
            return Flow(-np.inf if answer == UNBOUNDED or full.falls else np.inf)

        flows = self._flows(full, answer, cone_scale, share)
        _, cost, violation, x = min(flows, key=lambda each: each[1])
        # scaled to the power 1, if the conditions hold; beyond: the other loads have power where these have none
        power = float(live @ x[:n])
        is_kept = violation <= HELD and power > 0.0
        is_trusted = is_kept and cost >= 0.0 and not doubted
        if not is_trusted and any(program.falls for program, *_ in flows):
            return Flow(-np.inf)
        if not is_kept:
            raise SolveError(
                f"limit load: the velocities found break their conditions by {violation:.1e}: use another degree, or a "
                "mesh that is less graded"
            )
        x = x / power
        s, r, *rho = np.split(full.blocks(x) / cone_scale[:, None], [1, 3], axis=1)
        trace = cones.pressure * s[:, 0] + sum(cones.mean * part[:, 0] for part in rho if part.size)
        shares = np.column_stack([trace, r]) * (2.0 / self._weights[cones.coefficient, None])
        bound = max(float(full.q @ x), -float(dead @ x[:n]))  # negative dissipation is rounding
        return Flow(bound, violation, self._motion(x), shares)

    def _flows(
        self, full: ConicProgram, answer: Answer, cone_scale: FloatArray, share: float
    ) -> list[tuple[ConicProgram, float, float, FloatArray]]:
        """The answer of the full program, corrected, and one on faces if it costs much or a strength is 0.

        By program, cost, largest violation, and unknowns. The cost is the dissipation less the other power, with what
        violations may have saved: infinite if they are no rounding, −∞ if the program on faces has no least one.
        """
        cones, n = self.cones, self.space.basis.shape[1]

        def raised(program: ConicProgram, x: FloatArray) -> FloatArray:
            """The point with s as small as the cone allows, for cones whose s is in no trace equation."""
            x, without_trace = program.projected(x), np.flatnonzero(cones.pressure == 0.0)
            blocks = full.blocks(x)[without_trace]
            x[n + without_trace] -= (blocks[:, 0] - np.linalg.norm(blocks[:, 1:], axis=1)) / cone_scale[without_trace]
            return x

        def kept(program: ConicProgram, answer: Answer) -> tuple[ConicProgram, float, float, FloatArray]:
            x, violation = program.repaired(raised(program, answer.x), share)
            x = raised(program, x)
            violation = max(violation, -float(full.margins(x).min(initial=0.0)))
            cost = float(full.q @ x) + program.price(x, answer.multipliers)
            return program, cost if violation <= HELD else np.inf, violation, x

        start, flow = raised(full, answer.x), kept(full, answer)
        broken = -float(full.margins(start).min(initial=0.0))
        most = float(full.q @ start + _MUCH * np.abs(full.q) @ np.abs(start))
        with suppress(SolveError):  # the flow found so far stays
            if share:  # proofs need room for what the answer breaks, though it may cost a little more
                roomier = full.solve(room=_ROOMIER * broken * full.size(start))
                other = flow if isinstance(roomier, str) else kept(full, roomier)
                return [other if other[1] <= max(flow[1], most) else flow]
            if broken > ROUNDING and (flow[1] > most or not cones.limit.all()):
                program = full.on_faces(cones.rays)
                on_faces = program.solve() if program else INFEASIBLE
                if program and isinstance(on_faces, Answer):
                    return [flow, kept(program, on_faces)]
                if program and on_faces == UNBOUNDED:
                    return [flow, (program, -np.inf, np.inf, start)]
        return [flow]

    def _program(self, live: FloatArray, dead: FloatArray) -> ConicProgram:
        """The program. Unknowns are q, s of the cones, both components of r of all but the first cones, ρ, and slips.

        The first cone of a coefficient takes the rest of r.
        """
        # unknowns: slices of the identity; rows have one cone each, coefficients the sum of their cones
        cones, slips, n, rows = self.cones, self._slips, len(live), len(self.cones.coefficient)
        others, mean = np.flatnonzero(~cones.first), np.flatnonzero(cones.mean)
        ends = np.cumsum([0, n, rows, len(others), len(others), len(mean), len(slips.costs)])
        unknowns = sparse.eye_array(ends[-1], format="csr")
        Q, S, R1, R2, RHO, Y = (unknowns[a:b] for a, b in pairwise(ends))
        yielding, number = np.unique(cones.coefficient, return_inverse=True)  # coefficients that yield
        to_rows = sparse.eye_array(len(yielding), format="csr")[number]
        sums, first = to_rows.T, sparse.diags_array(cones.first.astype(float)) @ to_rows
        each = sparse.eye_array(rows, format="csc")
        other_columns, mean_columns = each[:, others], each[:, mean]
        rest_of_r = other_columns - first @ (sums @ other_columns)
        # strain times weights, (ε_xx − ε_yy)/2, ε_xy and tr ε/2, and the cones |(ρ_j, r_j)| ≤ s_j
        strain, weights = self._strain @ self.space.basis, sparse.diags_array(self._weights[yielding] / 2.0)
        xx, yy, xy = (weights @ strain[3 * yielding + i] @ Q for i in range(3))
        traces = sums @ (
            sparse.diags_array(cones.pressure) @ S + mean_columns @ sparse.diags_array(cones.mean[mean]) @ RHO
        )
        parts = [-S, -(first @ (xx - yy) + rest_of_r @ R1), -(first @ xy + rest_of_r @ R2)]
        parts += [-(mean_columns @ RHO)] if len(mean) else []
        # equations: traces, power 1, held velocities, jumps; inequalities of jumps; dissipation less the other power
        held = self.space.held() @ self.space.basis
        E = sparse.vstack([xx + yy - traces, sparse.csr_array(live[None]) @ Q, held @ Q, slips.E @ Q])
        e = np.zeros(E.shape[0])
        e[len(yielding)] = 1.0
        strengths = (beside(each, cones.least, 1.0 / APART) for each in (slips.strengths, cones.limit))
        of_slips, of_cones = map(sparse.diags_array, strengths)  # scaled: with large strengths solvers lose digits
        L = of_slips @ (slips.L @ Q + slips.own @ Y)
        q = np.concatenate([-dead, cones.limit / self.scales.stress, np.zeros(ends[-2] - ends[2]), slips.costs])
        zeros = [(of_cones @ part, np.zeros(rows)) for part in parts]
        return ConicProgram.of(q, (E, e), (L, np.zeros(L.shape[0])), zeros, dependent=True)

    @cached_property
    def _strain(self) -> sparse.csr_array:
        """Coefficients of (ε_xx, ε_yy, 2ε_xy), three numbers each, as rows on coefficients of v and bodies."""
        space = self.space
        along_x, along_y = derivatives(self._parts, space.degree, space.table.reshape(len(self._parts), -1))
        strain = sparse.kron(along_x, [[1, 0], [0, 0], [0, 1]]) + sparse.kron(along_y, [[0, 0], [0, 1], [1, 0]])
        return sparse.csr_array(sparse.hstack([strain, sparse.csr_array((strain.shape[0], 3 * len(space.centres)))]))

    def _powers(self) -> Iterator[tuple[str, FloatArray]]:
        """The power of the loads by name, as rows on coefficients of v and bodies, dimensionless."""
        space, mesh, S = self.space, self.space.mesh, self.scales.stress
        for traction in self.problem.prescribed(Traction):
            if isinstance(traction.condition, Traction):
                weights = self._edge_weights(traction.edges, traction.name, traction.value)
                direction = np.repeat(traction.direction, space.degree + 1, axis=0)
                yield traction.condition.name, weights @ space.rows(space.along(traction.edges).ravel(), direction)
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
            if callable(potential):  # −∫ ∇φ·v dx for the polynomial that stands for φ in the stresses
                k, row = self.k, np.zeros(space.size)
                ordinates = coefficients_of(self.problem, k, potential)[0].ravel()
                numbers = np.arange(len(ordinates)).reshape(len(self._parts), -1)
                for axis, along in enumerate(derivatives(self._parts, k, numbers)):
                    slopes = (along @ ordinates).reshape(*self._areas.shape, -1)
                    force = np.einsum("npc,cf,np->npf", slopes, _products(k - 1, space.degree), self._areas)
                    np.add.at(row, 2 * space.table + axis, -force / S)
                yield name, row

    def _edge_weights(self, edges: Edges, name: str, field: Field) -> FloatArray:
        """∫ f B_i ds (e · p,), dimensionless, from the first end of each edge on."""
        mesh, degree = self.space.mesh, self.space.degree
        field_on_edges = along_edges(mesh, edges, name, field)
        return (field_on_edges.moments(degree) * edges.length[:, None] / (self.scales.stress * mesh.length)).ravel()

    @cached_property
    def _slips(self) -> _Slips:
        """Jumps, rows and costs of the contacts that limit tractions.

        |[v]_T| ≤ d + u: the slip d dilates, w ≥ μ d, and costs c; the slip u does not dilate and costs t_max.
        """
        mesh, space, p = self.space.mesh, self.space, self.space.degree + 1
        contacts = [contact for contact in self.problem.contacts if contact.law != "tied"]
        jumps, numbers = [[sparse.csr_array((0, space.size))] * 2], [np.zeros((5, 0))]
        for contact, law in zip(contacts, shear_laws(self.problem), strict=True):
            edges = mesh.edges(contact.edges)
            weights = edges.length / (mesh.length * p * self.scales.stress)
            laws = [weights, np.full(len(edges), contact.law == "unilateral"), *law.max(axis=-1)]  # largest values
            numbers.append(np.repeat(laws, p, axis=1))
            jumps.append(list(space.jumps(contact)))
        weight, one_sided, mu, c, cap = np.concatenate(numbers, axis=1)
        opening, slip = (sparse.csr_array(sparse.vstack(rows) @ space.basis) for rows in zip(*jumps, strict=True))
        unilateral, rough, count = one_sided > 0.0, mu > 0.0, len(mu)
        # slips d, then slips u; with friction a bilateral contact has any shear up to its cap
        dilating = np.where(rough & ~unilateral, np.inf, np.minimum(c, cap))
        prices = np.append(dilating, np.where(rough, cap, np.inf))
        affordable = np.flatnonzero(prices <= self.cones.most)
        prices, at = prices[affordable], np.tile(np.arange(count), 2)[affordable]
        to_jumps, slides = sparse.eye_array(count, format="csr")[at].T.tocsr(), np.isin(np.arange(count), at)
        size = len(at)
        L = sparse.vstack([slip[slides], -slip[slides], sparse.csr_array((size, slip.shape[1])), -opening[unilateral]])
        dilates = (to_jumps @ sparse.diags_array(np.where(affordable < count, mu[at], 0.0))).tocsr()[unilateral]
        own = sparse.vstack([-to_jumps[slides], -to_jumps[slides], -sparse.eye_array(size), dilates])
        equal = sparse.vstack([opening[~unilateral], slip[~slides]])
        most = np.zeros(count)
        np.maximum.at(most, at, prices)
        strengths = np.concatenate([most[slides], most[slides], prices, np.zeros(unilateral.sum())])
        lengths = {contact.name: len(mesh.edges(contact.edges)) for contact in contacts}
        return _Slips(lengths, opening, slip, L, own, equal, strengths, weight[at] * prices, at)

    def _motion(self, x: FloatArray) -> BodyMotion:
        """The velocities, strains and dissipation of a solution."""
        space, cones, slips, p = self.space, self.cones, self._slips, self.space.degree + 1
        n, rows = space.basis.shape[1], len(cones.coefficient)
        v = space.basis @ x[:n]
        velocities = np.stack([v[2 * space.table], v[2 * space.table + 1]], axis=-1)
        strain = (self._strain @ v).reshape(-1, 3, cones.count, 3)
        spent = x[n : n + rows] * cones.limit / self.scales.stress
        dissipation = np.asarray(np.bincount(cones.cell, spent, space.mesh.cell_count), dtype=np.float64)
        opening, slip = slips.opening @ x[:n], slips.slip @ x[:n]
        slip_costs = slips.costs * x[len(x) - len(slips.at) :]
        cost = np.asarray(np.bincount(slips.at, slip_costs, len(opening)), dtype=np.float64)
        ends = np.cumsum([0, *slips.lengths.values()])[1:]
        parts = (np.split(part.reshape(-1, p), ends) for part in (opening, slip, cost))  # the last of each is empty
        contact_flows = {name: ContactFlow(w, t, spent.sum(axis=1))
                 for name, w, t, spent in zip(slips.lengths, *parts, strict=False)}  # fmt: skip
        plates = {
            contact.name: RigidMotion(a, b, turn / space.mesh.length, contact.plate.pivot)
            for contact, (a, b, turn) in zip(space.plates, v[2 * space.count :].reshape(-1, 3).tolist(), strict=False)
            if contact.plate is not None
        }
        return BodyMotion(velocities, strain, dissipation, contact_flows, plates)

    def gap_in_cells(self, discretization: Discretization, carried: Carried, motion: BodyMotion) -> FloatArray:
        """The parts of (D38) by triangle (cells,); the part of a contact edge is divided among its triangles."""
        assert carried.stress is not None
        assert carried.tractions is not None
        degree = self.k
        work = np.einsum("npic,ij,npjc,np->n", carried.stress, _products(degree, degree), motion.strain, self._areas)
        gaps: FloatArray = motion.dissipation - np.where(self.cones.strong, 0.0, work)
        table, on_edges = product_integrals(degree, degree + 1), dict[str, FloatArray]()
        rows_of = {contact.name: rows for rows, contact in limited(discretization)}
        for name, flow in motion.contacts.items():
            if name in rows_of:
                rows = rows_of[name]
                edges, q = rows.points.edges, rows.rule.count
                normal, shear = (half[rows.rows].reshape(-1, q) for half in np.split(carried.tractions, 2))
            else:  # a support that slips
                edges = self.space.mesh.edges(name)
                xx, yy, xy = np.moveaxis(carried.stress.reshape(-1, 3)[nodes_along(self.problem, degree, edges)], -1, 0)
                n, t = edges.normal[:, None], edges.tangent[:, None]
                force = np.stack([xx * n[..., 0] + xy * n[..., 1], xy * n[..., 0] + yy * n[..., 1]], axis=-1)
                normal, shear = (force * n).sum(axis=-1), (force * t).sum(axis=-1)
            edge_work = np.einsum("ei,ij,ej->e", normal, table, flow.opening)
            edge_work -= np.einsum("ei,ij,ej->e", shear, table, flow.slip)
            on_edges[name] = flow.dissipation - edge_work * edges.length / self.space.mesh.length
        return np.maximum(gaps + by_cell(self.problem, on_edges), 0.0)


class _Slips(NamedTuple):
    """Contacts in the program: jumps as rows on q, and L q + own y ≤ 0, E q = 0 for slips y with their costs."""

    lengths: dict[str, int]  # number of edges by contact
    opening: sparse.csr_array
    slip: sparse.csr_array
    L: Any
    own: Any
    E: Any
    strengths: FloatArray  # of the rows of L: the costs of their slips [stress]
    costs: FloatArray
    at: IntArray  # the jump of each slip


def _products(first: int, second: int) -> FloatArray:
    """∫ B_i B_j over a triangle of area 1, for two degrees."""
    points, weights = quadrature(first + second)
    return np.asarray((bernstein_values(first, points) * weights[:, None]).T @ bernstein_values(second, points))
