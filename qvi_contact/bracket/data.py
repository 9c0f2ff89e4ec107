"""Whether the data are polynomials that both models hold exactly, as far as many points show.

Bounds need data that are the same in both models. Functions are looked at in `bernstein.SAMPLES` of every edge and 169
points of every cell; what happens between those nobody sees.
"""

from collections.abc import Iterator

import numpy as np

from qvi_contact.basics.checks import Field, evaluate
from qvi_contact.companion.triangle import triangle
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import is_polynomial, physical, spanned
from qvi_contact.mesh.edges import Edges
from qvi_contact.problem.conditions import Contact, Displacement, Traction, components

_DIVISIONS = 13  # of each side of a cell; φ is looked at in the middle of the parts
_CELL_DEGREE = 5  # of φ: the work of its stresses is then integrated exactly
_SPOKEN = {
    "Contact.cohesion": "The cohesion, or Tresca's bound,",
    "Contact.shear_limit": "The shear limit",
    "Contact.pore_pressure": "The pore pressure",
    "Contact.gap": "The gap",
    "Contact.offset": "The offset",
    "ContactProblem.body_potential": "The body potential",
}


def data_reasons(discretization: Discretization, degree: int) -> tuple[str, ...]:
    """Which data are no polynomials of the degree that both models hold exactly, one sentence each.

    Supports, gaps and offsets are held up to the degree of the displacements, tractions and friction bounds c and t_max
    up to that of tractions along an edge, p − 2, a body potential up to 5 on cells, and up to p − 2 along contacts.
    """
    problem = discretization.problem
    found = [
        f"{_SPOKEN.get(name, name)} on {place!r} is not a polynomial of degree {most} on every edge."
        for name, place, edges, field, most in _on_edges(discretization, degree)
        if callable(field) and not is_polynomial(problem, edges, name, field, most)
    ]
    if callable(problem.body_potential) and not _cells_hold(discretization, problem.body_potential):
        found.append(f"The body potential is not a polynomial of degree {_CELL_DEGREE} on every cell.")
    return tuple(dict.fromkeys(found))


def _on_edges(discretization: Discretization, degree: int) -> Iterator[tuple[str, str, Edges, Field, int]]:
    """(name, edge set, edges, field, largest degree) of all data on edges."""
    problem, space = discretization.problem, discretization.space
    for condition in problem.cartesian_conditions:
        edges = problem.mesh.edges(condition.edges)
        if isinstance(condition, (Traction, Displacement)):
            most = degree if isinstance(condition, Displacement) else space.traction_degree
            for component, value in components(condition).items():
                yield f"{type(condition).__name__}.{component}", condition.edges, edges, value, most
        elif isinstance(condition, Contact):
            yield "Contact.gap", condition.name, edges, condition.gap, degree
            yield "Contact.offset", condition.name, edges, condition.offset, degree
            if condition.law != "tied":
                yield "Contact.cohesion", condition.name, edges, condition.cohesion, space.traction_degree
                yield "Contact.pore_pressure", condition.name, edges, condition.pore_pressure, space.traction_degree
                body = "ContactProblem.body_potential", condition.name, edges, problem.body_potential
                yield *body, space.traction_degree
            if condition.shear_limit is not None:
                yield "Contact.shear_limit", condition.name, edges, condition.shear_limit, space.traction_degree


def _cells_hold(discretization: Discretization, field: Field) -> bool:
    """Whether a field is a polynomial of degree 5 on each triangle."""
    problem, space = discretization.problem, discretization.space
    corners, parts = space.lattice(_DIVISIONS)
    t = corners[parts].mean(axis=1)
    places = space.points(np.arange(problem.mesh.cell_count), t)
    values = evaluate("ContactProblem.body_potential", field, *physical(problem, discretization.scales, places))
    return spanned(values, triangle(_CELL_DEGREE).values(t[:, -2:]))
