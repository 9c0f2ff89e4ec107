"""Meshes of triangles from other programs: scikit-fem, and by meshio files of Gmsh, Abaqus or CalculiX, and MED.

What has a name comes along: named curves become edge sets (joints where they lie inside the body), named surfaces
regions. Names are

* physical names in .msh files (formats 2.2 and 4.1),
* ELSET in .inp files, with line elements such as T3D2 for curves,
* groups in .med files.

Nothing but the named file is read, and no array is made of a size that a file only claims: see `gmsh_file`, `med_file`
and `abaqus_file`. Middle nodes of quadratic triangles are left out; sides are straight. Points that no triangle needs
are dropped.
"""

import stat
import warnings
from collections.abc import Iterable, Iterator
from contextlib import redirect_stderr
from importlib import import_module
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from qvi_contact.basics.checks import IntArray
from qvi_contact.basics.writing import given_path
from qvi_contact.errors import InputError
from qvi_contact.mesh import gmsh_file
from qvi_contact.mesh.parts import MeshParts
from solvers.basics.types import load

_FORMATS: Final = {".msh": "gmsh", ".inp": "abaqus", ".med": "med"}
_TRIANGLES: Final = ("triangle", "triangle6", "triangle7")
_LINES: Final = ("line", "line3")
_IGNORED: Final = (*_LINES, "vertex")
_HALF_NAMED: Final = "gmsh:physical"  # meshio reads binary files of format 4 only where all cells have names, or none
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
        raise InputError("mesh", str(path), f"give a file with one of the endings {', '.join(_FORMATS)}")
    _check_regular(path)
    found = _read(reader, path)
    kinds = {block.type for block in found.cells} - {*_TRIANGLES, *_IGNORED}
    if kinds:
        kind = sorted(kinds)[0]
        raise InputError("mesh", str(path), f"holds cells of kind {kind!r}: give a mesh of triangles only")
    points = np.asarray(found.points, dtype=float)
    if points.ndim != 2 or not any(block.type in _TRIANGLES for block in found.cells):
        raise InputError("mesh", str(path), "holds no triangles")
    if points.shape[1] == 3 and np.ptp(points[:, 2]) > _FLAT * np.ptp(points[:, :2], axis=0).max():
        raise InputError("mesh", str(path), "is not plane: all points must have one coordinate z")
    cells = np.concatenate([block.data[:, :3] for block in found.cells if block.type in _TRIANGLES])
    if len(cells) > _MOST_TRIANGLES:
        raise InputError("mesh", str(path), f"holds {len(cells)} triangles: give at most {_MOST_TRIANGLES}")
    edge_sets, regions = _named(found, _LINES, 2), _named(found, _TRIANGLES, 3)
    starts = _starts(found, _TRIANGLES)
    numbered = {name: np.concatenate([starts[i] + rows for i, rows in parts]) for name, parts in regions.items()}
    pairs = {
        name: np.concatenate([found.cells[i].data[rows, :2] for i, rows in parts]) for name, parts in edge_sets.items()
    }
    _refuse_strangers(path, points, cells, *pairs.values())
    return _tidy(points[:, :2], cells, pairs, numbered)


def _check_regular(path: Path) -> None:
    """`InputError` if the file is none that can be read, or is larger than any plane problem needs.

    Pipes and devices are not opened: they may wait for ever, and their end may be nowhere.
    """
    try:
        found = path.stat()
        if stat.S_ISREG(found.st_mode) or stat.S_ISDIR(found.st_mode):
            path.open("rb").close()
    except FileNotFoundError as error:
        raise InputError("mesh", str(path), "there is no such file: correct its name or folder") from error
    except (OSError, ValueError) as error:  # ValueError: a name no file can have
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError("mesh", str(path), f"cannot be read ({reason}): give the name of a mesh file") from error
    if not stat.S_ISREG(found.st_mode):
        raise InputError("mesh", str(path), "is not a regular file: give the name of a mesh file")
    if found.st_size > LARGEST:
        raise InputError("mesh", str(path), f"holds more than {LARGEST} bytes, the limit: give a coarser mesh")


def _read(reader: str, path: Path) -> Any:
    """What meshio reads of a copy that was checked, or one `InputError`.

    What meshio prints, and NumPy warns of, is part of the error, and else nothing that anybody needs.
    """
    printed = StringIO()
    try:
        with TemporaryDirectory() as folder, warnings.catch_warnings(), redirect_stderr(printed):
            warnings.simplefilter("ignore")
            module, copy = import_module(f"meshio.{reader}"), Path(folder) / path.name
            if reader == "abaqus":
                return module.read(_abaqus_text(path))
            if reader == "gmsh":
                gmsh_file.copy_needed(path, copy)
            else:
                _copy_med(path, copy, LARGEST)
            return module.read(copy)
    except InputError:
        raise
    except ImportError as error:
        needed = "MED files need meshio and h5py: python -m pip install meshio h5py"
        if reader != "med":
            needed = "mesh files need meshio: python -m pip install meshio"
        raise InputError("mesh", str(path), needed) from error
    except Exception as error:  # meshio raises whatever a broken file makes it stumble over
        told = " ".join(f"{error} {printed.getvalue()}".split()) or type(error).__name__
        hint = "save the mesh as ASCII, or in format 2.2" if _HALF_NAMED in told else "write the mesh again"
        raise InputError("mesh", str(path), f"cannot be read as {reader} ({told}): {hint}") from error


def _refuse_strangers(path: Path, points: Any, *joined: Any) -> None:
    """`InputError` if cells join points that are not there."""
    for numbers in joined:
        wrong = numbers[(numbers < 0) | (numbers >= len(points))]
        if wrong.size:
            remedy = f"joins nodes that it does not hold (it has {len(points)}): write the mesh again"
            raise InputError("mesh", str(path), remedy)


def _starts(found: Any, kinds: Iterable[str]) -> dict[int, int]:
    """The number of the first cell of each block among all cells of those kinds."""
    starts, count = {}, 0
    for index, block in enumerate(found.cells):
        if block.type in kinds:
            starts[index] = count
            count += len(block.data)
    return starts


def _named(found: Any, kinds: Iterable[str], dimension: int) -> dict[str, list[tuple[int, IntArray]]]:
    """Named sets of cells of those kinds: pairs (block, rows in it) by name."""
    sets: dict[str, list[tuple[int, IntArray]]] = {}
    for name, index, rows in (*_cell_sets(found), *_physical(found, dimension - 1), *_groups(found)):
        if found.cells[index].type in kinds and len(rows):
            sets.setdefault(name, []).append((index, rows))
    return sets


def _cell_sets(found: Any) -> Iterator[tuple[str, int, IntArray]]:
    """Sets that meshio knows by name: ELSET of Abaqus, physical names of Gmsh 4."""
    for name, members in found.cell_sets.items():
        if name.split(":")[0] == "gmsh":
            continue
        for index, rows in enumerate(members):
            if rows is not None:
                yield name, index, np.asarray(rows, dtype=np.int64).ravel()


def _physical(found: Any, dimension: int) -> Iterator[tuple[str, int, IntArray]]:
    """Physical names of Gmsh 2, which are numbers of cells beside a list of names."""
    tags = found.cell_data.get("gmsh:physical")
    if tags is None or any(name in found.cell_sets for name in found.field_data):
        return
    for name, (tag, of) in found.field_data.items():
        if of == dimension:
            for index, values in enumerate(tags):
                yield name, index, np.flatnonzero(np.asarray(values) == tag)


def _groups(found: Any) -> Iterator[tuple[str, int, IntArray]]:
    """Groups of MED: families of cells, each with the names of its groups."""
    families, tags = getattr(found, "cell_tags", None), found.cell_data.get("cell_tags")
    if not families or tags is None:
        return
    for family, names in families.items():
        for name in names:
            for index, values in enumerate(tags):
                yield name, index, np.flatnonzero(np.asarray(values) == family)


def _tidy(points: Any, cells: Any, edge_sets: dict[str, Any], regions: dict[str, Any]) -> MeshParts:
    """Without the points that no triangle needs."""
    cells = np.asarray(cells, dtype=np.int64)
    used = np.unique(cells)
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    pairs = {str(name): number[np.asarray(ends, dtype=np.int64)] for name, ends in edge_sets.items()}
    vertices = np.ascontiguousarray(np.asarray(points, dtype=float)[used])
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
            remedy = "reads another file by *INCLUDE: put everything into this one"
            raise InputError("mesh", str(path), remedy)
        if line.startswith("*"):
            if len(numbers) == 3 and numbers[2]:
                generated += len(range(numbers[0], numbers[1] + 1, numbers[2]))
            ranges, numbers = "GENERATE" in line.upper(), []
        elif ranges:
            numbers += [int(word) for word in line.split(",") if word.strip().isnumeric()]
    if generated > _MOST_GENERATED:
        remedy = f"has sets of {generated} members in ranges (GENERATE): give at most {_MOST_GENERATED}"
        raise InputError("mesh", str(path), remedy)
    text.seek(0)
    return text


_NEEDED: Final = ("ENS_MAA", "FAS")
_MOST_OBJECTS: Final = 100_000
_DEEPEST: Final = 20
"""Groups inside each other; MED needs 6, and a group may lie inside itself."""


def _copy_med(path: Path, copy: Path, largest: int) -> None:
    """Copy meshes and their families, of at most `largest` bytes unfolded.

    Raises
    ------
    ImportError
        If h5py is missing.
    InputError
        If the file refers to others, or holds more than the limit.
    ValueError
        If it is broken, or claims more than it holds.

    """
    h5py = load("h5py")
    with h5py.File(path, "r") as given:
        _refuse_med(h5py, str(path), given, largest)
        with h5py.File(copy, "w") as kept:
            for name in _NEEDED:
                if name in given:
                    given.copy(name, kept)


def _refuse_med(h5py: Any, path: str, given: Any, largest: int) -> None:
    """Look at every object on every way to it, as meshio reads what has several names several times."""
    total, items, claimed, count = 0, 0, 0, 0
    places = [(given, name, 1) for name in given if name in _NEEDED]
    while places:
        group, name, depth = places.pop()
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            raise InputError("mesh", path, f"holds a link {name!r} to another place: save the mesh as one file")
        item, count = group[name], count + 1
        if isinstance(item, h5py.Group):
            places += [(item, below, depth + 1) for below in item]
        elif isinstance(item, h5py.Dataset):
            if item.external or item.is_virtual:
                raise InputError("mesh", path, f"keeps {name!r} in another file: save the mesh as one file")
            if item.dtype.hasobject:
                raise ValueError(f"{name!r} has entries without a size")
            total, items = total + int(item.nbytes), items + int(item.size or 0)
        if total > largest:
            raise InputError("mesh", path, f"unfolds to more than {largest} bytes, the limit: give a coarser mesh")
        if count > _MOST_OBJECTS or depth > _DEEPEST:
            remedy = f"holds more than {_MOST_OBJECTS} objects, or {_DEEPEST} inside each other: give a simpler mesh"
            raise InputError("mesh", path, remedy)
        claimed = max(claimed, int(item.attrs.get("NBR", 0)))
    if claimed > items:
        raise ValueError(f"it claims {claimed} entries where it holds {items}")
