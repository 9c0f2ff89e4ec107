"""Holes that carry forces: Airy functions of several values, whatever the cut; equilibrium, orders, bounds, files."""

from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import InputError, discretize, exact
from qvi_contact.bracket import bracket
from qvi_contact.discretization import shortest_cuts
from qvi_contact.export import write_npz, write_vtu
from qvi_contact.files import load_result
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, Region, RigidPlate, Traction
from qvi_contact.verification import verify_file
from tests.qvi_contact.builders import difference, holed, solved

STEEL, FOAM = Material(1000.0, 0.3), Material(100.0, 0.45)
SIDES = ("bottom", "right", "top", "left")
PLACES = ((0.0, 0.0), (2.0, 0.0), (1.0, 2.0))
EYE, THREE = (PLACES[:1], (-1.5, -1.5), (1.5, 1.5)), (PLACES, (-1.5, -1.5), (3.5, 3.5))
"""Where unit holes are, and the corners of the rectangles around them."""
SOURCES = {(0.0, 0.0): (1.0, -0.7, 0.4), (2.0, 0.1): (-0.4, 0.9, 0.0), (1.0, 2.0): (0.5, 0.2, -0.6)}
"""Forces and moments (X, Y, M) at points inside them."""


def point_forces(sources):
    """Forces and moments in an infinite plane by Kolosov's functions; displacements are single-valued."""
    kappa, shear = (3.0 - STEEL.poisson) / (1.0 + STEEL.poisson), STEEL.young / 2.0 / (1.0 + STEEL.poisson)
    factor = 1.0 / (2.0 * np.pi * (1.0 + kappa))

    def stress(x, y):
        found = np.zeros((3, *np.shape(x)))
        for (a, b), (X, Y, M) in sources.items():
            z, force = x - a + 1j * (y - b), (X + 1j * Y) * factor
            mean = -4.0 * (force / z).real
            rest = 2.0 * (z.conj() * force / z**2 + kappa * force.conjugate() / z - 1j * M / (2.0 * np.pi * z**2))
            found += [(mean - rest.real) / 2.0, (mean + rest.real) / 2.0, rest.imag / 2.0]
        return found

    def displacement(x, y):
        total = np.zeros(np.shape(x), dtype=complex)
        for (a, b), (X, Y, M) in sources.items():
            z, force = x - a + 1j * (y - b), (X + 1j * Y) * factor
            total += -2.0 * kappa * force * np.log(np.abs(z)) + z * force.conjugate() / z.conj()
            total += 1j * M / (2.0 * np.pi * z.conj())
        return np.stack([total.real, total.imag]) / (2.0 * shear)

    return exact.ExactState(stress, displacement)


def eye(divisions):
    """A square of 3 with a unit hole in the middle; its rim is "rim"."""
    mesh = holed(divisions, *EYE)
    return mesh.with_edges("rim", lambda x, y: np.maximum(np.abs(x), np.abs(y)) < 0.6).with_edges(
        "outside", lambda x, y: np.maximum(np.abs(x), np.abs(y)) > 1.4
    )


def misses(state, mesh, kinds, degree):
    """Mean error of the stress where every side, those of holes too, has the data of the state."""
    problem = exact.problem_from_state(state, mesh, STEEL, dict(zip(SIDES, kinds, strict=True)))
    x, y, stress = solved(problem, degree=degree).gauss_stress()
    return np.sqrt(np.square(stress - np.moveaxis(state.stress(x, y), 0, -1)).mean())


@pytest.mark.parametrize(("degree", "kinds"), [(3, ("uu", "tt", "tt", "tt")), (5, ("uu",) * 4)])
def test_a_force_and_a_moment_in_a_hole(degree, kinds):
    """Order p − 1: that displacements are single-valued (Michell) follows from stationarity."""
    state = point_forces({PLACES[0]: SOURCES[PLACES[0]]})
    coarse, fine = (misses(state, holed(d, *EYE), kinds, degree) for d in (4, 8))
    assert np.log2(coarse / fine) > degree - 1.45
    assert fine < 2e-3 * 15.0 ** (3 - degree)


def test_three_holes():
    kinds, state = ("ut", "tu", "tt", "uu"), point_forces(SOURCES)
    coarse, fine = (misses(state, holed(d, *THREE), kinds, 5) for d in (2, 4))
    assert fine < 1e-4
    assert coarse / fine > 8.0


def lug(*rim, mesh=None, **options):
    """The eye held on its left side, with these conditions on the rim."""
    mesh = mesh or eye(2)
    mesh = mesh.with_edges("held", lambda x, _: x == -1.5)
    mesh = mesh.with_edges("free", lambda x, y: np.maximum(x, np.abs(y)) == 1.5)
    conditions = [*rim, Displacement("held", x=0.0, y=0.0), Traction("free", x=0.0, y=0.0)]
    return ContactProblem(mesh, STEEL, conditions, **options)


PUSHED = Contact("rim", 0.3, gap=1e-3, plate=RigidPlate(force_x=1.0, force_y=0.4, moment=0.1))
RIMS = {
    "loaded": [Traction("rim", x=0.5, y=-0.2)],
    "held": [Displacement("rim", x=1e-3, y=lambda x, _: 1e-3 * x)],
    "pushed": [PUSHED],
    "tied": [replace(PUSHED, friction=0.0, gap=0.0, law="tied")],
}


@pytest.fixture(scope="module", params=RIMS)
def rim(request):
    """Conditions on the rim, and the result."""
    return request.param, solved(lug(*RIMS[request.param]), degree=4)


def test_any_cut_gives_the_same(rim):
    """Stresses, tractions, motions and energies; a joint that nothing uses turns the cut away."""
    _, first = rim
    cut = first.discretization.space.cuts.vertices
    mesh = first.problem.mesh.with_joint("none", np.column_stack([cut[:-1], cut[1:]]))
    second = solved(replace(first.problem, mesh=mesh), degree=4)
    assert not np.isin(second.discretization.space.cuts.vertices, cut).any()
    assert difference(first, second) < 1e-9
    for contact, line in first.contacts.items():
        assert second.contacts[contact].slip == pytest.approx(line.slip, abs=1e-10)
        assert second.plates[contact].rotation == pytest.approx(first.plates[contact].rotation, rel=1e-9)
    assert second.energies.strain == pytest.approx(first.energies.strain, rel=1e-11)


def test_resultants_balance_to_rounding(rim):
    name, result = rim
    forces = [result.resultant(edges) for edges in ("rim", "held", "free")]
    sums = np.array([[force.x, force.y, force.moment] for force in forces])
    assert np.abs(sums.sum(axis=0)).max() < 1e-12 * np.abs(sums).max()
    force, jump = forces[0], result.discretization.space.jumps(result.dofs)[0]
    unit = result.discretization.scales.stress * result.discretization.scales.length
    assert np.abs(jump[1:] * unit) == pytest.approx(np.abs([force.y, force.x]), rel=1e-9, abs=1e-12)
    if name in ("pushed", "tied"):
        assert (force.x, force.y) == pytest.approx((1.0, 0.4), rel=1e-9)
        assert force.moment == pytest.approx(0.1, rel=1e-8)


def test_a_free_hole_in_a_heavy_body():
    """Its own weight alone would have a resultant on the rim: what would fill the hole."""
    heavy = lug(Traction("rim", x=0.0, y=0.0), body_potential=lambda _, y: 2.0 * y)
    result = solved(heavy, degree=4)
    held = result.resultant("held")
    assert (held.x, held.y) == pytest.approx((0.0, 2.0 * 8.0), abs=1e-11)
    assert abs(result.resultant("rim").y) < 1e-12
    found = bracket(result)
    assert found.guaranteed
    assert found.gap < 5e-2 * found.strain


@pytest.mark.parametrize("rim", ["loaded", "tied"])
def test_bounds_enclose_the_energy(rim):
    """Guaranteed, as equilibrium holds exactly, and the displacement model comes to the same."""
    gaps = []
    for divisions in (2, 4):
        found = bracket(solved(lug(*RIMS[rim], mesh=eye(divisions)), degree=4))
        assert found.guaranteed, found.reasons
        assert found.lower <= found.upper
        gaps.append(found.gap / found.strain)
    assert gaps[1] < 0.55 * gaps[0] < 0.05


def test_files(tmp_path):
    """What is stored comes back; the Airy function, which has several values, is left out of pictures' data."""
    meshio = pytest.importorskip("meshio")
    result = solved(lug(PUSHED), degree=4)
    write_npz(tmp_path / "a.npz", result)
    again = load_result(tmp_path / "a.npz")
    assert again.plates["rim"] == result.plates["rim"]
    assert difference(result, again) == 0.0
    assert verify_file(tmp_path / "a.npz").passed
    write_vtu(tmp_path / "a.vtu", result)
    assert "Airy function" not in meshio.read(tmp_path / "a.vtu").point_data


def test_cuts_go_round_joints_where_they_can():
    """A joint from the hole to the outside has no part in the cut; one around the hole is crossed."""
    mesh = eye(2)
    first = shortest_cuts(mesh)[0]
    line = mesh.with_joint("line", np.column_stack([first[:-1], first[1:]]))
    assert not np.isin(shortest_cuts(line)[0], first).any()
    closed = mesh.with_joint("closed", lambda x, y: np.abs(np.maximum(np.abs(x), np.abs(y)) - 1.0) < 1e-9)
    assert len(shortest_cuts(closed)[0]) == len(first)


def test_a_bushing_in_an_eye():
    """A closed joint that does not slip, with another material inside: the same as without the joint."""
    mesh = eye(2).with_region("bushing", lambda x, y: np.maximum(np.abs(x), np.abs(y)) < 1.0)
    whole = lug(*RIMS["loaded"], mesh=mesh, regions=[Region(FOAM, name="bushing")])
    expected = solved(whole, degree=4)
    split = mesh.with_joint("joint", lambda x, y: np.abs(np.maximum(np.abs(x), np.abs(y)) - 1.0) < 1e-9)
    joint = Contact("joint", 0.0, cohesion=50.0, law="bilateral")
    result = solved(lug(*RIMS["loaded"], joint, mesh=split, regions=[Region(FOAM, name="bushing")]), degree=4)
    assert difference(expected, result) < 1e-7


def test_loads_out_of_balance_as_a_whole():
    """A hole may have a resultant; the body as a whole not, if nothing holds it."""
    mesh = eye(2)
    balanced = [Traction("rim", x=0.6, y=0.0), Traction("outside", x=-0.2, y=0.0)]
    result = solved(ContactProblem(mesh, STEEL, balanced), degree=3)
    assert result.resultant("rim").x == pytest.approx(2.4, rel=1e-12)
    with pytest.raises(InputError, match="out of balance") as caught:
        discretize(ContactProblem(mesh, STEEL, [balanced[0], Traction("outside", x=-0.3, y=0.0)]))
    assert caught.value.value == pytest.approx(1.2, rel=1e-9)
    assert "themselves" not in caught.value.remedy
