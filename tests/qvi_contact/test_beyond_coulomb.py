"""What a user is told where no equilibrium within Coulomb's bounds was found and nothing proves that there is none."""

import pytest
from click.testing import CliRunner

from qvi_contact import Contact, ContactProblem, Material, RectilinearMesh, Traction, save_problem, solve
from qvi_contact.cli import group
from solvers import Status


def block(drag):
    """A block on a contact that cannot open, and whose friction carries 0.3, dragged."""
    loads = [Traction("top", x=drag, y=-1.0), Traction("left", x=0.0, y=0.0), Traction("right", x=0.0, y=0.0)]
    ground = Contact("bottom", 0.3, law="bilateral", name="ground")
    return ContactProblem(RectilinearMesh.rectangle((4, 2), 2.0, 1.0), Material(1e3, 0.2), [ground, *loads])


@pytest.fixture(scope="module")
def dragged():
    """A block dragged by 3.3 times what friction carries."""
    return block(1.0)


@pytest.mark.parametrize("method", ["condensed", None])
def test_the_message_names_the_limit_analysis(dragged, method):
    result = solve(dragged, method=method)
    assert result.status is Status.INNER_INFEASIBLE
    for word in ("Coulomb", "beyond", "limit_load_factor", "qvi-contact limit", "initial="):
        assert word in result.message


@pytest.mark.parametrize(("drag", "limited"), [(0.31, {"max_iterations": 5}), (0.5, {"max_iterations": 60})])
def test_the_end_of_iterations_does_so_too(drag, limited):
    result = solve(block(drag), method="condensed", **limited)
    assert result.status is Status.MAX_ITERATIONS
    for word in ("max_iterations", "beyond what friction can carry", "limit_load_factor", "qvi-contact limit"):
        assert word in result.message


def test_the_command_line_says_the_same(dragged, tmp_path):
    save_problem(tmp_path / "dragged.toml", dragged)
    done = CliRunner().invoke(
        group, ["solve", str(tmp_path / "dragged.toml"), "--method", "condensed"], standalone_mode=False
    )
    assert done.return_value == 1
    assert "qvi-contact limit" in " ".join(done.output.split())
    assert "Traceback" not in done.output
