"""The quasi-variational inequality on the unknowns that the contact feels, solved directly.

coordinates       (D2) in trace coordinates, everything else eliminated once, or in all unknowns, sparse
systems           what the interior point method needs of either, the dense Newton matrices, and those for the last
                  digits
complementarity   the bounds as one mixed complementarity problem, the friction threshold moving with the pressure, and
                  equations between coordinates, solved for some of them
interior_point    its primal-dual interior point method, and what follows the central path where it turns back
method            these with defect corrections: one start of the method
"""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "coordinates": ("DenseCoordinates", "SparseCoordinates"),
        "complementarity": ("Complementarity",),
        "interior_point": (
            "GAP",
            "InteriorPoint",
            "Newton",
            "Point",
            "Residuals",
            "start_near",
            "CentralPath",
        ),
        "systems": ("DenseSystem", "FRICTION_SHARES", "PathWeights"),
    },
)
