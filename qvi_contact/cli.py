"""The command `qvi-contact`."""

import click

from qvi_contact.terminal import run


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(package_name="qvi-contact")
def group() -> None:
    """Frictional contact computed from the stress side.

    An elastic body is described by an Airy stress function, so every computed stress is in equilibrium; contact with
    Coulomb friction becomes a sequence of convex programs, and every answer carries a certificate.

    \b
    Start with the paper the method comes from:
        python -m comparisons paper
    """  # noqa: D301  # click wants the character \b, not the two


@group.command()
@click.option("--json", "as_json", is_flag=True, help="One JSON document on standard output instead of a list.")
def methods(as_json: bool) -> None:
    """List the methods and inner solvers that can be used here.

    Inner solvers are names for the argument `inner` of qvi_contact.solve: "qp:…" are quadratic programs through
    qpsolvers, "direct:…" solvers kept alive between outer iterations, "socp:…" second-order cone programs through
    cvxpy. More back ends come with: python -m pip install 'qvi-contact[solvers]'
    """
    import json

    from solvers import available
    from solvers.solve import METHODS

    if as_json:
        click.echo(json.dumps({"methods": list(METHODS), "inner": list(available())}, indent=2))
        return
    click.echo("methods\n  " + "\n  ".join(METHODS) + "\ninner solvers\n  " + "\n  ".join(available()))


def main() -> None:
    """Entry point."""
    run(group, "qvi-contact")
