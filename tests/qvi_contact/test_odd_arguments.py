"""What is no argument of a function at all ends in the project's own exception, of one line, wherever it is given."""

import re
from functools import cache

import numpy as np
import pytest

from qvi_contact import (
    Corner,
    InputError,
    TriangleMesh,
    graded_lines,
    limit_load_factor,
    load_problem,
    load_result,
    read_sweep,
    refine,
    save_problem,
    solve,
    solve_companion,
    solve_history,
    solve_sweep,
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


@pytest.mark.parametrize("units", [*OBJECTS[1:], "mm", ("mm", "MPa")], ids=repr)
def test_units_of_tables_are_units(units):
    for table in tables():
        refused(table, units, "units")


@cache
def tables():
    """All that makes tables."""
    history, sweep = solve_history([PLATE]), solve_sweep(PLATE, "gap", [0.0])
    step = history.steps[0]
    return (history.to_frame, sweep.to_frame, step.to_frame, step.forces_frame, step.contacts["plate"].to_frame)


NO_TRUTH = [None, 2, -1, 0.5, np.nan, "no", "", [], [1], np.array([1.0, 2.0]), np.array([True]), object()]
FLAGS = {
    "verbose": lambda flag: solve(PLATE, verbose=flag),
    "verbose of a sweep": lambda flag: solve_sweep(PLATE, "friction", [0.1], verbose=flag),
    "verbose of a limit": lambda flag: limit_load_factor(PLATE, ["body"], verbose=flag),
    "verbose of displacements": lambda flag: solve_companion(PLATE, verbose=flag),
    "throw": lambda flag: solve(PLATE, throw=flag),
    "throw of a history": lambda flag: solve_history([PLATE], throw=flag),
    "warm_start": lambda flag: solve_history([PLATE], warm_start=flag),
    "warm_start of a sweep": lambda flag: solve_sweep(PLATE, "friction", [0.1], warm_start=flag),
    "guaranteed": lambda flag: refine(PLATE, guaranteed=flag),
    "both_ends": lambda flag: graded_lines(0.0, 1.0, 3, both_ends=flag),
    "Corner.clockwise": lambda flag: Corner((0.0, 0.0), clockwise=flag),
}


@pytest.mark.parametrize("flag", NO_TRUTH, ids=repr)
@pytest.mark.parametrize("entry", FLAGS)
def test_flags_are_true_or_false(entry, flag):
    refused(FLAGS[entry], flag, entry.split()[0])


@pytest.mark.parametrize("flag", [True, np.True_, 1])
def test_numbers_that_are_true_count_as_true(flag):
    assert graded_lines(0.0, 1.0, 3, 0.5, flag).tolist() == graded_lines(0.0, 1.0, 3, 0.5, True).tolist()


@pytest.mark.parametrize("rounds", [0.5, 1.5, 0, -1, np.inf, 1e308, "2"])
def test_rounds_of_a_refinement_are_counted(rounds):
    refused(lambda value: refine(PLATE, max_rounds=value), rounds, "max_rounds")
