"""A right result passes; one with anything wrong in it does not, and the verification names what."""

import json
from dataclasses import fields, replace

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    InputError,
    Material,
    RectilinearMesh,
    RigidPlate,
    Symmetry,
    Traction,
    solve,
    solve_history,
)
from qvi_contact.gallery import compressed_plate
from qvi_contact.result import ContactResult, Energies, PlateMotion
from qvi_contact.solution.contact_line import ContactLine, ContactState
from qvi_contact.verification import verify_result
from solvers import Certificate, Status, certify
from solvers.certificate.certificate import EXPONENTS
from solvers.inner.direct_clarabel import DirectClarabel

pytestmark = pytest.mark.usefixtures(
    "bogner_fox_schmit"
)  # states and numbers of grids; triangles: test_triangle_results

FREE = [Traction(side, x=0.0, y=0.0) for side in ("left", "right")]
PERFECT = Certificate(dict.fromkeys(EXPONENTS, 0.0), 1e-8, {"stress": 1.0, "displacement": 1.0, "energy": 1.0})


def lifted_block():
    """Pressed at its left end, pulled at its right: open, stick and slip."""
    top = Traction("top", x=2.0, y=lambda x, y: -30.0 + 25.0 * x + 0.0 * y)
    mesh = RectilinearMesh.rectangle((4, 2), width=2.0)
    ground = Contact("bottom", friction=0.3, cohesion=0.2, shear_limit=30.0, name="ground")
    return ContactProblem(mesh, Material(1e3, 0.3), [ground, top, Traction("left", y=0.0), Displacement("left", x=0.0),
                                                     Traction("right", x=0.0, y=0.0)])  # fmt: skip


def driven_plate():
    """A plate driven by force, whose motion is a multiplier of its balance."""
    contact = Contact("top", friction=0.4, plate=RigidPlate(force_x=2.0, force_y=-10.0), name="plate")
    conditions = [Contact("bottom", friction=0.5, name="ground"), contact, *FREE]
    return ContactProblem(RectilinearMesh.rectangle((3, 2)), Material(1e3, 0.2), conditions)


def sheared(offset):
    fixed = [*FREE, Displacement("top", x=0.0, y=-2e-3)]
    ground = Contact("bottom", friction=0.2, offset=offset, name="ground")
    return ContactProblem(RectilinearMesh.rectangle((4, 2), 2.0, 1.0), Material(1e4, 0.2), [ground, *fixed])


def column(shear):
    top = Traction("top", x=shear, y=-1.0)
    sides = [Traction("left", x=0.0, y=-shear), Traction("right", x=0.0, y=shear)]
    return ContactProblem(RectilinearMesh.rectangle((2, 2)), Material(1e3, 0.3), [Contact("bottom", 0.5), top, *sides])


@pytest.fixture(scope="module")
def plate():
    result = solve(compressed_plate(0.2, (4, 3), width=1.5, grading=0.8))
    assert set(result.contacts["plate"].state) == {ContactState.STICK, ContactState.SLIP}
    return result


@pytest.fixture(scope="module")
def lifted():
    result = solve(lifted_block())
    assert result.status is Status.SOLVED, result.message
    assert set(result.contacts["ground"].state) == {0, 1, 2}
    return result


@pytest.fixture(scope="module")
def driven():
    result = solve(driven_plate())
    assert result.status is Status.SOLVED, result.message
    return result


@pytest.fixture(scope="module")
def cycle():
    return solve_history([sheared(2e-3 * np.sin(t)) for t in (0.5, 1.5, 2.5)])


def failed(result, tolerance=None):
    """Names of the checks that fail."""
    return {row.name for row in verify_result(result, tolerance).failures}


def changed(result, **changes):
    """The same result with another solution."""
    return ContactResult(result.discretization, replace(result.solution, **changes))


def claiming(result, **claims):
    """The same result with other things to say of itself."""
    other = changed(result)
    other.__dict__.update(claims)
    return other


def with_line(result, name, **changes):
    return claiming(result, contacts={**result.contacts, name: replace(result.contacts[name], **changes)})


class TestRightResults:
    """They pass, whatever the method and the problem."""

    def test_condensed(self, plate, lifted, driven):
        for result in (plate, lifted, driven):
            assert failed(result) == set()

    @pytest.mark.parametrize(
        "options",
        [{"inner": "direct:clarabel"}, {"method": "uzawa", "tolerance": 1e-4},
         {"inner": "strict:clarabel"}, {"inner": "strict-direct:clarabel"}],
        ids=str,
    )  # fmt: skip
    def test_other_methods(self, options):
        result = solve(compressed_plate(0.2, (4, 3)), **options)
        assert result.status is Status.SOLVED, result.message
        assert failed(result) == set()

    def test_steps_of_a_history_with_the_slip_before_them(self, cycle):
        assert np.abs(cycle.steps[1].discretization.contacts[0].offset - cycle.steps[1].discretization.offsets()).any()
        for step in cycle.steps:
            assert failed(step) == set()

    @pytest.mark.parametrize("friction", [0.0, 0.2])
    def test_strongly_graded_cells(self, friction):
        assert failed(solve(compressed_plate(friction, (12, 12), grading=0.5))) == set()

    def test_a_proof_that_the_load_cannot_be_carried(self):
        result = solve(column(0.6))
        assert result.status is Status.INFEASIBLE
        assert failed(result) == set()
        y, nu = result.solution.farkas
        assert failed(changed(result, farkas=(np.zeros_like(y), nu))) == {"proof"}
        assert failed(changed(result, farkas=None)) == set()  # the mechanism is proof enough
        assert failed(changed(result, status=Status.INFEASIBLE_ON_MESH, farkas=None)) == {"status", "proof"}

    def test_an_inaccurate_one_passes_at_its_accuracy_only(self, plate):
        z = plate.solution.z * (1.0 + 1e-7)
        accuracy = verify_result(changed(plate, z=z)).rows
        assert accuracy
        inaccurate = certify(
            plate.solution.problem, z, plate.solution.normal_multiplier, plate.solution.tangential_multiplier
        )
        result = changed(plate, z=z, status=Status.INACCURATE, message="inaccurate", certificate=inaccurate)
        assert "stationarity" in failed(result)
        assert failed(result, 1e-5) == set()


class TestWrongNumbers:
    """Each fails by itself."""

    @pytest.mark.parametrize("kind", ["normal", "tangential"])
    def test_one_multiplier_with_its_sign_flipped(self, lifted, kind):
        name = f"{kind}_multiplier"
        values = getattr(lifted.solution, name)
        loaded = np.flatnonzero(np.abs(values) > 1e-6 * np.abs(values).max())
        assert len(loaded) > 2
        for point in loaded[::6]:
            flipped = values.copy()
            flipped[point] *= -1.0
            assert {"stationarity", "sign"} <= failed(changed(lifted, **{name: flipped})), point

    def test_a_multiplier_of_an_equation_with_its_sign_flipped(self, driven):
        for row, value in enumerate(driven.solution.equality_multiplier):
            flipped = driven.solution.equality_multiplier.copy()
            flipped[row] = -value
            assert "stationarity" in failed(changed(driven, equality_multiplier=flipped))

    @pytest.mark.parametrize(
        ("field", "check"),
        [("normal_stress", "tractions"), ("tangential_stress", "tractions"), ("friction_bound", "tractions"),
         ("gap", "gap and slip"), ("slip", "gap and slip"), ("x", "points"), ("weights", "points")],
    )  # fmt: skip
    def test_one_value_of_a_contact_shifted_by_a_hundred_thousandth_of_itself(self, lifted, field, check):
        values = getattr(lifted.contacts["ground"], field)
        for point in np.flatnonzero(np.abs(values) > 1e-3 * np.abs(values).max())[::12]:
            shifted = values.copy()
            shifted[point] *= 1.0 + 1e-5
            wrong = with_line(lifted, "ground", **{field: shifted})
            forces = {"ground: forces"} if field in ("normal_stress", "tangential_stress", "weights") else set()
            assert f"ground: {check}" in failed(wrong) <= {f"ground: {check}", "energies", *forces}

    @pytest.mark.parametrize("rows", ["N", "T"])
    def test_unknowns_with_which_one_traction_is_shifted_so(self, plate, rows):
        """By the least change in energy that does it."""
        qvi, z = plate.solution.problem, plate.solution.z
        tractions = {"N": qvi.normal(z), "T": qvi.tangential(z)}[rows]
        for point in range(0, qvi.m, 6):
            row = getattr(qvi, rows)[point].toarray().ravel()
            softness = qvi.equality_system.solve(row)[0]
            shifted = z + 1e-5 * tractions[point] / (row @ softness) * softness
            assert "stationarity" in failed(changed(plate, z=shifted)), point

    def test_one_state_mislabelled(self, lifted):
        state = lifted.contacts["ground"].state
        for point in range(0, len(state), 8):
            wrong = state.copy()
            wrong[point] = (wrong[point] + 1) % 3
            assert failed(with_line(lifted, "ground", state=wrong)) == {"ground: states"}

    def test_a_contact_of_another_length(self, plate):
        line = plate.contacts["plate"]
        shorter = {f.name: getattr(line, f.name)[:-1] for f in fields(ContactLine) if np.ndim(getattr(line, f.name))}
        wrong = claiming(plate, contacts={"plate": replace(line, **shorter)}, energies=plate.energies)
        assert {"plate: tractions", "plate: states", "plate: points"} <= failed(wrong)

    @pytest.mark.parametrize("name", [field.name for field in fields(Energies)])
    def test_an_energy(self, plate, name):
        value = getattr(plate.energies, name)
        assert failed(claiming(plate, energies=replace(plate.energies, **{name: value * (1.0 + 1e-6)}))) == {"energies"}

    def test_the_motion_of_a_plate(self, driven):
        motion = driven.plates["plate"]
        wrong = PlateMotion(motion.x, motion.y * (1.0 + 1e-6), motion.rotation)
        assert failed(claiming(driven, plates={"plate": wrong})) == {"plate: motion"}

    def test_the_misfit_of_tractions(self, plate):
        assert failed(claiming(plate, traction_misfit=1.0)) == {"traction_misfit"}

    def test_the_friction_of_the_problem_that_was_solved(self, plate):
        """A solution of another problem, certificate and all."""
        other = plate.discretization.qvi.changed(mu=1.001 * plate.discretization.qvi.mu)
        result = solve(replace(plate.discretization, qvi=other))
        assert result.certificate.passed
        wrong = ContactResult(plate.discretization, result.solution)
        assert {"problem", "friction"} <= failed(wrong)

    def test_a_load_that_was_left_out(self, lifted):
        """The algebraic problem of a body without its load: the forces of prescribed tractions are not its own."""
        lighter = replace(lifted.discretization, problem=lifted_block())
        conditions = [c if c.edges != "top" else Traction("top", x=2.0, y=-30.0) for c in lifted.problem.conditions]
        lighter = replace(lighter, problem=replace(lifted.problem, conditions=conditions))
        assert "problem" in failed(ContactResult(lighter, lifted.solution))

    def test_contacts_that_are_not_there(self, plate):
        for contacts in ({}, {**plate.contacts, "wall": plate.contacts["plate"]}):
            assert "entries" in failed(claiming(plate, contacts=contacts))

    def test_a_plate_that_is_not_there(self, plate):
        assert failed(claiming(plate, plates={**plate.plates, "wall": PlateMotion()})) == {"entries"}

    def test_the_name_of_a_contact(self, plate):
        wrong = claiming(plate, contacts={"plate": replace(plate.contacts["plate"], name="wall")})
        assert failed(wrong) == {"entries"}
        assert "plate.name" in verify_result(wrong).table()

    @pytest.mark.parametrize("measures", [{}, {"normal": np.nan}, {"normal": -1.0}])
    @pytest.mark.parametrize("status", [Status.SOLVED, Status.INACCURATE])
    def test_certificates_that_are_none(self, plate, status, measures):
        complete = {**plate.certificate.measures, **measures} if measures else {}
        lie = replace(plate.certificate, measures=complete)
        assert "status" in failed(changed(plate, certificate=lie, status=status, message=status.value))

    def test_what_is_not_a_number(self, plate):
        z = plate.solution.z.copy()
        z[0] = np.nan
        assert {"stationarity", "friction", "status"} <= failed(changed(plate, z=z))


class TestWrongWords:
    """What a result says of its success has to follow from the numbers."""

    @pytest.fixture
    def unfinished(self):
        result = solve(compressed_plate(0.2, (4, 4)), method="fixed-point", max_iterations=1)
        assert result.status is Status.MAX_ITERATIONS
        return result

    def test_solved_said_of_a_failure(self, unfinished):
        assert "status" not in failed(unfinished)
        lie = changed(unfinished, status=Status.SOLVED, message="solved", certificate=PERFECT)
        assert {"status", "claimed measures", "friction"} <= failed(lie)

    @pytest.mark.parametrize("status", [Status.INACCURATE, Status.INFEASIBLE, Status.MAX_ITERATIONS])
    def test_another_status_said_of_a_solution(self, plate, status):
        word = status.value.replace("_", " ")
        assert "status" in failed(changed(plate, status=status, message=word))

    def test_a_message_that_says_something_else(self, plate):
        assert failed(changed(plate, message="infeasible")) == {"status"}

    def test_measures_better_than_they_are(self, unfinished):
        assert "claimed measures" not in failed(unfinished)
        assert "claimed measures" in failed(changed(unfinished, certificate=PERFECT))

    @pytest.mark.parametrize("what", ["m_T", "nothing done"])
    def test_a_back_end_that_lies(self, monkeypatch, what):
        """It says solved and hands back something else: never solved, and never verified if forged to be."""
        honest = DirectClarabel.solve

        def lying(self, *arguments):
            found = honest(self, *arguments)
            if what == "nothing done":
                return replace(found, status=Status.SOLVED, z=0.0 * found.z, m_N=0.0 * found.m_N, m_T=0.0 * found.m_T)
            values = getattr(found, what).copy()
            values[0] += 0.1 * np.abs(found.m_T).max()
            return replace(found, status=Status.SOLVED, **{what: values})

        monkeypatch.setattr(DirectClarabel, "solve", lying)
        result = solve(compressed_plate(0.2, (4, 3)), inner="direct:clarabel", max_iterations=8)
        assert result.status is not Status.SOLVED
        forged = changed(result, status=Status.SOLVED, message="solved", certificate=PERFECT)
        assert {"status", "claimed measures"} <= failed(forged)


class TestOutcome:
    """What a verification tells."""

    def test_table_and_document(self, plate):
        found = verify_result(plate)
        lines = found.table().splitlines()
        assert lines[-1] == found.summary()
        assert lines[-1].startswith(f"verified: {sum(row.passed is True for row in found.rows)} checks passed at 1e-08")
        document = json.loads(json.dumps(found.document(), allow_nan=False))
        assert document["passed"] is True
        assert document["status"] == "solved"
        assert [check["name"] for check in document["checks"]] == [row.name for row in found.rows]
        assert all(check["meaning"] for check in document["checks"])

    def test_failures_are_marked_and_named(self, plate):
        wrong = with_line(plate, "plate", state=np.zeros_like(plate.contacts["plate"].state))
        found = verify_result(wrong)
        assert not found.passed
        assert found.summary() == "not verified: plate: states"
        assert [line.split("  ")[0] for line in found.table().splitlines() if line.endswith("FAILED")] == [
            "plate: states"
        ]
        assert found.document()["failures"] == ["plate: states"]

    def test_infinite_values_are_none_in_the_document(self, plate):
        missing = changed(plate, z=np.full_like(plate.solution.z, np.nan))
        document = json.loads(json.dumps(verify_result(missing).document(), allow_nan=False))
        assert {check["value"] for check in document["checks"] if check["name"] == "stationarity"} == {None}

    def test_facts(self, plate):
        names = {row.name: row for row in verify_result(plate).rows}
        assert names["uniqueness"].passed is None
        assert names["uniqueness"].value == plate.solution.uniqueness.sharper
        slow = solve(compressed_plate(0.2, (4, 3)), inner="direct:clarabel", variant="plain")
        assert {row.name: row.value for row in verify_result(slow).rows}["contraction"] == slow.solution.contraction

    @pytest.mark.parametrize("tolerance", [0.0, 1.0, -1e-8, np.nan, "1e-8", True])
    def test_bad_tolerance(self, plate, tolerance):
        with pytest.raises(InputError, match="tolerance"):
            verify_result(plate, tolerance)

    def test_something_else_than_a_result(self):
        with pytest.raises(InputError, match="ContactResult"):
            verify_result(None)

    def test_a_history_has_steps(self, cycle):
        with pytest.raises(InputError, match=r"\.steps"):
            verify_result(cycle)

    def test_it_says_what_it_cannot_check(self, plate):
        row = verify_result(plate).rows[-1]
        assert (row.name, row.passed) == ("not checked", None)
        assert "iterations" in row.meaning

    def test_a_tolerance_that_is_too_loose_unless_it_is_asked_for(self):
        result = solve(compressed_plate(0.2, (3, 3)), tolerance=2e-4)
        assert failed(result) == {"tolerance"}
        assert failed(result, 2e-4) == set()


def test_symmetric_halves_verify_with_one_tied_contact():
    """Contacts that limit nothing have tractions, and no rows in the problem."""
    conditions = [Symmetry("left"), Contact("bottom", 0.0, law="tied", name="glue"), Traction("right", x=0.0, y=0.0)]
    conditions.append(Contact("top", friction=0.2, gap=-1e-3, name="plate"))
    result = solve(ContactProblem(RectilinearMesh.rectangle((3, 3)), Material(1e3, 0.3), conditions))
    assert failed(result) == set()
    line = result.contacts["glue"]
    assert failed(with_line(result, "glue", normal_stress=line.normal_stress * (1.0 + 1e-5))) >= {"glue: tractions"}
