"""The benchmark: what is measured for a case, how ratios and exponents come about, and walls of many blocks."""

import itertools
import math
from dataclasses import replace

import pytest

from comparisons import benchmark as room
from comparisons.lab import growth
from comparisons.lab.study import Row, StoredStudy, Study
from qvi_contact import solve
from solvers.factorisation import available_backends
from tests.comparisons.convergence_parts import report_of, rows_of

TASK = "comparisons.benchmark.task"
ENVIRONMENT = {"machine": None, "versions": {}, "threads": 1, "timeout_seconds": None, "memory_mib": None}
NOTHING = StoredStudy({}, ())


def done(study, folder):
    """A study whose cases are done in this process."""
    return StoredStudy({}, rows_of(study, folder / f"{study.name}.sqlite"))


@pytest.fixture(scope="module")
def studies(tmp_path_factory):
    """Tiny meshes by both paths, one graded mesh, one loop."""
    folder = tmp_path_factory.mktemp("benchmark")
    equal = room.whole((4, 8), (0.2, 0.5), 1, "auto")
    (sparse,) = equal.factors["sparse"]
    mesh = {"mesh": ([4, 0.7],), "friction": (0.2, 1.0), "runs": (1,), "sparse": (sparse,)}
    other = {"cells": (4,), "loop": ("naive loop, qpsolvers",), "friction": (0.2,)}
    parts = (equal, Study("graded", 1, f"{TASK}:graded", mesh), Study("loops", 1, f"{TASK}:loop", other))
    return [done(each, folder) for each in parts]


@pytest.fixture(scope="module")
def document(studies):
    return room.document_of(*studies)


def made_up(declared, power=1.2, solve=3.0, status="solved"):
    """Rows whose times are those of a power of the unknowns; plain factorisations take a third."""
    return StoredStudy({}, tuple(_row(case, power, solve, status) for case in declared.cases))


def _row(case, power, solve, status):
    unknowns = 4 * case.values["cells"] ** 2
    times = [factor * solve * unknowns**power for factor in (0.5, 1.0, 1.1)]
    known = {"status": status, "message": "", "unknowns": unknowns, "iterations": 9, "half_force": 214.0}
    solves = [
        {"friction": mu, **known, "library": "pardiso, mkl", "seconds": dict.fromkeys(room.PARTS, times)}
        for mu in case.values["friction"]
    ]
    plain = [
        {"backend": backend, "status": "done", "message": "", "unknowns": unknowns,
         "seconds": {"plain": [factor * solve * unknowns**power / 3.0]}}
        for backend, factor in (("pardiso", 1.0), ("superlu", 4.0))
    ]  # fmt: skip
    result = {"solves": solves, "plain": plain, "peak": 2**27, "imports": 2**26}
    return Row(case.position, case.key, case.values, "done", "", result, None, 1.0, "", 0.0, ENVIRONMENT)


def equal_cells(cells, factorisation="superlu"):
    return room.whole(cells, (0.2,), None, factorisation)


class TestRun:
    """Real cases."""

    def test_every_solve_is_certified_and_paths_agree(self, document):
        found = {(row["cells"], row["path"], row["friction"]): row for row in document["solves"]}
        assert list(found) == [*itertools.product((4, 8), ("general",), (0.2, 0.5))]
        for (cells, _, mu), row in found.items():
            assert row["status"] == "solved"
            assert 0.0 <= row["accuracy"] < 1e-8
            assert row["half_force"] == pytest.approx(found[cells, "general", mu]["half_force"], rel=1e-9)
        assert found[8, "general", 0.2]["half_force"] == pytest.approx(213.81671332, rel=1e-9)

    def test_times_add_up(self, document):
        for row in document["solves"]:
            assert row["whole"] == pytest.approx(row["assembly"] + row["solve"])
            parts = row["factorisation"] + row["interior_point"] + row["certificate"] + row["rest"]
            assert row["solve"] == pytest.approx(parts)
            assert min(row[name] for name in ("assembly", "factorisation", "interior_point", "certificate")) > 0.0

    def test_ratios_are_those_of_the_times_listed(self, document):
        for row in document["solves"]:
            plain = {p["backend"]: p["plain"] for p in document["plain"]
                     if (p["cells"], p["path"]) == (row["cells"], row["path"])}  # fmt: skip
            assert row["fastest"] == min(plain, key=plain.get)
            assert row["ratio_fastest"] == pytest.approx(row["solve"] / min(plain.values()))
            own = plain[row["library"].split(",")[0]]
            assert row["ratio_own"] == pytest.approx(row["solve"] / own)

    def test_every_installed_library_factorises_the_same_matrix(self, document):
        found = [row for row in document["plain"] if (row["cells"], row["path"]) == (8, "general")]
        assert [row["backend"] for row in found] == list(available_backends())
        assert all(row["analysis"] + row["numeric"] <= row["plain"] for row in found)

    def test_loops_agree_with_the_condensed_method(self, document):
        (other,) = document["loops"]
        assert (other["cells"], other["status"]) == (4, "solved")
        assert other["half_force_difference"] < 1e-7
        (condensed,) = (row for row in document["solves"]
                        if (row["cells"], row["path"], row["friction"]) == (4, "general", 0.2))  # fmt: skip
        assert other["ratio"] == pytest.approx(other["solve"] / condensed["solve"])

    def test_graded_meshes_say_what_they_meet(self, document):
        assert [(row["cells"], row["grading"], row["friction"]) for row in document["graded"]] == [
            (4, 0.7, 0.2), (4, 0.7, 1.0)
        ]  # fmt: skip
        for row in document["graded"]:
            assert row["error"] == pytest.approx(abs(row["half_force"] / room.SETTLED[row["friction"]] - 1.0))
            assert (row["met"] == []) == (row["error"] > 1e-4 or row["whole"] > 0.02)

    @pytest.mark.usefixtures("outlined")
    def test_the_report_is_made_of_them(self, studies):
        text = report_of("benchmark", *studies).text
        assert "`python -m comparisons benchmark --cells 4 8 --friction 0.2 0.5" in text

    def test_the_loop_in_cvxpy_finds_the_same(self):
        found = room.loop({"cells": 4, "friction": 0.2, "loop": "naive loop, cvxpy"})
        assert (found["status"], found["unknowns"]) == ("solved", 64)
        assert found["half_force"] == pytest.approx(213.47271271, rel=1e-8)
        assert len(found["seconds"]) == 3
        assert min(found["seconds"]) > 0.0

    def test_an_error_is_a_record(self, tmp_path):
        case = {"cells": (4,), "path": ("general",), "friction": ([0.2],), "runs": (2,), "sparse": ("nothing",)}
        (row,) = rows_of(Study("wrong", 1, f"{TASK}:whole", case), tmp_path / "a")
        (record,) = row.result["solves"]
        assert (record["status"], record["seconds"]) == ("error", {})
        assert "'nothing'" in record["message"]
        assert {each["status"] for each in row.result["plain"]} == {"done"}

    def test_large_plain_factorisations_of_other_libraries_are_left_out(self):
        """The one that the solve takes is measured, whatever it takes."""
        told, expected = {}, {"superlu": 576.0, "mumps": 576.0, "pardiso": 20.0, "umfpack": 1.0}
        assert room.affordable(expected, "superlu", 3, told) == {"superlu": 3, "pardiso": 1, "umfpack": 3}
        (record,) = told.pop("mumps")
        assert (record["status"], "576 s" in record["message"], told) == ("skipped", True, {})


class TestNumbers:
    """Medians, ratios, exponents."""

    def test_growth_is_the_exponent(self):
        assert growth((100, 1600), (3.0 * 100**1.25, 3.0 * 1600**1.25)) == pytest.approx(1.25)
        assert growth((100, 400), (None, 1.0)) is growth((100, 400), (1.0, math.nan)) is None
        assert growth((100, 100), (1.0, 2.0)) is None
        assert room.predicted(2.0, 100, 400) == pytest.approx(16.0)

    def test_rows_have_medians_and_ratios_of_medians(self):
        for row in room.solves_of(made_up(equal_cells((128, 256, 512))).rows).itertuples():
            assert row.solve == pytest.approx(3.0 * row.unknowns**1.2)
            assert row.spread == pytest.approx(0.6)
            assert row.ratio_own == pytest.approx(3.0 / 4.0)
            assert (row.fastest, row.ratio_fastest) == ("pardiso", pytest.approx(3.0))
            assert row.half_force_error == pytest.approx(abs(214.0 / room.CONVERGED[row.cells] - 1.0))

    @pytest.mark.usefixtures("outlined")
    def test_a_failed_solve_and_a_case_that_died_are_rows_without_a_ratio(self):
        frames = room.frames_of(made_up(equal_cells((8,)), status="stalled"), NOTHING)
        assert frames["solves"][["ratio_own", "ratio_fastest"]].isna().all(axis=None)
        assert room.values_of(frames)["solved"] == 0
        found = made_up(equal_cells((4, 8), "auto"))
        rows = (replace(found.rows[0], status="memory", reason="out of memory", result={}), found.rows[1])
        lost = StoredStudy({}, rows)
        solves = room.document_of(lost, NOTHING)["solves"]
        assert [(row["status"], row["message"]) for row in solves] == [("memory", "out of memory"), ("solved", "")]
        assert "out of memory" not in report_of("benchmark", lost, NOTHING).text.split("## Whole solve")[0]


class TestStudies:
    """Settings."""

    def test_repetitions_by_size(self):
        assert [room.repetitions(cells, None) for cells in (64, 128, 256, 512, 1024)] == [5, 5, 3, 3, 2]
        assert room.repetitions(512, 7) == 7

    def test_the_factorisation_asked_for_is_taken(self):
        assert equal_cells((4,)).factors["sparse"] == ("superlu",)

    def test_loops_are_tried_on_meshes_that_are_not_too_large_for_them(self):
        cases = {(case.values["loop"], case.values["cells"]) for case in room.loops((64, 128, 256), (0.1, 0.2)).cases}
        assert cases == {(name, n) for name, each in room.METHODS.items() for n in (64, 128) if n <= each.largest}
        assert room.loops((256,), (0.2,)) is None
        assert {case.values["friction"] for case in room.loops((4,), (0.1, 0.5)).cases} == {0.1}

    def test_every_case_has_a_process_of_its_own(self):
        studies = (equal_cells((4,)), room.graded(1, "auto"), room.loops((4,), (0.2,)), room.walls((2,), (), ("bfs",)))
        assert all(each.fresh for each in studies)


@pytest.fixture(scope="module")
def wall(tmp_path_factory):
    """The row of a small wall."""
    (row,) = done(room.walls((2,), (0.3,), ("hct",)), tmp_path_factory.mktemp("wall")).rows
    return row


class TestWalls:
    """Walls of many blocks."""

    def test_a_wall_is_a_certified_row(self, wall):
        (found,) = room.walls_of([wall]).to_dict("records")
        assert (found["status"], found["blocks"], found["load"]) == ("solved", 2, 0.3)
        assert found["ratio"] == pytest.approx(found["solve"] / found["factorisation"])
        assert found["peak"] > 2**24
        text = room.wall_report(StoredStudy({}, (wall,))).text
        assert "`python -m comparisons benchmark --problem wall --blocks 2 --load 0.3" in text

    def test_the_wall_carries_its_weight_and_the_load(self):
        blocks, load = 3, 0.3
        weight, forms = 24.0 * blocks**2, []
        for system in ("sparse", "dense"):
            result = solve(room.wall_of(blocks, load), element="hct", method="condensed", system=system)
            assert result.contacts["bottom"].normal_force == pytest.approx(weight, rel=1e-9)
            assert abs(result.contacts["bottom"].tangential_force) == pytest.approx(load * weight, rel=1e-9)
            forms.append(result.solution.form)
        assert forms == ["full", "condensed"]
