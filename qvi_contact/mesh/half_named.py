"""Files of Gmsh 4 in which some curves or surfaces have a physical name and others have none.

meshio keeps the physical numbers of cells as one list with an entry for each block of cells, but makes an entry only
where there is a number, and then finds the list too short. So entities without a number get one that has no name.
"""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_BEGIN, _END = "$Entities", "$EndEntities"
_NAMELESS = 2**31 - 1  # the largest number there can be: no name has it


@contextmanager
def completed(path: Path) -> Iterator[Path]:
    """A file in which every entity has a physical number: the file itself, or a copy that is removed after.

    Files that are binary, of another format, or broken are left as they are.
    """
    text = _completed(path.read_bytes())
    if text is None:
        yield path
        return
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / path.name
        copy.write_bytes(text)
        yield copy


def _completed(content: bytes) -> bytes | None:
    """The content with numbers for all entities; None if it needs none, or is not understood."""
    head, begin, rest = content.partition(f"\n{_BEGIN}".encode())
    section, end, tail = rest.partition(_END.encode())
    format_line = head.split(b"\n")[1].split() if head.startswith(b"$MeshFormat") else []
    if not begin or not end or format_line[:2] != [b"4.1", b"0"]:
        return None
    try:
        lines = _numbered(section.decode("ascii").split())
    except (ValueError, IndexError):  # meshio says what is wrong
        return None
    return None if lines is None else head + begin + b"\n" + lines.encode("ascii") + b"\n" + end + tail


def _numbered(words: list[str]) -> str | None:
    """The section word by word, with a number of their own for entities without one; None if there are none.

    An entity is its tag, a point or box (3 or 6 coordinates), its physical numbers, and of curves and surfaces the
    entities that bound it; numbers and bounding entities are preceded by their count.
    """
    at, lines, complete = 4, [" ".join(words[:4])], True
    for dimension, count in enumerate(map(int, words[:4])):
        for _ in range(count):
            numbers_at = at + (4 if dimension == 0 else 7)
            bounds_at = numbers_at + 1 + int(words[numbers_at])
            stop = bounds_at if dimension == 0 else bounds_at + 1 + int(words[bounds_at])
            entity = words[at:stop]
            if bounds_at == numbers_at + 1:
                complete = False
                entity[numbers_at - at] = f"1 {_NAMELESS}"
            lines.append(" ".join(entity))
            at = stop
    return None if complete or at != len(words) else "\n".join(lines)
