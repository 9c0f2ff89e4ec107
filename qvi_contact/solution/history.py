"""Load histories: quasi-static friction, step by step.

Friction opposes the slip in the step. With the obstacle's offset w_k and the slip s_k = u_T − w_k accumulated up to
step k, step k is the static problem with the offset w_k + s_{k−1},

    |σ_T| ≤ b(σ_N),   |σ_T| < b ⇒ s_k = s_{k−1},   (s_k − s_{k−1}) σ_T ≤ 0.

This is the implicit Euler rule; loads and obstacles change in the steps the user gives. The slip passed to the next
step is that of the multipliers at the Gauss points, so that a step starts in exactly the state in which the last one
ended. A body whose position nothing determines stays as near as possible to its last position.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from qvi_contact import __version__
from qvi_contact.basics.checks import FloatArray, function_or_none, instance_of, real_array, true_or_false
from qvi_contact.basics.schema import WithFields
from qvi_contact.discretization.discretization import Discretization, discretize
from qvi_contact.discretization.loads import LOAD_POINTS, EdgePoints, laws_vary
from qvi_contact.discretization.scaling import Scales
from qvi_contact.errors import InputError
from qvi_contact.mesh.edges import centre_of, cross, points_back
from qvi_contact.problem.conditions import Displacement
from qvi_contact.problem.fields import along_edges
from qvi_contact.problem.problem import ContactProblem, run_digest
from qvi_contact.solution.remarks import free_motions
from qvi_contact.solution.result import ContactResult, contact_numbers, forces_units, overall_status
from qvi_contact.solution.settings import Settings
from qvi_contact.solution.solver import solved
from qvi_contact.solution.stress import traction
from qvi_contact.units import Units
from solvers import Status, certify
from solvers.basics.progress import Log, deadline
from solvers.basics.types import PicklesFields, frame, load, pandas
from solvers.errors import known_name
from solvers.inner.linear_program import BackendFailure, attempt

if TYPE_CHECKING:
    from pandas import DataFrame

_PARALLEL = 1e-9  # sine of the angle between edges up to which they count as parallel
CONTINUES = (Status.SOLVED, Status.INACCURATE)
"""Statuses of a step after which the next step is solved."""
_COLUMNS = {"step": ">5", "status": "<20", "iterations": ">10", "accuracy": ">9.1e", "seconds": ">9.2f"}


@dataclass(frozen=True, eq=False)
class History(WithFields):
    """Results of the load steps, up to the first step that is not solved.

    In each step's result `slip` and `energies.dissipation` are those of the step. Energies are computed from the
    multipliers of the rows, which obey the friction law exactly; `slip` is their projection.
    """

    steps: Sequence[ContactResult]
    """One result for each step done: a tuple, or with a store a sequence that reads each step on access."""
    planned: int
    """Number of load steps asked for."""

    @cached_property
    def statuses(self) -> tuple[Status, ...]:
        """The status of each step done."""
        stored: tuple[Status, ...] | None = getattr(self.steps, "statuses", None)  # a store need not read results
        return tuple(step.status for step in self.steps) if stored is None else stored

    @property
    def status(self) -> Status:
        """Solved if every step is; else the first other status, or "time_limit" if steps are missing."""
        return overall_status(self.statuses, self.planned)

    @property
    def message(self) -> str:
        """One sentence about the outcome."""
        for number, status in enumerate(self.statuses, 1):
            if status is not Status.SOLVED:
                return f"step {number} of {self.planned}: {self.steps[number - 1].message}"
        if len(self.steps) < self.planned:
            return f"time limit after {len(self.steps)} of {self.planned} steps. {Status.TIME_LIMIT.advice}"
        return f"all {self.planned} steps solved"

    def slip(self, contact: str) -> FloatArray:
        """Slip u_T − w accumulated up to each step at the points of a contact, shape (steps, m) [length]."""
        states = self._states
        if states:
            names = states[0].contacts
            known_name("contact", contact, {"contacts": names})
        return np.cumsum([step.contacts[contact].slip for step in states], axis=0)

    def to_frame(self, units: Units | None = None) -> DataFrame:
        """One row for each step and contact as a pandas table, with units and errors as `ContactResult.to_frame`.

        Columns are "step" (from 1), "status", "contact", the columns of `ContactResult.forces_frame`, with the slip of
        the step, and "dissipated", its energy lost in friction on all contacts. Steps without a state have no rows.
        """
        rows = [
            {"step": number, "status": str(step.status), "contact": name, **numbers, "dissipated": lost}
            for number, step in enumerate(self._states, 1)
            for lost in [_friction_work(step, step)]
            for name, numbers in contact_numbers(step).items()
        ]
        energy = Units.labels(units, {"dissipated": "energy"})
        return frame(pandas().DataFrame(rows), {**forces_units(units), **energy})

    @property
    def dissipated(self) -> FloatArray:
        """Energy lost in friction in each step, ∫ |σ_T| |s_k − s_{k−1}| ds ≥ 0, shape (steps,) [stress × length²]."""
        return np.array([_friction_work(step, step) for step in self._states])

    @property
    def friction_work(self) -> FloatArray:
        """Energy lost in friction by the trapezoidal rule, −∫ ½(σ_T,k + σ_T,k−1)(s_k − s_{k−1}) ds, shape (steps,).

        While no point opens or closes, this is the loss in the balance of energy between two steps: over a closed cycle
        it equals the work of obstacles and supports, the area of their loops [stress × length²]. It tends to
        `dissipated` as steps shrink, and equals it if friction is at its bound at both ends of every step with slip.
        """
        at_starts = [_friction_work(now, before) for before, now in pairwise(self._states)]
        return np.asarray(0.5 * (self.dissipated + np.array([0.0, *at_starts])))

    def loop(self, name: str) -> tuple[FloatArray, FloatArray]:
        """Displacement of an obstacle or support (steps,) [length], and its force on the body [stress × length].

        `name` is that of a contact, or of an edge set with a prescribed displacement. The obstacle of a contact moves
        along the tangent by its mean offset, and by the motion of its plate at the contact's centre. An edge set moves
        along the line of its motion, or else along its tangent; along x or y if it turns. On an arc the tangent turns,
        and the force is the sum of its components along the motion. A plate that also moves normally or turns does more
        work than this loop shows. For a plate on edges that face several ways, such as a pin, the loop is that of the
        component x, y or rotation with the most work; rotation and moment are [rad] and [stress × length²].

        `InputError` if there is no such contact or edge set, or if the obstacle is at rest while displacements
        prescribed elsewhere move the body: the error lists the edge sets to name instead.
        """
        return self.driven(name)[1:]

    def driven(self, name: str) -> tuple[str, FloatArray, FloatArray]:
        """The component that moves, "along", "x", "y" or "rotation", then the two arrays of `loop`."""
        if not self._states:
            return "along", np.zeros(0), np.zeros(0)
        first = self._states[0]
        supports = [each.edges for each in first.problem.conditions if isinstance(each, Displacement)]
        name = known_name(
            "name", name, {"contacts": first.contacts, "edge sets with a prescribed displacement": supports}
        )
        if name not in first.contacts:
            return "along", *self._of_support(name)
        steps = [_of_obstacle(step, name) for step in self._states]
        if any(each.keys() != steps[0].keys() for each in steps):
            raise InputError("name", name, "has a plate in some steps only: give the plate in all steps, or in none")
        pairs = np.array([list(each.values()) for each in steps]).transpose(1, 2, 0)
        most = int(np.argmax(np.ptp(pairs[:, 0], axis=1) * np.abs(pairs[:, 1]).max(axis=1)))
        displacement, force = pairs[most]
        if not np.ptp(displacement) > 0.0:
            movers = [edges for edges in dict.fromkeys(supports) if np.ptp(self._of_support(edges)[0]) > 0.0]
            if movers:
                remedy = f"its obstacle does not move: name what drives the body, {' or '.join(map(repr, movers))}"
                raise InputError("name", name, remedy)
        return list(steps[0])[most], displacement, force

    def _of_support(self, name: str) -> tuple[FloatArray, FloatArray]:
        """The loop of an edge set with a prescribed displacement, along the line of its motion or the tangent."""
        steps = [_of_support(step, name) for step in self._states]
        components = [component for component in steps[0] if all(component in each for each in steps)]
        loops = {component: np.array([each[component] for each in steps]).T for component in components}
        if not loops:
            raise InputError("name", name, "name a contact, or an edge set with a prescribed displacement")
        displacement, force = next((loop for loop in loops.values() if np.ptp(loop[0]) > 0.0), loops[components[0]])
        if {"x", "y"} <= loops.keys():
            both, edges = np.stack([loops["x"], loops["y"]]), self._states[0].problem.mesh.edges(name)
            ways, lengths, _ = np.linalg.svd(both[:, 0] - both[:, 0, :1], full_matrices=False)
            tangents, is_line = edges.tangent, lengths[1:].max(initial=0.0) <= _PARALLEL * lengths[0]
            if is_line or not (edges.curved or np.abs(cross(tangents, tangents[0])).max() > _PARALLEL):
                way = ways[:, 0] if is_line and lengths[0] > 0.0 else tangents[0]
                displacement, force = np.tensordot(-way if points_back(way[None])[0] else way, both, 1)
        return displacement, force

    @property
    def _states(self) -> Sequence[ContactResult]:
        """The steps that have a state: all, or all but the last."""
        return self.steps if not self.steps or self.steps[-1].has_state else self.steps[:-1]


def loop_area(displacement: FloatArray, force: FloatArray) -> float:
    """∮ F dw by the trapezoidal rule, the work done on the body [force × length]; positive where energy is lost.

    The last step is not joined with the first. `InputError` if the arrays are not vectors of the same length, or have
    numbers that are not finite.
    """
    displacement, force = real_array("displacement", displacement), real_array("force", force)
    for name, values in (("displacement", displacement), ("force", force)):
        if values.ndim != 1 or not np.isfinite(values).all():
            raise InputError(name, values, "give one finite number for each step")
    if force.shape != displacement.shape:
        remedy = f"give one number for each step, as many as displacements: {len(displacement)}"
        raise InputError("force", f"shape {force.shape}", remedy)
    return float(np.sum((force[1:] + force[:-1]) * np.diff(displacement)) / 2.0)


def solve_history(
    problems: Iterable[ContactProblem],
    callback: Callable[[int, ContactResult], object] | None = None,
    settings: Settings | None = None,
    *,
    store: str | Path | None = None,
    warm_start: bool = True,
    **changes: Any,
) -> History:
    """Solve a list of load steps with friction that remembers where it has slipped.

    Parameters
    ----------
    problems : iterable of ContactProblem
        The problem at each load step: the same mesh and contacts, while loads, displacements, gaps, offsets, friction
        and materials may change. The stress follows from the total strain and the material of the step, not from a sum
        of increments. An `offset` is the obstacle's own tangential displacement; slip is added to it. With a store a
        sequence is read twice, step by step, and its problems are not kept; another iterable becomes a list.
    callback : callable, optional
        Called with the number of each step, from 1, and its result.
    settings : Settings, optional
        How to discretise and solve all of them.
    store : str or Path, optional
        A folder in which each step is stored as soon as it is done, and not kept in memory. The same call continues an
        interrupted history; `callback` is not called for steps that were stored before. One run at a time can write.
    warm_start : bool
        Whether methods that accept a start begin at the state of the step before.
    **changes
        Fields of `Settings`, and options of the method.

    Returns
    -------
    History
        The history ends with the first step whose status is neither solved nor inaccurate, or at the time limit.

    Raises
    ------
    InputError
        If there is no step, mesh or contacts change, or the store cannot be written, is in use by another run, or holds
        another history.

    """
    function_or_none("callback", callback)
    warm_start = true_or_false("warm_start", warm_start)
    settings = Settings.of(settings, changes)
    title = f"qvi_contact {__version__}: solve_history"
    log = Log(title, settings.verbose, _COLUMNS, iterations=False)
    with deadline(settings.time_limit), log, ExitStack() as held:
        steps, scales, vary = _surveyed(problems, kept=store is None)
        if settings.law is None and vary:
            settings = replace(settings, law_on="points")  # in all steps, as slip is passed on point by point
        log.begin({"steps": len(steps), "cells": steps[0].mesh.cell_count})
        discretized = _Discretized(steps, settings, scales)
        results: Any = list[ContactResult]()
        if store is not None:
            fingerprint = run_digest(steps, {**settings.stated, "warm_start": warm_start})
            results = load("qvi_contact.files.archive").StepStore(store, fingerprint, len(steps), discretized, held)
        warm = warm_start and settings.takes_state
        for number in range(len(results) + 1, len(steps) + 1):
            before = results[number - 2] if number > 1 else None
            if before is None:
                discretization = discretized.first
            elif deadline.over:
                break
            else:
                discretization = before.discretization.with_data(steps[number - 1], scales, _slip_after(before))
            result = _at_rest(solved(discretization, settings, before if warm else None), before)
            results.append(result)
            accuracy = result.certificate.accuracy
            log.line(number, str(result.status), result.solution.iterations, accuracy, log.seconds)
            if callback is not None:
                callback(number, result)
            if result.status not in CONTINUES:
                break
        history = History(tuple(results) if store is None else results, len(steps))
        log.end(str(history.status), history.message, {}, history.status is Status.SOLVED)
        return history


@dataclass(eq=False)
class _Discretized(PicklesFields):
    """Discretisations of the steps, numbered from 1, without earlier slip; all share the matrices of the first."""

    steps: Sequence[ContactProblem]
    settings: Settings
    scales: Scales  # units of the first step

    def __call__(self, number: int, own: Scales) -> Discretization:
        return self.first if number == 1 and own == self.scales else self.first.with_data(self.steps[number - 1], own)

    @cached_property
    def first(self) -> Discretization:
        return discretize(self.steps[0], degree=self.settings.degree, law_on=self.settings.law, scales=self.scales)


def _surveyed(problems: Iterable[ContactProblem], kept: bool) -> tuple[Sequence[ContactProblem], Scales, bool]:
    """The steps, checked; the largest of their units; and whether any contact law varies along an edge.

    Each step is read once only: unless steps are kept, a sequence may make them anew on each access.
    """
    remedy = "give a list of at least one ContactProblem"
    if not isinstance(problems, Iterable):
        raise InputError("problems", problems, remedy)
    steps = list(problems) if kept or not isinstance(problems, Sequence) else problems
    if not len(steps):
        raise InputError("problems", problems, remedy)
    first, law_varies, all_scales = steps[0], False, list[Scales]()
    contacts = list[tuple[str, str, bytes]]()  # must be the same, as slip is passed on point by point
    for number in range(len(steps)):
        problem = steps[number]
        instance_of(ContactProblem, f"problems[{number}]", problem, "give a ContactProblem for each load step")
        if not problem.mesh.same_as(first.mesh):
            raise InputError(f"problems[{number}].mesh", problem.mesh, "give every load step the same mesh")
        found = [(each.name, each.law, problem.mesh.numbers(each.edges).tobytes()) for each in problem.contacts]
        contacts = contacts if number else found
        if found != contacts:
            names = [contact.name for contact in problem.contacts]
            raise InputError(f"problems[{number}].conditions", names, "give every load step the same contacts")
        all_scales.append(Scales.of(problem))
        law_varies = law_varies or laws_vary(problem)
    return steps, max(all_scales, key=lambda scales: (scales.loaded, scales.stress)), law_varies


def _at_rest(result: ContactResult, before: ContactResult | None) -> ContactResult:
    """The result, with bodies as near as possible to their last position where nothing determines their position.

    Of all motions y of the bodies that the contacts allow, G y ≤ h, the one with the least change of displacements on
    contacts since the step before, in the mean square. With the QR factors of the displacements of y this is the least
    |x| with y = R⁻¹ (x − c), by non-negative least squares (Lawson and Hanson 1974, chapter 23).
    """
    free = free_motions(result) if result.status is Status.SOLVED else None
    if free is None or not free.motions.shape[1]:
        return result
    from scipy.optimize import nnls  # loaded only where a body is free

    # with speeds S = Q R the change of displacements in the span of S is Q x, x = c + R y; without a motion Q c
    change, (G, h), solution = _places(result), free.limits, result.solution
    change -= 0.0 if before is None else _places(before)
    Q, R = np.linalg.qr(free.speeds.reshape(change.size, -1))
    c, rows = Q.T @ change.ravel(), np.linalg.solve(R.T, G.T)
    # least |x| with G y ≤ h as a problem of non-negative least squares, whose residual gives x
    last = np.eye(len(c) + 1)[-1]
    E = np.column_stack([np.vstack([-rows, -h - c @ rows]), 0.0 * last])
    residual = attempt("nnls", lambda: E @ nnls(E, last)[0] - last)
    if isinstance(residual, BackendFailure):
        return result
    # multipliers with the motion, certified
    changes, qvi = free.changes @ np.linalg.solve(R, -residual[:-1] / residual[-1] - c), solution.problem
    m_N, m_T = solution.normal_multiplier + changes[0], solution.tangential_multiplier + changes[1]
    stationarity = qvi.gradient(solution.z) + qvi.N.T @ m_N + qvi.T.T @ m_T
    nu = np.linalg.lstsq(qvi.A.T.toarray(), -stationarity, rcond=None)[0]  # motions of driven plates
    certificate = certify(qvi, solution.z, m_N, m_T, nu, solution.certificate.tolerance)
    multipliers = {"normal_multiplier": m_N, "tangential_multiplier": m_T, "equality_multiplier": nu}
    at_rest = replace(solution, **multipliers, certificate=certificate)
    return ContactResult(result.discretization, at_rest) if certificate.passed else result


def _places(result: ContactResult) -> FloatArray:
    """u_N and u_T (2, m) at the points of all contacts but tied ones, relative to driven plates, dimensionless."""
    unit, displacements = result.discretization.scales.displacement, [np.zeros((2, 0))]
    for rows in result.discretization.contacts:
        if rows.law != "tied":
            line, (gap, offset) = result.contacts[rows.name], rows.obstacle
            displacements.append(np.stack([gap - line.gap / unit, offset + line.slip / unit]))
    return np.concatenate(displacements, axis=1)


def _slip_after(result: ContactResult) -> list[FloatArray]:
    """Slip since the first step at the points of each contact, dimensionless: the earlier slip plus −λ_T."""
    m_T = result.solution.tangential_multiplier
    return [
        rows.slip if rows.law == "tied"
        else rows.slip - rows.rule.multipliers_at_points(m_T[rows.rows]) / rows.points.weights
        for rows in result.discretization.contacts
    ]  # fmt: skip


def _friction_work(now: ContactResult, other: ContactResult) -> float:
    """−∫ σ_T (s_k − s_{k−1}) ds with the slip of the step `now` and the traction of `other`."""
    traction = other.solution.problem.tangential(other.solution.z)
    return float(now.solution.tangential_multiplier @ traction) * now.discretization.scales.energy


def _of_obstacle(step: ContactResult, name: str) -> dict[str, tuple[float, float]]:
    """Displacement of a contact's obstacle along the tangent, and the tangential force on the body, as {"along": …}.

    For a plate on edges that face several ways {"x": …, "y": …, "rotation": …}, with force and moment of the plate.
    """
    problem, scales, line = step.problem, step.discretization.scales, step.contacts[name]
    plates = [contact.plate for contact in problem.contacts]
    rows, plate = next(p for p in zip(step.discretization.contacts, plates, strict=True) if p[0].name == name)
    tangents = rows.points.tangents
    if plate is not None and np.abs(cross(tangents, tangents[0])).max() > _PARALLEL:
        motion, force = step.plates[name], step.plate_force(name)
        return {"x": (motion.x, force.x), "y": (motion.y, force.y), "rotation": (motion.rotation, force.moment)}
    along = float(line.weights @ (rows.offset * scales.displacement) / line.weights.sum())
    if plate is not None:
        centre = np.array(centre_of(problem.mesh.vertices, rows.points.edges))
        along += float(rows.points.edges.tangent[0] @ step.plates[name].at(centre))
    return {"along": (along, float(line.weights @ line.tangential_stress))}


def _of_support(step: ContactResult, name: str) -> dict[str, tuple[float, float]]:
    """Mean of each displacement component prescribed on an edge set, and the force on the body along it.

    Components nearest to the first edge's tangent come first. Normal and tangential components turn with the edges.
    """
    problem, discretization, edges = step.problem, step.discretization, step.problem.mesh.edges(name)
    points = EdgePoints(discretization.space, edges, LOAD_POINTS).for_resultants()
    tractions, weights = traction(discretization, step.dofs, points).T, discretization.scales.length * points.weights
    pairs = list[tuple[float, str, tuple[float, float]]]()  # (order, component, (mean, force))
    for given in problem.prescribed(Displacement):
        if isinstance(given.condition, Displacement) and given.condition.edges == name:
            means = along_edges(problem.mesh, edges, given.name, given.value).coefficients(0)[:, 0]
            mean = float(edges.length @ means / edges.length.sum())
            force = float(weights @ (tractions * points.vectors(given.direction, given.turns)).sum(axis=1))
            component = given.name.partition(".")[2]
            pairs.append((-abs(float(given.direction[0] @ edges.tangent[0])), component, (mean, force)))
    return {component: pair for _, component, pair in sorted(pairs, key=lambda each: each[0])}
