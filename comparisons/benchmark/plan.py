"""What a run measures, and how often."""

from dataclasses import dataclass
from typing import Final, NamedTuple

from comparisons.benchmark.reference import CONVERGED_FRICTION
from comparisons.lab.checks import check_at_least_one, check_not_negative, check_some
from qvi_contact.errors import InputError
from solvers.factorisation import resolve
from solvers.factorisation.choice import CHOICES, SHARED

TOLERANCE: Final = 1e-8
"""That the certificate of every solve must confirm."""

GRADED: Final = ((12, 0.6), (16, 0.7), (24, 0.7), (32, 0.8), (40, 0.8))
"""(cells, grading) of the meshes on which accuracy is weighed against time."""

GRADED_FRICTION: Final = (0.2, 1.0)
GRADED_REPETITIONS: Final = 20

_REPETITIONS: Final = ((128, 5), (512, 3))  # up to so many cells a side; beyond the last one, two
_LEAST: Final = 2


class Path(NamedTuple):
    """A way through the condensed method: its name, and the factorisation it takes."""

    name: str
    factorisation: str


class Loop(NamedTuple):
    """Another method on the same problem: its name, options of `solve`, and the most cells a side it is tried on.

    Without options it is the loop of `naive`.
    """

    name: str
    options: dict[str, str]
    largest: int


LOOPS: Final = (
    Loop("naive loop, qpsolvers", {"method": "fixed-point", "inner": "qp:clarabel", "form": "full"}, 128),
    Loop("naive loop, cvxpy", {}, 128),
    Loop("naive loop, cvxpy, cones", {"method": "fixed-point", "inner": "socp:clarabel", "form": "full"}, 128),
    Loop("loop of condensed QPs", {"method": "fixed-point", "inner": "qp:clarabel", "form": "condensed"}, 64),
    Loop("Uzawa", {"method": "uzawa"}, 64),
)
"""The fixed point on the friction bound as one would write it first, on the condensed operator, and the paper's own."""


@dataclass(frozen=True)
class Plan:
    """Settings of a run.

    Attributes
    ----------
    cells : numbers of cells a side, increasing
    friction : coefficients μ
    threads : of factorisations and dense linear algebra
    repeat : repetitions of everything; None: by size
    naive : whether `LOOPS` are run too
    factorisation : the only one measured; "auto": the fastest sparse one installed, and shared subdomains
    limit : seconds after which a run of a loop is given up

    """

    cells: tuple[int, ...] = (64, 128, 256, 512)
    friction: tuple[float, ...] = (0.1, 0.2, 0.5)
    threads: int = 1
    repeat: int | None = None
    naive: bool = True
    factorisation: str = "auto"
    limit: float = 120.0

    def __post_init__(self) -> None:
        for name, values in (("cells", self.cells), ("friction", self.friction)):
            check_some(name, values)
        for cells in self.cells:
            check_at_least_one("cells", cells)
        check_at_least_one("threads", self.threads)
        if self.repeat is not None:
            check_at_least_one("repeat", self.repeat)
        for friction in self.friction:
            check_not_negative("friction", friction)
        if not self.limit > 0.0:
            raise InputError("limit", self.limit, "give a number of seconds > 0")
        object.__setattr__(self, "cells", tuple(sorted(set(self.cells))))
        object.__setattr__(self, "friction", tuple(sorted(set(self.friction))))
        if self.factorisation not in CHOICES:
            raise InputError("factorisation", self.factorisation, f"choose one of {', '.join(CHOICES)}")
        if self.factorisation != SHARED:
            resolve(self.factorisation)

    @property
    def paths(self) -> tuple[Path, ...]:
        """What the whole solve is measured with."""
        if self.factorisation == SHARED:
            return (Path("shared", SHARED),)
        general = Path("general", self.sparse)
        return (general, Path("shared", SHARED)) if self.factorisation == "auto" else (general,)

    @property
    def sparse(self) -> str:
        """The sparse back end, for meshes without structure."""
        return resolve("auto" if self.factorisation == SHARED else self.factorisation)

    @property
    def loop_friction(self) -> float:
        """μ of the loops and of the picture: that with known forces if it is among those measured, else the first."""
        return CONVERGED_FRICTION if CONVERGED_FRICTION in self.friction else self.friction[0]

    @property
    def graded_repetitions(self) -> int:
        """Repetitions on each graded mesh."""
        return self.repeat or GRADED_REPETITIONS

    @property
    def steps(self) -> int:
        """Steps of the progress bar."""
        solves = sum(self.repetitions(cells) for cells in self.cells) * len(self.friction) * len(self.paths)
        return solves + self.naive * len(LOOPS) * len(self.cells) + len(GRADED) * len(GRADED_FRICTION)

    @property
    def command(self) -> str:
        """The command that measures the same, without the place of its files."""
        words = ["python -m comparisons benchmark --cells", *map(str, self.cells), "--friction"]
        words += [*(f"{mu:g}" for mu in self.friction), f"--threads {self.threads}"]
        words += [f"--repeat {self.repeat}"] if self.repeat else []
        words += [f"--limit {self.limit:g}"] if self.naive else ["--no-naive"]
        words += [f"--factorisation {self.factorisation}"] if self.factorisation != "auto" else []
        return " ".join(words)

    def repetitions(self, cells: int) -> int:
        """Repetitions of the whole solve on this many cells a side."""
        return self.repeat or next((count for most, count in _REPETITIONS if cells <= most), _LEAST)
