"""Gap, slip and state of contact points."""

import numpy as np
import pytest
from scipy.linalg import null_space

from qvi_contact import Contact, Material, RectilinearMesh, discretize, exact
from qvi_contact.discretization.bogner_fox_schmit.displacements import project_tangential
from qvi_contact.solution.contact_line import (
    STATE_TOLERANCE,
    contact_line,
)

pytestmark = pytest.mark.usefixtures("bogner_fox_schmit")  # states and jumps of that element's points

T = STATE_TOLERANCE


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
