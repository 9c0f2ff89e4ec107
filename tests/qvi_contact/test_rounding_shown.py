"""Rounding beside the problem's own units is shown as 0, wherever a result is shown."""

import re

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    Material,
    Traction,
    TriangleMesh,
    solve,
    solve_history,
)
from qvi_contact.basics.shown import Rounding, shown
from qvi_contact.bracket import bracket
from qvi_contact.bracket import document as bracket_document
from qvi_contact.command.page.numbers import contact_rows, resultant_rows, step_tables
from qvi_contact.command.report import history_lines, result_lines
from qvi_contact.files.export import summary
from qvi_contact.units import Units

UNITS = Units(length="mm", stress="MPa")


@pytest.fixture(scope="module")
def squeezed():
    """A symmetric block on rough ground: T, the forces along x and the moments are rounding; another ground is far."""
    mesh = TriangleMesh.rectangle((4, 2), 2.0, 1.0)
    conditions = [
        Contact("bottom", friction=0.0, name="ground"),
        Contact("right", friction=0.5, gap=1.0, name="wall"),
        Traction("left", x=0.0, y=0.0),
        Displacement("top", x=0.0, y=-1e-3),
    ]
    return solve(ContactProblem(mesh, Material(2.1e5, 0.3), conditions))


def tiny(text):
    """Numbers in a text that are smaller than 1e-9, other than zero; those of certificates left out."""
    numbers = re.findall(r"-?\d+\.?\d*e-\d+", text.replace("−", "-"))
    return [number for number in numbers if abs(float(number)) < 1e-9]


def test_the_helper():
    assert [shown(value, 1e-7) for value in (1.4e-16, -1e-7, 1.1e-7, -2.0)] == ["0", "0", "1.1e-07", "-2"]
    assert shown(1.23456789, digits=3) == "1.23"
    assert shown(0.0) == "0"


def test_sizes_follow_the_units_of_the_problem(squeezed):
    scales = squeezed.discretization.scales
    found = scales.rounding
    assert found.force == pytest.approx(1e-9 * scales.stress * scales.length)
    assert found.moment == pytest.approx(1e-9 * scales.stress * scales.length**2)
    assert found.rotation == pytest.approx(1e-9 * scales.compliance * scales.stress)
    assert found.energy == pytest.approx(1e-9 * scales.energy)
    assert Rounding.largest([Rounding.of(1.0, 5.0, 2.0), Rounding.of(3.0, 4.0, 2.0)]).displacement == 5e-9


def test_tables_of_a_result(squeezed):
    """Contact rows and resultants, on the terminal, on the page and in notebooks."""
    assert abs(squeezed.contacts["ground"].tangential_force) < 1e-8
    assert squeezed.contacts["wall"].shown_forces == ("0", "0")
    report = "\n".join(line for line in result_lines(squeezed, UNITS) if "certificate" not in line)
    assert "normal [N/mm]" in report
    rows = [cell for row in (*contact_rows(squeezed.contacts.values()), *resultant_rows(squeezed)) for cell in row[1:]]
    for text in (report, " ".join(rows), squeezed.contacts["wall"]._repr_html_(), repr(squeezed.contacts["ground"])):
        assert not tiny(text)
    ground = contact_rows([squeezed.contacts["ground"]])[0]
    assert ground[2] == "0"
    assert float(ground[1]) == pytest.approx(squeezed.contacts["ground"].normal_force, rel=1e-4)


def test_tables_of_load_steps(squeezed):
    history = solve_history([squeezed.problem, squeezed.problem])
    lines = "\n".join(history_lines(history, (0.0, 1.0), UNITS))
    assert not tiny(lines)
    assert "energy lost in friction: 0 N mm/mm" in lines
    assert [row[3] for row in step_tables(history.steps, (0.0, 1.0))[0]] == ["0", "0"]


def test_sentences_carry_the_unit():
    """A load that jumps inside an edge is not met at points: remarks and reasons say by how many MPa."""
    mesh = TriangleMesh.rectangle((3, 2), 3.0, 2.0)
    conditions = [
        Contact("bottom", friction=0.0),
        Displacement("left", x=0.0),
        Displacement("left", y=0.0),
        Traction("right", x=0.0, y=0.0),
        Traction("top", x=0.0, y=lambda x, y: np.where(x < 0.4, -1.0, 0.0 * y)),
    ]
    result = solve(ContactProblem(mesh, Material(2.1e5, 0.3), conditions))
    found = bracket(result)
    told = bracket_document.document(found, UNITS)
    sentences = [*summary(result, UNITS)["remarks"], *told["reasons"], told["message"], *result_lines(result, UNITS)]
    assert sum(re.search(r"\d MPa\b", sentence) is not None for sentence in sentences) >= 4
    assert not any(re.search(r"\[(stress|length)\]", sentence) for sentence in sentences)
    nameless = summary(result)["remarks"]
    assert any("[stress]" in sentence for sentence in nameless)  # what the user has not named keeps its dimension
    assert UNITS.filled("[stress] of 'a' is 2 [stress], 3 [length]") == "[stress] of 'a' is 2 MPa, 3 mm"
    assert UNITS.filled("from 2 to 3 [stress × length] on 'a'") == "from 2 to 3 N/mm on 'a'"
    assert Units(stress="MPa").filled("2 [stress × length]") == "2 [stress × length]"
