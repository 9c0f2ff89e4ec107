"""Load histories: quasi-static friction, step by step.

Within a step friction opposes the slip since the step before: with w_k the obstacle's offset and s_k = u_T − w_k the
slip accumulated up to step k, step k is the static problem with the offset w_k + s_{k−1},

    |σ_T| ≤ b(σ_N),   |σ_T| < b ⇒ s_k = s_{k−1},   (s_k − s_{k−1}) σ_T ≤ 0.

That is the implicit Euler rule; loads and obstacles move in the steps the user gives. Slip is handed on as the
multipliers of the Gauss points, not as their projection, so that each step starts in exactly the state the one before
it ended in.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import astuple, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from qvi_contact import __version__
from qvi_contact.basics.checks import Field, FloatArray, IntArray, evaluate, one_of
from qvi_contact.discretization.basis import RowKind
from qvi_contact.discretization.contact_rows import laws_vary
from qvi_contact.discretization.discretization import discretize
from qvi_contact.discretization.families import ElementName, with_element
from qvi_contact.discretization.plates import centre_of
from qvi_contact.discretization.scaling import Scales
from qvi_contact.errors import InputError
from qvi_contact.mesh.edges import Edges
from qvi_contact.problem.conditions import Contact, Displacement, components
from qvi_contact.problem.problem import ContactProblem, direction_of
from qvi_contact.solution.contact_line import summary_units
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.solver import rows_for, solve
from solvers import Status
from solvers.basics.frames import columns_of, frame
from solvers.basics.narration import narrated
from solvers.basics.watch import expired, watched
from solvers.solve import takes_state

if TYPE_CHECKING:
    from pandas import DataFrame

    from qvi_contact.basics.units import Units

_PARALLEL = 1e-9  # sine of the angle between edges that face one way
_CONTINUES = (Status.SOLVED, Status.INACCURATE)
_COLUMNS = {"step": ">5", "status": "<20", "iterations": ">10", "accuracy": ">9.1e", "seconds": ">9.2f"}


@dataclass(frozen=True, eq=False)
class History:
    """Results of the load steps, up to the first that has none.

    In each step's result `slip` and `energies.dissipation` are those of the step. The energies are computed from the
    multipliers, which obey the friction law at every point, `slip` is their projection.

    Attributes
    ----------
    steps : tuple of ContactResult
        One for each load step done.
    planned : int
        Number of load steps asked for.

    """

    steps: tuple[ContactResult, ...]
    planned: int

    @property
    def status(self) -> Status:
        """Solved if every step was; else that of the first step that was not, or "time_limit" if steps are missing."""
        end = Status.SOLVED if len(self.steps) == self.planned else Status.TIME_LIMIT
        return next((step.status for step in self.steps if step.status is not Status.SOLVED), end)

    @property
    def message(self) -> str:
        """One sentence about the outcome."""
        for number, step in enumerate(self.steps, 1):
            if step.status is not Status.SOLVED:
                return f"step {number} of {self.planned}: {step.message}"
        if len(self.steps) < self.planned:
            return f"time limit after {len(self.steps)} of {self.planned} steps. {Status.TIME_LIMIT.advice}"
        return f"all {self.planned} steps solved"

    def slip(self, contact: str) -> FloatArray:
        """Slip u_T − w accumulated up to each step at the points of a contact, shape (steps, m) [length]."""
        names = self._states[0].contacts if self._states else ()
        if self._states:
            one_of("contact", contact, names, f"name a contact: {', '.join(names) or 'there is none'}")
        return np.cumsum([step.contacts[contact].slip for step in self._states], axis=0)

    def to_frame(self, units: Units | None = None) -> DataFrame:
        """One row for each step and contact as a pandas table; needs the extra ``frame`` (pandas).

        Columns are "step" (from 1), "status", "contact", and those of `ContactResult.forces_frame`, in which slip is
        that of the step, and "dissipated", the energy lost in friction on all contacts in the step. Steps without a
        state have no rows.

        Parameters
        ----------
        units : Units, optional
            If given, names of columns end in their unit, as in "largest_slip [mm]".

        Raises
        ------
        InputError
            If pandas is missing.

        """
        rows = [
            {"step": number, "status": str(step.status), "contact": name, **line.summary(), "dissipated": lost}
            for (number, step), lost in zip(self._numbered(), self.dissipated, strict=True)
            for name, line in step.contacts.items()
        ]
        energy = {} if units is None else {"dissipated": units.energy}
        return frame(columns_of(rows), {**summary_units(units), **energy})

    def _numbered(self) -> list[tuple[int, ContactResult]]:
        """The steps that have a state, with their numbers."""
        return [(number, step) for number, step in enumerate(self.steps, 1) if step.has_state]

    @property
    def dissipated(self) -> FloatArray:
        """Energy lost in friction in each step, ∫ |σ_T| |s_k − s_{k−1}| ds ≥ 0, shape (steps,) [stress × length²]."""
        return np.array([_friction_work(step, step) for step in self._states])

    @property
    def friction_work(self) -> FloatArray:
        """The same by the trapezoidal rule, −∫ ½(σ_T,k + σ_T,k−1)(s_k − s_{k−1}) ds, shape (steps,) [stress × length²].

        As long as no point opens or closes this is what enters the balance of energy between two steps: around a closed
        cycle it is the work that obstacles and supports have done, the area of their loops. It tends to `dissipated` as
        the steps shrink, and equals it if friction is used up at both ends of every step in which a point slips.
        """
        states = self._states
        work = [_friction_work(now, last) for now, last in zip(states, [None, *states[:-1]], strict=True)]
        return np.asarray(0.5 * (self.dissipated + np.array(work)))

    def loop(self, name: str) -> tuple[FloatArray, FloatArray]:
        """Displacement of what drives the body, and the force on the body in its direction, in each step.

        Parameters
        ----------
        name : str
            A contact, whose obstacle moves along the tangent by its mean offset and by the motion of its plate in the
            contact's centre; or an edge set with a prescribed displacement: along the tangent, or along x or y across
            it where nothing moves along the tangent. A plate that also moves normally or turns does more work than this
            loop shows. Of a plate on edges that face several ways, such as a pin, it is the component x, y or rotation
            that does the most work, with the moment about the pivot for a rotation [rad], [stress × length²].

        Returns
        -------
        displacement, force : (steps,) arrays
            [length], [stress × length].

        Raises
        ------
        InputError
            If there is no such contact or edge set, or the obstacle of the contact is at rest while displacements
            prescribed elsewhere move the body: the edge sets to name instead are listed.

        """
        states = self._states
        if not states:
            return np.zeros(0), np.zeros(0)
        if not (isinstance(name, str) and any(name in step.contacts for step in states)):
            return self._edge_loop(name)
        if _faces_several_ways(states[0], name):
            displacement, force = _of_plate(states, name)
        else:
            displacement, force = np.array([_obstacle(step, name) for step in states]).T
        movers = [edges for edges in _displaced(states) if np.ptp(self._edge_loop(edges)[0]) > 0.0]
        if movers and not np.ptp(displacement) > 0.0:
            remedy = f"its obstacle does not move: name what drives the body, {' or '.join(map(repr, movers))}"
            raise InputError("name", name, remedy)
        return displacement, force

    def _edge_loop(self, name: str) -> tuple[FloatArray, FloatArray]:
        """The loop of an edge set with a prescribed displacement: the component along the tangent if it moves."""
        states = self._states
        given = [_prescribed(step, name) for step in states]
        always = [component for component in given[0] if all(component in each for each in given)]
        pairs = [np.array([_supported(step, name, component) for step in states]).T for component in always]
        found = [(displacement, force) for displacement, force in pairs]
        if not found:
            raise InputError("name", name, "name a contact, or an edge set with a prescribed displacement")
        return next((loop for loop in found if np.ptp(loop[0]) > 0.0), found[0])

    @property
    def _states(self) -> tuple[ContactResult, ...]:
        """The steps that have a state."""
        return tuple(step for step in self.steps if step.has_state)


def loop_area(displacement: FloatArray, force: FloatArray) -> float:
    """∮ F dw of a polygon of steps, the work done on the body [force × length]; positive where energy is lost.

    Steps are joined by straight lines, the last one not with the first.
    """
    return float(np.sum((force[1:] + force[:-1]) * np.diff(displacement)) / 2.0)


def solve_history(
    problems: Iterable[ContactProblem],
    callback: Callable[[int, ContactResult], object] | None = None,
    *,
    time_limit: float | None = None,
    element: ElementName | None = None,
    degree: int | None = None,
    contact_rows: RowKind | None = None,
    warm_start: bool = True,
    verbose: bool = False,
    **options: Any,  # checked by solve
) -> History:
    """Solve a list of load steps with friction that remembers where it has slipped.

    Parameters
    ----------
    problems : iterable of ContactProblem
        The problem at each load step: the same mesh, regions and contacts, while loads, displacements, gaps, offsets
        and friction may change. An `offset` is the obstacle's own tangential displacement, slip is added to it.
    callback : callable, optional
        Called with the number of each step, from 1, and its result. Where a step gives up the shear in a corner beside
        a contact (see `discretize`) all steps do, and the history starts again.
    time_limit : float, optional
        Seconds for all steps together. The steps done until then are kept; the last one has the status "time_limit"
        unless its certificate passes.
    element, degree, contact_rows
        The element, its degree on triangles, and what bounds tractions there, see `discretize`.
    warm_start : bool
        Whether methods that take a start begin at the state of the step before.
    verbose : bool
        Print a header, a line a step, and a footer with status and time.
    **options
        As for `solve`.

    Returns
    -------
    History
        It ends with the first step whose status is neither solved nor inaccurate.

    Raises
    ------
    InputError
        If there is no step, or mesh or contacts change.

    """
    title = f"qvi_contact {__version__}: solve_history"
    with watched(time_limit), narrated(title, verbose, _COLUMNS, iterations=False) as story:
        steps = [with_element(problem, element) for problem in _checked_steps(problems)]
        contact_rows = rows_for(options.get("method"), contact_rows)
        if contact_rows is None and any(map(laws_vary, steps)):
            contact_rows = "gauss"  # in all steps, as slip is handed on from one to the next
        space = {"element": element, "degree": degree, "contact_rows": contact_rows}
        story.begin({"steps": len(steps), "cells": steps[0].mesh.cell_count})

        def told(number: int, result: ContactResult) -> None:
            solution = result.solution
            story.line(number, str(result.status), solution.iterations, result.certificate.accuracy, story.seconds)
            if callback is not None:
                callback(number, result)

        history = _history(steps, space, told, options, warm_start and takes_state(options))
        story.end(str(history.status), history.message, {}, history.status is Status.SOLVED)
        return history


def _history(
    steps: Sequence[ContactProblem],
    space: dict[str, Any],
    callback: Callable[[int, ContactResult], object],
    options: dict[str, Any],
    warm: bool,
) -> History:
    """All steps, again from the first where one gives up shears in corners."""
    all_scales = [Scales.of(problem) for problem in steps]
    scales = max(all_scales, key=lambda scales: (scales.loaded, scales.stress))
    freed = np.empty(0, dtype=np.int64)
    while True:
        results = _follow(steps, scales, freed, space, callback, options, warm)
        found = np.unique(np.concatenate([freed, *(result.discretization.freed for result in results)]))
        if len(found) == len(freed):
            return History(tuple(results), len(steps))
        if expired():  # no time to begin again: the steps before the one that gave up a shear are what they were
            return History(tuple(results[:-1] or results), len(steps))
        freed = found


def _follow(
    steps: Sequence[ContactProblem],
    scales: Scales,
    freed: IntArray,
    space: dict[str, Any],
    callback: Callable[[int, ContactResult], object],
    options: dict[str, Any],
    warm: bool,
) -> list[ContactResult]:
    """All steps with the shear given up at the `freed` nodes, up to one without an answer or with other nodes freed."""
    results: list[ContactResult] = []
    for number, problem in enumerate(steps, 1):
        if results and expired():
            break
        if results:
            discretization = results[-1].discretization.following(problem, scales).slipped(_slip_after(results[-1]))
        else:
            discretization = discretize(problem, scales=scales, freed=freed, **space)
        initial = {"initial": results[-1]} if results and warm else {}
        results.append(solve(discretization, **{**options, **initial}))
        callback(number, results[-1])
        if results[-1].status not in _CONTINUES or len(results[-1].discretization.freed) != len(freed):
            break
    return results


def _checked_steps(problems: Iterable[ContactProblem]) -> list[ContactProblem]:
    steps = list(problems) if isinstance(problems, Iterable) else []
    if not steps or not all(isinstance(problem, ContactProblem) for problem in steps):
        raise InputError("problems", problems, "give a list of at least one ContactProblem")
    first = steps[0]
    for number, problem in enumerate(steps[1:], 2):
        if problem.mesh is not first.mesh and not problem.mesh.same_as(first.mesh):
            raise InputError(f"problems[{number - 1}].mesh", problem.mesh, "give every load step the same mesh")
        if [_frame(contact) for contact in problem.contacts] != [_frame(contact) for contact in first.contacts]:
            names = [contact.name for contact in problem.contacts]
            raise InputError(f"problems[{number - 1}].conditions", names, "give every load step the same contacts")
    return steps


def _frame(contact: Contact) -> tuple[str, str, str]:
    """What must not change in a contact."""
    return contact.name, contact.edges, contact.law


def _slip_after(result: ContactResult) -> list[FloatArray]:
    """Slip since the beginning at the points of each contact, dimensionless: −λ_T on top of what came before."""
    discretization, solution = result.discretization, result.solution
    fresh = discretization.offsets()
    slip = []
    for rows, offset in zip(discretization.contacts, fresh, strict=True):
        step = np.zeros(len(offset))
        if rows.law != "tied":
            multipliers = rows.rule.multipliers_at_points(solution.tangential_multiplier[rows.rows])
            step = -multipliers / rows.points.weights
        slip.append(rows.offset - offset + step)
    return slip


def _friction_work(now: ContactResult, other: ContactResult | None) -> float:
    """−∫ σ_T (s_k − s_{k−1}) ds with the slip of one step and the traction of another (none: zero)."""
    if other is None:
        return 0.0
    traction = other.solution.problem.tangential(other.solution.z)
    return float(now.solution.tangential_multiplier @ traction) * now.discretization.scales.energy


def _faces_several_ways(step: ContactResult, name: str) -> bool:
    """Whether a contact has a rigid plate, and edges that are not parallel."""
    tangents = next(rows.points.tangents for rows in step.discretization.contacts if rows.name == name)
    across = tangents[:, 0] * tangents[0, 1] - tangents[:, 1] * tangents[0, 0]
    return name in step.plates and bool(np.abs(across).max() > _PARALLEL)


def _of_plate(states: Sequence[ContactResult], name: str) -> tuple[FloatArray, FloatArray]:
    """The component of a plate's motion that does the most work, and its force or moment."""
    motions = np.array([astuple(step.plates[name]) for step in states]).T
    forces = np.array([astuple(step.plate_force(name)) for step in states]).T
    component = int(np.argmax(np.ptp(motions, axis=1) * np.abs(forces).max(axis=1)))
    return motions[component], forces[component]


def _obstacle(step: ContactResult, name: str) -> tuple[float, float]:
    """Displacement of a contact's obstacle along the tangent, and the tangential force."""
    problem, scales = step.problem, step.discretization.scales
    index = next(i for i, rows in enumerate(step.discretization.contacts) if rows.name == name)
    line, points = step.contacts[name], step.discretization.contacts[index].points
    offset = step.discretization.offsets()[index] * scales.displacement
    along = float(line.weights @ offset / line.weights.sum())
    plate = problem.contacts[index].plate
    if plate is not None:
        motion, (x, y) = step.plates[name], centre_of(problem, scales, step.discretization.contacts[index])
        in_x = motion.x - motion.rotation * (y - plate.pivot[1])
        in_y = motion.y + motion.rotation * (x - plate.pivot[0])
        along += float(points.edges.tangent[0] @ (in_x, in_y))
    return along, line.tangential_force


def _displaced(states: Sequence[ContactResult]) -> list[str]:
    """Edge sets with a prescribed displacement."""
    conditions = states[0].problem.conditions
    return list(dict.fromkeys(condition.edges for condition in conditions if isinstance(condition, Displacement)))


def _prescribed(step: ContactResult, name: str) -> dict[str, Field]:
    """Components of the displacement prescribed on an edge set, those along its tangent first."""
    edges, found = step.problem.mesh.edges(name), dict[str, Field]()
    for condition in step.problem.conditions:
        if isinstance(condition, Displacement) and condition.edges == name:
            found |= components(condition)
    return dict(sorted(found.items(), key=lambda item: -abs(_direction(item[0], edges) @ edges.tangent[0])))


def _direction(component: str, edges: Edges) -> FloatArray:
    """Unit vector (2,) of a component, that of the tangent if it is along the edges."""
    direction, tangent = np.asarray(direction_of(component, edges)[0]), np.asarray(edges.tangent[0])
    return tangent if abs(float(direction @ tangent)) == 1.0 else direction


def _supported(step: ContactResult, name: str, component: str) -> tuple[float, float]:
    """Mean of a component of the displacement prescribed on an edge set, and the force in its direction."""
    edges, value = step.problem.mesh.edges(name), _prescribed(step, name)[component]
    direction = _direction(component, edges)
    sense = float(np.asarray(direction_of(component, edges)[0]) @ direction)
    middles = step.problem.mesh.points_along(edges, np.array([0.5]))
    values = evaluate(f"Displacement.{component}", value, *middles)[:, 0]
    resultant = step.resultant(name)
    force = float(direction @ (resultant.x, resultant.y))
    return sense * float(np.average(values, weights=edges.length)), force
