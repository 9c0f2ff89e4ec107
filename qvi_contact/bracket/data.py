"""Whether the data are polynomials that both models hold exactly, as far as many points show.

Bounds need data that are the same in both models. Functions are looked at in `bernstein.SAMPLES` of every edge and
13 × 13 points of every cell; what happens between those nobody sees.
"""

from collections.abc import Iterator

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray, evaluate
from qvi_contact.element import bernstein, legendre
from qvi_contact.mesh.rectilinear import GridEdges
from qvi_contact.problem.conditions import Contact, Displacement, Traction
from qvi_contact.problem.problem import ContactProblem

_CELL: FloatArray = (np.arange(13.0) + 0.5) / 13.0
_CELL_DEGREE = 5  # of φ in x and in y: the work of its stresses is then integrated exactly
_SPOKEN = {
    "Contact.cohesion": "The cohesion, or Tresca's bound,",
    "Contact.shear_limit": "The shear limit",
    "Contact.gap": "The gap",
    "Contact.offset": "The offset",
    "ContactProblem.body_potential": "The body potential",
}
_ROUNDING = 1e-9  # of the largest value


def data_reasons(problem: ContactProblem, degree: int) -> tuple[str, ...]:
    """Which data are no polynomials of the degree that both models hold exactly, one sentence each.

    Supports, gaps and offsets are held up to the degree of the displacements, tractions up to 2 along an edge, friction
    bounds c and t_max up to 2, a body potential up to 5 in each direction on cells and 1 along contacts.
    """
    found = [
        f"{_SPOKEN.get(name, name)} on {place!r} is no polynomial of degree {most} on every edge."
        for name, place, edges, field, most in _on_edges(problem, degree)
        if callable(field) and not _is_polynomial(problem, edges, name, field, most)
    ]
    if callable(problem.body_potential) and not _cells_hold(problem, problem.body_potential):
        found.append(f"The body potential is no polynomial of degree {_CELL_DEGREE} on every cell.")
    return tuple(dict.fromkeys(found))


def _on_edges(problem: ContactProblem, degree: int) -> Iterator[tuple[str, str, GridEdges, Field, int]]:
    """(name, edge set, edges, field, largest degree) of all data on edges."""
    for condition in problem.cartesian_conditions:
        edges = problem.grid.edges(condition.edges)
        if isinstance(condition, (Traction, Displacement)):
            most = degree if isinstance(condition, Displacement) else 2
            for component in ("x", "y"):
                value: Field | None = getattr(condition, component)
                if value is not None:
                    yield f"{type(condition).__name__}.{component}", condition.edges, edges, value, most
        elif isinstance(condition, Contact):
            yield "Contact.gap", condition.name, edges, condition.gap, degree
            yield "Contact.offset", condition.name, edges, condition.offset, degree
            if condition.law != "tied":
                yield "Contact.cohesion", condition.name, edges, condition.cohesion, 2
                yield "ContactProblem.body_potential", condition.name, edges, problem.body_potential, 1
            if condition.shear_limit is not None:
                yield "Contact.shear_limit", condition.name, edges, condition.shear_limit, 2


def _is_polynomial(problem: ContactProblem, edges: GridEdges, name: str, field: Field, most: int) -> bool:
    """Whether a field is a polynomial of that degree along each edge."""
    return _fits(evaluate(name, field, *problem.grid.points_along(edges, bernstein.SAMPLES)), bernstein.SAMPLES, most)


def _cells_hold(problem: ContactProblem, field: Field) -> bool:
    """Whether a field is a polynomial of degree 5 in x, and in y, on each cell."""
    mesh = problem.grid
    row, column = np.nonzero(mesh.active)
    x = mesh.x[column][:, None, None] + np.diff(mesh.x)[column][:, None, None] * _CELL
    y = mesh.y[row][:, None, None] + np.diff(mesh.y)[row][:, None, None] * _CELL[:, None]
    values = evaluate("ContactProblem.body_potential", field, *np.broadcast_arrays(x, y))
    turned = np.swapaxes(values, 1, 2)
    return all(_fits(part.reshape(-1, len(_CELL)), _CELL, _CELL_DEGREE) for part in (values, turned))


def _fits(values: FloatArray, t: FloatArray, degree: int) -> bool:
    """Whether rows of values (n, k) at points t (k,) are polynomials of that degree."""
    basis = np.linalg.qr(legendre.basis(degree, t))[0]
    return bool(np.abs(values - values @ basis @ basis.T).max() <= _ROUNDING * np.abs(values).max())
