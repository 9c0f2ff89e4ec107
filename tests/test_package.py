"""What is installed: packages, version, names that clash."""

import ast
import re
import subprocess
import sys
import sysconfig
import tomllib
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest
from packaging.requirements import Requirement

import qvi_contact
import qvi_contact.types

ROOT = Path(__file__).parent.parent
DECLARED = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT = DECLARED["project"]
FOR_DEVELOPERS = {"browser", "dev", "docs", "peers", "test"}


def test_every_package_is_on_the_page():
    """Of those that users install."""
    extras = PROJECT["optional-dependencies"]
    lines = PROJECT["dependencies"] + [line for name in extras.keys() - FOR_DEVELOPERS for line in extras[name]]
    required = {Requirement(line).name for line in lines} - {PROJECT["name"]}  # extras of extras
    section = (ROOT / "docs" / "installation.md").read_text(encoding="utf-8").split("## Licences")[1]
    assert sorted(re.findall(r"`([\w-]+)`", " ".join(re.findall(r"^\|.+", section, re.M)))) == sorted(required)


def test_a_file_of_the_user_that_has_taken_the_name_of_a_package_is_named(tmp_path):
    path = tmp_path / "solvers.py"
    path.write_text("mine = True\n", encoding="utf-8")
    folders = [str(tmp_path), str(Path(qvi_contact.__file__).parents[1]), sysconfig.get_path("purelib")]
    code = f"import sys; sys.path[:0] = {folders}; from qvi_contact import QVIError"
    done = subprocess.run([sys.executable, "-I", "-S", "-c", code], capture_output=True, text=True, check=False)
    assert f"ImportError: 'solvers' is {path}" in done.stderr


@pytest.mark.parametrize(("package", "patterns"), DECLARED["tool"]["setuptools"]["package-data"].items())
def test_all_files_of_a_package_are_installed(package, patterns):
    """But for code, and the reports, which belong to the repository."""
    folder = ROOT / package
    installed = {path for pattern in patterns for path in folder.glob(pattern)}
    files = [path for path in folder.rglob("*") if path.is_file() and path.suffix not in (".py", ".pyc")]
    assert [path for path in files if path not in installed and folder / "reports" not in path.parents] == []


def test_the_citation_has_the_version_and_the_licence():
    found = pytest.importorskip("yaml").safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert PROJECT["dynamic"] == ["version"]
    assert str(found["version"]) == qvi_contact.__version__
    assert found["license"] == PROJECT["license"]


def test_names_of_types_are_on_the_page():
    section = (ROOT / "docs" / "api" / "problem.md").read_text(encoding="utf-8").split("## Types in signatures")[1]
    rows = [line.split(" | ")[0] for line in section.splitlines() if line.startswith("| `")]
    assert sorted(re.findall(r"`(\w+)`", " ".join(rows))) == qvi_contact.types.__all__
    gallery = import_module("qvi_contact.gallery")
    assert not any(isinstance(getattr(gallery, name), ModuleType) for name in gallery.__all__)


PACKAGES = ("solvers", "qvi_contact", "comparisons")


@cache
def modules(package):
    """Name of each module and what it imports, those that only lead to others left out."""
    found = []
    folder = Path(import_module(package).__file__).parent  # of what is installed, where only that is there
    for path in sorted(folder.rglob("*.py")):
        parts = path.relative_to(folder.parent).with_suffix("").parts
        if len(parts) > 2 or parts[-1] not in ("__init__", "__main__"):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            found.append((".".join(parts).removesuffix(".__init__"), set(imports(tree))))
    return found


def imports(node):
    """Modules imported below a node, be it inside a function, but not for types only."""
    if isinstance(node, ast.ImportFrom):
        yield node.module
    elif isinstance(node, ast.Import):
        yield from (name.name for name in node.names)
    elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
        for below in node.orelse:
            yield from imports(below)
    elif not isinstance(node, ast.expr):
        for below in ast.iter_child_nodes(node):
            yield from imports(below)


def room(module):
    return ".".join(module.split(".")[:2])


def reached(start, graph):
    seen, waiting = set(), [start]
    while waiting:
        for other in graph.get(waiting.pop(), ()):
            if other not in seen:
                seen.add(other)
                waiting.append(other)
    return seen


@pytest.mark.parametrize("package", ["solvers", "qvi_contact"])
def test_no_room_leads_back_to_itself(package):
    graph = {}  # the rooms that each room imports from
    for name, targets in modules(package):
        others = {room(target) for target in targets if target.startswith(package + ".")}
        graph.setdefault(room(name), set()).update(others - {room(name)})
    assert len(graph) > 10
    assert [name for name in graph if name in reached(name, graph)] == []
    graph = {"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}
    assert [name for name in graph if name in reached(name, graph)] == ["a", "b", "c"]


@pytest.mark.parametrize("package", PACKAGES[:-1])
def test_packages_import_from_those_below_only(package):
    above = PACKAGES[PACKAGES.index(package) + 1 :]
    wrong = [
        (name, target) for name, targets in modules(package) for target in targets if target.split(".")[0] in above
    ]
    assert wrong == []
