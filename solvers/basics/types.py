"""Names for the arrays of (D2): dense vectors, and matrices in compressed columns or rows, all float64."""

from importlib import import_module
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array

Vector: TypeAlias = NDArray[np.float64]
"""One-dimensional float64 array."""

BoolVector: TypeAlias = NDArray[np.bool_]
"""One-dimensional boolean array."""

IntVector: TypeAlias = NDArray[np.int64]
"""One-dimensional integer array."""

Matrix: TypeAlias = NDArray[np.float64]
"""Two-dimensional dense float64 array."""

Sparse: TypeAlias = csc_array
"""Two-dimensional float64 array in compressed columns, the one form every back end reads.

Not csc_array[np.float64]: SciPy 1.15 cannot be asked for that, and scipy-stubs does not know that such an array times a
vector is a vector.
"""

SparseRows: TypeAlias = csr_array
"""The same in compressed rows."""

Module: TypeAlias = Any
"""A back end without type information, imported where it is used."""


def load(name: str) -> Module:
    """Import a back end now."""
    return import_module(name)
