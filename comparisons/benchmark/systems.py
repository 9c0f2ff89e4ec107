"""Where dense systems of the condensed method stop to pay: pairs of solves, dense and sparse, in CPU seconds.

The cost model counts operations, ⅔ k³ for k unknowns of the contact against 20 (nnz/9)^1.5. Sparse ones come
more slowly by a factor, which is measured here: dense systems are taken up to that quotient of the counts for which all
solves together lose the least, Σ log(time of the way taken / time of the faster way).
"""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from comparisons.benchmark.wall import wall_of
from qvi_contact import ContactProblem, discretize
from qvi_contact.discretization.families import CELLS, ElementName
from qvi_contact.gallery import compressed_plate, masonry_wall
from solvers import Status, solve_qvi
from solvers.factorisation.choice import operations

Made: TypeAlias = Callable[[], ContactProblem]


def _plate(cells: tuple[int, int]) -> Made:
    return lambda: compressed_plate(0.2, cells)


def _wall(blocks: int) -> Made:
    return lambda: wall_of(blocks, 0.02)


def _masonry(courses: int, blocks: int) -> Made:
    return lambda: masonry_wall(courses, blocks, ())


PROBLEMS: Final[dict[str, tuple[ElementName, Made]]] = {
    **{f"plate {n} × {n}": ("bfs", _plate((n, n))) for n in (64, 96, 128)},
    **{f"layer {8 * n} × {n}": ("bfs", _plate((8 * n, n))) for n in (16, 24)},
    **{f"wall {n} × {n}, {element}": (element, _wall(n)) for element in CELLS for n in (4, 5, 6, 7)},
    **{f"masonry {c} × {b}": ("hct", _masonry(c, b)) for c, b in ((4, 6), (5, 6), (6, 6), (6, 8))},
}
"""Elements and problems by their names: contacts that are a small, a middling and a large share of the body."""


@dataclass(frozen=True)
class Pair:
    """One problem solved both ways.

    Attributes
    ----------
    name : of the problem
    unknowns, interface : of the body, and of its contact
    counted : operations of a dense factorisation over those of a sparse one
    dense, sparse : CPU seconds of the whole solves

    """

    name: str
    unknowns: int
    interface: int
    counted: float
    dense: float
    sparse: float


def measured(names: Sequence[str], repeat: int) -> Iterator[Pair]:
    """The pairs of the problems named, each the least of so many repetitions; none for one that is not solved."""
    for name in names:
        element, make = PROBLEMS[name]
        problem = make()
        times = [[_seconds(problem, element, system) for system in ("dense", "sparse")] for _ in range(repeat)]
        qvi = discretize(problem, element=element).qvi
        interface = len(qvi.operator.frame(qvi).touched)
        dense, sparse = operations(qvi.K, interface)
        yield Pair(name, qvi.n, interface, dense / sparse, *np.min(times, axis=0).tolist())


def _seconds(problem: ContactProblem, element: ElementName, system: str) -> float:
    """CPU seconds of a solve with nothing prepared; not a number if it is not solved."""
    qvi = discretize(problem, element=element).qvi
    began = time.process_time()
    solution = solve_qvi(qvi, method="condensed", system=system)
    taken = time.process_time() - began
    return taken if solution.status is Status.SOLVED else np.nan


def crossover(pairs: Sequence[Pair]) -> float:
    """The quotient of counts up to which dense systems are best taken: the middle of those that lose least, by logs."""
    known = sorted((pair for pair in pairs if np.isfinite(pair.dense / pair.sparse)), key=lambda pair: pair.counted)
    counted = np.log([pair.counted for pair in known])
    slower = np.log([pair.dense / pair.sparse for pair in known])
    gained = np.concatenate([[0.0], np.cumsum(slower)])  # lost by dense systems for so many, less what sparse ones lose
    best = int(np.argmin(gained))
    ends = np.concatenate([counted[:1], counted, counted[-1:]])[best : best + 2]
    return float(np.exp(ends.mean()))
