"""Files that others may have written: one clear line for what is wrong with them."""

from pathlib import Path

import numpy as np

from solvers.errors import InputError


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
