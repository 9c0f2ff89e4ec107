"""What a problem file was understood to say, for `qvi-contact check`."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Final

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray
from qvi_contact.basics.schema import Varying, keys_of
from qvi_contact.discretization.discretization import discretize
from qvi_contact.files.export import element_of
from qvi_contact.files.problem_file import ProblemFile
from qvi_contact.mesh.edges import Edges
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import DRIVES, Condition, Contact, Traction, components
from qvi_contact.problem.fields import Expression, Polynomial, along_edges
from qvi_contact.problem.problem import ContactProblem, direction_of

_NOISE: Final = 1e-12  # share of all that acts below which a resultant is rounding


def outline(file: ProblemFile, given: Mapping[str, Any]) -> tuple[ContactProblem, dict[str, Any]]:
    """The problem at its first time, and that in words and numbers that JSON can hold; discretises, does not solve.

    Parameters
    ----------
    file : ProblemFile
        The problem.
    given : mapping
        Arguments for `discretize` that override the file's.

    """
    options = {**file.solve_options, **given}
    with file.named_errors(), np.errstate(all="ignore"):  # what is not finite is refused
        discretization = discretize(file.problem, **{**file.element, **given})
    problem = discretization.problem
    qvi = discretization.qvi
    return problem, {
        "title": file.title,
        "description": file.description,
        "units": {"length": file.units.length, "stress": file.units.stress},
        "mesh": _mesh(problem.mesh),
        "element": element_of(discretization),
        "unknowns": qvi.n,
        "contact_points": qvi.m,
        "materials": _materials(problem),
        "boundary": [_condition(problem, condition) for condition in problem.conditions],
        "loads": _loads(problem),
        "solve": dict(options),
        "refine": dict(file.refine_options),
        "times": list(file.times),
        "sweep": None if file.sweep is None else asdict(file.sweep),
        "remarks": [file.units.filled(remark) for remark in discretization.remarks],
    }


def _mesh(mesh: TriangleMesh) -> dict[str, Any]:
    vertices = mesh.vertices
    low, high = vertices.min(axis=0).tolist(), vertices.max(axis=0).tolist()
    smallest, largest = mesh.cell_range
    return {
        "cells": mesh.cell_count,
        "vertices": len(vertices),
        "x": [low[0], high[0]],
        "y": [low[1], high[1]],
        "smallest": smallest,
        "largest": largest,
    }


def _materials(problem: ContactProblem) -> list[dict[str, Any]]:
    counts = np.bincount(problem.cell_materials, minlength=len(problem.materials))
    return [
        {"young": material.young, "poisson": material.poisson, "plane": material.plane, "cells": int(count)}
        | ({} if material.strength is None else {"strength": material.strength.kind})
        for material, count in zip(problem.materials, counts, strict=True)
    ]


def _condition(problem: ContactProblem, condition: Condition) -> dict[str, Any]:
    kind = type(condition).__name__.lower()
    edges = problem.mesh.edges(condition.edges)
    found: dict[str, Any] = {
        "kind": kind,
        "edges": condition.edges,
        "length": float(edges.length.sum()),
    }
    if isinstance(condition, Contact):
        found |= {"name": condition.name, "law": condition.law, "joint": condition in problem.joints}
        if condition.plate is not None:
            drives = {name: getattr(condition.plate, name) for pair in DRIVES.items() for name in pair}
            found["plate"] = {name: value for name, value in drives.items() if value is not None}
    fields = [name for name, each in keys_of(type(condition)).items() if isinstance(each.kind, Varying)]
    return found | {name: _value(getattr(condition, name)) for name in fields}


def _value(field: object) -> object:
    """A number, or the function as it is written."""
    if isinstance(field, Expression):
        return field.text
    return {"polynomial": [list(row) for row in field.coefficients]} if isinstance(field, Polynomial) else field


def _loads(problem: ContactProblem) -> list[dict[str, Any]]:
    """Resultants of the prescribed tractions and of the body force b = −∇φ, ∫ b dx = −∮ φ n ds."""
    mesh = problem.mesh
    found: list[dict[str, Any]] = []
    for condition in problem.conditions:
        if isinstance(condition, Traction):
            edges = mesh.edges(condition.edges)
            given = [
                _along(mesh, edges, direction_of(name, edges), value) for name, value in components(condition).items()
            ]
            x, y, weights, t = (np.concatenate(parts) for parts in zip(*given, strict=True))
            if t.any():
                found.append({"name": condition.name, **_resultant(x, y, weights, *t.T)})
    if callable(problem.body_potential):
        x, y, weights, pull = _along(mesh, mesh.boundary, -mesh.boundary.normal, problem.body_potential)
        if np.ptp(np.hypot(*pull.T)) > 0.0:
            found.append({"name": "body", **_resultant(x, y, weights, *pull.T)})
    return found


def _along(
    mesh: TriangleMesh, edges: Edges, direction: FloatArray, value: Field
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Points x, y and weights (n,) [length] along edges, and a component of the traction there as vectors (n, 2)."""
    found = along_edges(mesh, edges, "load", value)
    x, y = mesh.points_along(edges.take(found.edge), found.t)
    weights = found.weights * edges.length[found.edge, None]
    vectors = found.values.ravel()[:, None] * np.repeat(direction[found.edge], found.t.shape[1], axis=0)
    return x.ravel(), y.ravel(), weights.ravel(), vectors


def _resultant(x: FloatArray, y: FloatArray, weights: FloatArray, t_x: FloatArray, t_y: FloatArray) -> dict[str, float]:
    parts = {"x": weights * t_x, "y": weights * t_y, "moment": weights * (x * t_y - y * t_x)}
    size = float(weights @ np.hypot(t_x, t_y))
    largest = {"x": size, "y": size, "moment": size * float(np.hypot(x, y).max())}
    found = {name: float(values.sum()) for name, values in parts.items()}
    return {name: value if abs(value) > _NOISE * largest[name] else 0.0 for name, value in found.items()}
