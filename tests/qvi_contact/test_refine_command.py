"""The command `qvi-contact refine`: rounds, what the error is, files, and what a problem file says of it."""

import io
import json
import re
from dataclasses import replace

import pytest
from click.testing import CliRunner
from rich.console import Console

from qvi_contact import Contact, load_problem, refine, save_problem
from qvi_contact.basics import terminal
from qvi_contact.bracket import Certainty
from qvi_contact.cli import group
from qvi_contact.command import solve_line
from qvi_contact.errors import InputError
from qvi_contact.gallery import compressed_plate
from qvi_contact.units import Units
from solvers.basics.watch import Progress, tell

FORCE = "plate.normal_force"


def plate(folder, friction, **details):
    """Quarter of the plate on 2 × 2 cells; tied instead of rough where there is no friction coefficient."""
    problem = compressed_plate(friction or 0.2, cells=(2, 2))
    if friction is None:
        tied = Contact.tied("top", gap=-1e-3, name="plate")
        problem = replace(problem, conditions=[*problem.conditions[:-1], tied])
    path = folder / "plate.toml"
    save_problem(path, problem, title="The plate", units=Units("mm", "MPa"), **details)
    return path


def command(*words):
    return CliRunner().invoke(group, ["refine", *map(str, words)], standalone_mode=False)


def table_rows(text):
    """Cells of the rows of rounds."""
    return [line.split() for line in text.splitlines() if re.match(r"\d+ +\d+ ", line)]


def test_a_guaranteed_bound(tmp_path):
    """Table and sentence say what the function finds; every file is written, and the archive verifies."""
    file, page, npz, kept = (tmp_path / name for name in ("plate.toml", "page.html", "answer.npz", "answer.json"))
    plate(tmp_path, None)
    asked = ("--target", 1e-3, "--quantity", FORCE, "--degree", 4)
    done = command(file, *asked, "--report", page, "--npz", npz, "--save-json", kept)
    known = refine(load_problem(file).problem, target=1e-3, quantity=FORCE, degree=4)
    assert done.return_value == 0
    assert known.guaranteed
    assert [row[-1] for row in table_rows(done.stdout)] == ["guaranteed"] * len(known.rounds)
    assert [row[2:4] for row in table_rows(done.stdout)] == [[str(r.unknowns), f"{r.value:.9g}"] for r in known.rounds]
    assert "This is a guaranteed bound" in done.stdout
    assert "friction" not in done.stdout
    assert f"{FORCE} [N/mm]" in done.stdout
    found = json.loads(kept.read_text(encoding="utf-8"))["refinement"]
    assert [each["unknowns"] for each in found["rounds"]] == [each.unknowns for each in known.rounds]
    assert found["value"] == {"value": pytest.approx(known.value, rel=1e-10), "unit": "N/mm"}
    assert found["estimate"] == pytest.approx(known.estimate, rel=1e-4)
    assert CliRunner().invoke(group, ["verify", str(npz)], standalone_mode=False).return_value == 0
    said = re.sub(r"<[^>]*>", " ", page.read_text(encoding="utf-8"))
    assert "Refinement of the mesh" in said
    assert f"{known.value:.9g}" in said


def test_an_estimate_that_misses_its_target(tmp_path):
    done = command(plate(tmp_path, 0.2), "--target", 1e-9, "--max-rounds", 2, "--degree", 3, "--json")
    found = json.loads(done.stdout)
    assert done.return_value == 1
    assert (found["status"], found["refinement"]["status"]) == ("solved", "rounds")
    assert found["refinement"]["guaranteed"] is False
    assert len(found["refinement"]["rounds"]) == 2
    assert found["refinement"]["estimate"] > 1e-9
    text = command(tmp_path / "plate.toml", "--target", 1e-9, "--max-rounds", 2, "--degree", 3).stdout
    assert "This is an estimate" in text
    assert "raise max_rounds" in text


def test_a_bound_of_the_tied_problem_says_so(tmp_path):
    """On so coarse a mesh the plate sticks everywhere, on finer ones it slips: the bound is no claim about that."""
    text = command(plate(tmp_path, 0.2), "--target", 1e-9, "--max-rounds", 1, "--degree", 3).stdout
    assert [row[-3:] for row in table_rows(text)] == [["guaranteed", "if", "sticking"]]
    assert str(Certainty.IF_STICKING) in text


class TestGuaranteed:
    """Bounds under slip, where they are asked for."""

    def kinds(self, *words):
        found = json.loads(command(*words, "--json").stdout)["refinement"]
        return [each["guaranteed"] for each in found["rounds"]]

    def test_by_option_and_by_file(self, tmp_path):
        asked = {"target": 0.02, "quantity": FORCE, "max_rounds": 1}
        path = plate(tmp_path, 0.2, solve_options={"degree": 4}, refine_options=asked)
        assert self.kinds(path) == [False]
        assert self.kinds(path, "--guaranteed") == [True]
        path = plate(tmp_path, 0.2, solve_options={"degree": 4}, refine_options=asked | {"guaranteed": True})
        assert dict(load_problem(path).refine_options) == asked | {"guaranteed": True}
        assert self.kinds(path) == [True]
        assert self.kinds(path, "--estimated") == [False]

    def test_a_bound_under_slip_is_not_said_to_stick(self, tmp_path):
        path = plate(tmp_path, 0.2, solve_options={"degree": 4})
        text = command(path, "--target", 0.02, "--quantity", FORCE, "--guaranteed").stdout
        assert "This is a guaranteed bound" in text
        assert "slips one way only" in text
        assert "tied" not in text

    def test_anything_but_true_and_false_is_refused(self):
        with pytest.raises(InputError, match="guaranteed"):
            refine(compressed_plate(0.2, cells=(2, 2)), guaranteed="yes")


def test_a_whole_number_is_shown_as_given(tmp_path):
    error = command(plate(tmp_path, 0.2), "--max-unknowns", 1).exception
    assert error.value == 1
    assert "1.0" not in str(error)


class TestFile:
    """What [refine] says."""

    def test_it_is_kept_and_overridden(self, tmp_path):
        asked = {"target": 0.05, "quantity": FORCE, "max_rounds": 1, "max_unknowns": 5000}
        path = plate(tmp_path, 0.2, solve_options={"degree": 3}, refine_options=asked)
        assert dict(load_problem(path).refine_options) == asked
        found = json.loads(command(path, "--json").stdout)
        assert (found["refinement"]["quantity"], found["refinement"]["target"]) == (FORCE, 0.05)
        assert found["element"]["degree"] == 3
        found = json.loads(command(path, "--json", "--target", 0.5, "--quantity", "energy", "--degree", 4).stdout)
        assert (found["refinement"]["quantity"], found["refinement"]["target"]) == ("energy", 0.5)
        assert found["element"]["degree"] == 4

    def test_what_is_wrong_is_named_by_its_path(self, tmp_path):
        path = plate(tmp_path, 0.2, refine_options={"quantity": "plate.force"})
        assert str(command(path).exception).startswith("refine.quantity: ")
        checked = CliRunner().invoke(group, ["check", str(path)])
        assert "refine: quantity = plate.force" in checked.stdout
        assert "degree" in str(command(path, "--quantity", "energy", "--degree", 12).exception)

    def test_load_steps_are_refused(self, tmp_path):
        done = command(plate(tmp_path, 0.2, times=[0.0, 1.0]))
        assert isinstance(done.exception, InputError)
        assert "history" in str(done.exception)


def test_progress_shows_the_last_round_beside_the_solve_under_way(monkeypatch):
    screen = io.StringIO()
    monkeypatch.setattr(terminal, "error_console", lambda: Console(file=screen, force_terminal=True, width=160))
    monkeypatch.setattr(solve_line, "_PATIENCE", 0.0)
    with solve_line.solving("plate") as advance:
        line = advance.__self__
        line.show()
        advance("216 unknowns, relative error 3.4e-03 (guaranteed)")
        tell(Progress("condensed"))
        line._bar.refresh()
    assert "216 unknowns, relative error 3.4e-03 (guaranteed); condensed: setting up" in screen.getvalue()
