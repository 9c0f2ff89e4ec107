"""Commands of ``python -m comparisons``."""

from typing import Final

import click

from comparisons.benchmark.command import benchmark, benchmark_wall
from comparisons.bounds.command import bounds
from comparisons.convergence.command import convergence_mesh, convergence_outer, convergence_uzawa
from comparisons.exchange.commands import export, import_file
from comparisons.paper.command import paper
from comparisons.peers.command import peers, peers_pin
from comparisons.solvers.command import solvers
from comparisons.verification.command import verify
from comparisons.wild.command import estimates, limits, wild

_NEEDED: Final = {"markdown-it-py": "markdown_it", "pandas": "pandas"}
"""Distributions that every report needs → their modules."""


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.pass_context
def group(context: click.Context) -> None:
    """Experiments that compare methods, solvers and published numbers.

    Each command runs one experiment and writes a report: Markdown, pictures, and one HTML page.
    """
    from importlib.util import find_spec

    from qvi_contact.errors import InputError

    missing = [name for name, module in _NEEDED.items() if find_spec(module) is None]
    if missing and context.invoked_subcommand not in (export.name, import_file.name):
        remedy = f"is missing: python -m pip install {' '.join(missing)}"
        raise InputError("installation", ", ".join(missing), remedy)


for command in (
    paper, benchmark, benchmark_wall, verify, solvers, convergence_mesh, convergence_outer, convergence_uzawa, peers,
    peers_pin, bounds, wild, estimates, limits, export, import_file,
):  # fmt: skip
    group.add_command(command)
