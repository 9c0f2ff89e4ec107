"""The quasi-variational inequality on the unknowns that the contact feels, solved directly.

coordinates       (D2) in trace coordinates, everything else eliminated once, or in all unknowns, sparse
systems           what the interior point method needs of either, and the dense Newton matrices
equations         equations between coordinates, solved for some of them
complementarity   the bounds as one mixed complementarity problem, the friction threshold moving with the pressure
interior_point    its primal-dual interior point method
saddle            its Newton steps for the last digits
central_path      what follows the central path where it turns back
method            these with defect corrections; `solve_condensed`
"""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "central_path": ("CentralPath",),
        "coordinates": ("Reduction", "Whole"),
        "complementarity": ("Complementarity",),
        "interior_point": ("GAP", "InteriorPoint", "Newton", "Point", "Residuals", "start_near"),
        "method": ("CondensedOptions",),
        "systems": ("DenseSystem", "FRICTION_SHARES", "Shares"),
    },
)
