"""Meshes from other programs: files of Gmsh, Abaqus or CalculiX, MED, and VTK.

What has a name comes along: named curves become edge sets (joints where they lie inside the body), named surfaces
regions. Names are

* physical names in .msh files,
* ELSET in .inp files, with line elements such as T3D2 for curves,
* groups in .med files;

files of VTK have none. Quadrilaterals are cut in two. Middle nodes of quadratic elements are left out, and points that
no triangle needs; sides are straight.

Files of Gmsh that are text, formats 2.2 and 4.1, are read here, as other readers want a name on every curve; all others
by meshio. Sections that no mesh needs (periodic nodes, fields, views) are skipped.
"""

import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import redirect_stderr
from importlib import import_module
from io import StringIO
from itertools import groupby
from pathlib import Path
from typing import Any, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.basics.writing import given_path, open_regular
from qvi_contact.errors import InputError
from qvi_contact.mesh.curves import MeshParts
from qvi_contact.mesh.edges import cross

_FORMATS: Final = {".msh": "gmsh", ".inp": "abaqus", ".med": "med", ".vtk": "vtk", ".vtu": "vtu"}
_LARGEST: Final = 200_000_000  # bytes
_MOST_TRIANGLES: Final = 1_000_000
_FLAT: Final = 1e-9  # of the size in the plane: larger z are no plane body
_BETTER: Final = 1e-6  # share by which a triangle is larger that rounding alone does not make so

_CORNERS: Final = {"triangle": 3, "triangle6": 3, "triangle7": 3, "quad": 4, "quad8": 4, "quad9": 4}
_LINES: Final = ("line", "line3")
_KINDS: Final = {
    1: ("line", 2), 2: ("triangle", 3), 3: ("quad", 4), 4: ("tetra", 4), 5: ("hexahedron", 8), 6: ("wedge", 6),
    7: ("pyramid", 5), 8: ("line3", 3), 9: ("triangle6", 6), 10: ("quad9", 9), 15: ("vertex", 1), 16: ("quad8", 8),
}  # fmt: skip
"""What Gmsh's numbers of kinds of elements mean, and how many nodes one has."""

_MOST_SETS: Final = 10_000_000  # names times blocks of elements: each of the blocks may have all names


def read_mesh(path: str | Path) -> MeshParts:
    """Vertices, triangles, and named curves and surfaces of a mesh file.

    `InputError` if meshio is missing, the file cannot be read, or it holds other cells than triangles and
    quadrilaterals, or no plane body.
    """
    path = given_path("mesh", path)
    mesh = _read(path)
    if not len(mesh.cells):
        raise _refused(path, "holds no triangles")
    if mesh.vertices.shape[1] == 3 and np.ptp(mesh.vertices[:, 2]) > _FLAT * np.ptp(mesh.vertices[:, :2], axis=0).max():
        raise _refused(path, "is not plane: all points must have one coordinate z")
    for numbers in (mesh.cells, *mesh.edge_sets.values()):
        if ((numbers < 0) | (numbers >= len(mesh.vertices))).any():
            held = f"(it has {len(mesh.vertices)})"
            raise _refused(path, f"joins nodes that it does not hold {held}: write the mesh again")
    cells, parent = _triangles(mesh.vertices[:, :2], mesh.cells)
    if len(cells) > _MOST_TRIANGLES:
        raise _refused(path, f"holds {len(cells)} triangles: give at most {_MOST_TRIANGLES}")
    used = np.unique(cells)  # the plane mesh without the points that no triangle needs
    number = np.full(len(mesh.vertices), -1)
    number[used] = np.arange(len(used))
    edge_sets = {name: number[ends] for name, ends in mesh.edge_sets.items()}
    regions = {name: np.flatnonzero(np.isin(parent, chosen)) for name, chosen in mesh.regions.items()}
    return MeshParts(np.ascontiguousarray(mesh.vertices[used, :2]), number[cells], edge_sets, regions)


def _refused(path: Path, remedy: str) -> InputError:
    return InputError("mesh", str(path), remedy)


def _read(path: Path) -> MeshParts:
    """What a file holds, or one `InputError`; pipes and devices are not opened, as they may wait for ever.

    Points (n, 2 or 3), and cells as quadrilaterals (m, 4): triangles have their last corner twice.
    """
    reader = _FORMATS.get(path.suffix.lower())
    if reader is None:
        raise _refused(path, f"give a file with one of the endings {', '.join(_FORMATS)}")
    printed = StringIO()  # what meshio prints, and NumPy warns of, is part of an error, and else nothing anybody needs
    try:
        with open_regular(path) as source, warnings.catch_warnings(), redirect_stderr(printed):
            warnings.simplefilter("ignore")
            if path.stat().st_size > _LARGEST:
                raise _refused(path, f"holds more than {_LARGEST} bytes, the limit: give a coarser mesh")
            content = source.read() if reader == "gmsh" else b""
            if reader == "gmsh" and content.split(maxsplit=3)[2:3] != [b"1"]:
                return _of_gmsh(content.decode("utf-8", "replace"))
            return _of_meshio(import_module(f"meshio.{reader}").read(path))
    except InputError as error:
        raise _refused(path, error.remedy) from error
    except FileNotFoundError as error:
        raise _refused(path, "there is no such file: correct its name or folder") from error
    except ImportError as error:
        needed = "meshio h5py" if reader == "med" else "meshio"
        remedy = f"such files need {needed.replace(' ', ' and ')}: python -m pip install {needed}"
        raise _refused(path, remedy) from error
    except Exception as error:  # whatever a broken file makes a reader stumble over
        told = " ".join(f"{getattr(error, 'strerror', None) or error} {printed.getvalue()}".split())
        told = told or type(error).__name__
        more = " as text (Mesh.Binary = 0)" if reader == "gmsh" else ""
        raise _refused(path, f"cannot be read as {reader} ({told}): write the mesh again{more}") from error


def _of_meshio(found: Any) -> MeshParts:
    """What meshio read: its sets of cells are ELSET; MED has groups of families, Gmsh physical numbers."""
    sets = [(name, members) for name, members in found.cell_sets.items() if not name.startswith("gmsh:")]
    groups = [(name, family) for family, names in (getattr(found, "cell_tags", None) or {}).items() for name in names]
    groups += [(name, number) for name, (number, _) in found.field_data.items()]
    numbers = found.cell_data.get("cell_tags") or found.cell_data.get("gmsh:physical") or ()
    sets += [(name, [np.flatnonzero(np.asarray(own) == number) for own in numbers]) for name, number in groups]
    blocks = [(block.type, block.data) for block in found.cells]
    named = (
        (name, block, np.asarray([] if rows is None else rows, dtype=np.int64).ravel())
        for name, members in sets
        for block, rows in enumerate(members[: len(blocks)])
    )
    return _parts(np.asarray(found.points, dtype=float), blocks, named)


def _parts(
    points: FloatArray, blocks: Sequence[tuple[str, IntArray]], named: Iterable[tuple[str, int, IntArray]]
) -> MeshParts:
    """Cells of blocks, each of one kind with its nodes (k, …); names come with a block and its rows that have them."""
    kinds = sorted({kind for kind, _ in blocks} - {*_CORNERS, *_LINES, "vertex"})
    if kinds:
        raise InputError("mesh", kinds[0], f"holds cells of kind {kinds[0]!r}: give triangles and quadrilaterals only")
    start = np.cumsum([0, *(len(nodes) if kind in _CORNERS else 0 for kind, nodes in blocks)])
    edge_sets, regions = dict[str, list[IntArray]](), dict[str, list[IntArray]]()
    for name, number, rows in named:
        kind, nodes = blocks[number]
        if kind in _CORNERS and len(rows):
            regions.setdefault(name, []).append(start[number] + rows)
        elif kind in _LINES and len(rows):
            edge_sets.setdefault(name, []).append(np.asarray(nodes[rows, :2], dtype=np.int64))
    cells = [nodes[:, [0, 1, 2, _CORNERS[kind] - 1]] for kind, nodes in blocks if kind in _CORNERS]
    lines, parts = ({name: np.concatenate(found) for name, found in each.items()} for each in (edge_sets, regions))
    return MeshParts(points, np.concatenate([np.empty((0, 4), np.int64), *cells]), lines, parts)


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


class _Numbers:
    """Those of a section of a file of Gmsh, taken one after the other."""

    def __init__(self, section: str) -> None:
        self.left: FloatArray = np.fromstring(section, sep=" ")

    def take(self, count: float) -> FloatArray:
        """The next ones."""
        if not 0 <= count <= len(self.left):
            raise ValueError(f"it claims {count:.0f} numbers where {len(self.left)} are left")
        found, self.left = np.split(self.left, [int(count)])
        return found


def _of_gmsh(text: str) -> MeshParts:
    """What a text in one of Gmsh's formats holds."""
    pieces = [piece.partition("\n") for piece in f"\n{text}".replace("\r\n", "\n").split("\n$")[1:]]
    sections = {head.strip(): body for head, _, body in pieces}
    heads = [head.strip() for head, _, _ in pieces]
    if heads[1::2] != [f"End{name}" for name in heads[::2]] or not {"MeshFormat", "Nodes", "Elements"} <= {*sections}:
        raise ValueError("its sections MeshFormat, Nodes and Elements do not begin and end where they should")
    version = sections["MeshFormat"].split()[0]
    if version not in ("2", "2.1", "2.2", "4.1"):  # "4" is 4.0
        raise InputError("mesh", "", f"has format {version} of Gmsh: save the mesh in format 4.1 or 2.2")
    names = [line.strip().split(maxsplit=2) for line in sections.get("PhysicalNames", "0").splitlines()]
    if int(names[0][0]) != len(names) - 1:
        raise ValueError("it does not hold the physical names that it claims")
    tags, points = _gmsh_nodes(_Numbers(sections["Nodes"]), version)
    order, blocks, groups = np.argsort(tags), list[tuple[str, IntArray]](), list[set[int]]()
    read = _gmsh_blocks(sections) if version == "4.1" else _gmsh_lines(sections["Elements"])
    for kind, nodes, physical in read:
        at = order[np.minimum(np.searchsorted(tags[order], nodes), len(order) - 1)]
        blocks.append((_gmsh_kind(kind)[0], np.where(tags[at] == nodes, at, -1)))  # refused later if it is -1
        groups.append(physical)
    if len(blocks) * len(names) > _MOST_SETS:
        raise ValueError(f"it has {len(blocks)} blocks of elements and {len(names) - 1} physical names")
    named = (
        (name.strip('"'), number, np.arange(len(nodes)))
        for dimension, physical, name in names[1:]
        for number, (kind, nodes) in enumerate(blocks)
        if int(physical) in groups[number] and int(dimension) == (1 if kind in _LINES else 2)
    )
    return _parts(points, blocks, named)


def _gmsh_nodes(numbers: _Numbers, version: str) -> tuple[FloatArray, FloatArray]:
    """Tags (n,) and coordinates (n, 3) of the nodes."""
    tags, points = [np.empty(0)], [np.empty((0, 3))]
    if version == "4.1":
        blocks, count, _, _ = numbers.take(4)
        for _ in range(int(blocks)):
            _, _, parametric, several = numbers.take(4)
            if parametric:
                remedy = "holds parameters of nodes: save the mesh without them (Mesh.SaveParametric = 0)"
                raise InputError("mesh", "", remedy)
            tags.append(numbers.take(several))
            points.append(numbers.take(3 * several).reshape(-1, 3))
    else:
        (count,) = numbers.take(1)
        rows = numbers.take(4 * count).reshape(-1, 4)
        tags.append(rows[:, 0])
        points.append(rows[:, 1:])
    found = np.concatenate(tags)
    if not len(found) == count > 0 or len(numbers.left):
        raise ValueError(f"it claims {count:.0f} nodes and holds {len(found)} or others")
    if not ((found >= 1.0) & (found < 2.0**53) & (found == np.rint(found))).all() or len(np.unique(found)) < count:
        raise ValueError("its nodes are not numbered by different whole numbers from 1")
    return found, np.concatenate(points)


def _gmsh_blocks(sections: dict[str, str]) -> Iterator[tuple[int, FloatArray, set[int]]]:
    """Format 4.1: kind, nodes (k, …) and physical numbers of each block of elements."""
    physical = dict[tuple[float, float], set[int]]()
    entities = _Numbers(sections.get("Entities", "0 0 0 0"))
    for dimension, count in enumerate(entities.take(4)):
        for _ in range(int(count)):
            (tag,) = entities.take(1)
            entities.take(6 if dimension else 3)  # point or box
            physical[dimension, tag] = {abs(int(number)) for number in entities.take(*entities.take(1))}
            if dimension:
                entities.take(*entities.take(1))  # what bounds it
    numbers = _Numbers(sections["Elements"])
    blocks, _, _, _ = numbers.take(4)
    for _ in range(int(blocks)):
        dimension, entity, kind, several = numbers.take(4).astype(int).tolist()
        columns = 1 + _gmsh_kind(kind)[1]
        yield (
            kind,
            numbers.take(several * columns).reshape(-1, columns)[:, 1:],
            physical.get((dimension, entity), set()),
        )
    if len(numbers.left):
        raise ValueError("it holds more elements than it claims")


def _gmsh_lines(section: str) -> Iterator[tuple[int, IntArray, set[int]]]:
    """Format 2.2: the same of elements of one kind and physical number that follow each other; 0 is none."""
    rows = [list(map(int, line.split())) for line in section.splitlines() if line.strip()]
    if [len(rows) - 1] != rows[0]:
        raise ValueError(f"it does not hold the {rows[0][0]} elements that it claims")
    for (kind, number), alike in groupby(rows[1:], key=lambda row: (row[1], abs(row[3]) if row[2] else 0)):
        nodes = np.array([row[3 + row[2] :] for row in alike])
        if nodes.shape[1:] != (_gmsh_kind(kind)[1],):
            raise ValueError(f"it holds elements of kind {kind} with {nodes.shape[1:]} nodes")
        yield kind, nodes, {number}


def _gmsh_kind(number: int) -> tuple[str, int]:
    """What elements of this kind are called, and how many nodes one has."""
    if number not in _KINDS:
        raise InputError("mesh", "", f"holds cells of kind {number}: give triangles and quadrilaterals only")
    return _KINDS[number]
