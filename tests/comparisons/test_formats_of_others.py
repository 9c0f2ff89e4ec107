"""Files of problems: nothing is lost, nothing broken is read, and foreign measures agree with ours."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import qpsolvers
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.sparse import csr_matrix

from comparisons.exchange import (
    ContactState,
    LocalProblem,
    load_qvi,
    local_problem,
    save_qvi,
    siconos_error,
    state_of,
    write_fclib,
)
from comparisons.exchange.local import project
from comparisons.exchange.quadratic_programs import programs_of
from qvi_contact import load_problem, save_problem, solve
from qvi_contact.gallery import compressed_plate
from solvers import FrictionQVI, Status, TractionFactor, certify, solve_qvi
from solvers.inequality import Compliance
from tests.cases import refusal
from tests.comparisons.conftest import command
from tests.qvi_contact.builders import told
from tests.solvers.conftest import dragged_block, one_contact, random_problem, two_contacts

h5py = pytest.importorskip("h5py", reason="FCLIB files need the extra 'exchange'")

THREE_STATES = {
    "open": ((1.0, 2.1), (0.0, 0.0)),
    "stick": ((0.0, 0.0), (1.7 / 0.9, -3.25 / 0.9)),
    "slip": ((0.0, 0.1), (5.0 / 3.0, -10.0 / 3.0)),
}
NOTHING = np.zeros(0)
few = settings(max_examples=8, deadline=None, derandomize=True)


def local(W, q, mu, V=None, s=NOTHING) -> LocalProblem:
    """A problem by its numbers, with points of length one."""
    W, q, mu, s = (np.asarray(each, dtype=float) for each in (W, q, mu, s))
    return LocalProblem(W, q, mu, np.zeros((len(q), 0)) if V is None else np.asarray(V), s, np.ones(len(mu)))


THREE = local([[1.0, 0.8], [0.8, 1.0]], [1.0, 2.1], [2.0])


def solved(problem: LocalProblem) -> ContactState:
    """Forces by `solve_qvi` on (D2) with the unknowns r, and the displacements and λ that go with them."""
    signs, V = np.tile([-1.0, 1.0], len(problem.mu)), problem.V
    rows = np.diag(signs / np.repeat(problem.weights, 2))
    found = solve_qvi(FrictionQVI.from_arrays(
        K=problem.W + V @ V.T, f=-problem.q - V @ problem.s, N=rows[0::2], n0=0.0 * problem.mu, T=rows[1::2],
        t0=0.0 * problem.mu, mu=problem.mu, W=problem.weights, A=V.T, b=-problem.s,
    ))  # fmt: skip
    assert found.solved
    lam = found.equality_multiplier
    return ContactState(problem.displacements(found.z, lam), found.z, lam)


def random_qvi(seed: int, n: int = 12, m: int = 5, equalities: int = 0) -> FrictionQVI:
    """Every field filled; 2 m rows depend on each other where 2 m > n."""
    qvi = random_problem(seed, equalities=equalities, n=n, m=m)
    return qvi.with_law(mu=np.random.default_rng(seed).uniform(0.0, 0.3, m))


def with_every_law(seed: int) -> FrictionQVI:
    """Cohesion, a limit that is infinite at one point, a bilateral point, traces."""
    qvi = random_qvi(seed, equalities=2)
    rows = csr_matrix(qvi.contact_rows)
    return qvi.with_contact(traces=TractionFactor(rows, csr_matrix(np.eye(10)))).with_law(
        cohesion=np.linspace(0.0, 0.2, 5), cap=np.array([np.inf, 1.0, 2.0, 3.0, 0.0]),
        bilateral=np.array([False, True, False, False, False]),
    )  # fmt: skip


def refused(call) -> str:
    """The error's field, and behind it one clear line."""
    error = refusal(call)
    return f"{error.field}|{error}"


@few
@given(arrays(float, 3, elements=st.floats(-5, 5)), st.sampled_from([0.0, 0.1, 1.0, 3.0]))
def test_the_projection_is_moreaus(x, friction):
    """P = P_K(x) exactly if p is in K, x − p in the polar cone, and both are orthogonal."""
    mu, x_T = np.full(3, friction), np.roll(x, 1)
    p_N, p_T = project(mu, x, x_T)
    r_N, r_T = x - p_N, x_T - p_T
    assert (np.abs(p_T) <= mu * p_N + 1e-12).all()
    assert (r_N <= -mu * np.abs(r_T) + 1e-12).all()
    assert np.allclose(p_N * r_N + p_T * r_T, 0.0, atol=1e-12)
    if friction == 0.0:  # the cone is a half-line: what pulls is projected on its end, however small its shear
        assert np.array_equal(np.stack([p_N, p_T]), np.stack([np.maximum(x, 0.0), 0.0 * x]))


HELD = local(np.eye(2), np.zeros(2), [1.0], [[1.0], [0.0]], [-1.0])


@pytest.mark.parametrize(
    ("problem", "r", "lam", "expected"),
    [
        # one contact pushed in by one, W = 1, q = (−1, 0): r − u = (1, 0) always, so F = r − (1, 0)
        *((local(np.eye(2), [-1.0, 0.0], [1.0]), (r, 0.0), None, error)
          for r, error in ((0.0, 1.0), (0.5, 0.5), (1.0, 0.0), (3.0, 2.0 / 3.0))),
        # on the cone at r = (1, 1), μ = 1: u = (0, −1) opposes friction, u = (0, 1) does not: P(0, 0) = 0, F = r
        *((local(np.zeros((2, 2)), [0.0, slip], [1.0]), (1.0, 1.0), None, error)
          for slip, error in ((-1.0, 0.0), (1.0, 1.0))),
        # λ such that nothing moves: r_N = 2 instead of 1 is off by |1| / (1 + |s|) = 0.5, and by nothing else
        (HELD, (2.0, 0.0), [-2.0], 0.5), (HELD, (1.0, 0.0), [-1.0], 0.0),
    ],
)  # fmt: skip
def test_siconos_error(problem, r, lam, expected):
    assert siconos_error(problem, np.array(r), lam and np.array(lam)) == pytest.approx(expected, abs=1e-15)


def test_three_solutions():
    """Each passes Siconos' measure, others do not; the one problem is the other."""
    for u, r in THREE_STATES.values():
        assert np.allclose(THREE.displacements(np.array(r), NOTHING), u, rtol=0, atol=1e-15)
        assert siconos_error(THREE, np.array(r)) < 1e-15
        assert siconos_error(THREE, r * np.array([1.0, -1.0]) + [0.1, 0.0]) > 1e-2
    again = local_problem(one_contact())
    assert np.allclose(again.W, THREE.W, rtol=0, atol=1e-14)
    assert np.allclose(again.q, THREE.q, rtol=0, atol=1e-14)


@few
@given(st.integers(0, 10**6), st.sampled_from([6, 8, 12, 20]), st.integers(0, 2))
def test_condensed_and_original_have_the_same_solutions(seed, n, equalities):
    """Either solution passes the other's certificate, rows dependent (n < 10) or not, and the energies agree."""
    qvi = random_qvi(seed, n=n, equalities=equalities)
    solution = solve_qvi(qvi)
    if not solution.solved:
        return
    problem = local_problem(qvi)
    assert len(problem.s) == max(10 - (n - equalities), 0)
    state = state_of(problem, solution)
    assert np.allclose(problem.displacements(state.r, state.lam), state.u, rtol=0, atol=1e-8 * np.abs(state.u).max())
    assert siconos_error(problem, state.r, state.lam) < 1e-6
    u = solved(problem).u
    m_N, m_T = qvi.W * u[0::2], -qvi.W * u[1::2]
    z, _, _, nu = Compliance(qvi).state(np.concatenate([m_N, m_T]))
    assert certify(qvi, z, m_N, m_T, nu).accuracy < 1e-7
    above = qvi.energy(solution.z) - qvi.energy(qvi.bonded)
    energy = 0.5 * state.r @ problem.W @ state.r + problem.q @ state.r
    rest = 0.5 * problem.q @ np.linalg.lstsq(problem.W, problem.q, rcond=1e-10)[0]
    assert energy + rest == pytest.approx(above, rel=1e-7, abs=1e-9)


def test_friction_has_the_signs_of_the_problem():
    """One contact pressed by 2, pushed by 0.4 and 2: r_N = −w σ_N ≥ 0, r_T = w σ_T, u_T = −λ_T against it."""
    state = solved(local_problem(two_contacts()))
    assert np.allclose(state.r, [1.0, 0.2, 2.0, -0.6], atol=1e-10)
    assert np.allclose(state.u, [0.0, 0.0, 0.0, 0.85], atol=1e-10)


def test_springs_take_the_place_of_equations():
    """Solutions tend to those of the problem with equations like one over the stiffness."""
    problem = local_problem(random_qvi(0, n=8))
    assert len(problem.s) == 2
    exact, errors = solved(problem).r, []
    for factor in (1e4, 1e6):
        springs = problem.penalised(factor)
        assert (springs.V.shape, len(springs.s)) == ((len(problem.q), 0), 0)
        errors.append(np.abs(solved(springs).r - exact).max() / np.abs(exact).max())
    assert errors[1] < 0.03 * errors[0] < 1e-3


def test_every_law_survives_an_archive(tmp_path):
    qvi = with_every_law(4)
    solution = solve_qvi(qvi)
    assert solution.solved
    save_qvi(tmp_path / "a.npz", qvi, solution)
    again, found = load_qvi(tmp_path / "a.npz")
    assert all((getattr(qvi, name) != getattr(again, name)).nnz == 0 for name in "KNTA")
    for name in ("f", "n0", "t0", "mu", "W", "b", "cohesion", "cap", "bilateral"):
        assert np.array_equal(getattr(qvi, name), getattr(again, name))
    content = (tmp_path / "a.npz").read_bytes()
    save_qvi(tmp_path / "a.npz", again, found)
    assert (tmp_path / "a.npz").read_bytes() == content
    assert np.array_equal(again.traces.interpolation, qvi.traces.interpolation)
    for name in ("z", "normal_multiplier", "tangential_multiplier", "equality_multiplier", "threshold"):
        assert np.array_equal(getattr(found, name), getattr(solution, name))
    for name in ("status", "method", "message", "iterations", "versions", "corrections", "form"):
        assert getattr(found, name) == getattr(solution, name)
    assert found.certificate.accuracy == pytest.approx(solution.certificate.accuracy, rel=1e-6)
    assert np.allclose(solve_qvi(again).z, solution.z, rtol=0, atol=1e-12)


def test_a_proof_of_infeasibility_survives_an_archive(tmp_path):
    qvi = dragged_block(0.5)
    solution = solve_qvi(qvi)
    save_qvi(tmp_path / "a.npz", qvi, solution)
    _, found = load_qvi(tmp_path / "a.npz")
    assert found.status is Status.INFEASIBLE
    assert all(np.array_equal(a, b) for a, b in zip(found.farkas, solution.farkas, strict=True))


def test_a_solution_is_not_believed_but_certified_again(tmp_path):
    qvi = random_qvi(1)
    solution = solve_qvi(qvi)
    assert solution.solved
    save_qvi(tmp_path / "a.npz", qvi, replace(solution, z=solution.z * 1.001))
    _, found = load_qvi(tmp_path / "a.npz")
    assert not found.solved
    assert "certificate failed" in found.message


def test_the_layout_is_that_of_fclib(tmp_path):
    """Names, types and shapes that its C functions read; strings end in a zero."""
    problem = local_problem(random_qvi(0, n=8))
    write_fclib(tmp_path / "a.hdf5", problem, solved(problem), title="A title")
    with h5py.File(tmp_path / "a.hdf5") as file:
        local = file["fclib_local"]
        assert local["spacedim"][()].tolist() == [2]
        for name, shape in (("W", (10, 10)), ("V", (10, 2)), ("R", (2, 2))):
            group = local[name]
            m, n, nz, nzmax = (int(group[key][0]) for key in ("m", "n", "nz", "nzmax"))
            assert (m, n, nz) == (*shape, -1)
            assert all(group[key].dtype == np.int32 for key in ("m", "n", "nz", "nzmax", "p", "i"))
            assert (group["p"].shape, group["i"].shape, group["x"].shape) == ((n + 1,), (nzmax,), (nzmax,))
        assert [local["vectors"][name].shape for name in ("q", "mu", "s")] == [(10,), (5,), (2,)]
        assert [file["solution"][name].shape for name in ("u", "r", "l")] == [(10,), (10,), (2,)]
        kind = local["info/title"].id.get_type()
        assert (kind.get_size(), kind.get_strpad()) == (len("A title") + 1, h5py.h5t.STR_NULLTERM)


def test_what_has_no_place_or_does_not_fit_is_refused(tmp_path):
    for laws in ({"cohesion": np.full(5, 0.1)}, {"cap": np.full(5, 2.0)}, {"bilateral": np.arange(5) == 2}):
        assert str(*laws) in refused(lambda laws=laws: local_problem(random_qvi(0).with_law(**laws)))
    assert "shape (3,)" in refused(lambda: siconos_error(THREE, np.zeros(3)))
    assert siconos_error(THREE, np.array([np.nan, 0.0])) == np.inf
    path = tmp_path / "a.hdf5"
    for u in (np.zeros(3), np.array([np.nan, 0.0])):
        refused(lambda u=u: write_fclib(path, THREE, ContactState(u, np.zeros(2), NOTHING)))
    solution = solve_qvi(random_qvi(1))
    for other in (random_qvi(2), random_qvi(1, m=4)):
        assert "another problem" in refused(lambda other=other: save_qvi(path, other, solution))
    refused(lambda: save_qvi(path, "qvi"))
    refused(lambda: save_qvi(tmp_path, random_qvi(1)))
    refused(lambda: write_fclib(tmp_path / "no" / "a.hdf5", THREE))
    assert not any(tmp_path.iterdir())
    save_qvi(path, random_qvi(1), solution)  # an equal one is no other


@pytest.mark.parametrize(
    ("changes", "word"),
    [({"format": np.array("another")}, "another"), ({"f": None}, "f"), ({"version": np.array(2)}, "version 2"),
     ({"f": np.array([np.nan] * 12)}, "NaN"), ({"mu": np.full(5, -1.0)}, "mu"),
     ({"K_indices": np.full(144, 99)}, "indices"), ({"solution_record": np.array("{")}, "save_qvi"),
     ({"solution_z": np.ones(3)}, "shape (3,)")],
)  # fmt: skip
def test_broken_archives(tmp_path, changes, word):
    path, qvi = tmp_path / "a.npz", random_qvi(0)
    path.write_bytes(b"PK")
    assert "save_qvi" in refused(lambda: load_qvi(path))
    path.unlink()
    assert "No such file" in refused(lambda: load_qvi(path))
    save_qvi(path, qvi, solve_qvi(qvi))
    with np.load(path) as archive:
        content = {name: archive[name] for name in archive.files} | changes
    np.savez(path, **{name: value for name, value in content.items() if value is not None})
    assert word in refused(lambda: load_qvi(path))


EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def tiny(tmp_path):
    path = tmp_path / "tiny.toml"
    plate = compressed_plate(0.2, (2, 2))
    save_problem(path, plate, title="Tiny plate", description="Two by two cells, squeezed.")
    return path


@pytest.mark.parametrize("form", ["full", "condensed"])
def test_a_converged_quadratic_program_has_the_solution_of_the_contact_problem(form):
    """The minimiser for the friction bound of the solution is the solution; for the cold bound it is not."""
    result = solve(compressed_plate(0.1, (8, 8)))
    qvi, z = result.solution.problem, result.solution.z
    found = dict(programs_of("p", qvi, qvi.pressure(z)))
    assert set(found) == {f"p_{f}_{b}" for f in ("full", "condensed") for b in ("converged", "cold")}
    errors = []
    for bound in ("converged", "cold"):
        P, q, G, h = (found[f"p_{form}_{bound}"][letter] for letter in "PqGh")
        problem = qpsolvers.Problem(P, q, G, h)
        x = qpsolvers.solve_problem(problem, solver="clarabel", tol_feas=1e-12, tol_gap_abs=1e-13, tol_gap_rel=1e-13).x
        rows = G[: 2 * qvi.m] @ x  # −n0 and thr − t0 above the bound: tractions are rows + (n0, t0)
        n0 = -h[: qvi.m]
        t0 = (h[2 * qvi.m :] - h[qvi.m : 2 * qvi.m]) / 2.0
        wanted = qvi.tractions(z)
        errors.append(float(np.abs(rows + np.concatenate([n0, t0]) - wanted).max() / np.abs(wanted).max()))
    assert errors[0] < 1e-5
    assert errors[1] > 1e-3


def read(path):
    """Forces at the points, title, description and sizes of the vectors of a file of FCLIB's layout."""
    with h5py.File(path) as file:
        group = file["fclib_local"]
        texts = [group[f"info/{name}"][()].decode() for name in ("title", "description")]
        return file["solution/r"][()] if "solution" in file else None, *texts, set(group["vectors"])


def test_export_commands(tmp_path, tiny):
    """A problem file becomes .hdf5 and .npz, with a penalty without equations or solution."""
    for kind, file in (("fclib", tmp_path / "a.hdf5"), ("npz", tmp_path / "a.npz")):
        out = told(command("export", kind, tiny, file))
        assert "solved" in out
        errors = [float(error) for error in re.findall(r"Siconos error (\S+)", out)]
        assert len(errors) == (kind == "fclib")
        assert max(errors, default=0.0) < 1e-8
    r, title, description, vectors = read(tmp_path / "a.hdf5")
    assert (title, vectors) == ("Tiny plate", {"q", "mu"})
    assert "squeezed. Dimensionless. Units" in description
    force = float(description.split("thickness ")[1].split(",")[0])
    expected = solve(load_problem(tiny).problem).contacts["plate"].normal_force
    qvi, solution = load_qvi(tmp_path / "a.npz")
    assert r[0::2].sum() == pytest.approx(-qvi.resultant(solution.z), rel=1e-12)
    assert force * r[0::2].sum() == pytest.approx(expected, rel=1e-9)
    assert command("export", "fclib", tiny, tmp_path / "a.hdf5", "--penalty", "1e6")[0] == 0
    assert read(tmp_path / "a.hdf5")[::3] == (None, {"q", "mu"})


def test_what_cannot_be_carried_is_written(tmp_path):
    source = EXAMPLES / "dragged_block_slides.toml"
    status, out, _ = command("export", "fclib", source, tmp_path / "a.hdf5")
    assert status == 1
    assert "infeasible" in out
    assert command("export", "npz", source, tmp_path / "a.npz")[0] == 1
    assert load_qvi(tmp_path / "a.npz")[1].status is Status.INFEASIBLE
