"""The command `qvi-contact`, and what all command lines of the project share."""

import io
import json
import subprocess
import sys
import time

import click
import pytest
from rich.console import Console

from qvi_contact import terminal
from qvi_contact.errors import InputError, SolveError
from solvers import available
from solvers.solve import METHODS

HEAVY = {"numpy", "scipy", "cvxpy", "matplotlib", "rich", "qpsolvers", "clarabel", "osqp"}


def command(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "qvi_contact", *arguments], capture_output=True, text=True, timeout=60, check=False
    )


def test_help_comes_at_once():
    def seconds():
        began = time.perf_counter()
        done = command("--help")
        assert done.returncode == 0
        assert "methods" in done.stdout
        assert done.stderr == ""
        return time.perf_counter() - began

    assert min(seconds() for _ in range(5)) < 0.5


@pytest.mark.parametrize("module", ["qvi_contact.cli", "comparisons.cli"])
def test_help_imports_nothing_heavy(module):
    code = f"""
import sys
from {module} import group
try:
    group.main(["--help"])
except SystemExit:
    print(*{{name.split(".")[0] for name in sys.modules}}, file=sys.stderr)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert "click" in done.stderr.split()
    assert HEAVY & set(done.stderr.split()) == set()


@pytest.mark.parametrize("arguments", [("solv",), ("--jsn",), ("methods", "--jsn"), ("methods", "extra")])
def test_what_is_unknown_is_one_line_and_status_2(arguments):
    done = command(*arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith("qvi-contact: ")
    assert arguments[-1] in done.stderr


def test_no_command_shows_the_commands_and_fails():
    done = command()
    assert done.returncode == 2
    assert done.stdout == ""
    assert "methods" in done.stderr
    assert "Traceback" not in done.stderr


def test_methods_as_one_json_document():
    done = command("methods", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout) == {"methods": list(METHODS), "inner": list(available())}


def test_methods_as_a_list():
    done = command("methods")
    assert done.returncode == 0
    assert set(METHODS) | set(available()) <= set(done.stdout.split())


def ending(capsys, raised):
    """Exit status and standard error of a command that raises."""

    @click.command()
    def failing():
        raise raised

    arguments = sys.argv
    sys.argv = ["tool"]
    try:
        with pytest.raises(SystemExit) as caught:
            terminal.run(failing, "tool")
    finally:
        sys.argv = arguments
    out, err = capsys.readouterr()
    assert out == ""
    return caught.value.code, err


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (InputError("Material.young", -1.0, "give a number greater than 0"), "Material.young: -1.0: give a number"),
        (SolveError("stalled\n  after 3\titerations"), "stalled after 3 iterations"),
        (click.UsageError("two\nlines"), "two lines"),
        (click.BadParameter("not a number"), "not a number"),
    ],
)
def test_wrong_input_is_one_line_and_status_2(capsys, error, words):
    status, err = ending(capsys, error)
    assert status == 2
    assert err.startswith("tool: ")
    assert words in err
    assert err.count("\n") == 1
    assert err.endswith("\n")


@pytest.mark.parametrize("error", [KeyboardInterrupt(), click.Abort()])
def test_an_interrupted_command_says_so(capsys, error):
    status, err = ending(capsys, error)
    assert status == 130
    assert err.split() == ["tool:", "interrupted"]


def test_a_fault_of_the_program_is_not_blamed_on_the_input(monkeypatch):
    @click.command()
    def failing():
        raise ZeroDivisionError

    monkeypatch.setattr(sys, "argv", ["tool"])
    with pytest.raises(ZeroDivisionError):
        terminal.run(failing, "tool")


def test_progress_is_silent_off_a_terminal(capfd):
    with terminal.progress("paper", 2) as advance:
        advance("first")
        advance()
    assert capfd.readouterr() == ("", "")


def test_progress_on_a_terminal_tells_the_step(monkeypatch):
    screen = io.StringIO()
    monkeypatch.setattr(terminal, "error_console", lambda: Console(file=screen, force_terminal=True, width=100))
    with terminal.progress("paper", 3) as advance:
        advance("μ = 0.10")
        advance("μ = 0.15")
    assert "paper: μ = 0.15" in screen.getvalue()
    assert "2/3" in screen.getvalue()
