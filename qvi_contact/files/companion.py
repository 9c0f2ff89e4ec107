"""Displacements and stresses of the displacement model as a VTU file for ParaView."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.basics.units import Units
from qvi_contact.basics.writing import check_suffix, replacing
from qvi_contact.companion.result import CompanionResult
from qvi_contact.errors import InputError
from qvi_contact.solution.sampling import out_of_plane_factor, von_mises
from qvi_contact.solution.stress import principal_stresses
from solvers.basics.types import load


def write_vtu(path: str | Path, companion: CompanionResult, units: Units | None = None) -> None:
    """Write displacements and stresses as an unstructured VTK grid; needs the extra ``vtk`` (meshio).

    Every cell is divided into (2 p)² quadrilaterals of its own, that share no points with those of other cells, so that
    stresses may jump between cells and displacements across joints. "Warp by vector" draws the deformed shape.

    Parameters
    ----------
    path : str or Path
        The file, ending in .vtu.
    companion : CompanionResult
        A result with a displacement.
    units : Units, optional
        If given, names of fields end in their unit, as in "displacement [mm]".

    Raises
    ------
    InputError
        If meshio is missing, there is no displacement, the suffix is another one, or the file cannot be written.

    Notes
    -----
    Point data: "displacement" with the components x, y, z = 0; "stress" with xx, yy, zz, xy, yz, xz (zz = ν(xx + yy) in
    plane strain); "von Mises"; "principal 1" ≥ "principal 2" in the plane. Cell data: "material", 0 for the body's own
    and then the number of the region.

    """
    if find_spec("meshio") is None:
        raise InputError("vtk", "meshio", "VTU files need meshio: python -m pip install 'qvi-contact[vtk]'")
    check_suffix("vtk", path, ".vtu")
    r = 2 * companion.degree
    points, fields = _point_data(companion, r, units)
    problem = companion.problem
    material = np.repeat(problem.cell_materials, r * r)
    meshio = load("meshio")
    quads = sub_quads(companion.problem.mesh.cell_count, r)
    mesh = meshio.Mesh(points, [("quad", quads)], point_data=fields, cell_data={"material": [material]})
    with replacing(path) as temporary:
        mesh.write(temporary, file_format="vtu")


def sub_points(r: int) -> tuple[FloatArray, FloatArray]:
    """Reference coordinates of the (r + 1)² corners of r² equal quadrilaterals in a cell, along x first."""
    t = np.linspace(0.0, 1.0, r + 1)
    return np.tile(t, r + 1), np.repeat(t, r + 1)


def sub_quads(cells: int, r: int) -> IntArray:
    """Corners of these quadrilaterals in all cells, counterclockwise, (cells r², 4)."""
    first = (np.arange(r)[:, None] * (r + 1) + np.arange(r)).ravel()
    corners = first[:, None] + np.array([0, 1, r + 2, r + 1])
    return np.asarray((r + 1) ** 2 * np.arange(cells)[:, None, None] + corners).reshape(-1, 4)


def _point_data(companion: CompanionResult, r: int, units: Units | None) -> tuple[FloatArray, dict[str, FloatArray]]:
    tx, ty = sub_points(r)
    place = companion.cell_points(tx, ty).reshape(-1, 2)
    displacement = companion.cell_displacement(tx, ty).reshape(-1, 2)
    stress = companion.cell_stress(tx, ty).reshape(-1, 3)
    active = companion.problem.grid.active
    factor = np.repeat(out_of_plane_factor(companion.problem)[active], len(tx))
    xx, yy, xy = stress.T
    zero = np.zeros_like(xx)
    first, second, _ = principal_stresses(stress)
    stresses = {"stress": np.column_stack([xx, yy, factor * (xx + yy), xy, zero, zero])}
    stresses |= {"von Mises": von_mises(stress, factor), "principal 1": first, "principal 2": second}
    fields = {"displacement" + (f" [{units.displacement}]" if units else ""): np.column_stack([displacement, zero])}
    fields |= {name + (f" [{units.stress}]" if units else ""): values for name, values in stresses.items()}
    return np.column_stack([place, zero]), fields
