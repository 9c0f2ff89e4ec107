"""The numbers of the report's sentences."""

from typing import Any

from comparisons.benchmark.reference import ACCURACY_TARGETS, GROWTH_SPAN, GROWTH_TARGET
from comparisons.benchmark.tables import target
from comparisons.lab.report.numbers import span

Document = dict[str, Any]


def values_of(document: Document) -> dict[str, Any]:
    """Name → number or text."""
    problems = [*document["solves"], *document["graded"]]
    return {
        "command": document["command"], "tolerance": document["tolerance"], "growth_target": GROWTH_TARGET,
        "growth_span": GROWTH_SPAN, "problems": len(problems),
        "solved": sum(row["status"] == "solved" for row in problems), "largest": _largest(document),
        "loops": _loops(document), "growth": _growth(document), "targets": _targets(document),
        "graded_targets": [target(each) for each in document["graded_targets"]],
    }  # fmt: skip


def _hundredth(value: float) -> str:
    return f"{value:.2f}"


def _largest(document: Document) -> list[dict[str, Any]]:
    """For each path the time of solves on the largest mesh over the fastest plain factorisation."""
    cells = max((row["cells"] for row in document["solves"]), default=0)
    found = []
    for path in dict.fromkeys(row["path"] for row in document["solves"]):
        rows = [row for row in document["solves"] if (row["cells"], row["path"]) == (cells, path)]
        rows = [row for row in rows if row["ratio_fastest"] is not None]
        if rows:
            ratios = span([row["ratio_fastest"] for row in rows], _hundredth)
            found.append({"cells": cells, "ratios": ratios, **{name: rows[0][name] for name in ("library", "fastest")}})
    return found


def _loops(document: Document) -> list[dict[str, Any]]:
    """For each loop the largest mesh that it finishes; without a ratio if there is none."""
    found = []
    for name in dict.fromkeys(row["name"] for row in document["loops"]):
        rows = [row for row in document["loops"] if row["name"] == name]
        shown = [row for row in rows if row["ratio"] is not None] or rows
        row = shown[-1] if shown is not rows else rows[0]
        found.append({name: row[name] for name in ("name", "cells", "ratio", "status")})
    return found


def _growth(document: Document) -> list[dict[str, Any]]:
    """For each path the exponents over the target's span."""
    found = []
    for path in dict.fromkeys(row["path"] for row in document["growth"]):
        rows = [row for row in document["growth"] if (row["path"], row["from"], row["to"]) == (path, *GROWTH_SPAN)]
        powers = [row["solve"] for row in rows if row["solve"] is not None]
        if powers:
            met = max(powers) <= GROWTH_TARGET
            found.append({"path": path, "powers": span(powers, _hundredth), "met": met})
    return found


def _targets(document: Document) -> list[dict[str, Any]]:
    """For each μ the accuracy targets that some graded mesh meets, and those that none does."""
    found = []
    for mu in dict.fromkeys(row["friction"] for row in document["graded"]):
        met = [each for row in document["graded"] if row["friction"] == mu for each in row["meets"]]
        asked = [{"error": error, "seconds": seconds} for error, seconds in ACCURACY_TARGETS]
        sides = {"met": [target(each) for each in asked if each in met],
                 "missed": [target(each) for each in asked if each not in met]}  # fmt: skip
        found.append({"friction": mu, **sides})
    return found
