"""All chapters of the manual, in its order, and the choice among them by name."""

from collections.abc import Sequence
from typing import Final

from comparisons.verification import (
    benchmarks,
    bounds,
    curves,
    energies,
    exact_states,
    examples,
    invariance,
    limits,
    manufactured,
    not_unique,
    paper,
    plate,
    ssnv128,
    strict,
)
from comparisons.verification.row import Chapters
from qvi_contact.errors import InputError

CHAPTERS: Final[Chapters] = {
    "paper": paper.PROBLEMS,
    "exact": exact_states.PROBLEMS,
    "friction": manufactured.PROBLEMS,
    "ssnv128": ssnv128.PROBLEMS,
    "benchmarks": benchmarks.PROBLEMS,
    "curves": curves.PROBLEMS,
    "limits": limits.PROBLEMS,
    "not-unique": not_unique.PROBLEMS,
    "invariance": invariance.PROBLEMS,
    "plate": plate.PROBLEMS,
    "energies": energies.PROBLEMS,
    "bounds": bounds.PROBLEMS,
    "strict": strict.PROBLEMS,
    "examples": examples.PROBLEMS,
}


def choose(names: Sequence[str], chapters: Chapters = CHAPTERS) -> Chapters:
    """The chapters with the problems of these names, in the manual's order; all if there are no names.

    Parameters
    ----------
    names : sequence of str
        Names of chapters or of problems.
    chapters : mapping
        What to choose from.

    Raises
    ------
    InputError
        If a name is unknown.

    """
    known = [*chapters, *(name for problems in chapters.values() for name in problems)]
    for name in names:
        if name not in known:
            raise InputError("--only", name, f"choose from {', '.join(known)}")
    if not names:
        return chapters
    chosen = {
        chapter: {name: problem for name, problem in problems.items() if {chapter, name} & set(names)}
        for chapter, problems in chapters.items()
    }
    return {chapter: problems for chapter, problems in chosen.items() if problems}
