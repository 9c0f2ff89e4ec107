"""The report on convergence in the mesh, from the stored rows alone."""

from collections.abc import Sequence

from comparisons.convergence.mesh.errors import Overview, meshes_of
from comparisons.convergence.mesh.figures import figures
from comparisons.convergence.mesh.measures import values_of
from comparisons.convergence.mesh.tables import FORMS, tables_of
from comparisons.lab.report import Document, environment_grids, render
from comparisons.lab.study import Row


def report(rows: Sequence[Row], quick: bool = False) -> Document:
    """The report; the same rows give the same report."""
    overview = Overview(meshes_of(rows))
    return render(
        "comparisons.convergence.mesh", "convergence-mesh-quick" if quick else "convergence-mesh",
        {"quick": quick, **values_of(overview)}, tables_of(overview), figures(overview), environment_grids(rows),
        forms=FORMS,
    )  # fmt: skip
