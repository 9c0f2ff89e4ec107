"""Gap, slip and state of contact points."""

import dataclasses

import numpy as np
import pytest
from scipy.linalg import null_space

from qvi_contact import Contact, ContactState, Material, RectilinearMesh, discretize, exact, solve
from qvi_contact.discretization.bogner_fox_schmit.displacements import project_normal, project_tangential
from qvi_contact.gallery import compressed_plate, sliding_block
from qvi_contact.solution.contact_line import (
    STATE_TOLERANCE,
    contact_line,
    contact_states,
)
from solvers import Status

pytestmark = pytest.mark.usefixtures("bogner_fox_schmit")  # states and jumps of that element's points

OPEN, STICK, SLIP = ContactState
T = STATE_TOLERANCE
STRESS, DISPLACEMENT = 200.0, 1e-3
"""Units of the points made by hand."""


@pytest.mark.parametrize(
    ("pressure", "shear", "bound", "gap", "slip", "expected"),
    [
        # clear cases
        (0.0, 0.0, 0.0, 0.5, 0.0, OPEN),
        (0.0, 0.0, 0.0, 0.5, 0.7, OPEN),
        (1.0, 0.1, 0.3, 0.0, 0.0, STICK),
        (1.0, 0.0, 0.3, 0.0, 0.0, STICK),
        (1.0, 0.3, 0.3, 0.0, -0.2, SLIP),
        (1.0, -0.3, 0.3, 0.0, 0.2, SLIP),
        (1.0, 0.0, 0.0, 0.0, 0.2, SLIP),  # no friction
        (1.0, 0.0, 0.0, 0.0, 0.0, STICK),  # no friction, and nothing that would move it
        # the gap against the pressure
        (0.0, 0.0, 0.0, 0.0, 0.0, OPEN),
        (0.5 * T, 0.0, 0.0, 0.0, 0.0, OPEN),
        (2.0 * T, 0.0, 0.3, 0.0, 0.0, STICK),
        (0.2, 0.0, 0.06, 0.2 - 0.5 * T, 0.0, OPEN),
        (0.2, 0.0, 0.06, 0.2 - 2.0 * T, 0.0, STICK),
        (-0.1, 0.0, 0.03, 0.0, 0.0, OPEN),  # tension left over by a loose solve
        # the slip against what is left of the bound
        (1.0, 0.3 - 0.5 * T, 0.3, 0.0, 0.0, SLIP),
        (1.0, 0.3 - 2.0 * T, 0.3, 0.0, 0.0, STICK),
        (1.0, 0.3 - 1e-3, 0.3, 0.0, 1e-3 - 0.5 * T, SLIP),
        (1.0, 0.3 - 1e-3, 0.3, 0.0, 1e-3 - 2.0 * T, STICK),
        (1.0, 0.3 + 1e-3, 0.3, 0.0, 0.0, SLIP),  # beyond the bound
        # whether it moves or is loaded at all
        (1.0, 0.0, 0.0, 0.0, 0.5 * T, STICK),
        (1.0, 0.0, 0.0, 0.0, 2.0 * T, SLIP),
        (1.0, 0.5 * T, 0.5 * T, 0.0, 0.0, STICK),
        (1.0, 2.0 * T, 2.0 * T, 0.0, 0.0, SLIP),
    ],
)
def test_state_of_a_point(pressure, shear, bound, gap, slip, expected):
    """Pressure, shear and bound in units of 200, gap and slip of 1e-3."""
    stress, displacement = [np.array([v]) for v in (-pressure, shear, bound)], [np.array([v]) for v in (gap, slip)]
    found = contact_states(
        *(STRESS * value for value in stress),
        *(DISPLACEMENT * value for value in displacement),
        STRESS,
        DISPLACEMENT,
    )
    assert found == [expected]


def test_states_do_not_depend_on_the_neighbours_or_on_the_sign():
    values = np.array([[-1, 0.3, 0.3, 0, -0.2], [0, 0, 0, 0.5, 0], [-1, 0.1, 0.3, 0, 0], [-1, -0.3, 0.3, 0, 0.2]])
    assert contact_states(*values.T, 1.0, 1.0).tolist() == [SLIP, OPEN, STICK, SLIP]
    assert contact_states(*(values * [1, -1, 1, 1, -1]).T, 1.0, 1.0).tolist() == [SLIP, OPEN, STICK, SLIP]


def test_normal_projection_is_exact_for_linear_functions_and_blind_to_the_rest():
    t, weights = np.polynomial.legendre.leggauss(4)
    lines = np.random.default_rng(1).normal(size=(5, 2))
    linear = (lines[:, :1] + lines[:, 1:] * t).ravel()
    assert project_normal(4, linear) == pytest.approx(linear, abs=1e-13)
    rest = np.stack([np.polynomial.legendre.legval(t, c) for c in np.eye(4)[2:]])  # orthogonal to linear functions
    assert np.abs(rest @ (weights * t)).max() < 1e-14
    for values in rest:
        assert project_normal(4, linear + np.tile(values, 5)) == pytest.approx(linear, abs=1e-13)


MATERIAL = Material(1000.0, 0.3)
SIDES = {  # what is prescribed left and right decides where σ_T is known at the ends of the base
    "free ends": ("uu", "uu"),
    "left prescribed": ("tt", "uu"),
    "right prescribed": ("uu", "tt"),
    "both prescribed": ("tt", "tt"),
}


def based(ends, cells=(4, 2), grading=0.6):
    """A block in uniform stress on a base, with either displacements or tractions at its sides."""
    left, right = SIDES[ends]
    state = exact.uniform(MATERIAL, xx=-20.0, yy=-100.0, xy=3.0)
    mesh = RectilinearMesh.rectangle(cells, 2.0, 1.0, origin=(-1.0, 0.5), grading=grading)
    sides = {"bottom": "cc", "right": right, "top": "uu", "left": left}
    return discretize(exact.problem_from_state(state, mesh, MATERIAL, sides, (Contact("bottom", friction=0.5),)))


def blind_nodes(discretization):
    return np.flatnonzero(~discretization.elimination.kept[3::4])


def piecewise_quadratic(x, lines):
    """A continuous function, quadratic between the lines and with kinks on them."""
    random = np.random.default_rng(2)
    ends = random.normal(size=len(lines))
    cell = np.clip(np.searchsorted(lines, x) - 1, 0, len(lines) - 2)
    t = (x - lines[cell]) / (lines[cell + 1] - lines[cell])
    return ends[cell] * (1 - t) + ends[cell + 1] * t + random.normal(size=len(lines) - 1)[cell] * t * (1 - t)


@pytest.mark.parametrize("cells", [(4, 2), (1, 1)])
def test_tangential_projection_knows_all_quadratics_if_no_end_is_prescribed(cells):
    discretization = based("free ends", cells)
    (rows,) = discretization.contacts
    values = piecewise_quadratic(rows.points.coordinates[:, 0], discretization.grid.x.lines)
    found = project_tangential(rows, rows.points.weights * values, np.zeros(0, dtype=int))
    assert found == pytest.approx(values, abs=1e-12)


@pytest.mark.parametrize("ends", list(SIDES)[1:])
def test_tangential_projection_extends_linear_functions_to_prescribed_ends(ends):
    discretization = based(ends)
    (rows,) = discretization.contacts
    x, lines = rows.points.coordinates[:, 0], discretization.grid.x.lines
    linear = 0.7 - 2.0 * x
    assert project_tangential(rows, rows.points.weights * linear, blind_nodes(discretization)) == pytest.approx(
        linear, abs=1e-12
    )
    kinked = piecewise_quadratic(x, lines)  # linear on the end edges, quadratic inside
    for first, last in ((0, 1), (-2, -1)):
        on = (lines[first] < x) & (x < lines[last])
        kinked[on] = np.interp(x[on], lines, piecewise_quadratic(lines + 1e-12 * (lines == lines[0]), lines))
    found = project_tangential(rows, rows.points.weights * kinked, blind_nodes(discretization))
    assert found == pytest.approx(kinked, abs=1e-9)


def test_tangential_projection_of_one_edge_with_both_ends_prescribed_keeps_a_translation():
    discretization = based("both prescribed", (1, 1))
    (rows,) = discretization.contacts
    found = project_tangential(rows, rows.points.weights * 0.4, blind_nodes(discretization))
    assert found == pytest.approx(0.4, abs=1e-12)


@pytest.mark.parametrize("ends", SIDES)
def test_gap_and_slip_do_not_depend_on_which_multipliers_a_solver_returns(ends):
    """Rows of N and T depend on each other: multipliers are one choice of many, displacements are not."""
    discretization = based(ends)
    qvi = discretization.qvi
    random = np.random.default_rng(3)
    m_N, m_T = random.uniform(size=(2, len(qvi.W)))
    tractions = np.full_like(m_N, -1.0), np.zeros_like(m_N)
    dependent = [null_space(rows_of.toarray().T) for rows_of in (qvi.N, qvi.T)]
    edges = len(m_N) // 4
    known = {"free ends": 0, "both prescribed": 2}.get(ends, 1)
    assert [basis.shape[1] for basis in dependent] == [2 * edges, 4 * edges - (2 * edges + 1 - known)]
    line = contact_line(discretization, 0, *tractions, m_N, m_T)
    shifted = [
        m + 5.0 * basis @ random.normal(size=basis.shape[1]) for m, basis in zip((m_N, m_T), dependent, strict=True)
    ]
    other = contact_line(discretization, 0, *tractions, *shifted)
    assert np.abs(shifted[1] - m_T).max() > 1.0
    assert other.gap == pytest.approx(line.gap, abs=1e-12 * np.abs(line.gap).max())
    assert other.slip == pytest.approx(line.slip, abs=1e-11 * np.abs(line.slip).max())


@pytest.mark.parametrize("plane", ["stress", "strain"])
@pytest.mark.parametrize(("cells", "grading"), [((2, 2), 1.0), ((5, 3), 1.0), ((6, 4), 0.5)])
def test_a_frictionless_plate_spreads_evenly_up_to_its_corner(cells, grading, plane):
    result = solve(compressed_plate(0.0, cells, width=1.5, plane=plane, grading=grading))
    line = result.contacts["plate"]
    c = result.problem.material.compliance
    spread = c[0, 1] / c[1, 1] * -1e-3 * line.x  # ε_xx = c12 σ_yy, in plane stress ν p x/E
    assert result.status is Status.SOLVED
    assert spread.min() > 0
    assert line.slip == pytest.approx(spread, rel=1e-6)
    assert line.gap == pytest.approx(0.0, abs=1e-9 * 1e-3)
    assert set(line.state) == {SLIP}


@pytest.mark.parametrize("cells", [(1, 1), (3, 2), (5, 4)])
def test_sliding_block(cells):
    problem, state = sliding_block(cells)
    line = solve(problem, tolerance=1e-10).contacts["base"]
    assert line.slip == pytest.approx(state.displacement(line.x, line.y)[0], rel=1e-8)
    assert line.gap == pytest.approx(0.0, abs=1e-10)
    assert set(line.state) == {SLIP}
    assert line.friction_bound == pytest.approx(30.0, rel=1e-8)
    assert line.weights.sum() == pytest.approx(2.0, rel=1e-14)


@pytest.mark.parametrize("friction", [0.0, 0.4])
@pytest.mark.parametrize("side", ["bottom", "top"])
def test_gap_and_slip_over_an_obstacle_that_is_not_reached(side, friction):
    """Tension along x: g − u_N and u_T − w for an obstacle that is a sloping line, moved along the contact."""
    state = exact.uniform(MATERIAL, xx=30.0)
    mesh = RectilinearMesh.rectangle((4, 2), 2.0, 1.0, grading=0.7)
    contact = Contact(
        side, friction=friction, gap=lambda x, y: 0.05 + 0.02 * x + 0 * y, offset=lambda x, y: 0.01 - 0.03 * x + 0 * y
    )
    other = "top" if side == "bottom" else "bottom"
    sides = {side: "cc", "right": "uu", other: "tt", "left": "uu"}
    result = solve(exact.problem_from_state(state, mesh, MATERIAL, sides, (contact,)))
    line = result.contacts[side]
    u = state.displacement(line.x, line.y)
    outward = 1.0 if side == "top" else -1.0
    assert result.status is Status.SOLVED
    assert set(line.state) == {OPEN}
    assert line.gap == pytest.approx(0.05 + 0.02 * line.x - outward * u[1], rel=1e-7)
    assert line.slip == pytest.approx(u[0] - (0.01 - 0.03 * line.x), abs=1e-8)
    assert line.normal_force == pytest.approx(0.0, abs=1e-7)


def test_contacts_take_their_own_rows():
    """Two contacts on one body: each has its own points, friction and force."""
    material = Material(1000.0, 0.0)
    state = exact.uniform(material, xx=-40.0)
    u = state.displacement(np.array(2.0), np.array(0.0))
    mesh = RectilinearMesh.rectangle((3, 2), 2.0, 1.0)
    contacts = (
        Contact("left", friction=0.2, name="stop"),
        Contact("right", friction=0.1, gap=float(u[0]), name="wall"),
    )
    sides = {"bottom": "tu", "right": "cc", "top": "tt", "left": "cc"}
    result = solve(exact.problem_from_state(state, mesh, material, sides, contacts))
    found = result.contacts
    assert result.status is Status.SOLVED
    assert list(found) == ["stop", "wall"]
    for name, x, friction in (("stop", 0.0, 0.2), ("wall", 2.0, 0.1)):
        line = found[name]
        assert line.name == name
        assert line.normal_force == pytest.approx(40.0, rel=1e-8)
        assert line.x == pytest.approx(x, abs=1e-14)
        assert line.friction_bound == pytest.approx(40.0 * friction, rel=1e-8)
        assert line.slip == pytest.approx(0.0, abs=1e-9)
        assert set(line.state) == {STICK}


def test_forces_follow_the_weights():
    line = solve(sliding_block((2, 1))[0]).contacts["base"]
    doubled = dataclasses.replace(line, weights=2 * line.weights)
    assert doubled.normal_force == pytest.approx(2 * line.normal_force)
    assert doubled.tangential_force == pytest.approx(-0.3 * doubled.normal_force, rel=1e-8)  # pulls back


def test_contacts_that_meet_in_a_corner():
    """They share Φ_xy there, so neither trace sees its own slip in the corner; it is continued from the edge."""
    state = exact.uniform(MATERIAL, xx=-40.0, yy=-100.0)
    mesh = RectilinearMesh.rectangle((3, 2), 2.0, 1.0)
    u = state.displacement(np.array(2.0), np.array(0.0))
    contacts = (
        Contact("bottom", friction=0.0, name="floor"),
        Contact("right", friction=0.0, gap=float(u[0]), name="wall"),
    )
    sides = {"bottom": "cc", "right": "cc", "top": "tt", "left": "ut"}
    found = solve(exact.problem_from_state(state, mesh, MATERIAL, sides, contacts)).contacts
    for name, component in (("floor", 0), ("wall", 1)):
        line = found[name]
        assert line.slip == pytest.approx(state.displacement(line.x, line.y)[component], abs=1e-8)
