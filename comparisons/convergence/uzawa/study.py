"""The study: runs with steps on a grid, limits, meshes, the paper's own run, and other methods at equal accuracy."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any, Final, NamedTuple

from comparisons.lab.study import Study
from comparisons.paper.reference import load
from qvi_contact.plots import BLUE, GREEN, GREY, ORANGE, VERMILLION

MOST: Final = 20_000
"""Iterations of Uzawa at most."""

SHRINKING: Final = 100.0
"""Iterations in which a shrinking step halves at first; it goes down like 1/(1 + i / k0)."""


class Method(NamedTuple):
    """A method: options of `solve_qvi`, and how it is drawn."""

    options: Mapping[str, Any]
    colour: str
    marker: str
    line: Any

    @property
    def is_uzawa(self) -> bool:
        """Whether it takes steps."""
        return bool(self.options["method"] == "uzawa")


_DECAY: Final = {"step_decay": SHRINKING, "decay": "harmonic"}

METHODS: Final[Mapping[str, Method]] = {
    "Uzawa": Method({"method": "uzawa", "max_iterations": MOST}, VERMILLION, "o", "-"),
    "Uzawa, shrinking step": Method({"method": "uzawa", "max_iterations": MOST, **_DECAY}, ORANGE, "^", "--"),
    "fixed point, QP": Method({"method": "fixed-point", "inner": "qp:clarabel"}, BLUE, "s", "-."),
    "fixed point, SOCP": Method({"method": "fixed-point", "inner": "socp:clarabel"}, GREEN, "D", ":"),
    "condensed": Method({"method": "condensed"}, GREY, "*", (0, (5, 1))),
}
"""Name → method, in the order of tables and legends."""

VERSION: Final = 2
"""To be raised when the task computes something else."""

TASK: Final = "comparisons.convergence.uzawa.task:run"

HALF: Final = 0.5
"""Steps of runs that are not about steps, as a share of the limits."""


@dataclass(frozen=True)
class Extent:
    """How much is run.

    Attributes
    ----------
    friction : μ on the plate
    map_cells, limit_cells, mesh_cells : cells a side of the plate in maps, limits, and iterations against the mesh
    steps : steps of the map, as shares of the limits
    normal_steps : the same of ω_N on the plate, where it hardly matters
    paper : μ of the paper's own run
    accuracy : (problem, cells, μ) of the comparison at equal accuracy
    targets : accuracies

    """

    friction: tuple[float, ...]
    map_cells: tuple[int, ...]
    limit_cells: tuple[int, ...]
    mesh_cells: tuple[int, ...]
    steps: tuple[float, ...]
    normal_steps: tuple[float, ...]
    paper: tuple[float, ...]
    accuracy: tuple[tuple[str, int, float], ...]
    targets: tuple[float, ...]


def _powers(first: int, last: int) -> tuple[float, ...]:
    """Powers of √2, rounded so that they mean the same on every machine."""
    return tuple(round(2.0 ** (power / 2.0), 6) for power in range(first, last + 1))


FULL: Final = Extent(
    friction=(0.05, 0.1, 0.2),
    map_cells=(2, 8, 16),
    limit_cells=(2, 4, 8, 16, 32),
    mesh_cells=(2, 4, 8, 16, 32),
    steps=_powers(-6, 4),
    normal_steps=(HALF, 1.0, 2.0),
    paper=tuple(load().table),
    accuracy=(("plate", 2, 0.0), ("plate", 2, 0.1), ("plate", 16, 0.1), ("plate", 16, 0.2), ("ssnv128", 8, 1.0)),
    targets=(1e-2, 1e-4, 1e-6, 1e-8),
)

QUICK: Final = Extent(
    friction=(0.1,),
    map_cells=(2,),
    limit_cells=(2, 4),
    mesh_cells=(2, 4, 8),
    steps=_powers(-2, 2),
    normal_steps=(HALF, 1.0),
    paper=(0.0, 0.1, 0.3),
    accuracy=(("plate", 2, 0.1),),
    targets=(1e-2, 1e-4),
)

HALF_OPEN: Final = ("half open", 0, 0.3)
SLIDING: Final = ("sliding", 0, 0.0)
"""The problems without a mesh, see `bodies`: ω_N matters in the one, in the other ω_T* is known by hand."""


def study(quick: bool) -> Study:
    """The study, or a quick one of coarse meshes under another name."""
    name = "convergence-uzawa-quick" if quick else "convergence-uzawa"
    return study_of(name, QUICK if quick else FULL)


def study_of(name: str, extent: Extent) -> Study:
    """The study of this extent."""
    return Study.of(name, VERSION, TASK, _cases(extent))


def _cases(extent: Extent) -> Iterator[dict[str, Any]]:
    """All cases: the paper's run, maps of both steps, searches for their limits, meshes, and other methods."""
    maps, limits, meshes = (
        [("plate", number, friction) for number in cells for friction in extent.friction]
        for cells in (extent.map_cells, extent.limit_cells, extent.mesh_cells)
    )
    yield from (_case("paper", ("plate", load().cells, friction)) for friction in extent.paper)
    for place, normal_steps in [*((place, extent.normal_steps) for place in maps), (HALF_OPEN, extent.steps)]:
        for normal in normal_steps:
            yield from (_case("map", place, tangential=step, normal=normal) for step in extent.steps)
    if limits:
        yield from (_case("tangential limit", place, normal=HALF) for place in (SLIDING, HALF_OPEN, *limits))
        yield from (_case("normal limit", place, tangential=HALF) for place in (HALF_OPEN, limits[-1]))
    yield from (_case("mesh", place, tangential=HALF, normal=HALF) for place in meshes)
    for place, method in product(extent.accuracy, METHODS):
        yield from (_case(method, place, target=target) for target in extent.targets)


def _case(run: str, place: tuple[str, int, float], **settings: Any) -> dict[str, Any]:
    """A case; steps are shares of the limits, see `task`, None where a run finds or has its own.

    The place is one factor, or the product of all of them, of which few are kept, would be long.
    """
    return {"run": run, "place": place, "tangential": None, "normal": None, "target": None, **settings}
