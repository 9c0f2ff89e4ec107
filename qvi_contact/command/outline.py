"""What a problem file was understood to say, for `qvi-contact check`."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any, Final

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray
from qvi_contact.basics.schema import Varying, keys_of
from qvi_contact.discretization.discretization import discretize
from qvi_contact.files.export import element_of
from qvi_contact.files.problem_file import ProblemFile
from qvi_contact.mesh.edges import Edges
from qvi_contact.problem.conditions import DRIVES, Condition, Contact, Traction, components
from qvi_contact.problem.fields import Expression, Polynomial, along_edges
from qvi_contact.problem.problem import ContactProblem, direction_of

_NOISE: Final = 1e-12  # share of all that acts below which a resultant is rounding


def outline(file: ProblemFile, given: Mapping[str, Any]) -> tuple[ContactProblem, dict[str, Any]]:
    """The problem at its first time, and that in words and numbers that JSON can hold; discretises, does not solve.

    `given` are arguments for `discretize` that override the file's.
    """
    options = {**file.solve_options, **given}
    with file.named_errors(), np.errstate(all="ignore"):  # what is not finite is refused
        discretization = discretize(file.problem, **{**file.element, **given})
    problem, mesh, qvi = discretization.problem, discretization.problem.mesh, discretization.qvi
    low, high = mesh.vertices.min(axis=0).tolist(), mesh.vertices.max(axis=0).tolist()
    smallest, largest = mesh.cell_range
    counts = np.bincount(problem.cell_materials, minlength=len(problem.materials))
    return problem, {
        "title": file.title,
        "description": file.description,
        "units": {"length": file.units.length, "stress": file.units.stress},
        "mesh": {
            "cells": mesh.cell_count,
            "vertices": len(mesh.vertices),
            "x": [low[0], high[0]],
            "y": [low[1], high[1]],
            "smallest": smallest,
            "largest": largest,
        },
        "element": element_of(discretization),
        "unknowns": qvi.n,
        "contact_points": qvi.m,
        "materials": [
            {"young": material.young, "poisson": material.poisson, "plane": material.plane, "cells": int(count)}
            | ({} if material.strength is None else {"strength": material.strength.kind})
            for material, count in zip(problem.materials, counts, strict=True)
        ],
        "boundary": [_condition(problem, condition) for condition in problem.conditions],
        "loads": list(_loads(problem)),
        "solve": dict(options),
        "refine": dict(file.refine_options),
        "times": list(file.times),
        "sweep": None if file.sweep is None else asdict(file.sweep),
        "remarks": [file.units.filled(remark) for remark in discretization.remarks],
    }


def _condition(problem: ContactProblem, condition: Condition) -> dict[str, Any]:
    """A condition: fields are numbers, or functions as they are written."""
    found: dict[str, Any] = {
        "kind": type(condition).__name__.lower(),
        "edges": condition.edges,
        "length": float(problem.mesh.edges(condition.edges).length.sum()),
    }
    if isinstance(condition, Contact):
        found |= {"name": condition.name, "law": condition.law, "joint": condition in problem.joints}
        if condition.plate is not None:
            drives = {name: getattr(condition.plate, name) for pair in DRIVES.items() for name in pair}
            found["plate"] = {name: value for name, value in drives.items() if value is not None}
    for name, each in keys_of(type(condition)).items():
        if isinstance(each.kind, Varying):
            value = getattr(condition, name)
            if isinstance(value, Polynomial):
                value = {"polynomial": [list(row) for row in value.coefficients]}
            found[name] = value.text if isinstance(value, Expression) else value
    return found


def _loads(problem: ContactProblem) -> Iterator[dict[str, Any]]:
    """Resultants of the prescribed tractions and of the body force b = −∇φ, ∫ b dx = −∮ φ n ds."""
    mesh = problem.mesh
    acting = list[tuple[str, list[tuple[Edges, FloatArray, Field]]]]()  # of each load: edges, directions, components
    for condition in problem.conditions:
        if isinstance(condition, Traction):
            edges, given = mesh.edges(condition.edges), components(condition)
            acting.append((condition.name, [(edges, direction_of(n, edges), value) for n, value in given.items()]))
    if callable(problem.body_potential):
        acting.append(("body", [(mesh.boundary, -mesh.boundary.normal, problem.body_potential)]))
    for name, parts in acting:
        points = []  # x, y, weight, t_x, t_y
        for edges, direction, value in parts:
            found = along_edges(mesh, edges, "load", value)
            x, y = mesh.points_along(edges.take(found.edge), found.t)
            weights = (found.weights * edges.length[found.edge, None]).ravel()
            vectors = found.values.ravel()[:, None] * np.repeat(direction[found.edge], found.t.shape[1], axis=0)
            points.append(np.column_stack([x.ravel(), y.ravel(), weights, vectors]))
        x, y, weights, t_x, t_y = np.concatenate(points).T
        size = np.hypot(t_x, t_y)
        if not size.any() or (parts[0][0] is mesh.boundary and np.ptp(size) == 0.0):  # a pressure all around is none
            continue
        largest = float(weights @ size)
        moment = weights @ (x * t_y - y * t_x)
        sums = {"x": (weights @ t_x, largest), "y": (weights @ t_y, largest)}
        sums["moment"] = moment, largest * float(np.hypot(x, y).max())
        yield {"name": name} | {n: float(s) if abs(s) > _NOISE * most else 0.0 for n, (s, most) in sums.items()}
