"""The trailing block of a supernodal factor of CHOLMOD, read where cvxopt keeps it.

cvxopt has no function for it but `getfactor`, which copies the whole factor and destroys it. The structure read here
is `cholmod_factor` of cholmod.h, unchanged from CHOLMOD 1.7 to 5.x; what is read is checked before it is believed.
"""

import ctypes
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from solvers.basics.types import IntVector, Matrix, Module, Vector

_NAME: Final = b"CHOLMOD FACTOR D L"  # cvxopt's name of a real factor made from the lower triangle
_LONG, _REAL, _DOUBLE = 2, 1, 0  # itype, xtype, dtype
_SIZES: Final = ("nsuper", "ssize", "xsize", "maxcsize", "maxesize")
_FLAGS: Final = ("ordering", "is_ll", "is_super", "is_monotonic", "itype", "xtype", "dtype", "use_gpu")


class _Factor(ctypes.Structure):
    """`cholmod_factor` of cholmod.h: L Lᵀ by supernodes when is_super."""

    _fields_ = (
        ("n", ctypes.c_size_t),
        ("minor", ctypes.c_size_t),
        *((name, ctypes.c_void_p) for name in ("Perm", "ColCount", "IPerm")),
        ("nzmax", ctypes.c_size_t),
        *((name, ctypes.c_void_p) for name in ("p", "i", "x", "z", "nz", "next", "prev")),
        *((name, ctypes.c_size_t) for name in _SIZES),
        *((name, ctypes.c_void_p) for name in ("super_", "pi", "px", "s")),
        *((name, ctypes.c_int) for name in _FLAGS),
    )


def trailing_block(factor: Module, diagonal: Vector, k: int) -> Matrix | None:
    """Last k rows and columns of L (n, n), a lower triangle, or None if the structure is not the one known.

    `diagonal` (n,) is that of L as cvxopt gives it, the last word on whether the right numbers were read.
    """
    if k == 0:
        return np.zeros((0, 0))
    structure = _structure(factor)
    if structure is None or not _is_known(structure, diagonal.size):
        return None
    block = _read(structure, k)
    if block is None or not np.array_equal(np.diagonal(block), diagonal[diagonal.size - k :]):
        return None
    return block


def _structure(factor: Module) -> _Factor | None:
    python = ctypes.pythonapi
    if not python.PyCapsule_IsValid(ctypes.py_object(factor), ctypes.c_char_p(_NAME)):
        return None
    get = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object, ctypes.c_char_p)(("PyCapsule_GetPointer", python))
    return _Factor.from_address(get(factor, _NAME))


def _is_known(structure: _Factor, n: int) -> bool:
    """Whether sizes and flags are those of a real supernodal factor (n, n) with 64-bit integers."""
    flags = (structure.is_ll, structure.is_super, structure.itype, structure.xtype, structure.dtype)
    sizes = structure.n == n and structure.minor == n and 0 < structure.nsuper <= n
    pointers = (structure.super_, structure.pi, structure.px, structure.s, structure.x)
    return flags == (1, 1, _LONG, _REAL, _DOUBLE) and sizes and all(pointers)


def _read(structure: _Factor, k: int) -> Matrix | None:
    """Supernode j has columns super[j] … super[j+1], rows s[pi[j] : pi[j+1]], values x[px[j] : px[j+1]] by columns."""
    n, count = int(structure.n), int(structure.nsuper)
    starts, row_starts, value_starts = (
        _integers(address, count + 1) for address in (structure.super_, structure.pi, structure.px)
    )
    ends = (int(starts[0]), int(starts[-1]), int(row_starts[-1]), int(value_starts[-1]))
    if ends != (0, n, structure.ssize, structure.xsize):
        return None
    rows = _integers(structure.s, int(structure.ssize))
    values = np.ctypeslib.as_array((ctypes.c_double * int(structure.xsize)).from_address(structure.x))
    block = np.zeros((k, k))
    for j in range(int(np.searchsorted(starts, n - k, side="right")) - 1, count):
        own = rows[row_starts[j] : row_starts[j + 1]] - (n - k)
        columns = np.arange(starts[j], starts[j + 1]) - (n - k)
        part = values[value_starts[j] : value_starts[j] + own.size * columns.size].reshape(own.size, -1, order="F")
        block[np.ix_(own[own >= 0], columns[columns >= 0])] = part[np.ix_(own >= 0, columns >= 0)]
    return np.tril(block)


def _integers(address: int, count: int) -> IntVector:
    array: NDArray[Any] = np.ctypeslib.as_array((ctypes.c_int64 * count).from_address(address))
    return array
