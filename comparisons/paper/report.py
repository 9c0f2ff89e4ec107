"""The report on the paper's plate: as a document, as CSV, as JSON."""

from collections.abc import Callable, Mapping
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pandas import DataFrame

from comparisons.lab.report import Document, drawn, findings_of, render, write_report
from comparisons.lab.report.numbers import fixed, scientific, seconds
from comparisons.lab.study.rows import finite_json
from comparisons.lab.tables import Form, Grid
from comparisons.paper import figures
from comparisons.paper.measures import back_end_rows, figure_rows, table_rows, values_of
from comparisons.paper.study import PaperStudy
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

_FORMS: Final[dict[str, Form]] = {
    **dict.fromkeys(("friction", "paper", "uzawa_30", "uzawa_30_printed_rule", "converged"), fixed(".2f")),
    **dict.fromkeys(("uzawa_converged", "fixed_point_qp", "fixed_point_socp", "condensed"), fixed(".6f")),
    **dict.fromkeys(("half_force_difference", "traction_difference"), scientific), "seconds": seconds,
    "paper_minus_solution_percent": "{:+.2f} %".format,
}  # fmt: skip


def report(study: PaperStudy) -> Document:
    """The report; the same study gives the same one, but for times."""
    return _filled(study, {name: drawn(f"paper-{name}", partial(draw, study)) for name, draw in PICTURES.items()})


def _filled(study: PaperStudy, pictures: Mapping[str, str]) -> Document:
    versions = Grid("Versions", ("package", "version"), list(_versions().items()))
    ends = DataFrame(back_end_rows(study))
    tables = {
        "forces": DataFrame(table_rows(study)), "stresses": DataFrame(figure_rows(study)),
        "solvers": ends.assign(share=ends.certified.astype(str) + "/" + ends.problems.astype(str)),
    }  # fmt: skip
    return render("comparisons.paper", "paper", values_of(study), tables, pictures, [versions], forms=_FORMS)


def as_document(study: PaperStudy) -> dict[str, Any]:
    """The whole report as plain data for JSON; what is not a number becomes null."""
    document = {
        "schema": "qvi-contact/paper/3",
        "source": "Więckowski, Dual finite element method in friction problems, Mech. Teoret. Stos. (1992)",
        "units": {"forces": "N/mm", "stresses": "MPa"},
        "rows": table_rows(study),
        "figures": figure_rows(study),
        "back_ends": back_end_rows(study),
        "uzawa_without_friction": {
            "cycle_low": min(study.cycle), "cycle_high": max(study.cycle),
            "shrinking_step": study.row(0.0).half_force(study.row(0.0).uzawa_converged),
            "exact": study.reference.exact_without_friction,
        },
        "findings": findings_of(_filled(study, dict.fromkeys(PICTURES, "")).text),
        "versions": _versions(),
    }  # fmt: skip
    return dict(finite_json(document, null=True))


def _versions() -> dict[str, str]:
    return {name: version(name) for name in ("numpy", "scipy", "cvxpy", "clarabel", "osqp", "qpsolvers")}


def write(study: PaperStudy, folder: Path) -> tuple[Document, list[Path]]:
    """Write the report and its tables as CSV; each file appears whole or not at all."""
    for name, rows in TABLES.items():
        write_text(folder / name, DataFrame(rows(study)).to_csv(index=False, lineterminator="\n"))
    made = report(study)
    return made, [*write_report(made, folder), *(folder / name for name in TABLES)]
