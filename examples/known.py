"""What the scripts of this folder share: numbers beside the known ones, and the picture."""

import sys
from dataclasses import dataclass

from qvi_contact import ContactProblem, ContactResult, LimitLoad
from qvi_contact.units import Units


@dataclass(frozen=True)
class Known:
    """A number that is known without this package.

    Attributes
    ----------
    quantity
        What it is, with its unit.
    computed, known
        The number of this package, and the known one.
    tolerance
        How far apart they may be, as a share of the known number.
    source
        How it is known.

    """

    quantity: str
    computed: float
    known: float
    tolerance: float
    source: str

    @property
    def holds(self) -> bool:
        """Whether the two agree."""
        return abs(self.computed - self.known) <= self.tolerance * abs(self.known)

    def __str__(self) -> str:
        """One line of the table."""
        numbers = f"{self.computed:12.8g} {self.known:12.8g} {self.tolerance:9.0g}"
        return f"{self.quantity:34s} {numbers}  {self.source}{'' if self.holds else '  <- OFF'}"


def compare(rows: list[Known], result: ContactResult, units: Units) -> None:
    """Print the table, and draw the result if the command line names a picture; exit status 1 if a number is off."""
    print(result.message)
    print(f"{'':34s} {'computed':>12s} {'known':>12s} {'tolerance':>9s}")
    print(*rows, sep="\n")
    if len(sys.argv) > 1:
        from qvi_contact.plots import result_figure, save_figure

        save_figure(sys.argv[1], result_figure(result, units))
    if not (result.certificate.passed and all(row.holds for row in rows)):
        sys.exit(1)


def draw_mechanism(problem: ContactProblem, limit: LimitLoad, units: Units) -> None:
    """Draw how blocks move beyond the limit load, if the command line names a second picture."""
    if len(sys.argv) > 2 and limit.mechanism is not None:
        from qvi_contact import plots

        plots.save_figure(sys.argv[2], plots.limit_figure(problem, limit, units))
