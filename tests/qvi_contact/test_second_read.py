"""Claims read again by someone else: guarantees, certificates and files against brute force and forged data."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import linprog

import comparisons.verification.chapters.bounds as bounds_chapter
from comparisons.verification.elements import Element
from comparisons.verification.proof import by_hand
from qvi_contact import Contact, ContactProblem, InputError, Material, RectilinearMesh, Symmetry, Traction, solve
from qvi_contact.companion import solve_companion
from qvi_contact.export import write_npz
from qvi_contact.files.archive import Archive, digest
from qvi_contact.files.stored import load_result
from qvi_contact.gallery import compressed_plate
from qvi_contact.verification import verify_file
from solvers import EdgeRows, FrictionQVI, Iteration, Status, certify
from solvers.inequality.edges import quadratic_basis

pytestmark = pytest.mark.usefixtures(
    "bogner_fox_schmit"
)  # claims about grids, cones on them, and companions on the same cells

STRICT = "strict-direct:clarabel"
GAUSS = (np.polynomial.legendre.leggauss(4)[0] + 1.0) / 2.0
EDGES = EdgeRows(GAUSS)
MU = 0.4


def pressed(mesh, **contact):
    """The paper's plate, on another mesh and with another law on its top."""
    plate = compressed_plate(0.0, (4, 4))
    top = Contact("top", **{"friction": 0.0, "gap": -1e-3, "name": "plate", **contact})
    return replace(plate, mesh=mesh, conditions=[*plate.conditions[:3], top])


def corner(law, cells=1):
    """A block in a corner of ground and wall, with a joint that ends at the wall; the wall slips all along."""

    def cut(lines):
        return np.interp(np.arange(0.0, len(lines) - 1.0 + 0.5 / cells, 1.0 / cells), np.arange(len(lines)), lines)

    mesh = RectilinearMesh(cut([0, 0.3, 0.8, 1.4, 2.0]), cut([0, 0.4, 0.7, 1.0]))
    mesh = mesh.with_joint("joint", "horizontal", at=0.4)
    conditions = [
        Contact("bottom", friction=0.0, cohesion=4.0, gap=3e-5, name="ground"),
        Contact("left", friction=0.0, cohesion=7.0, name="wall"),
        Contact("joint", friction=0.0, cohesion=2.0, law=law),
        Traction("right", x=-8.0, y=0.0),
        Traction("top", x=0.0, y=-30.0),
    ]
    return ContactProblem(mesh, Material(2e4, 0.3, "strain"), conditions)


def vertical_forces(found):
    """Of the wall by friction, of ground and joint by pressure."""
    wall, ground, joint = (found.contacts[name] for name in ("wall", "ground", "joint"))
    return wall.tangential_force, ground.normal_force, joint.normal_force


def quarter(cells=4):
    return RectilinearMesh.rectangle((cells, cells))


class TestGuaranteedUpperBound:
    """`CompanionResult.reasons` is empty only if no admissible stress has more energy."""

    @pytest.mark.parametrize("field", ["cohesion", "shear_limit"])
    def test_bound_that_quadrature_misses(self, field):
        def bump(x, y):
            return np.where((x > 0.81) & (x < 0.815), 2000.0, 0.0) + 0.0 * y

        law = {"cohesion": bump} if field == "cohesion" else {"cohesion": 2000.0, "shear_limit": bump}
        lines = np.array([0, 0.4, 0.7, 0.8, 0.81, 0.815, 0.825, 0.9, 1])
        aligned = RectilinearMesh(lines, np.array([0, 0.3, 0.6, 0.8, 0.9, 0.97, 1.0]))
        lower = -solve(pressed(aligned, **law), inner=STRICT).energies.complementary  # the bump is two constants here
        companion = solve_companion(pressed(quarter(), **law))
        assert companion.energy < lower  # no upper bound, so there has to be a reason
        assert len(companion.reasons) == 1

    def test_obstacle_between_the_samples(self):
        def dip(x, y):
            return -1e-3 - 1e-4 * np.exp(-(((x - 0.8125) / 0.002) ** 2)) + 0.0 * y

        problem = pressed(quarter(), gap=dip)
        companion = solve_companion(problem, degree=2)
        t = np.linspace(0.0, 1.0, 2001)
        normal, _ = companion.trace("plate", t)
        x, y = problem.mesh.points_along(problem.mesh.edges("top"), t)
        assert (normal - dip(x, y)).max() > 5e-5  # not admissible, so there has to be a reason
        assert len(companion.reasons) == 1

    @pytest.mark.parametrize("degree", [2, 3, 4])
    @pytest.mark.parametrize("law", ["unilateral", "bilateral"])
    def test_two_contacts_in_a_corner_and_a_joint(self, degree, law):
        problem = corner(law)
        result = solve(problem, element="hct")
        companion = solve_companion(result.problem, degree=degree)
        assert result.status is companion.status is Status.SOLVED
        assert companion.reasons == ()
        assert -result.energies.complementary <= companion.energy + 1e-10 * result.energies.strain
        for found in (result.contacts, companion.contacts):
            ground, wall = found["ground"], found["wall"]
            assert wall.normal_force + ground.tangential_force == pytest.approx(8.0, rel=1e-6)
            assert ground.normal_force + wall.tangential_force == pytest.approx(60.0, rel=1e-6)
        assert vertical_forces(result) == pytest.approx([7.0, 53.0, 55.8], rel=1e-6)  # slip all along the wall
        assert (companion.contacts["wall"].slip < 0.0).all()

    def test_one_shear_for_two_contacts_in_a_corner(self):
        """Rectangles have one shear where the wall carries 7 and ground or joint less; so has their companion force.

        Both are then wrong by what an edge carries, and come to the forces of triangles with the size of the edges.
        """
        errors = []
        for cells in (1, 2):
            problem = corner("bilateral", cells)
            found = solve(problem, element="bfs"), solve_companion(problem, degree=4)
            errors.append([53.0 - vertical_forces(each)[1] for each in found])
        rates = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
        assert np.array(errors).max() < 0.0
        assert rates == pytest.approx(1.0, abs=0.3)


def work(ell, theta):
    """The largest ℓ·τ with |τ| ≤ θ at 1001 points, by linear programming."""
    basis, size, unit = quadratic_basis(np.linspace(0.0, 1.0, 1001)), np.abs(ell).max(), theta.max()
    limit = np.tile(np.maximum(basis @ theta, 0.0) / unit, 2)
    found = linprog(-ell / size, A_ub=np.vstack([basis, -basis]), b_ub=limit, bounds=[(None, None)] * 3)
    return -found.fun * size * unit


def one_edge(n, tau, pushes, ell):
    """A strict problem on one edge with K = 1 in the coordinates (n, τ), stationary there; and its certificate."""
    z, N = np.concatenate([n, tau]), np.hstack([EDGES.affine, np.zeros((4, 3))])
    T = np.hstack([np.zeros((4, 2)), EDGES.quadratic])
    m_N, m_T = EDGES.rows(np.atleast_2d(pushes)), EDGES.rows(np.atleast_2d(ell))
    weights = np.polynomial.legendre.leggauss(4)[1] / 2.0
    qvi = FrictionQVI(
        K=np.eye(5), f=z + N.T @ m_N + T.T @ m_T, N=N, n0=np.zeros(4), T=T, t0=np.zeros(4),
        mu=np.full(4, MU), W=weights, edges=EDGES, strict=True,
    )  # fmt: skip
    return certify(qvi, z, m_N, m_T)


class TestStrictCertificate:
    """It passes for exact states of one edge, and for nothing else."""

    N = np.array([-0.3, -1.0])
    THETA = MU * np.array([0.3, 0.65, 1.0])

    def touching(self, t, share):
        """τ that touches the bound at t, and slip there."""
        return self.THETA - share * np.array([t * t, -t * (1.0 - t), (1.0 - t) ** 2]), quadratic_basis(np.array([t]))[0]

    @pytest.mark.parametrize("t", [0.0, 1e-3, 0.37, 1.0])
    def test_touched_at_one_point(self, t):
        tau, ell = self.touching(t, 0.1)
        assert one_edge(self.N, tau, np.zeros(2), 0.2 * ell).passed
        for wrong in (-ell, ell[::-1], ell + np.array([0.0, 1e-3, 0.0]), np.array([0.0, 1.0, 0.0])):
            assert not one_edge(self.N, tau, np.zeros(2), 0.2 * wrong).passed

    def test_slip_both_ways_on_one_edge(self):
        n, c = np.array([-1.0, -1.0]), MU
        tau, ell = np.array([-c, c, c]), np.array([-0.2, 0.0, 0.3])  # −θ at t = 0, +θ at t = 1
        assert work(ell, np.full(3, c)) == pytest.approx(ell @ tau, rel=1e-9)
        assert one_edge(n, tau, np.zeros(2), ell).passed
        assert not one_edge(n, tau[::-1], np.zeros(2), ell).passed
        assert not one_edge(n, tau * (1 - 1e-6), np.zeros(2), ell).passed

    def test_bound_that_vanishes_at_one_end(self):
        n, theta = np.array([0.0, -1.0]), MU * np.array([0.0, 0.5, 1.0])
        assert one_edge(n, theta, np.array([0.2, 0.0]), np.array([5.0, 0.3, 0.1])).passed  # sticks there whatever ℓ₀
        assert not one_edge(n, theta, np.array([0.0, 0.2]), np.array([0.0, 0.3, 0.1])).passed
        assert not one_edge(n, theta + np.array([1e-6, 0.0, 0.0]), np.zeros(2), np.array([0.0, 0.3, 0.1])).passed

    @pytest.mark.parametrize("seed", range(12))
    def test_passes_only_if_no_friction_works_more(self, seed):
        random = np.random.default_rng(seed)
        tau, _ = self.touching(random.uniform(), 0.1)
        ell = 0.2 * random.normal(size=3)
        missing = work(ell, self.THETA) - ell @ tau
        assert missing > 1e-6
        assert not one_edge(self.N, tau, np.zeros(2), ell).passed


class TestObservedContraction:
    """The factor of the outer loop is that of its own residuals."""

    def test_newton_is_no_step_of_the_loop(self):
        solution = solve(compressed_plate(0.1, (4, 4)), inner=STRICT).solution
        loop = tuple(Iteration(k, 0.5**k, 0.0, 0.0, Status.SOLVED, 9, 0.1) for k in range(1, 4))
        ended = (*loop, Iteration(4, 1e-12, 0.0, 0.0, None, 5, 0.1))  # as `solvers.fixed_point` records Newton's method
        assert replace(solution, history=loop).contraction is None
        assert replace(solution, history=ended).contraction is None


@pytest.fixture(scope="module")
def arrays(tmp_path_factory):
    """A stored result far from the origin."""
    mesh = quarter(3)
    path = tmp_path_factory.mktemp("far") / "far.npz"
    conditions = [
        Symmetry("left"), Symmetry("bottom"), Traction("right", x=0.0, y=0.0),
        Contact("top", friction=0.1, gap=-1e-3, name="plate"),
    ]  # fmt: skip
    far = RectilinearMesh(mesh.x + 1e7, mesh.y)
    write_npz(path, solve(ContactProblem(far, Material(2.09e5, 0.3), conditions)))
    assert verify_file(path).passed
    return Archive(path).arrays


def forged(tmp_path, arrays, **changes):
    entries = {**arrays, **{name: np.asarray(value) for name, value in changes.items()}}
    entries["digest"] = np.array(digest(entries))
    np.savez(tmp_path / "forged.npz", **entries)
    return tmp_path / "forged.npz"


class TestForgedFiles:
    """What is wrong in a file is found, and never by another exception."""

    @pytest.mark.parametrize("value", [np.nan, np.inf])
    def test_iterations_that_are_no_number(self, tmp_path, arrays, value):
        with pytest.raises(InputError, match="iterations"):
            load_result(forged(tmp_path, arrays, iterations=value))

    def test_measure_too_large_for_a_float(self, tmp_path, arrays):
        text = str(arrays["certificate"]).replace('"equality": 0.0', '"equality": 1' + 400 * "0")
        assert text != str(arrays["certificate"])
        with pytest.raises(InputError, match="certificate"):
            load_result(forged(tmp_path, arrays, certificate=text))

    def test_coordinates_moved_by_a_tenth_of_a_cell(self, tmp_path, arrays):
        path = forged(tmp_path, arrays, **{"plate.x": arrays["plate.x"] + 0.03, "gauss_x": arrays["gauss_x"] + 0.03})
        assert not verify_file(path).passed

    def test_a_contact_that_is_not_there(self, tmp_path, arrays):
        assert not verify_file(forged(tmp_path, arrays, **{"wall.normal_force": 1e9})).passed


class TestManual:
    """Rows of the manual fail where what they tell of is wrong."""

    @pytest.mark.parametrize(("power", "passes"), [(-2.0, True), (-0.5, False), (1.0, False)])
    def test_bounds_that_open_under_refinement(self, monkeypatch, power, passes):
        def fake(_, problem):
            return SimpleNamespace(bracket=SimpleNamespace(gap=(len(problem.mesh.x) - 1.0) ** power))

        monkeypatch.setattr(Element, "solve", fake)
        monkeypatch.setattr(bounds_chapter, "_guaranteed", lambda *_: by_hand(True, "by hand"))
        assert [row.passed for row in bounds_chapter.rates_of_the_gap(True)] == [passes] * 3
