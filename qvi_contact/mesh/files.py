"""Meshes from other programs, see `TriangleMesh.load`: files of Gmsh, Abaqus or CalculiX, MED, and VTK.

Names are physical names in .msh files, groups in .med files, and those of sets in .inp files, in upper or lower case:
element sets (ELSET), with line elements such as T3D2 for curves, then surfaces (SURFACE), and node sets (NSET), which
stand for the sides on the boundary between two of their nodes. A name that a part and its assembly use, as "Set-1", is
that of the assembly's set; the part's set has the name of its instance before it, as "Part-1-1.Set-1". Surfaces that
combine others, and springs, masses and connectors of an assembly, are left out. VTK files have no names. Middle nodes
of elements of higher order and points without a triangle are left out, so sides are straight.

Files of Gmsh, formats 2.2 and 4.1, text or binary, and of Abaqus are read here, the others by meshio. In Abaqus files
meshio keeps only the last of several blocks of nodes, may assign sets of elements to the wrong block, and loses
surfaces, and what included files, and sets within sets, hold; data at nodes of Gmsh files it gives to the nodes in the
order of the file, whatever their numbers. Every count in a Gmsh file is compared with the bytes that are left, so that
no wrong count makes a large array. Sections that a mesh does not need (periodic nodes, fields, views) are skipped.
"""

import io
import re
import warnings
from codecs import BOM_UTF8
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, redirect_stderr
from importlib import import_module
from itertools import chain, combinations, islice
from math import dist
from pathlib import Path
from typing import Any, BinaryIO, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.basics.writing import given_path, open_regular
from qvi_contact.errors import InputError
from qvi_contact.mesh.curves import MeshParts
from qvi_contact.mesh.grid import sides_of, triangles_of
from solvers.basics.types import load
from solvers.errors import known_name

_FORMATS: Final = {".msh": "gmsh", ".inp": "abaqus", ".med": "med", ".vtk": "vtk", ".vtu": "vtu"}
_MAX_BYTES: Final = 200_000_000  # bytes
_MAX_TRIANGLES: Final = 1_000_000
_PLANE_TOLERANCE: Final = 1e-9  # range of z, relative to the body's size, that counts as plane

# by Gmsh's numbers of element types and by meshio's: which nodes are the ends of a line, or the corners of a cell
_LINES: Final = dict.fromkeys((1, 8, 26, 27, 28, "line", "line3"), (0, 1))
_TRIANGLES: Final = (2, 9, 20, 21, 22, 23, 24, 25, "triangle", "triangle6", "triangle7", "triangle10", "triangle15")
_QUADS: Final = (3, 10, 16, 36, 37, 38, 39, 40, 41, "quad", "quad8", "quad9")
_CELLS: Final = dict.fromkeys(_TRIANGLES, (0, 1, 2, 2)) | dict.fromkeys(_QUADS, (0, 1, 2, 3))
_NODE_COUNTS: Final = {
    1: 2, 8: 3, 26: 4, 27: 5, 28: 6, 15: 1,  # lines, of degree 1 to 5; points
    2: 3, 9: 6, 21: 10, 23: 15, 25: 21, 20: 9, 22: 12, 24: 15,  # triangles; the last three without inner nodes
    3: 4, 10: 9, 36: 16, 37: 25, 38: 36, 16: 8, 39: 12, 40: 16, 41: 20,  # quadrilaterals; the last four, too
}  # fmt: skip
_SOLIDS: Final = {4: "tetra", 5: "hexahedron", 6: "wedge", 7: "pyramid"}
_MAX_MEMBERS: Final = 100_000_000  # names × elements: each element may have all names
_VERSIONS: Final = {"2": "2.2", "2.1": "2.2", "2.2": "2.2", "4.1": "4.1"}  # known formats; "4" would be 4.0


def read_mesh(path: str | Path) -> MeshParts:
    """Vertices, triangles, and named curves and surfaces of a mesh file.

    `InputError` if meshio is missing, or the file cannot be read, is not plane or has other than 3- and 4-sided cells.
    """
    path = given_path("mesh", path)
    return _triangulated(path, _read(path)).without_others()


def read_point_data(path: str | Path, name: str) -> tuple[MeshParts, FloatArray]:
    """The triangles of a file .msh, or one that meshio reads, and its point data of that name at their vertices (v,).

    `InputError` of "file" or "data" as in `read_mesh`, or if there is not one number a point under this name.
    """
    path = given_path("file", path)
    with reading("file", path) as source:
        if path.suffix.lower() == ".msh":
            gmsh_file = _GmshFile(source, path.stat().st_size)
            mesh, data = gmsh_file.read(with_data=True), gmsh_file.point_data()
        else:
            file: Any = load("meshio").read(path)
            cells, _ = _elements([(block.type, block.data, 0) for block in file.cells], _CELLS, {})
            mesh, data = MeshParts(file.points, cells), file.point_data
        whole = _triangulated(path, MeshParts(mesh.vertices, mesh.cells))
    values, used = np.asarray(data[known_name("data", name, {"point data": data})], dtype=float), np.unique(whole.cells)
    if values.shape != (len(whole.vertices),) or not np.isfinite(values[used]).all():
        raise InputError("file", str(path), f"needs one finite number a point, in one step, as {name!r}")
    return whole.without_others(), values[used]


def _triangulated(path: Path, mesh: MeshParts) -> MeshParts:
    """The mesh with all cells cut into triangles, checked."""
    if not len(mesh.cells):
        raise InputError("mesh", str(path), "holds no triangles")
    extent = np.ptp(mesh.vertices, axis=0)
    if len(extent) == 3 and extent[2] > _PLANE_TOLERANCE * extent[:2].max():
        raise InputError("mesh", str(path), "is not plane: all points must have one coordinate z")
    for numbers in (mesh.cells, *mesh.edge_sets.values()):
        if ((numbers < 0) | (numbers >= len(mesh.vertices))).any():
            n_nodes = f"(it has {len(mesh.vertices)})"
            raise InputError("mesh", str(path), f"joins nodes that it does not hold {n_nodes}: write the mesh again")
    cells, parent = triangles_of(mesh.vertices[:, :2], mesh.cells)
    if len(cells) > _MAX_TRIANGLES:
        raise InputError("mesh", str(path), f"holds {len(cells)} triangles: give at most {_MAX_TRIANGLES}")
    regions = {name: np.flatnonzero(np.isin(parent, chosen)) for name, chosen in mesh.regions.items()}
    vertices = np.ascontiguousarray(mesh.vertices[:, :2])
    return MeshParts(vertices, np.sort(cells, axis=1), mesh.edge_sets, regions)


def _read(path: Path) -> MeshParts:
    """The mesh in a file, with points (n, 2 or 3) and cells (m, 4), where triangles have their last corner twice."""
    reader = _FORMATS.get(path.suffix.lower())
    if reader is None:
        raise InputError("mesh", str(path), f"give a file with one of the endings {', '.join(_FORMATS)}")
    with reading("mesh", path) as source:
        size = path.stat().st_size
        if size > _MAX_BYTES:
            raise InputError("mesh", str(path), f"holds more than {_MAX_BYTES} bytes, the limit: give a coarser mesh")
        if reader == "gmsh":
            mesh = _GmshFile(source, size).read()
        elif reader == "abaqus":
            mesh = _AbaqusFile(path).read()
        else:
            mesh = _named_cells(import_module(f"meshio.{reader}").read(path))
    return mesh


@contextmanager
def reading(field: str, path: Path) -> Iterator[BinaryIO]:
    """The open file; every failure within is an `InputError` about the field.

    Pipes and devices, which may block, are not opened. What meshio prints is a part of the message.
    """
    stderr = io.StringIO()
    try:
        with open_regular(path) as source, warnings.catch_warnings(), redirect_stderr(stderr):
            warnings.simplefilter("ignore")
            yield source
    except InputError as error:
        raise InputError(field, str(path), error.remedy) from error
    except FileNotFoundError as error:
        raise InputError(field, str(path), "there is no such file: correct its name or folder") from error
    except ImportError as error:
        needed = "meshio h5py" if path.suffix.lower() == ".med" else "meshio"
        remedy = f"these files need {needed.replace(' ', ' and ')}: python -m pip install {needed}"
        raise InputError(field, str(path), remedy) from error
    except (Exception, SystemExit) as error:  # readers fail on broken files in many ways
        reason = " ".join(f"{getattr(error, 'strerror', None) or error} {stderr.getvalue()}".split())
        reason = reason or type(error).__name__
        other = ", or as .msh: in Gmsh by File > Export, in its scripts by gmsh.write('NAME.msh')"
        remedy = f"write the file again{other * (path.suffix.lower() in ('.med', '.vtk', '.vtu'))}"
        raise InputError(field, str(path), f"cannot be read ({reason}): {remedy}") from error


def _elements(
    blocks: Iterable[tuple[Any, Any, Any]], kinds: Mapping[Any, tuple[int, ...]], names: Mapping[str, Collection[int]]
) -> tuple[IntArray, dict[str, IntArray]]:
    """Ends (k, 2) of all lines, or corners (k, 4) of all cells, which are of these `kinds`; their numbers by name.

    Blocks have a kind, nodes (n, …) and a label, or one of each element; `names` has the labels of each name.
    """
    parts = [(nodes[:, kinds[kind]], np.broadcast_to(own, len(nodes))) for kind, nodes, own in blocks if kind in kinds]
    empty = np.empty((0, len(next(iter(kinds.values())))), np.int64), np.empty(0, np.int64)
    corners, labels = (np.concatenate(each).astype(np.int64) for each in zip(empty, *parts, strict=True))
    if len(names) * len(labels) > _MAX_MEMBERS:
        raise ValueError(f"it has {len(labels)} elements and {len(names)} names")
    numbers = {name: np.flatnonzero(np.isin(labels, list(own))) for name, own in names.items()}
    return corners, {name: own for name, own in numbers.items() if len(own)}


def _named_cells(file: Any) -> MeshParts:
    """The mesh that meshio read; its names are the groups of the families in a MED file."""
    kinds = sorted({block.type for block in file.cells} - {*_CELLS, *_LINES, "vertex"})
    if kinds:
        raise InputError("mesh", kinds[0], f"holds cells of kind {kinds[0]!r}: give triangles and quadrilaterals only")
    groups = defaultdict[str, list[int]](list)
    for family, names in (getattr(file, "cell_tags", None) or {}).items():
        for name in names:
            groups[name].append(family)
    tags = file.cell_data.get("cell_tags") or [0] * len(file.cells)
    blocks = [(block.type, block.data, tag) for block, tag in zip(file.cells, tags, strict=True)]
    lines, of_lines = _elements(blocks, _LINES, groups)
    cells, regions = _elements(blocks, _CELLS, groups)
    edge_sets = {name: lines[rows] for name, rows in of_lines.items()}
    return MeshParts(np.asarray(file.points, dtype=float), cells, edge_sets, regions)


class _GmshFile:
    """A Gmsh file, open, read section by section."""

    def __init__(self, source: BinaryIO, size: int) -> None:
        self._source, self._size = source, size
        self._version, self._binary, self._word = "", False, "u8"  # the type of counts and tags in format 4.1
        self._names = list[tuple[int, int, str]]()  # dimension, physical number, name
        self._entities = defaultdict[tuple[int, int], list[int]](list)  # by dimension and physical number, format 4.1
        self._tags, self._points = np.empty(0, np.int64), np.empty((0, 3))
        self._steps = defaultdict[str, list[tuple[FloatArray, FloatArray]]](list)  # of point data: nodes, values
        self._blocks = list[tuple[int, IntArray, int | IntArray]]()  # kind, nodes (k, …), entity or physical numbers

    def read(self, *, with_data: bool = False) -> MeshParts:
        """Read all sections, those of point data only if asked for, and make the mesh."""
        sections = {
            b"MeshFormat": self._read_format,
            b"PhysicalNames": self._read_names,
            b"Entities": self._read_entities,
            b"Nodes": self._read_nodes,
            b"Elements": self._read_elements,
        } | ({b"NodeData": self._read_data} if with_data else {})
        if self._source.read(len(BOM_UTF8)) != BOM_UTF8:  # which editors may put before text
            self._source.seek(0)
        while line := self._next_line():
            name = line[1:]
            if not line.startswith(b"$"):
                raise ValueError(f"{line[:40]!r} stands where a section should begin")
            if not self._version and name != b"MeshFormat":
                raise ValueError("it does not begin with $MeshFormat")
            if name in sections:
                sections[name]()
                line = self._next_line()
            else:
                line = next((line.strip() for line in self._source if line.strip() == b"$End" + name), b"")
            if line != b"$End" + name:
                raise ValueError(f"${name.decode('ascii', 'replace')} does not end where it should")
        if not len(self._tags):
            raise ValueError("it holds no nodes")
        (lines, of_lines), (cells, regions) = self._elements(1, _LINES), self._elements(2, _CELLS)
        # an element in several surfaces is repeated for each in format 2.2, and all are where a view was appended
        _, first, place = np.unique(np.sort(cells, axis=1), axis=0, return_index=True, return_inverse=True)
        kept_cells = np.sort(first)
        number = np.searchsorted(kept_cells, first)[place.reshape(-1)]
        cells, regions = cells[kept_cells], {name: number[rows] for name, rows in regions.items()}
        return MeshParts(self._points, cells, {name: lines[rows] for name, rows in of_lines.items()}, regions)

    def _elements(self, dimension: int, kinds: Mapping[Any, tuple[int, ...]]) -> tuple[IntArray, dict[str, IntArray]]:
        """See `_elements`; nodes by index, −1 for those that the file does not hold."""
        labels = defaultdict[str, list[int]](list)  # several physical numbers may have one name
        for own, number, name in self._names:
            if name and own == dimension:
                labels[name] += [number] if self._version == "2.2" else self._entities[own, number]
        tags, numbers = _elements(self._blocks, kinds, labels)
        return self._index(tags), numbers

    def _index(self, tags: IntArray | FloatArray) -> IntArray:
        """Indices of nodes by number, −1 for those that the file does not hold, which `_triangulated` refuses."""
        order = np.argsort(self._tags)
        index = order[np.minimum(np.searchsorted(self._tags[order], tags), len(order) - 1)]
        return np.where(self._tags[index] == tags, index, -1)

    def _next_line(self) -> bytes:
        """The next line that is not blank, stripped; empty at the end of the file."""
        return next((line.strip() for line in self._source if line.strip()), b"")

    def _take(self, kind: Any, count: int, what: str) -> NDArray[Any]:
        """The next `count` numbers; `ValueError` if the rest of the file cannot hold them. Errors call them `what`."""
        bytes_each = np.dtype(kind).itemsize if self._binary else 2  # a digit and a separator
        bytes_left = self._size - self._source.tell()
        if not 0 <= count * bytes_each <= bytes_left + 1:
            raise ValueError(f"it claims {count} {what} in {bytes_left} bytes")
        if self._binary:
            numbers = np.frombuffer(self._source.read(count * bytes_each), kind)
        else:
            try:
                numbers = np.fromfile(self._source, kind, count, sep=" ")
            except ValueError:  # from new versions of NumPy for words among numbers
                numbers = np.empty(0, kind)
        if len(numbers) != count:
            raise ValueError(f"it does not hold the {count} {what} that it claims")
        return numbers

    def _rows(self, count: int, columns: int, what: str) -> tuple[FloatArray, FloatArray]:
        """The next `count` rows of a node: its number (count,), and so many numbers (count, columns)."""
        if self._binary:
            rows = self._take([("node", "i4"), ("values", "f8", (columns,))], count, what)
            return rows["node"].astype(float), rows["values"]
        numbers = self._take("f8", count * (1 + columns), f"numbers of {what}").reshape(-1, 1 + columns)
        return numbers[:, 0], numbers[:, 1:]

    def _read_format(self) -> None:
        words = self._source.readline().decode("ascii").split()
        version, mode, size = words[:3]
        if version not in _VERSIONS:
            raise InputError("mesh", "", f"has format {version} of Gmsh: save the mesh in format 4.1 or 2.2")
        if mode not in ("0", "1") or size not in ("4", "8"):
            raise ValueError(f"{' '.join(words)!r} is no description of a format")
        self._version, self._binary, self._word = _VERSIONS[version], mode == "1", f"u{size}"
        if self._binary and self._source.read(4) != np.int32(1).tobytes():
            raise ValueError("its bytes are in the order of another processor")

    def _read_names(self) -> None:
        for _ in range(int(self._source.readline())):
            words = self._source.readline().decode("utf-8", "replace").strip().split(maxsplit=2)
            if len(words) != 3:
                raise ValueError("it does not hold the physical names that it claims")
            self._names.append((int(words[0]), int(words[1]), words[2].strip('"')))

    def _read_entities(self) -> None:
        """Format 4.1: for each entity its tag, point or box, physical numbers, and, except for points, its bounds."""
        for dimension, count in enumerate(self._take(self._word, 4, "numbers of entities").tolist()):
            for _ in range(count):
                (tag,) = self._take("i4", 1, "tags of entities").tolist()
                self._take("f8", 3 if dimension == 0 else 6, "coordinates of entities")
                (n_numbers,) = self._take(self._word, 1, "counts of entities").tolist()
                for number in self._take("i4", n_numbers, "physical numbers").tolist():
                    self._entities[dimension, abs(number)].append(tag)
                if dimension:
                    (n_numbers,) = self._take(self._word, 1, "counts of entities").tolist()
                    self._take("i4", n_numbers, "bounds")

    def _read_nodes(self) -> None:
        if self._version == "2.2":
            count = int(self._source.readline())
            tags, self._points = self._rows(count, 3, "nodes")
        else:
            blocks, count, _, _ = self._take(self._word, 4, "counts of nodes").tolist()
            tag_blocks, point_blocks = [np.empty(0, self._word)], [np.empty((0, 3))]
            for _ in range(blocks):
                _, _, parametric = self._take("i4", 3, "numbers of a block of nodes").tolist()
                if parametric:
                    remedy = "holds parameters of nodes: save the mesh without them (Mesh.SaveParametric = 0)"
                    raise InputError("mesh", "", remedy)
                (n_nodes,) = self._take(self._word, 1, "counts of nodes").tolist()
                tag_blocks.append(self._take(self._word, n_nodes, "tags of nodes"))
                point_blocks.append(self._take("f8", 3 * n_nodes, "coordinates").reshape(-1, 3))
            tags, self._points = np.concatenate(tag_blocks).astype(float), np.concatenate(point_blocks)
        if len(tags) != count or not count:
            raise ValueError(f"it claims {count} nodes and holds {len(tags)}")
        if not ((tags >= 1.0) & (tags < 2.0**53) & (tags == np.rint(tags))).all() or len(np.unique(tags)) < count:
            raise ValueError("its nodes are not numbered by different whole numbers from 1")
        self._tags = tags.astype(np.int64)

    def _read_elements(self) -> None:
        if self._version == "4.1":
            blocks, _, _, _ = self._take(self._word, 4, "counts of elements").tolist()
            for _ in range(blocks):
                _, entity, kind = self._take("i4", 3, "numbers of a block of elements").tolist()
                (count,) = self._take(self._word, 1, "counts of elements").tolist()
                columns = 1 + self._nodes_of(kind)
                numbers = self._take(self._word, count * columns, "numbers of elements").reshape(count, columns)
                self._blocks.append((kind, numbers[:, 1:].astype(np.int64), entity))
        elif self._binary:
            total, n_read = int(self._source.readline()), 0
            while n_read < total:
                kind, count, tags = self._take("i4", 3, "numbers of a block of elements").tolist()
                columns = 1 + tags + self._nodes_of(kind)
                numbers = self._take("i4", count * columns, "numbers of elements").reshape(count, columns)
                physical = np.abs(numbers[:, 1].astype(np.int64)) if tags > 0 else 0
                self._blocks.append((kind, numbers[:, 1 + tags :], physical))
                n_read += max(count, 1)
        else:
            total, rows = int(self._source.readline()), defaultdict[int, list[list[int]]](list)
            for _ in range(total):
                words = list(map(int, self._source.readline().split()))
                nodes = words[3 + words[2] :] if len(words) > 3 else []
                if not nodes or len(nodes) != self._nodes_of(words[1]):
                    raise ValueError(f"it does not hold the {total} elements that it claims")
                rows[words[1]].append([abs(words[3]) if words[2] else 0, *nodes])
            tables = ((kind, np.array(elements)) for kind, elements in rows.items())
            self._blocks += [(kind, table[:, 1:], table[:, 0]) for kind, table in tables]

    def _read_data(self) -> None:
        """Name, times, and integers, among them the number of components and of nodes; then nodes and their values."""
        (title, *_), _, (_, components, count, *_) = (
            list(islice(self._source, int(self._source.readline()))) for _ in range(3)
        )
        name = title.decode("utf-8", "replace").strip().strip('"')
        self._steps[name].append(self._rows(int(count), int(components), "values"))

    def point_data(self) -> dict[str, FloatArray]:
        """Values at the nodes (n,) by name, NaN where the file has none; empty if not one number a node in one step."""
        data = dict.fromkeys(self._steps, np.empty(0))
        for name, ((tags, values), *others) in self._steps.items():
            if not others and values.shape[1] == 1:
                index, data[name] = self._index(tags), np.full(len(self._tags), np.nan)
                data[name][index[index >= 0]] = values[index >= 0, 0]
        return data

    def _nodes_of(self, kind: int) -> int:
        """Number of nodes of an element."""
        if kind not in _NODE_COUNTS:
            named = repr(_SOLIDS.get(kind, kind))
            raise InputError("mesh", "", f"holds cells of kind {named}: give triangles and quadrilaterals only")
        return _NODE_COUNTS[kind]


# files of Abaqus

_PLANE: Final = re.compile(r"(?:CPS|CPE|CPEG|CAX|S|STRI|M3D|R3D)([34689])\w*")  # with the number of nodes
_TRUSS: Final = re.compile(r"(?:(T2D2|T3D2|R2D2|B[23][13])|T2D3|T3D3|B[23]2)H?")  # of two nodes, or of three
_GENERATORS: Final = ("NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY")  # keywords that generate nodes or elements
_SETS: Final = ("ELSET", "SURFACE", "NSET")  # in the order in which they get a name that several of them have
_READ: Final = ("NODE", "ELEMENT", *_SETS)
_OF_MESH: Final = ("NODE", "ELEMENT")  # types of surfaces, other than analytical ones
_FLAGS: Final = ("GENERATE", "INTERNAL", "UNSORTED")  # options without a value

_Key: TypeAlias = tuple[str, bool, str]  # keyword of a set, whether it belongs to an assembly, name in upper case
_Member: TypeAlias = tuple[bool, str] | int | range  # of a set of elements or nodes: another set, numbers
_Members: TypeAlias = defaultdict[str, list[_Member]]  # by the side of the elements that a surface names, else ""


def _lines_of(path: Path, including: tuple[Path, ...] = ()) -> Iterator[str]:
    """Lines of a file and of the files that it includes, without comments, and without quotes around names."""
    path = path.resolve()
    if path in including or (including and not path.is_file()):
        raise ValueError(f"it includes {path.name}, which is not there, or includes itself")
    with open_regular(path) as source:
        content = source.read()
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    for line in map(str.strip, io.StringIO(text.replace('"', ""), newline=None)):
        if line.upper().startswith("*INCLUDE"):
            yield from _lines_of(path.parent / line.partition("=")[2].strip(), (*including, path))
        elif line and not line.startswith("**"):
            yield line


class _AbaqusFile:
    """An Abaqus file; names of sets do not depend on upper and lower case."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._nodes = dict[int, list[float]]()
        self._elements = dict[int, list[int]]()  # nodes of each: 2 or 3 of lines, else 4
        self._shells = set[int]()  # numbers of shells and membranes
        self._of_assembly = {"NSET": set[int](), "ELSET": set[int]()}  # numbers of an assembly's own nodes and elements
        self._members = defaultdict[_Key, _Members](lambda: defaultdict(list))
        self._of_elements = list[tuple[list[_Member], _Member]]()  # members of node sets, and the elements with them
        self._called = dict[_Key, str]()  # the spelling of the names of sets, but not of sets that programs have named
        self._sections = list[tuple[str, dict[str, str], list[str]]]()
        is_continued = False
        for line in _lines_of(path):
            if line.startswith("*") or (is_continued and ("=" in line or line.strip(", ").upper() in _FLAGS)):
                words = [word.strip() for word in line.lstrip("*").rstrip(",").split(",")]
                if line.startswith("*"):
                    self._sections.append((" ".join(words.pop(0).upper().split()), {}, []))
                pairs = (word.partition("=") for word in words)
                self._sections[-1][1].update({key.strip().upper(): value.strip() for key, _, value in pairs})
                is_continued = line.endswith(",")
            elif self._sections and self._sections[-1][0] in (*_READ, "SYSTEM", "INSTANCE"):
                self._sections[-1][2].append(line)
                is_continued = False

    def read(self) -> MeshParts:
        """The mesh; `InputError` if it is not one part with a plane mesh, `ValueError` if the file is broken."""
        self._read_sections()
        owners = [options.get("NAME", "") for keyword, options, _ in self._sections if keyword in ("PART", "INSTANCE")]
        if not self._nodes:
            raise InputError("mesh", "", "holds no nodes: write the mesh again")
        index, points = {number: position for position, number in enumerate(self._nodes)}, list(self._nodes.values())
        nodes_of = {number: [index.get(node, -1) for node in each] for number, each in self._elements.items()}
        row_of = {number: row for row, number in enumerate(n for n, nodes in nodes_of.items() if len(nodes) == 4)}
        corners = np.array([nodes_of[number] for number in row_of], dtype=np.int64).reshape(-1, 4)
        ends, on_boundary = sides_of(corners)
        place = np.where((corners[:, 2] == corners[:, 3])[:, None], [1, 2, -9, 3], [1, 2, 3, 4])  # of triangles, quads
        place_on_shells = place + 2 * np.isin(list(row_of), list(self._shells))[:, None]
        edge_sets, regions = dict[str, IntArray](), dict[str, IntArray]()
        for key, name in sorted(self._called.items(), key=lambda item: _SETS.index(item[0][0])):
            keyword, of_assembly, upper = key
            if not of_assembly and (keyword, True, upper) in self._called:
                name = f"{owners[-1] if owners else 'part'}.{name}"
            if keyword != "ELSET" and name.upper() in map(str.upper, edge_sets):
                continue  # an element set and a node set of one name, as programs write them, are a region and edges
            lines = [np.empty((0, 2), np.int64)]
            for side, members in self._members[key].items():
                numbers = self._numbers(keyword, members)
                if keyword == "NSET":
                    boundary = ends[on_boundary]
                    lines.append(boundary[np.isin(boundary, [index[number] for number in numbers]).all(axis=1)])
                    continue
                pairs = (combinations(nodes_of[number], 2) for number in numbers if number not in row_of)
                trusses = [max(each, key=lambda pair: dist(*(points[node] for node in pair))) for each in pairs]
                cells = np.array([row_of[number] for number in numbers if number in row_of], dtype=np.int64)
                lines.append(np.array(trusses, dtype=np.int64).reshape(-1, 2))
                if keyword == "ELSET":
                    regions |= {name: cells} if len(cells) else {}
                else:  # S1 … are sides, but of CalculiX's shells two faces, then sides; E1 … are sides
                    number = int(side[1:]) if side[1:].isdigit() else -1
                    is_side = (place if side[:1] == "E" else place_on_shells) == number if side else on_boundary
                    lines.append(ends[cells][is_side[cells]])
            edges = np.unique(np.concatenate(lines), axis=0)
            edge_sets |= {name: edges} if len(edges) else {}
        return MeshParts(np.array(points, dtype=float).reshape(-1, 3), corners, edge_sets, regions)

    def _read_sections(self) -> None:
        """Read nodes, elements and sets."""
        if [keyword for keyword, _, _ in self._sections].count("PART") > 1:
            raise InputError("mesh", "", "holds several parts: write one, with all nodes where they are")
        of_assembly = False
        for keyword, options, data in self._sections:
            if keyword in ("ASSEMBLY", "INSTANCE", "END INSTANCE", "END ASSEMBLY"):
                of_assembly = keyword in ("ASSEMBLY", "END INSTANCE")
            is_moved = keyword in ("SYSTEM", "INSTANCE") and data  # a part is rotated or translated
            is_curved = keyword == "NODE" and options.get("SYSTEM", "R").upper() != "R"
            if is_moved or keyword in _GENERATORS or is_curved:
                remedy = f"holds *{keyword}, which moves or makes nodes: write all nodes where they are"
                raise InputError("mesh", "", remedy)
            if keyword in _READ and "INPUT" in options:
                data += _lines_of(self._path.parent / options["INPUT"], (self._path.resolve(),))
            rows = ([word.strip() for word in line.rstrip(",").split(",")] for line in data)
            if keyword == "NODE":
                self._read_nodes(options, rows, of_assembly)
            elif keyword == "ELEMENT":
                self._read_elements(options, rows, of_assembly)
            elif keyword in _SETS and "COMBINE" not in options and options.get("TYPE", "NODE").upper() in _OF_MESH:
                self._read_set(keyword, options, rows, of_assembly)
        for members, elements in self._of_elements:  # which may stand below
            members += chain.from_iterable(self._elements[number] for number in self._numbers("ELSET", [elements]))

    def _read_nodes(self, options: dict[str, str], rows: Iterator[list[str]], of_assembly: bool) -> None:
        if of_assembly:  # reference points
            self._of_assembly["NSET"] |= {int(words[0]) for words in rows}
            return
        members = self._set("NSET", options, of_assembly=False)[""] if "NSET" in options else []
        for number, *coordinates in rows:
            point = [*(float(word.upper().replace("D", "E") or 0) for word in coordinates), 0.0, 0.0][:3]
            if self._nodes.setdefault(int(number), point) != point:
                raise ValueError(f"two nodes have the number {number}")
            members.append(int(number))

    def _read_elements(self, options: dict[str, str], rows: Iterator[list[str]], of_assembly: bool) -> None:
        kind = options.get("TYPE", "")
        plane, truss = _PLANE.fullmatch(kind.upper()), _TRUSS.fullmatch(kind.upper())
        if of_assembly and not plane and not truss:  # springs, masses and connectors
            self._of_assembly["ELSET"] |= {int(words[0]) for words in rows if words[0].isdigit()}
            if "ELSET" in options:  # without elements of the body
                self._set("ELSET", options, of_assembly=True)
            return
        if of_assembly:
            raise InputError("mesh", "", "holds elements of an assembly: write one part, with all elements")
        if not plane and not truss:
            raise InputError("mesh", "", f"holds elements of type {kind!r}: give triangles and quadrilaterals only")
        count = int(plane[1]) if plane else 2 if truss and truss[1] else 3
        table = np.array([int(word) for words in rows for word in words if word]).reshape(-1, 1 + count)
        for number, *nodes in table.tolist():
            if number in self._elements:
                raise ValueError(f"two elements have the number {number}")
            self._elements[number] = nodes if truss else [*nodes[:3], nodes[2 if count in (3, 6) else 3]]
        if kind.upper().startswith(("S", "M3D")):
            self._shells.update(table[:, 0].tolist())
        if "ELSET" in options:
            self._set("ELSET", options, of_assembly=False)[""] += table[:, 0].tolist()

    def _read_set(self, keyword: str, options: dict[str, str], rows: Iterator[list[str]], of_assembly: bool) -> None:
        is_surface, of_nodes = keyword == "SURFACE", options.get("TYPE", "").upper() == "NODE"
        keyword = "NSET" if of_nodes else keyword
        members = self._set(keyword, options, of_assembly=of_assembly)
        is_inside = of_assembly and "INSTANCE" not in options  # names and numbers are those of the assembly
        others = self._of_assembly["NSET" if keyword == "NSET" else "ELSET"] if is_inside else set[int]()

        def member(word: str) -> _Member:
            """The number, or the set, that a word means; the name of an instance may stand before it."""
            instance, _, name = word.upper().rpartition(".")
            return int(name) if name.isdigit() else (is_inside and not instance, name)

        if keyword == "NSET" and options.get("ELSET"):  # the nodes of elements
            self._of_elements.append((members[""], member(options["ELSET"])))
        for words in rows:
            if "GENERATE" in options:
                first, last, *step = map(int, words)
                members[""] += [range(first, last + 1, *step)] if first not in others else []
            else:
                side = words[1].upper() if is_surface and not of_nodes and len(words) > 1 else ""
                used = filter(None, words[:1] if is_surface else words)
                members[side] += [member(word) for word in used if not word.isdigit() or int(word) not in others]

    def _set(self, keyword: str, options: dict[str, str], *, of_assembly: bool) -> _Members:
        """The members of the set that the options name."""
        name = options.get(keyword) or options.get("NAME", "")
        if not name:
            raise ValueError(f"a set (*{keyword}) has no name")
        key = keyword, of_assembly, name.upper()
        if "INTERNAL" not in options or (keyword, of_assembly) == ("ELSET", False):
            self._called.setdefault(key, name)
        return self._members[key]

    def _numbers(self, keyword: str, members: list[_Member]) -> list[int]:
        """The elements, or nodes, among members of a set and of the sets among these, in ascending order."""
        keyword, known = ("NSET", self._nodes.keys()) if keyword == "NSET" else ("ELSET", self._elements.keys())
        numbers, seen, pending = set[int](), set[_Key](), list(members)
        while pending:
            member = pending.pop()
            if isinstance(member, range):
                numbers.update(member if len(member) <= len(known) else (each for each in known if each in member))
            elif isinstance(member, int):
                numbers.add(member)
            else:
                of_assembly, name = member
                key = keyword, of_assembly and (keyword, True, name) in self._members, name
                if key not in self._members:
                    raise ValueError(f"there is no set {name} (*{keyword})")
                pending += chain.from_iterable(self._members[key].values()) if key not in seen else ()
                seen.add(key)
        return sorted(numbers & known)
