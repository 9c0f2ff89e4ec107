"""The benchmark: what is measured for a case, how ratios and exponents come about, and walls of many blocks."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from pandas import DataFrame

from comparisons.benchmark import report as room
from comparisons.benchmark import study
from comparisons.lab.studies import Study
from qvi_contact import solve
from solvers.factorisation import available_backends
from tests.comparisons.parts import rows_of

TASK = "comparisons.benchmark.study"


@pytest.fixture(scope="module")
def studies():
    """Rows of tiny meshes, of one graded mesh, one loop and two sequences."""
    equal = study.whole((4, 8), (0.2, 0.5), "auto")
    parts = (
        equal, replace(study.graded("auto"), cases=[case | {"runs": 1} for case in study.graded("auto").cases[2:4]]),
        replace(study.sequences(True), cases=[{"sequence": name, "quick": True} for name in ("friction", "cycle")]),
        replace(study.loops((4,), (0.2,)), cases=[{"cells": 4, "loop": "naive loop, qpsolvers", "friction": 0.2}]),
    )  # fmt: skip
    return [rows_of(each) for each in parts]


@pytest.fixture(scope="module")
def solves(studies):
    return room.solves_of(studies[0])


class TestRun:
    """Real cases."""

    def test_every_solve_is_certified_and_times_add_up(self, studies, solves):
        assert [*zip(solves.cells, solves.friction, strict=True)] == [*itertools.product((4, 8), (0.2, 0.5))]
        assert set(solves.status) == {"solved"}
        assert 0.0 <= solves.accuracy.min() <= solves.accuracy.max() < 1e-8
        assert solves.half_force[2] == pytest.approx(214.23302437, rel=1e-8)
        for found in (found for case in studies[0] for found in case.result["solves"]):
            times = {name: np.array(several) for name, several in found["seconds"].items()}
            parts = [times[name] for name in ("factorisation", "interior_point", "certificate")]
            assert times["whole"] == pytest.approx(times["assembly"] + times["solve"])
            assert times["solve"] == pytest.approx(sum(parts) + times["rest"])
            assert np.min([times["assembly"], *parts]) > 0.0

    def test_ratios_are_those_of_the_times_listed(self, studies, solves):
        for each in solves.itertuples():
            (case,) = (found for found in studies[0] if found.case["cells"] == each.cells)
            plain = {found["backend"]: np.median(found["seconds"]["plain"]) for found in case.result["plain"]}
            assert [*plain] == list(available_backends())
            assert each.fastest == min(plain, key=plain.get)
            assert each.ratio_fastest == pytest.approx(each.solve / min(plain.values()))
            assert each.ratio_own == pytest.approx(each.solve / plain[each.library.split(",")[0]])

    def test_loops_agree_with_the_condensed_method(self, studies, solves):
        (other,) = room.loops_of(studies[3], solves).itertuples()
        assert (other.cells, other.status) == (4, "solved")
        assert other.half_force_difference < 1e-4  # the law at points beside that on edges
        assert other.ratio == pytest.approx(other.solve / solves.solve[0])

    def test_graded_meshes_are_close_and_sequences_are_solved_and_agree(self, studies):
        graded, chains = room.graded_of(studies[1]), room.runs_of(studies[2])
        assert graded[["depth", "degree", "friction"]].to_numpy().tolist() == [[4, 5, 0.2], [4, 5, 1.0]]
        assert graded.error.max() < 3e-6
        assert (chains.solved == chains.planned).all()
        assert not (chains.force > 1e-8).any()

    def test_an_error_is_a_record(self):
        case = {"cells": 4, "friction": [0.2], "sparse": "nothing"}
        (found,) = rows_of(Study("wrong", 1, f"{TASK}:solve_whole", [case]))
        (record,) = found.result["solves"]
        assert (record["status"], record["seconds"]) == ("error", {})
        assert "'nothing'" in record["message"]
        assert {each["status"] for each in found.result["plain"]} == {"done"}


class TestNumbers:
    """Medians, ratios, exponents."""

    def test_growth_is_the_exponent(self):
        lines = [{"load": 1, "cells": n, "size": 100 * 4**n, "time": 3.0 * (100 * 4**n) ** 1.25, "status": status}
                 for n, status in ((1, "solved"), (2, "solved"), (3, "stalled"), (4, "solved"))]  # fmt: skip
        found = room.growth_of(DataFrame(lines), "load", "cells", "size", ["time"])
        assert found[["from", "to"]].to_numpy().tolist() == [[1, 2], [2, 3], [3, 4], [1, 4]]
        assert found.time.fillna(-1.0).tolist() == pytest.approx([1.25, -1.0, -1.0, 1.25])


@pytest.fixture(scope="module")
def wall():
    """The row of a small wall."""
    (found,) = rows_of(study.walls((2,), (0.3,)))
    return found


class TestWalls:
    """Walls of many blocks."""

    def test_a_wall_is_a_certified_row(self, wall):
        (found,) = room.walls_of([wall]).to_dict("records")
        assert (found["status"], found["blocks"], found["load"]) == ("solved", 2, 0.3)
        assert found["ratio"] == pytest.approx(found["solve"] / found["factorisation"])
        assert found["peak"] > 2**24
        assert room.wall_report([wall]).findings[-1] == "Of 1 walls 1 are solved, with a certificate."

    def test_the_wall_carries_its_weight_and_the_load(self):
        blocks, load = 3, 0.3
        weight, forms = 24.0 * blocks**2, []
        for system in ("sparse", "dense"):
            result = solve(study.wall_of(blocks, load), method="condensed", system=system)
            assert result.contacts["bottom"].normal_force == pytest.approx(weight, rel=1e-9)
            assert abs(result.contacts["bottom"].tangential_force) == pytest.approx(load * weight, rel=1e-9)
            forms.append(result.solution.form)
        assert forms == ["full", "condensed"]
