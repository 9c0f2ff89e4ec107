"""Studies whose cases are listed, as the product of factors that a study is declared by."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

Case = Mapping[str, Any]


def factors_of(cases: Sequence[Case]) -> dict[str, tuple[Any, ...]]:
    """Factor → its values in the cases, each once, in the order they are met; all cases have the same factors.

    A value may be a tuple, which a study keeps as a list.
    """
    return {name: tuple(dict.fromkeys(case[name] for case in cases)) for name in cases[0]}


def among(cases: Sequence[Case]) -> Callable[[Case], bool]:
    """The predicate `Study.keep` that leaves just these cases of the product of `factors_of`."""
    names = tuple(cases[0])
    kept = {_key(case, names) for case in cases}
    return lambda case: _key(case, names) in kept


def _key(case: Case, names: tuple[str, ...]) -> tuple[Any, ...]:
    """The values, lists as tuples."""
    return tuple(tuple(value) if isinstance(value := case[name], list) else value for name in names)
