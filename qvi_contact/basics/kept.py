"""What is made once for several uses, within bounds."""

from collections.abc import Callable, Hashable
from threading import Lock
from typing import Any, Final, TypeVar

import numpy as np

_Made = TypeVar("_Made")

_MOST: Final = 4  # of one kind


def read_only(*matrices: Any) -> None:
    """Arrays and sparse matrices that several problems share cannot be written to any more."""
    for matrix in matrices:
        if not isinstance(matrix, np.ndarray):
            matrix.sum_duplicates()  # which sorts entries too: SciPy would do so in place when it likes
        for part in (matrix,) if isinstance(matrix, np.ndarray) else (matrix.data, matrix.indices, matrix.indptr):
            part.flags.writeable = False


class Kept:
    """The latest objects that were made of something, of each kind a few.

    What is kept must not refer to its owner: memory, such as that of a large factorisation, is then freed at once with
    the owner, and not when the garbage is collected next.
    """

    def __init__(self) -> None:
        self._found: dict[type, dict[Hashable, Any]] = {}
        self._lock = Lock()

    def __call__(self, kind: type[_Made], key: Hashable, make: Callable[[], _Made]) -> _Made:
        """The object of a kind for a key, made if there is none; several threads get the same."""
        with self._lock:
            known = self._found.setdefault(kind, {})
            if key in known:
                known[key] = known.pop(key)  # the latest comes last
                return known[key]  # type: ignore[no-any-return]  # of its kind
        made = make()
        with self._lock:
            made = known.setdefault(key, made)
            if len(known) > _MOST:
                del known[next(iter(known))]
        return made
