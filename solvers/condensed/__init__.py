"""The quasi-variational inequality on the unknowns that the contact feels, solved directly.

reduction         (D2) in trace coordinates, everything else eliminated once
whole             (D2) in all unknowns, sparse, where the contact is a large share of them
systems           what the interior point method needs of either, and the dense Newton matrices
complementarity   the bounds as one mixed complementarity problem, the friction threshold moving with the pressure
interior_point    its primal-dual interior point method
central_path      what follows the central path where it turns back
method            these four with defect corrections; `solve_condensed`
"""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "central_path": ("CentralPath",),
        "complementarity": ("Complementarity",),
        "interior_point": ("InteriorPoint", "Newton", "Residuals", "Step"),
        "method": ("CondensedOptions",),
        "reduction": ("Reduction",),
        "systems": ("DenseSystem", "FRICTION_SHARES", "Shares"),
        "warm_start": ("GAP", "start_near"),
        "whole": ("Whole",),
    },
)
