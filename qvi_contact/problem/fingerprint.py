"""A digest of what a problem states, by which stored answers are told from those of other problems.

Functions are compared by their values: at five points inside of every edge they belong to, or in the middle of cells.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields

import numpy as np

from qvi_contact.basics.checks import evaluate
from qvi_contact.mesh.edges import Edges
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import Condition, RigidPlate
from qvi_contact.problem.initial_strain import is_strained, stress_at_rest
from qvi_contact.problem.problem import ContactProblem

_PASSING = ("callback", "threads", "throw")  # options that change no answer
_PLACES = np.array([0.05, 0.2, 0.45, 0.7, 0.9])  # along an edge


def run_digest(problems: Sequence[ContactProblem], options: Mapping[str, object]) -> str:
    """SHA-256 of problems on one mesh and of the options they are solved with, as hexadecimal text.

    Options that are None or change no answer do not count.
    """
    told = {name: value for name, value in sorted(options.items()) if name not in _PASSING and value is not None}
    found = hashlib.sha256(mesh_digest(problems[0].mesh) + repr(told).encode())
    for number in range(len(problems)):
        found.update(problem_digest(problems[number]))
    return found.hexdigest()


def mesh_digest(mesh: TriangleMesh) -> bytes:
    """SHA-256 of vertices, cells, arcs and named parts."""
    parts: list[object] = [mesh.vertices, mesh.cells, mesh.sides]
    parts += [part for name in mesh.edge_names for part in (name, mesh.edge_set(name))]
    parts += [part for name in mesh.joint_names for part in (name, mesh.joint_set(name))]
    return _digest(iter([type(mesh).__name__, *parts]))


def problem_digest(problem: ContactProblem) -> bytes:
    """SHA-256 of everything but the mesh."""
    return _digest(_stated(problem))


def _stated(problem: ContactProblem) -> Iterator[object]:
    mesh = problem.mesh
    yield from (problem.compliances, problem.cell_materials)
    middles = mesh.vertices[mesh.cells].mean(axis=1).T
    potential = problem.body_potential
    yield evaluate("body_potential", potential, *middles) if callable(potential) else potential
    if is_strained(problem):
        yield stress_at_rest(problem, np.arange(mesh.cell_count), *middles)
    for condition in problem.conditions:
        yield type(condition).__name__
        yield from _values(condition, mesh.edges(condition.edges), mesh)


def _values(part: Condition | RigidPlate, edges: Edges, mesh: TriangleMesh) -> Iterator[object]:
    """Names and values of all fields."""
    for each in fields(part):
        value = getattr(part, each.name)
        yield each.name
        if callable(value):
            yield evaluate(each.name, value, *mesh.points_along(edges, _PLACES))
        elif isinstance(value, RigidPlate):
            yield from _values(value, edges, mesh)
        else:
            yield value


def _digest(parts: Iterator[object]) -> bytes:
    """Arrays by their bytes, everything else as it is written; numbers to the last bit."""
    found = hashlib.sha256()
    for part in parts:
        if isinstance(part, np.ndarray):
            found.update(f"{part.dtype.str}{part.shape}".encode())
            found.update(np.ascontiguousarray(part).reshape(-1).view(np.uint8).data)
        else:
            found.update(repr(part).encode())
        found.update(b"\0")
    return found.digest()
