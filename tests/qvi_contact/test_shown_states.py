"""What contacts on triangles show beside sharp edges, in corners and where they open, against closed forms."""

from pathlib import Path

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    Expression,
    Material,
    RectilinearMesh,
    RigidPlate,
    Traction,
)
from qvi_contact.files.problem_file import load_problem
from qvi_contact.gallery import compressed_plate
from tests.qvi_contact.states import solved

EXAMPLES = Path(__file__).parents[2] / "examples"
OPEN, STICK, SLIP = 0, 1, 2
DEGREES = pytest.mark.parametrize("degree", [4, 5])


def states(line):
    """Coordinates along a horizontal contact and the states there, from left to right."""
    order = np.argsort(line.x)
    return line.x[order], line.state[order]


def zones(line):
    """The sequence of states without repetition, such as [2, 1, 2]."""
    state = states(line)[1]
    return state[np.flatnonzero(np.diff(state, prepend=-1))].tolist()


@DEGREES
def test_flat_punch_slips_beside_its_edges_only(degree):
    """Displacements of degree 3 stick up to 0.773 and slip from 0.777 of its half width, on lines 0.01 apart there."""
    coarse = load_problem(EXAMPLES / "punch.toml").problem
    fine = np.arange(0.74, 0.83, 0.02)
    problem = coarse.on_lines(np.union1d(coarse.grid.x, [*-fine, *fine]), coarse.grid.y)
    punch = solved(problem.triangulated(), degree=degree).contacts["punch"]
    assert zones(punch) == [SLIP, STICK, SLIP]
    x, state = states(punch)
    assert np.abs(x[state == STICK]).max() <= 0.79
    assert np.abs(x[state == SLIP]).min() >= 0.76
    assert punch.weights[punch.state == STICK].sum() / 2.0 == pytest.approx(0.775, abs=0.015)


def away(smallest, length):
    """Lines from 0 to a length, each interval 1.25 times as long as the one before or a little more."""
    sizes = smallest * 1.25 ** np.arange(1 + int(np.log(length / smallest / 4.0) / np.log(1.25)))
    lines = np.concatenate([[0.0], np.cumsum(sizes)])
    return lines * (length / lines[-1])


@pytest.mark.parametrize("rows", ["bernstein", "gauss"])
def test_flat_punch_on_a_wide_block_sticks_on_some_four_fifths(rows):
    """Half width 20: displacements of degree 2 on lines down to 0.02 stick up to 0.764 and slip from 0.800 on."""
    half, outer = 1.0 - away(0.05, 1.0)[::-1], 1.0 + away(0.05, 19.0)
    right = np.concatenate([half, outer[1:]])
    mesh = RectilinearMesh(np.concatenate([-right[:0:-1], right]), -away(0.05, 20.0)[::-1])
    mesh = mesh.with_edges("punch", "top", start=-1.0, stop=1.0)
    mesh = mesh.with_edges("free left", "top", stop=-1.0).with_edges("free right", "top", start=1.0)
    free = [Traction(side, 0.0, 0.0) for side in ("left", "right", "free left", "free right")]
    contact = Contact("punch", 0.3, plate=RigidPlate(force_y=-100.0))
    steel = Material(2.1e5, 0.3, "strain")
    problem = ContactProblem(mesh, steel, [Displacement("bottom", 0.0, 0.0), *free, contact])
    punch = solved(problem.triangulated(), degree=4, contact_rows=rows).contacts["punch"]
    assert zones(punch) == [SLIP, STICK, SLIP]
    assert punch.weights[punch.state == STICK].sum() / 2.0 == pytest.approx(0.785, abs=0.035)
    assert abs(punch.tangential_force) < 1e-6 * punch.normal_force


@DEGREES
@pytest.mark.parametrize("rows", ["bernstein", "gauss"])
@pytest.mark.parametrize("cells", [(1, 1), (7, 2)])
def test_a_dragged_brake_pad_slips_all_over(cells, rows, degree):
    """T = μ N on any mesh, corners included; only at the trailing end the pad may lift."""
    mesh = RectilinearMesh.rectangle(cells, 100.0, 20.0)
    conditions = [
        Displacement("top", x=0.0),
        Traction("top", y=-2.0),
        Traction("left", 0.0, 0.0),
        Traction("right", 0.0, 0.0),
        Contact("bottom", 0.4, offset=1.0, name="disc"),
    ]
    problem = ContactProblem(mesh, Material(2000.0, 0.3, "strain"), conditions).triangulated()
    disc = solved(problem, degree=degree, contact_rows=rows).contacts["disc"]
    assert disc.normal_force == pytest.approx(200.0, rel=1e-9)
    assert abs(disc.tangential_force) == pytest.approx(0.4 * 200.0, rel=1e-8)
    assert zones(disc) in ([SLIP], [SLIP, OPEN])
    assert disc.weights[disc.state == OPEN].sum() < 5.0


@DEGREES
def test_a_wall_in_the_wind_opens_from_the_windward_side(degree):
    """A wall 1 × 4 of weight 25 under wind: pressure linear over three times the distance of the resultant's foot."""
    wind = 5.2
    mesh = RectilinearMesh.rectangle((8, 16), 1.0, 4.0)
    conditions = [
        Traction("left", wind / 4.0, 0.0),
        Traction("right", 0.0, 0.0),
        Traction("top", 0.0, 0.0),
        Contact("bottom", 0.5, name="ground"),
    ]
    wall = ContactProblem(mesh, Material(1e4, 0.2), conditions, body_potential=Expression("6.25 * y"))
    ground = solved(wall.triangulated(), degree=degree).contacts["ground"]
    foot = 0.5 - 2.0 * wind / 25.0  # from the lee side
    assert zones(ground)[0] == OPEN
    assert zones(ground)[-1] == STICK
    assert ground.weights[ground.state != OPEN].sum() == pytest.approx(3.0 * foot, abs=0.03)
    assert ground.weights @ ((1.0 - ground.x) * -ground.normal_stress) == pytest.approx(25.0 * foot, rel=1e-8)


@pytest.mark.parametrize("rows", ["bernstein", "gauss"])
@pytest.mark.parametrize("cells", [5, 13])
def test_the_end_of_the_stick_zone_lies_inside_an_edge(cells, rows):
    """At x = 0.749 on the paper's plate with μ = 0.2; not at an end of the edge it lies in, a cell's half away."""
    problem = compressed_plate(0.2, (cells, cells)).triangulated()
    plate = solved(problem, degree=5, contact_rows=rows).contacts["plate"]
    assert zones(plate) == [STICK, SLIP]
    assert plate.weights[plate.state == STICK].sum() == pytest.approx(0.749, abs=0.1 / cells)
