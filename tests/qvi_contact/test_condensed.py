"""The condensed method on bodies: few iterations, settled values, and the answers of the fixed point."""

from functools import cache
from itertools import product

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    Material,
    RectilinearMesh,
    Region,
    RigidPlate,
    Symmetry,
    Traction,
    discretize,
    solve,
)
from qvi_contact.gallery import compressed_plate, ssnv128
from qvi_contact.solution.solver import posed
from solvers import Status
from solvers.condensed import method as module
from solvers.condensed.central_path import CentralPath
from solvers.condensed.complementarity import Complementarity
from solvers.condensed.interior_point import InteriorPoint
from solvers.condensed.method import CondensedOptions
from solvers.condensed.reduction import Reduction
from solvers.condensed.systems import Shares
from solvers.inequality.blocks import dense as dense_rows
from solvers.inequality.linear import interface_of
from solvers.inequality.traces import trace_coordinates
from tests.effort import examples, thinned
from tests.qvi_contact.frictions import with_friction

pytestmark = pytest.mark.usefixtures("bogner_fox_schmit")  # settled values and iterations on grids

FRICTIONS = (0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.5, 1.0, 2.0)
FEW = 25
STEEL, SOFT = Material(1000.0, 0.3), Material(100.0, 0.4)
SETTLED = {32: 214.10403803, 64: 214.15964926, 128: 214.19115763}
"""P/2 of `compressed_plate(0.2)` on n² cells, converged, see TRIAL.md."""


def in_turn(*meshes):
    """Every coefficient of friction, on one mesh after the other."""
    return [(friction, *meshes[number % len(meshes)]) for number, friction in enumerate(FRICTIONS)]


def solved_in_few(problem):
    result = solve(problem, method="condensed")
    assert result.status is Status.SOLVED, result.message
    assert result.iterations <= FEW
    return result


@cache
def plate_on(cells, grading):
    return posed(compressed_plate(1.0, (cells, cells), grading=grading))


@cache
def ground(cells):
    return posed(ssnv128((cells, cells), 1.0))


@cache
def plate_solved_in_few(friction, cells, grading=1.0):
    return solved_in_few(with_friction(plate_on(cells, grading), friction))


@pytest.mark.parametrize(("friction", "cells"), thinned(product(FRICTIONS, (2, 4, 8, 16)), 22))
def test_few_iterations_on_the_plate(friction, cells):
    plate_solved_in_few(friction, cells)


@pytest.mark.parametrize("friction", thinned(FRICTIONS, 5))
def test_few_iterations_on_the_finer_plate(friction):
    """Force and energies are those of the 16² cells to a discretisation error, and stick reduces the force's rise."""
    plate = plate_solved_in_few(friction, 32).contacts["plate"]
    assert 209.0 - 1e-6 < plate.normal_force < 214.36767
    assert np.abs(plate.tangential_stress).max() <= max(friction, 1e-9) * np.abs(plate.normal_stress).max()


@pytest.mark.parametrize(
    ("friction", "cells", "grading"), thinned(in_turn((16, 0.7), (24, 0.8)) + in_turn((24, 0.8), (32, 0.85)), 11)
)
def test_few_iterations_on_graded_plates(friction, cells, grading):
    plate_solved_in_few(friction, cells, grading)


@pytest.mark.parametrize("friction", thinned([0.02, 0.2, 1.0], 1))
def test_few_iterations_on_4096_cells(friction):
    plate_solved_in_few(friction, 64)


@pytest.mark.parametrize(("friction", "cells"), thinned(in_turn((8,), (16,)) + in_turn((16,), (32,)), 11))
def test_few_iterations_where_contact_opens(friction, cells):
    base = solved_in_few(with_friction(ground(cells), friction)).contacts["base"]
    assert base.normal_force == pytest.approx(2e6, rel=1e-8)


@pytest.mark.parametrize("cells", [8, 16])
@pytest.mark.parametrize("friction", [3.0, 4.0, 5.0])
def test_large_friction_is_solved_by_whatever_it_takes(friction, cells):
    result = solve(with_friction(ground(cells), friction))
    assert result.status is Status.SOLVED, result.message
    assert result.certificate.passed
    base = result.contacts["base"]
    assert base.normal_force == pytest.approx(2e6, rel=1e-8)
    assert -1.7e6 < base.tangential_force < -1.6e6


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


def opening():
    return ssnv128((6, 6))


def cohesion():
    base = Contact("bottom", 0.2, cohesion=2.0, name="base")
    return on_lines(base, *free("left", "right"), Displacement("top", x=8e-3, y=lambda x, _: -4e-3 + 6e-3 * x))


def cap():
    base = Contact("bottom", 0.5, shear_limit=1.5, name="base")
    return on_lines(base, *free("left", "right"), Displacement("top", x=1e-2, y=-5e-3))


def tresca():
    base = Contact.tresca("bottom", 0.8, name="base")
    return on_lines(base, *free("left", "right"), Displacement("top", x=4e-3, y=lambda x, _: -4e-3 + 5e-3 * x))


def bilateral():
    base = Contact("bottom", 0.3, law="bilateral", name="base")
    return on_lines(base, *free("left", "right"), Displacement("top", x=3e-3, y=lambda x, _: -4e-3 + 6e-3 * x))


def joint():
    joints = [("a", "horizontal", 0.3), ("b", "vertical", 0.8, 0.3, 1.0)]
    conditions = [Contact("a", 0.2), Contact("b", 0.1, gap=1e-3), Displacement("bottom", 0.0, 0.0)]
    push = Displacement("top", x=4e-3, y=lambda x, _: -4e-3 + 3e-3 * x)
    return on_lines(*conditions, push, *free("left", "right"), joints=joints, regions=[Region(SOFT, y=(0.0, 0.3))])


def driven():
    plate = Contact("top", 0.3, plate=RigidPlate(force_x=1.5, force_y=-8.0, moment=-5.0), name="plate")
    return on_lines(Contact("bottom", 0.25, name="base"), plate, *free("left", "right"))


def several():
    return on_lines(
        Contact("bottom", 0.2, cohesion=0.5, shear_limit=8.0, name="ground"),
        Contact("left", 0.1, law="bilateral", cohesion=0.2, name="rail"),
        Traction("right", x=lambda _, y: 16.0 * y * (1.0 - y), y=0.0),
        Contact("top", 0.3, plate=RigidPlate(force_y=-60.0, moment=-50.0), name="plate"),
        Contact("bed", 0.02, cohesion=0.3, name="bed"),
        joints=[("bed", "horizontal", 0.7)],
    )


BODIES = {body.__name__: body for body in (opening, cohesion, cap, tresca, bilateral, joint, driven, several)}


@pytest.mark.parametrize(("name", "inner"), thinned(product(BODIES, ("direct:clarabel", "qp:daqp")), 10))
def test_same_tractions_as_the_fixed_point(name, inner):
    problem = BODIES[name]()
    result = solved_in_few(problem)
    reference = solve(problem, inner=inner, tolerance=1e-9)
    assert reference.status is Status.SOLVED
    scale = max(np.abs(line.normal_stress).max() for line in reference.contacts.values())
    for key, line in reference.contacts.items():
        found = result.contacts[key]
        assert found.normal_stress == pytest.approx(line.normal_stress, abs=1e-7 * scale)
        assert found.tangential_stress == pytest.approx(line.tangential_stress, abs=1e-7 * scale)
        slip = np.abs(line.slip).max()
        assert found.slip == pytest.approx(line.slip, abs=1e-6 * max(slip, 1e-4))


@pytest.mark.parametrize("name", BODIES)
def test_the_bodies_show_what_they_are_named_after(name):
    result = solve(BODIES[name]())
    lines = list(result.contacts.values())
    states = np.concatenate([line.state for line in lines])
    assert (states == 2).any()  # something slips
    shown = {
        "opening": lambda: (states == 0).any(),
        "cohesion": lambda: any(
            (line.state == 0).any() and (np.abs(line.tangential_stress) > 0.1).any() for line in lines
        ),
        "cap": lambda: (lines[0].friction_bound == 1.5).any(),
        "tresca": lambda: (lines[0].state == 0).any(),
        "bilateral": lambda: (lines[0].normal_stress > 0.1).any(),
        "joint": lambda: (result.contacts["b"].state == 0).any() or (result.contacts["a"].state == 0).any(),
        "driven": lambda: result.plates["plate"].y != 0.0,
        "several": lambda: len(lines) == 4,
    }
    assert shown[name]()


def dragged(factor, cells=(4, 3), pressure=10.0, friction=0.3):
    """Uniform pressure and shear on a block that nothing else holds; the base is pushed back by friction alone."""
    mesh = RectilinearMesh.rectangle(cells, 2.0, 1.0)
    shear = factor * friction * pressure
    sides = [Traction("left", 0.0, -shear), Traction("right", 0.0, shear)]
    top = Traction("top", shear, -pressure)
    return ContactProblem(mesh, STEEL, [Contact("bottom", friction, name="base"), top, *sides])


@pytest.mark.parametrize("method", [None, "condensed"])
def test_dragged_block_at_the_limit(method):
    carried = solve(dragged(0.999), method=method)
    assert carried.status is Status.SOLVED, carried.message
    assert carried.contacts["base"].tangential_force == pytest.approx(-0.999 * 0.3 * 20.0, rel=1e-8)
    lost = solve(dragged(1.01), method=method)
    assert lost.status is Status.INFEASIBLE
    assert "slide" in lost.message
    assert "base" in lost.message


@pytest.mark.parametrize("method", [None, "condensed"])
def test_tension_on_top(method):
    mesh = RectilinearMesh.rectangle((3, 3), 2.0, 1.0)

    def pulled(stress):
        conditions = [Contact("bottom", 0.3, name="base"), Traction("top", 0.0, stress), Symmetry("left")]
        return solve(ContactProblem(mesh, STEEL, [*conditions, *free("right")]), method=method)

    assert pulled(-1e-3).status is Status.SOLVED
    result = pulled(1e-3)
    assert result.status is Status.INFEASIBLE
    assert "pull" in result.message
    assert "base" in result.message


@pytest.mark.parametrize("law", [{}, {"cohesion": 0.03}, {"cohesion": 1e6, "shear_limit": 1e9}])
@pytest.mark.parametrize("gap", [1e-3, 0.0, -1e-3])
def test_nothing_but_rounding_to_carry(gap, law):
    """A free block is not pressed by a base at any distance: zero, beside which cohesion is large beyond measure."""
    block = RectilinearMesh.rectangle((2, 2))
    base = Contact("bottom", 0.3, gap=gap, name="base", **law)
    result = solve(ContactProblem(block, STEEL, [base, *free("left", "right", "top")]), method="condensed")
    assert result.status is Status.SOLVED, result.message
    assert np.abs(result.contacts["base"].normal_stress).max() < 1e-15 * STEEL.young
    assert result.iterations < 60


SIDES = {
    "one side": [Contact("bottom", 0.3), *free("left", "right"), Displacement("top", 0.0, -1e-3)],
    "opposite sides": [Contact("bottom", 0.3), Contact("top", 0.2, gap=-1e-3), *free("left", "right")],
    "around a corner": [
        Contact("bottom", 0.3), Contact("left", 0.2), Traction("right", -1.0, 0.0), Traction("top", 0.0, -1.0),
    ],
    "all sides": [Contact(side, 0.3, gap=-1e-3) for side in ("bottom", "left", "right", "top")],
    "shear beside": [
        Contact("bottom", 0.3), Traction("left", 0.0, lambda _, y: 0.2 * (1.0 - y)), Traction("right", 0.0, 0.0),
        Displacement("top", 0.0, -1e-2),
    ],
    "driven": [
        Contact("bottom", 0.3), *free("left", "right"),
        Contact("top", 0.3, plate=RigidPlate(force_y=-8.0, moment=-5.0)),
    ],
}  # fmt: skip


@pytest.mark.parametrize(
    ("sides", "joints"),
    thinned(product(SIDES, ([], [("a", "horizontal", 0.3)], [("a", "horizontal", 0.3), ("b", "vertical", 0.8)])), 10),
)
def test_traces_reproduce_the_tractions(sides, joints):
    """Whatever depends on what: prescribed shear beside, balance of the whole body, corners, joints that cross."""
    problem = on_lines(*SIDES[sides], *(Contact(name, 0.2) for name, *_ in joints), joints=joints)
    qvi = discretize(problem).qvi
    interface = interface_of(qvi.contact_rows, qvi.A)
    coordinates = trace_coordinates(qvi.contact_rows, qvi.traces, interface)
    dense = trace_coordinates(qvi.contact_rows, None, interface)
    x = np.random.default_rng(0).normal(size=len(interface)) * np.sqrt(1.0 / qvi.K.diagonal()[interface])
    expected = qvi.contact_rows[:, interface] @ x
    size = np.abs(expected).max()
    for found in (coordinates, dense):
        assert found.interpolation @ found.from_values(x) == pytest.approx(expected, abs=1e-10 * size)
        assert np.linalg.norm(found.to_unknowns(found.from_values(x)) - x) < 1e-8 * np.linalg.norm(x)
    rows = qvi.contact_rows.toarray()
    rank = np.linalg.matrix_rank(rows / np.abs(rows).max(axis=1, keepdims=True), tol=1e-9)
    assert np.count_nonzero(dense_rows(coordinates.interpolation).any(axis=0)) == rank
    assert np.linalg.cond(Reduction(qvi).stiffness) < 1e5
    result = solve(problem)
    assert result.status is Status.SOLVED, result.message


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


def test_the_path_passes_a_fold(fold):
    """τ rises before it falls for good."""
    path, record = fold
    logs = np.array([entry[0] for entry in record])
    assert path.passed
    assert not path.lost
    assert logs.max() > logs[0] + 0.03
    assert logs[-1] < logs[0] - 2.0
    assert (np.diff(logs) > 0.0).any()


def test_the_path_is_central(fold):
    """Once found, s λ stays within a factor of two of τ ω, though every step is only one Newton step."""
    _, record = fold
    products = [entry[2] for entry in record]
    near = [bool((np.abs(p - 1.0) < 1.0).all()) for p in products]
    first = near.index(True)
    assert first < len(near) / 2
    assert np.mean(near[first:]) > 0.9
    assert all((p > 0.0).all() for p in products)


def test_the_parameter_is_what_the_path_says(fold):
    path, record = fold
    assert sum(change for _, change, *_ in record) == pytest.approx(path._log - path._start, abs=1e-9)
    assert record[-1][0] == pytest.approx(path._log, abs=0.3)


@pytest.mark.parametrize(
    ("friction", "cells", "most"), [(2.5, 32, 65), (3.0, 32, 110), (4.0, 8, 60), (4.0, 32, 140), (5.0, 32, 100)]
)
def test_what_the_interior_point_cannot_the_path_can(friction, cells, most):
    """At the first start; where the path was looked for next to its turn the last three took 350, 474 and 224."""
    result = solve(ssnv128((cells, cells), friction), method="condensed")
    assert result.status is Status.SOLVED, result.message
    assert result.iterations <= most


def test_without_friction_the_path_only_falls():
    problem, interior = at(ssnv128((8, 8), 0.0))
    for _ in range(3):
        interior.iterate(interior.residuals())
    assert isinstance(problem, Complementarity)
    assert isinstance(interior, InteriorPoint)
    path = CentralPath(interior)
    changes = [path.advance() for _ in range(12)]
    assert all(change < 0.0 for change in changes[6:])
    assert not path.lost
