"""What is no argument of a function at all ends in the project's own exception, of one line, wherever it is given."""

import re

import numpy as np
import pytest

from qvi_contact import (
    InputError,
    TriangleMesh,
    load_problem,
    load_result,
    read_sweep,
    save_problem,
    solve_history,
    stream_sweep,
)
from qvi_contact.gallery import compressed_plate

PLATE = compressed_plate(0.3, (2, 2))
OBJECTS = [None, np.nan, -1, 2.5, 1j, True, b"x", [], ["x"], {}, {"x": 1}, np.array([1.0, 2.0]), object(), print, float]


def refused(use, value, field):
    """The call ends in one line that begins with the field."""
    with pytest.raises(InputError, match=rf"^{re.escape(field)}: ") as caught:
        use(value)
    assert "\n" not in str(caught.value)
    assert caught.value.remedy


PATHS = {
    "file": load_problem,
    "result": load_result,
    "store": read_sweep,
    "mesh": TriangleMesh.load,
    "output": lambda path: save_problem(path, PLATE),
    "store of a sweep": lambda path: stream_sweep(PLATE, "friction", [0.1], path),
    "store of a history": lambda path: solve_history([PLATE], store=path),
}


@pytest.mark.parametrize("value", OBJECTS, ids=repr)
@pytest.mark.parametrize("entry", PATHS)
def test_paths_are_texts_or_paths(entry, value):
    if value is None and entry == "store of a history":
        return  # which needs none
    refused(PATHS[entry], value, entry.split()[0])


@pytest.mark.parametrize("name", ["a\0b", "a\ud800b"])
@pytest.mark.parametrize("entry", PATHS)
def test_names_that_no_file_can_have(entry, name, tmp_path):
    refused(PATHS[entry], f"{tmp_path}/{name}.msh", entry.split()[0])
