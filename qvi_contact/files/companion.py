"""Displacements and stresses of the displacement model as a VTU file for ParaView."""

from pathlib import Path

import numpy as np

from qvi_contact.basics.units import Units
from qvi_contact.companion.result import CompanionResult
from qvi_contact.files.vtu import check_vtu, named, stress_fields, vectors, write_grid
from qvi_contact.solution.sampling import cell_factors


def write_vtu(path: str | Path, companion: CompanionResult, units: Units | None = None) -> None:
    """Write displacements and stresses as an unstructured VTK grid; needs the extra ``vtk`` (meshio).

    Every cell is divided into (2 p)² quadrilaterals or triangles of its own, that share no points with those of other
    cells, so that stresses may jump between cells and displacements across joints. "Warp by vector" draws the deformed
    shape.

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
    check_vtu(path)
    problem, (t, parts) = companion.problem, companion.space.cell.lattice(2 * companion.degree)
    displacement = companion.cell_displacement(*t.T).reshape(-1, 2)
    stress = companion.cell_stress(*t.T).reshape(-1, 3)
    fields = {named("displacement", "displacement", units): vectors(displacement)}
    fields |= stress_fields(stress, np.repeat(cell_factors(problem), len(t)), units)
    cells = (len(t) * np.arange(problem.mesh.cell_count)[:, None, None] + parts).reshape(-1, parts.shape[1])
    material = np.repeat(problem.cell_materials, len(parts))
    write_grid(path, companion.cell_points(*t.T).reshape(-1, 2), cells, fields, {"material": material})
