"""The plate as plain data, so that every code solves the gallery's own problem; settings of a run."""

import math
import subprocess
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any, Final

from comparisons.peers.models import CODES, EQUILIBRIUM, MODELS, Model
from qvi_contact.conditions import Contact
from qvi_contact.errors import InputError
from qvi_contact.gallery import compressed_plate

WARM_UP: Final = 2
"""Cells a side of the case that loads all libraries."""

_GRADINGS: Final = ((12, 0.6), (24, 0.7), (48, 0.8))  # up to so many cells a side
_FINEST_GRADING: Final = 0.9
_LOOKING: Final = 60.0  # seconds for another Python to say what it has


def grading(cells: int) -> float:
    """Ratio of each cell to the one before it on graded meshes with so many cells a side."""
    return next((ratio for most, ratio in _GRADINGS if cells <= most), _FINEST_GRADING)


def case(friction: float, cells: int, ratio: float) -> dict[str, Any]:
    """`compressed_plate` as plain data.

    The grid lines "x" and "y", "young", "poisson" (plane stress), "displacement" U and "friction" μ; and "cells" and
    "grading", which the lines come from.
    """
    problem = compressed_plate(friction, cells=(cells, cells), grading=ratio)
    (contact,) = (condition for condition in problem.conditions if isinstance(condition, Contact))
    material: Any = problem.material
    gap: Any = contact.gap
    return {
        "x": problem.mesh.x.tolist(), "y": problem.mesh.y.tolist(), "young": material.young,
        "poisson": material.poisson, "displacement": -float(gap), "friction": friction,
        "cells": cells, "grading": ratio,
    }  # fmt: skip


@dataclass(frozen=True)
class Plan:
    """Settings of a run.

    Attributes
    ----------
    friction : coefficients μ
    cells : numbers of cells a side, increasing
    repeat : most repetitions of each solve
    limit : seconds after which a process is ended
    getfem : another Python in which GetFEM is installed

    """

    friction: tuple[float, ...] = (0.2, 1.0)
    cells: tuple[int, ...] = (8, 16, 32, 64)
    repeat: int = 3
    limit: float = 300.0
    getfem: str | None = None

    def __post_init__(self) -> None:
        for name, values in (("friction", self.friction), ("cells", self.cells)):
            if not values:
                raise InputError(name, values, "give at least one")
        for friction in self.friction:
            if not (math.isfinite(friction) and friction >= 0.0):
                raise InputError("friction", friction, "give a number ≥ 0")
        for name, least in (("cells", min(self.cells)), ("repeat", self.repeat)):
            if least < 1:
                raise InputError(name, least, "give a whole number ≥ 1")
        if not 0.0 < self.limit < math.inf:
            raise InputError("limit", self.limit, "give a number of seconds > 0")
        if self.getfem is not None:
            _require(self.getfem, CODES["getfem"].library)
        object.__setattr__(self, "cells", tuple(sorted(set(self.cells))))
        object.__setattr__(self, "friction", tuple(sorted(set(self.friction))))

    @property
    def missing(self) -> tuple[str, ...]:
        """Keys of the codes that are not installed."""
        return tuple(key for key in CODES if self.interpreter(key) is None and not _installed(key))

    @property
    def models(self) -> tuple[Model, ...]:
        """Those whose code is installed."""
        missing = self.missing
        return tuple(model for model in MODELS if model.code not in missing)

    @property
    def steps(self) -> int:
        """Processes of the run."""
        return len(self.friction) * len(self.cells) * len(self.models)

    @property
    def command(self) -> str:
        """The command that measures the same, without the place of its files and of other Pythons."""
        words = ["python -m comparisons peers --friction", *(f"{mu:g}" for mu in self.friction)]
        words += ["--cells", *map(str, self.cells), f"--repeat {self.repeat} --limit {self.limit:g}"]
        return " ".join(words)

    def interpreter(self, code: str) -> str | None:
        """Another Python that runs this code, None for this one."""
        return self.getfem if code == "getfem" else None

    def order(self, model: Model, friction: float, cells: int) -> dict[str, Any]:
        """What `measure.run` is asked for."""
        ratio = 1.0 if model.mesh == "uniform" else grading(cells)
        return {
            "module": CODES[model.code].module, "interpreter": self.interpreter(model.code),
            "case": case(friction, cells, ratio), "warm_up": case(friction, WARM_UP, ratio),
            "options": dict(model.options), "repeat": self.repeat,
        }  # fmt: skip


def _installed(code: str) -> bool:
    return code == EQUILIBRIUM or find_spec(CODES[code].library) is not None


def _require(interpreter: str, library: str) -> None:
    """Raise `InputError` unless this is a Python that finds the library."""
    look = f"import importlib.util, sys; sys.exit(importlib.util.find_spec({library!r}) is None)"
    try:
        found = subprocess.run([interpreter, "-c", look], capture_output=True, timeout=_LOOKING, check=False).returncode
    except (OSError, ValueError, subprocess.SubprocessError):
        found = 1
    if found:
        raise InputError(library, interpreter, f"give a Python that finds the module {library}")
