"""A second opinion on a solution: whether there is another one.

With friction the solution of (D2) need not be unique, and each method ends at the one its own way leads to. Pivoting
comes from elsewhere than an interior point method. Where it ends at other tractions, and the certificate passes there
too, there are at least two solutions: a fact. Where it ends at the same ones nothing follows.
"""

import numpy as np

from solvers.basics.types import Vector
from solvers.certificate.certificate import certify
from solvers.inequality.compliance import Compliance
from solvers.inequality.problem import FrictionQVI
from solvers.pivoting.method import affordable, other_ends
from solvers.solution.finish import WHAT_TO_DO
from solvers.solution.solution import QVISolution

LARGEST_DOUBTED, LARGEST_PLAIN = 48, 16
"""Contact points up to which a second opinion is asked for, where the way to a solution had to turn or the first method
failed, and two ways are gone, and where nothing was the matter, and one way is: a few per cent of the solve."""

_OTHER = 1e-4  # difference of tractions, over the largest one, that is not the certificates' error


def another_solution(qvi: FrictionQVI, solution: QVISolution, tolerance: float, *, doubted: bool = True) -> str:
    """A sentence if there is a certified solution with other tractions at the end of another way, else nothing."""
    largest = LARGEST_DOUBTED if doubted else LARGEST_PLAIN
    moving = (qvi.mu > 0.0) & (qvi.cap > qvi.cohesion)
    if not (moving.any() and qvi.m <= largest and affordable(qvi)):
        return ""
    size = solution.certificate.scales["stress"]
    compliance = Compliance(qvi)
    own = compliance.tractions(solution.z)
    for m in other_ends(qvi, compliance, both=doubted):
        difference = float(np.abs(compliance.bonded - compliance.relief(m) - own).max()) / size
        if difference > _OTHER and _certified(qvi, compliance, m, tolerance):
            return (
                "The discrete problem has several solutions: there is another one, certified as well, whose contact "
                f"tractions differ by up to {100.0 * difference:.2g} % of the largest. {WHAT_TO_DO}"
            )
    return ""


def _certified(qvi: FrictionQVI, compliance: Compliance, m: Vector, tolerance: float) -> bool:
    z, nu = compliance.unknowns(m)
    return certify(qvi, z, m[: qvi.m], m[qvi.m :], nu, tolerance).passed
