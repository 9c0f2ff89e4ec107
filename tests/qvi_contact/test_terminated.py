"""Commands ended by SIGTERM: nothing is left of them, neither files nor processes."""

import os
import signal
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from tests.run_processes import ROOT, eventually, marked, started

WRITING = """
import time, click
from qvi_contact.basics import terminal
from qvi_contact.basics.files import replacing

@click.command()
def write():
    with replacing("a.txt") as temporary:
        temporary.write_text("half")
        print("writing", flush=True)
        time.sleep(60.0)

terminal.run(write, "tool")
"""

pytestmark = pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="looks for processes in /proc")


def test_a_file_that_is_being_written(tmp_path):
    with started() as start:
        process = start("-c", WRITING, folder=tmp_path)
        assert process.stdout.readline() == "writing\n"
        assert len(list(tmp_path.glob(".*"))) == 1
        process.terminate()
        _, err = process.communicate(timeout=60)
        assert (process.returncode, err) == (143, "tool: terminated\n")
        assert list(tmp_path.iterdir()) == []


def rows_in(path):
    """How many rows a store has."""
    try:
        with closing(sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True)) as connection:
            return connection.execute("SELECT count(*) FROM results").fetchone()[0]
    except sqlite3.Error:
        return 0


def test_a_sweep_with_workers_all_of_which_get_the_signal(tmp_path):
    """As those of a service do."""
    store, plate = tmp_path / "a.sqlite", ROOT / "examples" / "compressed_plate.toml"
    words = ("-m", "qvi_contact", "solve", plate, "--set", "friction=0.1:0.9:400", "--store", store, "--workers", "2")
    with started() as start:
        process = start(*words, folder=tmp_path)
        assert eventually(lambda: rows_in(store) > 0)
        processes = marked(process.mark)
        assert len(processes) >= 3
        for number in sorted(processes, key=lambda number: number != process.pid):
            os.kill(number, signal.SIGTERM)
        _, err = process.communicate(timeout=60)
        assert process.returncode == 143
        assert "leaked" not in err
        assert err.splitlines()[-1] == "qvi-contact: terminated"
        assert eventually(lambda: not marked(process.mark), 10.0)
    assert list(tmp_path.rglob(".*")) == []
    assert rows_in(store) > 0
