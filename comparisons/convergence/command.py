"""The commands `convergence-mesh`, `convergence-outer` and `convergence-uzawa`."""

import click

from comparisons.lab.commands import Plan, experiment

quick_option = click.option("--quick", is_flag=True, help="Few and small cases.")


@experiment(timeout=600.0, short_help="How answers converge with the mesh.")
@quick_option
def convergence_mesh(quick: bool) -> Plan:
    """Measure errors of forces and energies on uniform, graded and adaptive meshes, for several degrees.

    \b
    Example:
        python -m comparisons convergence-mesh --quick
    """  # noqa: D301
    from comparisons.convergence.mesh import report, study

    return Plan([study.study(quick)], report.report)


@experiment(timeout=600.0, short_help="How loops over the friction bound converge.")
@quick_option
def convergence_outer(quick: bool) -> Plan:
    """Measure iterations over the friction bound against μ: plain, damped, Anderson's, and the condensed method.

    \b
    Example:
        python -m comparisons convergence-outer --quick
    """  # noqa: D301
    from comparisons.convergence.outer import report, study

    return Plan([study.study(quick)], report.report)


@experiment(timeout=600.0, short_help="How the paper's iteration converges.")
@quick_option
def convergence_uzawa(quick: bool) -> Plan:
    """Measure the paper's iteration: which steps are stable, and how many iterations it needs.

    \b
    Example:
        python -m comparisons convergence-uzawa --quick
    """  # noqa: D301
    from comparisons.convergence.uzawa import report, study

    return Plan([study.study(quick)], report.report)
