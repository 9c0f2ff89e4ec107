"""What is no argument of a function ends in one line about the field, wherever it is given, before anything is done."""

import pydoc
import re
import warnings
from dataclasses import fields, is_dataclass
from functools import cache
from itertools import product

import numpy as np
import pytest

import qvi_contact
from qvi_contact import Corner, Expression, InputError, QVIError, Settings, TriangleMesh, discretize, graded_lines
from qvi_contact.bracket import bracket
from qvi_contact.companion import solve_companion
from qvi_contact.element import hsieh_clough_tocher
from qvi_contact.export import write_collapse_vtu, write_json, write_npz, write_vtu
from qvi_contact.files import load_problem, load_result, problem_from_toml, problem_to_toml, save_problem
from qvi_contact.gallery import compressed_plate, jointed_slope, masonry_wall, stick_slip_block
from qvi_contact.limit import limit_load_factor, limit_proof, strength_reduction_factor
from qvi_contact.plots import history_figure, limit_figure, problem_figure, result_figure, save_figure
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, Polynomial, Region, Symmetry, Traction
from qvi_contact.refinement import refine
from qvi_contact.solution import History, loop_area, principal_stresses, read_sweep, solve, solve_history, solve_sweep
from qvi_contact.units import Units
from solvers import solve_qvi

PLATE = compressed_plate(0.3, (2, 2))
CUT = TriangleMesh.grid([0.0, 0.5, 1.0], [0.0, 0.5, 1.0], joints={"joint": ((0.0, 0.5), (1.0, 0.5))})
HELD = [Displacement(side, 0.0, 0.0) for side in CUT.edge_names]
OUTLINE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]


class Odd:
    """An object of no kind, called the same in all processes of a run."""

    def __repr__(self):
        return "Odd()"


def refused(use, value, field):
    """The call ends in one line that begins with the field."""
    with pytest.raises(QVIError, match=rf"^{re.escape(field)}(\[.*\])?: ") as caught:
        use(value)
    assert "\n" not in str(caught.value)
    assert caught.value.remedy


@cache
def step():
    """The only step of a history."""
    return solve_history([PLATE]).steps[0]


@pytest.fixture(autouse=True)
def _imaginary_parts_are_dropped_in_silence():
    """As they are for users, who do not make errors of warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def computed(*_):
    raise AssertionError("something was computed first")


UNTOUCHED = compressed_plate(computed, (2, 2))
"""A problem whose friction nobody may ask for."""

ENTRIES = {
    "solve": lambda _, **options: solve(UNTOUCHED, **options),
    "fixed point": lambda _, **options: solve(UNTOUCHED, **{"method": "fixed-point"} | options),
    "sweep": lambda _, **options: solve_sweep(UNTOUCHED, "gap", [0.1, 0.2], **options),
    "stream": lambda path, **options: solve_sweep(UNTOUCHED, "gap", [0.1], store=path / "rows.sqlite", **options),
    "history": lambda _, **options: solve_history([UNTOUCHED, UNTOUCHED], **options),
    "refine": lambda _, **options: refine(UNTOUCHED, **options),
}
WRONG = {
    "tolerance": "1e-8", "callback": 3, "factorisation": "pen and paper", "threads": 0, "max_iterations": 0,
    "gap": 2.0, "colour": "red", "method": "guess", "inner": "guess", "time_limit": 0.0,
}  # fmt: skip


@pytest.mark.parametrize("entry", ENTRIES)
def test_wrong_options_are_refused_at_once(entry, tmp_path):
    for option, wrong in WRONG.items():
        refused(lambda value, option=option: ENTRIES[entry](tmp_path, **{option: value}), wrong, option)


@pytest.mark.parametrize("use", [limit_load_factor, limit_proof, strength_reduction_factor, discretize])
def test_unknown_options_of_limits_are_refused_as_those_of_solves(use):
    given = [UNTOUCHED] if use in (strength_reduction_factor, discretize) else [UNTOUCHED, ["body"]]
    unknown = {"colour": "red", "contact_rows": "gauss"} | ({} if use is discretize else {"law_on": "points"})
    for option, wrong in unknown.items():
        refused(lambda value, option=option: use(*given, **{option: value}), wrong, option)
    with pytest.raises(InputError, match="did you mean 'degree'"):
        use(*given, degre=5)


def test_help_has_the_texts_of_all_fields():
    for kind in filter(is_dataclass, [getattr(qvi_contact, name) for name in qvi_contact.__all__]):
        shown = pydoc.plain(pydoc.render_doc(kind))
        assert {each.name for each in fields(kind) if shown.count(f" |  {each.name}: ") != 1} <= {"in_files"}


def test_wrong_options_of_a_bracket_the_algebraic_solve_and_tables():
    refused(lambda given: bracket(step(), given), 99, "degree")
    for units, table in product((*OBJECTS[1:], "mm", ("mm", "MPa")), tables()):
        refused(table, units, "units")
    for tolerance in ("1e-8", 0.0, 1.0):
        refused(lambda given: solve_qvi(step().discretization.qvi, tolerance=given), tolerance, "tolerance")


@pytest.mark.parametrize("entry", ["solve", "fixed point", "sweep", "history"])
def test_starts_that_cannot_be_are_refused_at_once(entry, tmp_path):
    for start in ("high", [1.0, np.nan], np.inf, 1j, ["x"], {}, Odd(), 10**400):
        refused(lambda value: ENTRIES[entry](tmp_path, initial=value), start, "initial")
    refused(lambda value: ENTRIES[entry](tmp_path, method="condensed", inner=value), "qp:clarabel", "inner")
    refused(lambda value: ENTRIES[entry](tmp_path, method="fixed-point", inner_options=value), 1.0, "inner_options")
    one, same, other = (Settings(initial=np.ones(2) + shift, options={"gap": 1e-9}) for shift in (0.0, 0.0, 1e-9))
    assert one == same != other
    assert hash(one) == hash(same)


@pytest.mark.parametrize(
    "use",
    [Symmetry, lambda name: Traction(name, x=0.0), lambda name: Displacement(name, x=0.0),
     lambda name: Contact(name, 0.3), lambda name: Contact("top", 0.3, name=name),
     lambda name: Contact("top", 0.3, law=name), lambda name: Material(1.0, 0.3, plane=name),
     lambda name: TriangleMesh.grid([0, 1], [0, 1], edges={"new": name}),
     lambda name: limit_load_factor(PLATE, [name]), lambda name: step().resultant([name]), CUT.edges, CUT.edge_set,
     CUT.joint_set, CUT.region, lambda name: TriangleMesh.joined(name, [CUT]),
     lambda name: CUT.with_edges(name, [[0, 1]]), lambda name: CUT.with_region(name, [0])],
)  # fmt: skip
def test_names_are_texts(use):
    for name in (np.array(["top", "bottom"]), np.array(["top"]), ["top"], b"top", None, 1):
        with pytest.raises(InputError):
            use(name)


@pytest.mark.parametrize(
    "use",
    [lambda value: TriangleMesh.grid(value, [0.0, 1.0]), lambda value: TriangleMesh(value, CUT.cells),
     lambda value: TriangleMesh(CUT.vertices, value), CUT.locate,
     lambda value: Polynomial([value] if np.ndim(value) else [[value]]), lambda value: Contact("top", friction=value),
     lambda value: Material(value, 0.3), lambda value: Expression("t", t=value),
     lambda value: Expression("a", {"a": value}), lambda value: Expression("1", value),
     lambda value: solve(PLATE, damping=value),
     lambda value: step().stress(value if np.iscomplexobj(value) else 1j, 0.5)],
)  # fmt: skip
def test_numbers_are_real(use):
    numbers = 0.5 + 1j, np.complex128(0.5 + 1j), np.array([0.0, 0.5 + 1j, 1.0]), [0.0, np.complex64(0.5 + 1j), 1.0]
    hidden, seconds = np.ma.masked_less([0.5, 1.0], 0.7), np.timedelta64(1, "s")
    for value in (*numbers, hidden, seconds, "0.5", ["0.0", "1.0"], 10**400, None):
        with pytest.raises(InputError):
            use(value)


def test_a_time_out_in_a_function_goes_on():
    def slow(*_):
        raise TimeoutError("time is over")

    with pytest.raises(TimeoutError, match="time is over"):
        solve(compressed_plate(slow, (2, 2)))


@pytest.mark.parametrize(
    "use",
    [lambda: limit_load_factor(None, ["body"]), lambda: discretize(None), lambda: solve_history(PLATE),
     lambda: solve(None), lambda: solve(PLATE, initial=np.ones(3)),
     lambda: limit_load_factor(PLATE, ["body"], time_limit=np.nan),
     lambda: solve_history([PLATE]).slip("typo"), lambda: problem_to_toml(None),
     lambda: problem_to_toml(PLATE, title=None), lambda: problem_to_toml(PLATE, units=0),
     lambda: TriangleMesh.rectangle((2, 2), origin=("0", 0.0)), lambda: graded_lines(0.0, 1.0, 10**400),
     lambda: compressed_plate(0.3, displacement="1e-3"), lambda: solve(PLATE, element="bfs", degree=4),
     lambda: solve(step().discretization, degree=5), lambda: ContactProblem(CUT, Material(1.0, 0.3), HELD, "y"),
     lambda: ContactProblem(CUT, Material(1.0, 0.3), HELD, regions=[Region(Material(2.0, 0.3), x=(0.0, 0.4))]),
     lambda: ContactProblem(CUT, Material(1.0, 0.3), HELD, regions=[Region(Material(2.0, 0.3), name="steel")])],
)  # fmt: skip
def test_arguments_of_another_kind(use):
    with pytest.raises(InputError):
        use()


OBJECTS = [None, np.nan, -1, 2.5, 1j, True, b"x", [], ["x"], {}, {"x": 1}, np.array([1.0, 2.0]), Odd(), print, float]
PATHS = {
    "file": load_problem,
    "result": load_result,
    "store": read_sweep,
    "mesh": TriangleMesh.load,
    "output": lambda path: save_problem(path, PLATE),
    "npz": lambda path: write_npz(path, step()),
    "store of a sweep": lambda path: solve_sweep(PLATE, "friction", [0.1], store=1 if path is None else path),
    "store of a history": lambda path: solve_history([PLATE], store=path if path is not None else 1),
}


@pytest.mark.parametrize("name", ["a\0b", "a\ud800b", 300 * "a"])
@pytest.mark.parametrize("entry", PATHS)
def test_names_that_no_file_can_have(entry, name, tmp_path):
    refused(PATHS[entry], f"{tmp_path}/{name}.msh", entry.split()[0])


@cache
def tables():
    """All that makes tables."""
    history, sweep = solve_history([PLATE]), solve_sweep(PLATE, "gap", [0.0])
    return (history.to_frame, sweep.to_frame, step().to_frame, step().forces_frame, step().contacts["plate"].to_frame)


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


@pytest.mark.parametrize("entry", [*PATHS, *FLAGS])
def test_paths_are_texts_or_paths_and_flags_are_true_or_false(entry):
    for value in OBJECTS if entry in PATHS else NO_TRUTH:
        refused((PATHS | FLAGS)[entry], value, entry.split()[0])


REFUSALS = {
    "law_on": lambda rows: discretize(PLATE, law_on=rows), "scales": lambda scales: discretize(PLATE, scales=scales),
    "problem": lambda problem: step().discretization.with_data(problem),
    "dask": lambda address: solve_sweep(PLATE, "friction", [0.1], store="never", dask=address),
    "workers": lambda workers: solve_sweep(PLATE, "friction", [0.1], store="never", workers=workers),
    "stress": principal_stresses, "TOML": problem_from_toml, "result": lambda result: write_json("never", result),
    "folder": lambda folder: problem_from_toml("", folder if not isinstance(folder, str) else 1),
    "units of a file": lambda units: write_npz("never.npz", step(), units),
    "ContactProblem.mesh": lambda mesh: ContactProblem(mesh, Material(1.0, 0.3), HELD),
    "ContactProblem.material": lambda material: ContactProblem(CUT, material, HELD),
    "loads of a proof": lambda loads: limit_proof(PLATE, loads),
    "displacement": lambda loop: loop_area(loop, [0.0, 1.0]), "force": lambda loop: loop_area([0.0, 1.0], loop),
    "TriangleMesh.edge_sets": lambda sets: TriangleMesh(CUT.vertices, CUT.cells, sets),
    "TriangleMesh.regions": lambda sets: TriangleMesh(CUT.vertices, CUT.cells, {}, sets),
    "TriangleMesh.arcs": lambda arcs: TriangleMesh(CUT.vertices, CUT.cells, arcs=arcs),
    "joints of a grid": lambda joints: TriangleMesh.grid([0, 1], [0, 1], joints=joints),
    "joints": lambda joints: TriangleMesh.outline(OUTLINE, 0.5, joints=joints),
    "regions": lambda regions: TriangleMesh.outline(OUTLINE, 0.5, regions=regions),
    "sizes": lambda sizes: TriangleMesh.outline(OUTLINE, 0.5, sizes=sizes), "coarse": CUT.parents,
    "name": CUT.numbers, "cells": CUT.part, "edge_sets": lambda sets: CUT.part([0, 1], sets),
    "points": lambda points: CUT.graded(points, 1), "points of places": CUT.locate,
    "depth": lambda depth: CUT.graded([[0.0, 0.0]], depth), "vertices": lambda vertices: CUT.fanned(vertices, 0.5),
    "marked": CUT.refined, "here": lambda where: CUT.with_region("here", where),
    "x, y": lambda x: step().displacement(x, 0.5), "history": history_figure, "problem of a picture": problem_figure,
    "result of a picture": result_figure, "panels": lambda names: result_figure(step(), panels=names),
    "title": lambda title: result_figure(step(), title=title if not isinstance(title, str) else 1),
    "title of a history": lambda title: history_figure(History((), 0), title=1 if isinstance(title, str) else title),
    "scales of a picture": lambda scales: result_figure(step(), scales=scales),
    "figure": lambda figure: save_figure("never.png", figure),
    "sentence": lambda text: Units().filled(text if not isinstance(text, str) else 1),
    "problem of a flow": lambda problem: write_collapse_vtu("never.vtu", problem, None),
    "limit of a flow": lambda limit: write_collapse_vtu("never.vtu", PLATE, limit),
    "units of a picture": lambda units: result_figure(step(), units), "limit": lambda load: limit_figure(PLATE, load),
    "bracket": lambda bounds: write_vtu("never.vtu", step(), bracket=bounds),
    "constants": lambda values: problem_from_toml(problem_to_toml(PLATE)).with_constants(values),
}  # fmt: skip


@pytest.mark.parametrize("entry", REFUSALS)
def test_arguments_of_no_kind(entry):
    column = np.array([[1.0], [np.nan]])
    for value in ("rough", -1.5, np.nan, 1j, Odd(), [Odd()], [[1, 2], [3]], column, 10**400, 1e308):
        refused(REFUSALS[entry], value, entry.split(" of ")[0])


HUGE = {
    "grading": lambda: graded_lines(0.0, 1.0, 3, 1e308), "grading of ends": lambda: graded_lines(-1e308, 1e308, 3),
    "x": lambda: TriangleMesh.rectangle((2, 2), width=1e308),
    "y": lambda: TriangleMesh.grid([0.0, 1.0], [0.0, 1e308]),
    "TriangleMesh.vertices": lambda: TriangleMesh([[0.0, 0.0], [1e308, 0.0], [0.0, 1e308]], [[0, 1, 2]]),
    "size": lambda: TriangleMesh.outline(OUTLINE, 1e308), "edge_sets": lambda: CUT.part([0, 1], {"x": 1}),
    "cells": lambda: TriangleMesh.rectangle((10**5, 10**5)),
    "cells of a line": lambda: TriangleMesh.rectangle(4), "cells of a box": lambda: TriangleMesh.rectangle((4, 4, 4)),
    "origin": lambda: TriangleMesh.rectangle((2, 2), origin=0.0),
    "grading of a box": lambda: TriangleMesh.rectangle((2, 2), grading=(0.8, 0.8, 0.8)),
}  # fmt: skip


@pytest.mark.parametrize("kind", [np.int8, np.uint8, np.int64])
def test_integers_of_numpy_are_integers(kind, tmp_path):
    for number in (kind, int):  # the same sweep, or the second is refused
        options = {name: number(value) for name, value in {"memory": 3, "max_iterations": 100, "degree": 4}.items()}
        solve_sweep(PLATE, "friction", [0.3], store=tmp_path / "a", throw=number(1), **options)
    assert masonry_wall(kind(3), kind(4), openings=()).mesh.same_as(masonry_wall(3, 4, openings=()).mesh)
    assert jointed_slope(kind(5), kind(2)).mesh.same_as(jointed_slope(5, 2).mesh)


VALUES = {
    "values": (lambda values: solve_sweep(PLATE, "friction", values), [[True], (0.1, True), [np.nan], [], [[0.1]]]),
    "displacement": (lambda loop: loop_area(loop, [1.0]), [[np.nan], [-np.inf], 1.0]),
    "force": (lambda loop: loop_area([1.0], loop), [[np.nan], [np.inf], [1.0, 1.0]]),
    "degree": (hsieh_clough_tocher, [2, 13, 4.0, True, "4"]),
    "marked": (CUT.refined, [[70], [-1], [0.5], [[0]], [True]]),
    "loads": (lambda loads: limit_load_factor(PLATE, loads), [["tide"], [], "right", ["right", "plate"], None, [3]]),
    "ratio": (lambda ratio: CUT.graded([(0.0, 0.0)], 1, ratio=ratio), [0.0, 1.0, np.nan, "0.5"]),
    "points": (lambda points: CUT.graded(points, 2), [[(2.0, 0.0)], [0.0, 1.0], [(np.nan, 0.0)]]),
    "openings": (lambda openings: masonry_wall(openings=openings), [
        ((0, 0, 2, 2),), ((3, 5, 2, 3),), ((10, 0, 2, 2),), ((2, 0, 2, 2), (4, 0, 2, 2)), ((1, 0, 2),),
        ((1, 0, 1.5, 2),), ((3, 0.0, 2, 4),),
    ]),
    "crest": (lambda crest: jointed_slope(crest=crest), [6]), "rows": (lambda rows: jointed_slope(rows=rows), [0]),
    "dip": (lambda dip: jointed_slope(dip=dip), [80.0]), "slip": (lambda slip: stick_slip_block(slip=slip), [0.0]),
    "transition": (lambda length: stick_slip_block(transition=length), [2.0]),
    "pressure_drop": (lambda drop: stick_slip_block(pressure_drop=drop), [100.0]),
}  # fmt: skip


@pytest.mark.parametrize("entry", [*VALUES, *HUGE])
def test_values_that_an_argument_cannot_have_are_refused_before_anything_is_made(entry):
    use, values = VALUES.get(entry) or (lambda _: HUGE[entry](), [None])
    for value in values:
        refused(use, value, entry.split(" of ")[0])


@pytest.mark.parametrize(
    ("package", "use"),
    [("pandas", lambda _: step().contacts["plate"].to_frame()),
     ("meshio", lambda path: write_vtu(path / "a.vtu", step())), ("matplotlib", lambda _: problem_figure(PLATE)),
     ("gmsh", lambda _: TriangleMesh.outline(OUTLINE, 0.5))],
)  # fmt: skip
def test_without_an_optional_package_the_command_to_type_is_told(package, use, without, tmp_path):
    without(package)
    with pytest.raises(InputError, match=f"pip install {package}"):
        use(tmp_path)
