"""What is said of displacement codes beside this package: costs of an error, bounds, references, pictures."""

import json

import pytest

from comparisons import LIMITS, SETTLED, UNCERTAINTY
from comparisons import peers as room
from comparisons.lab import grid_of
from comparisons.lab.report import NOTHING
from comparisons.lab.study import Row, finite_json, read_csv
from comparisons.peers import runs_of
from qvi_contact.bracket import BracketKind
from tests.comparisons.conftest import texts_of
from tests.comparisons.convergence_parts import REPORTS, report_of

LIMIT = {friction: value for friction, (value, _) in LIMITS.items()}
FLOOR = LIMITS[0.2][1] / LIMIT[0.2]


def row(model, number, friction=0.2, status="done", reason="", result=None):
    """A row of the study, made up."""
    case = {"friction": friction, "model": model, "number": number, "repetitions": 1, "repeat": 0, "seed": 0}
    environment = {"machine": None, "versions": {}, "threads": 1, "timeout_seconds": None, "memory_mib": None}
    return Row(0, "", case, status, reason, result or {}, None, 1.0, "", None, environment)


def solution(model, number, half_force, seconds, friction=0.2, **more):
    """A row with a solution, made up; unknowns are the square of the mesh's number."""
    costs = {"unknowns": number**2, "setup": [0.0], "solve": [seconds], "before": 2**26, "peak": 2**27}
    answer = {"status": "solved", "message": "", "half_force": half_force, "residual": 1e-9, "iterations": 1}
    return row(model, number, friction, result={**answer, **costs, **more})


def bracketed(lower, upper, friction=1.0, guaranteed=True, cells=8):
    """A row with a bracket, made up."""
    kind = BracketKind.PROBLEM if guaranteed else BracketKind.GIVEN_BOUND
    bounds = {"lower": lower, "upper": upper}  # numbers that are no bounds must not be taken for such
    more = {"width": (upper - lower) / (upper + lower), "strain_error": 0.01, "guaranteed": guaranteed}
    return solution("bracket, p = 3, graded", cells, None, 0.1, friction, kind=kind.name, **bounds, **more)


def costs(*rows):
    return room.costs_of(runs_of(rows))


def told(*rows):
    """The numbers of the findings."""
    runs = runs_of(rows)
    return room.values_of(runs, room.costs_of(runs))


def tabled(name, *rows, columns):
    """These columns of a table of the report as texts."""
    runs = runs_of(rows)
    return grid_of(room.tables_of(runs, room.costs_of(runs), room.known_of(runs))[name], columns, room.FORMS).rows


@pytest.mark.usefixtures("outlined")
class TestReach:
    """What an error costs each code."""

    OURS, THEIRS, OTHERS = "triangles, p = 4, bisected", "NGSolve, p = 3, symmetric, bisected", "GetFEM, Q2, uniform"

    def near(self, model, number, error, seconds):
        return solution(model, number, LIMIT[0.2] * (1.0 + error), seconds)

    def test_the_quickest_and_the_smallest_of_each_code(self):
        rows = [self.near(self.OURS, 3, 2e-6, 0.02), self.near(self.OURS, 4, 1e-7, 0.01)]
        rows += [self.near(self.THEIRS, 5, 2e-6, 0.04), self.near(self.OTHERS, 4, 2e-6, 0.05)]
        found = costs(*rows)
        ours = found[found.code == room.TRIANGLES].set_index("target")
        assert ours.loc[3e-6, ["quickest", "smallest"]].tolist() == 2 * [f"{self.OURS}, level 3"]  # it is confirmed
        assert set(ours.index) == set(room.TARGETS[:4])
        compared = room.compared_of(found).set_index("target")
        assert compared.loc[3e-6, ["code", "smallest_code"]].tolist() == ["ngsolve", "getfem"]
        assert compared.time_ratio[3e-6] == pytest.approx(2.0)
        assert compared.unknowns_ratio[3e-6] == pytest.approx(16 / 9)
        assert 1e-7 not in compared.index

    def test_an_error_is_reached_with_the_uncertainty_of_the_reference(self):
        for share, there in ((0.98, True), (1.02, False)):
            found = costs(self.near(self.OTHERS, 8, 1e-8 * share - FLOOR, 0.1))
            assert (1e-8 in set(found.target)) == there

    def test_an_error_that_a_finer_mesh_does_not_confirm_is_chance(self):
        rows = [self.near(self.OTHERS, 4, 1e-7, 0.01), self.near(self.OTHERS, 8, 1e-5, 0.02)]
        first, last = runs_of(rows).itertuples()
        assert first.lasting == last.error == last.lasting > first.error
        assert costs(*rows).target.tolist() == [1e-4, 2e-5]
        assert costs(rows[0], self.near(self.OTHERS, 8, 1e-3, 0.02)).empty

    def test_a_finer_mesh_that_fails_confirms_nothing(self):
        rows = [solution("GetFEM, Q2, graded", 8, 214.23325, 0.01)]
        rows += [row("GetFEM, Q2, graded", 16, status="crashed", reason="signal 11")]
        last = solution("GetFEM, Q2, graded", 32, 214.23325, 5.0)
        assert not costs(*rows).sure.any()
        assert told(*rows)["chance"] == ["GetFEM, Q2, graded, 8² cells"]
        assert costs(*rows, last).sure.all()
        assert told(*rows, last)["chance"] == []

    def test_what_is_confirmed_comes_first(self):
        rows = [solution("GetFEM, Q2, graded", 8, 214.23325, 0.01)]
        rows += [solution("GetFEM, Q2, uniform", cells, 214.23325, 0.05) for cells in (8, 16)]
        assert set(costs(*rows).quickest) == {"GetFEM, Q2, uniform, 8² cells"}


@pytest.mark.usefixtures("outlined")
class TestFindings:
    """The numbers of the sentences."""

    def test_the_narrowest_interval_and_what_is_outside(self):
        rows = [bracketed(214.3676, 214.3677), bracketed(214.36, 214.38)]
        rows += [solution("GetFEM, Q2, uniform", n, force, 0.1, 1.0) for n, force in ((8, 214.36765), (16, 214.3679))]
        rows += [row("GetFEM, Q2, uniform", 32, 1.0, status="crashed", reason="signal 11")]
        (found,) = room.intervals_of(runs_of(rows)).itertuples()
        assert (found.low, found.high) == pytest.approx((214.3676, 214.3677), abs=5e-6)
        assert (found.getfem, found.ngsolve) == ("1 of 2", "0 of 0")
        assert room.intervals_of(runs_of(rows[2:])).empty

    def test_beside_an_interval_stands_the_best_force_of_no_more_unknowns(self):
        rows = [bracketed(214.3, 214.4, cells=7), bracketed(214.367, 214.368)]  # 49 and 64 unknowns
        forces = {4: LIMIT[1.0] + 1e-3, 6: LIMIT[1.0] + 2e-3, 8: LIMIT[1.0] + 5e-4, 16: LIMIT[1.0]}
        rows += [solution("GetFEM, Q2, uniform", n, force, 0.1, 1.0) for n, force in forces.items()]
        found = room.beside_of(runs_of(rows))
        assert found.getfem.tolist() == pytest.approx([forces[4], forces[8]])
        assert found.ngsolve.isna().all()
        wide, narrow = tabled("beside-mu-1", *rows, columns=("ngsolve", "getfem"))
        assert wide == (NOTHING, f"{forces[4]:.7f}")
        assert narrow == (NOTHING, f"{forces[8]:.7f}, outside")

    def test_guaranteed_bounds_are_widened_by_what_the_solves_hold_to(self):
        (found,) = told(bracketed(214.3677, 214.3678), bracketed(214.2, 214.4))["bounds"]
        assert (found["low"], found["high"]) == pytest.approx((214.3676979, 214.3678021), abs=5e-8)

    def test_bounds_that_contradict_each_other_are_not_used(self):
        runs = runs_of([bracketed(214.367650, 214.367655), bracketed(214.367670, 214.367675)])
        assert room.contradictory(runs)
        assert room.reference(runs, 1.0).value == LIMIT[1.0]
        values = room.values_of(runs, room.costs_of(runs))
        assert (values["bounds"], values["doubtful"]) == ([], [{"friction": 1.0, "count": 2}])

    def test_an_indicator_is_no_bound(self):
        rows = [bracketed(214.1, 214.3, 0.2, guaranteed=False), solution("rectangles, graded", 8, 214.2, 0.1)]
        assert told(*rows)["bounds"] == []

    def test_failures_are_counted_and_told(self, without):
        without("matplotlib")
        result = {"status": "not converged", "message": "residual 1e-3", "half_force": 214.2, "residual": float("inf")}
        rows = [row("GetFEM, Q2, strips", n, result=result) for n in (1, 2)]
        rows += [row("GetFEM, Q2, strips", 3, status="crashed", reason="signal 11")]
        rows += [solution("rectangles, graded", 8, 214.2, 0.1)]
        runs, values, lines = runs_of(rows), told(*rows), tabled("failures", *rows, columns=("status", "message"))
        assert (values["runs"], values["solved"], values["failing"]) == (4, 1, "3 of GetFEM")
        assert lines[1:] == [("not converged", "residual 1e-3"), ("crashed", "signal 11")]
        assert runs.error[~runs.solved].isna().all()
        json.dumps(finite_json(room.document_of(rows, report_of("peers", rows))), allow_nan=False)

    def test_without_any_known_value(self):
        made = report_of("peers", [solution("GetFEM, Q2, uniform", 8, 214.4, 0.1, 0.12)])
        assert "No value of P/2 is known" in made.text
        assert made.pictures == {}


class TestReference:
    """What errors are relative to."""

    NONE = runs_of([solution("GetFEM, Q2, uniform", 8, 214.4, 0.1)])

    def test_limits_and_what_codes_settle_on(self):
        assert room.reference(self.NONE, 0.2)[:2] == LIMITS[0.2]
        assert room.reference(self.NONE, 0.4).value == LIMIT[1.0]
        assert room.reference(self.NONE, 0.15)[:2] == (SETTLED[0.15], UNCERTAINTY)
        assert room.reference(self.NONE, 0.12) is None

    def test_limits_are_those_that_codes_settle_on(self):
        assert all(abs(value - SETTLED[friction]) < UNCERTAINTY for friction, value in LIMIT.items())

    def test_guaranteed_bounds_if_nothing_narrower_is_known(self):
        wide, narrow = bracketed(214.3, 214.4, 0.12), bracketed(214.36765, 214.36766, 0.12)
        known = room.reference(runs_of([wide, narrow]), 0.12)
        assert known.value == pytest.approx(214.367655, abs=1e-9)
        assert known.uncertainty == pytest.approx(5e-6 + room.RESOLUTION * known.value)
        assert "guaranteed bounds of bracket, p = 3, graded, 8² cells" in known.source
        assert room.reference(runs_of([bracketed(214.2, 214.21, 0.12, False)]), 0.12) is None
        assert room.reference(runs_of([bracketed(214.36765, 214.36766)]), 1.0).value == LIMIT[1.0]

    @pytest.mark.parametrize("guaranteed", [True, False])
    def test_inverted_bounds_are_a_failure(self, guaranteed):
        rows = [bracketed(214.3678, 214.3677, 1.0, guaranteed), bracketed(214.3, 214.4, 1.0, guaranteed)]
        runs = runs_of(rows)
        inverted, right = runs.itertuples()
        assert (inverted.status, inverted.solved, right.solved) == ("inverted", False, True)
        assert "half width -2.3e-7" in inverted.message
        assert room.reference(runs, 1.0).value == LIMIT[1.0]
        assert told(*rows)["failing"] == "1 of the bracket"
        assert tabled("brackets-mu-1", *rows, columns=("status",))[0] == ("inverted",)

    def test_rounding_inverts_nothing(self):
        runs = runs_of([bracketed(209.0 + 1e-6, 209.0, 0.0)])
        assert runs.solved.all()
        assert room.reference(runs, 0.0).uncertainty > 0.0


def test_errors_below_the_uncertainty_are_shown_as_such():
    here = solution("rectangles, graded", 8, LIMIT[0.2] * (1.0 + 5e-10), 0.1)
    assert tabled("rows-mu-0_2", here, columns=("shown",)) == [
        ("≤ 1.4e-9",)
    ]  # with the uncertainty of the value itself


DRAWN = (
    solution("rectangles, graded", 8, 214.365, 0.1, 1.0),
    solution("GetFEM, Q2, strips", 3, 214.347, 0.1, 1.0),
    row("GetFEM, Q2, graded", 8, 1.0, status="crashed", reason="signal 11"),
    bracketed(214.365, 214.368),
    bracketed(214.1, 214.3, 0.2, guaranteed=False),
    solution("rectangles, graded", 8, 214.2, 0.1),
)


@pytest.fixture(scope="module")
def texts():
    """Name of a picture → its texts."""
    pytest.importorskip("matplotlib")
    runs = runs_of(DRAWN)
    return {name: texts_of(draw()) for name, draw in room.plots_of(runs, room.known_of(runs)).items()}


class TestFigures:
    """What is drawn."""

    BRACKET = "bracket, p = 3, graded"

    def labels(self, texts):
        names = ("rectangles, graded", "GetFEM, Q2, strips", "GetFEM, Q2, graded", f"{self.BRACKET}: guaranteed")
        return [name for name in names if name in texts]

    def test_errors_have_a_curve_for_each_model_that_was_solved(self, texts):
        errors = {
            f"{kind}-{cost.name}-mu-{mu}" for kind in ("best", "error") for cost in room.COSTS for mu in ("1", "0_2")
        }
        assert set(texts) == {"bounds-mu-0_2", "bounds-mu-1", "intervals-mu-1"} | errors
        found = texts["error-time-mu-1"]
        assert self.labels(found) == ["rectangles, graded", "GetFEM, Q2, strips", f"{self.BRACKET}: guaranteed"]
        assert room.COSTS[1].label in found
        assert self.labels(texts["error-unknowns-mu-0_2"]) == ["rectangles, graded"]  # an indicator is no error
        names = [code.name for code in room.CODES.values() if code.name in texts["best-unknowns-mu-1"]]
        assert names == ["this package on rectangles", "GetFEM"]

    def test_bounds_are_bars_and_an_indicator_is_named_so(self, texts):
        assert self.labels(texts["bounds-mu-1"]) == ["rectangles, graded", f"{self.BRACKET}: guaranteed"]
        assert f"{self.BRACKET}: indicator" in texts["bounds-mu-0_2"]
        assert f"{self.BRACKET}: guaranteed" not in texts["bounds-mu-0_2"]

    def test_a_run_is_drawn_at_its_cost_and_error(self):
        runs = runs_of([DRAWN[0], bracketed(214.365, 214.368)])
        assert runs.loc[0, [cost.column for cost in room.COSTS]].tolist() == [64, 0.1]
        expected = [abs(214.365 / LIMIT[1.0] - 1.0), 0.0015 / 214.3665]
        assert room.heights(runs).tolist() == pytest.approx(expected)

    @pytest.mark.parametrize("last", [(213.9, 214.5), (214.36, 214.37)])
    def test_all_bars_and_marks_are_inside_the_picture_of_bounds(self, last):
        runs = runs_of([bracketed(*last), *DRAWN[:3], bracketed(214.365, 214.368)])
        known = room.reference(runs, 1.0)
        bottom, top = room.limits(runs[runs.mesh == "graded"], known)
        ends = [end / known.value - 1.0 for end in (*last, 214.365, 214.368)]
        assert bottom < min(ends) < max(ends) < top
        marks = room.ticks(bottom, top, known.floor)
        assert bottom <= min(marks) < 0.0 < max(marks) <= top


def least(rows, friction, value, uncertainty, code):
    """Time of a code to an error of 1e-8 that no finer mesh contradicts; of those that one confirms, if any."""
    found = [(True, float("inf"))]
    for name in (name for name, model in room.NAMED.items() if model.code == code):
        curve = [row for row in rows if (row.case["model"], row.case["friction"]) == (name, friction)]
        errors = {row.case["number"]: abs((row.result["half_force"] or 0.0) / value - 1.0) for row in curve}
        for row in curve:
            worst = max(error for number, error in errors.items() if number >= row.case["number"])
            if worst + uncertainty / value <= 1e-8:
                sums = map(sum, zip(row.result["setup"], row.result["solve"], strict=True))
                found.append((row.case["number"] == max(errors), min(sums)))
    return min(found)[1]


def test_costs_of_the_committed_run_are_those_of_its_rows():
    """From the rows, without the frame."""
    rows = read_csv(REPORTS / "peers" / "peers.csv.gz")
    runs, solved = runs_of(rows), [row for row in rows if row.result.get("status") == "solved"]
    assert (len(runs), runs.solved.sum()) == (len(rows), len(solved))
    lines = room.compared_of(room.costs_of(runs)).query("target == 1e-8").set_index("friction")
    for friction, (value, uncertainty) in LIMITS.items():
        by_code = {code: least(solved, friction, value, uncertainty, code) for code in room.CODES}
        ours, theirs = by_code[room.TRIANGLES], min(by_code["ngsolve"], by_code["getfem"])
        assert lines.loc[friction, ["seconds_own", "seconds"]].tolist() == pytest.approx([ours, theirs])
