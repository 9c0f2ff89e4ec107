"""Generated problems: wild ones, the same every time, and a sample of them; limits and bounds beside proofs."""

from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest

from comparisons.bounds import study as bounds
from comparisons.wild import generator, judge, limits
from comparisons.wild import study as wild
from qvi_contact import ContactResult, InputError, TriangleMesh, discretize, limit_load_factor, solve
from qvi_contact.gallery import compressed_plate
from qvi_contact.limit import limit_proof
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, Symmetry, Traction
from tests.cases import EFFORT, examples
from tests.comparisons.conftest import committed, rows_of

STRENUOUS = {
    "thin": (3,), "gaps": (1, 4), "units": (4, 5), "friction": (2,), "everything": (1, 2), "incompressible": (0, 1),
    "poisson": (4,), "arcs": (1, 2), "bodies": (0, 2), "plates": (0, 2), "idle": (0,),
}  # fmt: skip
"""Problems of the sample that take half a second and more each: the study has them, and a suite of more effort."""

WANTED = {"idle": (wild.SOLVED, wild.REFUSED)}
"""What becomes of the problems of a family; of all others see the test of the sample."""

SAMPLE = [
    (family, number)
    for family in generator.FAMILIES
    for number in [n for n in range(examples(2)) if EFFORT > 1.0 or n not in STRENUOUS.get(family, ())][: examples(1)]
]


def described(family, number):
    """What a problem is made of, as text; functions by their name."""
    try:
        problem = generator.wild_problem(family, number).problem
    except InputError as error:
        return str(error)
    values = [repr(condition).split(" at 0x")[0] for condition in problem.conditions]
    return repr((problem.mesh.vertices.tolist(), problem.mesh.cells.tolist(), values))


class TestGenerator:
    """Problems."""

    @pytest.mark.parametrize("family", generator.FAMILIES)
    def test_makes_the_same_problem_again_and_others_of_other_numbers(self, family):
        first = [described(family, number) for number in range(3)]
        assert first[0] == described(family, 0)
        assert len(set(first)) == 3

    def test_dice_do_not_depend_on_versions(self):
        dice = generator.Dice("thin", 3)
        assert [dice.whole(0, 999) for _ in range(4)] == [74, 198, 372, 275]


def test_sides_of_polygons_that_move_press_on_the_obstacle_and_bent_gaps_are_parabolas_along_the_side():
    """Of those whose errors bounds are compared with; such gaps are multiples of (a x + b y + c)²."""
    problems = [bounds.stated("polygons", number)[0] for number in range(40)]
    for problem in problems:
        normal = problem.mesh.edges("side 0").normal[0]
        moves = [each for each in problem.conditions if isinstance(each, Displacement)]
        assert all(move.x * normal[0] + move.y * normal[1] > 0.0 for move in moves)
    gaps = [each.gap for problem in problems for each in problem.contacts]
    bent = [gap for gap in gaps if callable(gap) and len(gap.coefficients) == 3]
    assert len(bent) > 3
    for gap in bent:
        (c, y, yy), (x, xy), (xx,) = gap.coefficients
        assert [x * x, y * y, xy * xy] == pytest.approx([4.0 * xx * c, 4.0 * yy * c, 4.0 * xx * yy], rel=1e-9)


@pytest.mark.parametrize(("number", "width"), [(7, 0.11), (136, 0.55)])  # over the force
def test_force_bounds_are_narrow_where_some_tractions_are_little_and_others_very_little(number, width):
    problem, degree = bounds.stated("polygons", number)
    lower, upper = solve(problem, degree=degree).bracket.forces["contact.normal_force"]
    assert upper - lower < width * (lower + upper) / 2.0


@pytest.mark.parametrize(("family", "number"), SAMPLE)
def test_ends_in_an_answer_that_is_true_or_in_one_of_our_own_words(family, number):
    found = wild.solve_case({"family": family, "number": number})
    assert found["outcome"] in WANTED.get(family, (wild.SOLVED, wild.INFEASIBLE, wild.OPEN, wild.REFUSED)), found


def pressed(friction=0.3, **changes):
    """A block pressed and dragged on its bottom."""
    given = {"top": (2.0, -10.0), "left": (0.0, 0.0), **changes}
    tractions = [Traction(side, *values) for side, values in given.items()]
    mesh = TriangleMesh.rectangle((4, 3), 2.0, 1.0)
    return ContactProblem(mesh, Material(1e3, 0.3), [Contact("bottom", friction), *tractions, Symmetry("right")])


def forged(result, problem=None, **changes):
    """The result with another solution, or that of another problem."""
    known = result.discretization if problem is None else replace(result.discretization, problem=problem)
    return ContactResult(known, replace(result.solution, **changes))


@pytest.fixture(scope="module")
def right():
    return solve(pressed())


class TestJudge:
    """Each check fails where it ought to."""

    def test_a_right_answer_has_no_error(self, right):
        assert judge.wrong(right) == []
        assert judge.wrong(solve(pressed(), degree=6, law_on="points"), 6) == []

    def test_another_load_less_friction_and_a_body_force_that_is_not_there_are_seen(self, right):
        assert any("prescribed" in text for text in judge.wrong(forged(right, pressed(top=(2.0, -11.0)))))
        assert any(text.startswith("friction on bottom") for text in judge.wrong(forged(right, pressed(0.01))))
        heavy = replace(pressed(), body_potential=lambda _, y: 3.0 * y)
        assert not judge.wrong(solve(heavy))
        assert judge.wrong(ContactResult(replace(right.discretization, problem=heavy), right.solution))

    def test_tension_is_seen(self):
        result = solve(pressed(top=(0.0, -10.0)))
        assert any("tension" in text for text in judge.wrong(forged(result, z=-3.0 * result.solution.z)))

    def test_more_energy_than_needed_is_seen(self, right):
        """The state of another friction bound obeys the law of a larger one, and is not the least."""
        slipping = solve(pressed(0.21, top=(2.0, -10.0)))
        assert judge.compare(forged(slipping, pressed(0.9)), solve(pressed(0.9))).differs
        assert not judge.compare(right, solve(right.discretization, method="fixed-point")).differs

    def test_less_energy_by_breaking_the_law_is_not_less(self, right):
        """The bonded state has the least energy of all, and more shear than friction carries."""
        assert not judge.compare(right, forged(right, z=right.solution.problem.bonded)).differs

    @pytest.mark.parametrize("family", ["arcs", "bodies"])
    def test_answers_on_arcs_are_right(self, family):
        assert judge.wrong(solve(generator.wild_problem(family, 0).problem)) == []


def test_states_gone_through_of_a_plate_and_of_a_block_dragged_beyond_its_limit():
    assert judge.enumerated(discretize(compressed_plate(0.2, (2, 1))).qvi, 20.0) == judge.EXISTS
    mesh = TriangleMesh.rectangle((2, 1), 2.0, 1.0)
    free = [Traction(side, 0.0, 0.0) for side in ("left", "right")]
    dragged = ContactProblem(mesh, Material(1e3, 0.3), [Contact("bottom", 0.1), Traction("top", 2.0, -10.0), *free])
    assert judge.enumerated(discretize(dragged).qvi, 20.0) == judge.NONE


def test_problems_of_a_small_study_are_counted():
    """From a number on."""
    problems = wild.problems_of(rows_of(wild.declared(["thin", "files"], 1, 7)))
    assert list(zip(problems.family, problems.number, strict=True)) == [("thin", 7), ("files", 7)]
    assert sum(wild.values_of(problems)[name] for name in wild.ORDER) == 2


@pytest.fixture(scope="module")
def rows():
    """The committed rows."""
    return committed("wild")


def test_numbers_of_the_committed_run_are_those_of_its_rows(rows):
    values = wild.values_of(wild.problems_of(rows))
    outcomes = [row.result.get("outcome") for row in rows]  # none of what ran out of time
    assert (values["problems"], values["solved"], values["wrong"]) == (len(rows), outcomes.count("solved"), 0)
    open_ones = [row.result for row in rows if row.result.get("outcome") == "open"]
    assert values["missed"] == sum(each.get("exists") == judge.EXISTS for each in open_ones)
    assert values["solvable"] == values["solved"] + values["missed"]
    assert values["admissible"] == values["solved"] + sum(bool(each.get("admissible")) for each in open_ones)


def test_what_must_not_happen_is_in_the_numbers_and_in_the_table(rows):
    one = next(row for row in rows if row.result.get("outcome") == "solved")
    wrong = replace(one, result={**one.result, "outcome": "wrong", "errors": ["tension"]})
    dead = replace(one, status="timeout", reason="more than 120 s", result={}, seconds=120.0)
    problems = wild.problems_of([one, wrong, dead])
    values = wild.values_of(problems)
    assert (values["solved"], values["wrong"], values["broken"], values["slow"]) == (1, 1, 1, 1)
    assert problems.trouble.sum() == 2
    made = wild.report([one, wrong, dead])
    assert made.failed
    assert "tension" in made.text
    assert not wild.report([one]).failed


def test_an_exception_that_is_not_the_packages_own_is_foreign():
    assert wild.solve_case({"family": {}, "number": 0})["outcome"] == wild.FOREIGN


class TestLimits:
    """Both sides of limit loads, and their proofs."""

    def test_sides_and_proofs_are_in_order(self):
        for number in (12, 93, 118, 153):  # parts without tension beside a side that leans, and between two
            found = limits.solve_case({"number": number})
            assert found["proved_lower"] <= found["lower"] <= found["upper"] <= found["proved_upper"] * (1.0 + 1e-5)
            assert found["proved_upper"] - found["proved_lower"] < 1.001 * found["upper"] - found["lower"]
        problem, load, _ = limits.stated(93)  # a side is as straight in proofs if it has two names
        ends, conditions = problem.mesh.edge_sets["right"], [*problem.conditions, Traction("rest", 0.0, 0.0)]
        mesh = replace(problem.mesh, edge_sets={**problem.mesh.edge_sets, "right": ends[:1], "rest": ends[1:]})
        split = replace(problem, mesh=mesh, conditions=conditions)
        files = [limit_proof(each, [load], degree=3) for each in (split, problem)]
        assert files[0]["vertices"] == files[1]["vertices"]

    def test_beside_a_load_beyond_its_own_limit_no_multiple_is_carried(self):
        problem, load, _ = limits.stated(84)

        def limit(push, top, name):
            factors = [push if each.name == load else top for each in problem.conditions]
            loads = [replace(each, x=f * each.x, y=f * each.y) if isinstance(each, Traction) else each
                     for each, f in zip(problem.conditions, factors, strict=True)]  # fmt: skip
            return limit_load_factor(replace(problem, conditions=loads), [name], degree=3)

        found = limit(1.0, 1.001 * limit(0.0, 1.0, "top").upper, load)
        assert (found.lower, found.upper) == (-np.inf, -np.inf)
        for number, exact in ((189, -np.inf), (91, -np.inf), (197, 4.949872)):  # directions, faces, limits by rounding
            problem, load, degree = limits.stated(number)
            found = limit_load_factor(problem, [load], degree=degree)
            assert (found.lower, found.upper) == pytest.approx((exact, exact), rel=1e-6)

    def test_the_committed_rows(self):
        runs = committed("limits")
        values = limits.values_of(limits.runs_of(runs))
        assert values["runs"] == values["solved"] == values["held"] >= 60
        assert values["wrong"] == 0
        assert min(values["below"] / values["finite"], values["above"] / values["bounded"]) > 0.8
        first = next(each for each in runs if isinstance(each.result.get("proved_upper"), float))
        worse = replace(first, result={**first.result, "lower": 2.0 * first.result["upper"] + 1.0})
        values = limits.values_of(limits.runs_of([worse if each is first else each for each in runs]))
        assert values["held"] == values["runs"] - 1


class TestBounds:
    """Bounds of the package beside displacements by NGSolve."""

    @pytest.mark.skipif(find_spec("ngsolve") is None, reason="NGSolve is not installed")
    def test_a_reference_is_inside(self):
        cases = [{"family": "springs", "number": 0}]
        runs = bounds.runs_of(rows_of(replace(bounds.declared(1), cases=cases)))
        assert runs.judged.all()
        assert runs.inside.all()
        assert (runs.ratio < 1.3).all()

    def test_the_committed_rows(self):
        rows = committed("bounds")
        assert [dict(row.case) for row in rows] == [*bounds.declared(len(rows) // 6).cases]
        runs = bounds.runs_of(rows)
        values = bounds.values_of(runs, bounds.forces_of(runs))
        assert values["outside"] == values["forces_outside"] == 0
        assert values["together"] < 1.5  # without the problem whose bound is rounding
        assert values["judged"] > 0.7 * len(rows)

    def test_a_bound_that_is_too_small_is_found(self):
        row = next(each for each in committed("bounds") if each.result["status"] == "bounded" and each.result["forces"])
        for name, error in (("bound", "stress"), ("moved", "displacement")):
            worse = replace(row, result={**row.result, name: 0.8 * row.result[error]})
            assert bounds.runs_of([worse]).outside.all()
        name, lower, upper, _, doubt = row.result["forces"][0]
        worse = replace(row, result={**row.result, "forces": [[name, lower, upper, 2.0 * upper - lower, doubt]]})
        assert bounds.report([worse], committed("bounds-refined")).failed

    def test_polygons_that_slip(self):
        """Nine of ten have a bound, and nearly all of these a force to 1 %, in a time that depends on the machine."""
        rows = committed("bounds-refined")
        found = bounds.polygons_of(rows)
        assert found["slipping"] >= 300
        assert found["slipping_bounded"] > 0.9 * found["slipping"]
        assert found["refined"] > 0.99 * found["slipping_bounded"]
        slipping = next(row for row in rows if row.result["status"] == "slips" and row.result["guaranteed"])
        again = bounds.refine_case(slipping.case)
        assert (again["guaranteed"], again["error"] <= bounds.TARGET) == (True, True)
        assert bounds.refine_case({"number": 237})["refined"] == "no_guarantee"  # not only at the limit of unknowns
