"""Wild problems: the same every time, a sample of them, and a judge that sees what is wrong."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from comparisons.cli import group
from comparisons.lab.study import pool, read_csv, read_study
from comparisons.wild import study
from comparisons.wild.dice import Dice
from comparisons.wild.enumeration import EXISTS, NONE, enumerated
from comparisons.wild.generator import FAMILIES, wild_problem
from comparisons.wild.judge import compare, floor, wrong
from comparisons.wild.measures import ORDER, counts_of, problems_of, values_of
from comparisons.wild.report import report
from comparisons.wild.study import ACCEPTED, FOREIGN, INFEASIBLE, OPEN, REFUSED, SOLVED, declared, solve_case
from qvi_contact import Contact, ContactProblem, InputError, Material, RectilinearMesh, Symmetry, Traction, solve
from qvi_contact.basics import terminal
from qvi_contact.discretization.discretization import discretize
from qvi_contact.gallery import compressed_plate
from qvi_contact.solution.result import ContactResult
from solvers import Status
from solvers.pivoting.opinion import another_solution
from tests.comparisons.study_here import Here
from tests.effort import EFFORT, examples

pytestmark = pytest.mark.usefixtures("bogner_fox_schmit")  # the study of that element

STRENUOUS = {
    "thin": (3,), "gaps": (1, 4), "units": (4, 5), "friction": (2,), "everything": (2,), "incompressible": (0,),
    "poisson": (4,),
}  # fmt: skip
"""Problems of the sample that take half a second and more each: the study has them, and a suite of more effort."""

WANTED = {"nonsense": (REFUSED,), "idle": (SOLVED, REFUSED)}
"""What becomes of the problems of a family; of all others see `TestSample`."""

COMMITTED = Path(study.__file__).parents[1] / "reports" / "wild"

SAMPLE = [
    *(
        (family, number)
        for family in FAMILIES
        for number in range(examples(3))
        if EFFORT > 1.0 or number not in STRENUOUS.get(family, ())
    ),
    ("idle", 10),  # whose second method does not end
]


def described(family, number):
    """What a problem is made of, as text; functions by their name."""
    try:
        problem = wild_problem(family, number).problem
    except InputError as error:
        return str(error)
    values = [repr(condition).split(" at 0x")[0] for condition in problem.conditions]
    return repr((problem.mesh.x.tolist(), problem.mesh.y.tolist(), problem.mesh.active.tolist(), values))


class TestGenerator:
    """Problems."""

    @pytest.mark.parametrize("family", [name for name in FAMILIES if name != "nonsense"])
    def test_makes_the_same_problem_again_and_others_of_other_numbers(self, family):
        first = [described(family, number) for number in range(4)]
        assert first[:2] == [described(family, number) for number in range(2)]
        assert len(set(first)) == 4

    def test_dice_do_not_depend_on_versions(self):
        dice = Dice("thin", 3)
        assert [dice.whole(0, 999) for _ in range(4)] == [74, 198, 372, 275]

    def test_families_are_as_wild_as_they_say(self):
        numbers = {"thin": 36, "units": 12, "friction": 10, "idle": 30}
        problems = {family: made(family, range(each)) for family, each in numbers.items()}
        aspects = [np.ptp(each.mesh.y) / np.ptp(each.mesh.x) for each in problems["thin"]]
        assert min(aspects) < 3e-3
        assert max(aspects) > 300.0
        lengths = [each.mesh.length for each in problems["units"]]
        assert min(lengths) < 1e-7
        assert max(lengths) > 1e10
        frictions = [c.friction for each in problems["friction"] for c in each.contacts if not callable(c.friction)]
        assert min(frictions) == 0.0
        assert max(frictions) == 1e3
        assert any(callable(c.pore_pressure) for each in made("fluids", range(20)) for c in each.contacts)
        assert all(m.incompressible for each in made("incompressible", range(20)) for m in each.materials)
        assert not any(c.x or c.y for each in problems["idle"] for c in each.conditions if isinstance(c, Traction))


def made(family, numbers):
    """The problems that are not refused."""
    found = []
    for number in numbers:
        try:
            found.append(wild_problem(family, number).problem)
        except InputError:
            continue
    return found


class TestSample:
    """Outcomes."""

    @pytest.mark.parametrize(("family", "number"), SAMPLE)
    def test_ends_in_an_answer_that_is_true_or_in_one_of_our_own_words(self, family, number, monkeypatch):
        monkeypatch.setattr(study, "_solvable", lambda _: {})
        found = solve_case({"family": family, "number": number})
        assert found["outcome"] in WANTED.get(family, (SOLVED, INFEASIBLE, OPEN, REFUSED)), found
        assert found["warnings"] == []


def test_two_certified_answers_of_a_generated_body_are_said():
    """The condensed method and pivoting end apart; unasked that is looked for where the contact is smaller."""
    solution = solve(wild_problem("thin", 23).problem).solution
    assert "several solutions" in another_solution(solution.problem, solution, 1e-8)


def test_a_factorisation_that_fails_is_a_status():
    """Cells 40000 times as long as high are beyond double precision; which method sees that first is rounding."""
    assert solve(wild_problem("joints", 11).problem).status in (Status.ILL_CONDITIONED, Status.STALLED)


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


@pytest.mark.parametrize("number", [4, 29, 36, 46, 50, 54, 64, 75, 76, 109, 151, 190, 216, 385, 913])
def test_arrays_and_complex_values_where_a_name_or_number_belongs_are_refused(number):
    """Arrays as meshes, names of edges, sides, contacts and planes, ragged masks, complex offsets, lists as damping."""
    assert solve_case({"family": "nonsense", "number": number})["outcome"] == REFUSED


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

    def test_a_pressure_that_jumps_is_taken_by_its_force_and_moment_and_said(self, monkeypatch):
        def given(pressure):
            return replace(pressed(), conditions=[Contact("bottom", 0.3, pore_pressure=pressure), *right[1:]])

        right = pressed().conditions
        result = solve(given(lambda x, _: np.where(x < 0.7, 4.0, 1.0)), element="bfs")
        assert wrong(result) == []
        moved = forged(result, given(lambda x, _: np.where(x < 0.71, 4.0, 1.0)))
        assert any(text.startswith("pore pressure on bottom:") for text in wrong(moved))
        alike = solve(given(lambda x, _: 2.0 + 0.5 * x), element="bfs")
        assert wrong(alike) == []
        assert "pore pressure" not in " ".join(alike.remarks)
        monkeypatch.setattr(ContactResult, "remarks", ())
        assert [text.split(":")[0] for text in wrong(result)] == ["pore pressure on bottom, not said"]

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


class TestEnumeration:
    """States gone through."""

    def test_of_a_plate(self):
        assert enumerated(discretize(compressed_plate(0.2, (2, 1))).qvi, 20.0) == EXISTS

    def test_of_a_block_dragged_beyond_its_limit(self):
        free = [Traction(side, 0.0, 0.0) for side in ("left", "right")]
        mesh = pressed().mesh
        dragged = ContactProblem(mesh, Material(1e3, 0.3), [Contact("bottom", 0.1), Traction("top", 2.0, -10.0), *free])
        assert enumerated(discretize(dragged).qvi, 20.0) == NONE


def test_command_writes_report_and_rows(tmp_path, capfd):
    out, store = tmp_path / "out", tmp_path / "few.sqlite"
    words = ["wild", "--each", "1", "--only", "thin", "nonsense", "--store", str(store), "--out", str(out)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["comparisons", *words])
        patch.setattr(pool, "Crew", Here)
        with pytest.raises(SystemExit) as caught:
            terminal.run(group, "comparisons")
    assert caught.value.code == 0, capfd.readouterr().err
    rows = read_study(store).rows
    problems = problems_of(rows)
    assert list(zip(problems.family, problems.number, strict=True)) == [("thin", 0), ("nonsense", 0)]
    assert sum(counts_of(problems).values()) == 2
    assert tuple(counts_of(problems)) == ORDER
    assert sorted(path.name for path in out.iterdir()) == ["wild.csv.gz", "wild.html", "wild.md"]
    assert read_csv(out / "wild.csv.gz") == rows


@pytest.mark.parametrize("words", [["wild", "--each"], ["scaling", "--processes"], ["systems", "--repeat"]])
def test_counts_have_an_end(words, capfd):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["comparisons", *words, "9" * 26])
        with pytest.raises(SystemExit) as caught:
            terminal.run(group, "comparisons")
    err = capfd.readouterr().err.splitlines()
    assert (caught.value.code, len(err)) == (2, 1)
    assert words[1] in err[0]


@pytest.fixture(scope="module")
def rows():
    """The committed rows."""
    return read_csv(COMMITTED / "wild.csv.gz")


class TestCommitted:
    """What the report says of the committed rows."""

    def test_numbers_of_the_findings(self, rows):
        values = values_of(problems_of(rows))
        expected = {
            "problems": 3500, "solved": 2241, "wrong": 0, "accepted": 0, "foreign": 0, "broken": 0, "slow": 0,
            "solvable": 2247, "missed": 6, "admissible": 2393, "stuck": 152, "hopeless": 58, "unknown": 100,
        }  # fmt: skip
        assert {name: values[name] for name in expected} == expected

    def test_the_committed_report_is_that_of_the_committed_rows_in_any_order(self, rows):
        assert report(rows[::-1]).text == (COMMITTED / "wild.md").read_text(encoding="utf-8")

    def test_what_must_not_happen_is_in_the_numbers_and_in_the_table(self, rows):
        one = next(row for row in rows if row.result["outcome"] == "solved")
        wrong = replace(one, result={**one.result, "outcome": "wrong", "errors": ["tension"]})
        dead = replace(one, status="timeout", reason="more than 120 s", result={}, seconds=120.0)
        problems = problems_of([one, wrong, dead])
        values = values_of(problems)
        assert (values["solved"], values["wrong"], values["broken"], values["slow"]) == (1, 1, 1, 1)
        assert problems.trouble.sum() == 2
        assert "tension" in report([one, wrong, dead]).text


def test_unknown_family_is_refused():
    with pytest.raises(InputError, match="choose among thin"):
        declared(["thick"], 1)


def test_outcomes_of_failures(monkeypatch):
    def broken(*_):
        raise ZeroDivisionError("by zero")

    monkeypatch.setattr(study, "wild_problem", broken)
    assert solve_case({"family": "thin", "number": 0})["outcome"] == FOREIGN
    monkeypatch.setattr(study, "wild_problem", lambda *_: study.Wild(pressed(), {}, "gap = nonsense"))
    assert solve_case({"family": "nonsense", "number": 0})["outcome"] == ACCEPTED
