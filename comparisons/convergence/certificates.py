"""The certificate of a solution as plain values for the rows of a study."""

from typing import Any

from solvers import QVISolution


def plain_certificate(solution: QVISolution) -> dict[str, Any]:
    """Whether it passed at the tolerance asked for, the accuracy it confirms, and the measure that decides it."""
    found = solution.certificate
    return {"passed": found.passed, "tolerance": found.tolerance, "accuracy": found.accuracy, "worst": found.worst}
