"""Generated problems end in a certified answer, a documented status, or one of the project's own exceptions.

A long search: ``QVI_CONTACT_EFFORT=10 python -m pytest tests/qvi_contact/test_generated.py``.
"""

import json
import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    InputError,
    Material,
    Polynomial,
    QVIError,
    RectilinearMesh,
    Region,
    RigidPlate,
    Symmetry,
    Traction,
    solve,
)
from qvi_contact.solution.contact_line import ContactState
from solvers import Status
from tests.effort import examples

pytestmark = pytest.mark.usefixtures("bogner_fox_schmit")  # the judge samples bicubic functions

SEEN: Counter[str] = Counter()
OPEN, STICK, SLIP, CLOSED = ContactState
SIDES = ("bottom", "right", "top", "left")
NONSENSE = (float("nan"), float("inf"), -1.0, True, "1", None)

sizes = st.sampled_from([0.1, 0.5, 1.0, 1.0, 2.0])
small = st.integers(-3, 3).map(lambda k: k * 1e-3)
loads = st.sampled_from([0.0, 0.0, 0.0, 1.0, -1.0, -10.0, 5.0])


@st.composite
def fields(draw, values):
    """A number, a polynomial, a function, one that jumps; rarely nonsense."""
    value = draw(values)
    kind = draw(st.integers(0, 150))
    if kind == 77:
        return draw(
            st.sampled_from([*NONSENSE, lambda x, _: x[:1, None, None], lambda x: x, lambda x, _: np.log(-x - 1e9)])
        )
    if kind in (20, 40, 60, 80):
        return Polynomial([[value, value / 2.0], [value]])
    if kind in (30, 50, 70, 90):
        return lambda x, y: value * np.abs(np.sin(3.0 * x + y))
    if kind in (35, 55, 75, 95):
        return lambda x, _: np.where(x < 0.7, value, 0.0)
    return value


positive = st.sampled_from([0.0, 0.05, 0.2, 0.5, 1.0, 3.0])
frictions = fields(positive)
tractions = fields(loads)
moves = fields(small)


@st.composite
def meshes(draw):
    """Up to 4 × 4 cells, graded, with random cells left out."""
    lines = []
    for _ in range(2):
        steps = draw(st.lists(sizes, min_size=1, max_size=4))
        lines.append(draw(st.sampled_from([0.0, 0.0, -1.0, 100.0])) + np.concatenate([[0.0], np.cumsum(steps)]))
    shape = len(lines[1]) - 1, len(lines[0]) - 1
    active = np.ones(shape, dtype=bool)
    kind = draw(st.sampled_from(["full", "full", "corner", "hole", "step", "random"]))
    if kind == "corner":
        active[draw(st.integers(1, 3)) :, draw(st.integers(1, 3)) :] = False
    elif kind == "hole":
        active[1:-1, 1:-1] = False
    elif kind == "step":
        active[draw(st.integers(1, 3)) :, : draw(st.integers(0, 2))] = False
        active[draw(st.integers(1, 3)) :, draw(st.integers(2, 4)) :] = False
    elif kind == "random":
        active = np.array(draw(st.lists(st.sampled_from([True, True, True, False]), min_size=16, max_size=16)))
        active = active.reshape(4, 4)[: shape[0], : shape[1]]
    mesh = RectilinearMesh(*lines, active)
    for number in range(draw(st.sampled_from([0, 0, 0, 1, 2]))):
        axis = draw(st.integers(0, 1))
        inside = lines[1 - axis][1:-1]
        if len(inside):
            mesh = mesh.with_joint(
                f"joint {number}", ("horizontal", "vertical")[axis], draw(st.sampled_from(list(inside)))
            )
    if draw(st.integers(0, 3)) == 0:
        side = draw(st.sampled_from(SIDES))
        along = lines[0] if side in ("bottom", "top") else lines[1]
        mesh = mesh.with_edges("part", side, stop=along[draw(st.integers(1, len(along) - 1))])
    return mesh


@st.composite
def plates(draw):
    """Forces that mostly press a top or right side."""
    given = {"force_x": -3.0, "force_y": -3.0, "moment": 0.5, "none": None}
    chosen = draw(st.sets(st.sampled_from(["force_x", "force_y", "moment"]), min_size=1))
    forces = {name: given[name] * draw(st.sampled_from([1.0, 1.0, 0.0, -0.1])) for name in chosen}
    return RigidPlate(**forces, pivot=draw(st.sampled_from([(0.0, 0.0), (1.0, 1.0)])))


@st.composite
def contacts(draw, edges, joint=False):
    """Every law on an edge set."""
    law = draw(st.sampled_from(["unilateral"] * 5 + ["bilateral", "tied"]))
    plate = draw(plates()) if draw(st.integers(0, 5 if not joint else 60)) == 3 else None
    if law == "tied":
        return Contact(edges, 0.0, draw(moves), draw(moves), law=law, plate=plate)
    return Contact(
        edges,
        draw(frictions),
        draw(moves),
        draw(st.sampled_from([0.0, 0.0, 0.0, 1e-3])),
        "",
        draw(fields(positive)) if draw(st.booleans()) else 0.0,
        draw(fields(positive)) if draw(st.integers(0, 3)) == 0 else None,
        law,
        plate,
    )


@st.composite
def conditions_of(draw, edges):
    """What rules both components of an edge set."""
    kind = draw(st.sampled_from(["free", "free", "traction", "contact", "contact", "symmetry", "held", "mixed"]))
    if kind == "free":
        return [Traction(edges, 0.0, 0.0)]
    if kind == "traction":
        return [Traction(edges, draw(tractions), draw(tractions))]
    if kind == "contact":
        return [draw(contacts(edges))]
    if kind == "symmetry":
        return [Symmetry(edges)]
    if kind == "held":
        return [Displacement(edges, draw(moves), draw(moves))]
    return [Displacement(edges, x=draw(moves)), Traction(edges, y=draw(tractions))]


materials = st.builds(
    Material,
    st.sampled_from([1000.0, 1000.0, 1.0, 2.1e5, 1e11]),
    st.sampled_from([0.3, 0.0, 0.45, -0.3, 0.2, 0.1, 0.5]),
    st.sampled_from(["stress", "stress", "stress", "strain"]),
)


def boundary_conditions(mesh, draw):
    """One group a side; of holes and parts separately where they are named. "part" and its rest may overlap."""
    found = []
    for side in SIDES:
        if "part" in mesh.edge_names and mesh.named["part"].side == side:
            rest = mesh.named["part"].stop
            lines = mesh.x if side in ("bottom", "top") else mesh.y
            if rest < lines[-1]:
                mesh = mesh.with_edges("rest", side, start=rest)
                found += draw(conditions_of("rest"))
            found += draw(conditions_of("part"))
        else:
            found += draw(conditions_of(side))
    return mesh, found


@st.composite
def problems(draw):
    """A body on some support under some load: usually sensible, sometimes not."""
    mesh = draw(meshes())
    supported = draw(st.integers(0, 3)) > 0
    mesh, conditions = boundary_conditions(mesh, draw)
    if supported and "part" not in mesh.edge_names:  # pressed on ground, which most problems want
        conditions = [condition for condition in conditions if condition.edges not in ("bottom", "top")]
        conditions += [
            draw(contacts("bottom")),
            draw(st.sampled_from([Traction("top", 0.0, -3.0), Displacement("top", 1e-3, -3e-3)])),
        ]
    for name in mesh.joint_names:
        conditions.append(draw(contacts(name, joint=True)))
    material = draw(materials)
    regions = []
    if draw(st.integers(0, 3)) == 0:
        regions.append(Region(Material(material.young * 10.0, 0.2, material.plane), x=(mesh.x[0], mesh.x[1])))
    potential = draw(st.sampled_from([0.0, 0.0, 0.0, 5.0, lambda _, y: 2.0 * y, lambda x, y: x * y]))
    return ContactProblem(mesh, material, conditions, potential, regions)


def check_solved(result):
    """Certificate, balance, contact law, dissipation, and numbers that can be written down."""
    assert result.certificate.passed
    mesh, unit = result.problem.mesh, result.discretization.scales.stress
    size = max(unit, np.abs(result.gauss_stress()[2]).max(initial=0.0))
    length = mesh.length
    check_balance(result, size * length)
    stress = result.certificate.scales["stress"] * unit
    tolerance = 10.0 * result.certificate.tolerance * max(stress, unit)
    for contact in result.problem.contacts:
        line = result.contacts[contact.name]
        if contact.law == "unilateral":
            assert line.normal_stress.max() <= tolerance
        assert (np.abs(line.tangential_stress) - line.friction_bound).max() <= tolerance
        numbers = {
            name: getattr(line, name).tolist()
            for name in ("normal_stress", "tangential_stress", "gap", "slip", "state")
        }
        json.dumps(numbers, allow_nan=False)
        states = {OPEN, CLOSED} if line.frictionless else {OPEN, STICK, SLIP}
        assert set(line.state) <= ({STICK} if contact.law == "tied" else states)
    energies = result.energies
    work = abs(energies.strain) + abs(energies.load) + abs(energies.dissipation)
    assert energies.strain >= 0.0
    assert energies.dissipation >= -10.0 * result.certificate.tolerance * max(work, result.discretization.scales.energy)
    motions = [vars(motion) for motion in result.plates.values()]
    json.dumps([vars(energies), motions, result.traction_misfit, list(result.remarks), result.message], allow_nan=False)


def check_balance(result, force):
    """Σ of all boundary tractions + ∫ b = 0; with b = −∇φ, ∫ b = −∮ φ n, sides being taken one by one."""
    mesh, problem = result.problem.mesh, result.problem
    total, pushed = np.zeros(3), 0.0
    for side in SIDES:
        resultant = result.resultant(side)
        total += [resultant.x, resultant.y, resultant.moment]
    row, column = np.nonzero(mesh.active)
    t, w = np.polynomial.legendre.leggauss(6)
    for index, sign in ((0, -1.0), (1, 1.0)):
        for axis in (0, 1):
            lines, others = ((mesh.x, mesh.y), (mesh.y, mesh.x))[axis]
            cell, other = ((column, row), (row, column))[axis]
            at = np.repeat(lines[cell + index][:, None], 6, axis=1)
            half = (others[other + 1] - others[other])[:, None] / 2.0
            along = others[other][:, None] + half * (1.0 + t)
            x, y = (at, along) if axis == 0 else (along, at)
            phi = problem.body_potential(x, y) if callable(problem.body_potential) else problem.body_potential
            push = -sign * w * half * (phi + 0 * x)
            total[axis] += push.sum()
            pushed += np.abs(push).sum()  # which rounds, however small what remains of it
            total[2] += (x * push if axis == 1 else -y * push).sum()
    reach = max(np.abs(mesh.x).max(), np.abs(mesh.y).max())
    allowed = 1e-7 * force + 1e-13 * pushed
    assert np.abs(total[:2]).max() <= allowed
    assert abs(total[2]) <= allowed * reach


def ends_well(draw, **options):
    """Build and solve; note how it ended."""
    complaint, result = None, None
    try:
        result = solve(draw(problems()), **options)
    except QVIError as error:
        complaint = error
    if result is None:
        assert isinstance(complaint, InputError)
        assert "\n" not in str(complaint)
        SEEN["refused"] += 1
        return
    SEEN[str(result.status.value)] += 1
    assert isinstance(result.status, Status)
    assert result.status.value.replace("_", " ") in result.message
    assert math.isfinite(result.iterations)
    if result.status is Status.SOLVED:
        check_solved(result)
    else:
        assert result.status.advice in result.message or "Take another inner solver" in result.message
        if not result.has_state:
            with pytest.raises(InputError, match="no stress state"):
                _ = result.contacts or result.nodal


def generated(count):
    """A test's settings: the same problems every time, and no search for simpler ones, which takes minutes."""
    quiet = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much]
    phases = (Phase.generate,)
    return settings(
        max_examples=examples(count),
        deadline=None,
        derandomize=True,
        phases=phases,
        suppress_health_check=quiet,
    )


@generated(45)
@given(st.data())
def test_condensed(data):
    ends_well(data.draw, method="condensed", max_iterations=100)


@generated(20)
@given(st.data())
def test_fixed_point(data):
    ends_well(data.draw, method="fixed-point", max_iterations=40)


@generated(12)
@given(st.data())
def test_another_inner_solver(data):
    ends_well(data.draw, inner="direct:clarabel", form="full", max_iterations=25)


@generated(10)
@given(st.data())
def test_uzawa(data):
    ends_well(data.draw, method="uzawa", max_iterations=300, tolerance=1e-5)


def test_most_are_solved_and_all_ends_occur():
    """The problems above are not all nonsense, nor all easy; also keeps the generator honest."""
    if len(SEEN) < 2:
        pytest.skip("run on its own")
    total = sum(SEEN.values())
    assert total >= examples(48)
    assert SEEN["solved"] >= 0.4 * total
    assert SEEN["infeasible"] >= 0.03 * total
    assert SEEN["refused"] >= 0.08 * total
