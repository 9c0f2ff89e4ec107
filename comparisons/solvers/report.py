"""The report of the comparison, from the stored rows alone."""

from comparisons.lab.report import Document, environment_grids, render
from comparisons.lab.study import StoredStudy
from comparisons.solvers.figures import figures
from comparisons.solvers.measures import runs_of
from comparisons.solvers.tables import left_out, settings, tables_of
from comparisons.solvers.values import values_of


def report_of(study: StoredStudy) -> Document:
    """The report; the same rows give the same one."""
    runs = runs_of(study.rows)
    grids = [settings(study.rows), left_out(sorted({run.solver for run in runs})), *environment_grids(study.rows)]
    name = str(study.declaration["name"])
    return render("comparisons.solvers", name, values_of(study), tables_of(study), figures(runs), grids)
