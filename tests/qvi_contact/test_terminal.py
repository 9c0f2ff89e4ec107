"""What a command leaves on the terminal, and what becomes of output, signals and processes if something goes wrong."""

import errno
import io
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from unittest.mock import Mock

import click
import pytest

from qvi_contact import InputError, SolveError, solve
from qvi_contact.basics import solving
from qvi_contact.gallery import compressed_plate
from solvers.basics import Progress, report
from tests.run_tasks import eventually

ROOT = Path(__file__).parents[2]
FULL = Path("/dev/full")


def ending(shell, callback):
    """Exit status, standard output and standard error of a command that does this."""
    return shell(command=click.Command("tool", callback=callback), name="tool")


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (InputError("Material.young", -1.0, "give a number greater than 0"), "Material.young: -1.0: give a number"),
        (SolveError("stalled\n  after 3\titerations"), "stalled after 3 iterations"),
        (click.UsageError("two\nlines"), "two lines"),
        (click.BadParameter("not a number"), "not a number"),
        (MemoryError("for 18 GiB"), "out of memory (for 18 GiB)"),
        (MemoryError(), "out of memory (no details)"),
    ],
)
def test_wrong_input_is_one_line_and_status_2_and_no_answer_status_1(shell, error, words):
    status, out, err = ending(shell, Mock(side_effect=error))
    no_answer = isinstance(error, SolveError | MemoryError)
    assert (status, out, err.count("\n"), err[:6], err[-1]) == (2 - no_answer, "", 1, "tool: ", "\n")
    assert words in err


@pytest.mark.parametrize("error", [KeyboardInterrupt(), click.Abort()])
def test_an_interrupted_command_says_so(shell, error):
    status, out, err = ending(shell, Mock(side_effect=error))
    assert (status, out, err.split()) == (130, "", ["tool:", "interrupted"])


def test_a_fault_of_the_program_is_not_blamed_on_the_input(shell):
    with pytest.raises(ZeroDivisionError):
        ending(shell, Mock(side_effect=ZeroDivisionError))


SCRIPT = """
import sys, click
from qvi_contact.basics.terminal import error_console, run

@click.command()
@click.option("--lines", default=1)
@click.option("--rich", is_flag=True)
@click.option("--late", is_flag=True)
@click.option("--told", is_flag=True)
def write(lines, rich, late, told):
    from rich.console import Console
    if told:
        error_console().print("progress")
        print("what -v says", file=sys.stderr)
    for number in range(lines):
        sys.stdout.write("words\\n") if late else Console().print("words") if rich else click.echo("words")

run(write, "tool")
"""


def piped(*arguments, python=(), **streams):
    """The script's process, with these streams; they have buffers unless Python's options say otherwise."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    words = [sys.executable, *python, "-c", SCRIPT, *arguments]
    return subprocess.Popen(words, cwd=ROOT, env=environment, stderr=subprocess.PIPE, text=True, **streams)


@pytest.mark.skipif(not FULL.exists(), reason="needs /dev/full")
@pytest.mark.parametrize(
    ("arguments", "python"), [(["--rich"], []), (["--late", "--lines", "9999"], ["-u"])], ids=["rich", "unbuffered"]
)
def test_a_full_standard_output(arguments, python):
    with FULL.open("w", encoding="utf-8") as full, piped(*arguments, python=python, stdout=full) as process:
        _, err = process.communicate(timeout=60)
    assert err.startswith("tool: standard output: ")
    assert os.strerror(errno.ENOSPC) in err
    assert (process.returncode, len(err.splitlines())) == (2, 1)


def test_a_closed_pipe_is_silent_and_an_answer_the_same_where_nobody_reads_standard_error():
    with piped("--late", "--lines", "9", stdout=subprocess.PIPE) as process:
        process.stdout.close()
        err = process.stderr.read()
    assert (process.returncode, err) == (1, "")
    with piped("--told", stdout=subprocess.PIPE) as process:
        process.stderr.close()
        out = process.stdout.read()
    assert (process.returncode, out) == (0, "words\n")


def broken(number):
    """A stream that fails."""
    stream = io.StringIO()
    stream.write = Mock(side_effect=OSError(number, os.strerror(number)))
    return stream


@pytest.mark.parametrize(("number", "status", "words"), [(errno.EIO, 2, os.strerror(errno.EIO)), (errno.EPIPE, 1, "")])
def test_why_it_cannot_be_written(shell, number, status, words):
    stream = broken(number)
    with redirect_stdout(stream):
        found, _, err = ending(shell, lambda: print("words"))
        assert sys.stdout is stream
    assert (found, len(err.splitlines())) == (status, bool(words))
    assert words in err


def test_another_file_that_fails_is_not_taken_for_it(shell):
    with pytest.raises(OSError, match=os.strerror(errno.ENOSPC)):
        ending(shell, lambda: broken(errno.ENOSPC).write("words"))


def test_without_a_standard_output_or_a_place_to_complain_at(shell):
    with redirect_stdout(None):
        assert ending(shell, lambda: click.echo("words")) == (0, "", "")
    with redirect_stdout(broken(errno.ENOSPC)), redirect_stderr(broken(errno.ENOSPC)):
        assert ending(shell, lambda: print("words"))[0] == 2


def test_a_terminal_without_greek_gets_question_marks(shell):
    screen = io.BytesIO()
    with redirect_stdout(io.TextIOWrapper(screen, encoding="latin-1")) as stream:
        status, _, err = shell("check", ROOT / "examples" / "punch.toml")
        stream.flush()
    assert (status, err) == (0, "")
    assert b"? = 0.3" in screen.getvalue()


def test_a_solve_under_way_is_shown_on_a_terminal(environ):
    """Method, iteration and residual beside the last round; that one method takes the place of another one stays."""
    environ(FORCE_COLOR=1, COLUMNS=160)
    with redirect_stderr(io.StringIO()) as screen, solving("[plate]", 3, silence=0.0) as advance:
        assert eventually(lambda: "[plate]" in screen.getvalue())
        advance("216 unknowns")
        report(Progress("fixed-point", remark="the condensed method ended stalled"))
        solve(compressed_plate(0.2, (3, 3)))
    found = screen.getvalue()
    assert "1/3" in found
    assert re.search(r"216 unknowns; pivoting: iteration \d+, residual \d\.\de-", found)
    assert "the condensed method ended stalled; next method: fixed-point\n" in found


def test_off_a_terminal_it_is_silent(capfd, monkeypatch):
    monkeypatch.setattr("qvi_contact.basics.terminal._PATIENCE", 0.0)
    with solving("plate") as advance:
        solve(compressed_plate(0.2, (3, 3)))
        report(Progress("fixed-point", remark="the condensed method ended stalled"))
        advance()
        time.sleep(0.3)
    assert capfd.readouterr() == ("", "")


SIGNALS = """
import ctypes, faulthandler, os, signal, threading
from solvers.basics import handlers_kept

heard = []
signal.signal(signal.SIGTERM, lambda *_: heard.append("SIGTERM"))
faulthandler.enable()

def careless():
    with handlers_kept():
        for number in (signal.SIGPIPE, signal.SIGTERM, signal.SIGSEGV):
            assert library.signal(int(number), None) != -1

library = ctypes.CDLL(None)
library.signal.argtypes, library.signal.restype = (ctypes.c_int, ctypes.c_void_p), ctypes.c_ssize_t
thread = threading.Thread(target=careless)
thread.start()
thread.join()
os.kill(os.getpid(), signal.SIGTERM)
reading, writing = os.pipe()
os.close(reading)
try:
    os.write(writing, b"nobody reads this")
except BrokenPipeError:
    print(heard, flush=True)
os.kill(os.getpid(), signal.SIGSEGV)
"""


@pytest.mark.skipif(os.name != "posix", reason="there is nothing to keep")
def test_handlers_of_signals_are_kept_in_any_thread_and_not_only_those_of_python():
    done = subprocess.run([sys.executable, "-c", SIGNALS], capture_output=True, text=True, check=False)
    assert done.stdout == "['SIGTERM']\n", done
    assert done.returncode == -signal.SIGSEGV
    assert "Segmentation fault" in done.stderr  # of faulthandler
