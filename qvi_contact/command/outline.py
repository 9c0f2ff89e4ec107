"""What a problem file was understood to say, for `qvi-contact check`."""

from typing import Any

import numpy as np

from qvi_contact.basics.checks import FloatArray, evaluate
from qvi_contact.discretization.discretization import discretize
from qvi_contact.discretization.loads import LOAD_POINTS
from qvi_contact.element.hermite import gauss_legendre
from qvi_contact.files.problem_builder import FIELDS, TABLES
from qvi_contact.files.problem_file import ProblemFile
from qvi_contact.mesh.rectilinear import HORIZONTAL, GridEdges, RectilinearMesh
from qvi_contact.problem.conditions import Condition, Contact, Traction
from qvi_contact.problem.fields import Expression, Polynomial
from qvi_contact.problem.problem import ContactProblem


def outline(file: ProblemFile) -> dict[str, Any]:
    """The problem at its first time in words and numbers that JSON can hold; discretises, but does not solve."""
    problem, mesh = file.problem, file.problem.grid
    with file.named_errors(), np.errstate(all="ignore"):  # what is not finite is refused
        discretization = discretize(problem)
    qvi = discretization.qvi
    return {
        "title": file.title,
        "description": file.description,
        "units": {"length": file.units.length, "stress": file.units.stress},
        "mesh": _mesh(mesh),
        "unknowns": qvi.n,
        "contact_points": qvi.m,
        "materials": _materials(problem),
        "boundary": [_condition(problem, condition) for condition in problem.conditions],
        "loads": _loads(problem),
        "solve": dict(file.solve_options),
        "times": list(file.times),
        "remarks": list(discretization.remarks),
    }


def _mesh(mesh: RectilinearMesh) -> dict[str, Any]:
    return {
        "columns": mesh.shape[1],
        "rows": mesh.shape[0],
        "cells": int(mesh.active.sum()),
        "x": [float(mesh.x[0]), float(mesh.x[-1])],
        "y": [float(mesh.y[0]), float(mesh.y[-1])],
        "smallest": float(min(np.diff(mesh.x).min(), np.diff(mesh.y).min())),
        "largest": float(max(np.diff(mesh.x).max(), np.diff(mesh.y).max())),
    }


def _materials(problem: ContactProblem) -> list[dict[str, Any]]:
    counts = np.bincount(problem.cell_materials, minlength=len(problem.materials))
    return [
        {"young": material.young, "poisson": material.poisson, "plane": material.plane, "cells": int(count)}
        for material, count in zip(problem.materials, counts, strict=True)
    ]


def _condition(problem: ContactProblem, condition: Condition) -> dict[str, Any]:
    kind = type(condition).__name__.lower()
    edges = problem.grid.edges(condition.edges)
    found: dict[str, Any] = {
        "kind": kind,
        "edges": condition.edges,
        "length": float(edges.length.sum()),
    }
    if isinstance(condition, Contact):
        found |= {"name": condition.name, "law": condition.law, "joint": condition in problem.joints}
        if condition.plate is not None:
            plate = condition.plate
            forces = {name: getattr(plate, name) for name in ("force_x", "force_y", "moment")}
            found["plate"] = {name: value for name, value in forces.items() if value is not None}
    return found | {key: _value(getattr(condition, key)) for key in FIELDS[TABLES[type(condition)]]}


def _value(field: object) -> object:
    """A number, or the function as it is written."""
    if isinstance(field, Expression):
        return field.text
    return {"polynomial": [list(row) for row in field.coefficients]} if isinstance(field, Polynomial) else field


def _loads(problem: ContactProblem) -> list[dict[str, Any]]:
    """Resultants of the prescribed tractions and of the body force b = −∇φ, ∫ b dx = −∮ φ n ds."""
    mesh = problem.grid
    found: list[dict[str, Any]] = []
    for condition in problem.cartesian_conditions:
        if isinstance(condition, Traction):
            edges = mesh.edges(condition.edges)
            x, y, weights = _points(mesh, edges)
            parts = [evaluate("traction", 0.0 if v is None else v, x, y) for v in (condition.x, condition.y)]
            if parts[0].any() or parts[1].any():
                found.append({"name": condition.name, **_resultant(x, y, weights, parts[0], parts[1])})
    x, y, weights = _points(mesh, mesh.boundary)
    potential = evaluate("body_potential", problem.body_potential, x, y)
    if np.ptp(potential) > 0.0:
        along_x = np.repeat(mesh.boundary.axis == HORIZONTAL, LOAD_POINTS)
        pull = -potential * np.repeat(mesh.boundary.sign, LOAD_POINTS)
        found.append({"name": "body", **_resultant(x, y, weights, pull * ~along_x, pull * along_x)})
    return found


def _resultant(x: FloatArray, y: FloatArray, weights: FloatArray, t_x: FloatArray, t_y: FloatArray) -> dict[str, float]:
    moment = weights @ (x * t_y - y * t_x)
    return {"x": float(weights @ t_x), "y": float(weights @ t_y), "moment": float(moment)}


def _points(mesh: RectilinearMesh, edges: GridEdges) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Gauss points x, y and weights along edges [length]."""
    t, weights = gauss_legendre(LOAD_POINTS)
    x, y = mesh.points_along(edges, t)
    return x.ravel(), y.ravel(), (edges.length[:, None] * weights).ravel()
