"""Holes that carry forces: Airy functions of several values, whatever the cut; equilibrium, orders, bounds, files."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    InputError,
    Material,
    RectilinearMesh,
    Region,
    RigidPlate,
    Traction,
    TriangleMesh,
    discretize,
    exact,
)
from qvi_contact.bracket import bracket
from qvi_contact.discretization.hsieh_clough_tocher import cuts, space
from qvi_contact.discretization.hsieh_clough_tocher.cuts import shortest_cuts
from qvi_contact.export import write_npz, write_vtu
from qvi_contact.files.stored import load_result
from tests.qvi_contact.states import difference, solved
from tests.qvi_contact.test_stored import fails

STEEL, FOAM = Material(1000.0, 0.3), Material(100.0, 0.45)
SIDES = ("bottom", "right", "top", "left")
PLACES = ((0.0, 0.0), (2.0, 0.0), (1.0, 2.0))
"""Where the unit holes of `holed` are."""

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


def holed(divisions, places=PLACES, low=(-1.5, -1.5), high=(3.5, 3.5)):
    """A rectangle with unit holes, on cells of 1/divisions."""
    lines = [np.linspace(a, b, round((b - a) * divisions) + 1) for a, b in zip(low, high, strict=True)]
    x, y = np.meshgrid(*[(line[1:] + line[:-1]) / 2.0 for line in lines])
    body = np.ones(x.shape, dtype=bool)
    for a, b in places:
        body &= np.maximum(np.abs(x - a), np.abs(y - b)) > 0.5
    return RectilinearMesh(*lines, body)


def eye(divisions):
    """A square of 3 with a unit hole in the middle; its rim is "rim"."""
    mesh = TriangleMesh.of_rectangles(holed(divisions, PLACES[:1], (-1.5, -1.5), (1.5, 1.5)))
    return mesh.with_edges("rim", lambda x, y: np.maximum(np.abs(x), np.abs(y)) < 0.6).with_edges(
        "outside", lambda x, y: np.maximum(np.abs(x), np.abs(y)) > 1.4
    )


def misses(state, mesh, kinds, degree):
    """Mean error of the stress where every side, those of holes too, has the data of the state."""
    problem = exact.problem_from_state(state, mesh, STEEL, dict(zip(SIDES, kinds, strict=True)))
    x, y, stress = solved(problem, degree=degree).gauss_stress()
    return np.sqrt(np.square(stress - np.moveaxis(state.stress(x, y), 0, -1)).mean())


@pytest.mark.parametrize(
    ("degree", "kinds"), [(3, ("uu", "tt", "tt", "tt")), (4, ("tu", "ut", "tu", "ut")), (5, ("uu",) * 4)]
)
def test_a_force_and_a_moment_in_a_hole(degree, kinds):
    """Order p − 1: that displacements are single-valued (Michell) follows from stationarity."""
    state = point_forces({PLACES[0]: SOURCES[PLACES[0]]})
    coarse, fine = (misses(state, holed(d, PLACES[:1], (-1.5, -1.5), (1.5, 1.5)), kinds, degree) for d in (4, 8))
    assert np.log2(coarse / fine) > degree - 1.45
    assert fine < 2e-3 * 15.0 ** (3 - degree)


def test_three_holes():
    kinds, state = ("ut", "tu", "tt", "uu"), point_forces(SOURCES)
    coarse, fine = (misses(state, holed(d), kinds, 5) for d in (2, 4))
    assert fine < 1e-4
    assert coarse / fine > 8.0


def polygon(count, layers, inner=1.0, outer=2.0):
    """A ring between two regular polygons; its lines are "hole" and "outside"."""
    angle, radius = 2.0 * np.pi * np.arange(count) / count, np.geomspace(inner, outer, layers + 1)
    vertices = (radius[:, None, None] * np.column_stack([np.cos(angle), np.sin(angle)])).reshape(-1, 2)
    i, j = (index.ravel() for index in np.meshgrid(np.arange(layers), np.arange(count), indexing="ij"))
    a, b = i * count + j, i * count + (j + 1) % count
    cells = np.concatenate([np.column_stack([a, b, b + count]), np.column_stack([a, a + count, b + count])])
    middle = (inner + outer) / 2.0
    mesh = TriangleMesh(vertices, cells).with_edges("hole", lambda x, y: np.hypot(x, y) < middle)
    return mesh.with_edges("outside", lambda x, y: np.hypot(x, y) > middle)


def test_lames_ring_under_pressure():
    """The circles as polygons, with an error of (1/sides)²; a resultant of zero makes no jump."""
    worst = []
    for sides in (24, 48):
        loads = [Traction("hole", normal=-3.0, tangential=0.0), Traction("outside", x=0.0, y=0.0)]
        result = solved(ContactProblem(polygon(sides, sides // 8), STEEL, loads), degree=5)
        assert np.abs(result.discretization.space.jumps(result.dofs)).max() < 1e-13
        r, angle = np.array([1.3, 1.5, 1.7]), np.pi / sides
        xx, yy, xy = result.stress(r * np.cos(angle), r * np.sin(angle)).T
        c, s = np.cos(angle), np.sin(angle)
        radial = c * c * xx + s * s * yy + 2.0 * c * s * xy
        worst.append(np.abs([radial - 1.0 + 4.0 / r**2, xx + yy - 2.0]).max())
    assert worst[1] < 1e-2
    assert worst[0] > 3.5 * worst[1]


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


def elsewhere(mesh):
    """Cuts along detours."""
    rng = np.random.default_rng(0)

    def lengths(mesh, found=cuts._lengths):
        shape = found(mesh)
        drawn = shape.copy()
        drawn.data = rng.integers(1, 50, len(drawn.data)).astype(float)
        upper = sparse.triu(drawn)
        return sparse.csr_array(upper + upper.T)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cuts, "_lengths", lengths)
        return shortest_cuts(mesh)


@pytest.mark.parametrize("rim", RIMS)
def test_any_cut_gives_the_same(rim, monkeypatch):
    """Stresses, tractions, motions and energies; cuts are nowhere in them."""
    problem = lug(*RIMS[rim])
    first = solved(problem, degree=4)
    other = elsewhere(problem.mesh)
    assert not np.array_equal(other[0], first.discretization.space.cuts)
    monkeypatch.setattr(space, "shortest_cuts", lambda _: other)
    second = solved(problem, degree=4)
    assert np.array_equal(second.discretization.space.cuts, other[0])
    assert difference(first, second) < 1e-9
    for name, line in first.contacts.items():
        assert second.contacts[name].slip == pytest.approx(line.slip, abs=1e-10)
        assert second.plates[name].rotation == pytest.approx(first.plates[name].rotation, rel=1e-9)
    assert second.energies.strain == pytest.approx(first.energies.strain, rel=1e-11)


def equilibrium(result, pairs, loads=(0.0, 0.0, 0.0)):
    """What the resultants on the whole boundary miss of equilibrium, relative."""
    found = [result.resultant(name) for name in pairs]
    sums = np.array([[force.x, force.y, force.moment] for force in found])
    return np.abs(sums.sum(axis=0) + loads).max() / np.abs(sums).max()


@pytest.mark.parametrize("rim", RIMS)
def test_resultants_balance_to_rounding(rim):
    result = solved(lug(*RIMS[rim]), degree=4)
    assert equilibrium(result, ("rim", "held", "free")) < 1e-12
    force, jump = result.resultant("rim"), result.discretization.space.jumps(result.dofs)[0]
    unit = result.discretization.scales.stress * result.discretization.scales.length
    assert np.abs(jump[1:] * unit) == pytest.approx(np.abs([force.y, force.x]), rel=1e-9, abs=1e-12)
    if rim in ("pushed", "tied"):
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


@pytest.mark.parametrize("rim", ["loaded", "held", "tied"])
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
    assert fails(tmp_path / "a.npz") == set()
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


def test_rectangles_say_which_element_to_take():
    mesh = holed(1, PLACES[:1], (-1.5, -1.5), (1.5, 1.5))
    conditions = [Displacement("left", x=0.0, y=0.0), *(Traction(side, x=0.0, y=0.0) for side in SIDES[:3])]
    problem = ContactProblem(mesh, STEEL, conditions)
    with pytest.raises(InputError, match="take element 'hct'"):
        discretize(problem, element="bfs")
    assert len(discretize(problem).space.cuts) == 2
