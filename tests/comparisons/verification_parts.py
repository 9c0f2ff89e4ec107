"""A row that passes and a document made of it, for tests of the manual."""

from comparisons.verification import study
from comparisons.verification.proof import Proof
from comparisons.verification.row import absolute

PASSING = absolute("a number", 1.0, 1.0, 1e-3, "by hand", Proof(passed=True, text="by hand"))


def problem(quick):
    """A number."""
    del quick
    yield PASSING


DOCUMENT = study.run({"paper": {"number": problem}}, quick=True, advance=lambda _="": None)
