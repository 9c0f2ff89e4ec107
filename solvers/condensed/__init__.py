"""The quasi-variational inequality on the unknowns that the contact feels, solved directly.

systems           (D2) in trace coordinates, everything else eliminated once, or in all unknowns, sparse; and what the
                  interior point method needs of either: Newton's matrices
complementarity   the bounds as one mixed complementarity problem, the friction threshold moving with the pressure, and
                  equations between coordinates, solved for some of them
interior_point    its primal-dual interior point method, its last digits, and what follows the central path where that
                  turns back
method            these with defect corrections: one start of the method
"""

from solvers.basics.front import front

__getattr__ = front(__name__)
