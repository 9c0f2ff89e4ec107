"""A displacement code beside this package: what it finds, on which meshes, and what an error costs."""

from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec

import numpy as np
import pytest

from comparisons import LIMITS, SETTLED
from comparisons import peers as room
from qvi_contact import TriangleMesh, solve
from qvi_contact.gallery import compressed_plate
from tests.comparisons.conftest import committed, row

LIMIT = {friction: value for friction, (value, _) in LIMITS.items()}
with_ngsolve = pytest.mark.skipif(find_spec("ngsolve") is None, reason="NGSolve is not installed")


def solved(code, case, **options):
    """What a code, a key of `CODES`, answers."""
    return import_module(f"comparisons.peers.{room.CODES[code].module}").plate(case, **options)()


def squares(friction, cells):
    """The plate on squares."""
    lines = np.linspace(0.0, 1.0, cells + 1)
    return {**room.plate(friction, "adaptive", 0), **room.plain_mesh((lines, lines))}


@with_ngsolve
class TestNitsche:
    """NGSolve's script."""

    @pytest.mark.parametrize(("cells", "expected"), [(8, 214.23746), (16, 214.23420)])
    def test_expected_forces(self, cells, expected):
        found = solved(room.NGSOLVE, squares(0.2, cells), order=2, variant="incomplete")
        assert found["status"] == "solved"
        assert found["half_force"] == pytest.approx(expected, abs=6e-6)
        assert found["unknowns"] == 2 * (2 * cells + 1) ** 2 - 2 * (2 * cells + 1)

    def test_graded_meshes(self):
        """Full stick; and slip, in so few steps of Newton's method as only its line search lets it take."""
        stuck = solved(room.NGSOLVE, room.plate(1.0, "bisected", 6), order=4)
        assert stuck["half_force"] == pytest.approx(SETTLED[1.0], abs=1e-4)
        found = solved(room.NGSOLVE, room.plate(0.2, "strips", 5), order=2)
        assert (found["status"], found["residual"] <= 1e-8, found["iterations"] <= 15) == ("solved", True, True)


class TestOwnModels:
    """What this package's own codes answer."""

    def test_the_bracket_on_triangles_bounds_the_force_under_friction(self):
        case = room.plate(0.1, "bisected", 0)
        found = solved(room.BRACKET, case, degree=4, bracket=4)
        assert (found["status"], found["guaranteed"]) == ("solved", True)
        assert found["lower"] < LIMIT[0.1] < found["upper"]
        assert found["width"] == pytest.approx((found["upper"] - found["lower"]) / (found["upper"] + found["lower"]))
        stress = solve(on_the_mesh(case), degree=4, tolerance=1e-8)
        assert found["strain_error"] == pytest.approx(stress.bracket.relative_error, rel=1e-6)
        assert found["unknowns"] == stress.solution.problem.n + stress.bracket.companion.space.size

    @pytest.mark.parametrize(("number", "width"), [(0, 10.0**-2.5), (1, 1e-3)])
    def test_adaptive_meshes_give_bounds_as_close_as_their_number_asks_for(self, number, width):
        found = solved(room.BRACKET, room.plate(0.05, "adaptive", number), degree=5, adaptive=True)
        assert (found["status"], found["guaranteed"]) == ("solved", True)
        assert found["lower"] < LIMIT[0.05] < found["upper"]
        assert 0.0 < found["width"] <= width
        assert len(room.plate(0.05, "adaptive", number)["cells"]) == 2


def on_the_mesh(case):
    """The gallery's plate on the triangles of a case."""
    return replace(
        compressed_plate(case["friction"]), mesh=TriangleMesh(case["vertices"], case["cells"], case["sides"])
    )


def test_rows_are_certified_solves_with_times_a_memory_and_an_error():
    """Two models on one mesh."""
    chosen = ["triangles, p = 3, bisected", *(["NGSolve, p = 2, symmetric, bisected"] if find_spec("ngsolve") else [])]
    cases = [{"friction": 1.0, "model": name, "number": 0, "repetitions": 2} for name in chosen]
    runs = room.runs_of([row(case, room.run(case)) for case in cases])
    own = runs[runs.code == room.TRIANGLES].iloc[0]
    expected = solve(on_the_mesh(room.plate(1.0, "bisected", 0)), degree=3)
    assert own.half_force == pytest.approx(expected.contacts["plate"].normal_force, rel=1e-10)
    assert own.unknowns == expected.solution.problem.n
    assert own.residual < 1e-8
    for run in runs.itertuples():
        whole = [sum(pair) for pair in zip(run.setup, run.solve, strict=True)]
        assert (len(whole), run.seconds) == (2, min(whole))
        assert min(run.setup + run.solve) > 0.0
        assert 2**24 < run.before <= run.peak
        assert run.error == pytest.approx(abs(run.half_force / LIMIT[1.0] - 1.0))
        assert run.error > 1e-6


class TestMeshes:
    """Families of meshes."""

    @pytest.mark.parametrize("friction", [*room.TRANSITIONS, 1.0])
    @pytest.mark.parametrize("name", [name for name in room.FAMILIES if name != "adaptive"])
    def test_members_fill_the_plate_and_get_finer(self, name, friction):
        counts = []
        for number in (0, room.LEVELS - 1):
            mesh = room.plate(friction, name, number)
            corners = mesh["vertices"][mesh["cells"]]
            x, y = np.moveaxis(corners, 2, 0)
            area = 0.5 * (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1)
            assert area.min() > 0.0
            assert area.sum() == pytest.approx(1.0)
            edges = [mesh["vertices"][mesh["sides"][side]] for side in ("left", "top")]
            assert [np.abs(np.diff(ends, axis=1)).sum() for ends in edges] == pytest.approx([1.0, 1.0])
            counts.append(len(corners))
        assert counts[0] < counts[1]

    @pytest.mark.parametrize(("friction", "transition"), room.TRANSITIONS.items())
    @pytest.mark.parametrize("name", ["strips", "narrow strips", "bisected"])
    def test_the_smallest_cells_are_at_corner_and_transition(self, name, friction, transition):
        vertices = room.plate(friction, name, room.LEVELS - 1)["vertices"]
        tops = np.sort(vertices[vertices[:, 1] == 1.0, 0])
        lengths = np.diff(tops)
        near = lengths[(tops[:-1] <= transition + 1e-12) & (tops[1:] >= transition - 1e-12)]
        assert near.max() < 0.06
        assert max(near.max(), lengths[-1]) < lengths.max() / 4.0

    def test_all_codes_get_the_plate_of_the_gallery(self):
        case = room.plate(0.2, "strips", 3)
        assert (case["young"], case["poisson"], case["displacement"], case["friction"]) == (2.09e5, 0.3, 1e-3, 0.2)


def least(rows, friction, value, uncertainty, code):
    """Time of a code to an error of 1e-8 that no finer mesh contradicts; of those that one confirms, if any."""
    found = [(True, float("inf"))]
    for name in (name for name, model in room.MODELS.items() if model.code == code):
        curve = [row for row in rows if (row.case["model"], row.case["friction"]) == (name, friction)]
        errors = {row.case["number"]: abs((row.result["half_force"] or 0.0) / value - 1.0) for row in curve}
        for each in curve:
            worst = max(error for number, error in errors.items() if number >= each.case["number"])
            if worst + uncertainty / value <= 1e-8:
                sums = map(sum, zip(each.result["setup"], each.result["solve"], strict=True))
                found.append((each.case["number"] == max(errors), min(sums)))
    return min(found)[1]


def test_costs_of_the_committed_run_are_those_of_its_rows():
    """From the rows, without the frame."""
    rows = committed("peers")
    runs, solved = room.runs_of(rows), [row for row in rows if row.result.get("status") == "solved"]
    assert (len(runs), runs.solved.sum()) == (len(rows), len(solved))
    lines = room.costs_of(runs).query("target == 1e-8").set_index("friction")
    for friction, (value, uncertainty) in LIMITS.items():
        times = [least(solved, friction, value, uncertainty, code) for code in (room.TRIANGLES, room.NGSOLVE)]
        assert lines.loc[friction, ["seconds_own", "seconds"]].tolist() == pytest.approx(times)
