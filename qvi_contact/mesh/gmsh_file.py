"""Files of Gmsh, formats 2.2 and 4.1, as text or in binary: nodes, lines, cells, and what has a physical name.

No array is made of a size that a file only claims: every count is compared with the bytes that are left. Sections that
no mesh needs (periodic nodes, fields, views) are skipped.
"""

from collections.abc import Iterator, Mapping
from itertools import groupby
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.errors import InputError

_NODES: Final = {1: 2, 2: 3, 3: 4, 8: 3, 9: 6, 10: 9, 15: 1, 16: 8}  # by the number of a kind in Gmsh
_OTHERS: Final = {4: "tetra", 5: "hexahedron", 6: "wedge", 7: "pyramid"}
_LINES: Final = {1: (0, 1), 8: (0, 1)}
_CELLS: Final = {2: (0, 1, 2, 2), 9: (0, 1, 2, 2), 3: (0, 1, 2, 3), 10: (0, 1, 2, 3), 16: (0, 1, 2, 3)}
_MOST_SETS: Final = 10_000_000  # names times blocks of elements: each of the blocks may have all names
_VERSIONS: Final = {"2": "2.2", "2.1": "2.2", "2.2": "2.2", "4.1": "4.1"}  # "4" is 4.0


class NamedCells(NamedTuple):
    """What a file holds of a mesh: points (n, 2 or 3), cells, lines (k, 2) and cells (k,) by name.

    Cells are quadrilaterals (m, 4); triangles have their last corner twice.
    """

    points: FloatArray
    cells: IntArray
    edge_sets: dict[str, IntArray]
    regions: dict[str, IntArray]


def read_gmsh(path: Path) -> NamedCells:
    """What a file holds of a mesh.

    Raises
    ------
    InputError
        If the format is none of 2.2 and 4.1, or elements are neither points, lines, triangles nor quadrilaterals.
    ValueError
        If the file is broken: it claims more than it holds, or a section does not end.

    """
    with path.open("rb") as source:
        return _GmshFile(str(path), source, path.stat().st_size).read()


class _GmshFile:
    """An open file, read section by section."""

    def __init__(self, path: str, source: BinaryIO, size: int) -> None:
        self._path, self._source, self._size = path, source, size
        self._version, self._binary, self._word = "", False, "u8"  # the type of counts and tags in format 4.1
        self._names = list[tuple[int, int, str]]()  # dimension, physical number, name
        self._physical = dict[tuple[int, int], set[int]]()  # physical numbers of each entity of format 4.1
        self._tags, self._points = np.empty(0, np.int64), np.empty((0, 3))
        self._blocks = list[tuple[int, IntArray, set[int]]]()  # kind, nodes (k, …), physical numbers of all of them

    def read(self) -> NamedCells:
        """All sections that make a mesh."""
        sections = {
            b"MeshFormat": self._read_format,
            b"PhysicalNames": self._read_names,
            b"Entities": self._read_entities,
            b"Nodes": self._read_nodes,
            b"Elements": self._read_elements,
        }
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
        cells, of_cells = self._joined(_CELLS, 4)
        lines, of_lines = self._joined(_LINES, 2)
        curves = {name: number for dimension, number, name in self._names if dimension == 1 and number in of_lines}
        surfaces = {name: number for dimension, number, name in self._names if dimension == 2 and number in of_cells}
        edge_sets = {name: lines[np.concatenate(of_lines[number])] for name, number in curves.items()}
        regions = {name: np.concatenate(of_cells[number]) for name, number in surfaces.items()}
        return NamedCells(self._points, cells, edge_sets, regions)

    def _joined(self, kinds: Mapping[int, tuple[int, ...]], corners: int) -> tuple[IntArray, dict[int, list[IntArray]]]:
        """Indices of the corners of all elements of some kinds, (k, corners), and their numbers by physical number."""
        found, named, count = [np.empty((0, corners), np.int64)], dict[int, list[IntArray]](), 0
        for kind, nodes, physical in self._blocks:
            if kind in kinds and len(nodes):
                found.append(nodes[:, kinds[kind]])
                for number in physical:
                    named.setdefault(number, []).append(np.arange(count, count + len(nodes)))
                count += len(nodes)
        wanted, order = np.concatenate(found), np.argsort(self._tags)
        if not len(order):
            raise ValueError("it holds no nodes")
        at = order[np.minimum(np.searchsorted(self._tags[order], wanted), len(order) - 1)]
        if (self._tags[at] != wanted).any():
            remedy = f"joins nodes that it does not hold (it has {len(self._tags)}): write the mesh again"
            raise InputError("mesh", self._path, remedy)
        return at, named

    def _next_line(self) -> bytes:
        """The next line that is not blank, without blanks around it; empty at the end of the file."""
        for line in self._source:
            if line.strip():
                return line.strip()
        return b""

    def _take(self, kind: str, count: int, what: str) -> NDArray[Any]:
        """Numbers, no more than the rest of the file can hold."""
        least = np.dtype(kind).itemsize if self._binary else 2  # a digit, and what separates it from the next
        left = self._size - self._source.tell()
        if not 0 <= count * least <= left + 1:
            raise ValueError(f"it claims {count} {what} in {left} bytes")
        if self._binary:
            found = np.frombuffer(self._source.read(count * least), kind)
        else:
            try:
                found = np.fromfile(self._source, kind, count, sep=" ")
            except ValueError:  # new versions of NumPy for words among numbers; old ones warn
                found = np.empty(0, kind)
        if len(found) != count:
            raise ValueError(f"it does not hold the {count} {what} that it claims")
        return found

    def _read_format(self) -> None:
        words = self._source.readline().decode("ascii").split()
        version, mode, size = words[:3]
        if version not in _VERSIONS:
            raise InputError("mesh", self._path, f"has format {version} of Gmsh: save the mesh in format 4.1 or 2.2")
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
        """Format 4.1: tag, point or box, physical numbers, and of all but points what bounds them."""
        for dimension, count in enumerate(self._take(self._word, 4, "numbers of entities").tolist()):
            for _ in range(count):
                (tag,) = self._take("i4", 1, "tags of entities").tolist()
                self._take("f8", 3 if dimension == 0 else 6, "coordinates of entities")
                (several,) = self._take(self._word, 1, "counts of entities").tolist()
                numbers = self._take("i4", several, "physical numbers").tolist()
                self._physical[dimension, tag] = set(map(abs, numbers))
                if dimension:
                    (several,) = self._take(self._word, 1, "counts of entities").tolist()
                    self._take("i4", several, "bounds")

    def _read_nodes(self) -> None:
        if self._version == "2.2":
            count = int(self._source.readline())
            if self._binary:
                rows = self._take("i4,3f8", count, "nodes")
                tags, self._points = rows["f0"].astype(float), rows["f1"]
            else:
                numbers = self._take("f8", 4 * count, "numbers of nodes").reshape(-1, 4)
                tags, self._points = numbers[:, 0], numbers[:, 1:]
        else:
            blocks, count, _, _ = self._take(self._word, 4, "counts of nodes").tolist()
            found, places = [np.empty(0, self._word)], [np.empty((0, 3))]
            for _ in range(blocks):
                _, _, parametric = self._take("i4", 3, "numbers of a block of nodes").tolist()
                if parametric:
                    remedy = "holds parameters of nodes: save the mesh without them (Mesh.SaveParametric = 0)"
                    raise InputError("mesh", self._path, remedy)
                (several,) = self._take(self._word, 1, "counts of nodes").tolist()
                found.append(self._take(self._word, several, "tags of nodes"))
                places.append(self._take("f8", 3 * several, "coordinates").reshape(-1, 3))
            tags, self._points = np.concatenate(found).astype(float), np.concatenate(places)
        if len(tags) != count or not count:
            raise ValueError(f"it claims {count} nodes and holds {len(tags)}")
        if not ((tags >= 1.0) & (tags < 2.0**53) & (tags == np.rint(tags))).all() or len(np.unique(tags)) < count:
            raise ValueError("its nodes are not numbered by different whole numbers from 1")
        self._tags = tags.astype(np.int64)

    def _read_elements(self) -> None:
        if self._version == "4.1":
            blocks, _, _, _ = self._take(self._word, 4, "counts of elements").tolist()
            for _ in range(blocks):
                dimension, entity, kind = self._take("i4", 3, "numbers of a block of elements").tolist()
                (several,) = self._take(self._word, 1, "counts of elements").tolist()
                columns = 1 + self._nodes_of(kind)
                numbers = self._take(self._word, several * columns, "numbers of elements").reshape(several, columns)
                self._add(kind, numbers[:, 1:], self._physical.get((dimension, entity), set()))
            if blocks * len(self._names) > _MOST_SETS:
                raise ValueError(f"it has {blocks} blocks of elements and {len(self._names)} physical names")
        elif self._binary:
            count, done = int(self._source.readline()), 0
            while done < count:
                kind, several, tags = self._take("i4", 3, "numbers of a block of elements").tolist()
                columns = 1 + tags + self._nodes_of(kind)
                numbers = self._take("i4", several * columns, "numbers of elements").reshape(several, columns)
                changes = np.flatnonzero(np.diff(numbers[:, 1]) * (tags > 0)) + 1
                for part in np.split(numbers, changes) if several > 0 else ():
                    self._add(kind, part[:, 1 + tags :], {abs(int(part[0, 1]))} if tags > 0 else set())
                done += max(several, 1)
        else:
            lines = self._element_lines(int(self._source.readline()))
            for (kind, physical), alike in groupby(lines, key=lambda line: line[:2]):
                self._add(kind, np.array([nodes for _, _, nodes in alike]), {physical})

    def _element_lines(self, count: int) -> Iterator[tuple[int, int, list[int]]]:
        """Format 2.2 as text: kind, physical number and nodes of each element; 0 is no physical number."""
        for _ in range(count):
            words = list(map(int, self._source.readline().split()))
            nodes = words[3 + words[2] :] if len(words) > 3 else []
            if not nodes or len(nodes) != self._nodes_of(words[1]):
                raise ValueError(f"it does not hold the {count} elements that it claims")
            yield words[1], abs(words[3]) if words[2] else 0, nodes

    def _add(self, kind: int, nodes: NDArray[Any], physical: set[int]) -> None:
        self._blocks.append((kind, nodes.astype(np.int64), physical))

    def _nodes_of(self, kind: int) -> int:
        """Nodes of one element."""
        if kind not in _NODES:
            named = repr(_OTHERS.get(kind, kind))
            raise InputError("mesh", self._path, f"holds cells of kind {named}: give triangles and quadrilaterals only")
        return _NODES[kind]
