"""Tables of a run."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from comparisons.benchmark.reference import MEANINGLESS
from comparisons.lab.report.numbers import NOTHING, listing, memory, percent, scientific, seconds, significant
from comparisons.lab.tables import Grid, grid_of

Document = dict[str, Any]
Form = Callable[[Any], str]


def known(form: str) -> Form:
    """A number in this format, where there is one."""
    return lambda value: NOTHING if value is None or value != value else format(value, form)


def _cells(value: Any) -> str:
    return NOTHING if value is None or value != value else f"{int(value)}²"


def error(value: Any) -> str:
    """An error of P/2; one below what displacement codes agree to means nothing."""
    return f"< {scientific(MEANINGLESS, 1)}" if value is not None and value < MEANINGLESS else scientific(value)


COUNT: Final = known(".0f")
"""A whole number."""

_FORMS: Final[Mapping[str, Form]] = {
    **dict.fromkeys(("cells", "from", "to"), _cells), "friction": known("g"), "grading": known("g"),
    **dict.fromkeys(("unknowns", "iterations", "corrections"), COUNT),
    **dict.fromkeys(("assembly", "factorisation", "interior_point", "certificate", "rest"), seconds),
    **dict.fromkeys(("analysis", "numeric", "plain", "whole", "reported"), seconds),
    **dict.fromkeys(("ratio_own", "ratio_fastest"), known(".2f")), "solve_spread": percent,
    "half_force": known(".8f"), "accuracy": scientific, "peak": memory, "imports": memory,
    **dict.fromkeys(("half_force_error", "half_force_difference"), scientific), "more": COUNT,
    "ratio": lambda value: significant(value, 4), "error": error,
}  # fmt: skip


def tables_of(document: Document) -> dict[str, Grid]:
    """The tables by name."""
    solves, powers = document["solves"], dict.fromkeys(_POWERS, known(".2f"))
    memories = [{**row, "more": _more(row)} for row in document["memory"]]
    graded = [
        {**row, "runs": len(row["seconds"]), "met": listing([target(each) for each in row["meets"]])}
        for row in document["graded"]
    ]
    peers = [{**row, "reported": row["seconds"]} for row in document["peers"]]
    five, time = {"half_force": known(".5f")}, {"solve": seconds}
    return {
        "times-table": grid(solves, _TIMES, time), "answers": grid(solves, _ANSWERS),
        "plain": grid(document["plain"], _PLAIN), "memory": grid(memories, _MEMORY),
        "growth": grid(document["growth"], _GROWTH | _POWERS, powers), "loops": grid(document["loops"], _LOOPS, time),
        "graded": grid(graded, _GRADED, five), "peers": grid(peers, _PEERS, five),
    }  # fmt: skip


_TIMES: Final = {
    "cells": "cells", "path": "path", "friction": "μ", "assembly": "assembly", "solve": "solve",
    "solve_spread": "spread", "factorisation": "factorisation", "interior_point": "interior point",
    "certificate": "certificate", "rest": "rest", "ratio_own": "solve over own", "ratio_fastest": "over fastest",
    "fastest": "fastest", "repetitions": "runs",
}  # fmt: skip
_ANSWERS: Final = {
    "cells": "cells", "path": "path", "friction": "μ", "unknowns": "unknowns", "status": "status",
    "iterations": "iterations", "corrections": "corrections", "half_force": "P/2 [N/mm]",
    "half_force_error": "error of P/2", "accuracy": "residual",
}  # fmt: skip
_PLAIN: Final = {
    "cells": "cells", "path": "beside", "backend": "library", "version": "version", "analysis": "analysis",
    "numeric": "numeric", "plain": "together", "repetitions": "runs", "message": "remark",
}  # fmt: skip
_MEMORY: Final = {
    "cells": "cells", "path": "path", "peak": "peak", "imports": "before", "more": "more, by unknown [bytes]",
}  # fmt: skip
_GROWTH: Final = {"path": "path", "friction": "μ", "from": "from", "to": "to"}
_POWERS: Final = {
    "solve": "solve", "whole": "with assembly", "own_factorisation": "own factorisation",
    "fastest_factorisation": "fastest factorisation",
}  # fmt: skip
_LOOPS: Final = {
    "cells": "cells", "name": "method", "friction": "μ", "status": "status", "iterations": "iterations",
    "solve": "solve", "ratio": "over condensed", "half_force_difference": "difference in P", "message": "remark",
}  # fmt: skip
_GRADED: Final = {
    "cells": "cells", "grading": "grading", "friction": "μ", "unknowns": "unknowns", "status": "status",
    "half_force": "P/2 [N/mm]", "error": "error", "whole": "time", "runs": "runs", "met": "meets",
}  # fmt: skip
_PEERS: Final = {
    "code": "code", "cells": "cells", "half_force": "P/2 [N/mm]", "error": "error", "reported": "reported time",
}  # fmt: skip


def grid(
    rows: Sequence[Mapping[str, Any]], headings: Mapping[str, str], more: Mapping[str, Form] | None = None
) -> Grid:
    """Rows as a table, in the formats that columns of this name have, or in those that are given."""
    from pandas import DataFrame

    frame = DataFrame(rows, columns=list(headings))
    forms = dict.fromkeys(headings, _text) | dict(_FORMS) | dict(more or {})
    return grid_of(frame, headings, forms)


def _text(value: Any) -> str:
    return NOTHING if value is None or value != value else str(value)


def target(found: Mapping[str, float]) -> str:
    """A target of accuracy in words."""
    return f"{scientific(found['error'], 1)} in {seconds(found['seconds'])}"


def _more(row: Mapping[str, Any]) -> float | None:
    """Bytes by unknown that a solve takes."""
    if row["peak"] is None or row["imports"] is None:
        return None
    return float((row["peak"] - row["imports"]) / row["unknowns"])
