"""The command `python -m comparisons`: what it refuses, and that it refuses before any work."""

import subprocess
import sys

import pytest

from comparisons.cli import group
from comparisons.paper import study
from qvi_contact.basics import terminal


@pytest.fixture
def no_work(monkeypatch):
    """Fail the test if anything is computed."""

    def run(_):
        pytest.fail("the study was started")

    monkeypatch.setattr(study, "run", run)


def refused(capfd, *arguments):
    """Standard error of a command that must end with status 2 and print nothing else."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["comparisons", *map(str, arguments)])
        with pytest.raises(SystemExit) as caught:
            terminal.run(group, "comparisons")
    out, err = capfd.readouterr()
    assert caught.value.code == 2
    assert out == ""
    return err


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize("place", ["file", "file/below", "/proc/below"])
@pytest.mark.parametrize("more", [(), ("--json",)])
def test_a_folder_that_cannot_be_written_is_refused_before_any_work(capfd, tmp_path, place, more):
    (tmp_path / "file").write_text("kept", encoding="utf-8")
    err = refused(capfd, "paper", "--out", tmp_path / place, *more)
    assert len(err.splitlines()) == 1
    assert err.startswith("comparisons: ")
    assert place.split("/")[0] in err
    assert (tmp_path / "file").read_text(encoding="utf-8") == "kept"


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize("arguments", [("papr",), ("paper", "--jsn"), ("paper", "extra"), ("paper", "--out")])
def test_what_is_unknown_is_one_line(capfd, arguments):
    err = refused(capfd, *arguments)
    assert len(err.splitlines()) == 1
    assert arguments[-1] in err


def test_module_runs():
    done = subprocess.run(
        [sys.executable, "-m", "comparisons", "--help"], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "paper" in done.stdout
    done = subprocess.run(
        [sys.executable, "-m", "comparisons", "nothing"], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.usefixtures("no_work")
def test_an_empty_folder_name_is_not_the_current_folder(capfd):
    assert "give the name of a folder" in refused(capfd, "paper", "--out", "")
