"""Bounds of the energy of a contact problem, from its stress and a displacement computed beside it.

In `docs/theory.md`: (D19), (D20).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from qvi_contact.basics.checks import finite_number
from qvi_contact.bracket.admissible import LOOSEST, AdmissibleStress, admissible_stress
from qvi_contact.bracket.coulomb import CoulombBounds, coulomb_bounds
from qvi_contact.bracket.data import data_reasons
from qvi_contact.bracket.forces import force_bounds, force_differences
from qvi_contact.bracket.friction_norm import UNHELD, computed_norm
from qvi_contact.bracket.given import GivenProblem, given_problem, posed_strictly
from qvi_contact.bracket.law import contact_tractions, law_bound, traction_coefficients
from qvi_contact.bracket.outcome import Bracket, BracketKind, EdgeParts
from qvi_contact.bracket.parts import CellFields, bulk, by_cell, edge_parts, strain_energy
from qvi_contact.bracket.share import SharedStress, outside_scope, with_shares
from qvi_contact.companion import CompanionResult, solve_companions
from qvi_contact.companion.solver import check_scope
from qvi_contact.companion.triangle import degree_beside, triangle
from qvi_contact.errors import InputError
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.work import allowed_misfit, fluid_work, obstacle_work, rest_on_arcs, support_work
from qvi_contact.version import __version__
from solvers import Iteration, solve_qvi
from solvers.basics.progress import narrated, watched
from solvers.factorisation import FactorisationError
from solvers.solve import check_settings

_BALANCE = 1e-8  # difference of gap and parts, relative to the energies, that is rounding
_CROSSED = 1e-9  # of the strain energy: lower − upper that is more than rounding
_OUTWARD = 2.0  # safety of the work of violations that are left: v stands for u


def bracket(
    result: ContactResult,
    degree: int | None = None,
    tolerance: float = 1e-8,
    *,
    time_limit: float | None = None,
    max_iterations: int | None = None,
    callback: Callable[[Iteration], object] | None = None,
    verbose: bool = False,
) -> Bracket:
    """Bounds of the energy of the problem that a result belongs to, and an error indicator for each cell.

    With the compliance c, the stiffness C, a friction bound s on the contacts and

        J(v)  = ½ ∫ ε(v) : C : ε(v) − ∫ b·v − ∫_{Γ_σ} T·v + ∫_{Γ_μ} s |v_T − w|,      v_N ≤ g,  v = U on Γ_u,
        J*(τ) = ½ ∫ τ : c : τ − ∫_{Γ_u} U·τn − ∫_{Γ_μ} (g τ_N + w τ_T),                τ in K(s) of (D1),

    −J*(τ) ≤ J(u) ≤ J(v) for the solution u of the problem with that bound, and

        J(v) + J*(τ) ≥ ½ ∫ ε(u − v) : C : ε(u − v) + ½ ∫ (σ − τ) : c : (σ − τ).

    The stress τ is that of the result, if it obeys the contact law on whole edges, else it is computed anew for the
    same bound; v are displacement elements on the same mesh (`solve_companion`). Which problem is bracketed says
    `Bracket.kind`: for laws without Coulomb friction the one stated; else s = μ|σ_N| is held fixed, and the gap is an
    indicator, as it is without the part that comes from s itself. `Bracket.outer` measures it, and
    `Bracket.force_differences` shows what it does to forces. The errors under Coulomb's law itself are bounded by
    `Bracket.coulomb`.

    Parameters
    ----------
    result : ContactResult
        A result with a stress state, from any method, collocated or strict.
    degree : int, optional
        Of the displacement elements, see `solve_companion`; by default that of Φ, at most 5.
    tolerance : float
        Of the two solves, at most 1e-6. A stress that violates the contact law by less, relative to the largest
        stress, counts as admissible; what that may cost is estimated and taken off the lower bound (`Bracket.slack`).
    time_limit : float, optional
        Seconds for the two solves together; a bound that is not found in time is infinite.
    max_iterations, callback
        Iterations of each solve at most, and who is called with each iteration, as for `solve`.
    verbose : bool
        Print a header, a line for each iteration of the solves, and a footer with what is bounded and the time.

    Returns
    -------
    Bracket
        A bound that cannot be computed is infinite, with the reason.

    Raises
    ------
    InputError
        If there is no stress state, an argument is wrong, the result belongs to a step of a history, or a
        fluid presses in a contact.

    Notes
    -----
    Theory: W. Prager, J. L. Synge, Approximations in elasticity based on the concept of function space, Quart. Appl.
    Math. 5 (1947); P. Ladevèze, D. Leguillon, Error estimate procedure in the finite element method and applications,
    SIAM J. Numer. Anal. 20 (1983). Integrals are by Gauss quadrature, exact for polynomial data, the friction work by
    pieces between the zeros of the slip. "Guaranteed" holds up to rounding and the tolerance, and as far as the points
    show at which data given as functions are looked at (`bracket.data`).

    """
    if not isinstance(result, ContactResult):
        raise InputError("result", result, "give a ContactResult")
    if not 0.0 < finite_number("tolerance", tolerance) <= LOOSEST:
        raise InputError("tolerance", tolerance, f"give a number above 0, at most {LOOSEST:g}")
    check_scope(result.problem)
    degree = triangle(degree_beside(result.discretization.space.degree) if degree is None else degree).degree
    options: dict[str, Any] = {"callback": callback}
    if max_iterations is not None:
        options["max_iterations"] = max_iterations
    check_settings(options)
    given = given_problem(result)
    with watched(time_limit), narrated(f"qvi_contact {__version__}: bracket", verbose) as story:
        story.begin({"what": given.kind.value, "degree": degree, "tolerance": f"{tolerance:g}"})
        stress = admissible_stress(given, result, tolerance, **options)
        rough = given.kind is BracketKind.GIVEN_BOUND
        before = _obeying(result, tolerance, **options) if rough else None
        shared = with_shares(before) if isinstance(before, ContactResult) else before
        shares = shared.shares if isinstance(shared, SharedStress) else {}
        senses = {name: share.slipping for name, share in shares.items()}
        problem, laws = given.discretization.problem, [given.bounds, None, given.bounds] if rough else [given.bounds]
        companions = solve_companions(
            problem, laws, degree=degree, tolerance=tolerance, senses=({}, {}, senses)[: len(laws)], **options
        )
        found = _assemble(given, stress, companions[0])
        if shared is not None:
            reasons = dict.fromkeys((*found.reasons[len(given.reasons) :], *companions[2].reasons))
            bounds = _coulomb(shared, before, companions[2], tuple(reasons))
            found = replace(found, coulomb_reason=bounds) if isinstance(bounds, str) else replace(found, coulomb=bounds)
        if len(companions) > 1:
            own = companions[1]
            found = replace(found, own=own, force_differences=force_differences(result, own) if own.has_state else {})
        bounded = math.isfinite(found.gap)
        story.end("bounded" if bounded else "no bound", found.message, {}, bounded)
    return found


def _obeying(result: ContactResult, tolerance: float, **options: Any) -> ContactResult | str:
    """A stress that obeys Coulomb's law on whole edges, or why nothing is known of its errors."""
    reason, known = outside_scope(result.problem), result.discretization
    if reason or known.rule.kind == "bernstein":
        return reason or result
    strict = posed_strictly(known, known.problem)
    solution = solve_qvi(strict.qvi, tolerance=tolerance, **options)
    found = ContactResult(strict, solution)
    missing = f"No stress that obeys the contact law on whole edges was found: {solution.message}"
    return found if found.has_state else missing


def _coulomb(
    shared: SharedStress | str, before: ContactResult | str | None, companion: CompanionResult, reasons: tuple[str, ...]
) -> CoulombBounds | str:
    """The bounds under Coulomb's law, or why there are none."""
    if not isinstance(before, ContactResult):
        return str(before)
    if not companion.has_state:
        return "No admissible displacement was found."
    try:
        if isinstance(shared, str):  # a body that friction alone holds is the usual cause
            return shared if np.isfinite(computed_norm(before.problem, {})) else UNHELD
        assert shared is not None
        return coulomb_bounds(shared, companion, before, reasons)
    except (FactorisationError, MemoryError) as error:
        return f"The norm of friction was not computed: {error or 'out of memory'}."


@dataclass(frozen=True, eq=False)
class _Edges:
    """What the contacts contribute: parts by contact, work of violations, and of the bound's own error."""

    parts: Mapping[str, EdgeParts]
    slack: float
    outer: float


def _assemble(given: GivenProblem, stress: AdmissibleStress, companion: CompanionResult) -> Bracket:
    """Energies, parts, reasons."""
    discretization, u = given.discretization, stress.result.dofs
    problem, mesh = discretization.problem, discretization.problem.mesh
    fields = CellFields.of(discretization, u, companion.degree)
    strain = strain_energy(fields, problem.compliances)
    complementary = strain - support_work(discretization, u) - obstacle_work(discretization, u)
    complementary -= fluid_work(discretization)
    inside = np.zeros(mesh.cell_count)
    moved = companion.has_state
    edges = _Edges({}, 0.0, 0.0)
    if moved:
        inside = bulk(fields, problem.compliances, companion.cell_strain(*fields.t[:, -2:].T))
        edges = _edges(given, stress, companion)
    lower = -complementary - edges.slack if stress.found else -np.inf
    upper = companion.energy if moved else np.inf
    parts = by_cell(discretization, inside, edges.parts)
    total = float(parts.sum())
    balance = abs(upper + complementary - total) / max(strain, abs(complementary), 1e-300) if moved else 0.0
    frictionless = not given.threshold.any()
    return Bracket(
        problem,
        given.kind,
        _reasons(given, stress, companion, balance, (upper - lower) / max(strain, 1e-300)),
        lower,
        upper,
        strain,
        inside,
        edges.parts,
        parts,
        edges.outer if given.kind is BracketKind.GIVEN_BOUND else 0.0,
        edges.slack,
        force_bounds(discretization, frictionless, lower, upper),
        stress.result,
        companion,
        np.maximum(parts, 0.0),
    )


def _edges(given: GivenProblem, stress: AdmissibleStress, companion: CompanionResult) -> _Edges:
    """Contact and friction parts, contact by contact."""
    discretization, qvi = given.discretization, given.discretization.qvi
    if not qvi.m:
        return _Edges({}, 0.0, 0.0)
    unit = discretization.scales.stress
    at_points = contact_tractions(discretization, stress.result.dofs)
    normal, shear = (unit * part for part in traction_coefficients(discretization, at_points))
    bound, own = unit * given.threshold, unit * law_bound(discretization, at_points[0])[0]
    found, slack, outer = {}, 0.0, 0.0
    for rows in discretization.contacts:
        if rows.law == "tied":
            continue
        chosen = rows.edges
        arguments = discretization, rows, normal[chosen], shear[chosen], bound[chosen]
        found[rows.name], opening, slip = edge_parts(*arguments, companion)
        left = stress.pull[chosen] @ opening + stress.excess[chosen] @ slip
        slack += _OUTWARD * unit * float(left)
        outer += float(np.abs(own - bound)[chosen].max(axis=1) @ slip)
    return _Edges(found, slack, outer)


def _reasons(
    given: GivenProblem, stress: AdmissibleStress, companion: CompanionResult, balance: float, apart: float
) -> tuple[str, ...]:
    """Why the bounds are not guaranteed."""
    data = data_reasons(given.discretization, companion.degree)
    found = [*given.reasons, *data, *companion.reasons]
    if given.lowered and not data:
        found.append(
            "A friction bound is not a polynomial of the stress's degree on every edge. A lower one is used there."
        )
    if not stress.found:
        found.append(stress.message)
    if not companion.has_state:
        found.append(f"No admissible displacement was found: {companion.message}")
    misfit, unit = stress.result.traction_misfit, given.discretization.scales.stress
    curved = bool(given.discretization.problem.mesh.sides.any())
    if misfit > allowed_misfit(unit, stress.result.stress_rounding):
        found.append(f"Computed tractions differ from the prescribed ones by up to {misfit:.3g} [stress] at points.")
    elif balance > _BALANCE and not curved:
        found.append(f"The parts of the duality gap differ from the gap by {balance:.1e} of the energy.")
    if curved:
        rest = rest_on_arcs(given.discretization, stress.result.dofs)
        found.append(
            f"On arcs stress and displacement meet their conditions in the mean; the stress misses its tractions by up "
            f"to {rest:.2g} [stress] at points. The bounds hold up to the work of such differences, here {balance:.1e} "
            "of the energy."
        )
    if apart < -_CROSSED:
        found.append(f"The bounds contradict each other by {-apart:.1e} of the strain energy.")
    return tuple(found)
