"""Solve the displacement model: assemble, condense, solve for the contact forces, return to displacements."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import zip_longest
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray
from qvi_contact.companion.body import PARALLEL, CondensedBody, Elasticity, Supports, load_vector, supports
from qvi_contact.companion.contact import Contacts, DualProblem, admissible, dual_problem
from qvi_contact.companion.result import CompanionResult, CompanionState
from qvi_contact.companion.space import DisplacementSpace, Triangle, triangle
from qvi_contact.discretization.loads import scaled_stress_at_rest
from qvi_contact.discretization.scaling import Scales
from qvi_contact.errors import InputError
from qvi_contact.problem.material import is_strained
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.version import __version__
from solvers import Certificate, Iteration, QVISolution, Status, solve_qvi
from solvers.basics.progress import Log
from solvers.certificate.certificate import EXPONENTS
from solvers.factorisation import FactorisationError
from solvers.factorisation.base import limited_blas

_FAILURES = {"singular": Status.ILL_CONDITIONED, "memory": Status.OUT_OF_MEMORY, "time": Status.TIME_LIMIT}

MOST: Final = 4000
"""Contact coefficients, normal and tangential ones, for which dense matrices of them are made."""
SINGULAR: Final = 1e-11
"""Eigenvalue of a stiffness matrix, relative, that is a rigid motion's."""
_DEPENDENT = 1e-9  # singular value of rows, relative, that counts as zero


def solve_companion(
    problem: ContactProblem,
    *,
    degree: int | None = None,
    tolerance: float = 1e-8,
    time_limit: float | None = None,
    max_iterations: int | None = None,
    callback: Callable[[Iteration], object] | None = None,
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
    max_iterations, callback
        Iterations for the contact forces at most, and who is called with each, as for `solve`.
    verbose : bool
        Print a header, a line an iteration, and a footer with status and times.

    Returns
    -------
    CompanionResult
        With a status; a failure to solve does not raise.

    Raises
    ------
    InputError
        If the problem or an argument is wrong, or loads on a body that nothing holds are out of balance.

    Notes
    -----
    ∫ s |v_T − w| is bounded from above by Σ |c_i − w_i| ∫ s B_i, in which s is bounded from above by the smaller of the
    means of c and t_max. The laws hold for the coefficients' forces ∫ σ B_i, not for stresses at points.

    Data given as functions are looked at in 99 points of every edge (`bernstein.SAMPLES`), a body potential in those of
    two quadratures. `CompanionResult.reasons` names those that are no polynomials there; what happens between these
    points cannot be seen.

    """
    cell = _checked(problem, degree, tolerance)
    options: dict[str, Any] = {"callback": callback, "time_limit": time_limit}
    if max_iterations is not None:
        options["max_iterations"] = max_iterations
    with Log(f"qvi_contact {__version__}: solve_companion", verbose) as log:
        log.begin({"cells": problem.mesh.cell_count, "degree": cell.degree, "tolerance": f"{tolerance:g}"})
        found = solve_companions(problem, [None], degree=degree, tolerance=tolerance, **options)[0]
        timings = {} if found.solution is None else found.solution.timings
        log.end(str(found.status), found.message, timings, found.status is Status.SOLVED)
    return found


def solve_companions(
    problem: ContactProblem,
    laws: Sequence[Mapping[str, FloatArray] | None],
    *,
    degree: int | None = None,
    tolerance: float = 1e-8,
    slip_directions: Sequence[Mapping[str, FloatArray]] = (),
    **options: Any,
) -> tuple[CompanionResult, ...]:
    """The same under several friction laws with one factorisation: None for the contacts' own, or given bounds s ≥ 0.

    These are Bernstein coefficients (edges, q) [stress] for every contact that is not tied, along the tangents of edges
    in the order of the mesh; the energy then has ∫ s |v_T − w| itself. Options are those of `solve_qvi`. On contacts
    named in the law's entry of `slip_directions` displacements slip along the tangent of an edge where that says 1,
    against it where −1, and not at all where 0.
    """
    cell = _checked(problem, degree, tolerance)
    model = _Model.of(problem, cell)
    nothing = MappingProxyType[str, FloatArray]({})
    both = zip_longest(laws, slip_directions, fillvalue=nothing)
    contacts = [Contacts.of(problem, model.body.space, model.scales, law, slips) for law, slips in both]
    with limited_blas(1):
        try:
            load, size = model.load + model.body.initial_load, model.body.space.size
            load[:size] -= contacts[0].rows[:, :size].T @ contacts[0].fluid  # on the body, not on its springs
            condensed = CondensedBody.of(model.body, load, model.held, contacts[0].rows)
            duals = [dual_problem(each, condensed) for each in contacts]
        except (FactorisationError, MemoryError) as error:
            return tuple(model.failed(error, tolerance) for _ in laws)
        solutions = [solve_qvi(dual.qvi, tolerance=tolerance, **options) for dual in duals]
        return tuple(model.result(dual, solution) for dual, solution in zip(duals, solutions, strict=True))


def _checked(problem: ContactProblem, degree: int | None, tolerance: float) -> Triangle:
    """The element, if arguments and problem are what the model takes."""
    if not isinstance(problem, ContactProblem):
        raise InputError("problem", problem, "give a ContactProblem")
    cell = triangle(degree)
    if isinstance(tolerance, bool) or not (isinstance(tolerance, (int, float)) and 0.0 < tolerance < 1.0):
        raise InputError("tolerance", tolerance, "give a number between 0 and 1")
    check_scope(problem)
    return cell


def check_scope(problem: ContactProblem) -> None:
    """`InputError` for a problem that displacements of this room do not model.

    An incompressible material has no stiffness: displacements would have to keep every area.
    """
    if any(problem.materials[number].incompressible for number in np.unique(problem.cell_materials)):
        remedy = (
            "the displacement companion, and the bracket that needs it, have no displacements for incompressible "
            "materials: take a number below 0.5, or leave them out, and judge the result by its certificate and a "
            "finer mesh"
        )
        raise InputError("Material.poisson", 0.5, remedy)


@dataclass(frozen=True, eq=False)
class _Model:
    """A problem on its elements, its contacts' laws left open."""

    problem: ContactProblem
    scales: Scales
    body: Elasticity
    held: Supports
    load: FloatArray
    remarks: tuple[str, ...]

    @classmethod
    def of(cls, problem: ContactProblem, cell: Triangle) -> _Model:
        """Loads and supports."""
        scales = Scales.of(problem)
        space = DisplacementSpace.of(problem, cell, scales.length)
        at_rest = partial(scaled_stress_at_rest, problem, scales) if is_strained(problem) else None
        body, held = Elasticity(space, moduli(problem, scales), at_rest), supports(problem, space, scales)
        if any(contact.has_springs for contact in problem.contacts):
            springs = Contacts.of(problem, space, scales).springs
            body, held = replace(body, springs=springs), held.with_springs(springs.shape[0])
        return cls(problem, scales, body, held, *load_vector(problem, body, scales))

    def result(self, dual: DualProblem, solution: QVISolution) -> CompanionResult:
        """What a solution of the contact problem says."""
        state, contacts = None, dual.contacts
        reasons = self.held.reasons + self.remarks + contacts.reasons
        if solution.status is not Status.INFEASIBLE and np.isfinite(solution.z).all():
            bound = np.full(contacts.count, np.inf)
            bound[dual.limited] = dual.qvi.threshold(np.abs(dual.qvi.normal(solution.z)))
            values, plates = dual.displacements(solution)
            v, c, wrong = admissible(dual, values, plates, solution.z, bound)
            tractions, load = np.where(dual.live, solution.z, 0.0), dual.body.load - dual.body.body.initial_load
            state = CompanionState(contacts, v, c, plates, tractions, dual.live, bound, load, wrong)
            reasons += (wrong,) if wrong else ()
        known = solution.status, solution.certificate, solution.message
        return CompanionResult(self.problem, self.scales, self.body, *known, state, reasons, solution)

    def failed(self, error: FactorisationError | MemoryError, tolerance: float) -> CompanionResult:
        """Where the body could not be condensed."""
        reason = error.reason if isinstance(error, FactorisationError) else "memory"
        status = _FAILURES.get(reason, Status.BACKEND_FAILED)
        certificate = Certificate(dict.fromkeys(EXPONENTS, np.inf), tolerance)
        message = f"{status}: {error or 'out of memory'}"
        known = status, certificate, message
        return CompanionResult(self.problem, self.scales, self.body, *known, None, (message,), None)


def moduli(problem: ContactProblem, scales: Scales) -> FloatArray:
    """C = c⁻¹ of every cell, dimensionless, (cells, 3, 3)."""
    return np.asarray(np.linalg.inv(problem.compliances / scales.compliance), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class BodyAtRest:
    """Displacements v that vanish where displacements are prescribed, and motions of plates that forces drive."""

    contacts: Contacts  # the contacts, n coefficients
    body: CondensedBody
    B: FloatArray  # (2 n, k + q): c, what the body moves beyond the plates, normal ones first, from w_Γ and the motions
    S: FloatArray  # (k + q, k + q): the energy of both, ½ wᵀS w
    live: BoolArray  # (2 n,): where c can change

    @classmethod
    def of(cls, problem: ContactProblem, degree: int) -> BodyAtRest:
        """Displacements of a degree on the mesh of a problem.

        Raises
        ------
        InputError
            If the problem or the degree is wrong.
        FactorisationError
            If the stiffness matrix cannot be factorised.

        """
        model = _Model.of(problem, triangle(degree))
        contacts = Contacts.of(problem, model.body.space, model.scales)
        held = replace(model.held, values=np.zeros_like(model.held.values))
        with limited_blas(1):
            body = CondensedBody.of(model.body, np.zeros_like(model.load), held, contacts.rows)
        moved, driven = (contacts.rows @ body.supports.axes)[:, body.interface].toarray(), contacts.motions
        B = np.hstack([moved, -driven])
        live = np.abs(moved).sum(axis=1) > PARALLEL
        B[~live] = 0.0
        S = np.zeros((B.shape[1],) * 2)
        S[: moved.shape[1], : moved.shape[1]] = body.S
        return cls(contacts, body, B, S, np.asarray(live))

    def expand(self, w: FloatArray) -> tuple[FloatArray, FloatArray]:
        """V (size,) and the motions (q,) from w_Γ and these."""
        values, motions = np.split(w, [self.body.S.shape[0]])
        return self.body.expand(values), motions

    def least_energy(self, given: BoolArray, zero: BoolArray) -> FloatArray:
        """E with E x·x = min a(v, v) over v whose coefficients are x where `given`, and 0 where `zero`."""
        rows = np.vstack([self.B[given], self.B[zero & self.live]])
        particular, free = solutions(rows)
        count = int(given.sum())
        P, S = particular[:, :count], self.S
        found, left = P.T @ S @ P, free.T @ S @ free
        if len(left):  # without rigid motions, which make it singular
            values, vectors = np.linalg.eigh((left + left.T) / 2.0)
            kept = values > SINGULAR * values[-1]
            cross = vectors[:, kept].T @ (free.T @ S @ P)
            found = found - cross.T @ (cross / values[kept, None])
        return np.asarray((found + found.T) / 2.0)


def solutions(rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """P (k, r) and Z (k, k − rank): all solutions of rows · w = d are P d + Z y, of the least squares if they clash."""
    U, values, V = np.linalg.svd(rows, full_matrices=True)
    rank = int((values > _DEPENDENT * max(float(values.max(initial=0.0)), 1e-300)).sum())
    return (V[:rank].T / values[:rank]) @ U[:, :rank].T, V[rank:].T
