"""The bracket: bounds of the energy of a contact problem, and of forces, from a stress and a displacement.

The bounds need the same data in both models. Data given as functions are evaluated at `SAMPLES` of every edge and at
169 points of every cell, and must be polynomials there.

In `docs/theory.md`: (D19), (D20), (D21).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, Final

import numpy as np

from qvi_contact import __version__
from qvi_contact.basics.checks import Field, FloatArray, evaluate, finite_number, instance_of
from qvi_contact.basics.schema import WithFields, keys_of
from qvi_contact.bracket.coulomb import CoulombBounds, coulomb_bounds, reference_energy
from qvi_contact.bracket.outcome import Bracket, BracketKind
from qvi_contact.bracket.parts import LOOSEST, Bounds, CellFields, EdgeParts, EdgeTractions, coefficients, edge_parts
from qvi_contact.bracket.share import SharedStress, with_bernstein_rows, with_numbers, with_shares
from qvi_contact.companion import CompanionResult, solve_companion, solve_companions
from qvi_contact.companion.model import checked
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.displacements import HIGHEST, PARALLEL, triangle
from qvi_contact.discretization.loads import is_polynomial, physical, scaled_stress_at_rest, spanned
from qvi_contact.element.edge import bernstein_basis
from qvi_contact.errors import InputError
from qvi_contact.mesh.edges import Edges
from qvi_contact.problem.conditions import DRIVES, SPRINGS, Contact, Displacement, Traction, components, has_coulomb
from qvi_contact.problem.material import is_strained, varies
from qvi_contact.problem.problem import by_cell, with_contacts
from qvi_contact.solution.contact_line import turning_senses
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.stress import allowed_misfit, rest_on_arcs
from solvers import Status, solve_qvi
from solvers.basics.progress import Log, deadline
from solvers.factorisation.base import FactorisationError
from solvers.solution import WHAT_TO_DO
from solvers.solve import followed_solutions, traction_difference

_AT_ONCE: Final = 1000  # points whose distances to all edges are computed at once, to limit memory


@dataclass(frozen=True, eq=False)
class EarlierSlip:
    """The offset of a contact plus its slip in earlier steps, as a function of (x, y) [length]."""

    offset: Field  # prescribed by the problem
    first: FloatArray  # first, along, (e, 2) each: start points of edges, and vectors to their ends
    along: FloatArray
    slip: FloatArray  # (e, q): Bernstein coefficients on each edge

    def __call__(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """The sum at points, from the edge nearest to each point."""
        points, slips = np.stack([np.ravel(x), np.ravel(y)], axis=1), list[FloatArray]()
        for chunk in np.split(points, range(_AT_ONCE, len(points), _AT_ONCE)):
            offset = chunk[:, None] - self.first
            t = np.clip((offset * self.along).sum(axis=2) / (self.along**2).sum(axis=1), 0.0, 1.0)
            edge = np.square(offset - t[..., None] * self.along).sum(axis=2).argmin(axis=1)
            shapes = bernstein_basis(self.slip.shape[1] - 1, t[np.arange(len(chunk)), edge])
            slips.append((shapes * self.slip[edge]).sum(axis=1))
        slip = np.concatenate(slips).reshape(np.shape(x))
        return np.asarray(evaluate("Contact.offset", self.offset, x, y) + slip)


def after_earlier_slip(result: ContactResult) -> tuple[ContactResult, tuple[str, ...]]:
    """A step of a history as the result of a single problem, with the earlier slip in the offsets, and a reason.

    The slip is made continuous where edges go on straight. `InputError` if there is slip along arcs.
    """
    known, slipped, mesh = result.discretization, dict[str, Contact](), result.problem.mesh
    rough = [rows.name for rows in known.contacts if rows.law != "tied" and rows.bound(np.ones_like(rows.gap)).any()]
    if not (known.later and rough):
        return result, ()
    for rows, contact in zip(known.contacts, result.problem.contacts, strict=True):
        if not rows.slip.any():
            continue
        edges = mesh.edges(contact.edges)
        if edges.curved:
            remedy = "this step of a history has slipped before along arcs: bracket the result of one solve"
            raise InputError("result", contact.name, remedy)
        slip = coefficients(known, rows.slip * known.scales.displacement)
        ends, tangents = np.concatenate([edges.first, edges.second]), np.tile(edges.tangent, (2, 1))
        _, first_end, vertex = np.unique(ends, return_index=True, return_inverse=True)
        alignment = (tangents * tangents[first_end[vertex]]).sum(axis=1)
        does_bend = np.bincount(vertex, np.abs(alignment) <= 1.0 - PARALLEL)[vertex] > 0.0
        end_slips = np.concatenate([slip[:, 0], slip[:, -1]])
        mean = np.sign(alignment) * (np.bincount(vertex, np.sign(alignment) * end_slips) / np.bincount(vertex))[vertex]
        slip[:, 0], slip[:, -1] = np.split(np.where(does_bend, end_slips, mean), 2)
        start, along = mesh.vertices[edges.first], np.diff(mesh.vertices[[edges.first, edges.second]], axis=0)[0]
        slipped[contact.name] = replace(contact, offset=EarlierSlip(contact.offset, start, along, slip))
    problem = with_contacts(result.problem, lambda each: slipped.get(each.name, each))
    step = known.with_data(problem, known.scales)
    names = ", ".join(map(repr, rough))
    reason = f"The slip of {names} in the steps before is taken as computed: bounds are those of this step alone."
    return ContactResult(step, result.solution), (reason,)


def admissible_stress(
    discretization: Discretization, bound: FloatArray, result: ContactResult, tolerance: float
) -> tuple[ContactResult, str]:
    """The result if its stress obeys a bound (e, q) up to `tolerance` times the largest traction, else the best stress.

    The text says why no admissible stress was found; empty if one was.
    """

    def violation(result: ContactResult) -> float:
        """The largest violation over the largest traction, or over the unit of stress where everything is open."""
        tractions = EdgeTractions.of(discretization, result.dofs)
        size = float(max(tractions.size, result.certificate.scales.get("stress", 0.0))) or 1.0
        return float(max(part.max(initial=0.0) for part in tractions.violations(bound))) / size

    if violation(result) <= tolerance:
        return result, ""
    qvi = discretization.qvi  # m > 0, as a contact law is violated
    solution = solve_qvi(qvi.with_bound(np.maximum(bound.ravel(), 0.0)), tolerance=tolerance)
    strict = ContactResult(discretization, solution)
    message = f"No strictly admissible stress was found: {solution.message}"
    if solution.status in (Status.INFEASIBLE, Status.INNER_INFEASIBLE):
        message = "No stress on this mesh obeys the contact law on whole edges for that bound: refine the mesh."
    if not strict.has_state:
        return result, message
    return strict, "" if violation(strict) <= LOOSEST else message


_DIVISIONS = 13  # parts of each side of a cell: φ is evaluated at the centres of the 13² triangles
_CELL_DEGREE = 5  # largest degree of φ on a cell for which the work of its stresses is integrated exactly

_BALANCE = 1e-8  # largest difference of the gap and the sum of its parts, relative to the energies, by rounding
_CROSSED = 1e-9  # largest lower − upper, relative to the strain energy, by rounding


def data_reasons(discretization: Discretization) -> tuple[str, ...]:
    """One sentence for each datum that is no polynomial of the degree that the stress holds exactly.

    Tractions, friction bounds c and t_max, and a body potential along contacts may have the degree p − 2 of tractions
    on each edge, a body potential on cells degree 5. Springs must have one stiffness on an edge. Stresses far below the
    unit of stress are rounding.
    """
    problem, space, unit = discretization.problem, discretization.space, discretization.scales.stress
    most, data = space.element.traction_degree, list[tuple[str, str, Edges, str, Field | None, int]]()
    for condition in problem.prescribed(Traction):
        data.append((condition.name, condition.condition.edges, condition.edges, condition.name, condition.value, most))
    for contact in problem.contacts:
        place, degrees = (contact.name, problem.mesh.edges(contact.edges)), dict.fromkeys(SPRINGS, 0)
        if contact.law != "tied":
            degrees |= {name: most for name, each in keys_of(Contact).items() if each.unit == "stress"}
            data.append(("The body potential", *place, "ContactProblem.body_potential", problem.body_potential, most))
        for name, degree in degrees.items():
            data.append((f"The {name.replace('_', ' ')}", *place, f"Contact.{name}", getattr(contact, name), degree))
    reasons = [
        f"{datum} on {place!r} is not a polynomial of degree {degree} on every edge."
        for datum, place, edges, name, field, degree in data
        if callable(field) and not is_polynomial(problem, edges, name, field, degree, unit if degree else 0.0)
    ]
    cells, (corners, parts) = np.arange(problem.mesh.cell_count), space.lattice(_DIVISIONS)
    t = corners[parts].mean(axis=1)
    points, inside = space.points(cells, t), dict[str, FloatArray]()
    if callable(problem.body_potential):
        x, y = physical(problem, discretization.scales, points)
        inside["body potential"] = evaluate("ContactProblem.body_potential", problem.body_potential, x, y) / unit
    if varies(problem):
        values = scaled_stress_at_rest(problem, discretization.scales, cells, points)
        inside["initial strain"] = np.concatenate(list(np.moveaxis(values, -1, 0)))
    for name, values in inside.items():
        if not spanned(values, triangle(_CELL_DEGREE).values(t[:, -2:]), 1.0):
            reasons.append(f"The {name} is not a polynomial of degree {_CELL_DEGREE} on every cell.")
    return tuple(dict.fromkeys(reasons))


def force_bounds(discretization: Discretization, frictionless: bool, lower: float, upper: float) -> dict[str, Bounds]:
    """Bounds of the force at the only displacement that is not zero, from bounds of J(u) [stress × length²], see (D21).

    The key is "NAME.normal_force" for a contact pressed by its gap (≥ 0 under pressure), "NAME.tangential_force" for a
    tied contact driven by its offset; "NAME.force_x", "NAME.force_y", "NAME.moment" on the body for a plate that moves;
    "EDGES.x", "EDGES.y", "EDGES.normal" or "EDGES.tangential" for a support [stress × length]. The mapping is empty if
    more acts than this displacement, or if a friction bound is not zero.
    """
    problem = discretization.problem
    data: list[tuple[str, Field, bool, float]] = [("initial_strain", float(is_strained(problem)), False, 1.0)]
    data += [("body_potential", problem.body_potential, False, 1.0)]  # key of the force, value, whether it drives, sign
    for condition in problem.conditions:
        if isinstance(condition, Contact):
            name = condition.name
            data += [(f"{name}.normal_force", condition.gap, True, -1.0)]
            data += [(f"{name}.pore_pressure", condition.pore_pressure, False, 1.0)]
            if condition.law == "tied":
                senses = turning_senses(problem.mesh.vertices, problem.mesh.edges(condition.edges))
                data += [(f"{name}.tangential_force", condition.offset, bool((senses > 0.0).all()), 1.0)]
            plate = condition.plate
            for force, motion in DRIVES.items() if plate is not None else ():
                data += [(f"{name}.plate", getattr(plate, force) or 0.0, False, 1.0)]
                data += [(f"{name}.{force}", getattr(plate, motion) or 0.0, True, 1.0)]
        elif isinstance(condition, (Traction, Displacement)):
            drives = isinstance(condition, Displacement)
            data += [(f"{condition.edges}.{key}", value, drives, 1.0) for key, value in components(condition).items()]
    if not frictionless or any(callable(value) for _, value, *_ in data) or not np.isfinite([lower, upper]).all():
        return {}
    nonzero = [datum for datum in data if datum[1] != 0.0]
    if len(nonzero) != 1 or not nonzero[0][2]:
        return {}
    name, value, _, sign = nonzero[0]
    assert not callable(value)
    return {name: Bounds(*sorted(float(sign * 2.0 * bound / value) for bound in (lower, upper)))}


def bracket(
    result: ContactResult,
    degree: int | None = None,
    tolerance: float = 1e-8,
    *,
    time_limit: float | None = None,
    verbose: bool = False,
) -> Bracket:
    """Bounds of the energy of the problem that a result belongs to, and an error indicator for each cell.

    With the compliance c, the stiffness C, an initial strain ε⁰, a friction bound s on the contacts and

        J(v)  = ½ ∫ (ε(v) − ε⁰) : C : (ε(v) − ε⁰) − ∫ b·v − ∫_{Γ_σ} T·v + ∫_{Γ_μ} s |v_T − w|,  v_N ≤ g,  v = U on Γ_u,
        J*(τ) = ½ ∫ τ : c : τ + ∫ ε⁰ : τ − ∫_{Γ_u} U·τn − ∫_{Γ_μ} (g τ_N + w τ_T),                τ in K(s) of (D1),

    −J*(τ) ≤ J(u) ≤ J(v) for the solution u of the problem with that bound, and

        J(v) + J*(τ) ≥ ½ ∫ ε(u − v) : C : ε(u − v) + ½ ∫ (σ − τ) : c : (σ − τ).

    Springs of stiffness k along contacts add ½ ∫ k d² to J, with their stretch d, and ½ ∫ τ²/k to J*.
    The stress τ is the result's if it obeys the contact law on whole edges; else it is computed anew for the same
    bound. v is computed by displacement elements on the same mesh (`solve_companion`). Without Coulomb friction the
    bracket is of the problem stated. With Coulomb friction s = μ|σ_N| is held fixed, and the gap is an indicator
    without the effect of s itself: `Bracket.coulomb` bounds the errors under Coulomb's law. In a step of a history the
    earlier slip is taken as computed, and bounds are called estimates.

    Parameters
    ----------
    result : ContactResult
        A result with a stress state.
    degree : int, optional
        Degree of the displacement elements, see `solve_companion`; by default that of Φ, at most 5.
    tolerance : float
        Tolerance of the two solves, at most 1e-6. A stress that violates the contact law by less, relative to the
        largest stress, is admissible; an estimate of its cost is taken off the lower bound (`Bracket.slack`).
    time_limit : float, optional
        Seconds for the two solves together; a bound that is not found in time is infinite.
    verbose : bool
        Print a header, a line for each iteration of the solves, and a footer with what is bounded and the time.

    Returns
    -------
    Bracket
        A bound that cannot be computed is infinite, with the reason.

    Raises
    ------
    InputError
        If there is no stress state, an argument is wrong, or the result is a step of a history after slip along arcs.

    Notes
    -----
    Theory: W. Prager, J. L. Synge, Approximations in elasticity based on the concept of function space, Quart. Appl.
    Math. 5 (1947); P. Ladevèze, D. Leguillon, Error estimate procedure in the finite element method and applications,
    SIAM J. Numer. Anal. 20 (1983). "Guaranteed" holds up to rounding and the tolerance, for data that between the
    points of evaluation are the polynomials that they are there (`data_reasons`).

    """
    instance_of(ContactResult, "result", result)
    if not 0.0 < finite_number("tolerance", tolerance) <= LOOSEST:
        raise InputError("tolerance", tolerance, f"give a number above 0, at most {LOOSEST:g}")
    default = min(result.discretization.space.degree, HIGHEST)  # one degree less would double the gap
    degree = checked(result.problem, default if degree is None else degree, tolerance).degree
    result, earlier = after_earlier_slip(with_numbers(result))
    rough = ", ".join(repr(contact.name) for contact in result.problem.contacts if has_coulomb(contact))
    kind = BracketKind.GIVEN_BOUND if rough else BracketKind.PROBLEM
    known = with_bernstein_rows(result.discretization)
    tractions = EdgeTractions.of(known, result.dofs)  # its friction bound is held fixed
    reasons = (*earlier, *([f"The friction bound on {rough} was taken from the computed pressure."] if rough else []))
    with deadline(time_limit), Log(f"qvi_contact {__version__}: bracket", verbose) as log:
        log.begin({"what": kind.value, "degree": degree, "tolerance": f"{tolerance:g}"})
        stress, refusal = admissible_stress(known, tractions.bound, result, tolerance)
        shared: SharedStress | str = with_shares(result, known, tolerance) if rough else ""
        slips: list[Mapping[str, FloatArray]] = [{}]  # a second displacement is for Coulomb's law
        slips += [] if isinstance(shared, str) else [{name: each.slipping for name, each in shared.shares.items()}]
        bound = tractions.bound * known.scales.stress
        law = {rows.name: bound[rows.edges] for rows in known.contacts if rows.law != "tied"}
        settings: dict[str, Any] = {"degree": degree, "tolerance": tolerance}
        companions = solve_companions(known.problem, [law] * len(slips), slip_directions=slips, **settings)
        found = _assemble(known, kind, tractions, reasons, stress, refusal, companions[0])
        bounds: CoulombBounds | str = shared if isinstance(shared, str) else ""
        if isinstance(shared, SharedStress):
            try:
                bounds = coulomb_bounds(shared, companions[1], (*earlier, *found.reasons[len(reasons) :]))
            except (FactorisationError, MemoryError, np.linalg.LinAlgError) as error:
                bounds = f"The norm of friction was not computed: {error or 'out of memory'}."
        why_none = bounds if isinstance(bounds, str) else "" if math.isfinite(bounds.within) else bounds.message
        if why_none and not result.certificate.passed:
            bounds = f"The result is not solved: {result.status.words}."
        found = replace(found, coulomb_reason=bounds) if isinstance(bounds, str) else replace(found, coulomb=bounds)
        is_bounded = math.isfinite(found.gap)
        log.end("bounded" if is_bounded else "no bound", found.message, {}, is_bounded)
    return found


def _assemble(
    discretization: Discretization, kind: BracketKind, tractions: EdgeTractions, reasons: tuple[str, ...],
    stress: ContactResult, refusal: str, companion: CompanionResult,
) -> Bracket:  # fmt: skip
    """The bracket of a stress and a displacement: energies, parts by cell and contact, reasons for no guarantee."""
    problem, mesh, u = discretization.problem, discretization.problem.mesh, stress.dofs
    fields = CellFields.of(discretization, u, companion.degree)
    strain, energy_at_rest = fields.energy, 0.5 * fields.work(fields.at_rest, fields.at_rest)  # ½ ∫ ε⁰ : C : ε⁰
    complementary = strain - discretization.work(u) - fields.work(fields.stress, fields.at_rest)
    reference = max(reference_energy(stress, strain), energy_at_rest)
    scale = max(reference, abs(complementary))
    bulk, has_displacement = np.zeros(mesh.cell_count), companion.has_state
    contacts, slack = dict[str, EdgeParts](), 0.0
    if has_displacement:
        bulk = fields.bulk(companion)
        stress_tractions = EdgeTractions.of(discretization, u)
        contacts, slack = edge_parts(fields, discretization, stress_tractions, tractions.bound, companion)
    lower = -complementary - slack if not refusal else -np.inf
    upper = np.inf if companion.state is None or companion.state.contradiction else companion.energy
    parts = bulk + by_cell(problem, {name: each.total for name, each in contacts.items()})
    data = data_reasons(discretization)
    found = [*reasons, *data, *companion.reasons]
    if kind is BracketKind.PROBLEM and not tractions.exact.all() and not data:
        found.append(
            "A friction bound is not a polynomial of the stress's degree on every edge. A lower one is used there."
        )
    if refusal:
        found.append(refusal)
    if not has_displacement:
        found.append(f"No admissible displacement was found: {companion.message}")
    balance = abs(upper + complementary - float(parts.sum())) / scale if np.isfinite(upper) else 0.0
    misfit, is_curved = stress.traction_misfit, bool(mesh.sides.any())
    if misfit > allowed_misfit(discretization.scales.stress, stress.stress_rounding):
        found.append(f"Computed tractions differ from the prescribed ones by up to {misfit:.3g} [stress] at points.")
    elif balance > _BALANCE and not is_curved:
        found.append(f"The parts of the duality gap differ from the gap by {balance:.1e} of the energy.")
    if is_curved:
        rest = rest_on_arcs(discretization, u).max()
        found.append(
            f"On arcs stress and displacement meet their conditions on average over an edge. At points the stress "
            f"differs from its tractions by up to {rest:.2g} [stress]. The bounds neglect the work of such "
            f"differences, here {balance:.1e} of the energy."
        )
    if lower - upper > _CROSSED * reference:
        found.append(f"The bounds contradict each other by {(lower - upper) / reference:.1e} of the strain energy.")
    return Bracket(
        kind=kind, reasons=tuple(found), lower=lower, upper=upper, strain=strain, bulk=bulk, contacts=contacts,
        cell_gaps=np.maximum(parts, 0.0), slack=slack,
        driven=force_bounds(discretization, not tractions.bound.any(), lower, upper),
        result=stress, companion=companion,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Branches(WithFields):
    """Certified solutions of one discrete problem."""

    results: tuple[ContactResult, ...]
    """All solutions that were found, first the one nearest to the displacement model."""
    distances: tuple[float, ...]
    """Their distances d, see `other_solutions`: an indication, no proof; NaN without a displacement model."""
    companion: CompanionResult | None
    """The displacement model; None if there is only one solution, or if the model has no answer."""
    message: str
    """One sentence about what was found, a remark of each result if there are several."""

    @property
    def preferred(self) -> ContactResult:
        """The result nearest to the displacement model; without a model, the given result."""
        return self.results[0]


def other_solutions(result: ContactResult, *, time_limit: float | None = None) -> Branches:
    """Look for other solutions of the discrete problem of a result, and prefer the one that displacements confirm.

    On up to 200 contact points solutions are followed while tractions change, until these are back at their values; on
    all, while friction grows or falls to its value from 0.02, 0.4, 0.6, 0.85 and 1.3 times the value, in 3 to 20 steps.
    This takes as long as ten to thirty solves, and up to a hundred where a step starts far from its solution, or many
    are found; tractions change no more after 20. Only certified solutions count. If there are several, the displacement
    model is solved on the same mesh, and they are sorted by

        d² = ½ ∫ (cσ − ε(v)) : C : (cσ − ε(v)) dx / U,

    with the largest strain energy U of the solutions. A rigid motion v confirms a solution without stress.

    That no other solution was found does not prove that there is none. `time_limit` are the seconds for following
    solutions. `InputError` if the result is not solved, or belongs to a step of a history.
    """
    if not isinstance(result, ContactResult) or result.status is not Status.SOLVED:
        raise InputError("result", result, "give a result whose status is solved")
    discretization = result.discretization
    if any(rows.slip.any() for rows in discretization.contacts):
        remedy = "give the result of one solve, with the earlier slip in `offset`"
        raise InputError("result", "a step of a history, after earlier slip", remedy)
    solutions = followed_solutions(result.solution, time_limit=time_limit)
    if len(solutions) == 1:
        return Branches((result,), (np.nan,), None, "No other solution was found by following tractions and friction.")
    results, companion = [ContactResult(discretization, solution) for solution in solutions], None
    try:
        model = solve_companion(result.problem)
        companion, reason = (model if model.status is Status.SOLVED else None), model.message
    except InputError as error:
        reason = f"{error}."
    comparison = f"No displacement model on this mesh confirms one of them: {reason}"
    distances, largest = np.full(len(results), np.nan), max(each.energies.strain for each in results)
    if companion is not None:
        for i, each in enumerate(results):
            bulk = CellFields.of(discretization, each.dofs, companion.degree).bulk(companion)
            distances[i] = np.sqrt(bulk.sum() / largest)
        comparison = (
            "Their strains differ from those of the displacement model on the same mesh by "
            f"{', '.join(f'{100.0 * distance:.3g} %' for distance in np.sort(distances))} of the largest, in the "
            "energy norm."
        )
    order = np.argsort(distances, kind="stable")  # NaN without a companion: the order stays
    pairs, ranges = combinations([solutions[i] for i in order.tolist()], 2), list[str]()
    tractions = max(traction_difference(*pair) for pair in pairs)
    for name in result.contacts:
        forces = [each.contacts[name].tangential_force for each in results]
        ranges.append(f"{min(forces):.5g} to {max(forces):.5g} [stress × length] on {name!r}")
    message = (
        f"The discrete problem has several solutions: {len(results)} certified ones were found. Their contact "
        f"tractions differ by up to {100.0 * tractions:.2g} % of the largest. The tangential force is "
        f"{' and '.join(ranges)}. {comparison}"
    )
    branches = list[ContactResult]()
    for i in order.tolist():  # replaces the remark of the solve that there may be several solutions
        place = "" if companion is None else f" This one is {'not ' if branches else ''}the nearest."
        remarks = (f"{message}{place} {WHAT_TO_DO}",)
        branches.append(ContactResult(discretization, replace(solutions[i], remarks=remarks)))
    return Branches(tuple(branches), tuple(distances[order].tolist()), companion, message)
