"""Files that are either there whole or not there at all."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from qvi_contact.errors import InputError


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Give a temporary name beside `path` to write to, and rename it to `path` when the block ends well.

    An earlier file of that name survives any failure.

    Raises
    ------
    InputError
        If the folder or file cannot be written.

    """
    target = Path(path)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.stem}-", suffix=target.suffix, dir=target.parent)
        os.close(handle)
    except OSError as error:
        raise _unwritable(target, error) from error
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(target)
    except OSError as error:
        raise _unwritable(target, error) from error
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write a text file in UTF-8, whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def check_suffix(option: str, path: str | Path, suffix: str) -> None:
    """Refuse a file name that does not end in `suffix`."""
    if Path(path).suffix.lower() != suffix:
        raise InputError(option, str(path), f"give a file name that ends in {suffix}")


def writable_folder(path: str | Path) -> Path:
    """Make the folder if it is missing, and find out before any work is done whether it can be written."""
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise _unwritable(folder, error) from error
    return folder


def _unwritable(path: Path, error: OSError) -> InputError:
    reason = error.strerror or str(error)
    return InputError("output", str(path), f"cannot be written ({reason}): give another place, or make room there")


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
