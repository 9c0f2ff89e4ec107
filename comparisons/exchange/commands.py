"""Commands ``export`` and ``import`` of ``python -m comparisons``."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from qvi_contact.basics.terminal import Command, Group

if TYPE_CHECKING:
    from comparisons.exchange import ContactState, LocalProblem
    from qvi_contact.files.problem_file import ProblemFile
    from qvi_contact.result import ContactResult
    from solvers import Certificate

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
    ignores them: for Siconos give --penalty 1e6, which replaces them with an error of about 1e-6. If the problem is not
    solved, the file holds no solution and the exit status is 1.

    \b
    Example:
        python -m comparisons export fclib examples/punch.toml punch.hdf5
    """  # noqa: D301
    from comparisons.exchange import local_problem, state_of, write_fclib
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


@click.command("import", cls=Command, short_help="Solve a problem in another program's format.")
@_FILE
@click.option("--method", help="Outer method, see: qvi-contact methods")
@click.option("--inner", help="Inner solver of the fixed point, see: qvi-contact methods")
@click.option("--tolerance", type=float, help="Accuracy that the certificate must confirm.  [default: 1e-8]")
def import_file(file: str, **given: Any) -> int:
    """Solve the problem in FILE, and check the solution that FILE holds.

    FILE is an archive of "export npz" or a plane FCLIB problem. The output has the status, the certificate, and
    Siconos' error in the file's units and in dimensionless numbers. The exit status is 0 if the problem is solved, 1 if
    not, and 2 if the file is wrong.

    \b
    Example:
        python -m comparisons import punch.hdf5
    """  # noqa: D301
    import numpy as np

    from comparisons.exchange import load_qvi, local_problem, read_fclib, siconos_error, solve_local, state_of
    from solvers import InputError, solve_qvi

    options = {name: value for name, value in given.items() if value is not None}
    states: list[tuple[str, ContactState | None, Certificate]] = []
    problem: LocalProblem | None = None
    note = ""
    with np.errstate(all="ignore"):  # what overflows fails its certificate
        if Path(file).suffix.lower() == ".npz":
            qvi, known = load_qvi(file)
            kind, sizes = "NumPy archive", (qvi.m, qvi.n, qvi.p)
            try:
                problem = local_problem(qvi)
            except InputError as error:
                note = f"  no Siconos error: {error.field} has no place in FCLIB\n"
            solution = solve_qvi(qvi, **options)
            for label, each in (("solution", known), ("solved here", solution)):
                if each is not None:
                    state = None if problem is None else state_of(problem, each)
                    states.append((label, state, each.certificate))
        else:
            held = read_fclib(file)
            problem, kind = held.problem, f"FCLIB, “{held.title}”" if held.title else "FCLIB"
            sizes = (problem.contacts, len(problem.q), len(problem.s))
            if held.solution is not None:
                certificate = problem.certify(held.solution, options.get("tolerance", 1e-8))
                states.append(("solution", held.solution, certificate))
            state, solution = solve_local(problem, **options)
            states.append(("solved here", state, solution.certificate))
        points, unknowns, equations = sizes
        click.echo(f"{file}: {kind}, {points} contact points, {unknowns} unknowns, {equations} equations")
        for label, state, certificate in states:
            click.echo(f"  {label}: {certificate.summary()}")
            if problem is not None and state is not None:
                own, (_, r, lam) = problem.dimensionless(state)
                given_units, scaled = siconos_error(problem, state.r, state.lam), siconos_error(own, r, lam)
                click.echo(f"    Siconos error {given_units:.1e}, {scaled:.1e} with dimensionless u and r")
    click.echo(f"{note}status: {solution.message}")
    return 0 if solution.solved else 1


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
