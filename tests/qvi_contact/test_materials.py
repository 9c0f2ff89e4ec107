"""Bodies of several materials, and ν = ½ in plane strain, where stress elements do not lock."""

from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import InputError, TriangleMesh, exact, solve_companion
from qvi_contact.element import compliance_roots
from qvi_contact.gallery import cantilever, compressed_plate, problem_from_state
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, Region, RigidPlate, Symmetry, Traction
from tests.qvi_contact.builders import solved

SOFT, STIFF = Material(100.0, 0.0), Material(400.0, 0.0)


def test_layers_in_series_and_side_by_side():
    """Without lateral strain, springs: in series the compliances add, side by side the stiffnesses."""
    mesh = TriangleMesh.grid([0.0, 0.5, 1.0], [0.0, 0.25, 1.0])
    squeezed = [
        Symmetry("left"), Symmetry("bottom"), Traction("right", x=0, y=0), Contact("top", friction=0.3, gap=-0.1),
    ]  # fmt: skip
    series = solved(ContactProblem(mesh, SOFT, squeezed, regions=[Region(STIFF, y=(0.25, 1.0))]))
    pressure = 0.1 / (0.25 / 100 + 0.75 / 400)
    assert series.contacts["top"].normal_stress == pytest.approx(-pressure, rel=1e-10)
    assert series.stress(0.3, 0.6) == pytest.approx([0, -pressure, 0], abs=1e-8)
    beside = solved(ContactProblem(mesh, SOFT, squeezed, regions=[Region(STIFF, x=(0.5, 1.0))]))
    assert beside.stress([0.2, 0.8], 0.5)[:, 1] == pytest.approx([-10.0, -40.0], rel=1e-10)


def test_one_material_in_pieces_is_one_material():
    material = Material(1000.0, 0.3)
    mesh = TriangleMesh.rectangle((4, 3), 2.0, 1.0, origin=(0.0, -0.5), grading=0.8)
    middle = np.unique(mesh.vertices[:, 0])[2]
    state = exact.gravity_column(material, 5.0, 0.5)
    problem = exact.problem_from_state(state, mesh, material, dict.fromkeys(("bottom", "right", "top", "left"), "uu"))
    pieces = ContactProblem(
        mesh, Material(1.0, 0.0), problem.conditions, problem.body_potential,
        [Region(SOFT), Region(material, x=(0.0, middle)), Region(material, x=(middle, 2.0))],
    )  # fmt: skip
    x, y, stress = solved(pieces).gauss_stress()
    assert stress == pytest.approx(np.moveaxis(state.stress(x, y), 0, -1), abs=1e-10)


@pytest.mark.parametrize(
    ("regions", "field"),
    [([Region(SOFT, x=(0.0, 0.3))], "region"), ([Region(SOFT, y=(1.0, 0.0))], "range"),
     ([Region(Material(1.0, 0.0, "strain"))], "Region.material"), ("soft", "ContactProblem.regions")],
)  # fmt: skip
def test_bad_regions_are_refused(regions, field):
    mesh = TriangleMesh.rectangle((2, 2))
    conditions = [Symmetry("left"), Symmetry("bottom"), Traction("right", x=0, y=0), Traction("top", x=0, y=0)]
    with pytest.raises(InputError) as caught:
        ContactProblem(mesh, SOFT, conditions, regions=regions)
    assert caught.value.field == field


RUBBER = Material(1000.0, 0.5, "strain")


class TestIncompressible:
    """The pressure is free of strain, with and without body force."""

    def test_water_in_a_box(self):
        """σ = −(p + ρ g (h − y)) I has no energy at all."""
        sides = [Traction("top", 0.0, -2.0), Symmetry("left"), Contact("right", 0.3), Contact("bottom", 0.3)]
        weight = {"body_potential": lambda _, y: 3.0 * y}
        result = solved(ContactProblem(TriangleMesh.rectangle((3, 3)), RUBBER, sides, **weight), degree=4)
        _, y, stress = result.gauss_stress()
        assert stress == pytest.approx((3.0 * y - 5.0)[..., None] * [1.0, 1.0, 0.0], abs=1e-8)
        assert abs(result.energies.strain) < 1e-12

    def test_friction_is_the_limit(self):
        """The force is a smooth function of ν up to ½: by extrapolation from below."""
        plates = [compressed_plate(0.2, (3, 3), poisson=0.5 - step, plane="strain") for step in (0.0, 1e-4, 2e-4)]
        force = [solved(plate, degree=4).contacts["plate"].normal_force for plate in plates]
        assert force[0] == pytest.approx(2.0 * force[1] - force[2], rel=1e-6)
        assert abs(force[0] / force[2] - 1.0) > 1e-5

    def test_a_compressible_part(self):
        """It knows the pressure: a closed box half filled with it."""
        mesh = TriangleMesh.rectangle((4, 2), 2.0, 1.0)
        sides = [*map(Symmetry, ("left", "bottom", "top")), Displacement("right", x=-1e-3), Traction("right", y=0.0)]
        soft = Region(Material(500.0, 0.2, "strain"), x=(1.0, 2.0))
        c = soft.material.compliance
        modulus = c[0, 0] / (c[0, 0] ** 2 - c[0, 1] ** 2)  # no strain along y
        result = solved(ContactProblem(mesh, RUBBER, sides, regions=[soft]), degree=4)
        assert result.resultant("right").x == pytest.approx(-1e-3 * modulus, rel=1e-9)

    def test_bending_is_exact(self):
        mesh = TriangleMesh.rectangle((3, 2), 2.0, 1.0, origin=(0.0, -0.5))
        state = cantilever(RUBBER, 3.0, -0.375)
        kinds = dict(zip(("bottom", "right", "top", "left"), ("tt", "uu", "tt", "uu"), strict=True))
        x, y, stress = solved(problem_from_state(state, mesh, RUBBER, kinds), degree=4).gauss_stress()
        assert stress == pytest.approx(np.moveaxis(state.stress(x, y), 0, -1), abs=1e-9)


class TestRefusals:
    """A constant pressure strains nothing, so that something else must say how large it is."""

    CLOSED = (Symmetry("left"), Symmetry("bottom"), Symmetry("right"))

    @pytest.mark.parametrize(
        "top",
        [[Contact("top", 0.2, gap=-1e-3)],
         [Contact("top", 0.2, plate=RigidPlate(force_y=-1.0))],
         [Displacement("top", y=-1e-3), Traction("top", x=0.0)]], ids=["contact", "plate", "displacement"],
    )  # fmt: skip
    def test_closed_all_around(self, top):
        mesh = TriangleMesh.rectangle((2, 2))
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


def test_roots_of_compliances():
    """L Lᵀ = c, and a column of zeros where a pressure strains nothing; the same as Cholesky's elsewhere."""
    materials = [RUBBER, Material(2.1e5, 0.3), Material(3.0, 0.45, "strain"), Material(7.0, -0.9, "strain")]
    compliances = np.stack([material.compliance for material in materials])
    roots = compliance_roots(compliances)
    assert roots @ roots.swapaxes(1, 2) == pytest.approx(compliances, rel=1e-14)
    assert roots[0, 1, 1] <= 1e-7 * roots[0, 0, 0]
    assert roots[1:] == pytest.approx(np.linalg.cholesky(compliances[1:]), rel=1e-13)
