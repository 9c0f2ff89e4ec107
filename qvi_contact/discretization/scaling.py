"""Characteristic length, stress and displacement that make the algebraic problem dimensionless."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray, evaluate
from qvi_contact.element.edge import gauss_legendre
from qvi_contact.mesh.edges import Edges, centre_of, vectors_along
from qvi_contact.problem.conditions import SPRINGS, Contact, Displacement, Traction
from qvi_contact.problem.material import is_strained, stress_at_rest
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.units import Rounding
from solvers.inner.linear_program import solved

_AT_REST = 1e-6  # strain that is the unit of a body without any load
_NONE = 1e-60  # strain of loads that are none: their energy, and what is divided by them, would leave double precision
REACH = 100.0
"""Units of displacement that a body is at first taken to move at most, see `Scales`."""

PLACES: FloatArray = np.concatenate([[0.0], gauss_legendre(8)[0], [1.0]])  # of an edge where data are looked at


@dataclass(frozen=True)
class Scales:
    """Units of the dimensionless problem."""

    length: float  # L, the longer side of the bounding box [length]
    stress: float  # S, the largest stress the data suggest [stress]
    compliance: float  # C = max(c11, c22) of the body's materials [1/stress]
    loaded: bool = True  # whether S comes from loads or displacements, not from a body at rest
    # an obstacle farther than this from the body counts as that far [D]: where the body does not reach it, nothing but
    # the width of the gap depends on it, and numbers decades apart would drown the rest in rounding. Infinite where a
    # body did reach one that had been moved.
    reach: float = REACH

    @property
    def displacement(self) -> float:
        """D = C S L [length]."""
        return self.compliance * self.stress * self.length

    @property
    def airy(self) -> float:
        """Unit of Φ: S L² [force]."""
        return self.stress * self.length**2

    @property
    def energy(self) -> float:
        """Unit of energy per thickness: C S² L² [force]."""
        return self.compliance * self.stress**2 * self.length**2

    @property
    def rounding(self) -> Rounding:
        """What is next to nothing in these units."""
        return Rounding.of(self.stress, self.displacement, self.length)

    @classmethod
    def of(cls, problem: ContactProblem) -> "Scales":
        """Scales of a problem.

        S is the largest of: the prescribed tractions, the range of the body-force potential, and the stress 1/(C L)
        times the displacement that supports and obstacles force on the body (see `_forced`), the mean stress under
        plates driven by force, the pressure of fluids in contacts, and the stress of initial strains that are held.
        Without any load S is the stress of a strain of 1e-6, or the largest cohesion if that is less.
        """
        length = problem.mesh.length
        compliance = max(float(material.compliance[:2, :2].diagonal().max()) for material in problem.materials)
        tractions = (_sampled(problem, each.edges, each.name, each.value) for each in problem.prescribed(Traction))
        sizes = [float(np.abs(values).max()) for values in tractions]
        if callable(problem.body_potential):
            values = evaluate("ContactProblem.body_potential", problem.body_potential, *problem.mesh.vertices.T)
            sizes.append(float(np.ptp(values)))
        sizes += [forced / (compliance * length) for forced in _forced(problem)]
        sizes += _plate_stresses(problem)
        sizes += _in_contacts(problem, "pore_pressure")
        if is_strained(problem):
            x, y = np.moveaxis(problem.mesh.corners, -1, 0)
            sizes.append(float(np.abs(stress_at_rest(problem, np.arange(problem.mesh.cell_count), x, y)).max()))
        loads = [size for size in sizes if size * compliance > _NONE]
        if loads:
            return cls(length, max(loads), compliance)
        cohesions = [each for each in _in_contacts(problem, "cohesion") if each * compliance > _NONE]
        return cls(length, min(_AT_REST / compliance, max(cohesions, default=np.inf)), compliance, loaded=False)


def _sampled(
    problem: ContactProblem, edges: Edges, name: str, value: Field, minimum: float | None = None
) -> FloatArray:
    """Values of a field at the ends of edges and at Gauss points between them (n, q); (n, 1) of a number."""
    if not callable(value):
        return np.full((len(edges), 1), float(value))
    return evaluate(name, value, *problem.mesh.points_along(edges, PLACES), minimum=minimum)


def _in_contacts(problem: ContactProblem, name: str) -> list[float]:
    """The largest cohesion or pore pressure of each contact [stress]."""
    parts = [(problem.mesh.edges(contact.edges), getattr(contact, name)) for contact in problem.contacts]
    return [float(np.abs(_sampled(problem, edges, f"Contact.{name}", field, 0.0)).max()) for edges, field in parts]


def _plate_stresses(problem: ContactProblem) -> list[float]:
    """Forces of plates over the length of their contacts, moments over its square [stress]."""
    sizes = []
    for contact in problem.contacts:
        if contact.plate is not None:
            plate, edges = contact.plate, problem.mesh.edges(contact.edges)
            length = float(edges.length.sum())
            sizes += [abs(plate.force_x or 0.0) / length, abs(plate.force_y or 0.0) / length]
            if plate.moment is not None:
                centre = centre_of(problem.mesh.vertices, edges)
                arm = max(abs(at - place) for at, place in zip(centre, plate.reference(*centre), strict=True))
                sizes.append(abs(plate.moment_about(*centre)) / (length * max(length, arm)))
    return sizes


def _forced(problem: ContactProblem) -> list[float]:
    """By how much supports and obstacles must squeeze or stretch the body [length].

    A prescribed displacement bounds u from both sides, an obstacle from one, u_N ≤ g. Bilateral and tied contacts bound
    it from both sides, and tied ones by their offset w along the tangent. Obstacles that slide past (w) force nothing
    that friction does not limit; joints are left out, and plates in the components that are driven by force.

    Where all directions are x or y, the largest lower bound along either less the smallest upper one is forced; else
    twice the least distance by which some bound is missed if the body moves without rotation, a linear program.
    """
    rows, limits = [np.empty((0, 2))], [np.empty(0)]  # d·u ≤ limit
    for direction, values, on_both_sides, *_ in bounds(problem):
        rows.append(direction)
        limits.append(values.min(axis=1))
        if on_both_sides:
            rows.append(-direction)
            limits.append(-values.max(axis=1))
    d, limit = np.concatenate(rows), np.concatenate(limits)
    if (np.abs(d).max(axis=1) == 1.0).all():
        sides = [[limit[d[:, axis] == sign] for sign in (1.0, -1.0)] for axis in (0, 1)]
        return [max(0.0, -float(a.min()) - float(b.min())) if len(a) and len(b) else 0.0 for a, b in sides]
    if limit.min() >= 0.0:  # a body that stays where it is misses none
        return [0.0]
    ends = [(None, None), (None, None), (0.0, None)]
    A = np.column_stack([d, -np.ones(len(d))])
    found = solved(np.array([0.0, 0.0, 1.0]), A_ub=A, b_ub=limit, bounds=ends)
    return [2.0 * float(found.x[2]) if found.solved else 0.0]  # any unit will do, if not as well


def bounds(problem: ContactProblem) -> Iterator[tuple[FloatArray, FloatArray, bool, Edges, Contact | None]]:
    """Unit vectors d (n, 2), what d·u may be at most at `PLACES` (n, q) [length], and whether it may not be less.

    Last come the edges, whose arcs d turns along, and the contact; None of supports, and of obstacles that give way.
    """
    for given in problem.prescribed(Displacement):
        yield given.direction, _sampled(problem, given.edges, given.name, given.value), True, given.edges, None
    for contact in problem.contacts:
        edges, plate = problem.mesh.edges(contact.edges), contact.plate
        for direction, name, spring in zip((edges.normal, edges.tangent), ("gap", "offset"), SPRINGS, strict=True):
            fixed = np.full(len(edges), contact not in problem.joints and (name == "gap" or contact.law == "tied"))
            for component, force in enumerate(("force_x", "force_y")):
                if getattr(plate, force, None) is not None:
                    fixed &= direction[:, component] == 0.0
            if fixed.any():
                d, chosen = direction[fixed], edges.take(fixed)
                values = _sampled(problem, chosen, f"Contact.{name}", getattr(contact, name))
                if plate is not None:
                    moved = np.moveaxis(plate.displacement(*problem.mesh.points_along(chosen, PLACES)), 0, -1)
                    values = values + (moved * vectors_along(chosen, d, PLACES)).sum(axis=2)
                rigid = getattr(contact, spring) is None and not (plate is not None and plate.driven)
                both = name == "offset" or contact.law != "unilateral"
                yield d, values, both, chosen, contact if rigid else None
