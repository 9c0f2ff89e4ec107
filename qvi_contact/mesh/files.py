"""Meshes from other programs: scikit-fem, and files of Gmsh, Abaqus or CalculiX, MED, and VTK.

What has a name comes along: named curves become edge sets (joints where they lie inside the body), named surfaces
regions. Names are

* physical names in .msh files, see `gmsh_file`,
* ELSET in .inp files, with line elements such as T3D2 for curves,
* groups in .med files;

files of VTK have none. All but the first are read by meshio. Quadrilaterals are cut in two. Middle nodes of quadratic
elements are left out; sides are straight. Points that no triangle needs are dropped.
"""

import stat
import warnings
from contextlib import redirect_stderr
from importlib import import_module
from io import StringIO
from pathlib import Path
from typing import Any, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.basics.writing import given_path
from qvi_contact.errors import InputError
from qvi_contact.mesh.arcs import cross
from qvi_contact.mesh.curves import MeshParts
from qvi_contact.mesh.gmsh_file import NamedCells, read_gmsh

_FORMATS: Final = {".msh": "gmsh", ".inp": "abaqus", ".med": "med", ".vtk": "vtk", ".vtu": "vtu"}
_LARGEST: Final = 200_000_000  # bytes
_MOST_TRIANGLES: Final = 1_000_000
_FLAT: Final = 1e-9  # of the size in the plane: larger z are no plane body
_BETTER: Final = 1e-6  # share by which a triangle is larger that rounding alone does not make so


def from_skfem(mesh: object) -> MeshParts:
    """Vertices, triangles, boundaries and subdomains of a mesh of scikit-fem."""
    given: Any = mesh
    if not hasattr(given, "facets") or np.asarray(getattr(given, "t", 0)).shape[:1] != (3,):
        raise InputError("mesh", type(mesh).__name__, "give a skfem.MeshTri")
    boundaries, subdomains = given.boundaries or {}, given.subdomains or {}
    edge_sets = {name: given.facets[:, np.asarray(facets)].T for name, facets in boundaries.items()}
    regions = {name: np.asarray(cells) for name, cells in subdomains.items()}
    return _tidy(given.p.T, given.t.T, edge_sets, regions)


def read_mesh(path: str | Path) -> MeshParts:
    """Vertices, triangles, and named curves and surfaces of a mesh file.

    Raises
    ------
    InputError
        If meshio is missing, the file cannot be read, or it holds other cells than triangles and quadrilaterals, or no
        plane body.

    """
    path = given_path("mesh", path)
    mesh = _read(path)
    if not len(mesh.cells):
        raise _refused(path, "holds no triangles")
    if mesh.points.shape[1] == 3 and np.ptp(mesh.points[:, 2]) > _FLAT * np.ptp(mesh.points[:, :2], axis=0).max():
        raise _refused(path, "is not plane: all points must have one coordinate z")
    for numbers in (mesh.cells, *mesh.edge_sets.values()):
        if ((numbers < 0) | (numbers >= len(mesh.points))).any():
            held = f"(it has {len(mesh.points)})"
            raise _refused(path, f"joins nodes that it does not hold {held}: write the mesh again")
    cells, parent = _triangles(mesh.points[:, :2], mesh.cells)
    if len(cells) > _MOST_TRIANGLES:
        raise _refused(path, f"holds {len(cells)} triangles: give at most {_MOST_TRIANGLES}")
    regions = {name: np.flatnonzero(np.isin(parent, chosen)) for name, chosen in mesh.regions.items()}
    return _tidy(mesh.points, cells, mesh.edge_sets, regions)


def _refused(path: Path, remedy: str) -> InputError:
    return InputError("mesh", str(path), remedy)


def _read(path: Path) -> NamedCells:
    """What a file holds, or one `InputError`; pipes and devices are not opened, as they may wait for ever."""
    reader = _FORMATS.get(path.suffix.lower())
    if reader is None:
        raise _refused(path, f"give a file with one of the endings {', '.join(_FORMATS)}")
    printed = StringIO()  # what meshio prints, and NumPy warns of, is part of an error, and else nothing anybody needs
    try:
        found = path.stat()
        if not stat.S_ISREG(found.st_mode) and not stat.S_ISDIR(found.st_mode):
            raise _refused(path, "is not a regular file: give the name of a mesh file")
        path.open("rb").close()
        if found.st_size > _LARGEST:
            raise _refused(path, f"holds more than {_LARGEST} bytes, the limit: give a coarser mesh")
        with warnings.catch_warnings(), redirect_stderr(printed):
            warnings.simplefilter("ignore")
            return read_gmsh(path) if reader == "gmsh" else _named_cells(import_module(f"meshio.{reader}").read(path))
    except InputError as error:
        raise _refused(path, error.remedy) from error
    except FileNotFoundError as error:
        raise _refused(path, "there is no such file: correct its name or folder") from error
    except ImportError as error:
        needed = "meshio h5py" if reader == "med" else "meshio"
        remedy = f"these files need {needed.replace(' ', ' and ')}: python -m pip install {needed}"
        raise _refused(path, remedy) from error
    except Exception as error:  # whatever a broken file makes a reader stumble over
        told = " ".join(f"{getattr(error, 'strerror', None) or error} {printed.getvalue()}".split())
        told = told or type(error).__name__
        raise _refused(path, f"cannot be read as {reader} ({told}): write the mesh again") from error


def _named_cells(found: Any) -> NamedCells:
    """What meshio read, by name: its sets of cells (ELSET), and the groups of the families of MED."""
    corners = {"triangle": 3, "triangle6": 3, "triangle7": 3, "quad": 4, "quad8": 4, "quad9": 4}
    lines = ("line", "line3")
    kinds = sorted({block.type for block in found.cells} - {*corners, *lines, "vertex"})
    if kinds:
        raise InputError("mesh", kinds[0], f"holds cells of kind {kinds[0]!r}: give triangles and quadrilaterals only")
    sets = [(name, members) for name, members in found.cell_sets.items()]
    families, tags = getattr(found, "cell_tags", None) or {}, found.cell_data.get("cell_tags", ())
    for family, names in families.items():
        members = [np.flatnonzero(np.asarray(values) == family) for values in tags]
        sets += [(name, members) for name in names]
    edge_sets, regions = dict[str, list[Any]](), dict[str, list[Any]]()
    for name, members in sets:
        start = 0
        for block, rows in zip(found.cells, members, strict=False):
            rows = np.asarray([] if rows is None else rows, dtype=np.int64).ravel()
            if block.type in corners:
                regions.setdefault(name, []).append(start + rows)
                start += len(block.data)
            elif block.type in lines:
                edge_sets.setdefault(name, []).append(block.data[rows, :2])
    joined = ({name: np.concatenate(parts) for name, parts in each.items()} for each in (edge_sets, regions))
    named = [{name: parts for name, parts in each.items() if len(parts)} for each in joined]
    cells = [block.data[:, [0, 1, 2, corners[block.type] - 1]] for block in found.cells if block.type in corners]
    points = np.asarray(found.points, dtype=float)
    return NamedCells(points, np.concatenate([np.empty((0, 4), np.int64), *cells]), *named)


def _triangles(points: FloatArray, cells: IntArray) -> tuple[IntArray, IntArray]:
    """Triangles (t, 3) of cells (m, 4), of which triangles have their last corner twice; and the cell of each (t,).

    A quadrilateral is cut from a corner of the body that it fills, as a triangle with two edges on the boundary could
    follow the tractions on neither of them; else so that the smaller triangle is large.
    """
    quads = cells[:, 3] != cells[:, 2]
    if not quads.any():
        return cells[:, :3], np.arange(len(cells))
    pairs = np.sort(np.stack([cells, np.roll(cells, -1, axis=1)], axis=2), axis=2)  # of a triangle one is a point
    keys = pairs[..., 0] * len(points) + pairs[..., 1]
    _, index, count = np.unique(keys, return_inverse=True, return_counts=True)
    outer = (count == 1)[index].reshape(keys.shape)  # sides ab, bc, cd, da
    in_corner = outer & np.roll(outer, 1, axis=1)  # a, b, c, d
    a, b, c, d = points[cells].swapaxes(0, 1)
    least = []  # area of the smaller triangle on either diagonal, below 0 where it lies outside
    for one, other in (((a, b, c), (a, c, d)), ((a, b, d), (b, c, d))):
        first, second = (cross(q - p, r - p) for p, q, r in (one, other))
        least.append(np.where(first * second > 0.0, np.minimum(np.abs(first), np.abs(second)), -1.0))
    larger = least[1] > least[0] * (1.0 + _BETTER)
    fills = in_corner[:, [1, 3]].sum(axis=1) - in_corner[:, [0, 2]].sum(axis=1)
    from_b = np.where((least[0] > 0.0) & (least[1] > 0.0) & (fills != 0), fills > 0, larger)[:, None]
    halves = np.stack(
        [np.where(from_b, cells[:, [0, 1, 3]], cells[:, :3]), np.where(from_b, cells[:, 1:], cells[:, [0, 2, 3]])], 1
    )
    halves[~quads, 0] = cells[~quads, :3]
    kept = np.column_stack([np.ones(len(cells), dtype=bool), quads])
    return halves[kept], np.repeat(np.arange(len(cells)), kept.sum(axis=1))


def _tidy(points: Any, cells: Any, edge_sets: dict[str, Any], regions: dict[str, Any]) -> MeshParts:
    """The plane mesh without the points that no triangle needs."""
    cells = np.asarray(cells, dtype=np.int64)
    used = np.unique(cells)
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    pairs = {str(name): number[np.asarray(ends, dtype=np.int64)] for name, ends in edge_sets.items()}
    vertices = np.ascontiguousarray(np.asarray(points, dtype=float)[used, :2])
    return MeshParts(vertices, number[cells], pairs, {str(name): chosen for name, chosen in regions.items()})
