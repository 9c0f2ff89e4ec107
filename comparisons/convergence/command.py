"""The commands `convergence-mesh`, `convergence-outer` and `convergence-uzawa`."""

from importlib import import_module

import click

from comparisons.lab.commands import Experiment, Plan, experiment


def _command(name: str, short_help: str, about: str) -> Experiment:
    """The command of the study in the module of that name."""

    def plan(quick: bool) -> Plan:
        module = import_module(f"comparisons.convergence.{name}")
        return Plan([module.study(quick)], module.report)

    plan.__name__ = f"convergence_{name}"
    plan.__doc__ = f"{about}\n\n\b\nExample:\n    python -m comparisons convergence-{name} --quick"
    quick_option = click.option("--quick", is_flag=True, help="Few and small cases.")
    return experiment(timeout=600.0, short_help=short_help)(quick_option(plan))


convergence_mesh = _command(
    "mesh", "How answers converge with the mesh.",
    "Measure errors of forces and energies on uniform, graded and adaptive meshes, for several degrees.",
)  # fmt: skip
convergence_outer = _command(
    "outer", "How loops over the friction bound converge.",
    "Measure iterations over the friction bound against μ: plain, damped, Anderson's, and the condensed method.",
)  # fmt: skip
convergence_uzawa = _command(
    "uzawa", "How the paper's iteration converges.",
    "Measure the paper's iteration: which steps are stable, and how many iterations it needs.",
)  # fmt: skip
