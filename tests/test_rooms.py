"""Imports go one way: between the packages, and between the rooms of each."""

import ast
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = ("solvers", "qvi_contact", "comparisons")


@cache
def modules(package):
    """Name of each module and what it imports, those that only lead to others left out."""
    found = []
    for path in sorted((ROOT / package).rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
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


def arrows(package):
    """Rooms that each room of a package imports from."""
    found = {}
    for name, targets in modules(package):
        others = {room(target) for target in targets if target.startswith(package + ".")}
        found.setdefault(room(name), set()).update(others - {room(name)})
    return found


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
    graph = arrows(package)
    assert len(graph) > 10
    assert [name for name in graph if name in reached(name, graph)] == []
    graph = {"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}
    assert [name for name in graph if name in reached(name, graph)] == ["a", "b", "c"]


def test_the_lab_knows_no_experiment():
    """Framework apart from experiments: whatever is in it serves all of them."""
    wrong = [
        (name, target)
        for name, targets in modules("comparisons")
        if room(name) == "comparisons.lab"
        for target in targets
        if room(target) not in ("comparisons", "comparisons.lab") and target.startswith("comparisons")
    ]
    assert wrong == []


@pytest.mark.parametrize("package", PACKAGES[:-1])
def test_packages_import_from_those_below_only(package):
    above = PACKAGES[PACKAGES.index(package) + 1 :]
    wrong = [
        (name, target) for name, targets in modules(package) for target in targets if target.split(".")[0] in above
    ]
    assert wrong == []
