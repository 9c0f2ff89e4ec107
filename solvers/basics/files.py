"""Files that are either there whole or not there at all."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from solvers.errors import InputError


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
        handle, name = tempfile.mkstemp(prefix=".writing-", suffix=target.suffix, dir=target.parent)
        os.close(handle)
    except (OSError, ValueError) as error:  # ValueError: a folder's name that none can have
        raise unwritable(target, error) from error
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o666 & ~_umask())
        _rename(temporary, target)
    except OSError as error:
        raise unwritable(target, error) from error
    finally:
        temporary.unlink(missing_ok=True)


def unwritable(path: Path, error: OSError | ValueError, field: str = "output") -> InputError:
    """The error for a place where nothing can be written; `field` is the option that named it."""
    reason = getattr(error, "strerror", None) or str(error)
    return InputError(field, str(path), f"cannot be written ({reason}): give another place, or make room there")


def _rename(temporary: Path, target: Path) -> None:
    try:
        temporary.replace(target)
    except ValueError as error:  # a name no file can have
        raise unwritable(target, error) from error


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
