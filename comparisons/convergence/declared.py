"""Studies whose cases are listed, as the product of factors that a study is declared by."""

from collections.abc import Mapping, Sequence
from typing import Any

from comparisons.lab.study import Study

Case = Mapping[str, Any]


def listed(name: str, version: int, task: str, cases: Sequence[Case]) -> Study:
    """The study of just these cases, all with the same factors.

    Values of a factor stand in the order they are met. One may be a tuple, which a study keeps as a list.
    """
    names = tuple(cases[0])
    kept = {_key(case, names) for case in cases}
    factors = {factor: tuple(dict.fromkeys(case[factor] for case in cases)) for factor in names}
    return Study(name, version, task, factors, keep=lambda case: _key(case, names) in kept)


def _key(case: Case, names: tuple[str, ...]) -> tuple[Any, ...]:
    """The values, lists as tuples."""
    return tuple(tuple(value) if isinstance(value := case[name], list) else value for name in names)
