"""What is no argument of a function at all ends in the project's own exception, of one line, wherever it is given."""

import re
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qvi_contact import (
    Corner,
    InputError,
    RectilinearMesh,
    SweepRow,
    TriangleMesh,
    discretize,
    graded_lines,
    limit_load_factor,
    load_problem,
    load_result,
    loop_area,
    principal_stresses,
    read_sweep,
    refine,
    refined_where_apart,
    save_problem,
    solve,
    solve_companion,
    solve_history,
    solve_sweep,
    stream_sweep,
)
from qvi_contact.gallery import compressed_plate


class Odd:
    """An object of no kind, called the same in all processes of a run."""

    def __repr__(self):
        return "Odd()"


PLATE = compressed_plate(0.3, (2, 2))
OBJECTS = [None, np.nan, -1, 2.5, 1j, True, b"x", [], ["x"], {}, {"x": 1}, np.array([1.0, 2.0]), Odd(), print, float]


def refused(use, value, field):
    """The call ends in one line that begins with the field."""
    with pytest.raises(InputError, match=rf"^{re.escape(field)}(\[.*\])?: ") as caught:
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


NO_TRUTH = [None, 2, -1, 0.5, np.nan, "no", "", [], [1], np.array([1.0, 2.0]), np.array([True]), Odd()]
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


PRESSURES = ["high", [1.0, np.nan], np.inf, 1j, ["x"], {}, Odd(), 10**400]
STARTED = {
    "solve": lambda start: solve(PLATE, initial=start),
    "fixed point": lambda start: solve(PLATE, method="fixed-point", initial=start),
    "sweep": lambda start: solve_sweep(PLATE, "friction", [0.1], initial=start),
    "history": lambda start: solve_history([PLATE], initial=start),
}


@pytest.mark.parametrize("start", PRESSURES, ids=repr)
@pytest.mark.parametrize("entry", STARTED)
def test_starts_that_cannot_be_are_refused_before_anything_is_computed(entry, start, monkeypatch):
    monkeypatch.setattr("qvi_contact.discretization.discretization._discretized", None)
    refused(STARTED[entry], start, "initial")


@pytest.mark.parametrize("shape", [(), (5,), (2, 3)])
@pytest.mark.parametrize("entry", STARTED)
def test_starts_of_another_shape_are_shown_as_they_were_given(entry, shape):
    with pytest.raises(InputError, match=r"^initial: .*7\.25.*6 contact points") as caught:
        STARTED[entry](np.full(shape, 7.25))
    assert np.array_equal(caught.value.value, np.full(shape, 7.25))


def refusals():
    """What each of these takes is given by `ALWAYS_WRONG`."""
    known = tables()[2].__self__
    return {
        "contact_rows": lambda rows: discretize(PLATE, contact_rows=rows),
        "contact_rows on rectangles": lambda rows: discretize(PLATE, element="bfs", contact_rows=rows),
        "scales": lambda scales: discretize(PLATE, scales=scales),
        "freed": lambda freed: discretize(PLATE, freed=freed),
        "problem": known.discretization.following,
        "problem of marks": lambda problem: refined_where_apart(problem, None),
        "dask": lambda address: stream_sweep(PLATE, "friction", [0.1], "never", dask=address),
        "workers": lambda workers: stream_sweep(PLATE, "friction", [0.1], "never", workers=workers),
        "stress": principal_stresses,
        "displacement": lambda displacement: loop_area(displacement, [0.0, 1.0]),
        "force": lambda force: loop_area([0.0, 1.0], force),
        "result": lambda result: SweepRow.of(1, 1.0, result),
    }


ALWAYS_WRONG = ["rough", 2.5, -1, np.nan, 1j, Odd(), [[0.5]], np.array([[1.0, np.nan]]), 10**400, {"x": 1}]


@pytest.mark.parametrize("value", ALWAYS_WRONG, ids=repr)
@pytest.mark.parametrize("entry", refusals())
def test_arguments_of_no_kind(entry, value):
    refused(refusals()[entry], value, entry.split()[0])


def test_vertices_given_up_are_vertices():
    for freed in ([-1], [99], [0.5], [[0]], ["0"]):
        refused(lambda value: discretize(PLATE, freed=value), freed, "freed")
    assert discretize(PLATE, freed=[0, 2]).freed.tolist() == [0, 2]


@pytest.mark.parametrize("field", ["solve_options", "refine_options"])
def test_options_of_problem_files_have_names(field, tmp_path):
    refused(lambda options: save_problem(tmp_path / "plate.toml", PLATE, **{field: options}), {1: 2}, field)


@given(st.lists(st.floats(-10.0, 10.0), min_size=2, max_size=6), st.integers(1, 4))
def test_areas_of_loops_need_as_many_forces_as_displacements(displacement, more):
    with pytest.raises(InputError, match=r"^force: "):
        loop_area(displacement, [1.0] * (len(displacement) + more))
    assert loop_area(displacement, [1.0] * len(displacement)) == pytest.approx(displacement[-1] - displacement[0])


SQUARE = RectilinearMesh.rectangle((2, 2))
CUT = TriangleMesh.of_rectangles(SQUARE)
OUTLINE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]
MESHES = {
    "TriangleMesh.edge_sets": lambda sets: TriangleMesh(CUT.vertices, CUT.cells, sets),
    "TriangleMesh.regions": lambda sets: TriangleMesh(CUT.vertices, CUT.cells, {}, sets),
    "TriangleMesh.arcs": lambda arcs: TriangleMesh(CUT.vertices, CUT.cells, arcs=arcs),
    "mesh": TriangleMesh.of_rectangles,
    "joints": lambda joints: TriangleMesh.outline(OUTLINE, 0.5, joints=joints),
    "regions": lambda regions: TriangleMesh.outline(OUTLINE, 0.5, regions=regions),
    "sizes": lambda sizes: TriangleMesh.outline(OUTLINE, 0.5, sizes=sizes),
    "coarse": CUT.parents,
    "name": CUT.numbers,
    "cells": CUT.part,
    "edge_sets": lambda sets: CUT.part([0, 1], sets),
    "points": lambda points: CUT.graded(points, 1),
    "points to locate": CUT.locate,
    "depth": lambda depth: CUT.graded([[0.0, 0.0]], depth),
    "marked": CUT.refined,
    "here": lambda where: CUT.with_region("here", where),
    "x, y": lambda x: tables()[2].__self__.displacement(x, 0.5),
}


@pytest.mark.parametrize("value", [np.nan, -1.5, 1j, "text", Odd(), [[1, 2], [3]], [Odd()], 10**400, 1e308], ids=repr)
@pytest.mark.parametrize("entry", MESHES)
def test_meshes_are_made_of_what_they_are_made_of(entry, value):
    refused(MESHES[entry], value, entry.split(" to ")[0])


@given(st.floats(allow_nan=True, allow_infinity=True), st.floats(allow_nan=True, allow_infinity=True))
def test_any_point_is_in_a_triangle_or_outside(x, y):
    inside = 0.0 <= x <= 1.0 and 0.0 <= y <= 1.0
    assert (CUT.locate([[x, y]])[0] >= 0) == inside or min(abs(x), abs(x - 1.0), abs(y), abs(y - 1.0)) < 1e-8


@pytest.mark.parametrize("points", [[], np.zeros((0, 2))])
def test_no_points_are_nowhere(points):
    assert CUT.locate(points).shape == (0,)
    displacement = tables()[2].__self__.displacement
    assert displacement(np.zeros((3, 0)), 0.5).shape == (3, 0, 2)


HUGE = {
    "grading": lambda: graded_lines(0.0, 1.0, 3, 1e308),
    "grading of ends": lambda: graded_lines(-1e308, 1e308, 3),
    "RectilinearMesh.x": lambda: RectilinearMesh.rectangle((2, 2), width=1e308),
    "RectilinearMesh.y": lambda: RectilinearMesh([0.0, 1.0], [0.0, 1e308]),
    "TriangleMesh.vertices": lambda: TriangleMesh([[0.0, 0.0], [1e308, 0.0], [0.0, 1e308]], [[0, 1, 2]]),
    "size": lambda: TriangleMesh.outline(OUTLINE, 1e308),
    "edge_sets": lambda: CUT.part([0, 1], {"x": 1}),
    "cells": lambda: RectilinearMesh.rectangle((10**6, 10**6)),
    "cells of triangles": lambda: TriangleMesh.rectangle((10**5, 10**5)),
}


@pytest.mark.parametrize("entry", HUGE)
def test_what_is_too_large_is_refused_before_it_is_made(entry):
    refused(lambda _: HUGE[entry](), None, entry.split(" of ")[0])
