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

_AT_REST = 1e-6  # unit of strain of a body without any load
_NONE = 1e-60  # strain up to which a load counts as zero: energies, and quotients by it, would leave double precision
REACH = 100.0
"""Distance from the body, in units of displacement, to which farther obstacles are first moved, see `Scales`."""

PLACES: FloatArray = np.concatenate([[0.0], gauss_legendre(8)[0], [1.0]])  # points of an edge where data are sampled


@dataclass(frozen=True)
class Scales:
    """Units of the dimensionless problem."""

    length: float  # L, the longer side of the bounding box [length]
    stress: float  # S, the largest stress the data suggest [stress]
    compliance: float  # C = max(c11, c22) of the body's materials [1/stress]
    loaded: bool = True  # whether S comes from loads or displacements, not from a body at rest
    # Largest distance of an obstacle from the body [D]; farther obstacles are moved to it. As long as the body does not
    # reach them only the width of the gap changes, and far larger numbers would drown all others in rounding. Infinite
    # if the body did reach an obstacle that had been moved.
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
        """Sizes of stress, displacement and length that count as rounding in these units."""
        return Rounding.of(self.stress, self.displacement, self.length)

    @classmethod
    def of(cls, problem: ContactProblem) -> "Scales":
        """Scales of a problem.

        S is the largest of: the prescribed tractions, the range of the body-force potential, the displacement that
        supports and obstacles force on the body (see `_forced`) over C L, the mean stress under plates driven by force,
        the pressure of fluids in contacts, and the stress of initial strains that are held. Without any load S is the
        stress of a strain of 1e-6, or the largest cohesion if that is less.
        """
        length = problem.mesh.length
        compliance = max(float(material.compliance[:2, :2].diagonal().max()) for material in problem.materials)
        tractions = problem.prescribed(Traction)
        sizes = [_largest(problem, each.edges, each.name, each.value) for each in tractions]
        if callable(problem.body_potential):
            values = evaluate("ContactProblem.body_potential", problem.body_potential, *problem.mesh.vertices.T)
            sizes.append(float(np.ptp(values)))
        sizes.append(_forced(problem) / (compliance * length))
        for contact in problem.contacts:
            edges = problem.mesh.edges(contact.edges)
            sizes.append(_largest(problem, edges, "Contact.pore_pressure", contact.pore_pressure, 0.0))
            if contact.plate is not None:  # mean stresses: forces over the contact's length, moments over length × arm
                plate, line = contact.plate, float(edges.length.sum())
                sizes += [abs(plate.force_x or 0.0) / line, abs(plate.force_y or 0.0) / line]
                if plate.moment is not None:
                    centre = centre_of(problem.mesh.vertices, edges)
                    arm = max(abs(at - place) for at, place in zip(centre, plate.reference(*centre), strict=True))
                    sizes.append(abs(plate.moment_about(*centre)) / (line * max(line, arm)))
        if is_strained(problem):
            x, y = np.moveaxis(problem.mesh.corners, -1, 0)
            sizes.append(float(np.abs(stress_at_rest(problem, np.arange(problem.mesh.cell_count), x, y)).max()))
        if max(sizes) * compliance > _NONE:
            return cls(length, max(sizes), compliance)
        given = [(problem.mesh.edges(each.edges), "Contact.cohesion", each.cohesion) for each in problem.contacts]
        cohesion = max([_largest(problem, *each, 0.0) for each in given], default=0.0)
        least = cohesion if cohesion * compliance > _NONE else np.inf
        return cls(length, min(_AT_REST / compliance, least), compliance, loaded=False)


def _sampled(problem: ContactProblem, edges: Edges, name: str, value: Field) -> FloatArray:
    """Values of a field at the `PLACES` of edges (n, q); (n, 1) for a constant."""
    if not callable(value):
        return np.full((len(edges), 1), float(value))
    return evaluate(name, value, *problem.mesh.points_along(edges, PLACES))


def _largest(problem: ContactProblem, edges: Edges, name: str, value: Field, minimum: float | None = None) -> float:
    """The largest size of a field at the `PLACES` of edges."""
    if not callable(value):
        return abs(value)
    return float(np.abs(evaluate(name, value, *problem.mesh.points_along(edges, PLACES), minimum=minimum)).max())


def _forced(problem: ContactProblem) -> float:
    """The stretch or squeeze [length] that supports and obstacles force on the body, along x and y if possible.

    A prescribed displacement bounds u from both sides, a unilateral contact from one, u_N ≤ g. Bilateral and tied
    contacts bound u_N from both sides, and tied contacts also u_T by their offset w. Offsets of other contacts force
    only what friction can carry, and do not count. Nor do joints, and the components of plates driven by force.

    If all directions are x or y, the forced displacement along each is the largest lower bound less the smallest upper
    bound; the larger one counts. Else it is twice the least distance by which a translation of the body misses a bound,
    by a linear program.
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
        by_side = np.array([np.where(d == sign, limit[:, None], np.inf) for sign in (1.0, -1.0)])
        return max(0.0, -float(by_side.min(axis=1, initial=np.inf).sum(axis=0).min()))
    if limit.min() >= 0.0:  # u = 0 meets all bounds
        return 0.0
    box = [(None, None), (None, None), (0.0, None)]  # translation and the distance, which is minimised
    A = np.column_stack([d, -np.ones(len(d))])
    program = solved(np.array([0.0, 0.0, 1.0]), A_ub=A, b_ub=limit, bounds=box)
    return 2.0 * float(program.x[2]) if program.solved else 0.0  # S need not be accurate


def bounds(problem: ContactProblem) -> Iterator[tuple[FloatArray, FloatArray, bool, Edges, Contact | None]]:
    """Bounds d·u ≤ limit of supports and obstacles: d (n, 2), limits (n, q) at `PLACES` [length], whether d·u = limit.

    Then come the edges, along whose arcs d turns, and the contact: None for supports, springs and driven plates.
    """
    for given in problem.prescribed(Displacement):
        yield given.direction, _sampled(problem, given.edges, given.name, given.value), True, given.edges, None
    for contact in problem.contacts:
        edges, plate = problem.mesh.edges(contact.edges), contact.plate
        for direction, name, spring in zip((edges.normal, edges.tangent), ("gap", "offset"), SPRINGS, strict=True):
            # edges whose obstacle cannot give way along this direction
            fixed = np.full(len(edges), contact not in problem.joints and (name == "gap" or contact.law == "tied"))
            for component, force in enumerate(("force_x", "force_y")):
                if getattr(plate, force, None) is not None:
                    fixed &= direction[:, component] == 0.0
            if fixed.any():
                d, chosen = direction[fixed], edges.take(fixed)
                values = _sampled(problem, chosen, f"Contact.{name}", getattr(contact, name))
                if plate is not None:
                    motion = np.moveaxis(plate.displacement(*problem.mesh.points_along(chosen, PLACES)), 0, -1)
                    values = values + (motion * vectors_along(chosen, d, PLACES)).sum(axis=2)
                rigid = getattr(contact, spring) is None and not (plate is not None and plate.driven)
                is_equation = name == "offset" or contact.law != "unilateral"
                yield d, values, is_equation, chosen, contact if rigid else None
