"""What a user should know about a result: one table of conditions and sentences."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeAlias

import numpy as np

from qvi_contact.discretization.loads import physical
from qvi_contact.mesh.edges import edge_ends
from qvi_contact.problem.conditions import Symmetry, has_coulomb
from qvi_contact.solution.contact_line import ContactState
from qvi_contact.solution.stress import cell_stresses
from qvi_contact.solution.undetermined import largest_counted, undetermined_motions
from solvers import Status
from solvers.factorisation import FactorisationError

if TYPE_CHECKING:
    from qvi_contact.solution.result import ContactResult

_MISFIT: Final = 1e-6  # of the unit of stress: difference of tractions that counts
_ROUNDED: Final = 1e-6  # share of the stress in which rounding of single stresses counts
_FAR: Final = 1e4  # gaps over displacements above which rounding of gaps is what an inaccurate result lacks
_LARGE_FRICTION: Final = 1.0  # above which other solutions are known: of 2 and more
_EXCESS: Final = 1e-2  # share of a contact's largest traction by which friction may leave its bound between points
_EDGES_IN_CONTACT: Final = 4  # edges of an arc below which a contact zone is too short for them
_YIELDS: Final = 1e-6  # of the unit of stress: excess of the strength that counts

Numbers: TypeAlias = Iterator[Mapping[str, Any]]
"""What stands in a sentence, once for each time that it is said."""


class Remark(NamedTuple):
    """A condition, which yields the numbers of the sentence where it holds; whether it needs a stress state."""

    condition: Callable[[ContactResult], Numbers]
    sentence: str
    of_state: bool = True


def remarks(result: ContactResult) -> tuple[str, ...]:
    """Sentences about how data were taken, about the way to the solution, and those of `REMARKS` that hold."""
    found = [*result.discretization.remarks, *result.solution.remarks]
    for remark in REMARKS:
        if result.has_state or not remark.of_state:
            found += [remark.sentence.format(**numbers) for numbers in remark.condition(result)]
    return tuple(found)


def _turning_plates(result: ContactResult) -> Numbers:
    if result.status is not Status.SOLVED and not result.status.impossible:
        for contact in result.problem.contacts:
            if contact.plate is not None and contact.plate.moment is not None and has_coulomb(contact):
                yield {"name": contact.name}


def _misfit(result: ContactResult) -> Numbers:
    if result.traction_misfit > _MISFIT * result.discretization.scales.stress:
        yield {"misfit": result.traction_misfit}


def _large_friction(result: ContactResult) -> Numbers:
    """Unless friction is below its bound for one solution only, which is computed where it is large.

    The bound alone says nothing: on usual meshes it is 0.01 to 0.1.
    """
    qvi = result.solution.problem
    friction = float(qvi.mu[qvi.law.moving].max(initial=0.0))
    if result.status is Status.SOLVED and not result.solution.remarks and friction > _LARGE_FRICTION:
        try:
            unique = result.solution.uniqueness.satisfied
        except (FactorisationError, ValueError):  # dense algebra refuses what has overflowed by ValueError
            unique = False
        if not unique:
            yield {"friction": friction, "large": _LARGE_FRICTION}


def _undetermined(result: ContactResult) -> Numbers:
    for motion in undetermined_motions(result):
        yield {"remark": motion.remark}


def _rounded_stresses(result: ContactResult) -> Numbers:
    unit = result.certificate.scales.get("stress", 1.0) * result.discretization.scales.stress
    if result.stress_rounding > _ROUNDED * unit:
        yield {"rounding": result.stress_rounding}


def _next_to_nothing(result: ContactResult) -> Numbers:
    largest = largest_counted(result)
    if largest is not None:
        yield {"largest": result.discretization.scales.stress * largest}


def _rounded_gaps(result: ContactResult) -> Numbers:
    """Gaps far larger than the displacements, where the certificate does not pass."""
    unit = result.certificate.scales.get("displacement", 0.0)
    gaps = {rows.name: float(np.abs(rows.gap).max(initial=0.0)) for rows in result.discretization.contacts}
    name = max(gaps, key=gaps.__getitem__, default="")
    if result.status is Status.INACCURATE and unit and gaps[name] > _FAR * unit:
        accuracy = result.certificate.accuracy
        tolerance = 10.0 ** np.ceil(np.log10(2.0 * accuracy))
        yield {"name": name, "times": gaps[name] / unit, "accuracy": accuracy, "tolerance": tolerance}


def _beyond_strength(result: ContactResult) -> Numbers:
    if not result.problem.yields:
        return
    from qvi_contact.limit.stresses import excess  # loaded for bodies that yield alone

    scales = result.discretization.scales
    points, stress = cell_stresses(result.discretization, result.dofs)
    x, y = physical(result.problem, scales, points)
    beyond = excess(result.problem, x, y, scales.stress * stress)
    least, largest = _YIELDS * scales.stress, float(beyond.max())
    if largest > least:
        at = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
        share = 100.0 * float((beyond.max(axis=1) > least).mean())
        yield {"largest": largest, "x": x[at], "y": y[at], "share": share}


def _coarse_arcs(result: ContactResult) -> Numbers:
    """Contacts on arcs that touch along a part which is only a few edges long, both halves of it if symmetric."""
    mesh = result.problem.mesh
    mirrors = [mesh.edges(each.edges) for each in result.problem.conditions if isinstance(each, Symmetry)]
    mirrored = np.concatenate([np.empty(0, dtype=np.int64), *map(edge_ends, mirrors)])
    for rows in result.discretization.contacts:
        line, edges = result.contacts[rows.name], rows.points.edges
        touching = (line.state != ContactState.OPEN).reshape(len(edges), -1)
        held = edges.take(touching.any(axis=1) & edges.bent)
        count = len(held) * (2 if np.isin(edge_ends(held), mirrored).any() else 1)
        if not touching.all() and 0 < count < _EDGES_IN_CONTACT:
            x, y = (float(part[touching.ravel()].mean()) for part in (line.x, line.y))
            yield {"name": rows.name, "x": x, "y": y, "least": _EDGES_IN_CONTACT, "count": count}


def _excess_between_points(result: ContactResult) -> Numbers:
    for name, line in result.contacts.items():
        largest = float(np.hypot(line.normal_stress, line.tangential_stress).max(initial=0.0))
        beyond = line.excess_between_points
        if beyond > max(_EXCESS * largest, line.rounding.stress):
            yield {"name": name, "beyond": beyond, "share": 100.0 * beyond / largest}


REMARKS: Final = (
    Remark(
        _turning_plates,
        "The plate or pin at {name!r} may slip round under its moment. Nothing proves it, as equilibrium alone would "
        "allow a larger pressure, and more friction with it. Give the rotation instead of the moment: the moment of "
        "the result is then what friction carries.",
        of_state=False,
    ),
    Remark(
        _misfit,
        "Computed tractions differ from the prescribed ones by up to {misfit:.3g} [stress] at single points. Force and "
        "moment on every edge are right. To reduce the difference, let an edge end where the tractions jump, or "
        "refine there.",
    ),
    Remark(
        _large_friction,
        "Friction is {friction:.3g}. Above {large:g} the discrete problem may have several solutions. This is one of "
        "them. To look for others, call other_solutions(result), or run 'qvi-contact branches' with the problem file.",
    ),
    Remark(_undetermined, "{remark}"),
    Remark(
        _rounded_stresses,
        "Rounding makes stresses in the smallest cells uncertain by up to {rounding:.2g} [stress]. Forces and energies "
        "are not affected. Use larger cells there, or less grading.",
    ),
    Remark(
        _next_to_nothing,
        "The contacts carry at most {largest:.2g} [stress], very little compared with the stress in the body. No digit "
        "of these tractions is reliable. To compute them, leave out the loads that strain the body elsewhere.",
    ),
    Remark(
        _rounded_gaps,
        "On {name!r} gaps are up to {times:.0e} times the displacements of the body. Rounding of the gaps limits the "
        "accuracy, here to {accuracy:.1e}. Ask for a tolerance of {tolerance:.0e}, or state the problem with a smaller "
        "clearance or gap.",
    ),
    Remark(
        _beyond_strength,
        "The elastic stress exceeds the strength of the material by up to {largest:.3g} [stress], most around "
        "({x:.6g}, {y:.6g}), and in {share:.0f} % of the triangles. There the body yields, which is not computed. What "
        "it carries at most is found by limit_load_factor, or by 'qvi-contact limit'.",
    ),
    Remark(
        _coarse_arcs,
        "Contact {name!r} touches around ({x:.6g}, {y:.6g}) on fewer than {least} edges of its arc ({count}). The "
        "pressure there is not resolved. Refine the mesh there until {least} edges or more touch, as by "
        "graded([(x, y)], 2).",
    ),
    Remark(
        _excess_between_points,
        "On {name!r} friction exceeds its bound between the points of an edge, by up to {beyond:.3g} [stress]: "
        "{share:.1f} % of the largest traction. Refine the mesh there.",
    ),
)
"""In the order in which they are said."""
