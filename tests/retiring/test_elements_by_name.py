"""The element by name: in `solve` and its relatives, in problem files, on the command line."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from qvi_contact import (
    Contact,
    ContactProblem,
    InputError,
    Material,
    Traction,
    TriangleMesh,
    discretize,
    limit_load_factor,
    load_problem,
    refine,
    save_problem,
    solve,
    solve_history,
    verify_result,
)
from qvi_contact.cli import group
from qvi_contact.command.outline import outline
from qvi_contact.gallery import compressed_plate

EXAMPLES = Path(__file__).parents[2] / "examples"
PLATE, BLOCK = (str(EXAMPLES / f"{name}.toml") for name in ("compressed_plate", "dragged_block_holds"))


def printed(*arguments):
    """What a command prints as JSON."""
    done = CliRunner().invoke(group, [*arguments, "--json"], catch_exceptions=False, standalone_mode=False)
    return json.loads(done.stdout)


class TestPython:
    """`element` in Python."""

    def test_rectangles_are_cut_for_triangles(self):
        plate = compressed_plate(0.2, (4, 4))
        result, other = solve(plate, element="hct", degree=3), solve(plate.triangulated(), degree=3)
        assert isinstance(result.problem.mesh, TriangleMesh)
        assert result.contacts["plate"].normal_force == other.contacts["plate"].normal_force
        rectangles = solve(plate, element="bfs")
        assert rectangles.problem is plate
        assert rectangles.nodal.shape == (5, 5, 4)

    def test_by_default_rectangles_are_cut(self):
        plate = compressed_plate(0.2, (2, 2))
        result, known = solve(plate), solve(plate.triangulated(), degree=4)
        assert result.discretization.space.degree == 4
        assert result.contacts["plate"].normal_force == known.contacts["plate"].normal_force
        assert refine(plate, target=0.1).guaranteed is False
        with pytest.raises(InputError, match="bfs"):
            _ = result.nodal

    def test_by_default_thin_rectangles_stay(self):
        """Triangles would be refused; what is solved on a grid is refined, checked and bracketed on it."""
        thin = compressed_plate(0.5, (8, 8), grading=0.35)
        with pytest.raises(InputError, match="as long as high"):
            discretize(thin, element="hct")
        result = solve(thin)
        assert result.problem is thin
        assert verify_result(result).passed
        assert result.bracket.reasons == ()

    def test_an_earlier_result_says_what_is_refined(self):
        plate = compressed_plate(0.5, (2, 2))
        for element, on_triangles in (("bfs", False), ("hct", True)):
            refined = refine(plate, solve(plate, element=element), target=0.5)
            assert isinstance(refined.problem.mesh, TriangleMesh) is on_triangles

    def test_uzawa_steps_follow_each_other(self):
        steps = [compressed_plate(0.2, (2, 2), displacement=factor * 1e-3) for factor in (1.0, 2.0)]
        assert solve_history(steps, method="uzawa", iterations=3).steps[0].status == "max_iterations"

    def test_triangles_stay_what_they_are(self):
        plate = compressed_plate(0.2, (2, 2)).triangulated()
        assert discretize(plate, element="hct").problem is plate

    def test_a_limit_load_is_that_of_the_triangles(self):
        block = load_problem(BLOCK).problem
        loads = ["drag"]
        assert limit_load_factor(block, loads, element="hct", degree=3) == pytest.approx(1.0 / 0.99, rel=1e-9)

    def test_a_history_by_uzawa_takes_the_rows_that_solve_takes(self):
        steps = [compressed_plate(0.2, (2, 2), displacement=factor * 1e-3) for factor in (1.0, 2.0)]
        options = {"method": "uzawa", "iterations": 2, "element": "hct"}
        kinds = [step.discretization.space.contact_rule.kind for step in solve_history(steps, **options).steps]
        assert set(kinds) == {solve(steps[0], **options).discretization.space.contact_rule.kind} == {"gauss"}

    def test_a_history_is_cut_as_a_whole(self):
        steps = [compressed_plate(0.2, (2, 2), displacement=factor * 1e-3) for factor in (1.0, 2.0)]
        history = solve_history(steps, element="hct", degree=3)
        assert history.status == "solved"
        meshes = [step.problem.mesh for step in history.steps]
        assert all(isinstance(mesh, TriangleMesh) for mesh in meshes)
        forces = [step.contacts["plate"].normal_force for step in history.steps]
        assert forces[1] == pytest.approx(2.0 * forces[0], rel=1e-6)

    @pytest.mark.parametrize("element", ["tri", "HCT", 3, ["hct"]])
    def test_unknown_elements_are_refused(self, element):
        with pytest.raises(InputError, match="hct") as caught:
            solve(compressed_plate(0.2, (2, 2)), element=element)
        assert caught.value.field == "element"

    def test_what_does_not_fit_is_refused(self):
        plate = compressed_plate(0.2, (2, 2))
        with pytest.raises(InputError, match="rectangles"):
            discretize(plate.triangulated(), element="bfs")
        with pytest.raises(InputError, match="hct"):
            discretize(plate, element="bfs", degree=5)
        with pytest.raises(InputError, match="discretize"):
            solve(discretize(plate), element="bfs")


class TestFiles:
    """[solve] and the options of the commands."""

    @pytest.fixture
    def on_triangles(self, tmp_path):
        path = tmp_path / "plate.toml"
        text = Path(PLATE).read_text(encoding="utf-8").replace("cells = 16, grading = 0.9", "cells = 2")
        path.write_text(text + '\n[solve]\nelement = "hct"\ndegree = 3\ncontact_rows = "gauss"\n', encoding="utf-8")
        return str(path)

    def test_a_file_chooses_its_element(self, on_triangles):
        found = printed("check", on_triangles)
        assert found["element"] == {"name": "Hsieh-Clough-Tocher", "degree": 3, "contact_rows": "gauss"}
        assert found["mesh"]["cells"] == 8
        solved = printed("solve", on_triangles)
        assert solved["element"] == found["element"]
        known = solve(load_problem(on_triangles).problem, element="hct", degree=3, contact_rows="gauss")
        force = solved["contacts"]["plate"]["normal_force"]["value"]
        assert force == pytest.approx(known.contacts["plate"].normal_force, rel=1e-12)

    def test_options_come_before_the_file(self, on_triangles):
        other = printed(
            "solve", on_triangles, "--degree", "5", "--contact-rows", "bernstein", "--method", "fixed-point"
        )
        assert other["element"] == {"name": "Hsieh-Clough-Tocher", "degree": 5, "contact_rows": "bernstein"}
        assert other["method"] == "fixed-point"

    def test_an_option_cuts_the_rectangles_of_a_file(self):
        found = printed("check", BLOCK, "--element", "hct", "--degree", "5")
        assert found["mesh"]["cells"] == 64
        assert found["element"]["degree"] == 5
        factor = printed("limit", BLOCK, "--load", "drag", "--element", "hct")
        assert factor["factor"] == pytest.approx(1.0 / 0.99, rel=1e-9)

    def test_a_bracket_is_of_the_element_too(self, tmp_path):
        path = tmp_path / "plate.toml"
        path.write_text(Path(PLATE).read_text(encoding="utf-8").replace("cells = 16, grading = 0.9", "cells = 2"))
        found = printed("bracket", str(path), "--element", "hct")
        assert found["element"]["name"] == "Hsieh-Clough-Tocher"
        assert 0.0 <= found["bracket"]["relative_error"] < 0.1

    def test_rounding_of_resultants_is_zero(self, tmp_path):
        """A slanted pressure whose parts along x cancel."""
        roof = TriangleMesh(
            [(0.0, 0.0), (2.0, 0.0), (1.0, 0.7)], [[0, 1, 2]], {"base": [[0, 1]], "roof": [[0, 2], [1, 2]]}
        )
        conditions = [Contact("base", friction=0.3), Traction("roof", normal=-3.0, tangential=0.0)]
        save_problem(tmp_path / "roof.toml", ContactProblem(roof, Material(1.0, 0.3), conditions))
        (load,) = printed("check", str(tmp_path / "roof.toml"))["loads"]
        assert load["x"] == 0.0
        assert load["y"] == pytest.approx(-6.0)
        assert load["moment"] == pytest.approx(-6.0)

    def test_loads_of_triangles_are_those_of_rectangles(self):
        known, found = printed("check", BLOCK), printed("check", BLOCK, "--element", "hct")
        assert [load["name"] for load in found["loads"]] == [load["name"] for load in known["loads"]]
        for one, other in zip(known["loads"], found["loads"], strict=True):
            for part in ("x", "y", "moment"):
                assert other[part] == pytest.approx(one[part], abs=1e-9)

    def test_a_degree_that_does_not_fit_is_named_by_its_place(self, tmp_path):
        path = tmp_path / "plate.toml"
        path.write_text(Path(PLATE).read_text(encoding="utf-8") + "\n[solve]\ndegree = 2\n", encoding="utf-8")
        done = CliRunner().invoke(group, ["solve", str(path)])
        assert isinstance(done.exception, InputError)
        assert done.exception.field == "solve.degree"
        for wrong in ("degree = 2.5", 'element = "tri"', 'contact_rows = "points"'):
            path.write_text(Path(PLATE).read_text(encoding="utf-8") + f"\n[solve]\n{wrong}\n", encoding="utf-8")
            with pytest.raises(InputError) as caught:
                load_problem(path)
            assert caught.value.field == f"solve.{wrong.split()[0]}"

    def test_what_is_described_and_drawn_is_what_is_solved(self):
        problem, described = outline(load_problem(BLOCK), {"element": "hct"})
        assert isinstance(problem.mesh, TriangleMesh)
        assert described["mesh"]["cells"] == problem.mesh.cell_count
