"""Gap, slip and state of contact points; SSNV128, where all states meet, is in the manual."""

import numpy as np
import pytest

from qvi_contact import Contact, ContactState, Material, TriangleMesh, solve
from qvi_contact.gallery import exact
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


MATERIAL = Material(1000.0, 0.3)


@pytest.mark.parametrize("friction", [0.0, 0.4])
@pytest.mark.parametrize("side", ["bottom", "top"])
def test_gap_and_slip_over_an_obstacle_that_is_not_reached(side, friction):
    """Tension along x: g − u_N and u_T − w for an obstacle that is a sloping line, moved along the contact."""
    state = exact.uniform(MATERIAL, xx=30.0)
    mesh = TriangleMesh.rectangle((4, 2), 2.0, 1.0, grading=0.7)
    contact = Contact(
        side, friction=friction, gap=lambda x, y: 0.05 + 0.02 * x + 0 * y, offset=lambda x, y: 0.01 - 0.03 * x + 0 * y
    )
    other, outward = ("bottom", 1.0) if side == "top" else ("top", -1.0)
    sides = {side: "cc", "right": "uu", other: "tt", "left": "uu"}
    result = solve(exact.problem_from_state(state, mesh, MATERIAL, sides, (contact,)))
    line = result.contacts[side]
    u = state.displacement(line.x, line.y)
    assert result.status is Status.SOLVED
    assert set(line.state) == {OPEN}
    assert line.gap == pytest.approx(0.05 + 0.02 * line.x - outward * u[1], rel=1e-7)
    assert line.slip == pytest.approx(u[0] - (0.01 - 0.03 * line.x), abs=1e-8)
    assert line.normal_force == pytest.approx(0.0, abs=1e-7)
