"""Results as files for other programs: JSON summary and NumPy archive; for ParaView see `files.vtu`.

Every file is either written whole or not at all.
"""

import json
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, Final

import numpy as np

from qvi_contact.basics.units import Units
from qvi_contact.basics.writing import check_suffix, write_text
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.space import FAMILY
from qvi_contact.files.archive import solution_arrays, write_archive
from qvi_contact.solution.contact_line import ContactLine
from qvi_contact.solution.result import ContactResult, Energies

_NOT_STORED: Final = ("name", "ends", "pore_pressure", "rounding", "senses", "frictionless")
"""Fields of contacts that come from the mesh, or not always."""

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
    units, mesh = units or Units(), result.problem.mesh
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
        "mesh": {
            "cells": mesh.cell_count,
            "nodes": len(mesh.vertices),
            "unknowns": result.discretization.qvi.n,
            "contact_points": result.discretization.qvi.m,
            "smallest_cell": _quantity(mesh.cell_range[0], units.length),
            "largest_cell": _quantity(mesh.cell_range[1], units.length),
        },
        "element": element_of(result.discretization),
        **(_state(result, units) if result.has_state else dict.fromkeys(_STATE_KEYS)),
    }
    return {key: _plain(value) for key, value in document.items()}


def write_json(path: str | Path, result: ContactResult, units: Units | None = None) -> None:
    """Write `summary` as a JSON file in UTF-8; `InputError` if the file cannot be written."""
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
    * ``degree`` and ``law_on`` ("points" or "edges") of the element; ``centres``: vertices with affine
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


_STATE_KEYS: Final = ("contacts", "plates", "energies", "resultants", "traction_misfit")


def _state(result: ContactResult, units: Units) -> dict[str, Any]:
    """The part of the summary that needs a stress state."""
    energies = result.energies

    def pair(found: Any, prefix: str, unit: str) -> dict[str, Any]:
        return {f"{prefix}{axis}": _quantity(getattr(found, axis), unit) for axis in "xy"}

    contacts, plates = {}, {}
    for name, line in result.contacts.items():
        found = {
            "normal_force": _quantity(line.normal_force, units.force),
            "tangential_force": _quantity(line.tangential_force, units.force),
        }
        if line.has_fluid:
            found["effective_normal_force"] = _quantity(line.effective_normal_force, units.force)
        contacts[name] = {
            **found,
            "length": {state: _quantity(length, units.length) for state, length in line.lengths.items()},
            "largest_pressure": _quantity((-line.normal_stress).max(), units.stress),
            "largest_shear": _quantity(np.abs(line.tangential_stress).max(), units.stress),
            "largest_gap": _quantity(line.gap.max(), units.displacement),
            "largest_slip": _quantity(np.abs(line.slip).max(), units.displacement),
            "points": len(line.x),
        }
    for name, motion in result.plates.items():
        pushed = result.plate_force(name)
        plates[name] = {
            **pair(motion, "", units.displacement),
            "rotation": _quantity(motion.rotation, "rad"),
            **pair(pushed, "force_", units.force),
            "moment": _quantity(pushed.moment, units.moment),
        }
    resultants = {name: result.resultant(name) for name in result.problem.mesh.edge_names}
    values = (
        contacts,
        plates,
        {name: _quantity(getattr(energies, name), units.energy) for name in energies.__dataclass_fields__},
        {n: {**pair(f, "", units.force), "moment": _quantity(f.moment, units.moment)} for n, f in resultants.items()},
        _quantity(result.traction_misfit, units.stress),
    )
    return dict(zip(_STATE_KEYS, values, strict=True))


def element_of(discretization: Discretization) -> dict[str, Any]:
    """Name, degree and contact rows of the element, for documents."""
    space = discretization.space
    return {"name": FAMILY, "degree": space.degree, "law_on": discretization.rule.law_on}


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
