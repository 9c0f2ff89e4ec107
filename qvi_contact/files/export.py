"""Results as files for other programs: JSON summary, NumPy archive, VTU for ParaView.

Every file is either written whole or not at all.
"""

import json
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray, whole_number
from qvi_contact.basics.units import Units
from qvi_contact.basics.writing import check_suffix, write_text
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import physical
from qvi_contact.discretization.space import FAMILY
from qvi_contact.errors import InputError
from qvi_contact.files.archive import write_archive
from qvi_contact.files.stored import solution_arrays
from qvi_contact.files.vtu import check_vtu, named, stress_fields, vectors, write_grid
from qvi_contact.solution.contact_line import ContactLine
from qvi_contact.solution.result import ContactResult, Energies
from qvi_contact.solution.sampling import cell_factors
from qvi_contact.solution.stress import stress_in_cells

if TYPE_CHECKING:
    from qvi_contact.bracket import Bracket
    from qvi_contact.companion import CompanionResult

_CHUNK: Final = 4096  # cells at a time: their tables stay small
_SINGLE_VALUED: Final = 1e-9  # jump of the dimensionless Airy function that is rounding
_MOST_SUBDIVISIONS: Final = 100  # of a part of a cell: ten thousand triangles
_NOT_STORED: Final = (
    "name",
    "ends",
    "pore_pressure",
    "rounding",
    "senses",
    "frictionless",
)  # of contacts, or not always

SUMMARY_VERSION: Final = 1
"""Grows when an entry of `summary` changes its meaning or goes away; new entries may come at any time."""


def summary(result: ContactResult, units: Units | None = None) -> dict[str, Any]:
    """What came out, as a document of plain values that JSON can hold.

    Parameters
    ----------
    result : ContactResult
        The result, solved or failed.
    units : Units, optional
        Names of the units.

    Returns
    -------
    dict
        Physical quantities are ``{"value": …, "unit": …}``, the rest plain. What does not exist, such as contacts of an
        infeasible problem or measures that could not be computed, is None. Signs are those of `ContactLine` and
        `Resultant`: the largest pressure is the largest −σ_N, the largest shear and slip are absolute values.

    """
    units = units or Units()
    solution, certificate = result.solution, result.certificate
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
            "passed": certificate.passed,
            "tolerance": certificate.tolerance,
            "accuracy": certificate.accuracy,
            "worst": certificate.worst,
            "measures": dict(certificate.measures),
            "limits": certificate.limits,
            "signed": dict(certificate.signed),
        },
        "contraction": solution.contraction,
        "iterations": result.iterations,
        "method": solution.method,
        "inner": solution.inner,
        "factorisation": solution.factorisation,
        "form": solution.form,
        "seconds": dict(solution.timings),
        "versions": dict(solution.versions),
        "mesh": _mesh(result, units),
        "element": element_of(result.discretization),
        **(_state(result, units) if result.has_state else dict.fromkeys(_STATE_KEYS)),
    }
    return {key: _plain(value) for key, value in document.items()}


def write_json(path: str | Path, result: ContactResult, units: Units | None = None) -> None:
    """Write `summary` as a JSON file in UTF-8.

    Parameters
    ----------
    path : str or Path
        The file.
    result : ContactResult
        The result, solved or failed.
    units : Units, optional
        Names of the units.

    Raises
    ------
    InputError
        If the file cannot be written.

    """
    write_text(path, json.dumps(summary(result, units), indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def write_npz(path: str | Path, result: ContactResult, units: Units | None = None, title: str = "") -> None:
    """Write everything about a result as a NumPy archive that `numpy.load` reads without pickle.

    `qvi_contact.load_result` makes the result again, and `qvi-contact verify` checks all that the file claims.

    Parameters
    ----------
    path : str or Path
        The file, ending in .npz.
    result : ContactResult
        A result with a stress state.
    units : Units, optional
        Names of the units, kept with the problem.
    title : str
        What to call the problem.

    Raises
    ------
    InputError
        If there is no stress state, the suffix is another one, or the file cannot be written.

    Notes
    -----
    The fields are

    * ``vertices`` (v, 2) [length], ``cells`` (cells, 3) and ``material`` (cells,);
    * ``gauss_x``, ``gauss_y`` (cells, g) [length] and ``gauss_stress`` (cells, g, 3): σ_xx, σ_yy, σ_xy [stress];
    * for every contact ``<name>.x``, ``<name>.normal_stress`` and so on: what `ContactLine` has of its points, and its
      forces; ``pore_pressure`` and effective stress and force where a fluid presses in the contact; with a
      plate ``<name>.motion``: x, y [length] and rotation [rad];
    * ``energies``: strain, load, complementary, dissipation [stress × length²]; ``traction_misfit`` [stress];
    * ``status``, ``message``: texts.

    What the fields are made from is there too:

    * ``problem``: the text of a problem file; empty if functions are Python's, which no file can hold, and
      ``problem_missing`` then says which. Such a file has all fields, but cannot be checked;
    * ``degree`` and ``contact_rows`` ("gauss" or "bernstein") of the element; ``centres``: vertices with affine
      functions from which ``z`` counts, where small cells lie in several places; ``cuts``: vertices along lines from
      holes across which the Airy function of ``z`` jumps, line by line;
    * ``scales``: units of length, stress and compliance of the dimensionless problem, ``loaded``, ``reach``: obstacles
      farther than so many units of displacement count as that far; ``earlier_slip``: of load steps before this one,
      at all contact points;
    * ``z``, ``normal_multiplier``, ``tangential_multiplier``, ``equality_multiplier``, ``threshold``: of `QVISolution`;
    * ``certificate`` (JSON) and ``tolerance``; ``method``, ``inner``, ``form``, ``factorisation``, ``iterations``,
      ``corrections``, ``remarks``, ``history``, ``history_status``, ``timings``, ``versions``;
    * ``format``, ``format_version`` and ``digest``, see `qvi_contact.files.archive`.

    """
    check_suffix("npz", path, ".npz")
    write_archive(path, {**field_arrays(result), **solution_arrays(result, units, title)})


def field_arrays(result: ContactResult) -> dict[str, Any]:
    """Mesh, stresses, contacts and energies of a result, as `write_npz` describes them."""
    return {**_body_arrays(result), **_contact_arrays(result.contacts), **_numbers(result)}


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
    them.

    Parameters
    ----------
    path : str or Path
        The file, ending in .vtu.
    result : ContactResult
        A result with a stress state.
    units : Units, optional
        If given, names of fields end in their unit, as in "stress [MPa]".
    subdivisions : int
        Parts along each side of a cell.
    bracket : Bracket, optional
        That of the result, such as ``result.bracket``: displacements and the error of each cell are written too.

    Raises
    ------
    InputError
        If meshio is missing, there is no stress state, the bracket is of another mesh or has no displacement, the
        suffix is another one, or the file cannot be written.

    Notes
    -----
    Point data: "stress" with the components xx, yy, zz, xy, yz, xz of VTK's symmetric tensors (zz = ν(xx + yy) in plane
    strain), "von Mises", "principal 1" ≥ "principal 2" in the plane, "Airy function" up to an affine function (left out
    where a hole carries a force, as it has several values around it); with a bracket "displacement", x, y, 0, of its
    displacement elements. Cell data: "material", 0 for the body's own and then the number of the region, "cell", the
    number of the mesh's cell; with a bracket "energy gap", what the whole cell adds to the gap between the bounds of
    the energy.

    """
    check_vtu(path)
    r = whole_number("subdivisions", subdivisions, _MOST_SUBDIVISIONS)
    points, point_data = _point_data(result, r, units)
    t, corners = result.discretization.space.lattice(r)
    count = result.problem.mesh.cell_count
    number = np.repeat(np.arange(count), len(corners))
    cell_data: dict[str, FloatArray | IntArray] = {"material": result.problem.cell_materials[number], "cell": number}
    if bracket is not None:
        companion = _companion(result, bracket)
        moved = companion.cell_displacement(*t[:, -2:].T).reshape(-1, 2)
        point_data[named("displacement", "displacement", units)] = vectors(moved)
        cell_data[named("energy gap", "energy", units)] = bracket.cell_gaps[number]
    cells = (len(t) * np.arange(count)[:, None, None] + corners).reshape(-1, corners.shape[1])
    write_grid(path, points, cells, point_data, cell_data)


def write_contacts_vtu(path: str | Path, result: ContactResult, units: Units | None = None) -> None:
    """Write what happens on the contacts as lines through their points, for ParaView; needs the extra ``vtk`` (meshio).

    Parameters
    ----------
    path : str or Path
        The file, ending in .vtu.
    result : ContactResult
        A result with a stress state and contacts.
    units : Units, optional
        If given, names of fields end in their unit, as in "pressure [MPa]".

    Raises
    ------
    InputError
        If meshio is missing, there is no stress state or no contact, the suffix is another one, or the file cannot be
        written.

    Notes
    -----
    Point data: "pressure" −σ_N, "fluid pressure" p_w, which is part of it, "shear" σ_T, "friction bound" (NaN where
    tied), "gap", "slip" and "state" (numbers of `ContactState`) as `ContactLine` has them, "traction" on the body and
    "normal" as vectors. Cell data: "contact", its number in the order of the problem. Lines join neighbouring points
    along each contact.

    """
    check_vtu(path)
    if not result.contacts:
        raise InputError("vtk", str(path), "there is no contact to write")
    parts, joints, number, count = [], [], [], 0
    for index, (contact, line) in enumerate(zip(result.problem.contacts, result.contacts.values(), strict=True)):
        normal = np.repeat(result.problem.mesh.edges(contact.edges).normal, line.points_per_edge, axis=0)
        tangent = np.repeat(result.problem.mesh.edges(contact.edges).tangent, line.points_per_edge, axis=0)
        order = line.path.points(line.points_per_edge)
        parts.append(_contact_points(line, normal, tangent, units))
        joints.append(count + _joined_points(order, line.path.line))
        number.append(np.full(len(joints[-1]), index))
        count += len(line.x)
    points = np.concatenate([np.column_stack([line.x, line.y]) for line in result.contacts.values()])
    fields = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    write_grid(path, points, np.concatenate(joints), fields, {"contact": np.concatenate(number)})


def contacts_path(path: str | Path) -> Path:
    """The file of contacts beside a file of fields: part.vtu has part_contacts.vtu."""
    whole = Path(path)
    return whole.with_name(f"{whole.stem}_contacts{whole.suffix}")


def _companion(result: ContactResult, bracket: "Bracket") -> "CompanionResult":
    """The displacement of a bracket of this result's mesh."""
    companion = bracket.companion
    if not bracket.problem.mesh.same_as(result.problem.mesh):
        raise InputError("bracket", repr(bracket.problem.mesh), "belongs to another mesh: give the one of this result")
    if companion is None or not companion.has_state:
        raise InputError("bracket", bracket.message, "there is no displacement in it to write")
    return companion


def _contact_points(
    line: ContactLine, normal: FloatArray, tangent: FloatArray, units: Units | None
) -> dict[str, FloatArray]:
    """The fields of one contact."""
    bound = np.where(np.isfinite(line.friction_bound), line.friction_bound, np.nan)
    stresses = {
        "pressure": -line.normal_stress,
        "fluid pressure": line.pore_pressure,
        "shear": line.tangential_stress,
        "friction bound": bound,
    }
    traction = line.normal_stress[:, None] * normal + line.tangential_stress[:, None] * tangent
    return {
        **{named(name, "stress", units): values for name, values in stresses.items()},
        **{named(name, "displacement", units): getattr(line, name) for name in ("gap", "slip")},
        "state": line.state.astype(np.float64),
        named("traction", "stress", units): vectors(traction),
        "normal": vectors(normal),
    }


def _joined_points(order: IntArray, line: IntArray) -> IntArray:
    """Pairs (k, 2) of neighbours among points in order (n, q), of edges on lines with these numbers (n,)."""
    within = np.stack([order[:, :-1].ravel(), order[:, 1:].ravel()], axis=1)
    goes_on = np.diff(line) == 0
    between = np.stack([order[:-1, -1][goes_on], order[1:, 0][goes_on]], axis=1)
    return np.concatenate([within, between])


_STATE_KEYS: Final = ("contacts", "plates", "energies", "resultants", "traction_misfit")


def _state(result: ContactResult, units: Units) -> dict[str, Any]:
    """The part of the summary that needs a stress state."""
    energies = result.energies
    plates = {
        name: {
            "x": _quantity(motion.x, units.displacement),
            "y": _quantity(motion.y, units.displacement),
            "rotation": _quantity(motion.rotation, "rad"),
            **_plate_force(result, name, units),
        }
        for name, motion in result.plates.items()
    }
    values = (
        {name: _contact(line, units) for name, line in result.contacts.items()},
        plates,
        {name: _quantity(getattr(energies, name), units.energy) for name in energies.__dataclass_fields__},
        {name: _resultant(result, name, units) for name in result.problem.mesh.edge_names},
        _quantity(result.traction_misfit, units.stress),
    )
    return dict(zip(_STATE_KEYS, values, strict=True))


def _plate_force(result: ContactResult, name: str, units: Units) -> dict[str, Any]:
    """Force of a plate on the body, and its moment about the pivot."""
    force = result.plate_force(name)
    return {
        "force_x": _quantity(force.x, units.force),
        "force_y": _quantity(force.y, units.force),
        "moment": _quantity(force.moment, units.moment),
    }


def _contact(line: ContactLine, units: Units) -> dict[str, Any]:
    """Forces, lengths and extremes of one contact."""
    return {
        "normal_force": _quantity(line.normal_force, units.force),
        "tangential_force": _quantity(line.tangential_force, units.force),
        **_effective(line, units),
        "length": {name: _quantity(length, units.length) for name, length in line.lengths.items()},
        "largest_pressure": _quantity((-line.normal_stress).max(), units.stress),
        "largest_shear": _quantity(np.abs(line.tangential_stress).max(), units.stress),
        "largest_gap": _quantity(line.gap.max(), units.displacement),
        "largest_slip": _quantity(np.abs(line.slip).max(), units.displacement),
        "points": len(line.x),
    }


def _effective(line: ContactLine, units: Units) -> dict[str, Any]:
    """The effective force where a fluid presses in the contact."""
    if not line.has_fluid:
        return {}
    return {"effective_normal_force": _quantity(line.effective_normal_force, units.force)}


def _resultant(result: ContactResult, edges: str, units: Units) -> dict[str, Any]:
    found = result.resultant(edges)
    return {
        "x": _quantity(found.x, units.force),
        "y": _quantity(found.y, units.force),
        "moment": _quantity(found.moment, units.moment),
    }


def element_of(discretization: Discretization) -> dict[str, Any]:
    """Name, degree and contact rows of the element, for documents."""
    space = discretization.space
    return {"name": FAMILY, "degree": space.degree, "contact_rows": space.contact_rule.kind}


def _mesh(result: ContactResult, units: Units) -> dict[str, Any]:
    mesh, qvi = result.problem.mesh, result.discretization.qvi
    smallest, largest = mesh.cell_range
    return {
        "cells": mesh.cell_count,
        "nodes": len(mesh.vertices),
        "unknowns": qvi.n,
        "contact_points": qvi.m,
        "smallest_cell": _quantity(smallest, units.length),
        "largest_cell": _quantity(largest, units.length),
    }


def _quantity(value: float | np.floating[Any], unit: str) -> dict[str, Any]:
    return {"value": float(value), "unit": unit}


def _plain(value: object) -> object:
    """The same with None for what JSON has no number for."""
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    if isinstance(value, (float, np.floating)):
        return float(value) if np.isfinite(value) else None
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    return int(value) if isinstance(value, np.integer) else value


def airy_units(result: ContactResult) -> FloatArray:
    """Units (4,) of Φ, Φ_x, Φ_y, Φ_xy: S L², S L, S L, S of `Scales`."""
    scales = result.discretization.scales
    return np.asarray(scales.airy / np.array([1.0, scales.length, scales.length, scales.length**2]))


def _body_arrays(result: ContactResult) -> dict[str, Any]:
    x, y, stress = result.gauss_stress()
    mesh, material = result.problem.mesh, result.problem.cell_materials
    body = {"vertices": mesh.vertices, "cells": mesh.cells, "material": material}
    return {**body, "gauss_x": x, "gauss_y": y, "gauss_stress": stress}


def _contact_arrays(contacts: Mapping[str, ContactLine]) -> dict[str, Any]:
    """Fields of every `ContactLine`, with its resultant forces; those of a fluid where there is one.

    Where its edges lie, and in which sense they count, is known from the mesh.
    """
    names = [field.name for field in fields(ContactLine) if field.name not in _NOT_STORED]
    names += ["normal_force", "tangential_force"]
    wet = ["pore_pressure", "effective_normal_stress", "effective_normal_force"]
    return {
        f"{name}.{field}": getattr(line, field)
        for name, line in contacts.items()
        for field in (names + wet if line.has_fluid else names)
    }


def _numbers(result: ContactResult) -> dict[str, Any]:
    """Energies, motion of plates, misfit of tractions."""
    energies, motions = result.energies, result.plates
    return {
        "energies": np.array([getattr(energies, field.name) for field in fields(Energies)]),
        "traction_misfit": result.traction_misfit,
        **{f"{name}.motion": np.array([motion.x, motion.y, motion.rotation]) for name, motion in motions.items()},
    }


def _point_data(result: ContactResult, r: int, units: Units | None) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Points (m, 2) of all cells, those of `StressSpace.lattice` in each, cell by cell, and the fields there."""
    known, count = result.discretization, result.problem.mesh.cell_count
    t, _ = known.space.lattice(r)
    chunks = [np.arange(count)[start : start + _CHUNK] for start in range(0, count, _CHUNK)]
    coefficients = known.energy.coefficients(result.dofs)
    places = np.concatenate([known.space.points(cells, t) for cells in chunks]).reshape(-1, 2)
    stress = np.concatenate([stress_in_cells(known, coefficients, cells, t)[1] for cells in chunks]).reshape(-1, 3)
    stress *= known.scales.stress
    found = stress_fields(stress, np.repeat(cell_factors(result.problem), len(t)), units)
    if np.abs(known.space.jumps(result.dofs)).max(initial=0.0) <= _SINGLE_VALUED:
        airy = np.concatenate([known.space.airy(coefficients, cells, t) for cells in chunks])
        found[named("Airy function", "moment", units)] = airy.ravel() * known.scales.airy
    return np.column_stack(physical(result.problem, known.scales, places)), found
