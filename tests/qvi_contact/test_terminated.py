"""Commands ended by SIGTERM: nothing is left of them, neither files nor processes."""

import os
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MARK = "QVI_CONTACT_TERMINATED_TEST"  # in the environment of a command and of all that it starts
WRITING = """
import time, click
from qvi_contact.basics import terminal
from solvers.basics.files import replacing

@click.command()
def write():
    with replacing("a.txt") as temporary:
        temporary.write_text("half")
        print("writing", flush=True)
        time.sleep(60.0)

terminal.run(write, "tool")
"""

pytestmark = pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="looks for processes in /proc")


def eventually(true, seconds=60.0):
    end = time.monotonic() + seconds
    while not true() and time.monotonic() < end:
        time.sleep(0.05)
    return true()


def marked(mark):
    """Processes with this mark."""
    found = []
    for place in Path("/proc").iterdir():
        try:
            if place.name.isdigit() and f"{MARK}={mark}".encode() in (place / "environ").read_bytes().split(b"\0"):
                found.append(int(place.name))
        except OSError:  # of another user, or gone
            continue
    return found


@pytest.fixture
def begun(tmp_path):
    """Start Python with these arguments in a folder; nothing of it outlives the test."""
    started = []

    def begin(*arguments):
        environment = {**os.environ, MARK: tmp_path.name, "PYTHONPATH": str(ROOT)}
        words = [sys.executable, *map(str, arguments)]
        pipe = subprocess.PIPE
        started.append(subprocess.Popen(words, cwd=tmp_path, env=environment, stdout=pipe, stderr=pipe, text=True))
        return started[-1]

    yield begin
    for process in started:
        process.kill()
        process.communicate()
    assert eventually(lambda: not marked(tmp_path.name), 10.0)


def hidden(folder):
    return [path.name for path in folder.rglob(".*")]


def test_a_file_that_is_being_written(begun, tmp_path):
    process = begun("-c", WRITING)
    assert process.stdout.readline() == "writing\n"
    assert len(hidden(tmp_path)) == 1
    process.terminate()
    _, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (143, "tool: terminated\n")
    assert list(tmp_path.iterdir()) == []


def rows_in(path, table):
    """How many rows a store has."""
    try:
        with closing(sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True)) as connection:
            return connection.execute(f'SELECT count(*) FROM "{table}"').fetchone()[0]
    except sqlite3.Error:
        return 0


@pytest.mark.parametrize("everybody", [False, True])
def test_a_sweep_with_workers(begun, tmp_path, everybody):
    """Also where all processes get the signal, as those of a service do."""
    store, plate = tmp_path / "a.sqlite", ROOT / "examples" / "compressed_plate.toml"
    process = begun(
        "-m", "qvi_contact", "solve", plate, "--set", "friction=0.1:0.9:400", "--store", store, "--workers", "2"
    )
    assert eventually(lambda: rows_in(store, "results") > 0)
    processes = marked(tmp_path.name)
    assert len(processes) >= 3
    for number in sorted(processes, key=lambda number: number != process.pid) if everybody else [process.pid]:
        os.kill(number, signal.SIGTERM)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 143
    assert "leaked" not in err
    assert err.splitlines()[-1] == "qvi-contact: terminated"
    assert eventually(lambda: not marked(tmp_path.name), 10.0)
    assert hidden(tmp_path) == []
    assert rows_in(store, "results") > 0


def test_a_study_with_workers(begun, tmp_path):
    pytest.importorskip("markdown_it")
    pytest.importorskip("pandas")
    words = ("-m", "comparisons", "convergence-outer", "--workers", "2", "--store", "kept/rows.sqlite", "--out", "told")
    process = begun(*words)
    assert eventually(lambda: any(rows_in(path, "rows") for path in tmp_path.glob("kept/*.sqlite")))
    process.terminate()
    _, err = process.communicate(timeout=60)
    assert process.returncode == 143
    assert "leaked" not in err
    assert eventually(lambda: not marked(tmp_path.name), 10.0)
    assert hidden(tmp_path) == []
