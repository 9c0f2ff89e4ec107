"""Names that nothing has are one kind of error, with the closest one; those there are may be anything."""

import re
from dataclasses import replace
from xml.etree import ElementTree

import pytest
from matplotlib.text import Text

from qvi_contact import History, InputError, TriangleMesh, UnknownNameError, limit_load_factor, solve, solve_sweep
from qvi_contact.export import write_contacts_vtu, write_vtu
from qvi_contact.gallery import compressed_plate
from qvi_contact.plots import history_figure, problem_figure, result_figure
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, RigidPlate, Symmetry, Traction
from qvi_contact.refinement import refine
from qvi_contact.units import Units


@pytest.fixture(scope="module")
def result():
    """A block on a rigid plate, with a joint that holds."""
    mesh = TriangleMesh.rectangle((2, 2)).with_joint("seam", lambda _, y: y == 0.5)
    conditions = [
        Contact("bottom", friction=0.3, name="fit", plate=RigidPlate(y=0.0)),
        Contact("seam", law="tied", friction=0.0),
        Displacement("top", x=0.0, y=-1e-3),
        Traction("left", x=0.0, y=0.0),
        Traction("right", x=0.0, y=0.0),
    ]
    return solve(ContactProblem(mesh, Material(1e4, 0.2), conditions), degree=3)


@pytest.mark.parametrize(
    ("of", "meant"),
    [(lambda result: result.contacts["fitt"], "fit"), (lambda result: result.plates["Fit"], "fit"),
     (lambda result: result.plate_force("seamm"), None), (lambda result: result.plate_force("fti"), "fit"),
     (lambda result: result.resultant("tob"), "top"), (lambda result: result.resultant("semm"), "seam"),
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
     (lambda result: result.problem.mesh.with_region("low", [0]).region("lov"), "low")],
)  # fmt: skip
def test_the_closest_name_is_offered(result, of, meant):
    with pytest.raises(UnknownNameError) as caught:
        of(result)
    assert {InputError, KeyError} <= {*type(caught.value).__mro__}
    assert ("did you mean" in caught.value.remedy) == (meant is not None)
    assert meant is None or f"did you mean {meant!r}?" in caught.value.remedy


FORMULA = r"$\foo$"
UNITS = Units(r"$\bar$", '<b & "c">\'')


@pytest.fixture(scope="module")
def odd():
    plate = compressed_plate(0.2, (2, 2))
    named = [replace(each, name=FORMULA) if isinstance(each, Contact) else each for each in plate.conditions]
    return solve(replace(plate, conditions=named), degree=3)


@pytest.mark.usefixtures("outlined")
@pytest.mark.parametrize(
    "drawn",
    [lambda result: result_figure(result, UNITS), lambda result: problem_figure(result.problem, UNITS),
     lambda result: history_figure(History((result, result), 2), UNITS)],
)  # fmt: skip
def test_pictures_show_dollar_signs(odd, drawn):
    texts = [text.get_text() for text in drawn(odd).findobj(Text)]
    assert any(r"\$\bar\$" in text for text in texts)
    assert not any(re.search(r"(?<!\\)\$\\(foo|bar)", text) for text in texts)


def test_names_of_fields_in_vtu_files_are_those_given(odd, tmp_path):
    meshio = pytest.importorskip("meshio")
    for write in (write_vtu, write_contacts_vtu):
        path = tmp_path / "fields.vtu"
        write(path, odd, UNITS)
        names = {array.get("Name") for array in ElementTree.parse(path).iter("DataArray")}
        assert any(UNITS.stress in name for name in names)
        assert any(UNITS.length in name for name in names)
        assert set(meshio.read(path).point_data) <= names
