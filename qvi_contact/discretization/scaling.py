"""Characteristic length, stress and displacement that make the algebraic problem dimensionless."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray, evaluate
from qvi_contact.element.hermite import gauss_legendre
from qvi_contact.mesh.rectilinear import HORIZONTAL, VERTICAL, GridEdges
from qvi_contact.problem.conditions import Contact, Displacement, Traction
from qvi_contact.problem.problem import ContactProblem

_SAMPLES = 8  # points between the ends of an edge where data are looked at


@dataclass(frozen=True)
class Scales:
    """Units of the dimensionless problem.

    Attributes
    ----------
    length : float
        L, the longer side of the bounding box [length].
    stress : float
        S, the largest stress the data suggest [stress].
    compliance : float
        C = max(c11, c22) of the body's materials [1/stress].
    loaded : bool
        Whether S comes from loads or displacements, not from a body at rest.

    """

    length: float
    stress: float
    compliance: float
    loaded: bool = True

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

    @classmethod
    def of(cls, problem: ContactProblem) -> "Scales":
        """Scales of a problem.

        S is the largest of: the prescribed tractions, the range of the body-force potential, and the stress 1/(C L)
        times the displacement that supports and obstacles force on the body (see `_forced`), and the mean stress under
        plates driven by force; without any of these the largest cohesion. Neither a constant
        potential, nor a common translation, nor an obstacle far away strains the body. Without any load S = 1/C.
        """
        length = problem.mesh.length
        compliance = max(float(material.compliance[:2, :2].diagonal().max()) for material in problem.materials)
        sizes = [0.0]
        for component, edges, value in problem.prescribed(Traction):
            values = evaluate(f"Traction.{'xy'[component]}", value, *_samples(problem, edges))
            sizes.append(float(np.abs(values).max()))
        nodes = problem.mesh.coordinates[problem.mesh.active_nodes.ravel()]
        potential = evaluate("ContactProblem.body_potential", problem.body_potential, *nodes.T)
        sizes.append(float(np.ptp(potential)))
        sizes += [forced / (compliance * length) for forced in _forced(problem)]
        sizes += _plate_stresses(problem)
        stress = max(sizes) or min(1.0 / compliance, max(_cohesions(problem), default=0.0))
        return cls(length, stress if stress > 0.0 else 1.0 / compliance, compliance, max(sizes) > 0.0)


def _samples(problem: ContactProblem, edges: GridEdges | IntArray) -> tuple[FloatArray, FloatArray]:
    """Coordinates x, y of the ends of edges and of Gauss points between them, shape (edges, points) each."""
    chosen = edges if isinstance(edges, GridEdges) else problem.mesh.boundary.take(edges)
    return problem.mesh.points_along(chosen, np.concatenate([[0.0], gauss_legendre(_SAMPLES)[0], [1.0]]))


def _cohesions(problem: ContactProblem) -> list[float]:
    """The largest cohesion of each contact [stress]."""
    return [
        float(evaluate("Contact.cohesion", contact.cohesion, *_samples(problem, edges), minimum=0.0).max())
        for contact, edges in ((contact, problem.mesh.edges(contact.edges)) for contact in problem.contacts)
    ]


def _plate_stresses(problem: ContactProblem) -> list[float]:
    """Forces of plates over the length of their contacts, moments over its square [stress]."""
    sizes = []
    for contact in problem.contacts:
        if contact.plate is not None:
            plate, edges = contact.plate, problem.mesh.edges(contact.edges)
            lengths = edges.length
            length = float(lengths.sum())
            middles = problem.mesh.points_along(edges, np.array([0.5]))
            centre = np.array([np.average(part[:, 0], weights=lengths) for part in middles])
            sizes += [abs(plate.force_x or 0.0) / length, abs(plate.force_y or 0.0) / length]
            if plate.moment is not None:
                arm = float(np.abs(centre - plate.reference(*centre)).max())
                sizes.append(abs(plate.moment_about(*centre)) / (length * max(length, arm)))
    return sizes


def _forced(problem: ContactProblem) -> tuple[float, float]:
    """By how much supports and obstacles must squeeze or stretch the body along x and along y [length].

    A prescribed displacement bounds u from both sides, an obstacle from one: u ≤ g or −u ≤ g as n points. What is
    forced is the largest lower bound less the smallest upper one, if positive. Bilateral and tied contacts bound it
    from both sides, and tied ones by their offset w along the tangent. Obstacles that slide past (w) force nothing that
    friction does not limit; joints are left out, and plates in the components that are driven by force.
    """
    lower: tuple[list[float], list[float]] = ([], [])
    upper: tuple[list[float], list[float]] = ([], [])
    for component, edges, value in problem.prescribed(Displacement):
        values = evaluate(f"Displacement.{'xy'[component]}", value, *_samples(problem, edges))
        lower[component].append(float(values.max()))
        upper[component].append(float(values.min()))
    for contact in problem.contacts:
        for component, values, above, below in _held(problem, contact):
            if above:
                upper[component].append(float(values.min()))
            if below:
                lower[component].append(float(values.max()))
    along_x, along_y = (
        max(0.0, max(low) - min(up)) if low and up else 0.0 for low, up in zip(lower, upper, strict=True)
    )
    return along_x, along_y


def _held(problem: ContactProblem, contact: Contact) -> Iterator[tuple[int, FloatArray, bool, bool]]:
    """(component, where the obstacle is, whether it bounds u from above, from below) for each side of a contact."""
    if contact in problem.joints:
        return
    edges, boundary = problem.mesh.edge_set(contact.edges), problem.mesh.boundary
    driven = [getattr(contact.plate, name, None) is not None for name in ("force_x", "force_y")]
    both = contact.law != "unilateral"
    for axis, sign in product((HORIZONTAL, VERTICAL), (-1.0, 1.0)):
        facing = edges[(boundary.axis[edges] == axis) & (boundary.sign[edges] == sign)]
        normal, tangential = (1, 0) if axis == HORIZONTAL else (0, 1)
        if len(facing) and not driven[normal]:
            gap = evaluate("Contact.gap", contact.gap, *_samples(problem, facing))
            yield normal, sign * gap, sign > 0 or both, sign < 0 or both
        if len(facing) and not driven[tangential] and contact.law == "tied":
            yield tangential, evaluate("Contact.offset", contact.offset, *_samples(problem, facing)), True, True
