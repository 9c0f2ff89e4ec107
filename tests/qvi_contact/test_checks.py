"""Names that are no names, and numbers that are not real, wherever a problem or a result takes one."""

import warnings

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    Displacement,
    Expression,
    InputError,
    Material,
    Polynomial,
    RectilinearMesh,
    Symmetry,
    Traction,
    discretize,
    graded_lines,
    limit_load_factor,
    solve,
    solve_history,
)
from qvi_contact.files.problem_writer import problem_to_toml
from qvi_contact.gallery import compressed_plate
from qvi_contact.mesh.triangles import TriangleMesh

MESH = RectilinearMesh.rectangle((2, 2)).with_joint("joint", "horizontal", at=0.5)
TRIANGLES = TriangleMesh.of_rectangles(MESH)


@pytest.fixture(scope="module")
def result():
    return solve(compressed_plate(0.3, (2, 2)))


@pytest.fixture(autouse=True)
def _imaginary_parts_are_dropped_in_silence():
    """As they are for users, who do not make errors of warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


NAMES = [np.array(["top", "bottom"]), np.array(["top"]), ["top"], b"top", None, 1]


@pytest.mark.parametrize("name", NAMES, ids=repr)
@pytest.mark.parametrize(
    "use",
    [
        Symmetry,
        lambda name: Traction(name, x=0.0),
        lambda name: Displacement(name, x=0.0),
        lambda name: Contact(name, 0.3),
        lambda name: Contact("top", 0.3, name=name),
        lambda name: Contact("top", 0.3, law=name),
        lambda name: Material(1.0, 0.3, plane=name),
        MESH.edges,
        MESH.edge_set,
        MESH.joint_set,
        lambda name: MESH.with_edges("new", name),
        lambda name: MESH.with_edges(name, "top"),
        lambda name: MESH.with_joint("new", name, 0.5),
        lambda name: MESH.with_joint(name, "vertical", 0.5),
        lambda name: MESH.refined(0.5, [name]),
        lambda name: limit_load_factor(compressed_plate(0.3, (2, 2)), [name]),
        TRIANGLES.edges,
        TRIANGLES.edge_set,
        TRIANGLES.joint_set,
        TRIANGLES.region,
        lambda name: TRIANGLES.with_edges(name, [[0, 1]]),
        lambda name: TRIANGLES.with_region(name, [0]),
    ],
)
def test_names_are_texts(use, name):
    with pytest.raises(InputError):
        use(name)


@pytest.mark.parametrize("name", NAMES[:-1], ids=repr)
def test_names_asked_of_a_result_are_texts(result, name):
    with pytest.raises(InputError):
        result.resultant(name)


COMPLEX = [0.5 + 1j, np.complex128(0.5 + 1j), np.array([0.0, 0.5 + 1j, 1.0]), [0.0, np.complex64(0.5 + 1j), 1.0]]


@pytest.mark.parametrize("value", [*COMPLEX, "0.5", ["0.0", "1.0"], 10**400, None], ids=repr)
@pytest.mark.parametrize(
    "use",
    [
        lambda value: RectilinearMesh(value, [0.0, 1.0]),
        lambda value: MESH.on_lines(value, [0.0, 1.0]),
        lambda value: TriangleMesh(value, TRIANGLES.cells),
        lambda value: TriangleMesh(TRIANGLES.vertices, value),
        TRIANGLES.locate,
        lambda value: Polynomial([value] if np.ndim(value) else [[value]]),
        lambda value: Contact("top", friction=value),
        lambda value: Material(value, 0.3),
        lambda value: Expression("t", t=value),
        lambda value: Expression("a", {"a": value}),
        lambda value: Expression("1", value),
        lambda value: solve(compressed_plate(0.3, (2, 2)), damping=value),
    ],
)
def test_numbers_are_real(use, value):
    with pytest.raises(InputError):
        use(value)


@pytest.mark.parametrize("value", COMPLEX, ids=repr)
def test_results_are_asked_at_real_points(result, value):
    with pytest.raises(InputError):
        result.stress(value, 0.5)


@pytest.mark.parametrize("factor", [1j, "0.1"], ids=repr)
def test_functions_and_starts_are_real(factor):
    problem = compressed_plate(lambda x, y: 0 * x * y + factor, (2, 2))
    with pytest.raises(InputError, match="friction"):
        solve(problem)
    with pytest.raises(InputError, match="initial"):
        solve(compressed_plate(0.3, (2, 2)), method="fixed-point", initial=[factor] * 8)


def test_a_time_out_in_a_function_goes_on():
    def slow(*_):
        raise TimeoutError("time is over")

    with pytest.raises(TimeoutError, match="time is over"):
        solve(compressed_plate(slow, (2, 2)))


@pytest.mark.parametrize(
    "use",
    [
        lambda: limit_load_factor(None, ["body"]),
        lambda: discretize(None),
        lambda: solve_history(compressed_plate(0.3)),
        lambda: solve_history([compressed_plate(0.3, (1, 1))]).slip("typo"),
        lambda: problem_to_toml(None),
        lambda: problem_to_toml(compressed_plate(0.3), title=None),
        lambda: problem_to_toml(compressed_plate(0.3), units="mm"),
        lambda: problem_to_toml(compressed_plate(0.3), times=1.0),
        lambda: problem_to_toml(compressed_plate(0.3), solve_options=["method"]),
        lambda: problem_to_toml(compressed_plate(0.3), solve_options={"tolerance": None}),
        lambda: RectilinearMesh.rectangle((2, 2), origin=("0", 0.0)),
        lambda: graded_lines(0.0, 1.0, 10**400),
        lambda: compressed_plate(0.3, displacement="1e-3"),
    ],
)
def test_arguments_of_another_kind(use):
    with pytest.raises(InputError):
        use()
