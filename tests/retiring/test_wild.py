"""Wild problems: the same every time, a sample of them, and a judge that sees what is wrong."""

from dataclasses import replace

import numpy as np
import pytest

from comparisons.wild.generator import wild_problem
from comparisons.wild.judge import compare, floor, wrong
from qvi_contact import Contact, ContactProblem, Material, RectilinearMesh, Symmetry, Traction, solve
from qvi_contact.solution.result import ContactResult
from solvers.pivoting.opinion import another_solution

pytestmark = pytest.mark.usefixtures("bogner_fox_schmit")  # the study of that element


def test_two_certified_answers_of_a_generated_body_are_said():
    """The condensed method and pivoting end apart; unasked that is looked for where the contact is smaller."""
    solution = solve(wild_problem("thin", 23).problem).solution
    assert "several solutions" in another_solution(solution.problem, solution, 1e-8)


def pressed(friction=0.3, **changes):
    """A block pressed and dragged on its bottom."""
    mesh = RectilinearMesh(np.linspace(0.0, 2.0, 5), np.linspace(0.0, 1.0, 4))
    given = {"top": (2.0, -10.0), "left": (0.0, 0.0), **changes}
    tractions = [Traction(side, *values) for side, values in given.items()]
    return ContactProblem(mesh, Material(1e3, 0.3), [Contact("bottom", friction), *tractions, Symmetry("right")])


@pytest.fixture(scope="module")
def right():
    return solve(pressed())


def forged(result, problem=None, **changes):
    """The result with another solution, or that of another problem."""
    known = result.discretization if problem is None else replace(result.discretization, problem=problem)
    return ContactResult(known, replace(result.solution, **changes))


class TestJudge:
    """Each check fails where it ought to."""

    def test_a_right_answer_has_no_error(self, right):
        assert wrong(right) == []

    def test_another_load_is_seen(self, right):
        assert any("prescribed" in text for text in wrong(forged(right, pressed(top=(2.0, -11.0)))))

    def test_less_friction_is_seen(self, right):
        assert any(text.startswith("friction on bottom") for text in wrong(forged(right, pressed(0.01))))

    def test_a_body_force_that_is_not_there_is_seen(self, right):
        heavy = replace(pressed(), body_potential=lambda _, y: 3.0 * y)
        result = ContactResult(replace(right.discretization, problem=heavy), right.solution)
        assert not wrong(solve(heavy))
        assert wrong(result)

    def test_a_fluid_that_is_not_there_is_seen(self):
        """Friction holds what the sides press on each other, which is less than the whole pressure."""
        wet = replace(pressed(), conditions=[Contact("bottom", 0.3, pore_pressure=8.0), *pressed().conditions[1:]])
        result = solve(wet)
        assert wrong(result) == []
        less = replace(wet, conditions=[Contact("bottom", 0.3, pore_pressure=9.5), *wet.conditions[1:]])
        assert any("on bottom" in text for text in wrong(forged(result, less)))
        dry = solve(pressed())
        assert any("on bottom" in text for text in wrong(forged(dry, wet)))

    def test_a_pressure_strains_no_incompressible_body(self):
        """The size of stresses that are as good as none stays finite."""
        rubber = replace(pressed(), material=Material(1e3, 0.5, "strain"))
        assert np.isfinite(floor(rubber))
        assert wrong(solve(rubber)) == []

    def test_tension_is_seen(self):
        result = solve(pressed(top=(0.0, -10.0)))
        assert any("tension" in text for text in wrong(forged(result, z=-3.0 * result.solution.z)))

    def test_more_energy_than_needed_is_seen(self, right):
        """The state of another friction bound obeys the law of a larger one, and is not the least."""
        slipping = solve(pressed(0.21, top=(2.0, -10.0)))
        difference = compare(forged(slipping, pressed(0.9)), solve(pressed(0.9)))
        assert difference.differs
        assert not compare(right, solve(right.discretization, method="fixed-point")).differs
