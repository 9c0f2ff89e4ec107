"""Convergence: the outer loop and Uzawa's iteration where theory is exact, costs of meshes."""

import numpy as np
import pytest
from pandas import DataFrame

from comparisons.convergence import bodies, mesh
from comparisons.convergence import outer as loops
from comparisons.convergence import uzawa as steps
from solvers import solve_qvi
from tests.comparisons.conftest import committed


def plain(qvi):
    return solve_qvi(qvi, **loops.LOOPS["plain"])


class TestProblems:
    """What is said of the problems without a mesh is so."""

    def test_the_state_the_loads_were_made_for_is_found(self):
        solution = solve_qvi(bodies.contacts(0.7), method="condensed")
        pressure = 1.0 + 0.3 * np.cos(np.arange(bodies.POINTS))
        assert solution.solved
        assert solution.z == pytest.approx(np.concatenate([pressure, 0.7 * pressure]), abs=1e-8)

    @pytest.mark.parametrize("loop", ["plain", "damped 0.5", "damped 0.25"])
    @pytest.mark.parametrize("friction", [0.5, 1.1])
    def test_observed_contraction_is_the_exact_one(self, loop, friction):
        found = solve_qvi(bodies.contacts(friction), **loops.LOOPS[loop])
        damping = loops.LOOPS[loop]["damping"]
        exact = np.abs(1.0 - damping - damping * friction * bodies.COUPLINGS).max()
        assert found.solved
        # the other modes have not died out where they are almost as slow, and then make the loop look faster
        assert found.contraction == pytest.approx(exact, rel=2e-3 if loop == "plain" else 0.12)
        assert found.contraction <= exact * (1.0 + 1e-3)

    def test_plain_fails_just_beyond_its_limit(self):
        below, above = (plain(bodies.contacts(mu)) for mu in (1.1, 1.5))
        assert below.solved
        assert above.status == "cycling"

    def test_dragged_block_carries_what_is_claimed(self):
        assert solve_qvi(bodies.body("block", 2, 0.15).qvi).solved
        assert solve_qvi(bodies.body("block", 2, 0.09).qvi).status == "infeasible"


class TestSteps:
    """The observed limits of the steps of Uzawa's iteration are those of theory where theory is exact."""

    def test_the_limit_is_two_over_the_largest_eigenvalue(self):
        """By the matrix of the dual operator, taken from the definition."""
        known = bodies.reference("plate", 4, 0.1)
        qvi, (tangential, normal, condition) = known.body.qvi, steps.limits_of(known)
        B = qvi.contact_rows.toarray()
        weights = np.sqrt(np.concatenate([qvi.W, qvi.W]))
        C = weights[:, None] * (B @ np.linalg.solve(qvi.K.toarray(), B.T)) * weights
        root = 1.0 / np.sqrt(qvi.threshold(qvi.pressure(known.solution.z)))
        largest = np.linalg.eigvalsh(root[:, None] * C[qvi.m :, qvi.m :] * root)[-1]
        assert tangential == pytest.approx(2.0 / largest, rel=1e-8)
        assert normal == pytest.approx(2.0 / np.linalg.eigvalsh(C[: qvi.m, : qvi.m])[-1], rel=1e-8)
        assert condition > 10.0

    def test_steps_too_long_never_settle_and_too_short_ones_are_still_and_not_there(self):
        long, short = (
            steps.run({"run": "step", "place": ("plate", 2, 0.1), "share": share, "target": None})
            for share in (1.5, 0.01)
        )
        assert not long["settles"]
        assert not short["settles"]
        assert long["last_error"] < steps.NEAR < short["last_error"]  # the force alone would not show it
        assert long["last_change"] > 10.0 * steps.STILL > steps.STILL > short["last_change"]
        assert not long["certificate"]["passed"]

    def test_what_rounding_leaves_of_a_pressure_is_no_bound(self):
        """Of an open point the limit would be that of a bound of 1e-16: no step at all."""
        assert steps.limits_of(bodies.reference("ssnv128", 4, 1.0))[0] > 1e-3

    def test_first_lasting(self):
        numbers = range(1, 11)
        assert steps.first_lasting([1, 1e-3, 1, 1e-3, *[1e-4] * 6], numbers, 1e-3) == 4
        assert steps.first_lasting([0.0] * 10, numbers, 1e-3) == 1
        assert steps.first_lasting([*[1.0] * 8, 0.0, 0.0], numbers, 1e-3) is None
        assert steps.first_lasting([*[0.0] * 9, float("nan")], numbers, 1e-3) is None
        assert steps.first_lasting([1.0, 1.0, 0.0, 0.0], [1, 2, 100, 1000], 0.5) == 100


def test_costs_are_those_of_lasting_errors():
    def cost(errors, target):
        points = DataFrame({"unknowns": 64.0 * 4.0 ** np.arange(len(errors)), "error": np.array(errors, dtype=float)})
        return mesh.cost(points, target)

    found = [1e-2, 1e-5, 1e-3, 1e-4]
    assert (cost(found, 1e-3), cost(found, 1e-4)) == (256, 4096)
    assert cost([1e-3, 1e-6, 1e-4, 1e-5], 2e-5) == 4096  # what is small by chance does not count
    assert cost(found, 1e-5) == np.inf
    assert np.isnan(cost([], 1.0))


def test_graded_and_adaptive_meshes_tend_to_the_reference_of_each_problem():
    found = mesh.meshes_of(committed("convergence-mesh"))
    finest = found[found.solved].groupby(["sequence", "problem"]).error.last()
    assert finest[[mesh.GRADED, mesh.ADAPTIVE]].max() < 3e-6
