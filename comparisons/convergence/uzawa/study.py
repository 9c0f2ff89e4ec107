"""The study: runs with steps on a grid, limits, meshes, the paper's own run, and other methods at equal accuracy."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

from comparisons.convergence.declared import among, factors_of
from comparisons.convergence.uzawa.methods import METHODS
from comparisons.lab.study import Study
from comparisons.paper.reference import load

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
    cases = [case for part in (_paper, _maps, _limits, _meshes, _accuracies) for case in part(extent)]
    return Study(name, VERSION, TASK, factors_of(cases), keep=among(cases))


def _case(run: str, problem: str, cells: int, friction: float, **settings: Any) -> dict[str, Any]:
    """A case; steps are shares of the limits, see `task`, None where a run finds or has its own.

    The place is one factor, or the product of all of them, of which few are kept, would be long.
    """
    case = {"run": run, "place": (problem, cells, friction)}
    return {**case, "tangential": None, "normal": None, "target": None, **settings}


def _paper(extent: Extent) -> Iterator[dict[str, Any]]:
    for friction in extent.paper:
        yield _case("paper", "plate", load().cells, friction)


def _maps(extent: Extent) -> Iterator[dict[str, Any]]:
    plates = [("plate", cells, friction) for cells in extent.map_cells for friction in extent.friction]
    steps = [*((place, extent.normal_steps) for place in plates), (HALF_OPEN, extent.steps)]
    for place, normal_steps in steps:
        for normal in normal_steps:
            for tangential in extent.steps:
                yield _case("map", *place, tangential=tangential, normal=normal)


def _limits(extent: Extent) -> Iterator[dict[str, Any]]:
    plates = [("plate", cells, friction) for cells in extent.limit_cells for friction in extent.friction]
    for place in (SLIDING, HALF_OPEN, *plates) if plates else ():
        yield _case("tangential limit", *place, normal=HALF)
    for place in (HALF_OPEN, plates[-1]) if plates else ():
        yield _case("normal limit", *place, tangential=HALF)


def _meshes(extent: Extent) -> Iterator[dict[str, Any]]:
    for cells in extent.mesh_cells:
        for friction in extent.friction:
            yield _case("mesh", "plate", cells, friction, tangential=HALF, normal=HALF)


def _accuracies(extent: Extent) -> Iterator[dict[str, Any]]:
    for place in extent.accuracy:
        for method in METHODS:
            for target in extent.targets:
                yield _case(method, *place, target=target)
