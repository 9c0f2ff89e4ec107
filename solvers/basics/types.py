"""Names for the arrays of (D2): dense vectors and compressed sparse columns, both float64."""

from importlib import import_module
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Vector: TypeAlias = NDArray[np.float64]
"""One-dimensional float64 array."""

BoolVector: TypeAlias = NDArray[np.bool_]
"""One-dimensional boolean array."""

IntVector: TypeAlias = NDArray[np.int64]
"""One-dimensional integer array."""

Matrix: TypeAlias = NDArray[np.float64]
"""Two-dimensional dense float64 array."""

Sparse: TypeAlias = Any
"""`scipy.sparse.csc_matrix` of float64, the one form every back end reads."""

Module: TypeAlias = Any
"""A back end without type information, imported where it is used."""


def load(name: str) -> Module:
    """Import a back end now."""
    return import_module(name)
