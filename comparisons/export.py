"""The commands ``export`` of ``python -m comparisons``."""

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from qvi_contact.basics.terminal import Group

if TYPE_CHECKING:
    from qvi_contact.files.problem_file import ProblemFile
    from qvi_contact.solution.result import ContactResult

_PROBLEM = click.argument("problem", metavar="PROBLEM")
_FILE = click.argument("file", metavar="FILE")


@click.group(cls=Group)
def export() -> None:
    """Write problems in formats of other programs.

    \b
    qpbenchmark  quadratic programs with the friction bound fixed, as a test set
    fclib        the condensed friction problem (W, q, μ), for Siconos and other contact codes
    npz          the whole algebraic problem as a NumPy archive
    """  # noqa: D301


@export.command(short_help="Quadratic programs as a test set of qpbenchmark.")
@click.argument("folder", metavar="FOLDER")
@click.argument("problems", metavar="[PROBLEM]...", nargs=-1)
def qpbenchmark(folder: str, problems: tuple[str, ...]) -> None:
    """Write a test set that qpbenchmark runs, from problem files or, without any, from standard problems.

    Each contact problem gives up to four quadratic programs: in all unknowns and condensed on the contact, with the
    friction bound of its solution and with that of a body that does not slip.

    \b
    Example:
        python -m comparisons export qpbenchmark results/test_set
        qpbenchmark results/test_set/friction_contact.py --results-path results/test_set/qps.csv run
    """  # noqa: D301
    from comparisons.exchange import quadratic_programs as programs
    from comparisons.lab.studies import progress
    from qvi_contact.basics.writing import writable_folder
    from qvi_contact.errors import InputError
    from qvi_contact.files.problem_file import load_problem

    if not folder:
        raise InputError("FOLDER", folder, "give the name of a folder")
    chosen = {Path(name).stem: load_problem(name).problem for name in problems} or dict(programs.standard_problems())
    if problems and len(chosen) < len(problems):
        raise InputError("PROBLEM", " ".join(problems), "give files of different names")
    target = writable_folder(folder)
    writable_folder(target / "problems")
    with progress("quadratic programs", len(chosen)) as advance:
        written = programs.write_test_set(target, chosen, advance)
    click.echo(f"{len(written)} quadratic programs in {target / 'problems'}; run them by")
    for name in (programs.TEST_SET, programs.SPARSE_TEST_SET):
        click.echo(f"  qpbenchmark {target / name} --results-path {target / Path(name).with_suffix('.csv')} run")


@export.command(short_help="The condensed friction problem and its solution.")
@_PROBLEM
@_FILE
@click.option(
    "--penalty",
    type=float,
    help="Write W, q and μ only: replace equations by springs that are this many times stiffer.",
)
def fclib(problem: str, file: str, penalty: float | None) -> int:
    """Solve PROBLEM and write its condensed friction problem and solution to FILE (.hdf5) in FCLIB's layout.

    Forces and displacements at the contact points are dimensionless. The file says what their units are. Where there
    are more points than degrees of freedom of the tractions, the problem has equations (FCLIB's V, R and s). Siconos
    ignores them: for Siconos give --penalty 1e6, which replaces them with an error of about 1e-6. The output has the
    solution's error as Siconos measures it. If the problem is not solved, the file holds no solution and the exit
    status is 1.

    \b
    Example:
        python -m comparisons export fclib examples/punch.toml punch.hdf5
    """  # noqa: D301
    from comparisons.exchange import local_problem, siconos_error, state_of, write_fclib
    from qvi_contact.errors import InputError

    _check_target(file, ".hdf5")
    if penalty is not None and not 1.0 < penalty < math.inf:
        raise InputError("--penalty", penalty, "give a number above 1")
    source, result = _solved(problem)
    local = local_problem(result.solution.problem)
    if penalty is not None:
        local = local.penalised(penalty)
    solved = result.solution.solved and penalty is None
    state = state_of(local, result.solution) if solved else None
    scales = result.discretization.scales
    units = (
        f"Dimensionless. Units, in those of the problem: force per thickness {scales.stress * scales.length:.17g}, "
        f"displacement {scales.displacement:.17g}, stress {scales.stress:.17g}, length {scales.length:.17g}."
    )
    write_fclib(file, local, state, title=source.title, description=f"{source.description} {units}".strip())
    if state is not None:
        click.echo(f"Siconos error {siconos_error(local, state.r, state.lam):.1e}")
    return _written(file, result)


@export.command(short_help="The algebraic problem and its solution.")
@_PROBLEM
@_FILE
def npz(problem: str, file: str) -> int:
    """Solve PROBLEM and write its algebraic problem and solution to FILE (.npz).

    If the problem is not solved, the solution in the file says why and the exit status is 1.

    \b
    Example:
        python -m comparisons export npz examples/punch.toml punch.npz
    """  # noqa: D301
    from comparisons.exchange import save_qvi

    _check_target(file, ".npz")
    _, result = _solved(problem)
    save_qvi(file, result.solution.problem, result.solution)
    return _written(file, result)


def _check_target(file: str, suffix: str) -> None:
    """Find out before any work is done whether the file can be written; a missing folder is made."""
    from qvi_contact.basics.writing import check_suffix, writable_folder

    check_suffix("FILE", file, suffix)
    writable_folder(Path(file).parent)


def _solved(path: str) -> "tuple[ProblemFile, ContactResult]":
    """The problem file, and its result with the file's own options; of a history the first step."""
    import numpy as np

    from qvi_contact.files.problem_file import load_problem
    from qvi_contact.solution.solver import solve

    source = load_problem(path)
    with source.named_errors(), np.errstate(all="ignore"):
        return source, solve(source.problem, **source.solve_options)


def _written(file: str, result: "ContactResult") -> int:
    click.echo(f"{file}: {result.message}")
    return 0 if result.solution.solved else 1
