"""The command `qvi-contact bracket`, its documents and pictures."""

import json
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from qvi_contact import (
    Contact,
    ContactProblem,
    Expression,
    Material,
    RectilinearMesh,
    Symmetry,
    Traction,
    save_problem,
    solve,
)
from qvi_contact.bracket import Certainty, slip
from qvi_contact.bracket.document import document, lines
from qvi_contact.cli import group
from qvi_contact.command import solve_line
from qvi_contact.errors import InputError
from qvi_contact.gallery import compressed_plate
from qvi_contact.plots import save_figure
from qvi_contact.plots.bracket import bracket_figure
from qvi_contact.units import Units

EXAMPLES = Path(__file__).parents[3] / "examples"


def curved_potential():
    """A potential that is not affine along a rough contact: stresses of rectangles obey no law on its whole edges."""
    contact = Contact.tresca("top", 0.1, gap=-1e-3)
    sides = Symmetry("left"), Symmetry("bottom"), Traction("right", x=0.0, y=0.0)
    return ContactProblem(RectilinearMesh.rectangle((3, 3)), Material(1e3, 0.2), [contact, *sides], Expression("x**2"))


def command(*words):
    return CliRunner().invoke(group, ["bracket", *map(str, words)], standalone_mode=False)


def test_guaranteed_example_with_all_files(tmp_path):
    """A stack of blocks that sticks: bounds of the tied problem, picture and displacements."""
    picture, fields = tmp_path / "apart.png", tmp_path / "moved.vtu"
    done = command(EXAMPLES / "stacked_blocks.toml", "--plot", picture, "--vtk", fields)
    assert done.return_value == 0
    assert str(Certainty.IF_STICKING) in done.stdout
    assert "MN m/m" in done.stdout
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert b"displacement" in fields.read_bytes()


def test_one_json_document():
    done = command(EXAMPLES / "compressed_plate.toml", "--json", "--degree", 3)
    found = json.loads(done.stdout)
    bounds = found["bracket"]["energies"]
    assert done.return_value == 0
    assert bounds["lower"]["value"] < bounds["upper"]["value"]
    assert found["bracket"]["guaranteed"] is False
    assert found["bracket"]["reasons"]
    assert found["bracket"]["companion"]["degree"] == 3
    assert found["status"] == "solved"


def test_missing_lower_bound(tmp_path):
    """No bound from below: no gap, no picture, the reason."""
    picture = tmp_path / "apart.png"
    save_problem(tmp_path / "curved.toml", curved_potential())
    done = command(tmp_path / "curved.toml", "--element", "bfs", "--plot", picture)
    assert done.return_value == 1
    assert "no lower bound" in done.stdout
    assert "duality gap" not in done.stdout
    assert "no duality gap to draw" in done.stderr
    assert not picture.exists()


def test_problem_without_solution(tmp_path):
    done = command(EXAMPLES / "dragged_block_slides.toml", "--vtk", tmp_path / "moved.vtu")
    assert done.return_value == 1
    assert "no displacement to write" in done.stderr
    assert json.loads(command(EXAMPLES / "dragged_block_slides.toml", "--json").stdout)["bracket"] is None


@pytest.mark.parametrize(
    ("words", "field"),
    [((EXAMPLES / "cyclic_shear.toml",), "history"), ((EXAMPLES / "punch.toml", "--degree", 7), "degree"),
     ((EXAMPLES / "punch.toml", "--tolerance", 0.5), "tolerance")],
)  # fmt: skip
def test_refusals(words, field):
    done = command(*words)
    assert isinstance(done.exception, InputError)
    assert field in str(done.exception)


class TestDocument:
    """What is said about one bracket."""

    def test_forces_and_parts(self):
        found = solve(compressed_plate(0.5, (4, 4))).bracket
        told = document(found, Units(length="mm", stress="MPa"))
        force = found.forces["plate.normal_force"]
        assert told["forces"]["plate.normal_force"] == {"lower": force.lower, "upper": force.upper, "unit": "MPa mm"}
        assert sum(part["value"] for part in told["gap"].values()) == pytest.approx(found.gap, rel=1e-6)
        assert any("plate.normal_force between" in line for line in lines(found))

    def test_rounding_is_shown_as_zero(self):
        found = solve(compressed_plate(0.1, (4, 4))).bracket
        assert found.parts["contact"] != 0.0
        assert found.shown_parts["contact"] == 0.0

    def test_picture_of_no_gap_is_refused(self):
        with pytest.raises(InputError, match="no duality gap"):
            bracket_figure(solve(curved_potential(), element="bfs").bracket)

    def test_picture_of_an_exact_state(self, tmp_path):
        found = solve(compressed_plate(0.0, (2, 2))).bracket
        save_figure(tmp_path / "exact.svg", bracket_figure(found, title="No gap"))
        assert (tmp_path / "exact.svg").read_text(encoding="utf-8").startswith("<?xml")

    def test_repr_is_one_line(self):
        found = solve(compressed_plate(0.0, (2, 2))).bracket
        assert "\n" not in repr(found)
        assert len(repr(found)) < 400


def test_tresca_contact_with_a_wavy_bound_says_so():
    plate = compressed_plate(0.0, (3, 3))
    wavy = Contact.tresca("top", lambda x, y: 20.0 * np.abs(np.sin(5.0 * x)) + 0.0 * y, gap=-1e-3, name="plate")
    found = solve(replace(plate, conditions=[*plate.conditions[:3], wavy])).bracket
    assert not found.guaranteed
    assert sum("bound" in reason for reason in found.reasons) == 1


def test_forces_under_slip_are_computed_while_progress_is_shown(monkeypatch):
    """They take longest on large meshes."""
    under_way, computed = [], []

    @contextmanager
    def watching(*_, **__):
        under_way.append(True)
        yield lambda _="": None
        under_way.pop()

    def forces(*_):
        computed.append(bool(under_way))
        return {}

    monkeypatch.setattr(solve_line, "solving", watching)
    monkeypatch.setattr(slip, "force_bounds_under_slip", forces)
    done = command(EXAMPLES / "compressed_plate.toml", "--degree", 3)
    assert done.return_value == 0
    assert computed == [True]
