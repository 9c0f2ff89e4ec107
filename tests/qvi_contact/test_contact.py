"""Gap, slip and state of contact points; a contact that opens, slips and sticks against published values."""

import numpy as np
import pytest

from qvi_contact import Contact, ContactState, InputError, Material, TriangleMesh, exact, solve
from qvi_contact.gallery import SSNV128_DISPLACEMENTS, compressed_plate, ssnv128, stick_slip_block
from qvi_contact.solution import STATE_TOLERANCE, contact_states
from solvers import Status

OPEN, STICK, SLIP, _CLOSED = ContactState
T = STATE_TOLERANCE
UNIT = 200.0
"""Of the points made by hand."""


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
    """All in units of 200."""
    assert contact_states(*(UNIT * np.array([v]) for v in (-pressure, shear, bound, gap, slip)), UNIT) == [expected]


def test_states_do_not_depend_on_the_neighbours_or_on_the_sign():
    values = np.array([[-1, 0.3, 0.3, 0, -0.2], [0, 0, 0, 0.5, 0], [-1, 0.1, 0.3, 0, 0], [-1, -0.3, 0.3, 0, 0.2]])
    assert contact_states(*values.T, 1.0).tolist() == [SLIP, OPEN, STICK, SLIP]
    assert contact_states(*(values * [1, -1, 1, 1, -1]).T, 1.0).tolist() == [SLIP, OPEN, STICK, SLIP]


MATERIAL = Material(1000.0, 0.3)


@pytest.mark.parametrize(("cells", "grading", "plane"), [((5, 3), 1.0, "strain"), ((6, 4), 0.5, "stress")])
def test_a_frictionless_plate_spreads_evenly_up_to_its_corner(cells, grading, plane):
    result = solve(compressed_plate(0.0, cells, width=1.5, plane=plane, grading=grading))
    line = result.contacts["plate"]
    c = result.problem.material.compliance
    spread = c[0, 1] / c[1, 1] * -1e-3 * line.x  # ε_xx = c12 σ_yy, in plane stress ν p x/E
    assert result.status is Status.SOLVED
    assert spread.min() > 0
    assert line.slip == pytest.approx(spread, rel=1e-6)
    assert line.gap == pytest.approx(0.0, abs=1e-9 * 1e-3)
    assert set(line.state) == {ContactState.CLOSED}
    assert line.shares == {"open": 0.0, "closed": pytest.approx(1.0)}  # nothing to stick or slip by


@pytest.mark.parametrize("friction", [0.0, 0.4])
@pytest.mark.parametrize("side", ["bottom", "top"])
def test_gap_and_slip_over_an_obstacle_that_is_not_reached(side, friction):
    """Tension along x: g − u_N and u_T − w for an obstacle that is a sloping line, moved along the contact."""
    state = exact.uniform(MATERIAL, xx=30.0)
    mesh = TriangleMesh.rectangle((4, 2), 2.0, 1.0, grading=0.7)
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


MOVED = {"rotation": 0.03, "lift": -0.05}
"""A rigid motion that the obstacle follows: its gap function is then not small."""


@pytest.mark.parametrize("plane", ["stress", "strain"])
def test_the_state_is_elastic(plane):
    """Strains of the displacement are those of the stress, by central differences, exact for cubics but for h²."""
    problem, state = stick_slip_block(plane=plane, pressure_drop=40.0, **MOVED)
    x, y = np.random.default_rng(1).uniform(size=(2, 20))
    h = 1e-3
    ux, uy = (state.displacement(x + h, y) - state.displacement(x - h, y)) / (2 * h)
    vx, vy = (state.displacement(x, y + h) - state.displacement(x, y - h)) / (2 * h)
    strain = np.einsum("ij,jn->in", problem.material.compliance, state.stress(x, y))
    assert np.stack([ux, vy, vx + uy]) == pytest.approx(strain, abs=1e-7)


@pytest.mark.parametrize(("name", "value"), [("transition", 2.0), ("pressure_drop", 100.0), ("slip", 0.0)])
def test_data_out_of_range(name, value):
    with pytest.raises(InputError) as caught:
        stick_slip_block(**{name: value})
    assert caught.value.field == name


SIDE = 0.04
CELLS = 16
POINTS = np.array([x for _, x, _ in SSNV128_DISPLACEMENTS])
PUBLISHED = np.array([u for _, _, u in SSNV128_DISPLACEMENTS])
SETTLED = np.array([2.8603e-5, 2.7226e-5, 2.2868e-5, 1.9808e-5, 1.5414e-5])
"""u_x at the same points: biquadratic displacement elements with nodal contact, up to 320×96 cells, ± 2e-9 m."""
SETTLED_FORCE = 1.40535e6
SETTLED_PRESSURE = 8.3882e7


def trace(line, values, x, degree):
    """Values at points x of a contact quantity that is a polynomial on each cell edge of the base."""
    lines = np.linspace(0.0, SIDE, len(line.x) // 4 + 1)
    found = []
    for place in np.atleast_1d(x):
        edge = min(np.searchsorted(lines, place, side="right") - 1, len(lines) - 2)
        points = slice(4 * edge, 4 * edge + 4)
        found.append(np.polynomial.Polynomial.fit(line.x[points], values[points], degree)(place))
    return np.array(found)


@pytest.fixture(scope="module", params=["edges", "points"])
def result(request):
    return solve(ssnv128((CELLS, CELLS)), law_on=request.param)


@pytest.fixture(scope="module")
def base(result):
    return result.contacts["base"]


def test_forces(result, base):
    """Equilibrium to rounding; what friction leaves of the push on x = 0 arrives on x = a."""
    assert result.status is Status.SOLVED
    assert (result.remarks == ()) == (result.discretization.rule.law_on == "edges")
    assert base.normal_force == pytest.approx(5e7 * SIDE, rel=1e-9)
    assert base.tangential_force == pytest.approx(-SETTLED_FORCE, rel=2e-4)  # pulls back what is pushed along +x
    assert result.resultant("right").x == pytest.approx(-15e7 * SIDE - base.tangential_force, rel=1e-9)


def test_displacements(base):
    """Those of another discretisation; published ones to 2 % and, at point E, to the 5 % of their two digits."""
    found = trace(base, base.slip, POINTS, 2)
    assert found == pytest.approx(SETTLED, rel=2e-3)
    assert found[:4] == pytest.approx(PUBLISHED[:4], rel=0.02)
    assert found[4] == pytest.approx(PUBLISHED[4], rel=0.05)


def test_zones(base):
    """Open, slip, stick, in this order, with boundaries within a cell of those of the other discretisation."""
    changes = np.flatnonzero(np.diff(base.state))
    assert base.state[np.r_[0, changes + 1]].tolist() == [OPEN, SLIP, STICK]
    found = (base.x[changes] + base.x[changes + 1]) / 2
    assert found == pytest.approx([3.28e-3, 29.84e-3], abs=SIDE / CELLS)


def test_pressure_and_gap(base):
    assert trace(base, base.normal_stress, SIDE, 1) == pytest.approx(-SETTLED_PRESSURE, rel=1e-3)
    assert (base.normal_stress <= 1e-6 * SETTLED_PRESSURE).all()
    gap = trace(base, base.gap, 0.0, 1)
    assert gap == pytest.approx(5.9e-7, rel=0.05)
    assert np.abs(base.gap[base.x > 5e-3]).max() < 0.05 * gap
