"""The plate with this package: stresses in equilibrium, the inequality solved directly by the condensed method.

The package is loaded by `build`, not before.
"""

from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from qvi_contact import Discretization

MODULE: Final = "qvi_contact"

TOLERANCE: Final = 1e-8
"""That the certificate must confirm."""


def build(case: dict[str, Any]) -> "EquilibriumPlate":
    """The plate of a case (see `cases`), ready to be solved."""
    from qvi_contact import discretize
    from qvi_contact.gallery import compressed_plate

    cells = (case["cells"], case["cells"])
    return EquilibriumPlate(discretize(compressed_plate(case["friction"], cells, grading=case["grading"])))


class EquilibriumPlate:
    """A discretisation that is solved once; another solve would find what the first has factorised."""

    def __init__(self, discretization: "Discretization") -> None:
        self._discretization = discretization

    def solve(self) -> dict[str, Any]:
        """As `qvi_contact.solve` does it by default: P/2, unknowns, iterations, the certificate's residual, status."""
        from qvi_contact import solve
        from solvers.factorisation.choice import using

        with using("auto", 1, self._discretization.qvi.n):
            fitted = self._discretization.fitted()
        result = solve(fitted, method="condensed", tolerance=TOLERANCE, threads=1)
        return {
            "status": result.status.value,
            "message": "" if result.certificate.passed else result.message,
            "half_force": float(result.contacts["plate"].normal_force) if result.has_state else None,
            "unknowns": int(result.solution.problem.n),
            "iterations": int(result.iterations),
            "residual": float(result.certificate.accuracy),
            "version": _version(),
        }


def _version() -> str:
    try:
        return version("qvi-contact")
    except PackageNotFoundError:
        return "not installed"
