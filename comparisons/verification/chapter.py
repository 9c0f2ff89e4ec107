"""A chapter of the manual: problems that show the same thing."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from comparisons.verification.row import Row

Problem = Callable[[bool], Iterator[Row]]
"""A problem of the manual yields its rows, given True from coarse meshes and few cases. Its docstring is printed."""


@dataclass(frozen=True)
class Chapter:
    """Problems of one kind.

    Attributes
    ----------
    name : str
        Name on the command line.
    title : str
        Heading.
    shows : str
        What it shows, a sentence.
    reading : str
        How to read its rows, a sentence.
    failure : str
        What counts as failure, a sentence.
    problems : mapping
        Name of each problem on the command line, and its function.

    """

    name: str
    title: str
    shows: str
    reading: str
    failure: str
    problems: Mapping[str, Problem]


def sentence(problem: Problem) -> str:
    """What a problem is: the first paragraph of its docstring, on one line."""
    return " ".join((problem.__doc__ or "").strip().split("\n\n")[0].split())
