"""Files of this package: written whole or not at all, and read with one clear line for what is wrong."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from solvers.errors import InputError


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Give a temporary name beside `path` to write to, and rename it to `path` when the block ends well.

    Raises
    ------
    InputError
        If the folder or file cannot be written; an earlier file of that name then survives.

    """
    target = Path(path)
    temporary: Path | None = None
    try:
        handle, name = tempfile.mkstemp(prefix=".writing-", suffix=target.suffix, dir=target.parent)
        os.close(handle)
        temporary = Path(name)
        yield temporary
        temporary.chmod(0o644)
        temporary.replace(target)
    except (OSError, ValueError) as error:  # ValueError: a name no file can have
        if isinstance(error, InputError):
            raise
        reason = getattr(error, "strerror", None) or str(error)
        remedy = f"cannot be written ({reason}): give another place, or make room there"
        raise InputError("output", str(target), remedy) from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def unreadable(path: str | Path, error: Exception, kind: str) -> InputError:
    """The error for a file that is missing, truncated or of another format."""
    reason = getattr(error, "strerror", None) or " ".join(str(error).split()) or type(error).__name__
    return InputError("file", str(path), f"cannot be read ({reason}): give {kind}")


def finite(field: str, values: np.ndarray, *, infinite: bool = False) -> np.ndarray:
    """The numbers as float64; `InputError` for anything that is no number, NaN, or (unless allowed) infinite."""
    if values.dtype.kind not in "fiu":
        raise InputError(field, f"type {values.dtype}", "give real numbers")
    numbers = np.asarray(values, dtype=np.float64)
    if np.isnan(numbers).any() or not (infinite or np.isfinite(numbers).all()):
        raise InputError(field, "NaN or infinity", "give finite numbers")
    return numbers
