"""Characteristic length, stress and displacement that make the algebraic problem dimensionless."""

from dataclasses import dataclass

import numpy as np

from qvi_contact.checks import FloatArray, evaluate
from qvi_contact.conditions import Displacement, Traction
from qvi_contact.mesh import HORIZONTAL
from qvi_contact.problem import ContactProblem


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

    """

    length: float
    stress: float
    compliance: float

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

        S is the largest of: the prescribed tractions, the range of the body-force potential, and the stress
        1/(C L) times the range of prescribed displacements (obstacle positions included). Ranges, because neither a
        constant potential nor a common translation strains the body. Without any load S = 1/C.
        """
        length = problem.mesh.length
        compliance = max(float(material.compliance[:2, :2].diagonal().max()) for material in problem.materials)
        sizes = [0.0]
        middle = problem.mesh.boundary_midpoints
        for component, edges, value in problem.prescribed(Traction):
            sizes.append(np.abs(evaluate(f"Traction.{'xy'[component]}", value, *middle[edges].T)).max())
        nodes = problem.mesh.coordinates[problem.mesh.active_nodes.ravel()]
        potential = evaluate("ContactProblem.body_potential", problem.body_potential, *nodes.T)
        sizes.append(np.ptp(potential))
        stiffness = 1.0 / (compliance * length)
        sizes += [stiffness * np.ptp(values) for values in _displacement_data(problem) if len(values)]
        stress = float(max(sizes))
        return cls(length, stress if stress > 0.0 else 1.0 / compliance, compliance)


def _displacement_data(problem: ContactProblem) -> tuple[FloatArray, FloatArray]:
    """Prescribed values of u_x and of u_y at the midpoints of all edges that have any."""
    middle, boundary = problem.mesh.boundary_midpoints, problem.mesh.boundary
    found: tuple[list[FloatArray], list[FloatArray]] = ([], [])
    for component, edges, value in problem.prescribed(Displacement):
        found[component].append(evaluate(f"Displacement.{'xy'[component]}", value, *middle[edges].T))
    for contact in problem.contacts:
        edges = problem.mesh.edge_set(contact.edges)
        gap = evaluate("Contact.gap", contact.gap, *middle[edges].T) * boundary.sign[edges]
        offset = evaluate("Contact.offset", contact.offset, *middle[edges].T)
        horizontal = boundary.axis[edges] == HORIZONTAL
        found[0].append(np.where(horizontal, offset, gap))
        found[1].append(np.where(horizontal, gap, offset))
    return tuple(np.concatenate([np.empty(0), *values]) for values in found)  # type: ignore[return-value]
