"""ν = ½ in plane strain: stress elements do not lock, and the constant pressure must be known from a traction."""

from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    InputError,
    Material,
    RectilinearMesh,
    Region,
    RigidPlate,
    Symmetry,
    Traction,
    TriangleMesh,
    solve_companion,
)
from qvi_contact.element.compliance import compliance_roots
from qvi_contact.exact import cantilever, problem_from_state
from qvi_contact.files.problem_file import problem_from_toml
from qvi_contact.files.problem_writer import problem_to_toml
from qvi_contact.gallery import compressed_plate
from tests.qvi_contact.states import solved

RUBBER = Material(1000.0, 0.5, "strain")
ELEMENTS = {"rectangles": {}, "degree 4": {"degree": 4}}


def on(element, problem):
    """The problem on the mesh of an element."""
    return problem.triangulated() if element else problem


@pytest.mark.parametrize("element", ELEMENTS.values(), ids=ELEMENTS)
class TestStates:
    """Both elements, with and without body force."""

    def test_water_in_a_box(self, element):
        """σ = −(p + ρ g (h − y)) I has no energy at all."""
        mesh = RectilinearMesh.rectangle((3, 3))
        sides = [Traction("top", 0.0, -2.0), Symmetry("left"), Contact("right", 0.3), Contact("bottom", 0.3)]
        problem = on(element, ContactProblem(mesh, RUBBER, sides, body_potential=lambda _, y: 3.0 * y))
        result = solved(problem, **element)
        _, y, stress = result.gauss_stress()
        assert stress[..., 0] == pytest.approx(3.0 * y - 5.0, abs=1e-8)
        assert stress[..., 1] == pytest.approx(3.0 * y - 5.0, abs=1e-8)
        assert stress[..., 2] == pytest.approx(0.0, abs=1e-8)
        assert abs(result.energies.strain) < 1e-12

    def test_friction_is_the_limit(self, element):
        """The force is a smooth function of ν up to ½: by extrapolation from below."""
        force = [
            solved(on(element, compressed_plate(0.2, (3, 3), poisson=0.5 - step, plane="strain")), **element)
            .contacts["plate"]
            .normal_force
            for step in (0.0, 1e-4, 2e-4)
        ]
        assert force[0] == pytest.approx(2.0 * force[1] - force[2], rel=1e-6)
        assert abs(force[0] / force[2] - 1.0) > 1e-5

    def test_a_compressible_part(self, element):
        """It knows the pressure: a closed box half filled with it."""
        mesh = RectilinearMesh.rectangle((4, 2), 2.0, 1.0)
        sides = [
            Symmetry("left"),
            Symmetry("bottom"),
            Symmetry("top"),
            Displacement("right", x=-1e-3),
            Traction("right", y=0.0),
        ]
        soft = Region(Material(500.0, 0.2, "strain"), x=(1.0, 2.0))
        problem = on(element, ContactProblem(mesh, RUBBER, sides, regions=[soft]))
        compliance = soft.material.compliance
        modulus = compliance[0, 0] / (compliance[0, 0] ** 2 - compliance[0, 1] ** 2)  # no strain along y
        assert solved(problem, **element).resultant("right").x == pytest.approx(-1e-3 * modulus, rel=1e-9)


def test_bending_is_exact():
    mesh = RectilinearMesh.rectangle((3, 2), 2.0, 1.0, origin=(0.0, -0.5))
    state = cantilever(RUBBER, 3.0, -0.375)
    kinds = dict(zip(("bottom", "right", "top", "left"), ("tt", "uu", "tt", "uu"), strict=True))
    problem = problem_from_state(state, mesh, RUBBER, kinds)
    for tried, options in ((problem, {}), (problem.triangulated(), {"degree": 4})):
        x, y, stress = solved(tried, **options).gauss_stress()
        assert stress == pytest.approx(np.moveaxis(state.stress(x, y), 0, -1), abs=1e-9)


class TestRefusals:
    """A constant pressure strains nothing, so that something else must say how large it is."""

    CLOSED = (Symmetry("left"), Symmetry("bottom"), Symmetry("right"))

    @pytest.mark.parametrize("triangles", [False, True])
    @pytest.mark.parametrize(
        "top",
        [
            [Contact("top", 0.2, gap=-1e-3)],
            [Contact("top", 0.2, plate=RigidPlate(force_y=-1.0))],
            [Displacement("top", y=-1e-3), Traction("top", x=0.0)],
        ],
        ids=["contact", "plate", "displacement"],
    )
    def test_closed_all_around(self, top, triangles):
        mesh = RectilinearMesh.rectangle((2, 2))
        mesh = TriangleMesh.of_rectangles(mesh) if triangles else mesh
        with pytest.raises(InputError, match=r"Material\.poisson.*traction"):
            ContactProblem(mesh, RUBBER, [*self.CLOSED, *top])
        ContactProblem(mesh, replace(RUBBER, poisson=0.499), [*self.CLOSED, *top])

    def test_a_normal_traction_by_a_slanted_component(self):
        corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
        mesh = TriangleMesh(corners, [[0, 1, 2]], {"bottom": [[0, 1]], "slope": [[1, 2]], "left": [[2, 0]]})
        rest = [Symmetry("bottom"), Symmetry("left")]
        ContactProblem(mesh, RUBBER, [*rest, Traction("slope", x=0.0), Displacement("slope", y=0.0)])
        with pytest.raises(InputError, match=r"Material\.poisson"):
            ContactProblem(mesh, RUBBER, [*rest, Traction("slope", tangential=0.0), Displacement("slope", normal=0.0)])

    def test_displacement_model(self):
        problem = compressed_plate(0.2, (2, 2), poisson=0.5, plane="strain")
        with pytest.raises(InputError, match=r"Material\.poisson"):
            solve_companion(problem)
        with pytest.raises(InputError, match=r"Material\.poisson"):
            _ = solved(problem).bracket

    def test_in_a_file(self):
        text = problem_to_toml(compressed_plate(0.2, (2, 2), poisson=0.499, plane="strain"))
        assert problem_from_toml(text.replace("0.499", "0.5")).problem.material.incompressible


def test_roots_of_compliances():
    """L Lᵀ = c, and a column of zeros where a pressure strains nothing; the same as Cholesky's elsewhere."""
    materials = [RUBBER, Material(2.1e5, 0.3), Material(3.0, 0.45, "strain"), Material(7.0, -0.9, "strain")]
    compliances = np.stack([material.compliance for material in materials])
    roots = compliance_roots(compliances)
    assert roots @ roots.swapaxes(1, 2) == pytest.approx(compliances, rel=1e-14)
    assert roots[0, 1, 1] <= 1e-7 * roots[0, 0, 0]
    assert roots[1:] == pytest.approx(np.linalg.cholesky(compliances[1:]), rel=1e-13)
