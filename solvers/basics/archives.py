"""NumPy archives that others may have written: no pickles, and no more memory than a limit."""

import os
import stat
import zipfile
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from solvers.errors import InputError

LARGEST: Final = 1_000_000_000
"""Bytes of all entries together; a megabyte of a compressed archive can hold a gigabyte of zeros."""


def open_regular(path: str | Path) -> BinaryIO:
    """Open a file for reading; `ValueError` for pipes, which may wait for ever, and devices, which may have no end."""
    if not stat.S_ISREG(os.stat(path).st_mode):
        raise ValueError("it is not a regular file")
    return Path(path).open("rb")


def read_arrays(field: str, path: str, stream: BinaryIO) -> dict[str, NDArray[Any]]:
    """All entries of an open .npz file, each read to its end so that nothing truncated goes unnoticed.

    Raises
    ------
    InputError
        About `field`, if the entries have more than `LARGEST` bytes in all; nothing is read then.
    Exception
        Of many kinds (of zip, zlib, NumPy) for what is no such file, is broken, names two entries alike, or holds
        pickles.

    """
    with zipfile.ZipFile(stream) as archive:
        entries = archive.infolist()
    sizes = {entry.filename.removesuffix(".npy"): entry.file_size for entry in entries}
    if len(sizes) < len(entries):
        raise ValueError("two of its entries have one name")
    total = sum(sizes.values())  # a reader gets no more, whatever the header of an entry says
    if total > LARGEST:
        remedy = f"its arrays have {total} bytes, more than the limit of {LARGEST}: write it from a coarser mesh"
        raise InputError(field, path, remedy)
    stream.seek(0)
    with np.load(stream, allow_pickle=False) as found:
        return {name: _entry(found[name], sizes[name]) for name in found.files}


def _entry(entry: NDArray[Any] | bytes, size: int) -> NDArray[Any]:
    """The array, if it is no longer than its bytes: items without a size cost nothing until somebody lists them."""
    array = np.asarray(entry)  # what is no array in the file comes as bytes
    if array.size > size:
        raise ValueError("an entry has more items than bytes")
    return array
