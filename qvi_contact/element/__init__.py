"""Finite elements for the Airy stress function, and the polynomials they are made of."""

from qvi_contact.element.hsieh_clough_tocher import hsieh_clough_tocher
from solvers.basics.front import front

__all__ = ["hsieh_clough_tocher"]

_EDGE = "absolute_integrals", "adapted", "constant", "gauss_legendre", "legendre_from_values", "product_integrals"
_TRIANGLE = "AffineTriangles", "EDGES", "exponents"

__getattr__ = front(__name__, {"hsieh_clough_tocher": ("compliance_roots",), "edge": _EDGE, "triangle": _TRIANGLE})
