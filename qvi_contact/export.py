"""Results as files for other programs: JSON summary, NumPy archive, and VTU files for ParaView, by meshio.

Every file is written completely or not at all.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import fields
from html import escape
from importlib.util import find_spec
from math import isqrt
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from qvi_contact.basics.checks import FloatArray, IntArray, instance_of, whole_number
from qvi_contact.basics.writing import check_suffix, replacing, write_text
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.space import FAMILY
from qvi_contact.element.triangle import bernstein, triangle_lattice
from qvi_contact.errors import InputError
from qvi_contact.files.archive import json_ready, solution_arrays, write_archive
from qvi_contact.mesh.edges import cross
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.contact_line import SUMMARY, ContactLine
from qvi_contact.solution.result import PLATE_COLUMNS, RESULTANT, ContactResult, Energies, contact_numbers
from qvi_contact.solution.stress import principal_stresses, sample_body, von_mises
from qvi_contact.units import Units
from solvers.basics.types import load

if TYPE_CHECKING:
    from qvi_contact.bracket import Bracket
    from qvi_contact.limit import LimitLoad

_NOT_STORED: Final = ("name", "ends", "pore_pressure", "rounding", "senses", "frictionless")
"""Fields of contacts that the archive leaves out: they follow from the mesh, or exist only with a fluid."""

SUMMARY_VERSION: Final = 1
"""Version of `summary`; it grows when an entry changes its meaning or is removed, not when one is added."""


def summary(result: ContactResult, units: Units | None = None) -> dict[str, Any]:
    """A result, solved or failed, as a document of plain values for JSON.

    Physical quantities are ``{"value": …, "unit": …}``, the rest plain. Missing values, such as contacts of an
    infeasible problem or measures that could not be computed, are None. Signs are those of `ContactLine` and
    `Resultant`: the largest pressure is the largest −σ_N, the largest shear and slip are absolute values.
    """
    _check_given(result, units)
    units, mesh, solution = units or Units(), result.problem.mesh, result.solution
    document = {
        "format": "qvi_contact summary",
        "version": SUMMARY_VERSION,
        "units": {name: getattr(units, name) for name in ("length", "stress", "force", "moment", "energy")},
        "status": str(result.status),
        "solved": solution.solved,
        "message": result.message,
        "advice": result.status.advice,
        "remarks": [units.filled(remark) for remark in result.remarks],
        "certificate": {
            name: getattr(solution.certificate, name)
            for name in ("passed", "tolerance", "accuracy", "worst", "measures", "limits", "signed")
        },
        **{
            name: getattr(solution, name)
            for name in ("contraction", "iterations", "method", "inner", "factorisation", "form")
        },
        "seconds": solution.timings,
        "versions": solution.versions,
        "mesh": {
            "cells": mesh.cell_count,
            "nodes": len(mesh.vertices),
            "unknowns": result.discretization.qvi.n,
            "contact_points": result.discretization.qvi.m,
            "smallest_cell": _quantity(mesh.cell_range[0], units.length),
            "largest_cell": _quantity(mesh.cell_range[1], units.length),
        },
        "element": element_of(result.discretization),
    }
    state_keys = ("contacts", "plates", "energies", "resultants", "traction_misfit")
    document |= _state(result, units) if result.has_state else dict.fromkeys(state_keys)
    return {key: json_ready(value) for key, value in document.items()}


def write_json(path: str | Path, result: ContactResult, units: Units | None = None) -> None:
    """Write `summary` as a JSON file in UTF-8; `InputError` if the file cannot be written."""
    write_text(path, json.dumps(summary(result, units), indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def write_npz(path: str | Path, result: ContactResult, units: Units | None = None, title: str = "") -> None:
    """Write everything about a result as a NumPy archive that `numpy.load` reads without pickle.

    `qvi_contact.load_result` makes the result again, and `qvi-contact verify` checks all that the file claims.
    `InputError` if there is no stress state, the suffix is not .npz, or the file cannot be written.

    "NumPy archive" in docs/formats.md describes the entries with shapes and units. If data of the problem are functions
    in Python, which no file can hold, ``problem`` is empty: the file has all fields, but cannot be checked.
    """
    check_suffix("npz", path, ".npz")
    _check_given(result, units)
    write_archive(path, {**field_arrays(result), **solution_arrays(result, units, title)})


def field_arrays(result: ContactResult) -> dict[str, Any]:
    """Mesh, stresses, contacts and energies of a result, as `write_npz` describes them."""
    x, y, stress = result.gauss_stress()
    mesh, energies = result.problem.mesh, result.energies
    names = [field.name for field in fields(ContactLine) if field.name not in _NOT_STORED]
    names += ["normal_force", "tangential_force"]
    fluid_fields = ["pore_pressure", "effective_normal_stress", "effective_normal_force"]
    return {
        "vertices": mesh.vertices,
        "cells": mesh.cells,
        "material": result.problem.cell_materials,
        "gauss_x": x,
        "gauss_y": y,
        "gauss_stress": stress,
        **{
            f"{name}.{field}": getattr(line, field)
            for name, line in result.contacts.items()
            for field in (names + fluid_fields if line.has_fluid else names)
        },
        "energies": np.array([getattr(energies, field.name) for field in fields(Energies)]),
        "traction_misfit": result.traction_misfit,
        **{f"{name}.motion": np.array([m.x, m.y, m.rotation]) for name, m in result.plates.items()},
    }


def _state(result: ContactResult, units: Units) -> dict[str, Any]:
    """The part of the summary that needs a stress state."""
    contacts, all_numbers = {}, contact_numbers(result)
    for name, line in result.contacts.items():
        effective = {"effective_normal_force": line.effective_normal_force} if line.has_fluid else {}
        contacts[name] = {
            **_quantities(all_numbers[name], SUMMARY, units),
            **_quantities(effective, dict.fromkeys(effective, "force"), units),
            "length": {state: _quantity(length, units.length) for state, length in line.lengths.items()},
            "points": len(line.x),
        }
    plates = {name: _quantities(all_numbers[name], PLATE_COLUMNS, units) for name in result.plates}
    energies = vars(result.energies)
    return {
        "contacts": contacts,
        "plates": {name: {key.removeprefix("moved_"): n for key, n in each.items()} for name, each in plates.items()},
        "energies": _quantities(energies, dict.fromkeys(energies, "energy"), units),
        "resultants": {
            name: _quantities(vars(result.resultant(name)), RESULTANT, units) for name in result.problem.mesh.edge_names
        },
        "traction_misfit": _quantity(result.traction_misfit, units.stress),
    }


def _check_given(result: object, units: object) -> None:
    """`InputError` unless the arguments are a result (not a history) and units."""
    instance_of(ContactResult, "result", result, "give a ContactResult, such as solve returns, or one of the steps")
    Units.labels(units, {})


def element_of(discretization: Discretization) -> dict[str, Any]:
    """Name and degree of the element, and where the contact law holds, for documents."""
    return {"name": FAMILY, "degree": discretization.space.degree, "law_on": discretization.rule.law_on}


def _quantity(value: float | np.floating[Any], unit: str) -> dict[str, Any]:
    return {"value": float(value), "unit": unit}


def _quantities(numbers: Mapping[str, float], kinds: Mapping[str, str], units: Units) -> dict[str, Any]:
    """Numbers by name with their units; `kinds` has the quantity of each."""
    return {name: _quantity(numbers[name], getattr(units, kind)) for name, kind in kinds.items()}


_Data: TypeAlias = dict[str, tuple[NDArray[Any], str]]  # fields by name, each with the quantity of its unit
_SINGLE_VALUED: Final = 1e-9  # jump of the dimensionless Airy function that is rounding
_DIVISIONS: Final = 3  # of each side of the three parts of a triangle, in files of limit loads
_MAX_SUBDIVISIONS: Final = 100  # of each side of a part: ten thousand triangles


def write_vtu(
    path: str | Path,
    result: ContactResult,
    units: Units | None = None,
    subdivisions: int = 4,
    bracket: "Bracket | None" = None,
) -> None:
    """Write stresses as an unstructured VTK grid, which ParaView opens; needs the extra ``vtk`` (meshio).

    Each of the three parts of a cell is divided into subdivisions² triangles, in which fields are linear. Cells share
    no points, so that stresses along an edge may jump across it, as in the element. `InputError` if meshio is
    missing, there is no stress state, the bracket belongs to another mesh or has no displacement, the suffix is not
    .vtu, or the file cannot be written.

    With units, names of fields end with them, as in "stress [MPa]". With the bracket of the result, ``result.bracket``,
    displacements and the error of each cell are written too.

    Point data: "stress" with the components xx, yy, zz, xy, yz, xz of VTK's symmetric tensors (zz = 0 in plane stress),
    "von Mises", "principal 1" ≥ "principal 2" in the plane, "Airy function" up to an affine function (left out if a
    hole carries a force, as it has several values then); with a bracket "displacement", x, y, 0, of the displacement
    model. Cell data: "material", 0 for the body's own material or the number of the region, counted from
    1, "cell", the number of the mesh's cell; with a bracket "energy gap", the contribution of the whole cell to the
    difference between the bounds of the energy.
    """
    _check_vtu(path)
    _check_given(result, units)
    discretization, problem = result.discretization, result.problem
    samples = sample_body(result, divisions=whole_number("subdivisions", subdivisions, _MAX_SUBDIVISIONS))
    (xx, yy, xy), zero = samples.stress.T, np.zeros(len(samples.points))
    largest, smallest, _ = principal_stresses(samples.stress)
    point_data: _Data = {
        "stress": (np.column_stack([xx, yy, samples.along_z, xy, zero, zero]), "stress"),
        "von Mises": (von_mises(samples.stress, samples.along_z), "stress"),
        "principal 1": (largest, "stress"),
        "principal 2": (smallest, "stress"),
    }
    if np.abs(discretization.space.jumps(result.dofs)).max(initial=0.0) <= _SINGLE_VALUED:
        t, cells = discretization.space.lattice(subdivisions)[0], np.arange(problem.mesh.cell_count)
        airy = discretization.space.airy(discretization.coefficients(result.dofs), cells, t)
        point_data["Airy function"] = airy.ravel() * discretization.scales.airy, "airy"
    cell = samples.cells[samples.triangles[:, 0]]
    cell_data: _Data = {"material": (problem.cell_materials[cell], ""), "cell": (cell, "")}
    if bracket is not None:
        instance_of(load("qvi_contact.bracket").Bracket, "bracket", bracket, "give result.bracket, or leave it out")
        mesh, companion = bracket.problem.mesh, bracket.companion
        if not mesh.same_as(problem.mesh):
            raise InputError("bracket", repr(mesh), "belongs to another mesh: give the one of this result")
        if not companion.has_state:
            raise InputError("bracket", bracket.message, "there is no displacement in it to write")
        displacement = companion.displacement_in(samples.cells, samples.reference[:, None, -2:])[:, 0]
        point_data["displacement"] = displacement, "displacement"
        cell_data["energy gap"] = bracket.cell_gaps[cell], "energy"
    _write_grid(path, samples.points, samples.triangles, point_data, cell_data, units)


def write_contacts_vtu(path: str | Path, result: ContactResult, units: Units | None = None) -> None:
    """Write the tractions, gaps, slips and states of all contacts as lines through their points, for ParaView.

    Arguments and errors are those of `write_vtu`; `InputError` too if the result has no contact.

    Point data: "pressure" −σ_N, "fluid pressure" p_w, which is part of the pressure, "shear" σ_T, "friction bound" (NaN
    on tied contacts), "gap", "slip" and "state" (numbers of `ContactState`) as in `ContactLine`, "traction" on the body
    and "normal" as vectors. Cell data: "contact", the number of the contact in the order of the problem. Lines join
    neighbouring points along each contact.
    """
    _check_vtu(path)
    _check_given(result, units)
    if not result.contacts:
        raise InputError("vtk", str(path), "there is no contact to write")
    parts, segments, segment_contacts, n_points = list[_Data](), [], [], 0
    for index, (rows, line) in enumerate(zip(result.discretization.contacts, result.contacts.values(), strict=True)):
        normal, tangent = rows.points.normals, rows.points.tangents  # they turn along arcs
        bound = np.where(np.isfinite(line.friction_bound), line.friction_bound, np.nan)
        traction = line.normal_stress[:, None] * normal + line.tangential_stress[:, None] * tangent
        stresses = {
            "pressure": -line.normal_stress,
            "fluid pressure": line.pore_pressure,
            "shear": line.tangential_stress,
            "friction bound": bound,
            "traction": traction,
        }
        contact_data: _Data = {name: (values, "stress") for name, values in stresses.items()}
        contact_data |= {"gap": (line.gap, "displacement"), "slip": (line.slip, "displacement")}
        parts.append(contact_data | {"state": (line.state.astype(np.float64), ""), "normal": (normal, "")})
        on_path, order = line.path, n_points + line.path.points(line.points_per_edge)
        starts, stops = (line.ends[on_path.edges, end.astype(int)] for end in (~on_path.forward, on_path.forward))
        for edges in on_path.lines:
            chain, is_closed = order[edges].ravel(), (starts[edges[0]] == stops[edges[-1]]).all()
            chain = np.append(chain, chain[: int(is_closed)])  # a closed line leads back to its first point
            segments.append(np.column_stack([chain[:-1], chain[1:]]))
            segment_contacts += [index] * (len(chain) - 1)
        n_points += len(line.x)
    points = np.concatenate([np.column_stack([line.x, line.y]) for line in result.contacts.values()])
    data = {name: (np.concatenate([part[name][0] for part in parts]), of) for name, (_, of) in parts[0].items()}
    cell_data: _Data = {"contact": (np.array(segment_contacts), "")}
    _write_grid(path, points, np.concatenate(segments), data, cell_data, units)


def write_collapse_vtu(
    path: str | Path, problem: ContactProblem, limit: "LimitLoad", units: Units | None = None
) -> None:
    """Write the collapse of a yielding body at its limit load, for ParaView.

    The problem has the mesh of the analysis, as `LimitRefinement.problem`. Path, units and errors are those of
    `write_vtu`; `InputError` too if the body does not yield or has no limit load.

    Each of the three parts of a triangle is cut into 9. Point data: "stress" at `LimitLoad.lower`, with xx, yy, 0, xy,
    0, 0 as components of VTK's symmetric tensors; "velocity", x, y, 0, of the plastic flow that proves
    `LimitLoad.upper`, with a largest coefficient of 1. Cell data: "dissipation" per area of each triangle, with a
    maximum of 1, "gap", its contribution to upper − lower, "material", and "cell", its number.
    """
    _check_vtu(path)
    from qvi_contact.limit.split import part_corners  # only needed for bodies that yield

    instance_of(ContactProblem, "problem", problem)
    instance_of(load("qvi_contact.limit").LimitLoad, "limit", limit)
    mesh, collapse = problem.mesh, limit.collapse
    if collapse is None:
        raise InputError("vtk", str(path), "there is no flow to write: the body has no strength, or no largest load")
    if len(collapse.gap) != mesh.cell_count:
        raise InputError("problem", mesh, "is not that of the limit analysis: give LimitRefinement.problem")
    lattice, corners = triangle_lattice(_DIVISIONS)
    degree = (isqrt(8 * collapse.stress.shape[2] + 1) - 3) // 2  # degree of the stress
    points = (lattice @ part_corners(mesh.corners)).reshape(-1, 2)
    xx, yy, xy = (bernstein(degree, lattice) @ collapse.stress).reshape(-1, 3).T
    velocity = (bernstein(degree + 1, lattice) @ collapse.motion.velocities).reshape(-1, 2)
    point_data: _Data = {
        "stress": (np.column_stack([xx, yy, 0 * xx, xy, 0 * xx, 0 * xx]), "stress"),
        "velocity": (velocity / np.abs(collapse.motion.velocities).max(), ""),
    }
    a, b, c = mesh.corners.swapaxes(0, 1)
    density = collapse.motion.dissipation / np.abs(cross(b - a, c - a))
    cell = np.repeat(np.arange(mesh.cell_count), 3 * len(corners))
    cells: _Data = {
        "dissipation": (density[cell] / max(float(density.max()), 1e-300), ""),
        "gap": (collapse.gap[cell], ""),
        "material": (problem.cell_materials[cell], ""),
        "cell": (cell, ""),
    }
    triangles = (len(lattice) * np.arange(3 * mesh.cell_count)[:, None, None] + corners).reshape(-1, 3)
    _write_grid(path, points, triangles, point_data, cells, units)


def _check_vtu(path: str | Path) -> None:
    """`InputError` unless the name ends in .vtu and meshio is installed."""
    if find_spec("meshio") is None:
        raise InputError("vtk", "meshio", "VTU files need meshio: python -m pip install meshio")
    check_suffix("vtk", path, ".vtu")


def _write_grid(
    path: str | Path, points: FloatArray, parts: IntArray, point_data: _Data, cell_data: _Data, units: Units | None
) -> None:
    """Write points (n, 2), lines or triangles by their corners (c, 2 or 3), and data of both."""
    kind = "line"
    if parts.shape[1] == 3:  # make all triangles counterclockwise
        kind, (a, b, c) = "triangle", points[parts].swapaxes(0, 1)
        parts = np.where((cross(b - a, c - a) < 0.0)[:, None], parts[:, ::-1], parts)
    labels = Units.labels(units, {name: of for name, (_, of) in (point_data | cell_data).items()})

    def named(data: _Data) -> Iterator[tuple[str, NDArray[Any]]]:
        for name, (values, _) in data.items():
            title = f"{name} [{labels[name]}]" if name in labels else name
            vectors = values.ndim == 2 and values.shape[1] == 2
            # a unit may contain any character, and meshio does not escape names
            yield escape(title), np.column_stack([values, np.zeros(len(values))]) if vectors else values

    points_3d, blocks = np.column_stack([points, np.zeros(len(points))]), [(kind, parts)]
    cells = {name: [values] for name, values in named(cell_data)}
    grid = load("meshio").Mesh(points_3d, blocks, point_data=dict(named(point_data)), cell_data=cells)
    with replacing(path) as temporary:
        grid.write(temporary, file_format="vtu")
