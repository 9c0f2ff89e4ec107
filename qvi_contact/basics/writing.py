"""Files written completely or not at all, archives of arrays read within limits, and templates of HTML pages.

A regular file is replaced by renaming and keeps its mode; links are followed, devices and pipes are written to.
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
    """The path from a caller's text or `Path`; `InputError` for anything else."""
    name = os.fspath(value) if isinstance(value, str | os.PathLike) else None
    if not isinstance(name, str):
        raise InputError(field, value, "give the name of a file or folder, as a text or a Path")
    return Path(name)


@contextmanager
def replacing(path: str | Path, field: str = "output") -> Iterator[Path]:
    """Yield a temporary name to write to; if the block succeeds, its contents become those of `path`.

    If the block fails, an earlier file remains. If it succeeds, the new file has the earlier file's mode. `InputError`
    about `field` if the folder or file cannot be written.
    """
    path = given_path(field, path)
    try:
        target, old_stat = _followed(path)
        folder = target.parent if old_stat is None or stat.S_ISREG(old_stat.st_mode) else None
        handle, name = tempfile.mkstemp(prefix=".writing-", suffix=path.suffix, dir=folder)
        os.close(handle)
    except (OSError, ValueError) as error:  # ValueError: an impossible name of a folder
        raise unwritable(path, error, field) from error
    temporary = Path(name)
    try:
        yield temporary
        stream = None if old_stat is None else _standard_stream(old_stat)  # such as /dev/stdout
        if stream is None and (old_stat is None or stat.S_ISREG(old_stat.st_mode)):
            mask = os.umask(0)
            os.umask(mask)
            temporary.chmod(0o666 & ~mask if old_stat is None else stat.S_IMODE(old_stat.st_mode))
            temporary.replace(target)
        else:  # copy into the stream, device or pipe
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
    """`InputError` about `field` if `replacing` cannot write a file; to be called before the work."""
    with suppress(_LeaveError), replacing(path, field):
        raise _LeaveError


class _LeaveError(Exception):
    """Leave a block of `replacing` without replacing the file."""


def identity(path: str | Path) -> object:
    """A key that is equal for all names of one file, also if the file does not exist yet."""
    with suppress(OSError, ValueError):
        status = Path(path).stat()
        return status.st_dev, status.st_ino
    with suppress(OSError, ValueError):  # no working folder, or an impossible name
        return os.path.realpath(path)
    return str(path)


def unwritable(path: Path, error: Exception, field: str = "output") -> InputError:
    """The error for a path that cannot be written; `field` is the option that named it."""
    reason = getattr(error, "strerror", None) or str(error)
    return InputError(field, str(path), f"cannot be written ({reason}): give another place, or make room there")


def _followed(path: Path) -> tuple[Path, os.stat_result | None]:
    """The target of a path through links, and its status if it exists; an error if it exists and cannot be written."""
    resolved = Path(os.path.realpath(path))
    try:
        status = path.stat()
    except FileNotFoundError:  # a new file, or a link to one
        return resolved, None
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    has_name = resolved.exists() and resolved.samefile(path)  # pipes that a process holds open have no name
    return resolved if has_name else path, status


def _standard_stream(earlier: os.stat_result) -> int | None:
    """The number of the standard output or error stream if the file is one of them, after flushing it; else None."""
    for number, stream in ((1, sys.stdout), (2, sys.stderr)):
        with suppress(OSError):  # closed by the shell
            if os.path.samestat(os.fstat(number), earlier):
                if stream is not None:
                    stream.flush()
                return number
    return None


def write_text(path: str | Path, text: str, field: str = "output") -> None:
    """Write a text file in UTF-8, completely or not at all; see `replacing`.

    Characters without UTF-8 bytes, which names of files on Unix may contain, become question marks.
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
    """The folder, made if it is missing; to be called before the work.

    `InputError` about `field`, the option that named it, if it cannot be written or is a file.
    """
    folder = given_path(field, path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except FileExistsError as error:
        raise InputError(field, str(path), "is a file, not a folder: give another place") from error
    except (OSError, ValueError) as error:  # ValueError: an impossible name
        raise unwritable(folder, error, field) from error
    return folder


def page_template(package: str, name: str = "page.html") -> Template:
    """The template of this name in a package; it extends ``frame.html`` of `qvi_contact.basics`.

    The frame has the head, the common style, the package's ``page.css``, and the blocks "title", "body" and "script".
    """
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

    loader = ChoiceLoader([PackageLoader(package, "."), PackageLoader("qvi_contact.basics", ".")])
    pages = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return pages.get_template(name)


# NumPy archives from unknown sources: no pickles, and limited memory

LARGEST: Final = 1_000_000_000
"""Largest number of bytes of all entries; one megabyte of a compressed archive can hold a gigabyte of zeros."""


def open_regular(path: str | Path) -> BinaryIO:
    """Open a file for reading; `ValueError` for pipes, which may block, and devices, which may have no end."""
    if not stat.S_ISREG(os.stat(path).st_mode):
        raise ValueError("it is not a regular file")
    return Path(path).open("rb")


def read_arrays(field: str, path: str, stream: BinaryIO) -> dict[str, NDArray[Any]]:
    """All entries of an open .npz file, each read to its end, which detects truncated files.

    `InputError` about `field`, before anything is read, if the entries have more than `LARGEST` bytes in all.
    Exceptions of many kinds (of zip, zlib, NumPy) for other and broken files, equal names of entries, and pickles.
    """
    import numpy as np  # not at the top: commands that only write files do not need it

    with zipfile.ZipFile(stream) as archive:
        entries = archive.infolist()
    sizes = {entry.filename.removesuffix(".npy"): entry.file_size for entry in entries}
    if len(sizes) < len(entries):
        raise ValueError("two of its entries have one name")
    total = sum(sizes.values())  # zipfile reads no more, whatever an entry's header says
    if total > LARGEST:
        remedy = f"its arrays have {total} bytes, more than the limit of {LARGEST}: write it from a coarser mesh"
        raise InputError(field, path, remedy)
    stream.seek(0)
    with np.load(stream, allow_pickle=False) as archive_arrays:
        arrays = {name: np.asarray(archive_arrays[name]) for name in archive_arrays.files}  # other files come as bytes
    if any(array.size > sizes[name] for name, array in arrays.items()):  # items of size zero
        raise ValueError("an entry has more items than bytes")
    return arrays
