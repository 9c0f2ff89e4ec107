"""Inner quadratic programs of frictional contact problems, written as a test set of `qpbenchmark`."""

import shutil
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csc_array

from comparisons.exchange.archive import parts_of
from qvi_contact import ContactProblem, solve
from qvi_contact.basics.writing import replacing, write_text
from qvi_contact.gallery import compressed_plate, ssnv128
from solvers.basics.types import Sparse, Vector
from solvers.fixed_point import make_form
from solvers.inequality.problem import FrictionQVI
from solvers.inner.problem import Centre, limited_rows

TEST_SET = "friction_contact.py"
SPARSE_TEST_SET = "friction_contact_sparse.py"
FORMS: tuple[str, ...] = ("full", "condensed")

_SPARSE = '''"""The sparse problems: qpbenchmark friction_contact_sparse.py --results-path FILE run."""

from friction_contact import FrictionContactSparse

__all__ = ["FrictionContactSparse"]
'''


QuadraticProgram = Mapping[str, Sparse | Vector]
"""min ½ zᵀPz + qᵀz  s.t.  G z ≤ h,  A z = b, by these letters; sparse P (n, n), G (3m, n) and A (p, n)."""


def standard_problems() -> Iterator[tuple[str, ContactProblem]]:
    """Names and problems of the test set: the plate on equal and on strongly graded cells, and SSNV128.

    With μ = 0.1 most of the plate's contact slips, with 0.5 all of it sticks (cold and converged bound then have the
    same minimiser); a part of SSNV128 is open. Graded cells shrink towards the free corner by 0.6 each: K is then badly
    conditioned.
    """
    for cells in (4, 8, 16):
        for friction in (0.1, 0.2, 0.5):
            yield f"plate_{cells}_mu_{friction:g}", compressed_plate(friction, cells=(cells, cells))
    for cells in (8, 16):
        yield f"graded_plate_{cells}_mu_0.1", compressed_plate(0.1, cells=(cells, cells), grading=0.6)
    yield "ssnv128_16", ssnv128((16, 16))


def programs_of(name: str, qvi: FrictionQVI, pressure: Vector | None) -> Iterator[tuple[str, QuadraticProgram]]:
    """The inner problems of a `FrictionQVI` about z = 0, in both forms, and their names, which begin with `name`.

    `pressure` (m,) is that of the solution and gives the bound "converged"; None leaves this bound out.
    """
    bounds = {"cold": qvi.threshold(qvi.pressure(qvi.bonded))}
    if pressure is not None:
        bounds = {"converged": qvi.threshold(pressure)} | bounds
    for form in FORMS:
        in_form = make_form(qvi, form)
        inner = in_form.problem
        centre = Centre(inner, np.zeros(inner.n))
        shared: QuadraticProgram = {"P": inner.K, "q": -centre.f, "G": limited_rows(inner), "A": inner.A}
        for bound, threshold in bounds.items():
            yield f"{name}_{form}_{bound}", {**shared, "h": centre.h(in_form.threshold(threshold)), "b": centre.b}


def write_test_set(folder: Path, problems: dict[str, ContactProblem], advance: Callable[[str], object]) -> list[Path]:
    """Solve the problems and write their inner problems, and the modules of the test set.

    For unsolved problems only the bound "cold" is written. `advance` is called with the name of each problem.
    """
    target = folder / "problems"
    target.mkdir(exist_ok=True)
    written: list[Path] = []
    for name, problem in problems.items():
        solution = solve(problem, law_on="points").solution
        qvi, pressure = solution.problem, solution.problem.pressure(solution.z) if solution.solved else None
        for program_name, program in programs_of(name, qvi, pressure):
            arrays: dict[str, Any] = {key: program[key] for key in "qhb"}
            for key in "PGA":
                arrays |= parts_of(key, csc_array(program[key]))
            written.append(target / f"{program_name}.npz")
            with replacing(written[-1]) as temporary, temporary.open("wb") as stream:
                np.savez_compressed(stream, **arrays)
        advance(name)
    with replacing(folder / TEST_SET) as temporary:
        shutil.copyfile(Path(__file__).with_name(TEST_SET), temporary)
    write_text(folder / SPARSE_TEST_SET, _SPARSE)
    return written
