"""Files of Gmsh: the sections that make a mesh, copied for meshio after a look at all that they claim.

meshio makes arrays of the sizes that a file claims, and one as long as the largest tag of a node. So every count is
compared here with the bytes there are before anything of that size is made, and tags with the number of nodes. Sections
that no mesh needs (periodic nodes, fields, views) do not reach meshio.

Entities without a physical number get one that has no name. meshio keeps the physical numbers of cells as one list with
an entry for each block of cells, but makes an entry only where there is a number, and then finds the list too short.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from qvi_contact.errors import InputError
from solvers.basics.types import load

_NODES_OF_KIND: Final = {1: 2, 2: 3, 8: 3, 9: 6, 15: 1}  # lines, triangles and points by their number in Gmsh
_NAMELESS: Final = 2**31 - 1  # the largest physical number there can be: no name has it
_TAGS_AT_LEAST: Final = 1_000_000
_TAGS_PER_NODE: Final = 10
_MOST_SETS: Final = 10_000_000
"""Of names times blocks of elements: meshio makes a list for each pair."""


def copy_needed(path: Path, copy: Path) -> None:
    """Copy the sections that make a mesh.

    Raises
    ------
    InputError
        If the format is none of 2.2 and 4.1, a tag of a node is far beyond the number of nodes, or cells are neither
        points, lines nor triangles.
    ValueError
        If the file is broken: it claims more than it holds, or a section does not end.

    """
    with path.open("rb") as source, copy.open("wb") as target:
        file = _GmshFile(path, source)
        for name, content in file.needed():
            target.write(b"$%b\n%b\n$End%b\n" % (name, content, name))


class _GmshFile:
    """An open file of Gmsh, read section by section.

    Attributes
    ----------
    version : str
        "2.2" or "4.1"; empty before the section that tells it.
    binary : bool
        Whether numbers are bytes, not text.
    word : str
        The type of counts and tags in format 4.1.

    """

    def __init__(self, path: Path, source: BinaryIO) -> None:
        self._path, self._source, self._size = str(path), source, path.stat().st_size
        self.version, self.binary, self.word = "", False, "u8"
        self._names = 0

    def needed(self) -> Iterator[tuple[bytes, bytes]]:
        """Name and content of each section that makes a mesh, after its check."""
        checks: dict[bytes, Callable[[], None]] = {
            b"MeshFormat": self._check_format,
            b"PhysicalNames": self._check_names,
            b"Entities": self._check_entities,
            b"Nodes": self._check_nodes,
            b"Elements": self._check_elements,
        }
        while line := self._next_line():
            if not line.startswith(b"$"):
                raise ValueError(f"{line[:40]!r} stands where a section should begin")
            name, start = line[1:], self._source.tell()
            if name not in checks:
                self._skip(name)
                continue
            if not self.version and name != b"MeshFormat":
                raise ValueError("it does not begin with $MeshFormat")
            checks[name]()
            stop = self._source.tell()
            if self._next_line() != b"$End" + name:
                raise ValueError(f"${name.decode()} does not end where its counts say")
            yield name, self._content(name, start, stop)

    def _content(self, name: bytes, start: int, stop: int) -> bytes:
        """The bytes of a section, and the file where it was."""
        after = self._source.tell()
        self._source.seek(start)
        content = self._source.read(stop - start)
        self._source.seek(after)
        if not self.binary:
            content = content.strip()
        if name == b"Entities" and self.version == "4.1" and not self.binary:
            return _all_numbered(content.decode("ascii").split()).encode("ascii")
        return content

    def _next_line(self) -> bytes:
        """The next line that is not blank, without blanks around it; empty at the end of the file."""
        for line in self._source:
            if line.strip():
                return line.strip()
        return b""

    def _skip(self, name: bytes) -> None:
        """Go behind the end of a section."""
        while line := self._source.readline():
            if line.strip() == b"$End" + name:
                return
        raise ValueError(f"${name.decode('ascii', 'replace')} does not end")

    def _take(self, kind: str, count: int, what: str) -> NDArray[Any]:
        """Numbers, no more than the rest of the file can hold."""
        least = np.dtype(kind).itemsize if self.binary else 2  # a digit, and what separates it from the next
        left = self._size - self._source.tell()
        if not 0 <= count * least <= left + 1:
            raise ValueError(f"it claims {count} {what} in {left} bytes")
        if self.binary:
            found = np.frombuffer(self._source.read(count * least), kind)
        else:
            try:
                found = np.fromfile(self._source, kind, count, sep=" ")
            except ValueError:  # new versions of NumPy for words among numbers; old ones warn
                found = np.empty(0, kind)
        if len(found) != count:
            raise ValueError(f"it does not hold the {count} {what} that it claims")
        return found

    def _lines(self, count: int) -> Iterator[bytes]:
        """So many lines of text."""
        for _ in range(count):
            line = self._source.readline()
            if not line:
                raise ValueError(f"it does not hold the {count} lines that it claims")
            yield line

    def _line_count(self) -> int:
        return int(self._source.readline())

    def _check_format(self) -> None:
        words = self._source.readline().decode("ascii").split()
        version, mode, size = words[:3]
        known = {"2": "2.2", "2.1": "2.2", "2.2": "2.2", "4.1": "4.1"}  # "4" is 4.0
        if version not in known:
            raise InputError("mesh", self._path, f"has format {version} of Gmsh: save the mesh in format 4.1 or 2.2")
        if mode not in ("0", "1") or size not in ("4", "8"):
            raise ValueError(f"{' '.join(words)!r} is no description of a format")
        self.version, self.binary, self.word = known[version], mode == "1", f"u{size}"
        if self.binary and self._source.read(4) != np.int32(1).tobytes():
            raise ValueError("its bytes are in the order of another processor")

    def _check_names(self) -> None:
        self._names = self._line_count()
        for _ in self._lines(self._names):
            pass

    def _check_entities(self) -> None:
        """Format 4.1: tag, point or box, physical numbers, and of all but points what bounds them."""
        for dimension, count in enumerate(self._take(self.word, 4, "numbers of entities").tolist()):
            for _ in range(count):
                self._take("i4", 1, "tags of entities")
                self._take("f8", 3 if dimension == 0 else 6, "coordinates of entities")
                for what in ("physical numbers", "bounds")[: 1 if dimension == 0 else 2]:
                    (several,) = self._take(self.word, 1, "counts of entities").tolist()
                    self._take("i4", several, what)

    def _check_nodes(self) -> None:
        if self.version == "2.2":
            count = self._line_count()
            if self.binary:
                tags = self._take("i4,f8,f8,f8", count, "nodes")["f0"]
            else:
                tags = self._take("f8", 4 * count, "numbers of nodes")[::4]
        else:
            blocks, count, _, _ = self._take(self.word, 4, "counts of nodes").tolist()
            found = [np.empty(0, self.word)]
            for _ in range(blocks):
                _, _, parametric = self._take("i4", 3, "numbers of a block of nodes").tolist()
                if parametric:
                    remedy = "holds parameters of nodes: save the mesh without them (Mesh.SaveParametric = 0)"
                    raise InputError("mesh", self._path, remedy)
                (several,) = self._take(self.word, 1, "counts of nodes").tolist()
                found.append(self._take(self.word, several, "tags of nodes"))
                self._take("f8", 3 * several, "coordinates")
            tags = np.concatenate(found)
        if len(tags) != count or not count:
            raise ValueError(f"it claims {count} nodes and holds {len(tags)}")
        if not tags.min() >= 1:
            raise ValueError(f"{tags.min():g} is the tag of a node")
        if not tags.max() <= _TAGS_AT_LEAST + _TAGS_PER_NODE * count:
            remedy = f"numbers one of its {count} nodes {tags.max():.0f}: renumber them (RenumberMeshNodes in Gmsh)"
            raise InputError("mesh", self._path, remedy)

    def _check_elements(self) -> None:
        if self.version == "4.1":
            blocks, _, _, _ = self._take(self.word, 4, "counts of elements").tolist()
            for _ in range(blocks):
                _, _, kind = self._take("i4", 3, "numbers of a block of elements").tolist()
                (several,) = self._take(self.word, 1, "counts of elements").tolist()
                self._check_numbers(self._take(self.word, several * (1 + self._nodes_of(kind)), "numbers of elements"))
            if blocks * self._names > _MOST_SETS:
                raise ValueError(f"it has {blocks} blocks of elements and {self._names} physical names")
        elif self.binary:
            count, done = self._line_count(), 0
            while done < count:
                kind, several, tags = self._take("i4", 3, "numbers of a block of elements").tolist()
                columns = 1 + tags + self._nodes_of(kind)
                numbers = self._take("i4", several * columns, "numbers of elements").reshape(several, columns)
                self._check_numbers(numbers[:, 1 + tags :])
                done += several
        else:
            for line in self._lines(self._line_count()):
                words = list(map(int, line.split()))
                nodes = words[3 + words[2] :]
                if len(nodes) != self._nodes_of(words[1]) or min(nodes) < 1:
                    raise ValueError(f"{line.strip()!r} is no element")

    def _check_numbers(self, numbers: NDArray[Any]) -> None:
        """Zero is no tag, and would be taken for that of the last node."""
        if numbers.size and numbers.min() < 1:
            raise ValueError(f"{numbers.min()} is the tag of an element or its node")

    def _nodes_of(self, kind: int) -> int:
        """Nodes of one element."""
        if kind not in _NODES_OF_KIND:
            name = load("meshio.gmsh").gmsh_to_meshio_type.get(kind, kind)
            raise InputError("mesh", self._path, f"holds cells of kind {name!r}: give a mesh of triangles only")
        return _NODES_OF_KIND[kind]


def _all_numbered(words: list[str]) -> str:
    """The section of entities word by word, with a physical number for entities that have none.

    An entity is its tag, a point or box (3 or 6 coordinates), its physical numbers, and of curves and surfaces the
    entities that bound it; numbers and bounding entities are preceded by their count.
    """
    at, lines = 4, [" ".join(words[:4])]
    for dimension, count in enumerate(map(int, words[:4])):
        for _ in range(count):
            numbers_at = at + (4 if dimension == 0 else 7)
            bounds_at = numbers_at + 1 + int(words[numbers_at])
            stop = bounds_at if dimension == 0 else bounds_at + 1 + int(words[bounds_at])
            entity = words[at:stop]
            if bounds_at == numbers_at + 1:
                entity[numbers_at - at] = f"1 {_NAMELESS}"
            lines.append(" ".join(entity))
            at = stop
    return "\n".join(lines)
