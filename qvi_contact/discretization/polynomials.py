"""Whether data are polynomials, as far as many points show."""

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray, evaluate
from qvi_contact.element import bernstein, legendre
from qvi_contact.mesh.edges import Edges
from qvi_contact.problem.problem import ContactProblem

_ROUNDING = 1e-9  # of the largest value


def is_polynomial(problem: ContactProblem, edges: Edges, name: str, field: Field, most: int) -> bool:
    """Whether a field is a polynomial of that degree along each edge."""
    return _fits(evaluate(name, field, *problem.mesh.points_along(edges, bernstein.SAMPLES)), bernstein.SAMPLES, most)


def _fits(values: FloatArray, t: FloatArray, degree: int) -> bool:
    """Whether rows of values (n, k) at points t (k,) are polynomials of that degree."""
    return spanned(values, legendre.basis(degree, t))


def spanned(values: FloatArray, functions: FloatArray) -> bool:
    """Whether rows of values (n, k) are combinations of the columns of functions (k, c)."""
    basis = np.linalg.qr(functions)[0]
    return bool(np.abs(values - values @ basis @ basis.T).max() <= _ROUNDING * np.abs(values).max())
