"""Commands of ``python -m comparisons``."""

import click

from comparisons.benchmark.command import benchmark
from comparisons.convergence.command import convergence
from comparisons.exchange.commands import export, import_file
from comparisons.paper.command import paper
from comparisons.peers.command import peers
from comparisons.solvers.command import solvers
from comparisons.verification.command import verify
from comparisons.wild.command import wild


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
def group() -> None:
    """Experiments that compare methods, solvers and published numbers."""


for command in (paper, benchmark, verify, solvers, convergence, peers, wild, export, import_file):
    group.add_command(command)
