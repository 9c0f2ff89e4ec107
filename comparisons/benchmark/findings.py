"""What the numbers of a run say, in sentences computed from them."""

from collections.abc import Iterator
from typing import Any

from comparisons.benchmark.reference import ACCURACY_TARGETS, GROWTH_SPAN, GROWTH_TARGET

Document = dict[str, Any]


def findings(document: Document) -> list[str]:
    """The sentences."""
    return [*_failures(document), *_largest(document), *_loops(document), *_growth(document), *_accuracy(document)]


def _failures(document: Document) -> Iterator[str]:
    """How many solves are certified."""
    rows = [*document["solves"], *document["graded"]]
    solved = sum(row["status"] == "solved" for row in rows)
    yield f"{solved} of {len(rows)} problems are solved with a certificate of {document['tolerance']:.0e}."


def _largest(document: Document) -> Iterator[str]:
    """Ratios on the largest mesh."""
    cells = max((row["cells"] for row in document["solves"]), default=0)
    for path in dict.fromkeys(row["path"] for row in document["solves"]):
        rows = [row for row in document["solves"] if (row["cells"], row["path"]) == (cells, path)]
        found = [row for row in rows if row["ratio_fastest"] is not None]
        if found:
            low, high = (end(row["ratio_fastest"] for row in found) for end in (min, max))
            yield (
                f"On {cells}² cells a whole Coulomb solve ({found[0]['library']}) takes {_range(low, high)} "
                f"times one plain factorisation of the same matrix by {found[0]['fastest']}."
            )


def _range(low: float, high: float) -> str:
    """Both ends, or one where they look alike."""
    return " to ".join(dict.fromkeys((f"{low:.2f}", f"{high:.2f}")))


def _loops(document: Document) -> Iterator[str]:
    """The naive loops on the largest mesh that they finish."""
    for name in dict.fromkeys(row["name"] for row in document["loops"]):
        rows = [row for row in document["loops"] if row["name"] == name]
        solved = [row for row in rows if row["ratio"] is not None]
        if solved:
            row = solved[-1]
            times, cells = f"{row['ratio']:.0f} times", f"{row['cells']}² cells"
            yield f"{name}: {times} the condensed method's time on {cells} ({row['status']})."
        else:
            yield f"{name}: solved on none of the meshes ({rows[0]['status'].replace('_', ' ')})."


def _growth(document: Document) -> Iterator[str]:
    """The exponent over the target's span."""
    for path in dict.fromkeys(row["path"] for row in document["growth"]):
        found = [
            row["solve"]
            for row in document["growth"]
            if row["path"] == path and (row["from"], row["to"]) == GROWTH_SPAN and row["solve"] is not None
        ]
        if found:
            verdict = "met" if max(found) <= GROWTH_TARGET else "missed"
            yield (
                f"From {GROWTH_SPAN[0]}² to {GROWTH_SPAN[1]}² cells the time of the {path} solve grows with unknowns "
                f"to the power of {_range(min(found), max(found))} (target ≤ {GROWTH_TARGET}: {verdict})."
            )


def _accuracy(document: Document) -> Iterator[str]:
    """The accuracy targets at each friction."""
    for mu in dict.fromkeys(row["friction"] for row in document["graded"]):
        rows = [row for row in document["graded"] if row["friction"] == mu]
        words = []
        for error, seconds in ACCURACY_TARGETS:
            met = any({"error": error, "seconds": seconds} in row["meets"] for row in rows)
            words.append(f"{error:.0e} in {1e3 * seconds:.0f} ms {'met' if met else 'missed'}")
        yield f"Targets at μ = {mu:g}: {', '.join(words)}."
