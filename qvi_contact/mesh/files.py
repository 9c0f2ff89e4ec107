"""Meshes of triangles from other programs: scikit-fem, and files of Gmsh, Abaqus or CalculiX, and MED.

What has a name comes along: named curves become edge sets (joints where they lie inside the body), named surfaces
regions. Names are

* physical names in .msh files, see `gmsh_file`,
* ELSET in .inp files, with line elements such as T3D2 for curves,
* groups in .med files.

The last two are read by meshio, from copies. Nothing but the named file is read, and no array is made of a size that a
file only claims. Middle nodes of quadratic triangles are left out; sides are straight. Points that no triangle needs
are dropped.
"""

import stat
import warnings
from contextlib import redirect_stderr
from importlib import import_module
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from qvi_contact.basics.writing import given_path
from qvi_contact.errors import InputError
from qvi_contact.mesh.curves import MeshParts
from qvi_contact.mesh.gmsh_file import NamedCells, read_gmsh
from solvers.basics.types import load

_FORMATS: Final = {".msh": "gmsh", ".inp": "abaqus", ".med": "med"}
_TRIANGLES: Final = ("triangle", "triangle6", "triangle7")
_LINES: Final = ("line", "line3")
LARGEST: Final = 200_000_000
"""Bytes of a mesh file, and of the data that a MED file unfolds to."""

_MOST_TRIANGLES: Final = 1_000_000
_FLAT: Final = 1e-9  # of the size in the plane: larger z are no plane body


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
        If meshio is missing, the file cannot be read, or it holds other cells than triangles, or no plane body.

    """
    path = given_path("mesh", path)
    reader = _FORMATS.get(path.suffix.lower())
    if reader is None:
        raise _refused(path, f"give a file with one of the endings {', '.join(_FORMATS)}")
    _check_regular(path)
    found = _read(reader, path)
    if not len(found.cells):
        raise _refused(path, "holds no triangles")
    if found.points.shape[1] == 3 and np.ptp(found.points[:, 2]) > _FLAT * np.ptp(found.points[:, :2], axis=0).max():
        raise _refused(path, "is not plane: all points must have one coordinate z")
    if len(found.cells) > _MOST_TRIANGLES:
        raise _refused(path, f"holds {len(found.cells)} triangles: give at most {_MOST_TRIANGLES}")
    for numbers in (found.cells, *found.edge_sets.values()):
        wrong = numbers[(numbers < 0) | (numbers >= len(found.points))]
        if wrong.size:
            remedy = f"joins nodes that it does not hold (it has {len(found.points)}): write the mesh again"
            raise _refused(path, remedy)
    return _tidy(*found)


def _check_regular(path: Path) -> None:
    """`InputError` if the file is none that can be read, or is larger than any plane problem needs.

    Pipes and devices are not opened: they may wait for ever, and their end may be nowhere.
    """
    try:
        found = path.stat()
        if stat.S_ISREG(found.st_mode) or stat.S_ISDIR(found.st_mode):
            path.open("rb").close()
    except FileNotFoundError as error:
        raise _refused(path, "there is no such file: correct its name or folder") from error
    except (OSError, ValueError) as error:  # ValueError: a name no file can have
        reason = getattr(error, "strerror", None) or str(error)
        raise _refused(path, f"cannot be read ({reason}): give the name of a mesh file") from error
    if not stat.S_ISREG(found.st_mode):
        raise _refused(path, "is not a regular file: give the name of a mesh file")
    if found.st_size > LARGEST:
        raise _refused(path, f"holds more than {LARGEST} bytes, the limit: give a coarser mesh")


def _read(reader: str, path: Path) -> NamedCells:
    """What a file holds, or one `InputError`.

    What meshio prints, and NumPy warns of, is part of the error, and else nothing that anybody needs.
    """
    printed = StringIO()
    try:
        if reader == "gmsh":
            return read_gmsh(path)
        with TemporaryDirectory() as folder, warnings.catch_warnings(), redirect_stderr(printed):
            warnings.simplefilter("ignore")
            module = import_module(f"meshio.{reader}")
            if reader == "abaqus":
                found = module.read(_abaqus_text(path))
            else:
                h5py, copy = load("h5py"), Path(folder) / path.name
                with h5py.File(path, "r") as given, h5py.File(copy, "w") as kept:
                    _check_med(h5py, path, given)
                    for name in filter(given.__contains__, _NEEDED):
                        given.copy(name, kept)
                found = module.read(copy)
            return _named_cells(path, found)
    except InputError:
        raise
    except ImportError as error:
        needed = "meshio h5py" if reader == "med" else "meshio"
        remedy = f"these files need {needed.replace(' ', ' and ')}: python -m pip install {needed}"
        raise _refused(path, remedy) from error
    except Exception as error:  # whatever a broken file makes a reader stumble over
        told = " ".join(f"{error} {printed.getvalue()}".split()) or type(error).__name__
        raise _refused(path, f"cannot be read as {reader} ({told}): write the mesh again") from error


def _named_cells(path: Path, found: Any) -> NamedCells:
    """What meshio read, by name: its sets of cells (ELSET), and the groups of the families of MED."""
    kinds = sorted({block.type for block in found.cells} - {*_TRIANGLES, *_LINES, "vertex"})
    if kinds:
        raise _refused(path, f"holds cells of kind {kinds[0]!r}: give a mesh of triangles only")
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
            if block.type in _TRIANGLES:
                regions.setdefault(name, []).append(start + rows)
                start += len(block.data)
            elif block.type in _LINES:
                edge_sets.setdefault(name, []).append(block.data[rows, :2])
    joined = ({name: np.concatenate(parts) for name, parts in each.items()} for each in (edge_sets, regions))
    named = [{name: parts for name, parts in each.items() if len(parts)} for each in joined]
    cells = [block.data[:, :3] for block in found.cells if block.type in _TRIANGLES]
    points = np.asarray(found.points, dtype=float)
    return NamedCells(points, np.concatenate([np.empty((0, 3), np.int64), *cells]), *named)


def _tidy(points: Any, cells: Any, edge_sets: dict[str, Any], regions: dict[str, Any]) -> MeshParts:
    """The plane mesh without the points that no triangle needs."""
    cells = np.asarray(cells, dtype=np.int64)
    used = np.unique(cells)
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    pairs = {str(name): number[np.asarray(ends, dtype=np.int64)] for name, ends in edge_sets.items()}
    vertices = np.ascontiguousarray(np.asarray(points, dtype=float)[used, :2])
    return MeshParts(vertices, number[cells], pairs, {str(name): chosen for name, chosen in regions.items()})


_MOST_GENERATED: Final = 10_000_000
"""Members of all sets given as ranges together."""


def _abaqus_text(path: Path) -> StringIO:
    """The text of a file for meshio.

    Raises
    ------
    InputError
        If it includes another file, or its ranges (GENERATE) have too many members.

    """
    text = StringIO(path.read_bytes().decode("utf-8", "replace"), newline=None)
    generated, numbers, ranges = 0, list[int](), False
    for line in (*text, "*"):
        if line.partition(",")[0].strip().replace("*", "").upper() == "INCLUDE":  # as meshio finds keywords
            raise _refused(path, "reads another file by *INCLUDE: put everything into this one")
        if line.startswith("*"):
            if len(numbers) == 3 and numbers[2]:
                generated += len(range(numbers[0], numbers[1] + 1, numbers[2]))
            ranges, numbers = "GENERATE" in line.upper(), []
        elif ranges:
            numbers += [int(word) for word in line.split(",") if word.strip().isnumeric()]
    if generated > _MOST_GENERATED:
        raise _refused(path, f"has sets of {generated} members in ranges (GENERATE): give at most {_MOST_GENERATED}")
    text.seek(0)
    return text


_NEEDED: Final = ("ENS_MAA", "FAS")
_MOST_OBJECTS: Final = 100_000
_DEEPEST: Final = 20
"""Groups inside each other; MED needs 6, and a group may lie inside itself."""


def _check_med(h5py: Any, path: Path, given: Any) -> None:
    """Look at every object on every way to it, as meshio reads what has several names several times.

    `InputError` if the file refers to others, or holds more than the limit; `ValueError` if it claims more than that.
    """
    total, items, claimed, count = 0, 0, 0, 0
    places = [(given, name, 1) for name in given if name in _NEEDED]
    while places:
        group, name, depth = places.pop()
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            raise _refused(path, f"holds a link {name!r} to another place: save the mesh as one file")
        item, count = group[name], count + 1
        if isinstance(item, h5py.Group):
            places += [(item, below, depth + 1) for below in item]
        elif isinstance(item, h5py.Dataset):
            if item.external or item.is_virtual:
                raise _refused(path, f"keeps {name!r} in another file: save the mesh as one file")
            if item.dtype.hasobject:
                raise ValueError(f"{name!r} has entries without a size")
            total, items = total + int(item.nbytes), items + int(item.size or 0)
        if total > LARGEST:
            raise _refused(path, f"unfolds to more than {LARGEST} bytes, the limit: give a coarser mesh")
        if count > _MOST_OBJECTS or depth > _DEEPEST:
            told = f"holds more than {_MOST_OBJECTS} objects, or {_DEEPEST} inside each other"
            raise _refused(path, f"{told}: give a simpler mesh")
        claimed = max(claimed, int(item.attrs.get("NBR", 0)))
    if claimed > items:
        raise ValueError(f"it claims {claimed} entries where it holds {items}")


def _refused(path: Path, remedy: str) -> InputError:
    return InputError("mesh", str(path), remedy)
