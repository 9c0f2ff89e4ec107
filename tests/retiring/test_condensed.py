"""The condensed method on bodies: few iterations, settled values, and the answers of the fixed point."""

from functools import cache

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    Material,
    RectilinearMesh,
    Region,
    Traction,
    discretize,
    solve,
)
from qvi_contact.gallery import compressed_plate, ssnv128
from qvi_contact.solution.solver import posed
from solvers import Status
from solvers.condensed import method as module
from solvers.condensed.central_path import CentralPath
from solvers.condensed.method import CondensedOptions
from solvers.condensed.reduction import Reduction
from solvers.condensed.systems import Shares
from tests.effort import examples
from tests.qvi_contact.frictions import with_friction

pytestmark = pytest.mark.usefixtures("bogner_fox_schmit")  # settled values and iterations on grids

FEW = 25
STEEL, SOFT = Material(1000.0, 0.3), Material(100.0, 0.4)
SETTLED = {32: 214.10403803, 64: 214.15964926, 128: 214.19115763}
"""P/2 of `compressed_plate(0.2)` on n² cells, converged, see TRIAL.md."""


def solved_in_few(problem):
    result = solve(problem, method="condensed")
    assert result.status is Status.SOLVED, result.message
    assert result.iterations <= FEW
    return result


@cache
def plate_on(cells, grading):
    return posed(compressed_plate(1.0, (cells, cells), grading=grading))


@cache
def plate_solved_in_few(friction, cells, grading=1.0):
    return solved_in_few(with_friction(plate_on(cells, grading), friction))


@pytest.mark.parametrize("cells", list(SETTLED)[: examples(2)])
def test_settled_forces(cells):
    """To all printed digits, 1e-6 beyond what a direct solve of the assembled K has on 128² cells."""
    plate = plate_solved_in_few(0.2, cells).contacts["plate"]
    assert plate.normal_force == pytest.approx(SETTLED[cells], rel=1e-9 if cells < 128 else 2e-9)


def free(*sides):
    return [Traction(side, 0.0, 0.0) for side in sides]


def on_lines(*conditions, joints=(), **options):
    mesh = RectilinearMesh([0.0, 0.3, 0.8, 1.5], [0.0, 0.3, 0.7, 1.0])
    for joint in joints:
        mesh = mesh.with_joint(*joint)
    return ContactProblem(mesh, STEEL, [*conditions], **options)


def joint():
    joints = [("a", "horizontal", 0.3), ("b", "vertical", 0.8, 0.3, 1.0)]
    conditions = [Contact("a", 0.2), Contact("b", 0.1, gap=1e-3), Displacement("bottom", 0.0, 0.0)]
    push = Displacement("top", x=4e-3, y=lambda x, _: -4e-3 + 3e-3 * x)
    return on_lines(*conditions, push, *free("left", "right"), joints=joints, regions=[Region(SOFT, y=(0.0, 0.3))])


def at(problem):
    """Complementarity and interior point of a body, as `solve_condensed` begins, with a share that leads into folds."""
    qvi = discretize(problem).fitted().qvi
    run = module._start(qvi, Reduction(qvi), CondensedOptions(), Shares(1000.0, 1000.0))
    return run.problem, run.interior


def followed(friction, cells=32, patience=6):
    """The interior point method until it stalls, and the central path from there."""
    problem, interior = at(ssnv128((cells, cells), friction))
    best, since = np.inf, 0
    for _ in range(100):
        gap = interior.measures(interior.residuals()).gap
        best, since = (gap, 0) if gap < 0.7 * best else (best, since + 1)
        if since >= patience:
            break
        interior.iterate(interior.residuals())
    else:
        pytest.fail("the interior point method does not stall here any more: take more friction")
    return problem, interior, CentralPath(interior)


@pytest.fixture(scope="module")
def fold():
    """μ = 3 on 32² cells: log τ, steps, s λ over τ ω and residuals along the path until it is passed."""
    problem, interior, path = followed(3.0)
    record = []
    while not (path.passed or path.lost):
        change = path.advance()
        point = interior.point
        tau = np.exp(path._log)
        residuals = interior.residuals()
        record.append((np.log(interior.parameter()), change, point.s * point.lam / (tau * problem.shares), residuals))
    return path, record


def test_the_parameter_is_what_the_path_says(fold):
    path, record = fold
    assert sum(change for _, change, *_ in record) == pytest.approx(path._log - path._start, abs=1e-9)
    assert record[-1][0] == pytest.approx(path._log, abs=0.3)
