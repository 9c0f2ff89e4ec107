"""Files of Abaqus and CalculiX: the text, if it names no other file and no set beyond measure."""

from io import StringIO
from pathlib import Path
from typing import Final

from qvi_contact.errors import InputError

_MOST_GENERATED: Final = 10_000_000
"""Members of all sets given as ranges together."""


def checked_text(path: Path) -> StringIO:
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
