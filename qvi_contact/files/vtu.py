"""VTU files for ParaView, by meshio: results, their contacts, and displacements of the displacement model."""

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final
from xml.sax.saxutils import escape

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray, whole_number
from qvi_contact.basics.units import Units
from qvi_contact.basics.writing import check_suffix, replacing
from qvi_contact.companion.result import CompanionResult
from qvi_contact.discretization.loads import physical
from qvi_contact.errors import InputError
from qvi_contact.solution.contact_line import ContactLine
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.sampling import cell_factors, held_along_z, von_mises
from qvi_contact.solution.stress import principal_stresses, stress_in_cells
from solvers.basics.types import load

if TYPE_CHECKING:
    from qvi_contact.bracket import Bracket

_CHUNK: Final = 4096  # cells at a time: their tables stay small
_SINGLE_VALUED: Final = 1e-9  # jump of the dimensionless Airy function that is rounding
_MOST_SUBDIVISIONS: Final = 100  # of a part of a cell: ten thousand triangles
_QUOTES = {'"': "&quot;"}
_KINDS = {2: "line", 3: "triangle"}
_TRIANGLE: Final = (0, 1, 2)


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
    _check_vtu(path)
    r = whole_number("subdivisions", subdivisions, _MOST_SUBDIVISIONS)
    points, point_data = _point_data(result, r, units)
    t, corners = result.discretization.space.lattice(r)
    count = result.problem.mesh.cell_count
    number = np.repeat(np.arange(count), len(corners))
    cell_data: dict[str, FloatArray | IntArray] = {"material": result.problem.cell_materials[number], "cell": number}
    if bracket is not None:
        companion = _companion(result, bracket)
        moved = companion.cell_displacement(*t[:, -2:].T).reshape(-1, 2)
        point_data[_named("displacement", "displacement", units)] = _vectors(moved)
        cell_data[_named("energy gap", "energy", units)] = bracket.cell_gaps[number]
    cells = (len(t) * np.arange(count)[:, None, None] + corners).reshape(-1, corners.shape[1])
    _write_grid(path, points, cells, point_data, cell_data)


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
    _check_vtu(path)
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
    _write_grid(path, points, np.concatenate(joints), fields, {"contact": np.concatenate(number)})


def contacts_path(path: str | Path) -> Path:
    """The file of contacts beside a file of fields: part.vtu has part_contacts.vtu."""
    whole = Path(path)
    return whole.with_name(f"{whole.stem}_contacts{whole.suffix}")


def write_companion_vtu(path: str | Path, companion: CompanionResult, units: Units | None = None) -> None:
    """Write displacements and stresses as an unstructured VTK grid; needs the extra ``vtk`` (meshio).

    Every cell is divided into (2 p)² triangles of its own, that share no points with those of other
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
    _check_vtu(path)
    problem, (t, parts) = companion.problem, companion.space.cell.lattice(2 * companion.degree)
    displacement = companion.cell_displacement(*t.T).reshape(-1, 2)
    stress = companion.cell_stress(*t.T).reshape(-1, 3)
    fields = {_named("displacement", "displacement", units): _vectors(displacement)}
    held = held_along_z(problem, np.arange(problem.mesh.cell_count), *np.moveaxis(companion.cell_points(*t.T), -1, 0))
    fields |= _stress_fields(stress, np.repeat(cell_factors(problem), len(t)), held.ravel(), units)
    cells = (len(t) * np.arange(problem.mesh.cell_count)[:, None, None] + parts).reshape(-1, parts.shape[1])
    material = np.repeat(problem.cell_materials, len(parts))
    _write_grid(path, companion.cell_points(*t.T).reshape(-1, 2), cells, fields, {"material": material})


def _companion(result: ContactResult, bracket: "Bracket") -> CompanionResult:
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
        **{_named(name, "stress", units): values for name, values in stresses.items()},
        **{_named(name, "displacement", units): getattr(line, name) for name in ("gap", "slip")},
        "state": line.state.astype(np.float64),
        _named("traction", "stress", units): _vectors(traction),
        "normal": _vectors(normal),
    }


def _joined_points(order: IntArray, line: IntArray) -> IntArray:
    """Pairs (k, 2) of neighbours among points in order (n, q), of edges on lines with these numbers (n,)."""
    within = np.stack([order[:, :-1].ravel(), order[:, 1:].ravel()], axis=1)
    goes_on = np.diff(line) == 0
    between = np.stack([order[:-1, -1][goes_on], order[1:, 0][goes_on]], axis=1)
    return np.concatenate([within, between])


def _point_data(result: ContactResult, r: int, units: Units | None) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Points (m, 2) of all cells, those of `StressSpace.lattice` in each, cell by cell, and the fields there."""
    known, count = result.discretization, result.problem.mesh.cell_count
    t, _ = known.space.lattice(r)
    chunks = [np.arange(count)[start : start + _CHUNK] for start in range(0, count, _CHUNK)]
    coefficients = known.coefficients(result.dofs)
    places = np.concatenate([known.space.points(cells, t) for cells in chunks]).reshape(-1, 2)
    stress = np.concatenate([stress_in_cells(known, coefficients, cells, t)[1] for cells in chunks]).reshape(-1, 3)
    stress *= known.scales.stress
    x, y = physical(result.problem, known.scales, places)
    held = held_along_z(result.problem, np.repeat(np.arange(count), len(t)), x, y)
    found = _stress_fields(stress, np.repeat(cell_factors(result.problem), len(t)), held, units)
    if np.abs(known.space.jumps(result.dofs)).max(initial=0.0) <= _SINGLE_VALUED:
        airy = np.concatenate([known.space.airy(coefficients, cells, t) for cells in chunks])
        found[_named("Airy function", "moment", units)] = airy.ravel() * known.scales.airy
    return np.column_stack([x, y]), found


def _check_vtu(path: str | Path) -> None:
    """Refuse a name that does not end in .vtu; `InputError` with the command to type if meshio is missing."""
    if find_spec("meshio") is None:
        raise InputError("vtk", "meshio", "VTU files need meshio: python -m pip install meshio")
    check_suffix("vtk", path, ".vtu")


def _write_grid(
    path: str | Path,
    points: FloatArray,
    parts: IntArray,
    point_data: Mapping[str, FloatArray],
    cell_data: Mapping[str, FloatArray | IntArray],
) -> None:
    """Write points (n, 2), lines or triangles by their corners (c, s), and data of both; whole or not at all.

    Triangles are turned counterclockwise, so that all face the same way.

    Meshio writes names as they are: those of fields are escaped here, as a unit may be called anything.
    """
    if parts.shape[1] == len(_TRIANGLE):
        first, second, third = np.moveaxis(points[parts], 1, 0)
        (ux, uy), (vx, vy) = (second - first).T, (third - first).T
        parts = np.where((ux * vy < uy * vx)[:, None], parts[:, _TRIANGLE[::-1]], parts)
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


def _named(name: str, unit: str, units: Units | None) -> str:
    """The name of a field, with the unit it has among the user's, such as "stress"."""
    label = Units.labels(units, {name: unit})
    return f"{name} [{label[name]}]" if label else name


def _stress_fields(
    stress: FloatArray, factor: FloatArray, held: FloatArray, units: Units | None
) -> dict[str, FloatArray]:
    """Fields of stresses (n, 3); `factor` and `held` as in `von_mises`.

    "stress" has the components xx, yy, zz, xy, yz, xz of VTK's symmetric tensors.
    """
    xx, yy, xy = stress.T
    zero = np.zeros_like(xx)
    first, second, _ = principal_stresses(stress)
    found = {
        "stress": np.column_stack([xx, yy, factor * (xx + yy) + held, xy, zero, zero]),
        "von Mises": von_mises(stress, factor, held),
        "principal 1": first,
        "principal 2": second,
    }
    return {_named(name, "stress", units): values for name, values in found.items()}


def _vectors(values: FloatArray) -> FloatArray:
    """Plane vectors (n, 2) as VTK has them, with z = 0."""
    return np.column_stack([values, np.zeros(len(values))])
