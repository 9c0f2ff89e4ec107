"""Initial strain: temperature, shrinkage and prestress, in stresses, displacements and bounds."""

import json
import sys
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from numpy.polynomial.polynomial import polyder

from qvi_contact import Contact, InputError, Material, Polynomial, Region, RigidPlate, Symmetry, Traction, TriangleMesh
from qvi_contact.companion import solve_companion
from qvi_contact.element import compliance_roots
from qvi_contact.files import load_problem, problem_from_toml, problem_to_toml
from qvi_contact.gallery import compressed_plate
from qvi_contact.problem import ContactProblem, Displacement, Expression, PointData, problem_digest, stress_along_z
from qvi_contact.refinement import refine
from qvi_contact.solution import solve
from tests.cases import examples, refused_at
from tests.qvi_contact.builders import holed, quarter, solved

E, NU, ALPHA = 1000.0, 0.3, 1e-3
SIDES = ("left", "right", "top", "bottom")
FREE = [Traction(name, 0.0, 0.0) for name in SIDES]


def steel(plane="stress", **more):
    return Material(E, NU, plane, **{"expansion": ALPHA, **more})


@pytest.mark.parametrize("degree", [3, 4, 6])
def test_a_linear_temperature_leaves_a_free_body_without_stress(degree):
    """On any mesh of straight triangles to rounding; where sides are arcs to the order of the element."""
    hot = Expression("10 + 20 * x - 7 * y")
    for mesh, tolerance in (
        (TriangleMesh.rectangle((3, 2), 2.0, 1.0, grading=0.7), 1e-10),
        (quarter(2, 3), 3.0**-degree),
    ):
        problem = ContactProblem(mesh, steel(), [Traction(n, 0.0, 0.0) for n in mesh.edge_names], temperature=hot)
        stress = solve(problem, degree=degree).stress(*mesh.corners.mean(axis=1).T)
        assert np.abs(stress).max() < tolerance * E * ALPHA * 20.0


@pytest.mark.parametrize(("plane", "factor"), [("stress", 1.0 - NU), ("strain", 1.0 - 2.0 * NU)])
def test_a_held_block(plane, factor):
    """−E α ΔT/(1 − 2ν) in plane strain, also along z; both models say so, and the bounds meet."""
    mesh = TriangleMesh.rectangle((2, 2))
    held = [Displacement(name, 0.0, 0.0) for name in SIDES]
    problem = ContactProblem(mesh, steel(plane), held, temperature=10.0)
    result = solve(problem)
    pressure, place = E * ALPHA * 10.0 / factor, (np.array([0.3]), np.array([0.4]))
    stress = result.stress(*place)
    assert stress == pytest.approx(np.array([[-pressure, -pressure, 0.0]]), abs=1e-9 * pressure)
    along_z = stress_along_z(problem, np.array([0]), *place, stress)
    assert along_z == pytest.approx([-pressure if plane == "strain" else 0.0], rel=1e-9)
    mises = refine(problem, target=1e-3, quantity="von_mises(0.3, 0.4)", max_rounds=1).value
    assert mises == pytest.approx(0.0 if plane == "strain" else pressure, abs=1e-9 * pressure)
    pressed = [Contact("bottom", 0.3), *(Traction(name, normal=-pressure, tangential=0.0) for name in SIDES[:3])]
    assert solve(replace(problem, mesh=TriangleMesh.rectangle((6, 6), grading=0.7), conditions=pressed)).remarks == ()
    for method in ("fixed-point", "condensed"):  # rounding is no strain energy
        solved(replace(problem, conditions=[Contact(SIDES[0], 0.3), *held[1:]]), method=method)
    bounds = result.bracket
    energy = 0.5 * pressure * 2.0 * ALPHA * 10.0 * (1.0 + NU if plane == "strain" else 1.0)
    assert (bounds.lower, bounds.upper) == pytest.approx((energy, energy), rel=1e-9)
    assert not bounds.reasons
    assert bounds.companion.stress(*place) == pytest.approx(stress, rel=1e-9)
    assert (result.energies.strain, -result.energies.complementary) == pytest.approx((energy, energy), rel=1e-9)


def test_layers_of_two_temperatures_lift_what_lies_on_them():
    """By α (h₁ T₁ + h₂ T₂) less p/E; each temperature has its own layer's derivative α h."""
    mesh = TriangleMesh.rectangle((1, 4)).with_region("upper", lambda _, y: y > 0.75)
    lid = Contact("top", 0.0, law="bilateral", plate=RigidPlate(force_y=-4.0, x=0.0, rotation=0.0))
    sides = [Symmetry("left"), Symmetry("bottom"), Traction("right", 0.0, 0.0)]
    layers = [Region(steel(), name="upper", temperature=10.0)]
    result = solve(ContactProblem(mesh, steel(), [*sides, lid], temperature=5.0, regions=layers))
    assert result.plates["top"].y == pytest.approx(ALPHA * (0.75 * 5.0 + 0.25 * 10.0) - 4.0 / E, rel=1e-9)
    for name, height in (("temperature", 0.75), ("upper.temperature", 0.25)):
        assert result.derivative("top.y", name) == pytest.approx(ALPHA * height, rel=1e-8)


def test_a_prestress_in_the_plane_has_no_part_along_z():
    """What is held all around is not strained: its stress is the prestress, and σ_zz = 0."""
    held = [Displacement(name, 0.0, 0.0) for name in SIDES]
    problem = ContactProblem(TriangleMesh.rectangle((2, 2)), steel("strain", prestress=(3.0, -7.0, 2.0)), held)
    place = np.array([0.3]), np.array([0.4])
    stress = solve(problem).stress(*place)
    assert stress == pytest.approx(np.array([[3.0, -7.0, 2.0]]), rel=1e-9)
    assert stress_along_z(problem, np.array([0]), *place, stress) == pytest.approx(0.0, abs=1e-9)


def manufactured(mesh, materials, held):
    """A displacement of degree 3 and the stress of an Airy function of degree 4, which a prestress makes fit."""
    rng = np.random.default_rng(0)
    u = [rng.normal(size=(4, 4)) * 1e-3 * np.tri(4)[::-1] for _ in range(2)]
    phi = 10.0 * rng.normal(size=(5, 5)) * np.tri(5)[::-1]
    dx, dy = (partial(polyder, axis=axis) for axis in (0, 1))

    def padded(c, n=5):
        return np.pad(c, [(0, n - c.shape[0]), (0, n - c.shape[1])])

    stress = [padded(dy(dy(phi))), padded(dx(dx(phi))), -padded(dx(dy(phi)))]
    strain = [padded(dx(u[0])), padded(dy(u[1])), padded(dy(u[0])) + padded(dx(u[1]))]

    def prestressed(material):
        C = np.linalg.inv(material.compliance)
        fields = [s - sum(C[i, j] * strain[j] for j in range(3)) for i, s in enumerate(stress)]
        return Material(material.young, material.poisson, material.plane, prestress=tuple(map(Polynomial, fields)))

    xx, yy, xy = map(Polynomial, stress)
    conditions = []
    for name in mesh.edge_names:
        if name in held:
            conditions.append(Displacement(name, Polynomial(u[0]), Polynomial(u[1])))
        else:
            normal = mesh.edges(name).normal
            assert np.ptp(normal, axis=0).max() < 1e-12, name
            nx, ny = normal[0]
            conditions.append(
                Traction(
                    name,
                    lambda x, y, nx=nx, ny=ny: nx * xx(x, y) + ny * xy(x, y),
                    lambda x, y, nx=nx, ny=ny: nx * xy(x, y) + ny * yy(x, y),
                )
            )
    main, *others = [prestressed(material) for material in materials]
    regions = [Region(material, name=f"part {i}") for i, material in enumerate(others, 1)]
    return ContactProblem(mesh, main, conditions, regions=regions), (xx, yy, xy), [Polynomial(part) for part in u]


@pytest.mark.parametrize("plane", ["stress", "strain"])
@pytest.mark.parametrize("hole", [False, True])
def test_manufactured_solution(plane, hole):
    """Mixed boundaries, two materials, a body with a hole: both models find the stress, and the bounds meet."""
    grid = holed(2, [(1.0, 1.0)] if hole else [], (0.0, 0.0), (2.0, 2.0))
    mesh = TriangleMesh(grid.vertices, grid.cells, {}).with_region("part 1", lambda x, _: x > 1.0)
    for axis, at in ((0, 0.0), (0, 0.5), (0, 1.5), (0, 2.0), (1, 0.0), (1, 0.5), (1, 1.5), (1, 2.0)):
        if hole or at in (0.0, 2.0):
            mesh = mesh.with_edges(f"{'xy'[axis]} = {at}", lambda *p, axis=axis, at=at: np.abs(p[axis] - at) < 0.1)
    materials = [Material(E, NU, plane), Material(3.0 * E, 0.2, plane)]
    problem, stress, moved = manufactured(mesh, materials, ("x = 0.0", "x = 1.5"))
    result, (x, y) = solve(problem, degree=4), mesh.corners.mean(axis=1).T + 0.01
    exact = np.stack([part(x, y) for part in stress], axis=-1)
    assert result.stress(x, y) == pytest.approx(exact, abs=1e-8 * np.abs(exact).max())
    bounds, exact = result.bracket, np.stack([part(x, y) for part in moved], axis=-1)
    assert bounds.companion.displacement(x, y) == pytest.approx(exact, abs=1e-8)
    assert bounds.gap < 1e-9 * bounds.strain
    assert not bounds.reasons


@pytest.mark.parametrize("seed", range(examples(2)))
def test_bounds_hold_the_truth_of_contacts(seed):
    """Two blocks heated unevenly, a joint between them, pressed on a base: energies and forces of a finer model."""
    rng = np.random.default_rng(seed)
    law = {"friction": 0.0, "cohesion": 3.0} if seed % 2 else {"friction": 0.2}
    hot = Polynomial(10.0 * rng.normal(size=(2, 2)))
    prestress = (Polynomial(rng.normal(size=(2, 1))), -2.0, 0.5)

    def block(cells):
        x, y = (np.linspace(0.0, size, n + 1) for size, n in zip((2.0, 1.0), cells, strict=True))
        mesh = TriangleMesh.grid(x, y, regions={"upper": ((0.0, 2.0), (0.5, 1.0))})
        mesh = mesh.with_joint("joint", lambda _, y: np.abs(y - 0.5) < 1e-9)
        conditions = [Contact("bottom", **law), Contact("joint", **law), Displacement("top", x=0.0, y=-0.02)]
        conditions += [Traction("right", 0.0, 0.0), Traction("left", y=0.0), Displacement("left", x=0.0)]
        stiffer = Material(2.0 * E, NU, "strain", expansion=ALPHA, prestress=prestress)
        upper = Region(stiffer, name="upper", temperature=8.0)
        return ContactProblem(mesh, steel("strain", shrinkage=-2e-3), conditions, regions=[upper], temperature=hot)

    coarse, fine = (solve(block(cells), degree=4) for cells in ((4, 2), (16, 8)))
    bounds = coarse.bracket
    if seed % 2:
        truth = -fine.energies.complementary
        assert bounds.lower < truth < bounds.upper
        assert bounds.gap < 0.1 * bounds.strain
    for name, force in bounds.forces.items():
        contact, kind = name.split(".")
        value = getattr(fine.contacts[contact], kind)
        assert force.lower <= value <= force.upper, name
        assert seed or force.upper - force.lower < 0.11 * abs(value)  # with ε⁰ counted twice: 0.13
    assert seed % 2 or bounds.forces


FILE = """
version = 1
temperature = "dT * x * t"
constants = { dT = 10.0 }
mesh = { x = [0, 1, 2], y = [0, 0.5, 1] }
displacements = [{ edges = "left", x = 0, y = 0 }]
tractions = [{ edges = "top", x = 0, y = 0 }, { edges = "bottom", x = 0, y = 0 }, { edges = "right", x = 0, y = 0 }]
history = { times = [0.0, 1.0] }

[material]
young = 1000.0
poisson = 0.3
expansion = 1e-3
shrinkage = "1e-4 * y"

[[regions]]
y = [0.5, 1.0]
young = 1000.0
poisson = 0.3
prestress = [-1.0, "2 * x", 0.0]
temperature = 5.0
"""


def test_files_hold_it():
    file = problem_from_toml(FILE)
    cold, hot = file.problems
    assert problem_digest(cold) != problem_digest(hot)
    assert hot.temperature(np.array([0.5]), np.array([0.0])) == pytest.approx([5.0])
    upper = hot.regions[0]
    assert upper.temperature == 5.0
    assert upper.material.prestress[1](np.array([0.5]), np.array([0.0])) == pytest.approx([1.0])
    again = problem_from_toml(problem_to_toml(hot)).problem
    assert problem_digest(again) == problem_digest(hot)
    with pytest.raises(InputError, match=r"material.prestress"):
        problem_from_toml(FILE.replace("expansion = 1e-3", "prestress = [1.0, 2.0]"))


def test_what_cannot_be_meant_is_refused():
    mesh = TriangleMesh.rectangle((1, 1))
    with pytest.raises(InputError, match="compressible"):
        ContactProblem(mesh, Material(E, 0.5, "strain", expansion=ALPHA), FREE, temperature=10.0)
    with pytest.raises(InputError, match="prestress"):
        Material(E, NU, prestress=(1.0, 2.0))
    with pytest.raises(InputError, match="temperature"):
        solve(ContactProblem(mesh, steel(), FREE, temperature=lambda x, _: np.full_like(x, np.nan)))
    for material, told in ((steel(expansion=0.0), 1), (steel(), 0)):
        assert " ".join(solve(ContactProblem(mesh, material, FREE, temperature=10.0)).remarks).count("expan") == told


def test_a_temperature_by_values_at_points(tmp_path, shell, monkeypatch):
    """Linear between them: on vertices of the problem, of another mesh, by number in files, beside chords of arcs."""
    meshio = pytest.importorskip("meshio")
    mesh, x, y = TriangleMesh.rectangle((5, 3), 2.0, 1.0), np.array([0.1, 1.7]), np.array([0.3, 0.9])
    hot = 10.0 + 20.0 * mesh.vertices[:, 0] - 7.0 * mesh.vertices[:, 1]
    field = PointData(mesh, hot)
    assert field(x, y) == pytest.approx(10.0 + 20.0 * x - 7.0 * y)
    cells = {"quad": [[0, 1, 7, 6]], "triangle": mesh.cells[2:]}
    meshio.write_points_cells(tmp_path / "hot.vtu", np.pad(mesh.vertices, [(0, 0), (0, 1)]), cells, {"T": hot})
    body = "$Nodes\n4\n9 1 1 0\n7 0 0 0\n5 4 0 0\n6 0 4 0\n$EndNodes\n"
    body += "$Elements\n2\n1 2 0 5 6 7\n2 1 1 3 9 7\n$EndElements\n"  # a line off the triangles has a name
    data = '$NodeData\n1\n"T"\n1\n0\n3\n0\n1\n4\n5 9\n6 5\n7 1\n8 2\n$EndNodeData\n'  # there is no node 8
    text = '$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n1 3 "line"\n$EndPhysicalNames\n' + data + body
    (tmp_path / "a.msh").write_text(text + body + 2 * data.replace("T", "U"))
    assert PointData.load(tmp_path / "a.msh", "T")(x, y) == pytest.approx(1.0 + 2.0 * x + y)
    for wrong in (text + data, text.replace("7 1\n8 2", "8 1\n8 2")):  # two steps; a vertex without a value
        (tmp_path / "a.msh").write_text(wrong)
        with refused_at("file", "one finite number a point, in one step"):
            PointData.load(tmp_path / "a.msh", "T")
    (tmp_path / "problem.toml").write_text(FILE.replace('"dT * x * t"', '{ file = "hot.vtu", data = "T" }'))
    problem = load_problem(tmp_path / "problem.toml").problem
    assert problem.temperature(x, y) == pytest.approx(field(x, y))
    said = json.loads(shell("check", tmp_path / "problem.toml", "--json")[1])
    assert (said["temperature"], said["materials"][1]["temperature"]) == ("values at 24 points", 5.0)
    for file, data, words in (("hot.vtu", "U", r"temperature\.data"), ("cold.vtu", "T", "no such file")):
        (tmp_path / "wrong.toml").write_text(FILE.replace('"dT * x * t"', f'{{ file = "{file}", data = "{data}" }}'))
        with pytest.raises(InputError, match=words):
            load_problem(tmp_path / "wrong.toml")
    monkeypatch.setitem(sys.modules, "meshio", None)
    with pytest.raises(InputError, match="pip install meshio"):
        PointData.load(tmp_path / "hot.vtu", "T")
    with pytest.raises(InputError, match="outside"):
        field(np.array([9.0]), np.array([0.0]))
    ring = quarter(2, 3, arcs=False)
    beside = PointData(ring, ring.vertices @ np.array([1.0, 2.0]))
    x, y = 2.0 * np.cos(np.pi / 12.0), 2.0 * np.sin(np.pi / 12.0)
    assert beside(x, y) == pytest.approx(x + 2.0 * y)


SOFT = Material(100.0, 0.0)


@pytest.mark.parametrize(
    ("regions", "field"),
    [([Region(SOFT, x=(0.0, 0.3))], "region"), ([Region(SOFT, y=(1.0, 0.0))], "range.y"),
     ([Region(Material(1.0, 0.0, "strain"))], "Region.material"), ("soft", "ContactProblem.regions")],
)  # fmt: skip
def test_bad_regions_are_refused(regions, field):
    mesh = TriangleMesh.rectangle((2, 2))
    conditions = [Symmetry("left"), Symmetry("bottom"), Traction("right", x=0, y=0), Traction("top", x=0, y=0)]
    with refused_at(field):
        ContactProblem(mesh, SOFT, conditions, regions=regions)


RUBBER = Material(1000.0, 0.5, "strain")


def test_a_compressible_part_knows_the_pressure():
    """A closed box half filled with it; a box of water, and ν → ½ under friction, are in the manual."""
    mesh = TriangleMesh.rectangle((4, 2), 2.0, 1.0)
    sides = [*map(Symmetry, ("left", "bottom", "top")), Displacement("right", x=-1e-3), Traction("right", y=0.0)]
    soft = Region(Material(500.0, 0.2, "strain"), x=(1.0, 2.0))
    c = soft.material.compliance
    modulus = c[0, 0] / (c[0, 0] ** 2 - c[0, 1] ** 2)  # no strain along y
    result = solved(ContactProblem(mesh, RUBBER, sides, regions=[soft]), degree=4)
    assert result.resultant("right").x == pytest.approx(-1e-3 * modulus, rel=1e-9)


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
        with pytest.raises(InputError, match="of the other kind"):
            ContactProblem(mesh, RUBBER, [*rest, Traction("slope", x=0.0), Displacement("slope", normal=0.0)])

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
