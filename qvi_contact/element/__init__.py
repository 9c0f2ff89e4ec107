"""Finite elements for the Airy stress function, one file each, and the polynomials they are made of."""

from qvi_contact.element.hermite import hermite
from qvi_contact.element.hsieh_clough_tocher import hsieh_clough_tocher
from solvers.basics.front import front

__all__ = ["hermite", "hsieh_clough_tocher"]

__getattr__ = front(
    __name__,
    {
        "affine": ("AffineTriangles", "EDGES"),
        "bernstein": ("absolute_integrals", "gauss_interpolation", "product_integrals"),
        "bogner_fox_schmit": ("Grid", "Line"),
        "compliance": ("compliance_roots",),
        "hermite": ("gauss_legendre", "scaled_hermite"),
        "legendre": ("from_values",),
        "quadrature": ("adapted", "constant"),
        "triangle": ("exponents",),
    },
)
