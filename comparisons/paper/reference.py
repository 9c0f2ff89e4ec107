"""The numbers that Więckowski (1992) prints."""

import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from qvi_contact import paper
from qvi_contact.paper import QuarterPlate
from solvers import FrictionQVI, QVISolution, solve_qvi


@dataclass(frozen=True)
class Reference:
    """Data of the paper's section 5; E in MPa, U and ω_T in the paper's length.

    `table` maps the friction coefficient to P/2 of Table 1, `figures` to the number of Figs 2-5 and the largest
    |principal stress| [MPa]; without friction P/2 = E U.
    """

    young: float
    poisson: float
    displacement: float
    cells: int
    iterations: int
    omega_T: float  # noqa: N815  # the paper's symbol
    table: dict[float, float]
    figures: dict[float, tuple[int, float]]
    exact_without_friction: float

    def plate(self, friction: float) -> QuarterPlate:
        """The example in the paper's own system."""
        data: dict[str, Any] = {"young": self.young, "poisson": self.poisson, "displacement": self.displacement}
        return paper.plate(friction, (self.cells, self.cells), **data)

    def uzawa(self, qvi: FrictionQVI, **options: Any) -> QVISolution:
        """The paper's iteration with its step; the problem's unit of displacement is U."""
        return solve_qvi(qvi, method="uzawa", omega_T=self.omega_T / self.displacement, **options)


@cache
def load() -> Reference:
    """Read the data file of the package."""
    data = tomllib.loads(files("comparisons.paper").joinpath("wieckowski_1992.toml").read_text(encoding="utf-8"))
    table, figures = data.pop("table_1"), data.pop("figures")
    shown = zip(figures["number"], figures["max_principal_stress"], strict=True)
    return Reference(
        **data,
        table=dict(zip(table["friction"], table["half_force"], strict=True)),
        figures=dict(zip(figures["friction"], shown, strict=True)),
        exact_without_friction=table["half_force_without_friction"],
    )
