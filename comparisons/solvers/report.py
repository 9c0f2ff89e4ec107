"""The report of the comparison, from the stored rows alone."""

from comparisons.lab.report import Document, environment_grids, render
from comparisons.lab.study import StoredStudy
from comparisons.solvers.figures import figures
from comparisons.solvers.measures import runs_of
from comparisons.solvers.tables import FORMS, left_out, settings, tables_of
from comparisons.solvers.values import values_of


def report_of(study: StoredStudy) -> Document:
    """The report; the same rows give the same one."""
    runs = runs_of(study.rows)
    grids = [settings(runs), left_out(runs), *environment_grids(study.rows)]
    values = values_of(study.declaration, runs)
    name, tables = study.declaration["name"], tables_of(runs)
    return render("comparisons.solvers", name, values, tables, figures(runs), grids, forms=FORMS)
