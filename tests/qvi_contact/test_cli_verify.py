"""The command `qvi-contact verify`, and `qvi-contact solve --certificate`."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from qvi_contact import save_problem, solve
from qvi_contact.basics import terminal
from qvi_contact.cli import group
from qvi_contact.export import write_npz
from qvi_contact.files.archive import Archive
from qvi_contact.gallery import compressed_plate
from qvi_contact.units import Units

EXAMPLES = Path(__file__).parent.parent.parent / "examples"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A problem file, its result, and the result of an iteration that was cut short."""
    path = tmp_path_factory.mktemp("verify")
    save_problem(path / "plate.toml", compressed_plate(0.2, (3, 3)), title="The plate", units=Units("mm", "MPa"))
    write_npz(path / "plate.npz", solve(compressed_plate(0.2, (3, 3))))
    write_npz(
        path / "short.npz", solve(compressed_plate(0.2, (3, 3)), method="fixed-point", max_iterations=2, element="bfs")
    )
    return path


@pytest.fixture
def shell(capsys, monkeypatch):
    """Run the command in this process; exit status, standard output, standard error."""

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["qvi-contact", *map(str, arguments)])
        with pytest.raises(SystemExit) as caught:
            terminal.run(group, "qvi-contact")
        return (caught.value.code, *capsys.readouterr())

    return call


def test_what_solve_has_written_verifies(shell, folder, tmp_path):
    assert shell("solve", folder / "plate.toml", "--npz", tmp_path / "a.npz")[0] == 0
    status, out, err = shell("verify", tmp_path / "a.npz")
    assert (status, err) == (0, "")
    assert out.startswith("verified: ")
    assert len(out.splitlines()) == 1
    out = shell("verify", tmp_path / "a.npz", "-v")[1]
    assert out.splitlines()[-1].startswith("verified: ")
    assert "natural_map" in out
    assert "1/γ" in out
    assert 'title = "The plate"' in Archive(tmp_path / "a.npz").text("problem")


def test_as_json(shell, folder):
    status, out, err = shell("verify", folder / "plate.npz", "--json")
    assert (status, err) == (0, "")
    document = json.loads(out)
    assert document["passed"] is True
    assert document["failures"] == []
    names = [check["name"] for check in document["checks"]]
    assert names[:2] == ["digest", "status"]
    assert "plate: tractions" in names


def test_a_changed_file_is_status_1_and_says_what(shell, folder, tmp_path):
    entries = Archive(folder / "plate.npz").arrays
    stress = entries["plate.tangential_stress"]
    stress[np.abs(stress).argmax()] *= 1.0 + 1e-5
    np.savez(tmp_path / "a.npz", **entries)
    status, out, err = shell("verify", tmp_path / "a.npz")
    assert (status, err) == (1, "")
    assert out.splitlines()[-1] == "not verified: digest, plate: tractions"
    assert [line.split("  ")[0] for line in out.splitlines() if line.endswith("FAILED")] == [
        "digest",
        "plate: tractions",
    ]
    assert "natural_map" not in out
    assert json.loads(shell("verify", tmp_path / "a.npz", "--json")[1])["failures"] == ["digest", "plate: tractions"]


def test_the_tolerance_decides_what_is_good_enough(shell, folder):
    status, out, _ = shell("verify", folder / "short.npz")
    assert status == 1
    assert "energy_gap" in out.splitlines()[-1]
    assert shell("verify", folder / "short.npz", "--tolerance", "1e-3")[0] == 0


@pytest.mark.parametrize("tolerance", ["0", "2", "nan", "small"])
def test_bad_tolerance(shell, folder, tolerance):
    status, out, err = shell("verify", folder / "plate.npz", "--tolerance", tolerance)
    assert (status, out) == (2, "")
    assert "tolerance" in err


@pytest.mark.parametrize("kind", ["missing", "text", "truncated", "folder", "another archive", "another version"])
def test_bad_files_are_one_line_and_status_2(shell, folder, tmp_path, kind):
    path = tmp_path / "a.npz"
    entries = Archive(folder / "plate.npz").arrays
    if kind == "text":
        path.write_text("no archive")
    elif kind == "truncated":
        path.write_bytes((folder / "plate.npz").read_bytes()[:5000])
    elif kind == "folder":
        path.mkdir()
    elif kind == "another archive":
        np.savez(path, z=np.ones(3))
    elif kind == "another version":
        np.savez(path, **entries | {"format_version": np.array(99)})
    status, out, err = shell("verify", path)
    assert (status, out) == (2, "")
    assert err.startswith("qvi-contact: result: ")
    assert str(path) in err
    assert len(err.splitlines()) == 1


def test_solve_prints_the_certificate_on_request(shell, folder):
    status, out, err = shell("solve", folder / "plate.toml", "--certificate")
    assert (status, err) == (0, "")
    assert "alart_curnier" in out
    assert out.splitlines()[-1].startswith("verified: ")
    assert "alart_curnier" not in shell("solve", folder / "plate.toml")[1]


def test_and_has_it_in_its_document(shell, folder):
    document = json.loads(shell("solve", folder / "plate.toml", "--certificate", "--json")[1])
    assert document["verification"]["passed"] is True
    assert "verification" not in json.loads(shell("solve", folder / "plate.toml", "--json")[1])


def test_steps_of_a_history_are_verified_each(shell, tmp_path):
    path = tmp_path / "cycle.toml"
    text = (EXAMPLES / "cyclic_shear.toml").read_text(encoding="utf-8")
    text = text.replace("cells = 8", "cells = 4").replace("cells = 4", "cells = 2")
    path.write_text(text.replace("stop = 2.0, steps = 16", "stop = 0.5, steps = 2"), encoding="utf-8")
    status, out, err = shell("solve", path, "--certificate", "--npz", tmp_path / "a.npz")
    assert (status, err) == (0, "")
    assert [line.split(":")[0] for line in out.splitlines()[-3:]] == [
        f"step {n}, t = {t}" for n, t in ((1, 0), (2, 0.25), (3, 0.5))
    ]
    assert shell("verify", tmp_path / "a.npz")[0] == 0


def test_a_wrong_result_is_status_1(shell, folder, monkeypatch):
    """The certificate of the solve is not what decides: here the verification disagrees."""
    monkeypatch.setattr("qvi_contact.verification.verification.worse_than_claimed", lambda *_: 1.0)
    status, out, _ = shell("solve", folder / "plate.toml", "--certificate")
    assert status == 1
    assert out.splitlines()[-1] == "not verified: claimed measures"
