"""Strongly graded cells: exact discrete values where double precision holds them, a status where it does not."""

from functools import cache
from itertools import product

import pytest

from qvi_contact import ContactState, InputError, discretize, solve
from qvi_contact.gallery import compressed_plate
from qvi_contact.solution.solver import posed
from solvers import Status
from solvers.factorisation.augmented import ORTHOGONAL
from solvers.solution.finish import LOOSEST, Outcome, finish
from tests.effort import examples, thinned
from tests.qvi_contact.frictions import with_friction

BONDED = {
    (18, 0.6): 214.366845874428,
    (19, 0.6): 214.366846552723,
    (24, 0.6): 214.366847291526,
    (28, 0.6): 214.366847329517,
    (32, 0.65): 214.367238857135,
    (32, 0.8): 214.367623133544,
}
"""P/2 of the bonded plate on n² cells of a grading: discrete values by 200-bit arithmetic."""
STICK = ContactState.STICK


@cache
def meshed(cells, grading):
    """A plate on graded cells, in fitting units."""
    return posed(compressed_plate(1.0, (cells, cells), grading=grading))


def plate_on(cells, grading, friction):
    return with_friction(meshed(cells, grading), friction)


@cache
def condensed(friction, cells, grading):
    """Result by the condensed method, which several tests look at."""
    return solve(plate_on(cells, grading, friction), method="condensed")


def ratio(cells, grading):
    """Smallest cell over the largest."""
    return grading ** (cells - 1)


@pytest.mark.parametrize(("mesh", "friction"), thinned(product(BONDED, (1.0, 2.0, 20.0)), 9))
def test_full_stick_is_the_bonded_plate(mesh, friction):
    cells, grading = mesh
    result = condensed(friction, cells, grading)
    assert result.status is Status.SOLVED, result.message
    plate = result.contacts["plate"]
    assert (plate.state == STICK).all()
    accuracy = 1e-9 if ratio(cells, grading) > 0.99e-4 else 1e-6
    assert plate.normal_force == pytest.approx(BONDED[cells, grading], rel=accuracy)


@pytest.mark.parametrize(("cells", "grading"), BONDED)
def test_energy_of_the_bonded_plate(cells, grading):
    """P U = 2 × strain energy, of the quarter, by Clapeyron; by the default method."""
    result = solve(plate_on(cells, grading, 2.0))
    assert result.status is Status.SOLVED, result.message
    assert (result.contacts["plate"].state == STICK).all()
    assert 2.0 * result.energies.strain == pytest.approx(1e-3 * BONDED[cells, grading], rel=1e-6)


@pytest.mark.parametrize(
    ("cells", "grading", "expected"),
    [(16, 0.7, False), (32, 0.8, False), (19, 0.6, True), (24, 0.6, True), (32, 0.65, True)],
)
def test_the_factorisation_used_is_named(cells, grading, expected):
    """QR where the assembled K is lost, the sparse Cholesky factorisation where it is good enough."""
    used = condensed(0.2, cells, grading).solution.factorisation
    assert used.startswith(f"{ORTHOGONAL}, ") == expected


@pytest.mark.parametrize(
    ("mesh", "friction"),
    thinned(product([(18, 0.6), (24, 0.6), (28, 0.6), (32, 0.65)], (0.0, 0.02, 0.2, 0.5, 1.0)), 12),
)
def test_few_iterations_and_a_force_between_slip_and_stick(mesh, friction):
    cells, grading = mesh
    result = condensed(friction, cells, grading)
    assert result.status is Status.SOLVED, result.message
    force = result.contacts["plate"].normal_force
    assert 209.0 * (1.0 - 1e-9) < force < BONDED[cells, grading] * (1.0 + 1e-9)
    if friction == 0.0:
        assert force == pytest.approx(209.0, rel=1e-9)
    slow = (cells, friction) == (28, 1.0)  # cells down to 1e-6 of the largest: its path is centred slowly
    assert result.iterations <= (60 if slow else 40)  # some ten of them for the gap that the smallest edges need


@pytest.mark.parametrize("friction", [0.2, 0.5, 1.0])
def test_the_last_defect_is_worked_off(friction):
    """A residual beside which forces are large moves soft directions all the same: a hundred times more digits."""
    assert condensed(friction, 28, 0.6).certificate.accuracy < 1e-10


@pytest.mark.parametrize("friction", [0.02, 0.2, 1.0])
def test_both_factorisations_give_one_force(friction):
    """(18, 0.6) is the last that K serves: by its root instead the force is the same."""
    problem = compressed_plate(friction, (18, 18), grading=0.6)
    by_root = discretize(problem).fitted()
    assert by_root.qvi.operator.use_root()
    first, second = (solve(way, method="condensed") for way in (problem, by_root))
    assert first.solution.factorisation.split(",")[0] != second.solution.factorisation.split(",")[0] == ORTHOGONAL
    assert first.status is second.status is Status.SOLVED
    forces = [result.contacts["plate"].normal_force for result in (first, second)]
    assert forces[0] == pytest.approx(forces[1], rel=1e-9)


WITHOUT_ANSWER = (
    Status.ILL_CONDITIONED, Status.STALLED, Status.INACCURATE, Status.INNER_INFEASIBLE, Status.MAX_ITERATIONS,
)  # fmt: skip
"""How a method ends that rounding keeps from an answer; which of them, rounding decides as well."""


@pytest.mark.parametrize(
    ("cells", "grading", "friction"),
    [
        *((*mesh, friction) for mesh in [(30, 0.6), (24, 0.5)] for friction in (0.0, 0.2, 20.0)),
        *((40, 0.6, friction) for friction in (0.0, 2.0)[: examples(1)]),  # stalls, which takes its time
        *((48, 0.6, friction) for friction in thinned([0.0, 20.0], 1)),  # refused
    ],
)
def test_beyond_double_precision_there_is_no_wrong_number(cells, grading, friction):
    """An error about the mesh, a status, or the right force; a result to look at is right to its stated accuracy."""
    assert ratio(cells, grading) < 1e-6
    problem = compressed_plate(friction, (cells, cells), grading=grading)
    try:
        result = solve(problem, method="condensed")
    except InputError:
        with pytest.raises(InputError, match=r"ContactProblem\.mesh.*less grading"):
            discretize(problem)
        return
    if result.status is not Status.SOLVED:
        assert result.status in WITHOUT_ANSWER
    if result.status in (Status.SOLVED, Status.INACCURATE):
        expected = {0.0: 209.0, 0.2: 214.2327}.get(friction, BONDED[28, 0.6])
        allowed = 1e-5 if result.status is Status.SOLVED else 1e3 * result.certificate.accuracy
        assert result.contacts["plate"].normal_force == pytest.approx(expected, rel=allowed)


@pytest.mark.parametrize(("cells", "grading"), BONDED)
def test_inaccurate_results_are_nearly_right(cells, grading):
    """More is asked for than can be had: the force is right to a hundred times the stated accuracy, 1e-3 at worst."""
    result = solve(plate_on(cells, grading, 1.0), method="condensed", gap=1e-8, tolerance=1e-12)
    assert result.status in (Status.SOLVED, Status.INACCURATE)
    error = abs(result.contacts["plate"].normal_force / BONDED[cells, grading] - 1.0)
    assert error < max(100.0 * result.certificate.accuracy, 1e-9)


@pytest.mark.parametrize("ended", [Status.SOLVED, Status.STALLED])
def test_what_is_left_too_early_is_not_called_inaccurate(ended):
    """Whatever a method says of its end: what is accepted as inaccurate has an accuracy of 1e-4 or better."""
    known = condensed(1.0, 8, 0.6).solution
    for off in (1e-7, 1e-2):
        z = (1.0 - off) * known.z
        left = Outcome(
            ended,
            z,
            known.normal_multiplier,
            known.tangential_multiplier,
            known.equality_multiplier,
            known.threshold,
            [],
            1,
        )
        found = finish(known.problem, left, "condensed", "", 1e-12)
        assert (found.certificate.accuracy > LOOSEST) == (off == 1e-2)
        assert found.status is (Status.STALLED if off == 1e-2 else Status.INACCURATE)


@pytest.mark.parametrize(("cells", "grading"), [(19, 0.6), (24, 0.6), (32, 0.65)])
def test_bonded_solution_of_the_algebraic_problem(cells, grading):
    """What the fixed point and scales of every kind start from: by the root of K where K is lost."""
    discretization = discretize(compressed_plate(0.2, (cells, cells), grading=grading))
    qvi = discretization.qvi
    assert qvi.bonded_error < 1e-6
    assert qvi.factorisation.startswith(ORTHOGONAL)
    force = -discretization.scales.stress * qvi.resultant(qvi.bonded)  # the plate is 1 wide
    assert force == pytest.approx(BONDED[cells, grading], rel=1e-6)
