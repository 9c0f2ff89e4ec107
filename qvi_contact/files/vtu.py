"""VTU files for ParaView, by meshio: what all of them have in common."""

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.basics.units import Units
from qvi_contact.basics.writing import check_suffix, replacing
from qvi_contact.errors import InputError
from qvi_contact.solution.sampling import von_mises
from qvi_contact.solution.stress import principal_stresses
from solvers.basics.types import load

_QUOTES = {'"': "&quot;"}
_KINDS = {2: "line", 3: "triangle", 4: "quad"}


def check_vtu(path: str | Path) -> None:
    """Refuse a name that does not end in .vtu; `InputError` with the command to type if meshio is missing."""
    if find_spec("meshio") is None:
        raise InputError("vtk", "meshio", "VTU files need meshio: python -m pip install meshio")
    check_suffix("vtk", path, ".vtu")


def write_grid(
    path: str | Path,
    points: FloatArray,
    parts: IntArray,
    point_data: Mapping[str, FloatArray],
    cell_data: Mapping[str, FloatArray | IntArray],
) -> None:
    """Write points (n, 2), parts of two to four corners (c, s), and data of both; whole or not at all.

    Meshio writes names as they are: those of fields are escaped here, as a unit may be called anything.
    """
    flat = np.column_stack([points, np.zeros(len(points))])
    blocks: Sequence[Any] = [(_KINDS[parts.shape[1]], parts)]
    grid = load("meshio").Mesh(
        flat,
        blocks,
        point_data={escape(name, _QUOTES): values for name, values in point_data.items()},
        cell_data={escape(name, _QUOTES): [values] for name, values in cell_data.items()},
    )
    with replacing(path) as temporary:
        grid.write(temporary, file_format="vtu")


def named(name: str, unit: str, units: Units | None) -> str:
    """The name of a field, with the unit it has among the user's, such as "stress"."""
    label = Units.labels(units, {name: unit})
    return f"{name} [{label[name]}]" if label else name


def stress_fields(stress: FloatArray, factor: FloatArray, units: Units | None) -> dict[str, FloatArray]:
    """Fields of stresses (n, 3); `factor` as in `von_mises`.

    "stress" has the components xx, yy, zz, xy, yz, xz of VTK's symmetric tensors.
    """
    xx, yy, xy = stress.T
    zero = np.zeros_like(xx)
    first, second, _ = principal_stresses(stress)
    found = {
        "stress": np.column_stack([xx, yy, factor * (xx + yy), xy, zero, zero]),
        "von Mises": von_mises(stress, factor),
        "principal 1": first,
        "principal 2": second,
    }
    return {named(name, "stress", units): values for name, values in found.items()}


def vectors(values: FloatArray) -> FloatArray:
    """Plane vectors (n, 2) as VTK has them, with z = 0."""
    return np.column_stack([values, np.zeros(len(values))])
