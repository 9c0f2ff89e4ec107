"""A manufactured state that sticks on one part of a curved contact and slips on the other.

The discrete problem knows the friction law at four Gauss points of every edge, and these points integrate all products
of displacements (cubic) and trace stresses (quadratic) exactly. So with a stress function in the space

    ∫ cσ:(τ − σ) − loads(τ − σ) = Σ W [(u_N − g)(τ_N − σ_N) + (u_T − w)(τ_T − σ_T)]   with values at the Gauss points,

where every product of the second kind is ≥ 0 by the friction law of the exact state at that very point: the exact
stress solves the discrete problem wherever the transition lies. Only what is approximated shows a rate:

* The slip is a projection on continuous quadratics. Outside the element of the transition it is one; inside, −A (x −
  x_t)² for x > x_t in local coordinates is A h² times a fixed function if x_t keeps its relative place. The error is
  A h² times a fixed function that decays away from there: h² in the maximum, h^(5/2) in L².
* With a quadratic pressure (k ≠ 0) Φ is no longer contained. Then σ_N is interpolated linearly and the stress by the
  second derivatives of cubics: h² in L². The friction law adds at most √(slip × length × traction error) = √(h² h h²)
  = h^(5/2), which is not seen. (A transition without such data, as in SSNV128, is less smooth: about h^1.6 there.)
"""

from itertools import product

import numpy as np
import pytest

from qvi_contact import ContactState, solve
from qvi_contact.gallery import stick_slip_block
from qvi_contact.mesh.grid import graded_lines
from solvers import Status
from tests.effort import thinned

pytestmark = pytest.mark.usefixtures("bogner_fox_schmit")  # four Gauss points of every edge, as in the docstring

OPEN, STICK, SLIP, _CLOSED = ContactState
WIDTH, FAR_SLIP = 2.0, 0.02
MOVED = {"rotation": 0.03, "lift": -0.05}
"""A rigid motion that the obstacle follows: its gap function is then not small."""


def exact_slip(x, transition):
    return -FAR_SLIP * (np.maximum(x - transition, 0.0) / (WIDTH - transition)) ** 2


def relative_error(result, state, count=100):
    """Largest error of the stress at random points over the largest stress."""
    x, y = np.random.default_rng(7).uniform(size=(2, count)) * [[WIDTH], [result.problem.mesh.y[-1]]]
    expected = np.moveaxis(state.stress(x, y), 0, -1)
    return np.abs(result.stress(x, y) - expected).max() / np.abs(expected).max()


def mean_square_error(result, state):
    """L² norm of the stress error over the root of the area."""
    x, y, stress = result.gauss_stress()
    square = ((stress - np.moveaxis(state.stress(x, y), 0, -1)) ** 2).sum(axis=(1, 2))  # cells of one size
    return np.sqrt(square.mean())


def check_exact(result, state, tolerance=1e-8):
    base = result.contacts["base"]
    exact = state.stress(base.x, base.y)
    assert result.status is Status.SOLVED
    assert relative_error(result, state) < tolerance
    assert base.normal_stress == pytest.approx(exact[1], abs=100.0 * tolerance)
    assert base.tangential_stress == pytest.approx(-exact[2], abs=100.0 * tolerance)
    assert base.tangential_force == pytest.approx(20.0, rel=tolerance)  # ∫ 30 (x/2)² dx, along +x
    assert base.normal_force == pytest.approx(200.0, rel=tolerance)
    assert base.gap == pytest.approx(0.0, abs=1e-9)


NODES = {  # cells, grading, the grid line with the transition
    "2x1": ((2, 1), 1.0, 1),
    "4x3": ((4, 3), 1.0, 2),
    "5x4": ((5, 4), 1.0, 1),
    "16x8": ((16, 8), 1.0, 11),
    "graded to the right": ((9, 4), 0.8, 3),
    "graded to the left": ((6, 6), 1.5, 4),
}


@pytest.mark.parametrize(("node", "plane"), thinned(product(NODES, ("stress", "strain")), 6))
def test_transition_on_a_node(node, plane):
    cells, grading, line = NODES[node]
    transition = float(graded_lines(0.0, WIDTH, cells[0], grading)[line])
    problem, state = stick_slip_block(cells, transition, plane=plane, grading=grading, slip=FAR_SLIP, **MOVED)
    result = solve(problem, inner="qp:daqp", tolerance=1e-9)
    base = result.contacts["base"]
    check_exact(result, state)
    assert base.slip == pytest.approx(exact_slip(base.x, transition), abs=1e-8 * FAR_SLIP)
    assert base.state.tolist() == np.where(base.x < transition, STICK, SLIP).tolist()


@pytest.mark.parametrize(
    ("mesh", "transition", "plane"),
    thinned(
        product([((1, 1), 1.0), ((4, 3), 1.0), ((7, 3), 1.0), ((8, 4), 0.8)], (0.3, 0.77, 1.31), ("stress", "strain")),
        10,
    ),
)
def test_transition_inside_an_element(mesh, transition, plane):
    """The stress is exact here as well; states are right outside the element of the transition."""
    cells, grading = mesh
    problem, state = stick_slip_block(cells, transition, plane=plane, grading=grading, slip=FAR_SLIP, **MOVED)
    result = solve(problem, inner="qp:daqp", tolerance=1e-9)
    base = result.contacts["base"]
    check_exact(result, state)
    lines = problem.mesh.x
    element = np.searchsorted(lines, transition)
    outside = (base.x < lines[element - 1]) | (base.x > lines[element])
    assert base.state[outside].tolist() == np.where(base.x < transition, STICK, SLIP)[outside].tolist()
    assert set(base.state) <= {STICK, SLIP}


@pytest.mark.parametrize("inner", ["qp:clarabel", "direct:clarabel", "socp:clarabel"])
def test_other_inner_solvers(inner):
    """Interior points leave more: the error of x is about the root of their tolerance where slip begins from zero."""
    problem, state = stick_slip_block((4, 3), 1.0, slip=FAR_SLIP, **MOVED)
    check_exact(solve(problem, inner=inner, tolerance=1e-9), state, tolerance=2e-7)


def errors(cells, transition, **data):
    """Mesh size, and errors of stress, σ_N, σ_T and slip in L² along the base and of slip in the maximum."""
    problem, state = stick_slip_block((cells, cells), transition, slip=FAR_SLIP, **data)
    result = solve(problem, inner="qp:daqp", tolerance=1e-9)
    base = result.contacts["base"]
    assert result.status is Status.SOLVED
    exact = state.stress(base.x, base.y)
    lines = base.normal_stress - exact[1], base.tangential_stress + exact[2], base.slip - exact_slip(base.x, transition)
    norms = [np.sqrt(base.weights @ line**2) for line in lines]
    return [WIDTH / cells, mean_square_error(result, state), *norms, np.abs(lines[2]).max()]


def rates(transition, **data):
    """Observed orders in h on 9², 17², 33² cells: x_t = 1 is in the middle of its element, x_t = 0.5 a quarter in."""
    logs = np.log([errors(cells, transition, **data) for cells in (9, 17, 33)])
    steps = np.diff(logs, axis=0)
    return steps[:, 1:] / steps[:, :1]


@pytest.mark.parametrize("transition", [1.0, 0.5])
def test_rate_of_the_slip(transition):
    _, _, _, slip, largest = rates(transition).T
    assert slip == pytest.approx(2.5, abs=0.02)
    assert largest == pytest.approx(2.0, abs=0.02)


@pytest.mark.parametrize("transition", thinned([1.0, 0.5], 1))
def test_rate_of_the_stress_if_the_pressure_is_quadratic(transition):
    stress, normal, tangential, slip, _ = rates(transition, pressure_drop=40.0).T
    assert stress == pytest.approx(2.0, abs=0.02)
    assert normal == pytest.approx(2.0, abs=0.02)
    assert (tangential > 1.95).all()
    assert slip == pytest.approx(2.5, abs=0.15)
