"""Everything works with what `pip install .` brings alone, and says which library it misses.

A process of its own sees the project and the distributions that its requirements without extras lead to, nothing else
of the environment.
"""

import json
import subprocess
import sys
import tomllib
from importlib.metadata import distribution
from pathlib import Path

import pytest
from packaging.requirements import Requirement

import qvi_contact
import solvers

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

SCRIPT = """
import json, sys
sys.prefix, sys.path[:0] = sys.argv[1], sys.argv[1:2]

from qvi_contact import InputError, TriangleMesh, limit_load_factor, load_problem, solve, solve_companion
from qvi_contact.bracket import bracket
from qvi_contact.gallery import compressed_plate
from qvi_contact.plots import result_figure
from solvers import available
from solvers.factorisation import available_backends, missing_backends

found = {"backends": list(available_backends()), "missing": missing_backends(), "inner": list(available())}
ways = [{}, {"law_on": "points"}, {"method": "pivoting"}, {"method": "uzawa"}]
ways += [{"inner": name} for name in ("qp:clarabel", "qp:osqp", "socp:clarabel")]
plate = compressed_plate(0.2, (2, 2))
found["solves"] = [solve(plate, tolerance=1e-6, **way).status for way in ways]

large = solve(compressed_plate(0.2, (8, 8)))
found["large"] = [large.status, large.solution.factorisation.split(",")[0]]
found["bracket"] = bracket(solve(plate)).relative_error
dragged = load_problem(f"{sys.argv[2]}/examples/dragged_block_holds.toml").problem
limit = limit_load_factor(dragged, ["drag"])
found["limit"] = [limit.lower, limit.upper]

asked = {
    "mkl": lambda: solve(plate, factorisation="pardiso"),
    "qp:cvxopt": lambda: solve(plate, inner="qp:cvxopt"),
    "qp:daqp": lambda: solve(plate, inner="qp:daqp"),
    "tables": lambda: large.contacts["plate"].to_frame(),
    "pictures": lambda: result_figure(large),
    "mesh files": lambda: TriangleMesh.load(f"{sys.argv[1]}/body.vtk"),
}
found["messages"] = {}
for what, ask in asked.items():
    try:
        ask()
    except InputError as error:
        found["messages"][what] = str(error)
print(json.dumps(found))
"""


def _closure(requirements):
    """Names of the distributions that requirements lead to, their own extras included."""
    found, waiting = set(), [(requirement, "") for requirement in requirements]
    while waiting:
        requirement, extra = waiting.pop()
        if (requirement.marker and not requirement.marker.evaluate({"extra": extra})) or requirement in found:
            continue
        found.add(requirement)
        needed = [Requirement(text) for text in distribution(requirement.name).requires or ()]
        waiting += [(each, extra) for each in needed for extra in ("", *requirement.extras)]
    return {requirement.name for requirement in found}


@pytest.fixture(scope="module")
def base(tmp_path_factory):
    """What the process has found."""
    folder = tmp_path_factory.mktemp("base")
    (folder / "body.vtk").touch()
    for name in _closure(map(Requirement, PROJECT["dependencies"])):
        package = distribution(name)
        for top in {file.parts[0] for file in package.files} - {"..", "__pycache__"}:
            if not (folder / top).exists():
                (folder / top).symlink_to(package.locate_file(top))
    for module in (qvi_contact, solvers):
        (folder / module.__name__).symlink_to(Path(module.__file__).parent)
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", SCRIPT, str(folder), str(ROOT)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_everything_is_solved_by_the_fronts(base):
    assert base["backends"] == ["multifrontal"]
    assert set(base["solves"]) == {"solved"}
    assert base["large"] == ["solved", "multifrontal"]
    assert 0.0 < base["bracket"] < 0.2
    assert base["limit"] == pytest.approx([1.0 / 0.99, 1.0 / 0.99], rel=1e-6)
    assert not [name for name in base["inner"] if "cvxopt" in name]


def test_what_is_missing_names_its_library(base):
    assert base["missing"].keys() == {"pardiso"}
    assert {what: message.split("pip install ")[1].split(")")[0] for what, message in base["messages"].items()} == {
        "mkl": "mkl", "qp:cvxopt": "cvxopt", "qp:daqp": "daqp", "tables": "pandas",
        "pictures": "matplotlib", "mesh files": "meshio",
    }  # fmt: skip
