"""Square roots of compliances c of (xx, yy, xy), which plane strain of an incompressible material makes singular."""

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray

_NEARLY = 1e-4  # of c_11: a resistance to pressure below which Cholesky's root of an element's energy loses digits


def compliance_roots(compliances: FloatArray) -> FloatArray:
    """L lower triangular with L Lᵀ = c, for c (n, 3, 3) positive semi-definite with c_11, c_33 > 0.

    Where a pivot is zero, up to rounding, so is its column: a constant pressure has no energy in an incompressible
    body.
    """
    c, roots = compliances, np.zeros_like(compliances)
    roots[:, 0, 0] = np.sqrt(c[:, 0, 0])
    roots[:, 1:, 0] = c[:, 1:, 0] / roots[:, :1, 0]
    roots[:, 1, 1] = np.sqrt(np.maximum(c[:, 1, 1] - roots[:, 1, 0] ** 2, 0.0))
    rest = c[:, 2, 1] - roots[:, 2, 0] * roots[:, 1, 0]
    roots[:, 2, 1] = np.divide(rest, roots[:, 1, 1], out=np.zeros_like(rest), where=roots[:, 1, 1] > 0.0)
    roots[:, 2, 2] = np.sqrt(np.maximum(c[:, 2, 2] - roots[:, 2, 0] ** 2 - roots[:, 2, 1] ** 2, 0.0))
    return roots


def nearly_incompressible(compliances: FloatArray) -> BoolArray:
    """Whether pressure strains a material (n, 3, 3) next to nothing beside what shear does, shape (n,)."""
    in_plane = compliances[:, :2, :2].sum(axis=(1, 2))
    return np.asarray(in_plane < _NEARLY * (compliances[:, 0, 0] + compliances[:, 1, 1]))
