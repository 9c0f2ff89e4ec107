"""The report on convergence in the mesh, from the stored rows alone."""

from collections.abc import Iterator, Sequence
from typing import Final

from comparisons.convergence.mesh import figures, tables
from comparisons.convergence.mesh.data import data_of
from comparisons.convergence.mesh.errors import TRACTIONS
from comparisons.convergence.mesh.findings import findings
from comparisons.convergence.mesh.overview import Overview, ends_of
from comparisons.convergence.mesh.problems import Problem
from comparisons.convergence.mesh.study import MODELS, SEQUENCES
from comparisons.convergence.mesh.task import STRICT, TOLERANCE
from comparisons.lab.report.environment import environment_grids
from comparisons.lab.report.numbers import count_of, scientific
from comparisons.lab.report.old import Exhibit, Report, Section
from comparisons.lab.study import Row
from comparisons.lab.tables import Grid

_LIMITATIONS: Final = (
    "Meshes are rectilinear grids: refinement towards a point refines two whole strips. Graded and adaptive meshes of "
    "other codes may need fewer unknowns.",
    "Graded meshes are made for places that are known beforehand, for the contacts that open from a finer computation.",
    "Where no exact or external value is known, the reference comes from this package: from two models on the same "
    "mesh, which share the problem and its grid, or from the finest mesh. Errors near its uncertainty are not errors.",
    "Expected orders are those of the strongest singularity in linear elasticity with the friction law; the law at "
    "four points of an edge, and the moving bound, may add slower parts that no theory here describes.",
    "With Coulomb friction that slips, bounds of the energy hold for the friction bound held fixed: indicators.",
    "The time is one run's, and that of adaptive meshes contains all solves before.",
)


def report(rows: Sequence[Row]) -> Report:
    """Findings, tables and pictures of the rows of `study`; the same rows give the same report."""
    overview = Overview(data_of(rows))
    names = count_of(len(overview.data.problems), "problem")
    return Report(
        "convergence-mesh",
        "Convergence in the mesh",
        f"{names} of frictional contact on sequences of meshes: forces, energies, tractions and the ends of zones "
        "against exact values, values of other codes, and bounds. Made by `python -m comparisons convergence mesh`.",
        findings(overview),
        [
            _summary(overview),
            *(_section(overview, problem) for problem in overview.problems),
            Section("What failed", (), [tables.failures_table(overview)]),
        ],
        [_settings(), *environment_grids(rows)],
        _LIMITATIONS,
    )


def _summary(overview: Overview) -> Section:
    exhibits: list[Exhibit] = [
        tables.costs_table(overview), tables.orders_table(overview), figures.gaps_figure(overview),
        tables.references_table(overview),
    ]  # fmt: skip
    return Section("All problems", (), exhibits)


def _section(overview: Overview, problem: Problem) -> Section:
    return Section(problem.title, (), list(_exhibits(overview, problem)))


def _exhibits(overview: Overview, problem: Problem) -> Iterator[Exhibit]:
    known = overview.references[problem.name]
    yield figures.errors_figure(overview, problem)
    if TRACTIONS in known.measures:
        yield figures.tractions_figure(overview, problem)
    if ends_of(known):
        yield figures.ends_figure(overview, problem)
    yield tables.meshes_table(overview, problem)


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
