"""NumPy archives of results: flat names, arrays and texts, no pickles, and a digest of them all.

The digest is SHA-256 over names, types, shapes and bytes of all other entries in the order of their names. It tells
a file that was changed after it was written; whoever changes the digest too still has to fool the certificate.
"""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO, Final
from zipfile import BadZipFile

import numpy as np
from numpy.lib.format import MAGIC_PREFIX
from numpy.typing import NDArray

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.basics.writing import replacing
from qvi_contact.errors import InputError
from solvers.basics.files import open_regular, read_arrays

FORMAT: Final = "qvi_contact result"
FORMAT_VERSION: Final = 1
"""Grows when an entry changes its meaning or goes away; one that comes says what files without it mean."""

OWN: Final = frozenset({"format", "format_version", "digest"})
"""Names of the entries that `write_archive` adds."""

Arrays = dict[str, NDArray[Any]]

_REMEDY = "give a file written by write_npz, or by qvi-contact solve --npz"


def digest(arrays: Mapping[str, NDArray[Any]]) -> str:
    """The digest of all entries but the digest itself, as hexadecimal text."""
    found = hashlib.sha256()
    for name in sorted(set(arrays) - {"digest"}):
        array = np.ascontiguousarray(arrays[name])
        found.update(f"{name}\0{array.dtype.str}\0{array.shape}\0".encode())
        found.update(array.reshape(-1).view(np.uint8).data)  # not a copy of them
    return found.hexdigest()


def write_archive(path: str | Path, arrays: Mapping[str, Any]) -> None:
    """Write entries, format, version and digest, whole or not at all."""
    entries = {name: np.asarray(value) for name, value in arrays.items()}
    entries |= {"format": np.array(FORMAT), "format_version": np.array(FORMAT_VERSION)}
    entries["digest"] = np.array(digest(entries))
    with replacing(path) as temporary:
        np.savez_compressed(temporary, **entries)  # type: ignore[arg-type]  # names are entries, not options


class Archive:
    """The entries of a file, read and checked one by one.

    Attributes
    ----------
    path : str
        The file.
    arrays : mapping of str to array
        All entries.

    Raises
    ------
    InputError
        If the file is no archive, truncated, holds pickles, or is of another format or version; and by the methods if
        an entry is missing or of another kind.

    """

    def __init__(self, path: str | Path) -> None:
        self.path = str(path)
        self.arrays: Arrays
        try:
            with open_regular(path) as stream:
                self.arrays = _entries(self.path, stream)
        except InputError:
            raise
        except Exception as error:  # zip, zlib, numpy, tokenize: what broken bytes raise there is not documented
            raise InputError("result", self.path, f"cannot be read ({_reason(error)}): {_REMEDY}") from error
        if "format" not in self.arrays or self.text("format") != FORMAT:
            raise InputError("result", self.path, f"is not a result that can be checked: {_REMEDY}")
        version = self.number("format_version")
        if version != FORMAT_VERSION:
            remedy = f"only version {FORMAT_VERSION} is known here: take the version of qvi-contact that wrote the file"
            raise InputError("result", f"{self.path}, version {version:g}", remedy)

    @property
    def intact(self) -> bool:
        """Whether the digest fits."""
        return self.text("digest") == digest(self.arrays)

    def text(self, name: str) -> str:
        """A text."""
        array = self.array(name)
        if array.dtype.kind != "U" or array.ndim:
            raise self._wrong(name, "a text")
        return str(array)

    def texts(self, name: str) -> list[str]:
        """A list of texts."""
        array = self.array(name)
        if array.dtype.kind != "U" or array.ndim != 1:
            raise self._wrong(name, "a list of texts")
        return [str(text) for text in array]

    def number(self, name: str) -> float:
        """A number, or a truth value as 0 or 1."""
        array = self.array(name)
        if array.dtype.kind not in "biuf" or array.ndim:
            raise self._wrong(name, "a number")
        return float(array)

    def floats(self, name: str, dimensions: int = 1) -> FloatArray:
        """An array of float64."""
        array = self.array(name)
        if array.dtype != np.float64 or array.ndim != dimensions:
            raise self._wrong(name, f"{dimensions}-dimensional, of float64")
        return array

    def integers(self, name: str) -> IntArray:
        """A vector of int64."""
        array = self.array(name)
        if array.dtype != np.int64 or array.ndim != 1:
            raise self._wrong(name, "a vector of int64")
        return array

    def array(self, name: str) -> NDArray[Any]:
        """An entry of any kind."""
        if name not in self.arrays:
            raise InputError("result", self.path, f"has no entry {name!r}: {_REMEDY}")
        return self.arrays[name]

    def _wrong(self, name: str, wanted: str) -> InputError:
        found = self.arrays[name]
        return InputError("result", self.path, f"entry {name!r} is {found.dtype}{list(found.shape)}, not {wanted}")


def _entries(path: str, stream: BinaryIO) -> Arrays:
    """All entries of an open file."""
    if stream.read(len(MAGIC_PREFIX)) == MAGIC_PREFIX:
        raise InputError("result", path, f"is a single array: {_REMEDY}")
    stream.seek(0)
    return read_arrays("result", path, stream)


def _reason(error: BaseException) -> str:
    """Why a file cannot be read, on one line."""
    text = getattr(error, "strerror", None) or (str(error).splitlines() or [type(error).__name__])[0]
    return (
        "it is not an archive, or holds pickled objects"
        if "pickle" in text or isinstance(error, BadZipFile)
        else str(text)
    )
