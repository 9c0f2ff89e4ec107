"""A standard output that cannot be written is one line on standard error; a reader that has gone away is no fault."""

import errno
import io
import os
import subprocess
import sys
from pathlib import Path

import click
import pytest

from qvi_contact.basics import terminal

FULL = Path("/dev/full")
SCRIPT = """
import sys, click
from qvi_contact.basics.terminal import run

@click.command()
@click.option("--lines", default=1)
@click.option("--rich", is_flag=True)
@click.option("--late", is_flag=True)
def write(lines, rich, late):
    from rich.console import Console
    for number in range(lines):
        sys.stdout.write("words\\n") if late else Console().print("words") if rich else click.echo("words")

run(write, "tool")
"""


def piped(*arguments, python=(), **streams):
    """The script's process, with these streams; they have buffers unless Python's options say otherwise."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    words = [sys.executable, *python, "-c", SCRIPT, *arguments]
    root = Path(__file__).parents[2]
    return subprocess.Popen(words, cwd=root, env=environment, stderr=subprocess.PIPE, text=True, **streams)


@pytest.mark.skipif(not FULL.exists(), reason="needs /dev/full")
@pytest.mark.parametrize(
    ("arguments", "python"),
    [(["--help"], []), (["--rich"], []), (["--late"], []), (["--late", "--lines", "9999"], []), (["--late"], ["-u"])],
    ids=["help", "rich", "late", "long", "unbuffered"],
)
def test_a_full_standard_output(arguments, python):
    with FULL.open("w", encoding="utf-8") as full, piped(*arguments, python=python, stdout=full) as process:
        _, err = process.communicate(timeout=60)
    assert err == "tool: standard output: cannot be written (No space left on device)\n"
    assert process.returncode == 2


@pytest.mark.parametrize("arguments", [["--rich"], ["--late"], []])
def test_a_closed_pipe_is_silent(arguments):
    with piped(*arguments, "--lines", "9", stdout=subprocess.PIPE) as process:
        process.stdout.close()
        err = process.stderr.read()
    assert err == ""
    assert process.returncode == 1


class Broken(io.StringIO):
    """A stream that fails."""

    def __init__(self, number):
        super().__init__()
        self.number = number

    def write(self, _):
        raise OSError(self.number, os.strerror(self.number))


def ending(monkeypatch, capsys, callback, stdout):
    """Exit status and standard error of a command that does this, with that standard output."""
    monkeypatch.setattr(sys, "argv", ["tool"])
    monkeypatch.setattr(sys, "stdout", stdout)
    with pytest.raises(SystemExit) as caught:
        terminal.run(click.Command("tool", callback=callback), "tool")
    assert sys.stdout is stdout
    return caught.value.code, capsys.readouterr().err


@pytest.mark.parametrize(
    ("number", "status", "words"), [(errno.EIO, 2, "cannot be written (Input/output error)"), (errno.EPIPE, 1, "")]
)
def test_why_it_cannot_be_written(monkeypatch, capsys, number, status, words):
    found, err = ending(monkeypatch, capsys, lambda: print("words"), Broken(number))
    assert found == status
    assert words in err
    assert len(err.splitlines()) == bool(words)


def test_another_file_that_fails_is_not_taken_for_it(monkeypatch, capsys):
    with pytest.raises(OSError, match="No space") as caught:
        ending(monkeypatch, capsys, lambda: Broken(errno.ENOSPC).write("words"), io.StringIO())
    assert caught.value.errno == errno.ENOSPC


def test_without_a_standard_output(monkeypatch, capsys):
    assert ending(monkeypatch, capsys, lambda: click.echo("words"), None) == (0, "")


def test_no_place_to_complain_at(monkeypatch, capsys):
    monkeypatch.setattr(sys, "stderr", Broken(errno.ENOSPC))
    assert ending(monkeypatch, capsys, lambda: print("words"), Broken(errno.ENOSPC))[0] == 2
