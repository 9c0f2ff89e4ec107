"""A small report with everything that reports can have, for the tests of its files."""

from comparisons.lab.report import environment_grids, fill
from comparisons.lab.report.drawing import drawn
from comparisons.lab.study.rows import Row
from comparisons.lab.tables import Grid
from qvi_contact.plots.style import new_figure

MACHINE = {
    "processor": "P1", "cores": 4, "memory_bytes": 2**34, "system": "Linux, x86_64", "python": "CPython 3.12.1",
}  # fmt: skip

TIMES = Grid(
    "Times",
    ("back end", "median\ntime", "stationarity [-]", "certi-\nfied", "status", "reason"),
    [
        ("qp:clarabel", "12.3 ms", "1.2e-05", "12 %", "done", "-"),
        ("qp:osqp", "1.2 s", "< 1e-9", "> 99 %", "done", "-"),
        ("qp:scs", "340 µs", "3.0e-02", "5 %", "timeout", f"ended after 60 s | with `ValueError`{9 * ', a sentence'}"),
        ("qp:daqp", "none", "n/a", "100 %", "done", "-"),
        ("qp:piqp", "2 min", "−1.0e-3", "0 %", "error", "-"),
    ],
)  # fmt: skip


def picture(name):
    """A picture with clip paths, markers and mathematical text."""

    def draw():
        figure = new_figure(6.0, 3.0)
        axes = figure.subplots()
        axes.semilogy([0.0, 1.0, 2.0], [1e-3, 1e-2, 1e-1], marker="o", label=name)
        axes.set_xlabel("time [s]")
        axes.legend()
        return figure

    return drawn(name, draw)


def row(position=0, status="done", load=0.5, seed=7, **environment):
    """A stored row; more of its environment by keyword."""
    known = {"machine": MACHINE, "versions": {"numpy": "2.0.0"}, "threads": 1, "timeout_seconds": 60.0}
    case = {"repeat": 0, "seed": seed}
    environment = known | {"memory_mib": None} | environment
    return Row(position, "0", case, status, "", {}, None, 0.1, "2026-01-01", load, environment)


TEMPLATE = """
# Solvers compared

By `python -m comparisons solvers`.

## Findings

1. *Clarabel* takes {{ fastest | seconds }} ([table](#times)).
2. Nobody lies ([table](#lies)).

## Times

{{ figure("a", "Figure of a") }}

{{ table("times") }}

Rows whose status is not `done` failed.

## Lies

{{ table("lies") }}

{{ figure("b", "Figure of b") }}

<details>
<summary>All of them</summary>

{{ table("many") }}

</details>

## Settings

{{ settings }}

## Limits

{% for limit in limits %}
- {{ limit }}
{% endfor %}
"""


def sample(svg=picture, template=TEMPLATE, times=TIMES, **values):
    """The report; values are replaced by name."""
    many = Grid("", ("case", "μ"), [(f"plate-{i}", f"{i / 10:g}") for i in range(40)])
    tables = {"times": times, "many": many, "lies": Grid("", ("back end", "times"), [])}
    known = {"fastest": 0.0123, "limits": ["One thread."]} | values
    figures = {name: svg(name) for name in "ab"}
    return fill(template, "sample", known, tables, figures, environment_grids([row(0), row(1, "timeout")]))
