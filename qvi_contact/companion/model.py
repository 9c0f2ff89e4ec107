"""The displacement model: assemble, condense, solve for the contact forces, return to displacements; and its result."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from qvi_contact import __version__
from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, fraction
from qvi_contact.basics.schema import WithFields
from qvi_contact.companion.body import CondensedBody, Elasticity, load_vector
from qvi_contact.companion.contact import VIOLATED, Contacts, admissible, dual_problem
from qvi_contact.discretization.displacements import (
    PARALLEL,
    DisplacementSpace,
    PrescribedDisplacements,
    Triangle,
    supports,
    triangle,
)
from qvi_contact.discretization.loads import scaled_stress_at_rest
from qvi_contact.discretization.scaling import Scales
from qvi_contact.element.edge import absolute_integrals, bernstein_basis
from qvi_contact.errors import InputError
from qvi_contact.problem.conditions import RigidMotion
from qvi_contact.problem.material import is_strained
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.result import plate_motions
from qvi_contact.solution.stress import mean_at
from solvers import Certificate, QVISolution, Status
from solvers.basics.progress import Log, deadline
from solvers.basics.types import PicklesFields
from solvers.certificate.certificate import EXPONENTS
from solvers.errors import known_name
from solvers.factorisation.base import FactorisationError, limited_blas

_FAILURES: Final = {"singular": Status.ILL_CONDITIONED, "memory": Status.OUT_OF_MEMORY, "time": Status.TIME_LIMIT}

MOST: Final = 4000
"""Largest number of contact coefficients, normal and tangential, for which dense matrices are made."""
SINGULAR: Final = 1e-11
"""Eigenvalue of a stiffness matrix, relative to the largest, below which the motion is rigid."""
_DEPENDENT = 1e-9  # relative singular value of rows that counts as zero
_DIGITS = 12  # digits of coordinates over the body's length by which coefficients are sorted: more are rounding


@dataclass(frozen=True, eq=False)
class CompanionContact(WithFields):
    """One contact in the displacement model; arrays over the n Bernstein coefficients of its trace, by x, then by y.

    A quantity at a coefficient is no value at a point: a displacement is the coefficient itself, a traction the mean
    weighted by B_i. Where supports prescribe a coefficient's displacement, the traction is the support's, and 0 here.
    """

    name: str
    """Name of the contact."""
    tangential_force: float
    """∫ ± σ_T ds, force on the body along the contact, signs as in `ContactLine` [stress × length]."""
    x: FloatArray
    y: FloatArray
    """Points of the coefficients, i/p along each edge [length], (n,) each."""
    weights: FloatArray
    """∫ B_i ds [length], (n,)."""
    normal_stress: FloatArray
    tangential_stress: FloatArray
    """Mean tractions [stress], signs as in `ContactLine`, the pressure of a fluid included, (n,) each."""
    friction_bound: FloatArray
    """Bound of |tangential_stress| [stress]; infinity if tied, (n,)."""
    gap: FloatArray
    """g − v_N ≥ 0 [length], (n,)."""
    slip: FloatArray
    """v_T − w [length], (n,)."""

    @property
    def normal_force(self) -> float:
        """−∫ σ_N ds, ≥ 0 if unilateral [stress × length]."""
        return -float(self.weights @ self.normal_stress)


@dataclass(frozen=True, eq=False)
class CompanionState(WithFields):
    """A displacement that meets all conditions, dimensionless."""

    contacts: Contacts  # the contacts; arrays over their n coefficients
    v: FloatArray  # (size,): unknowns of the body, then stretches of springs and motions of plates
    c: FloatArray  # (2 n,): relative displacements, normal ones first
    tractions: FloatArray  # (2 n,): τ
    live: BoolArray  # (2 n,): whether there is a force, see `DualProblem`; elsewhere τ is zero
    bound: FloatArray  # (n,): bound of |τ_T|
    load: FloatArray  # (size,): load vector, with forces on plates
    contradiction: str  # why v violates a condition after all; empty if it does not


@dataclass(frozen=True, eq=False, repr=False)
class CompanionResult(WithFields, PicklesFields):
    """A displacement model, solved or not: check `status`.

    Without a state (loads that cannot be carried, failed back end) fields, energies and forces raise `InputError`.
    """

    problem: ContactProblem
    scales: Scales
    body: Elasticity
    """The problem, the units of the dimensionless model, and the body in these units."""
    status: Status
    """How the solve ended; ``status.advice`` says what to do."""
    certificate: Certificate
    """Residuals of the contact problem in its forces."""
    message: str
    """One sentence about the outcome."""
    state: CompanionState | None
    """The displacement; None if the model was not solved."""
    reasons: tuple[str, ...]
    """Why the displacement or its energy is not admissible or exact. Empty if J(v) is a guaranteed upper bound, if data
    between the `SAMPLES` of every edge are the polynomials that they are there."""
    solution: QVISolution | None
    """The algebraic answer."""

    def __repr__(self) -> str:
        return f"<CompanionResult {self.message}>"

    @property
    def space(self) -> DisplacementSpace:
        """The displacement space, dimensionless."""
        return self.body.space

    @property
    def degree(self) -> int:
        """Degree p of the displacements."""
        return self.space.degree

    @property
    def unknowns(self) -> int:
        """Number of displacement unknowns, prescribed ones included."""
        return self.space.size

    @property
    def has_state(self) -> bool:
        """Whether there is a displacement to evaluate."""
        return self.state is not None

    def displacement(self, x: ArrayLike, y: ArrayLike) -> FloatArray:
        """Displacement (u_x, u_y) at points of the body, (...) to (..., 2) [length]; on joints the mean of all sides.

        `InputError` if a point lies outside the body.
        """
        return self._mean(x, y, self.displacement_in)

    def stress(self, x: ArrayLike, y: ArrayLike) -> FloatArray:
        """Stress (σ_xx, σ_yy, σ_xy) = C (ε − ε⁰) at points, (...) to (..., 3) [stress]; on edges the mean of cells."""
        stress = self._mean(x, y, lambda cells, t: self.body.stress(self._v, cells, self.space.own(cells, t)))
        return stress * self.scales.stress

    def cell_strain(self, t: ArrayLike, v: FloatArray | None = None) -> FloatArray:
        """Strains (ε_xx, ε_yy, 2ε_xy) at reference points t (k, 2) of every cell of the mesh, (cells, k, 3).

        t are barycentric coordinates of the second and third corner. v (size,) is a displacement, by default its own.
        """
        own = self.space.own(slice(None), np.asarray(t, dtype=float))
        strain = self.body.strain(self._v if v is None else v, slice(None), own)
        return np.asarray(strain * (self.scales.displacement / self.scales.length))

    def displacement_in(self, cells: IntArray | slice, t: FloatArray) -> FloatArray:
        """Displacements (n, k, 2) at reference points, (k, 2) or (n, k, 2), of cells with numbers (n,) [length]."""
        local = self._v.reshape(-1, 2)[self.space.table[cells]]
        shape = self.space.cell.values(self.space.own(cells, t))
        return np.asarray(shape @ local * self.scales.displacement)

    def trace(self, name: str, t: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """v_N and v_T at points t (k,), 0 to 1, of a contact's edges, (edges, k) each [length].

        Edges are in the order of ``problem.mesh.edges(contact.edges)``, t runs along their tangents. On a joint the
        values are jumps, on a rigid plate relative to the plate, with springs without the stretch of the springs.
        """
        return self.along(name, self._state.c, t)

    def stretch(self, name: str, t: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Stretch of the springs along a contact, in the form of `trace`; 0 without springs."""
        return self.along(name, self._state.contacts.stretched(self._state.v), t)

    def along(self, name: str, coefficients: FloatArray, t: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Values on the edges of a contact, in the form of `trace`, from dimensionless coefficients (2 n,)."""
        traces = {trace.name: trace for trace in self._state.contacts.traces}
        trace = traces[known_name("name", name, {"contacts": list(traces)})]
        shape = bernstein_basis(self.degree, np.atleast_1d(np.asarray(t, dtype=float))) * self.scales.displacement
        normal, tangential = trace.on_edges(*coefficients.reshape(2, -1)[:, trace.here])
        return normal @ shape.T, tangential @ shape.T

    @cached_property
    def parts(self) -> dict[str, float]:
        """Parts of the energy J(v) = strain − load + friction [stress × length²].

        "strain" is ½ ∫ (ε − ε⁰):C:(ε − ε⁰), with the energy of springs; "load" is ∫ b·v + ∫_{Γσ} T·v + Σ F·q, with the
        motions q of plates under the forces F; "friction" is Σ ∫ s |v_T − w| ds ≥ 0 for given bounds, and Σ W_i s_i
        |c_i − w_i|, which is no less, under the contacts' own laws.
        """
        state, friction = self._state, 0.0
        for trace in state.contacts.traces:
            slip = self._beyond[1, trace.here]
            if trace.contact.law == "tied":
                continue
            if trace.bound is None:
                friction += float(np.sum(trace.weights * state.bound[trace.here] * np.abs(slip)))
            else:
                along = trace.on_edges(slip, slip)[1]
                friction += float(trace.lengths @ absolute_integrals(trace.bound, along))
        parts = {"strain": self.body.energy(state.v), "load": float(state.load @ state.v), "friction": friction}
        return {name: part * self.scales.energy for name, part in parts.items()}

    @property
    def energy(self) -> float:
        """J(v) for the bound s that was used [stress × length²]: an upper bound if `reasons` is empty."""
        return self.parts["strain"] - self.parts["load"] + self.parts["friction"]

    @cached_property
    def contacts(self) -> Mapping[str, CompanionContact]:
        """Results on each contact by name, arrays in order along its line."""
        state, scales, contacts = self._state, self.scales, dict[str, CompanionContact]()
        normal, tangential = state.tractions.reshape(2, -1)
        fluid = np.where(state.live, state.contacts.fluid / state.contacts.weights, 0.0)
        normal = normal - fluid[: state.contacts.count]
        for trace in state.contacts.traces:
            x, y = (self.problem.mesh.origin + scales.length * trace.places).T
            stresses = (scales.stress * part[trace.here] for part in (normal, tangential, state.bound))
            displacements = (scales.displacement * part[trace.here] for part in (-self._beyond[0], self._beyond[1]))
            arrays = (x, y, trace.weights * scales.length, *stresses, *displacements)
            order = np.lexsort(np.round(trace.places, _DIGITS).T[::-1])
            force = scales.stress * scales.length * float(trace.weights @ (trace.senses * tangential[trace.here]))
            contacts[trace.name] = CompanionContact(trace.name, force, *(part[order] for part in arrays))
        return MappingProxyType(contacts)

    @cached_property
    def plates(self) -> Mapping[str, RigidMotion]:
        """Motions of rigid plates and their given forces, by the names of their contacts."""
        scales, contacts, motions_of = self.scales, self._state.contacts, dict[str, dict[str, float]]()
        motions = self._state.v[len(self._state.v) - len(contacts.driven) :] * scales.displacement
        for (name, part), value in zip(contacts.driven, motions.tolist(), strict=True):
            motions_of.setdefault(name, {})[part] = value / (scales.length if part == "moment" else 1.0)
        return plate_motions(self.problem, motions_of)

    @property
    def _state(self) -> CompanionState:
        if self.state is None:
            raise InputError("companion", self.status.value, f"there is no displacement to evaluate: {self.message}")
        return self.state

    @property
    def _beyond(self) -> FloatArray:
        """C less g and w (2, n)."""
        return (self._state.c - self._state.contacts.obstacle).reshape(2, -1)

    @property
    def _v(self) -> FloatArray:
        return self._state.v[: self.space.size]

    def _mean(self, x: ArrayLike, y: ArrayLike, values: Callable[[IntArray, FloatArray], FloatArray]) -> FloatArray:
        """The mean of the values in all cells that hold a point."""
        _ = self._state  # raises if there is none
        return mean_at(
            self.problem.mesh, x, y, lambda cell, t: values(cell, np.clip(t[..., 1:], 0.0, 1.0))[:, 0], "x, y"
        )


def solve_companion(
    problem: ContactProblem,
    *,
    degree: int | None = None,
    tolerance: float = 1e-8,
    time_limit: float | None = None,
    verbose: bool = False,
) -> CompanionResult:
    """Displacements of a contact problem, by conforming elements P_p on its mesh.

    Minimises, over the displacements v of degree p that meet supports and contacts on whole edges,

        J(v) = ½ ∫ (ε − ε⁰):C:(ε − ε⁰) − ∫ b·v − ∫_{Γσ} T·v + Σ ∫ s |v_T − w| − Σ F·q,
        v_N ≤ g  (= g, and v_T = w where tied)

    with q the motions of plates under F, relative to which v_N and v_T count on their contacts; a fluid in a contact
    adds ∫ p_w v_N; ε⁰ is an initial strain. Springs along a contact add ½ ∫ k d² for their stretches d, and v − d takes
    the place of v in the conditions of the contact. Contacts have their own laws, with the pressure of this model's
    contact forces. J(v) is an upper bound of the exact minimum for the same s.

    Parameters
    ----------
    problem : ContactProblem
        The problem.
    degree : int, optional
        p: 1 to 5, 3 by default.
    tolerance : float
        Accuracy that the certificate of the contact forces must confirm.
    time_limit : float, optional
        Seconds for the contact forces.
    verbose : bool
        Print a header, a line per iteration, and a footer with status and times.

    Raises
    ------
    InputError
        If the problem or an argument is wrong, or loads on a body that nothing holds are out of balance. A failure to
        solve does not raise: check `status`.

    """
    cell = checked(problem, degree, tolerance)
    with deadline(time_limit), Log(f"qvi_contact {__version__}: solve_companion", verbose) as log:
        log.begin({"cells": problem.mesh.cell_count, "degree": cell.degree, "tolerance": f"{tolerance:g}"})
        (found,) = solve_companions(problem, [None], degree=degree, tolerance=tolerance)
        timings = {} if found.solution is None else found.solution.timings
        log.end(str(found.status), found.message, timings, found.status is Status.SOLVED)
    return found


def checked(problem: ContactProblem, degree: int | None, tolerance: float) -> Triangle:
    """The element of the degree; `InputError` if the problem or an argument is not one the model takes."""
    if not isinstance(problem, ContactProblem):
        raise InputError("problem", problem, "give a ContactProblem")
    cell = triangle(degree)
    fraction("tolerance", tolerance)
    # an incompressible material has no stiffness: displacements would have to keep every area
    if any(problem.materials[number].incompressible for number in np.unique(problem.cell_materials)):
        remedy = "the displacement model, and the bracket that needs it, have no displacements for incompressible "
        remedy += "materials: take a number below 0.5, or judge the result by its certificate and a finer mesh"
        raise InputError("Material.poisson", 0.5, remedy)
    return cell


def solve_companions(
    problem: ContactProblem,
    laws: Sequence[Mapping[str, FloatArray] | None],
    *,
    degree: int | None = None,
    tolerance: float = 1e-8,
    slip_directions: Sequence[Mapping[str, FloatArray]] = (),
) -> tuple[CompanionResult, ...]:
    """Displacements under several friction laws with one factorisation: None for the contacts' own, or bounds s ≥ 0.

    Bounds are Bernstein coefficients (edges, q) [stress] by contact that is not tied, along the tangents of edges in
    the order of the mesh; the energy then has ∫ s |v_T − w| itself. `slip_directions` has an entry for each law: by
    contact (edges,) 1 or −1 where displacements may slip along the tangent or against it, NaN where both, else 0.
    """
    pairs = zip(laws, slip_directions or [{}] * len(laws), strict=True)
    body, held, contact_sets = _discretized(problem, checked(problem, degree, tolerance), pairs)
    scales, results = Scales.of(problem), list[CompanionResult]()
    external_load, remarks = load_vector(problem, body, scales)
    with limited_blas(1):
        try:
            load = external_load + body.initial_load + contact_sets[0].loads
            condensed = CondensedBody.of(body, load, held, contact_sets[0].rows)
            duals = [dual_problem(each, condensed) for each in contact_sets]
        except (FactorisationError, MemoryError, np.linalg.LinAlgError) as error:
            known = "memory" if isinstance(error, MemoryError) else "singular"
            status = _FAILURES.get(getattr(error, "reason", known), Status.BACKEND_FAILED)
            message = f"{status}: {error or 'out of memory'}"
            failure = status, Certificate(dict.fromkeys(EXPONENTS, np.inf), tolerance), message, None, (message,), None
            return (CompanionResult(problem, scales, body, *failure),) * len(laws)
        for dual in duals:
            solution, contacts, state = dual.solved(tolerance), dual.contacts, None
            reasons = tuple(dict.fromkeys((*held.reasons, *remarks, *contacts.reasons)))
            if solution.status is not Status.INFEASIBLE and np.isfinite(solution.z).all():
                bound = np.full(contacts.count, np.inf)
                bound[~contacts.tied] = dual.qvi.threshold(np.abs(dual.qvi.normal(solution.z)))
                v, c, wrong = admissible(dual, dual.displacements(solution), solution.z, bound)
                tractions = np.where(dual.live, solution.z, 0.0)
                reasons += (wrong,) if wrong else ()
                wrong = " ".join(filter(None, (*held.jumps, wrong)))
                state = CompanionState(contacts, v, c, tractions, dual.live, bound, load - body.initial_load, wrong)
            outcome = solution.status, solution.certificate, solution.message, state, reasons, solution
            results.append(CompanionResult(problem, scales, body, *outcome))
    return tuple(results)


def _discretized(
    problem: ContactProblem, cell: Triangle,
    laws: Iterable[tuple[Mapping[str, FloatArray] | None, Mapping[str, FloatArray]]] = ((None, MappingProxyType({})),),
) -> tuple[Elasticity, PrescribedDisplacements, list[Contacts]]:  # fmt: skip
    """The body with springs and plates, its supports, and its contacts under several laws and directions of slip."""
    scales = Scales.of(problem)
    space = DisplacementSpace.of(problem, cell)
    contacts = [Contacts.of(problem, space, scales, *law) for law in laws]
    at_rest = partial(scaled_stress_at_rest, problem, scales) if is_strained(problem) else None
    moduli = np.asarray(np.linalg.inv(problem.compliances / scales.compliance), dtype=np.float64)  # C = c⁻¹
    return Elasticity(space, moduli, at_rest, contacts[0].beside), supports(problem, space, scales), contacts


def prescribed_slip(problem: ContactProblem) -> dict[str, FloatArray]:
    """By contact (e,), the sign ±1 of v_T − w that supports prescribe at an end of the edge or both; else 0."""
    body, held, (contacts,) = _discretized(problem, triangle(1))
    B, start = held.beside(body.size - body.space.size)
    fixed = abs(contacts.rows @ B).sum(axis=1) <= PARALLEL
    slip = np.where(fixed, contacts.rows @ start - contacts.moved - contacts.obstacle, 0.0)[contacts.count :]
    slip = np.where(np.abs(slip) > VIOLATED * max(1.0, float(np.abs(start).max(initial=0.0))), np.sign(slip), 0.0)
    ends = ((trace.name, trace.on_edges(slip[trace.here], slip[trace.here])[1]) for trace in contacts.traces)
    return {name: np.sign(along.sum(axis=1)) for name, along in ends}


@dataclass(frozen=True, eq=False)
class BodyAtRest:
    """Displacements that vanish where displacements are prescribed, and motions of plates that forces drive."""

    contacts: Contacts  # the contacts, n coefficients
    body: CondensedBody
    B: FloatArray  # (2 n, k): c from w_Γ: of the body, less springs and plates, normal ones first
    live: BoolArray  # (2 n,): where c can change

    @classmethod
    def of(cls, problem: ContactProblem, degree: int) -> BodyAtRest:
        """Displacements of a degree on the mesh; `FactorisationError` if K cannot be factorised."""
        body_at_rest, supports_at_rest, (contacts,) = _discretized(problem, triangle(degree))
        supports_at_rest = replace(supports_at_rest, particular=0.0 * supports_at_rest.particular)
        with limited_blas(1):
            body = CondensedBody.of(body_at_rest, np.zeros(body_at_rest.size), supports_at_rest, contacts.rows)
        B = (contacts.rows @ body.B)[:, body.interface].toarray()
        live = np.abs(B[:, : B.shape[1] - len(contacts.driven)]).sum(axis=1) > PARALLEL
        B[~live] = 0.0
        return cls(contacts, body, B, np.asarray(live))


def least_energy(stiffness: FloatArray, given: FloatArray, zero: FloatArray) -> FloatArray:
    """E with E x·x = min S w·w over w (k,) with given · w = x and zero · w = 0, for the stiffness S (k, k)."""
    diagonal = np.diag(stiffness)
    units = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))  # of w: springs may be far stiffer than the body
    stiffness = units[:, None] * stiffness * units
    particular, free = solutions(np.vstack([given, zero]) * units)
    P = particular[:, : len(given)]
    energy, free_stiffness = P.T @ stiffness @ P, free.T @ stiffness @ free
    if len(free_stiffness):  # rigid motions are left out: they make the matrix singular
        values, vectors = np.linalg.eigh((free_stiffness + free_stiffness.T) / 2.0)
        has_energy = values > SINGULAR * values[-1]
        cross = vectors[:, has_energy].T @ (free.T @ stiffness @ P)
        energy = energy - cross.T @ (cross / values[has_energy, None])
    return np.asarray((energy + energy.T) / 2.0)


def solutions(rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """P (k, r) and Z (k, k − rank): the solutions of rows · w = d are P d + Z y, in least squares if none is exact."""
    U, values, V = np.linalg.svd(rows, full_matrices=True)
    rank = int((values > _DEPENDENT * max(float(values.max(initial=0.0)), 1e-300)).sum())
    return (V[:rank].T / values[:rank]) @ U[:, :rank].T, V[rank:].T
