"""Names that nothing has: one kind of error, which lists the names that fit and first the closest one."""

import pickle

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    InputError,
    Material,
    Region,
    RigidPlate,
    Symmetry,
    Traction,
    TriangleMesh,
    UnknownNameError,
    limit_load_factor,
    load_problem,
    refine,
    solve,
    solve_history,
    solve_sweep,
)
from qvi_contact.plots import result_figure
from solvers.basics.names import closest, known_name


def posed(contact="fit", base="bottom"):
    """A block on a rigid plate, with a joint that holds."""
    mesh = TriangleMesh.rectangle((2, 2)).with_joint("seam", lambda _, y: y == 0.5)
    conditions = [
        Contact(base, friction=0.3, name=contact, plate=RigidPlate(y=0.0)),
        Contact("seam", law="tied", friction=0.0),
        Displacement("top", x=0.0, y=-1e-3),
        Traction("left", x=0.0, y=0.0),
        Traction("right", x=0.0, y=0.0),
    ]
    return ContactProblem(mesh, Material(1e4, 0.2), conditions)


@pytest.fixture(scope="module")
def result():
    return solve(posed(), degree=3)


@pytest.fixture(scope="module")
def history():
    return solve_history([posed()], degree=3)


def refused(function):
    """The error of a name that nothing has."""
    with pytest.raises(UnknownNameError) as caught:
        function()
    assert isinstance(caught.value, InputError)
    assert isinstance(caught.value, KeyError)
    return caught.value


@pytest.mark.parametrize(
    ("of", "meant"),
    [
        (lambda result: result.contacts["fitt"], "fit"),
        (lambda result: result.plates["Fit"], "fit"),
        (lambda result: result.plate_force("seamm"), None),
        (lambda result: result.plate_force("fti"), "fit"),
        (lambda result: result.resultant("tob"), "top"),
        (lambda result: result.resultant("semm"), "seam"),
        (lambda result: result.resultant("fitt"), "fit"),
        (lambda result: result.problem.mesh.edge_set("botom"), "bottom"),
        (lambda result: result.problem.mesh.joint_set("saem"), "seam"),
        (lambda result: result.problem.mesh.edges("saem"), "seam"),
        (lambda result: result_figure(result, panels=["fitt"]), "fit"),
        (lambda result: solve_sweep(result.problem, "friction", [0.1], ["fitt"]), "fit"),
        (lambda result: solve_sweep(result.problem, "load", [0.1], ["lleft"]), "left"),
        (lambda result: limit_load_factor(result.problem, ["rihgt"]), "right"),
        (lambda result: refine(result.problem, quantity="fit.normal_forc"), "fit.normal_force"),
        (lambda result: ContactProblem(result.problem.mesh, Material(1.0, 0.3), [Symmetry("lfet")]), "left"),
        (lambda result: ContactProblem(result.problem.mesh, Material(1.0, 0.3), [Contact("saem", 0.3)]), "seam"),
        (lambda result: result.problem.mesh.with_region("low", [0]).region("lov"), "low"),
    ],
)
def test_the_closest_name_is_offered(result, of, meant):
    error = refused(lambda: of(result))
    assert ("did you mean" in error.remedy) == (meant is not None)
    assert meant is None or f"did you mean {meant!r}?" in error.remedy


def test_contacts_and_plates_of_a_result_are_mappings_as_others(result):
    assert list(result.contacts) == ["fit", "seam"]
    assert list(result.plates) == ["fit"]
    assert result.contacts.get("fitt") is None
    assert "fitt" not in result.contacts
    assert refused(lambda: result.contacts["fitt"]).field == "contacts"
    assert refused(lambda: result.plates["seam"]).field == "plates"


def test_names_in_histories(history):
    assert "did you mean 'fit'?" in refused(lambda: history.slip("fitt")).remedy
    assert "did you mean 'top'?" in refused(lambda: history.loop("topp")).remedy
    assert refused(lambda: history.loop("left")).field == "name"  # nothing is prescribed there
    assert np.shape(history.loop("top")) == (2, 1)


def test_a_contact_may_be_on_edge_sets_and_joints_a_traction_on_edge_sets(tmp_path):
    text = """
version = 1
[mesh]
x = {start = 0.0, stop = 1.0, cells = 2}
y = {start = 0.0, stop = 1.0, cells = 2}
[material]
young = 1.0
poisson = 0.3
[[joints]]
name = "joint"
direction = "horizontal"
at = 0.5
[[KIND]]
edges = "jont"
"""
    path = tmp_path / "problem.toml"
    for kind, fits in (("contacts", True), ("symmetry", False)):
        path.write_text(text.replace("KIND", kind) + ("friction = 0.3" if fits else ""))
        error = refused(lambda: load_problem(path))
        assert error.field == f"{kind}[0].edges"
        assert ("did you mean 'joint'?" in error.remedy) == fits
        assert all(name in error.remedy for name in ("bottom", "left", "right", "top"))


def test_all_names_are_listed_and_the_message_is_a_sentence():
    error = refused(lambda: known_name("here", "c", {"apes": ("amber", "bo"), "bees": ()}))
    assert str(error).startswith("here: 'c': ")
    assert all(word in error.remedy for word in ("apes", "amber", "bo", "bees"))
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), str(again)) == (type(error), str(error))
    for odd in (3, None, ["amber"]):
        assert refused(lambda odd=odd: known_name("here", odd, {"apes": ("amber",)})).value == odd


def test_the_closest_word_has_the_same_letters_but_for_a_few():
    words = ("flank", "base", "Top")
    assert [closest(word, words) for word in ("flnak", "BASE", "top", "other", 3)] == [
        "flank",
        "base",
        "Top",
        None,
        None,
    ]


def test_a_region_that_the_mesh_has_not(result):
    problem = result.problem
    error = refused(
        lambda: ContactProblem(
            problem.mesh.with_region("core", [0]), problem.material, problem.conditions,
            regions=[Region(Material(1.0, 0.3), name="cor")],
        )
    )  # fmt: skip
    assert "did you mean 'core'?" in error.remedy
