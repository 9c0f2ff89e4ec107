"""Meshes in files of Abaqus or CalculiX (.inp): nodes, plane elements, line elements, and sets of these by name.

meshio takes some of them for others: of several blocks of nodes it keeps the last, and sets of elements may get those
of another block, or lose what other sets or files hold.
"""

import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np

from qvi_contact.basics.checks import IntArray
from qvi_contact.basics.writing import open_regular
from qvi_contact.errors import InputError
from qvi_contact.mesh.curves import MeshParts

_PLANE: Final = re.compile(r"(?:CPS|CPE|CPEG|CAX|S|STRI|M3D|R3D)([34689])\w*")  # with the number of nodes
_TRUSS: Final = re.compile(r"(?:(T2D2|T3D2|R2D2|B[23][13])|T2D3|T3D3|B[23]2)H?")  # of two nodes, or of three
_MAKING: Final = ("NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY")  # nodes and elements of others
_READ: Final = ("NODE", "ELEMENT", "ELSET")
_WORDS: Final = ("GENERATE", "INTERNAL", "UNSORTED")  # options without a value
_LARGEST: Final = 2**62  # number of an element that a range may end with

_Member: TypeAlias = str | int | range
"""Of a set: the name of another one, an element, or several."""


def _lines(path: Path, above: tuple[Path, ...] = ()) -> Iterator[str]:
    """Lines of a file, and of those that it includes, without comments."""
    path = path.resolve()
    if path in above or (above and not path.is_file()):
        raise ValueError(f"it includes {path.name}, which is not there, or includes itself")
    with open_regular(path) as source:
        content = source.read()
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    for line in map(str.strip, io.StringIO(text, newline=None)):
        if line.upper().startswith("*INCLUDE"):
            yield from _lines(path.parent / line.partition("=")[2].strip().strip('"'), (*above, path))
        elif line and not line.startswith("**"):
            yield line


class AbaqusFile:
    """What a file holds; names of sets mean the same in capitals and small letters."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._nodes, self._elements = dict[int, list[float]](), dict[int, list[int]]()  # of lines two or three, else 4
        self._members = dict[str, list[_Member]]()
        self._called = dict[str, tuple[str, bool]]()  # as it is written, and whether it belongs to an assembly
        self._sections = list[tuple[str, dict[str, str], list[str]]]()
        goes_on = False
        for line in _lines(path):
            if line.startswith("*") or (goes_on and ("=" in line or line.strip(", ").upper() in _WORDS)):
                words = [word.strip() for word in line.lstrip("*").rstrip(",").split(",")]
                if line.startswith("*"):
                    self._sections.append((" ".join(words.pop(0).upper().split()), {}, []))
                pairs = (word.partition("=") for word in words)
                self._sections[-1][1].update({key.strip().upper(): value.strip() for key, _, value in pairs})
                goes_on = line.endswith(",")
            elif self._sections and self._sections[-1][0] in (*_READ, "SYSTEM", "INSTANCE"):
                self._sections[-1][2].append(line)
                goes_on = False

    def read(self) -> MeshParts:
        """The mesh; `InputError` for what is no plane mesh in one part, `ValueError` for a file that is broken."""
        self._read_sections()
        if not self._nodes:
            raise InputError("mesh", "", "holds no nodes: write the mesh again")
        index, points = {number: place for place, number in enumerate(self._nodes)}, list(self._nodes.values())
        found = {number: [index.get(node, -1) for node in each] for number, each in self._elements.items()}
        at = {number: row for row, number in enumerate(n for n, nodes in found.items() if len(nodes) == 4)}
        edge_sets, regions = dict[str, IntArray](), dict[str, IntArray]()
        for key, (name, _) in self._called.items():
            members = self._numbers(key)
            lines = [_ends(found[number], points) for number in members if number not in at]
            cells = [at[number] for number in members if number in at]
            edge_sets |= {name: np.array(lines)} if lines else {}
            regions |= {name: np.array(cells)} if cells else {}
        corners = np.array([found[number] for number in at], dtype=np.int64).reshape(-1, 4)
        return MeshParts(np.array(points, dtype=float).reshape(-1, 3), corners, edge_sets, regions)

    def _read_sections(self) -> None:
        """Nodes, elements and sets."""
        if [keyword for keyword, _, _ in self._sections].count("PART") > 1:
            raise InputError("mesh", "", "holds several parts: write one, with all nodes where they are")
        of_assembly = False
        for keyword, options, data in self._sections:
            if keyword in ("ASSEMBLY", "INSTANCE", "END INSTANCE", "END ASSEMBLY"):
                of_assembly = keyword in ("ASSEMBLY", "END INSTANCE")
            placed = keyword in ("SYSTEM", "INSTANCE") and data  # turned or moved
            if placed or keyword in _MAKING or (keyword == "NODE" and options.get("SYSTEM", "R").upper() != "R"):
                remedy = f"holds *{keyword}, which moves or makes nodes: write all nodes where they are"
                raise InputError("mesh", "", remedy)
            if keyword in _READ and "INPUT" in options:
                data += _lines(self._path.parent / options["INPUT"].strip('"'), (self._path.resolve(),))
            rows = (line.rstrip(",").split(",") for line in data)
            if keyword == "NODE" and not of_assembly:  # those of assemblies are reference points
                self._read_nodes(rows)
            elif keyword == "ELEMENT" and of_assembly:
                raise InputError("mesh", "", "holds elements of an assembly: write one part, with all elements")
            elif keyword == "ELEMENT":
                self._read_elements(options, rows)
            elif keyword == "ELSET" and not (of_assembly and "INTERNAL" in options):
                self._read_set(options, rows, of_assembly)

    def _read_nodes(self, rows: Iterator[list[str]]) -> None:
        for number, *place in rows:
            found = [*map(float, place), 0.0, 0.0][:3]
            if self._nodes.setdefault(int(number), found) != found:
                raise ValueError(f"two nodes have the number {number}")

    def _read_elements(self, options: dict[str, str], rows: Iterator[list[str]]) -> None:
        kind = options.get("TYPE", "")
        plane, truss = _PLANE.fullmatch(kind.upper()), _TRUSS.fullmatch(kind.upper())
        if not plane and not truss:
            raise InputError("mesh", "", f"holds elements of type {kind!r}: give triangles and quadrilaterals only")
        count = int(plane[1]) if plane else 2 if truss and truss[1] else 3
        given = np.array([int(word) for words in rows for word in words if word.strip()]).reshape(-1, 1 + count)
        for number, *nodes in given.tolist():
            if number in self._elements:
                raise ValueError(f"two elements have the number {number}")
            self._elements[number] = nodes if truss else [*nodes[:3], nodes[2 if count in (3, 6) else 3]]
        if "ELSET" in options:
            self._set(options, of_assembly=False).extend(given[:, 0].tolist())

    def _read_set(self, options: dict[str, str], rows: Iterator[list[str]], of_assembly: bool) -> None:
        own = self._set(options, of_assembly=of_assembly)
        for words in rows:
            if "GENERATE" in options:
                first, last, *step = map(int, words)
                own.append(range(first, min(last, _LARGEST) + 1, *step))
            else:
                own += [int(word) if word.isdigit() else word.upper() for word in map(str.strip, words)]

    def _set(self, options: dict[str, str], *, of_assembly: bool) -> list[_Member]:
        """The members of the set that is named."""
        name = options.get("ELSET", "")
        if not name:
            raise ValueError("a set of elements has no name")
        if self._called.setdefault(name.upper(), (name, of_assembly))[1] != of_assembly:
            raise InputError("mesh", "", f"holds a set {name!r} of a part, and another one of its assembly: rename one")
        return self._members.setdefault(name.upper(), [])

    def _numbers(self, key: str) -> list[int]:
        """The elements of a set, and of those that it names."""
        found, known, left = set[int](), {key}, [key]
        while left:
            if (name := left.pop()) not in self._members:
                raise ValueError(f"there is no set {name} of elements")
            for each in self._members[name]:
                if isinstance(each, range):
                    few = len(each) <= len(self._elements)
                    found.update(each if few else (number for number in self._elements if number in each))
                elif isinstance(each, int):
                    found.add(each)
                elif each not in known:
                    known.add(each)
                    left.append(each)
        return sorted(found & self._elements.keys())


def _ends(nodes: list[int], points: list[list[float]]) -> list[int]:
    """The two nodes of a line, or the two of three that are farthest apart."""
    pairs = [nodes[:2], nodes[1:], nodes[::2]] if len(nodes) == 3 else [nodes]
    return max(pairs, key=lambda pair: float(np.hypot(*np.subtract(points[pair[0]], points[pair[1]])[:2])))
