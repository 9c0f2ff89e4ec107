"""The report on the paper's plate: as a document, as CSV, as JSON."""

from collections.abc import Callable, Mapping
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from comparisons.lab.report import Document, drawn, findings_of, render, write_report
from comparisons.lab.report.numbers import scientific, seconds
from comparisons.lab.tables import Grid, grid_of
from comparisons.paper import figures
from comparisons.paper.measures import back_end_rows, figure_rows, table_rows, values_of
from comparisons.paper.study import PaperStudy, half_force
from qvi_contact.basics.writing import write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TABLES = {"table_1.csv": table_rows, "figures_2_to_5.csv": figure_rows, "back_ends.csv": back_end_rows}
"""Name of a file → its rows."""

PICTURES: "Mapping[str, Callable[[PaperStudy], Figure]]" = {
    "table-1": figures.table_1,
    "figures-2-to-5": figures.principal_stresses,
    "contact-tractions": figures.contact_tractions,
    "convergence": figures.convergence,
}


def report(study: PaperStudy) -> Document:
    """The report; the same study gives the same one, but for times."""
    return _filled(study, {name: drawn(f"paper-{name}", partial(draw, study)) for name, draw in PICTURES.items()})


def _filled(study: PaperStudy, pictures: Mapping[str, str]) -> Document:
    versions = Grid("Versions", ("package", "version"), list(_versions().items()))
    return render("comparisons.paper", "paper", values_of(study), tables_of(study), pictures, [versions])


def tables_of(study: PaperStudy) -> dict[str, Grid]:
    """The tables by name."""
    from pandas import DataFrame

    return {
        "forces": _forces(DataFrame(table_rows(study)), study.reference.iterations),
        "stresses": _stresses(DataFrame(figure_rows(study)), study.reference.iterations),
        "solvers": _solvers(DataFrame(back_end_rows(study))),
    }


def _forces(rows: Any, iterations: int) -> Grid:
    headings = {
        "friction": "μ", "paper": "paper", "uzawa_30": f"Uzawa, {iterations} iterations",
        "uzawa_30_printed_rule": f"as printed, {iterations} iterations", "uzawa_converged": "Uzawa, converged",
        "fixed_point_qp": "fixed point, QP", "fixed_point_socp": "fixed point, SOCP", "condensed": "condensed",
        "strict": "strict", "paper_minus_solution_percent": "paper − solution",
    }  # fmt: skip
    two = dict.fromkeys(("friction", "paper", "uzawa_30", "uzawa_30_printed_rule"), "{:.2f}".format)
    six = dict.fromkeys(
        ("uzawa_converged", "fixed_point_qp", "fixed_point_socp", "condensed", "strict"), "{:.6f}".format
    )
    return grid_of(rows, headings, two | six | {"paper_minus_solution_percent": "{:+.2f} %".format})


def _stresses(rows: Any, iterations: int) -> Grid:
    headings = {
        "figure": "figure", "friction": "μ", "paper": "paper", "uzawa_30": f"Uzawa, {iterations} iterations",
        "converged": "converged",
    }  # fmt: skip
    forms = dict.fromkeys(("paper", "uzawa_30", "converged"), "{:.2f}".format)
    return grid_of(rows, headings, forms | {"friction": "{:.1f}".format})


def _solvers(rows: Any) -> Grid:
    rows = rows.assign(share=[f"{row.certified}/{row.problems}" for row in rows.itertuples()])
    headings = {
        "solver": "solver", "share": "certified", "half_force_difference": "P/2, relative",
        "traction_difference": "tractions over mean pressure", "seconds": "time", "verdict": "agreement",
    }  # fmt: skip
    forms = {"half_force_difference": scientific, "traction_difference": scientific, "seconds": seconds}
    return grid_of(rows, headings, forms)


def as_document(study: PaperStudy) -> dict[str, Any]:
    """The whole report as plain data for JSON; what is not a number becomes null."""
    return {
        "schema": "qvi-contact/paper/2",
        "source": "Więckowski, Dual finite element method in friction problems, Mech. Teoret. Stos. (1992)",
        "units": {"forces": "N/mm", "stresses": "MPa"},
        "rows": [_finite(row) for row in table_rows(study)],
        "figures": [_finite(row) for row in figure_rows(study)],
        "back_ends": [_finite(row) for row in back_end_rows(study)],
        "uzawa_without_friction": _finite(
            {
                "cycle_low": min(study.cycle),
                "cycle_high": max(study.cycle),
                "shrinking_step": half_force(study.row(0.0).uzawa_converged),
                "exact": study.reference.exact_without_friction,
            }
        ),
        "findings": findings_of(_filled(study, dict.fromkeys(PICTURES, "")).text),
        "versions": _versions(),
    }


def _versions() -> dict[str, str]:
    return {name: version(name) for name in ("numpy", "scipy", "cvxpy", "clarabel", "osqp", "qpsolvers")}


def _finite(row: Mapping[str, Any]) -> dict[str, Any]:
    """The row with None for what is not a finite number."""
    return {key: None if isinstance(v, float) and not np.isfinite(v) else v for key, v in row.items()}


def write(study: PaperStudy, folder: Path) -> tuple[Document, list[Path]]:
    """Write the report and its tables as CSV; each file appears whole or not at all."""
    from pandas import DataFrame

    for name, rows in TABLES.items():
        write_text(folder / name, DataFrame(rows(study)).to_csv(index=False, lineterminator="\n"))
    made = report(study)
    return made, [*write_report(made, folder), *(folder / name for name in TABLES)]
