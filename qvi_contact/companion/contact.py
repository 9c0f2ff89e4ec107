"""Contacts in the displacement model: coefficients of v_N and v_T, the dual problem in their forces, and the way back.

On an edge the relative displacement is Σ c_i B_i. Each c is a coefficient of the body, or the difference of two on a
joint, along the edge's normal or tangent. In a corner of the line, where edges of two directions meet, there is one
c for each direction. Tangents point to the right. Where an arc goes straight up, the tangents of two edges lead
against each other, and c_T counts with the other sign on one of them; on a joint the normals and sides of the edges
change there as well, and c_T does not. The motion of a plate driven by force and the stretch of springs are subtracted
from c. The forces conjugate to c are

    z_i = ∫ σ B_i ds = W_i τ_i,   W_i = ∫ B_i ds,

with mean tractions τ_i [stress] weighted by the positive B_i. They obey the contact laws: c_N ≤ g, τ_N ≤ 0 and
|τ_T| ≤ s_i with s_i = ∫ s B_i ds / W_i, under Coulomb's law min(cohesion + μ_i |τ_N|, cap), μ_i at the point of i.

With c = c_D + B w_Γ (c_D from supports and given motions) and the maps of `CondensedBody`, in which w_Γ has stretches
of springs and motions of plates, forces that are in equilibrium minimise

    ½ τᵀ C τ − τᵀ W (g̃ − c_D − B G r),   C = W B G Bᵀ W,   g̃ = (g, w)

over the mean tractions τ = z / W that the laws admit, a `FrictionQVI`, subject to

    Rᵀ Bᵀ W τ = −Rᵀ r        equilibrium of free bodies and of plates, with the motions a as multiplier.

The multipliers of the laws are W (g − c_N) ≥ 0 and −W (c_T − w). All normal tractions come first, then all tangential
ones. A force whose c cannot change (supports prescribe it, or it is at the tip of a joint) gets a compliance of its own
and stays zero, as do normal and tied forces whose c follows from others. In corners where two contact lines end or
joints cross, the c of friction follows from others, and C is singular: there friction gets a small additional
compliance, as does a force that stops a plate where supports prescribe c.

A solution meets the contact conditions to a tolerance, and is then made `admissible`.

In `docs/theory.md`: (D18), (D40).
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, evaluate
from qvi_contact.companion.body import LOAD_POINTS, CondensedBody
from qvi_contact.discretization.displacements import (
    MISFIT,
    PARALLEL,
    ROUNDED,
    DisplacementSpace,
    components_along,
    contact_edges,
    edge_data,
    in_lines,
    spread,
)
from qvi_contact.discretization.plates import COMPONENTS, independent_rows
from qvi_contact.discretization.scaling import REACH, Scales
from qvi_contact.element.edge import SAMPLES, bernstein_basis, gauss_legendre, product_integrals
from qvi_contact.errors import InputError, place_of
from qvi_contact.mesh.edges import Edges, centre_of, frames_along
from qvi_contact.problem.conditions import DRIVES, SPRINGS, Contact, RigidPlate
from qvi_contact.problem.fields import along_edges
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.contact_line import turning_senses
from solvers import FrictionQVI, QVISolution, Status, solve_qvi
from solvers.basics.linked import linked

_DEPENDENT = 1e-9  # relative norm of a row after projection on earlier rows, below which it depends on them
_BALANCED = 1e-9  # imbalance of the loads on a free body, relative to the loads, that is rounding
_STICKS = 1e3  # times the largest friction bound: the bound where slip is forbidden
_SOFT = 3e-5  # added compliance of a force whose c follows from others, relative to that of other forces
_TRIALS = 4  # solutions with corrected right-hand sides, which make up for added compliances and far obstacles

_FIRM = 1e6  # weight of motions of plates in least changes of displacements
VIOLATED = 1e-12  # largest violation of a contact condition, relative to the largest displacement, that is rounding

_INDICATOR = "The friction bound was taken from the displacement model's own contact forces: its energy is no bound."


@dataclass(frozen=True, eq=False)
class DisplacementContact:
    """One contact, dimensionless; arrays over its n coefficients unless said otherwise."""

    contact: Contact
    space: DisplacementSpace
    scales: Scales
    edges: Edges  # in the mesh's order, with one direction along each straight line
    start: int  # its first coefficient among those of all contacts
    columns: IntArray  # (e, p + 1): numbers below n of the coefficients on each edge
    turned: FloatArray  # (e, p + 1): −1 where c_T of a coefficient counts against the edge's tangent, else 1
    places: FloatArray  # (n, 2): points of the coefficients
    normal: sparse.csr_array  # normal, tangential, (n, size) each: rows of c_N and c_T on the body's unknowns
    tangential: sparse.csr_array
    lengths: FloatArray  # (e,): of the edges
    weights: FloatArray  # (n,): W = ∫ B_i ds
    bound: FloatArray | None  # (e, q): Bernstein coefficients of the given bound s on each edge

    @property
    def name(self) -> str:
        """Name of the contact."""
        return self.contact.name

    @property
    def count(self) -> int:
        """Number of coefficients n."""
        return len(self.places)

    @property
    def here(self) -> slice:
        """The slice of its coefficients among those of all contacts."""
        return slice(self.start, self.start + self.count)

    @cached_property
    def senses(self) -> FloatArray:
        """±1 (n,), the sign of c_T in the contact's force, see `turning_senses`; 0 where the edges disagree."""
        return np.sign(self.summed(self.turned * turning_senses(self.space.mesh.vertices, self.edges)[:, None]))

    def on_edges(self, normal: FloatArray, tangential: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Coefficients (…, n) edge by edge, (…, e, p + 1); the tangential ones along the edge's own tangent."""
        return normal[..., self.columns], self.turned * tangential[..., self.columns]

    def summed(self, values: FloatArray) -> FloatArray:
        """Sums (n,) at coefficients of values (e, p + 1) on edges."""
        sums = np.bincount(self.columns.ravel(), values.ravel(), minlength=self.count)
        return np.asarray(sums, dtype=np.float64)

    def slipping_on(self, edges: FloatArray) -> FloatArray:
        """`Contacts.slipping` (n,) from slip directions (e,) along the edges' own tangents; 0 where the edges disagree.

        A coefficient that is free on one edge has the direction of the other edge.
        """
        is_given = ~np.isnan(edges)
        columns, directions = self.columns[is_given], (self.turned * edges[:, None])[is_given]
        least, most = np.full(self.count, np.inf), np.full(self.count, -np.inf)
        np.minimum.at(least, columns, directions)
        np.maximum.at(most, columns, directions)
        return np.where(least > most, np.nan, np.where(least == most, least, 0.0))

    def law(self, reasons: list[str]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """μ_i, c_i and the cap (n,); where the bound is given, c_i is the whole bound and μ_i zero."""
        friction, limit = np.zeros(self.count), np.full(self.count, np.inf)
        # The minimum of the means of c and t_max is at least the mean of their minimum, so the energy is an upper bound
        # if the means are exact. A given bound takes the place of c, t_max and friction.
        if self.bound is not None:
            products = product_integrals(self.bound.shape[1] - 1, self.space.degree)
            mean = self.summed(self.bound @ products * self.lengths[:, None]) / self.weights
            return friction, np.maximum(mean, 0.0), limit
        x, y = (self.space.mesh.origin + self.scales.length * self.places).T
        friction = evaluate("Contact.friction", self.contact.friction, x, y, minimum=0.0)
        cohesion = self.moments("cohesion", reasons) / self.weights
        if self.contact.shear_limit is not None:
            limit = self.moments("shear_limit", reasons) / self.weights
        return friction, cohesion, limit

    def moments(self, kind: str, reasons: list[str]) -> FloatArray:
        """∫ f B_i ds (n,) of a datum over S; adds a reason if the quadrature is not exact."""
        field, stress = getattr(self.contact, kind), self.scales.stress
        field_on_edges = along_edges(self.space.mesh, self.edges, f"Contact.{kind}", field, LOAD_POINTS, minimum=0.0)
        if field_on_edges.error > MISFIT * max(stress, float(np.abs(field_on_edges.values).max(initial=0.0))):
            reasons.append(
                f"The {kind.replace('_', ' ')} of {self.name!r} jumps or grows steeply. Quadrature leaves an error of "
                f"{field_on_edges.error:.2g} [stress] times an edge's length."
            )
        return self.summed(self.lengths[:, None] / stress * field_on_edges.moments(self.space.degree))

    def obstacle(self, kind: str, signs: FloatArray, reasons: list[str]) -> FloatArray:
        """Coefficients (n,) of the gap or offset, with signs (e, p + 1) on edges; the smaller value at jumps."""
        p, unit = self.space.degree, self.scales.displacement
        data, misfit = edge_data(self.space.mesh, self.edges, f"Contact.{kind}", getattr(self.contact, kind), p, unit)
        on_edges, least = signs * data, np.full(self.count, np.inf)
        np.minimum.at(least, self.columns, on_edges)
        if self.contact.law != "unilateral" or kind == "offset":
            misfit = max(misfit, float(np.abs(least[self.columns] - on_edges).max(initial=0.0)))
        if misfit > MISFIT * max(1.0, float(np.abs(least).max(initial=0.0))):
            reasons.append(
                f"The {kind} of {self.name!r} is not a continuous polynomial of degree {p} on each edge. "
                f"It is interpolated, with an error of up to {misfit * unit:.2g} [length]."
            )
        if np.abs(self.edges.normal - self.space.mesh.edges(self.contact.edges).normal).max() > PARALLEL:
            reasons.append(ROUNDED)
        return least

    def moved(self, plate: RigidPlate) -> FloatArray:
        """Coefficients (2, n) of the given motion of a plate along normals and tangents [length]."""
        field = plate.displacement(*(self.space.mesh.origin + self.scales.length * self.space.positions).T).T.ravel()
        return np.stack([self.normal @ field, self.tangential @ field])

    def motions(self) -> Iterator[tuple[str, FloatArray, float]]:
        """By force or moment on a plate: its name, c (2 n,) of the plate under the unit motion, and the force."""
        plate, centre = self.contact.plate, centre_of(self.space.mesh.vertices, self.edges)
        for component in COMPONENTS if plate is not None else ():
            if plate is not None and getattr(plate, component) is not None:
                moment = component == "moment"
                given = plate.moment_about(*centre) if moment else float(getattr(plate, component))
                motion = {DRIVES[component]: 1.0 / self.scales.length if moment else 1.0}
                size = self.scales.stress * self.scales.length ** (2 if moment else 1)
                yield component, self.moved(RigidPlate(pivot=plate.reference(*centre), **motion)), given / size


def _trace(
    problem: ContactProblem, space: DisplacementSpace, scales: Scales, contact: Contact, edges: Edges, start: int,
    bound: FloatArray | None,
) -> DisplacementContact:  # fmt: skip
    """A contact from the edges and coefficients of the body."""
    p, joint, near = space.degree, contact in problem.joints, space.along(edges)
    far = space.along(edges, other=True) if joint else near
    sides = np.where(near > far, -1.0, 1.0)
    along = frames_along(edges, np.linspace(0.0, 1.0, p + 1))
    frames = [(sides[..., None] * vectors).reshape(-1, 2) for vectors in along]
    # where edges meet, a coefficient for each direction of the line: directions get numbers
    heading = np.zeros(near.shape, dtype=np.int64)
    places, ends = np.minimum(near, far)[:, [0, -1]], frames[0].reshape(*near.shape, 2)[:, [0, -1]]
    ends = in_lines(ends.reshape(-1, 2), places.reshape(-1, 1), np.ones(places.size, dtype=bool))
    heading[:, [0, -1]] = np.unique(ends, axis=0, return_inverse=True)[1].reshape(-1, 2)
    # the n coefficients of the contact: pairs of coefficients of the body on both sides, the smaller number first, and
    # the direction. Where a joint turns back, its edges change their sides, but normals from the first of a pair do not
    pairs = np.stack([np.minimum(near, far).ravel(), np.maximum(near, far).ravel(), heading.ravel()], axis=1)
    pairs, columns = np.unique(pairs, axis=0, return_inverse=True)
    owner = np.empty(len(pairs), dtype=np.int64)  # one of the places on edges of each coefficient
    owner[columns.ravel()] = np.arange(columns.size)
    columns, tangents = columns.reshape(near.shape), frames[1][owner]
    turned = np.where((frames[1].reshape(*near.shape, 2) * tangents[columns]).sum(axis=2) < 0.0, -1.0, 1.0)
    rows = []
    for vectors in (edges.normal, edges.tangent):
        parts = components_along(edges, vectors, p).reshape(-1, p + 1, 2)[owner]
        row_numbers = np.repeat(np.arange(len(pairs)), 2 * (p + 1))
        matrix = sparse.csr_array((len(pairs), space.size))
        for coefficients, sign in ((near, 1.0), (far, -1.0))[: 1 + joint]:
            dofs = 2 * coefficients[owner // (p + 1), :, None] + np.arange(2)
            matrix = matrix + sparse.csr_array((sign * parts.ravel(), (row_numbers, dofs.ravel())), shape=matrix.shape)
        matrix.eliminate_zeros()
        rows.append(sparse.csr_array(matrix))
    lengths = edges.length / scales.length
    weights = np.bincount(columns.ravel(), np.repeat(lengths / (p + 1), p + 1), minlength=len(pairs))
    return DisplacementContact(
        contact, space, scales, edges, start, columns, turned, space.places[pairs[:, 0]],
        rows[0], rows[1], lengths, np.asarray(weights, dtype=np.float64), bound,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Contacts:
    """All contacts together; arrays over the n coefficients of all contacts, or over 2 n with the normal ones first."""

    traces: tuple[DisplacementContact, ...]
    # (2 n, size): c from v: of the body, less stretches of springs and motions of plates driven by force
    rows: sparse.csr_array
    sprung: IntArray  # (k,): coefficients with springs; their stretches follow the body's unknowns in v
    driven: tuple[tuple[str, str], ...]  # (q,): contact and force or moment of plates; their motions come last in v
    beside: sparse.csr_array  # stiffness of stretches and motions
    loads: FloatArray  # (size,): forces and moments on plates, and the loads of fluids in contacts
    weights: FloatArray  # (2 n,): W
    obstacle: FloatArray  # (2 n,): g̃ = (g, w)
    law: FloatArray  # (3, n): μ_i, c_i and the cap; where the bound is given, c_i is the whole bound and μ_i zero
    # (n,): ±1 where slip has one direction, slipping (c_T − w) ≥ 0; 0 where c_T = w; NaN where slip is free
    slipping: FloatArray
    moved: FloatArray  # (2 n,): c of the plates themselves under their given motions
    # (2 n,): ∫ p_w B_i ds of fluids, 0 for tangential coefficients, of work −Σ fluid c; tractions are σ_N + p_w, σ_T
    fluid: FloatArray
    reasons: tuple[str, ...]  # why the laws are not met exactly

    @classmethod
    def of(
        cls,
        problem: ContactProblem,
        space: DisplacementSpace,
        scales: Scales,
        bounds: Mapping[str, FloatArray] | None,
        slips: Mapping[str, FloatArray],
    ) -> "Contacts":
        """The contacts in the order of the problem, with their own laws or given bounds [stress], and slip by edge."""
        traces, n, has_friction, edges_of = list[DisplacementContact](), 0, False, contact_edges(problem)
        for contact in problem.contacts:
            bound = None if bounds is None or contact.law == "tied" else bounds[contact.name] / scales.stress
            traces.append(_trace(problem, space, scales, contact, edges_of[contact.name], n, bound))
            n += traces[-1].count
        springs, columns, resultants = sparse.csr_array((2 * n, 2 * n)), [np.zeros((2 * n, 0))], list[float]()
        obstacle, moved, fluid, law, slipping = *np.zeros((3, 2, n)), np.zeros((3, n)), np.full(n, np.nan)
        reasons, driven = list[str](), list[tuple[str, str]]()
        t, weights = gauss_legendre(LOAD_POINTS)
        shapes = bernstein_basis(space.degree, t)
        for trace in traces:
            here, contact, signs = trace.here, trace.contact, (np.ones_like(trace.turned), trace.turned)
            places = problem.mesh.points_along(trace.edges, t)
            for half, kind in enumerate(("gap", "offset")):
                obstacle[half, here] = trace.obstacle(kind, signs[half], reasons)
            law[:, here] = trace.law(reasons)
            fluid[0, here] = trace.moments("pore_pressure", reasons)
            if contact.name in slips:
                slipping[here] = trace.slipping_on(slips[contact.name])
            if bounds is None:  # friction may act between the points of coefficients
                samples = problem.mesh.points_along(trace.edges, SAMPLES)
                at_samples = evaluate("Contact.friction", contact.friction, *samples, minimum=0.0)
                has_friction |= max(law[0, here].max(), at_samples.max()) > 0.0
            for half, kind in enumerate(SPRINGS):
                if getattr(contact, kind) is not None:
                    numbers = half * n + trace.start + trace.columns
                    k = evaluate(f"Contact.{kind}", getattr(contact, kind), *places, minimum=0.0)
                    k = k * (scales.compliance * trace.edges.length[:, None] * weights)
                    shape = signs[half][:, None] * shapes
                    springs = springs + spread(numbers, numbers, (k[..., None] * shape).swapaxes(1, 2) @ shape, 2 * n)
            if contact.plate is not None:
                moved[:, here] = trace.moved(contact.plate) / scales.displacement
            for component, motion, resultant in trace.motions():
                driven.append((trace.name, component))
                column = np.zeros((2, n))
                column[:, here] = motion
                columns.append(column.reshape(-1, 1))
                resultants.append(resultant)
        blocks = [sparse.csr_array((0, space.size)), *(t.normal for t in traces), *(t.tangential for t in traces)]
        motions, sprung = np.hstack(columns), np.flatnonzero(springs.diagonal())
        stretches = sparse.eye_array(2 * n, format="csc")[:, sprung]
        rows = sparse.csr_array(sparse.hstack([sparse.vstack(blocks), -stretches, sparse.csr_array(-motions)]))
        loads = -(rows.T @ fluid.ravel())
        loads[space.size : space.size + len(sprung)] = 0.0  # fluids press on the body, not on springs
        loads[rows.shape[1] - len(resultants) :] += resultants
        beside = sparse.block_diag([springs[sprung][:, sprung], np.zeros((len(resultants),) * 2)])
        weights = np.tile(np.concatenate([np.empty(0), *(trace.weights for trace in traces)]), 2)
        return cls(
            traces=tuple(traces), rows=rows, sprung=sprung, driven=tuple(driven), beside=sparse.csr_array(beside),
            loads=loads, weights=weights, obstacle=obstacle.ravel(), law=law, slipping=slipping, moved=moved.ravel(),
            fluid=fluid.ravel(), reasons=(*reasons, _INDICATOR) if has_friction else tuple(reasons),
        )  # fmt: skip

    def stretched(self, v: FloatArray) -> FloatArray:
        """Coefficients (2 n,) of the stretch of springs from v (size,); 0 without springs."""
        stretch, start = np.zeros(2 * self.count), self.rows.shape[1] - self.beside.shape[0]
        stretch[self.sprung] = v[start : start + len(self.sprung)]
        return stretch

    @property
    def count(self) -> int:
        """Number of coefficients n."""
        return len(self.moved) // 2

    @cached_property
    def tied(self) -> BoolArray:
        """Whether the contact is tied (n,)."""
        return self.where(lambda contact: contact.law == "tied")

    @cached_property
    def bilateral(self) -> BoolArray:
        """Whether the contact keeps its distance (n,)."""
        return self.where(lambda contact: contact.law != "unilateral")

    def where(self, holds: Callable[[Contact], bool]) -> BoolArray:
        """Whether a property holds of the contact of each coefficient (n,)."""
        of_contacts = np.array([holds(trace.contact) for trace in self.traces], dtype=bool)
        return np.repeat(of_contacts, np.array([trace.count for trace in self.traces], dtype=np.int64))


@dataclass(frozen=True, eq=False)
class DualProblem:
    """The algebraic problem in contact forces, and the way back to displacements."""

    contacts: Contacts
    body: CondensedBody
    B: FloatArray  # (2 n, k): c from w_Γ
    constant: FloatArray  # (2 n,): c_D, plates moved as given
    independent: BoolArray  # (2 n,): whether the body can change c independently of the others
    live: BoolArray  # (2 n,): whether there is a force
    equalities: IntArray  # motions of R whose rows are independent
    qvi: FrictionQVI
    beyond: FloatArray  # (2 n,): part of f of far obstacles that count as nearer than they are, see `Scales.reach`
    added: FloatArray  # (2 n,): added compliances in C, for which f makes up

    def solved(self, tolerance: float) -> QVISolution:
        """The solution; solved again with far obstacles where they are, if reached, and without added compliances."""
        solution, qvi, is_reached = solve_qvi(self.qvi, tolerance=tolerance), self.qvi, False
        for _ in range(_TRIALS):
            least = tolerance * solution.certificate.scales.get("stress", np.inf)
            is_reached |= bool((solution.z[self.beyond > 0.0] < -least).any())
            f = self.qvi.f + is_reached * self.beyond + self.added * solution.z
            change = float(np.abs(f - qvi.f).max(initial=0.0))
            if solution.status is not Status.SOLVED or change <= tolerance * float(np.abs(f).max(initial=0.0)):
                break
            qvi = self.qvi.with_loads(f=f)
            next_solution = solve_qvi(qvi, tolerance=tolerance)
            solution = next_solution if is_reached or next_solution.status is Status.SOLVED else solution
        return solution

    def displacements(self, solution: QVISolution) -> FloatArray:
        """The displacements w_Γ of a solution."""
        body, motion = self.body, np.zeros(self.body.R.shape[1])
        motion[self.equalities] = solution.equality_multiplier
        forces = self.B.T @ np.where(self.live, self.contacts.weights * solution.z, 0.0)
        return np.asarray(body.relieve(body.r + forces) + body.R @ motion)


def dual_problem(contacts: Contacts, body: CondensedBody) -> DualProblem:
    """The problem in contact forces; `InputError` if loads, or resultants of plates, contradict equilibrium."""
    n, W, rigid = contacts.count, contacts.weights, body.R.shape[1] - len(contacts.driven)
    # c = constant + B w_Γ; B of the body and of driven plates are views
    constant = contacts.rows @ body.start - contacts.moved
    B = (contacts.rows @ body.B)[:, body.interface].toarray()
    of_body, plates = np.hsplit(B, [B.shape[1] - len(contacts.driven)])
    independent, driven = (np.abs(part).sum(axis=1) > PARALLEL for part in (of_body, plates))
    of_body[~independent], plates[~driven] = 0.0, 0.0
    independent[_determined(of_body, contacts)] = False  # without plates, which would connect all rows
    shear = np.append(np.zeros(n, dtype=bool), ~contacts.tied)
    live = independent | (shear & of_body.any(axis=1)) | driven | of_body[:, of_body[driven].any(axis=0)].any(axis=1)
    # C = W B G Bᵀ W plus the added compliances
    compliance = B @ body.relieve(np.ascontiguousarray(B.T)) if len(B) else np.zeros((0, 0))
    typical = float(np.median(np.diag(compliance)[independent])) if independent.any() else 1.0
    compliance[~live], compliance[:, ~live] = 0.0, 0.0
    added = typical * np.select([independent, live], [0.0, _SOFT], 1.0) * W**2
    C = compliance * W * W[:, None] + np.diag(added)
    C = (C + C.T) / 2.0
    # f = W (g̃ − c_D − B G r), with far obstacles at the distance `REACH`
    beyond = np.where(contacts.bilateral, 0.0, np.maximum(contacts.obstacle[:n] - REACH, 0.0))
    beyond = np.append(beyond, np.zeros(n)) * W * live
    f = np.where(live, W * (contacts.obstacle - constant - B @ body.relieve(body.r)), 0.0) - beyond
    # equilibrium Rᵀ Bᵀ W τ = −Rᵀ r: independent rows, and a check of the others
    A, b = np.where(live, body.R.T @ B.T, 0.0) * W, -body.R.T @ body.r
    sizes = np.linalg.norm(A, axis=1)
    kept, combinations = independent_rows(A, _DEPENDENT * np.maximum(sizes, _DEPENDENT * sizes.max(initial=0.0)))
    for index, combination in combinations.items():
        contradiction = float(b[index] - combination @ b[kept[: len(combination)]])
        if abs(contradiction) > max(_BALANCED, body.closely) * max(1.0, float(np.abs(b).max())):
            field = "ContactProblem.conditions"
            remedy = "the loads on a body that nothing holds are out of balance by this, dimensionless: correct them, "
            remedy += "or support the body by a displacement or a contact"
            if index >= rigid:
                field, contradiction = "RigidPlate", -contradiction  # of the force that is given
                remedy = "contradicts the other loads by this, dimensionless: correct it, or leave it out"
            raise InputError(field, contradiction, remedy)
    friction, cohesion, cap = contacts.law
    rows = np.flatnonzero(~contacts.tied)  # tractions that obey a law
    cohesion = np.where(contacts.slipping == 0.0, _STICKS * max(1.0, float(cohesion.max(initial=0.0))), cohesion)
    identity, zeros = sparse.eye_array(2 * contacts.count, format="csr"), np.zeros(len(rows))
    qvi = FrictionQVI.from_arrays(
        K=sparse.csc_array(C), f=f, N=sparse.csc_array(identity[rows]), n0=zeros,
        T=sparse.csc_array(identity[contacts.count + rows]), t0=zeros, mu=friction[rows], W=W[rows],
        cohesion=cohesion[rows], cap=cap[rows], bilateral=contacts.bilateral[rows],
        A=sparse.csc_array(A[kept].reshape(len(kept), 2 * contacts.count)), b=b[kept],
    )  # fmt: skip
    added = np.where(live, added, 0.0)
    return DualProblem(
        contacts, body, B, constant, independent, live, np.array(kept, dtype=np.int64), qvi, beyond, added
    )


def _determined(B: FloatArray, contacts: Contacts) -> IntArray:
    """Rows that follow from earlier ones, in the order tied, normal, friction."""
    dependent, rank = list[int](), np.where(np.tile(contacts.tied, 2), 0, np.repeat([1, 2], contacts.count))
    row, column = B.nonzero()
    group = linked(row, column + len(B), sum(B.shape))[: len(B)]  # rows connected by columns
    order = np.argsort(group, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(group[order])) + 1):
        ordered = rows[np.argsort(rank[rows], kind="stable")]
        part = B[ordered]
        part = part[:, part.any(axis=0)]
        _, combinations = independent_rows(part, np.full(len(part), _DEPENDENT))
        dependent += ordered[list(combinations)].tolist()
    return np.array(dependent, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class LeastChange:
    """The x of least ½ xᵀKx − load · x for prescribed rows · x; rows may be dependent."""

    scales: tuple[FloatArray, FloatArray]  # (n,) and (r,): units of x and of the rows
    matrix: sparse.csc_array  # the equations, in these units
    factors: Any  # factors of the slightly regularised equations

    @classmethod
    def of(cls, stiffness: Any, rows: sparse.csr_array) -> "LeastChange":
        """The factorised equations for K (n, n) and rows (r, n)."""
        K: Any = sparse.csc_array(stiffness)
        scale = 1.0 / np.sqrt(K.diagonal())
        R = sparse.csr_array(rows @ sparse.diags_array(scale))
        lengths = np.sqrt(np.maximum(np.asarray(R.multiply(R).sum(axis=1)).ravel(), 1e-300))
        R = sparse.csr_array(sparse.diags_array(1.0 / lengths) @ R)
        S, number = sparse.diags_array(scale) @ K @ sparse.diags_array(scale), len(lengths)
        matrix = sparse.csc_array(sparse.block_array([[S, R.T], [R, sparse.csr_array((number, number))]]))
        slightly = sparse.diags_array(np.append(np.zeros(len(scale)), np.full(number, 1e-9)))
        return cls((scale, lengths), matrix, splu(sparse.csc_array(matrix - slightly)))

    def solved(self, right: FloatArray, load: FloatArray | float = 0.0) -> FloatArray:
        """The x with rows · x = right, as nearly as possible."""
        scale, lengths = self.scales
        right_side = np.concatenate([scale * load, right / lengths])
        solution = np.zeros_like(right_side)
        for _ in range(4):  # corrects the effect of the regularisation
            solution = solution + self.factors.solve(right_side - self.matrix @ solution)
        return np.asarray(scale * solution[: len(scale)])


def admissible(
    problem: DualProblem, values: FloatArray, tractions: FloatArray, bound: FloatArray
) -> tuple[FloatArray, FloatArray, str]:
    """(v (size,), c (2 n,), contradiction): displacements that meet the contact conditions up to rounding, from w_Γ.

    Coefficients that surely press or stick, must not slip, or slip against their direction get the displacement of the
    obstacle by the least changes. Plates move only as far as that is needed.
    """
    contacts, rows = problem.contacts, sparse.csr_array(problem.B)
    unit, n, slipping = max(1.0, float(np.abs(tractions).max(initial=0.0))), contacts.count, contacts.slipping
    c, weights = rows @ values + problem.constant, np.ones(len(values))
    weights[len(values) - len(contacts.driven) :] = _FIRM
    opening, slip = contacts.obstacle[:n] - c[:n], c[n:] - contacts.obstacle[n:]
    is_closed = (-tractions[:n] / unit > np.maximum(opening, 0.0)) | (opening < 0.0)
    is_stuck = ((bound - np.abs(tractions[n:])) / unit > np.abs(slip)) & (np.abs(slip) < 1e-6) & problem.independent[n:]
    is_stuck |= (slipping == 0.0) | (slipping * slip < 0.0)
    is_closed = contacts.bilateral | (is_closed & (np.abs(opening) < 1e-6))
    is_held = np.concatenate([is_closed, is_stuck | contacts.tied])  # coefficients moved to the obstacle
    computed = values
    for _ in range(3):  # a correction in a corner may push another contact line over its gap
        moved = np.flatnonzero(is_held)
        least = LeastChange.of(sparse.diags_array(weights), rows[moved])
        for _ in range(2):  # once more for rounding
            values = values + least.solved((contacts.obstacle - c)[moved])
            c = rows @ values + problem.constant
        is_violated = (_excess(problem, c) > 0.0) & ~is_held
        if not is_violated.any():
            break
        is_held |= is_violated
    for candidate in (values, computed):  # if conditions contradict each other, the changes may be worse than none
        v = problem.body.expand(candidate)
        c = contacts.rows @ v - contacts.moved
        excess = _excess(problem, c)
        worst = float(excess.max(initial=0.0)) / max(1.0, float(np.abs(c).max(initial=0.0)))
        if worst <= VIOLATED:
            return v, c, ""
    half, number = divmod(int(np.argmax(excess)), contacts.count)
    trace = next(each for each in contacts.traces if number < each.here.stop)
    place = trace.space.mesh.origin + trace.scales.length * trace.places[number - trace.start]
    condition = "the slip condition" if half else "the obstacle"
    where = f"{condition} of {trace.name!r} at {place_of(place)}"
    cause = "Prescribed displacements" + (", or the stick demanded at kinks," if (slipping == 0.0).any() else "")
    return v, c, f"{cause} contradict {where}, by {worst:.1e} of their size."


def _excess(problem: DualProblem, c: FloatArray) -> FloatArray:
    """Violations (2 n,): of c_N ≤ g, or c_N = g where the contact keeps its distance, and of the conditions on c_T."""
    contacts = problem.contacts
    normal, shear = (c - contacts.obstacle).reshape(2, contacts.count)
    backwards = np.where(np.isnan(contacts.slipping), 0.0, np.maximum(-contacts.slipping * shear, 0.0))
    is_held = contacts.tied | (contacts.slipping == 0.0)
    across = np.where(contacts.bilateral, np.abs(normal), np.maximum(normal, 0.0))
    return np.concatenate([across, np.where(is_held, np.abs(shear), backwards)])
