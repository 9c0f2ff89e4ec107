"""Results as files for other programs: JSON summary, NumPy archive, and VTU files for ParaView, by meshio.

Every file is either written whole or not at all.
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
from qvi_contact.solution.contact_line import SUMMARY, ContactLine
from qvi_contact.solution.result import PLATE_COLUMNS, RESULTANT, ContactResult, Energies, contact_numbers
from qvi_contact.solution.stress import principal_stresses, sample_body, von_mises
from qvi_contact.units import Units
from solvers.basics.types import load

if TYPE_CHECKING:
    from qvi_contact.bracket import Bracket
    from qvi_contact.limit import LimitLoad
    from qvi_contact.problem.problem import ContactProblem

_NOT_STORED: Final = ("name", "ends", "pore_pressure", "rounding", "senses", "frictionless")
"""Fields of contacts that come from the mesh, or not always."""

SUMMARY_VERSION: Final = 1
"""Grows when an entry of `summary` changes its meaning or goes away; new entries may come at any time."""


def summary(result: ContactResult, units: Units | None = None) -> dict[str, Any]:
    """What came out, solved or failed, as a document of plain values that JSON can hold.

    Physical quantities are ``{"value": …, "unit": …}``, the rest plain. What does not exist, such as contacts of an
    infeasible problem or measures that could not be computed, is None. Signs are those of `ContactLine` and
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
    stated = ("contacts", "plates", "energies", "resultants", "traction_misfit")
    document |= _state(result, units) if result.has_state else dict.fromkeys(stated)
    return {key: json_ready(value) for key, value in document.items()}


def write_json(path: str | Path, result: ContactResult, units: Units | None = None) -> None:
    """Write `summary` as a JSON file in UTF-8; `InputError` if the file cannot be written."""
    write_text(path, json.dumps(summary(result, units), indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def write_npz(path: str | Path, result: ContactResult, units: Units | None = None, title: str = "") -> None:
    """Write everything about a result as a NumPy archive that `numpy.load` reads without pickle.

    `qvi_contact.load_result` makes the result again, and `qvi-contact verify` checks all that the file claims.
    `InputError` if there is no stress state, the suffix is another one, or the file cannot be written.

    What the entries are, with shapes and units, says "NumPy archive" in docs/formats.md. Where functions are Python's,
    which no file can hold, ``problem`` is empty: such a file has all fields, but cannot be checked.
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
    wet = ["pore_pressure", "effective_normal_stress", "effective_normal_force"]
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
            for field in (names + wet if line.has_fluid else names)
        },
        "energies": np.array([getattr(energies, field.name) for field in fields(Energies)]),
        "traction_misfit": result.traction_misfit,
        **{f"{name}.motion": np.array([m.x, m.y, m.rotation]) for name, m in result.plates.items()},
    }


def _state(result: ContactResult, units: Units) -> dict[str, Any]:
    """The part of the summary that needs a stress state."""
    contacts, found = {}, contact_numbers(result)
    for name, line in result.contacts.items():
        numbers, unit = line.summary(), dict(SUMMARY)
        if line.has_fluid:
            numbers["effective_normal_force"], unit["effective_normal_force"] = line.effective_normal_force, "force"
        contacts[name] = {
            **_quantities(numbers, unit, units),
            "length": {state: _quantity(length, units.length) for state, length in line.lengths.items()},
            "points": len(line.x),
        }
    plates = {name: _quantities(found[name], PLATE_COLUMNS, units) for name in result.plates}
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
    """Refuse what is no result, such as a whole history, and what are no units."""
    instance_of(ContactResult, "result", result, "give a ContactResult, such as solve returns, or one of the steps")
    Units.labels(units, {})


def element_of(discretization: Discretization) -> dict[str, Any]:
    """Name, degree and contact rows of the element, for documents."""
    space = discretization.space
    return {"name": FAMILY, "degree": space.degree, "law_on": discretization.rule.law_on}


def _quantity(value: float | np.floating[Any], unit: str) -> dict[str, Any]:
    return {"value": float(value), "unit": unit}


def _quantities(numbers: Mapping[str, float], kinds: Mapping[str, str], units: Units) -> dict[str, Any]:
    """Numbers by name, each in this one of the units."""
    return {name: _quantity(numbers[name], getattr(units, kind)) for name, kind in kinds.items()}


_Data: TypeAlias = dict[str, tuple[NDArray[Any], str]]  # fields by name, with the quantity whose unit they have
_SINGLE_VALUED: Final = 1e-9  # jump of the dimensionless Airy function that is rounding
_DIVIDED: Final = 3  # parts along each side of a part of a triangle, in files of limit loads
_MOST_SUBDIVISIONS: Final = 100  # of a part of a cell: ten thousand triangles


def write_vtu(
    path: str | Path,
    result: ContactResult,
    units: Units | None = None,
    subdivisions: int = 4,
    bracket: "Bracket | None" = None,
) -> None:
    """Write stresses as an unstructured VTK grid, which ParaView opens; needs the extra ``vtk`` (meshio).

    Each of the three parts of a cell is divided into subdivisions² triangles of its own, that share no points with
    those of other cells, so that normal stresses may jump between cells as they do in the element. Fields are linear in
    them. `InputError` if meshio is missing, there is no stress state, the bracket is of another mesh or has no
    displacement, the suffix is another one, or the file cannot be written.

    With units names of fields end in these, as in "stress [MPa]". With the bracket of the result, such as
    ``result.bracket``, displacements and the error of each cell are written too.

    Point data: "stress" with the components xx, yy, zz, xy, yz, xz of VTK's symmetric tensors (zz = ν(xx + yy) in plane
    strain), "von Mises", "principal 1" ≥ "principal 2" in the plane, "Airy function" up to an affine function (left out
    where a hole carries a force, as it has several values around it); with a bracket "displacement", x, y, 0, of its
    displacement elements. Cell data: "material", 0 for the body's own and then the number of the region, "cell", the
    number of the mesh's cell; with a bracket "energy gap", what the whole cell adds to the gap between the bounds of
    the energy.
    """
    _check_vtu(path)
    _check_given(result, units)
    known, problem = result.discretization, result.problem
    samples = sample_body(result, divisions=whole_number("subdivisions", subdivisions, _MOST_SUBDIVISIONS))
    (xx, yy, xy), zero = samples.stress.T, np.zeros(len(samples.points))
    first, second, _ = principal_stresses(samples.stress)
    point_data: _Data = {
        "stress": (np.column_stack([xx, yy, samples.along_z, xy, zero, zero]), "stress"),
        "von Mises": (von_mises(samples.stress, samples.along_z), "stress"),
        "principal 1": (first, "stress"),
        "principal 2": (second, "stress"),
    }
    if np.abs(known.space.jumps(result.dofs)).max(initial=0.0) <= _SINGLE_VALUED:
        t, cells = known.space.lattice(subdivisions)[0], np.arange(problem.mesh.cell_count)
        airy = known.space.airy(known.coefficients(result.dofs), cells, t)
        point_data["Airy function"] = airy.ravel() * known.scales.airy, "airy"
    number = samples.cells[samples.triangles[:, 0]]
    cell_data: _Data = {"material": (problem.cell_materials[number], ""), "cell": (number, "")}
    if bracket is not None:
        instance_of(load("qvi_contact.bracket").Bracket, "bracket", bracket, "give result.bracket, or leave it out")
        mesh, companion = bracket.problem.mesh, bracket.companion
        if not mesh.same_as(problem.mesh):
            raise InputError("bracket", repr(mesh), "belongs to another mesh: give the one of this result")
        if not companion.has_state:
            raise InputError("bracket", bracket.message, "there is no displacement in it to write")
        moved = companion.displacement_in(samples.cells, samples.reference[:, None, -2:])[:, 0]
        point_data["displacement"] = moved, "displacement"
        cell_data["energy gap"] = bracket.cell_gaps[number], "energy"
    _write_grid(path, samples.points, samples.triangles, point_data, cell_data, units)


def write_contacts_vtu(path: str | Path, result: ContactResult, units: Units | None = None) -> None:
    """Write what happens on the contacts as lines through their points, for ParaView.

    Arguments and errors are those of `write_vtu`; `InputError` too if the result has no contact.

    Point data: "pressure" −σ_N, "fluid pressure" p_w, which is part of it, "shear" σ_T, "friction bound" (NaN where
    tied), "gap", "slip" and "state" (numbers of `ContactState`) as `ContactLine` has them, "traction" on the body and
    "normal" as vectors. Cell data: "contact", its number in the order of the problem. Lines join neighbouring points
    along each contact.
    """
    _check_vtu(path)
    _check_given(result, units)
    if not result.contacts:
        raise InputError("vtk", str(path), "there is no contact to write")
    parts, joints, number, count = list[_Data](), [], [], 0
    for index, (rows, line) in enumerate(zip(result.discretization.contacts, result.contacts.values(), strict=True)):
        normal, tangent = rows.points.normals, rows.points.tangents  # which turn along arcs
        bound = np.where(np.isfinite(line.friction_bound), line.friction_bound, np.nan)
        traction = line.normal_stress[:, None] * normal + line.tangential_stress[:, None] * tangent
        stresses = {
            "pressure": -line.normal_stress,
            "fluid pressure": line.pore_pressure,
            "shear": line.tangential_stress,
            "friction bound": bound,
            "traction": traction,
        }
        own: _Data = {name: (values, "stress") for name, values in stresses.items()}
        own |= {"gap": (line.gap, "displacement"), "slip": (line.slip, "displacement")}
        parts.append(own | {"state": (line.state.astype(np.float64), ""), "normal": (normal, "")})
        along, order = line.path, line.path.points(line.points_per_edge)
        starts, stops = (line.ends[along.edges, end.astype(int)] for end in (~along.forward, along.forward))
        following = np.concatenate([np.roll(own, -1) for own in along.lines])  # a closed line ends where it begins
        goes_on = (stops == starts[following]).all(axis=1)
        joints.append(count + np.column_stack([order[:, :-1].ravel(), order[:, 1:].ravel()]))
        joints.append(count + np.column_stack([order[goes_on, -1], order[following[goes_on], 0]]))
        number.append(np.full(len(joints[-2]) + len(joints[-1]), index))
        count += len(line.x)
    points = np.concatenate([np.column_stack([line.x, line.y]) for line in result.contacts.values()])
    data = {name: (np.concatenate([part[name][0] for part in parts]), of) for name, (_, of) in parts[0].items()}
    _write_grid(path, points, np.concatenate(joints), data, {"contact": (np.concatenate(number), "")}, units)


def write_collapse_vtu(
    path: str | Path, problem: "ContactProblem", limit: "LimitLoad", units: Units | None = None
) -> None:
    """Write how a body that yields gives way at its limit load, for ParaView.

    The problem is that on the mesh of the analysis, such as `LimitRefinement.problem`, and the limit what
    `limit_load_factor` has found. Path, units and errors are those of `write_vtu`; `InputError` too if the body does
    not yield or has no limit.

    Each of the three parts of a triangle is cut into 9. Point data: "stress" at `LimitLoad.lower`, with xx, yy, 0, xy,
    0, 0 as components of VTK's symmetric tensors; "velocity", x, y, 0, of the flow that proves `LimitLoad.upper`, its
    largest coefficient being 1. Cell data: "dissipation" of a triangle over its area, the largest being 1, "gap", its
    part of upper − lower, "material", and "cell", its number.
    """
    _check_vtu(path)
    from qvi_contact.limit.split import part_corners  # loaded for bodies that yield alone

    mesh, collapse = problem.mesh, limit.collapse
    if collapse is None:
        raise InputError("vtk", str(path), "there is no flow to write: the body has no strength, or no largest load")
    places, corners = triangle_lattice(_DIVIDED)
    k = (isqrt(8 * collapse.stress.shape[2] + 1) - 3) // 2  # degree of the stress
    points = (places @ part_corners(mesh.corners)).reshape(-1, 2)
    xx, yy, xy = (bernstein(k, places) @ collapse.stress).reshape(-1, 3).T
    v = (bernstein(k + 1, places) @ collapse.motion.velocities).reshape(-1, 2)
    point_data: _Data = {
        "stress": (np.column_stack([xx, yy, 0 * xx, xy, 0 * xx, 0 * xx]), "stress"),
        "velocity": (v / np.abs(collapse.motion.velocities).max(), ""),
    }
    a, b, c = mesh.corners.swapaxes(0, 1)
    density = collapse.motion.dissipation / np.abs(cross(b - a, c - a))
    number = np.repeat(np.arange(mesh.cell_count), 3 * len(corners))
    cells: _Data = {
        "dissipation": (density[number] / max(float(density.max()), 1e-300), ""),
        "gap": (collapse.gap[number], ""),
        "material": (problem.cell_materials[number], ""),
        "cell": (number, ""),
    }
    triangles = (len(places) * np.arange(3 * mesh.cell_count)[:, None, None] + corners).reshape(-1, 3)
    _write_grid(path, points, triangles, point_data, cells, units)


def _check_vtu(path: str | Path) -> None:
    """Refuse a name that does not end in .vtu; `InputError` with the command to type if meshio is missing."""
    if find_spec("meshio") is None:
        raise InputError("vtk", "meshio", "VTU files need meshio: python -m pip install meshio")
    check_suffix("vtk", path, ".vtu")


def _write_grid(
    path: str | Path, points: FloatArray, parts: IntArray, point_data: _Data, cell_data: _Data, units: Units | None
) -> None:
    """Write points (n, 2), lines or triangles by their corners (c, s), and data of both; whole or not at all."""
    kind = "line"
    if parts.shape[1] == 3:  # turned counterclockwise, so that all face the same way
        kind, (a, b, c) = "triangle", points[parts].swapaxes(0, 1)
        parts = np.where((cross(b - a, c - a) < 0.0)[:, None], parts[:, ::-1], parts)
    labels = Units.labels(units, {name: of for name, (_, of) in (point_data | cell_data).items() if of})

    def named(data: _Data) -> Iterator[tuple[str, NDArray[Any]]]:
        for name, (values, _) in data.items():
            title = f"{name} [{labels[name]}]" if name in labels else name
            vectors = values.ndim == 2 and values.shape[1] == 2
            # a unit may be called anything, and meshio writes names as they are
            yield escape(title), np.column_stack([values, np.zeros(len(values))]) if vectors else values

    flat, blocks = np.column_stack([points, np.zeros(len(points))]), [(kind, parts)]
    cells = {name: [values] for name, values in named(cell_data)}
    grid = load("meshio").Mesh(flat, blocks, point_data=dict(named(point_data)), cell_data=cells)
    with replacing(path) as temporary:
        grid.write(temporary, file_format="vtu")
