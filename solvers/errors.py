"""The project's exception tree.

`QVIError` is the root of everything the project raises on purpose; the mechanics package adds no second root.
"""

import pickle
from typing import Any


class QVIError(Exception):
    """Root of the project's exceptions: catch this one to catch them all."""


class InputError(QVIError, ValueError):
    """Something the caller gave is wrong.

    The message is one line: the field, the value found there, and what to do about it.

    Attributes
    ----------
    field : str
        Name of the offending argument or file entry, e.g. ``"Contact.friction"``.
    value : object
        The value found.
    remedy : str
        A sentence telling what to give instead.

    """

    def __init__(self, field: str, value: object, remedy: str) -> None:
        self.field = field
        self.value = value
        self.remedy = remedy
        super().__init__(f"{field}: {_shorten(value)}: {remedy}")

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickles, as worker processes send it; a value that cannot be pickled goes along as text."""
        value = self.value
        try:
            pickle.dumps(value)
        except Exception:  # whatever the value's own code raises
            value = _shorten(value)
        return type(self), (self.field, value, self.remedy), {"args": self.args}


class UnknownNameError(InputError, KeyError):
    """A name that nothing has: the message lists the names there are, and the one that was probably meant."""

    __str__ = Exception.__str__  # KeyError's is the repr


class SolverUnavailableError(InputError):
    """A solver was asked for that is unknown or not installed; the message lists what is."""


class SolveError(QVIError):
    """Raised on request (``throw=True``) when a solve ends without a certified answer."""


def plain(value: object) -> str:
    """`repr` with plain numbers: 0.2, not np.float64(0.2), also inside lists, tuples and objects."""
    import numpy as np  # errors are raised before it is needed

    if np.lib.NumpyVersion(np.__version__) < "2.0.0":
        return repr(value)
    with np.printoptions(legacy="1.25"):
        return repr(value)


def _shorten(value: object) -> str:
    """`plain` on one line, in at most 120 characters: of a path its end says more than its middle."""
    text = " ".join(plain(value).split())
    return text if len(text) <= 120 else f"{text[:59]}…{text[-59:]}"
