"""The report on convergence in the mesh, from the stored rows alone."""

from collections.abc import Sequence

from comparisons.convergence.mesh.data import meshes_of
from comparisons.convergence.mesh.errors import Overview
from comparisons.convergence.mesh.figures import figures
from comparisons.convergence.mesh.measures import values_of
from comparisons.convergence.mesh.orders import FLAT, SAME, STEADY
from comparisons.convergence.mesh.study import MODELS, SEQUENCES
from comparisons.convergence.mesh.tables import tables_of
from comparisons.convergence.mesh.task import STRICT, TOLERANCE
from comparisons.lab.report import Document, environment_grids, render
from comparisons.lab.report.numbers import scientific
from comparisons.lab.study import Row
from comparisons.lab.tables import Grid


def report(rows: Sequence[Row], quick: bool = False) -> Document:
    """The report; the same rows give the same report."""
    overview = Overview(meshes_of(rows))
    return render(
        "comparisons.convergence.mesh", "convergence-mesh-quick" if quick else "convergence-mesh",
        {"quick": quick, "same": SAME, "steady": STEADY, "flat": FLAT, **values_of(overview)}, tables_of(overview),
        figures(overview), [_settings(), *environment_grids(rows)],
    )  # fmt: skip


def _settings() -> Grid:
    """What was asked for."""
    rows = [
        ("tolerance of the certificates", scientific(TOLERANCE)),
        ("method", "condensed; the fixed point where that fails"),
        ("friction law on whole edges", STRICT),
        *((f"meshes: {name}", text) for name, text in SEQUENCES.items()),
        *((f"model: {name}", text) for name, text in MODELS.items()),
    ]
    return Grid("Settings", ("setting", "value"), rows)
