"""Files that are either there whole or not there at all, archives of arrays read within limits, and HTML pages.

Only regular files are replaced, by renaming, and keep their mode. Links are followed; devices and pipes are written
into. Pages load nothing.
"""

from __future__ import annotations

import errno
import os
import shutil
import stat
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Final

from qvi_contact.errors import InputError

if TYPE_CHECKING:
    from jinja2 import Template
    from numpy.typing import NDArray


def given_path(field: str, value: object) -> Path:
    """The path that a caller has given as a text or a `Path`; `InputError` for anything else."""
    name = os.fspath(value) if isinstance(value, str | os.PathLike) else None
    if not isinstance(name, str):
        raise InputError(field, value, "give the name of a file or folder, as a text or a Path")
    return Path(name)


@contextmanager
def replacing(path: str | Path, field: str = "output") -> Iterator[Path]:
    """Give a temporary name to write to; when the block ends well, what was written becomes the contents of `path`.

    An earlier file of that name survives any failure of the block, and keeps its mode after it. `InputError` about
    `field` if the folder or file cannot be written.
    """
    path = given_path(field, path)
    try:
        target, earlier = _followed(path)
        beside = target.parent if earlier is None or stat.S_ISREG(earlier.st_mode) else None
        handle, name = tempfile.mkstemp(prefix=".writing-", suffix=path.suffix, dir=beside)
        os.close(handle)
    except (OSError, ValueError) as error:  # ValueError: a folder's name that none can have
        raise unwritable(path, error, field) from error
    temporary = Path(name)
    try:
        yield temporary
        stream = None if earlier is None else _standard_stream(earlier)  # as /dev/stdout, in its turn
        if stream is None and (earlier is None or stat.S_ISREG(earlier.st_mode)):
            mask = os.umask(0)
            os.umask(mask)
            temporary.chmod(0o666 & ~mask if earlier is None else stat.S_IMODE(earlier.st_mode))
            temporary.replace(target)
        else:  # into what stands there
            with (
                temporary.open("rb") as source,
                target.open("wb") if stream is None else os.fdopen(os.dup(stream), "wb") as sink,
            ):
                shutil.copyfileobj(source, sink)
    except OSError as error:
        raise unwritable(path, error, field) from error
    finally:
        temporary.unlink(missing_ok=True)


def check_writable(path: str | Path, field: str = "output") -> None:
    """Find out before any work is done whether `replacing` can write a file; `InputError` about `field` if not."""
    with suppress(_EnoughError), replacing(path, field):
        raise _EnoughError


class _EnoughError(Exception):
    """Leaves a block of `replacing` with the earlier file as it was."""


def identity(path: str | Path) -> object:
    """What all names of one file have in common, whether it exists or not."""
    with suppress(OSError, ValueError):
        found = Path(path).stat()
        return found.st_dev, found.st_ino
    with suppress(OSError, ValueError):  # where the working folder is gone, or no file can have that name
        return os.path.realpath(path)
    return str(path)


def unwritable(path: Path, error: Exception, field: str = "output") -> InputError:
    """The error for a place where nothing can be written; `field` is the option that named it."""
    reason = getattr(error, "strerror", None) or str(error)
    return InputError(field, str(path), f"cannot be written ({reason}): give another place, or make room there")


def _followed(path: Path) -> tuple[Path, os.stat_result | None]:
    """Where a path leads through links, and what stands there; an error if that is there and cannot be written."""
    resolved = Path(os.path.realpath(path))
    try:
        found = path.stat()
    except FileNotFoundError:  # a new file, or a link to one
        return resolved, None
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    named = resolved.exists() and resolved.samefile(path)  # pipes that a process holds open have no name
    return resolved if named else path, found


def _standard_stream(earlier: os.stat_result) -> int | None:
    """The number of the standard output or error stream that a file is, with nothing left in its buffer."""
    for number, stream in ((1, sys.stdout), (2, sys.stderr)):
        with suppress(OSError):  # closed by the shell
            if os.path.samestat(os.fstat(number), earlier):
                if stream is not None:
                    stream.flush()
                return number
    return None


def write_text(path: str | Path, text: str, field: str = "output") -> None:
    """Write a text file in UTF-8, whole or not at all; see `replacing`.

    What UTF-8 has no bytes for, as names of files may have on Unix, is a question mark, as on the terminal.
    """
    with replacing(path, field) as temporary:
        temporary.write_text(text, encoding="utf-8", errors="replace", newline="\n")


def check_suffix(option: str, path: str | Path, *suffixes: str) -> str:
    """The suffix of a file name in lower case; `InputError` unless it is one of these."""
    suffix = given_path(option, path).suffix.lower()
    if suffix not in suffixes:
        raise InputError(option, str(path), f"give a file name that ends in {', '.join(suffixes)}")
    return suffix


def writable_folder(path: str | Path, field: str = "output") -> Path:
    """Make the folder if it is missing, and find out before any work is done whether it can be written.

    `InputError` if it cannot, or is a file; about `field`, the option that named it.
    """
    folder = given_path(field, path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except FileExistsError as error:
        raise InputError(field, str(path), "is a file, not a folder: give another place") from error
    except (OSError, ValueError) as error:  # ValueError: a name no folder can have
        raise unwritable(folder, error, field) from error
    return folder


def page_template(package: str, name: str = "page.html") -> Template:
    """The template of this name of a package, which extends ``frame.html`` of this one.

    The frame has the head, the style that pages share and the package's own ``page.css``, and the blocks "title",
    "body" and "script".
    """
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=ChoiceLoader([PackageLoader(package, "."), PackageLoader("qvi_contact.basics", ".")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(name)


# NumPy archives that others may have written: no pickles, and no more memory than a limit.


LARGEST: Final = 1_000_000_000
"""Bytes of all entries together; a megabyte of a compressed archive can hold a gigabyte of zeros."""


def open_regular(path: str | Path) -> BinaryIO:
    """Open a file for reading; `ValueError` for pipes, which may wait for ever, and devices, which may have no end."""
    if not stat.S_ISREG(os.stat(path).st_mode):
        raise ValueError("it is not a regular file")
    return Path(path).open("rb")


def read_arrays(field: str, path: str, stream: BinaryIO) -> dict[str, NDArray[Any]]:
    """All entries of an open .npz file, each read to its end so that nothing truncated goes unnoticed.

    `InputError` about `field` if the entries have more than `LARGEST` bytes in all; nothing is read then. Exceptions of
    many kinds (of zip, zlib, NumPy) for what is no such file, is broken, names two entries alike, or holds pickles.
    """
    import numpy as np  # commands that only write files, or show their help, need none

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
        arrays = {name: np.asarray(found[name]) for name in found.files}  # what is no array in the file comes as bytes
    if any(array.size > sizes[name] for name, array in arrays.items()):  # items without a size cost nothing at first
        raise ValueError("an entry has more items than bytes")
    return arrays
