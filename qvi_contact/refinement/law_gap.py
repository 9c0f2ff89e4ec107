"""How far a mesh's tractions, and the motion with which it gives way, are from the contact law between its rows.

At the limit a mesh gives way by a motion with the opening w and the slip s against the shear: the multipliers of its
rows. It obeys the law in the sense of the rows. At points the body may enter the obstacle, or slip without the opening
that friction asks for. The part of an edge is the work that the law gives the motion, made admissible at points, less
that of the tractions:

    w' = max(w, μ|s|)   (w' = max(w, 0) under a cap),     ∫ (π(w', s) − |σ_N| w' − σ_T s) ds ≥ 0,

for unilateral contacts, with π of (D23). It is zero on all edges if the mesh gives way as the body would, and of the
size of pressure times motion on the edge in which the body turns, or where slip ends.

In `docs/theory.md`: (D25).
"""

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.discretization.contact_rows import ContactRows


def law_gap(
    rows: ContactRows, normal: FloatArray, shear: FloatArray, opening: FloatArray, slip: FloatArray
) -> FloatArray:
    """The parts (m,) of the points of a contact, dimensionless.

    Parameters
    ----------
    rows : ContactRows
        The contact.
    normal, shear : (m,) arrays
        σ_N and σ_T at its points, dimensionless.
    opening, slip : (m,) arrays
        w and s there, times the weights of the points.

    """
    size, friction, unilateral = np.abs(slip), rows.friction, ~rows.bilateral
    capped, rough = np.isfinite(rows.shear_limit), friction > 0.0
    admitted = np.maximum(opening, np.where(capped, 0.0, friction * size))
    opening = np.where(unilateral, admitted, opening)
    room = np.divide(np.maximum(opening, 0.0), friction, out=size.copy(), where=rough)
    dilatant = np.where(unilateral, np.minimum(size, room), np.where(rough, 0.0, size))
    work = np.minimum(rows.cohesion, rows.shear_limit) * dilatant
    work += np.where(capped, rows.shear_limit, 0.0) * (size - dilatant)
    return np.asarray(np.maximum(work - normal * opening - shear * slip, 0.0))
