"""Dörfler's marking: the fewest parts that hold a share of the whole."""

from typing import Final

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray

_BULK: Final = 0.6  # Dörfler's share of the difference that is marked


def bulk(parts: FloatArray, share: float = _BULK) -> BoolArray:
    """The fewest entries that hold a share of the sum, Dörfler's by default."""
    order: IntArray = np.argsort(-parts, kind="stable")
    enough = int(np.searchsorted(np.cumsum(parts[order]), share * parts.sum() * (1.0 - 1e-12))) + 1
    found = np.zeros(len(parts), dtype=bool)
    found[order[:enough]] = True
    return found
