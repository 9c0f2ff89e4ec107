"""The loaded pin with this package, on the same triangles: stresses of degree p − 2.

The package is loaded by `build`, not before.
"""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from qvi_contact import ContactProblem


def build(case: dict[str, Any], degree: int = 4) -> Callable[[], dict[str, Any]]:
    """What solves the pin of a case (see `comparisons.peers.pin.study.plain_pin`): it assembles each time."""
    from qvi_contact.gallery import loaded_pin

    return partial(_solved, loaded_pin(case["sectors"], case["friction"]), degree, case["radius"])


def _solved(problem: "ContactProblem", degree: int, radius: float) -> dict[str, Any]:
    """What `comparisons.peers.pin.study.MEASURED` names, unknowns, the certificate's residual, status."""
    from comparisons.peers.codes.equilibrium import TOLERANCE, ended
    from qvi_contact import solve

    found = solve(problem, degree=degree, tolerance=TOLERANCE)
    posed = found.solution
    answer = ended(
        found, unknowns=None if posed is None else int(posed.problem.n),
        iterations=0 if posed is None else int(posed.iterations),
    )  # fmt: skip
    return answer | _measured(found, radius) if found.has_state else answer


def _measured(found: Any, radius: float) -> dict[str, float]:
    hole = found.contacts["pin"]
    return {
        "moved": float(found.displacement(radius, 0.0)[0]),
        "normal": -float(hole.weights @ hole.normal_stress),
        "shear": -float(hole.weights @ hole.tangential_stress),
        "carried": -float(found.resultant("wall").x),
    }
