"""Commands of ``python -m comparisons``: a function each, which imports what it runs.

The function of an experiment returns a `Plan`. Its name is that of the command and of the report.
"""

import math
import os
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from comparisons.lab.commands import COUNT, Experiment, FiniteRange, ListCommand, Plan, experiment, folder_option
from comparisons.peers import LEVELS
from qvi_contact.basics.terminal import Command, Group
from qvi_contact.errors import InputError

if TYPE_CHECKING:
    from qvi_contact.files.problem_file import ProblemFile
    from qvi_contact.solution.result import ContactResult

_NEEDED: Final = {"markdown-it-py": "markdown_it", "matplotlib": "matplotlib", "pandas": "pandas"}
"""Packages that every report needs → their modules."""


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.pass_context
def group(context: click.Context) -> None:
    """Experiments that compare methods, solvers and published numbers.

    Each command runs one experiment and writes a report: Markdown, pictures, and one HTML page.
    """
    missing = [name for name, module in _NEEDED.items() if find_spec(module) is None]
    if missing and context.invoked_subcommand != "export":
        remedy = f"is missing: python -m pip install {' '.join(missing)}"
        raise InputError("installation", ", ".join(missing), remedy)


@click.command(cls=Command, short_help="The paper's Table 1 and Figures 2-5, and the solution.")
@click.option("--out", metavar="FOLDER", default="results/paper", callback=folder_option, show_default=True,
              help="Folder for the report, its pictures, and tables as CSV.")  # fmt: skip
def paper(out: Path) -> None:
    """Recompute Table 1 and Figures 2-5 of Więckowski (1992), and compare them with the converged solution.

    The seven problems are solved by the paper's Uzawa iteration, for its 30 iterations and to convergence, by the fixed
    point with quadratic and with second-order cone programs, and by every installed solver.
    """
    from comparisons.lab.studies import progress
    from comparisons.paper import study
    from qvi_contact.basics.writing import writable_folder

    folder = writable_folder(out, "--out")
    with progress("paper", study.step_count()) as advance:
        result = study.run(advance)
    made, written = study.write(result, folder)
    made.show(written)


@experiment(short_help="Time of a whole solve beside that of one factorisation.")
@click.option("--cells", type=COUNT, multiple=True, default=(8, 16, 32, 64), show_default=True,
              help="Cells along a side; may take several numbers.")  # fmt: skip
@click.option("--friction", type=FiniteRange(0.0), multiple=True, default=(0.1, 0.2, 0.5), show_default=True,
              help="Coefficients of friction; may take several numbers.")  # fmt: skip
@click.option("--factorisation", metavar="NAME", default="auto", show_default=True,
              help="Factorisation to measure, see: qvi-contact methods")  # fmt: skip
def benchmark(cells: tuple[int, ...], friction: tuple[float, ...], factorisation: str) -> Plan:
    """Compare the time of a whole solve with Coulomb friction with one factorisation of the same matrix.

    The problems are the paper's compressed plate on n × n equal cells, cut into triangles, and histories and sweeps,
    whose problems share a factorisation. The report has time, iterations, peak memory and accuracy, and their growth
    with n. `comparisons solvers` compares other methods.

    \b
    Examples:
        python -m comparisons benchmark --cells 32 64 --friction 0.2
        python -m comparisons benchmark --threads 4 --store results/four.sqlite --out results/four
    """  # noqa: D301
    from comparisons.benchmark import report, study

    return Plan([study.whole(cells, friction, factorisation), study.sequences(max(cells) < 32)], report.report)


@experiment(timeout=400.0, short_help="How the time of walls of many blocks grows.")
@click.option("--blocks", type=COUNT, multiple=True, default=(8, 16, 32), show_default=True,
              help="Blocks along a side of a wall; may take several numbers.")  # fmt: skip
@click.option("--load", type=FiniteRange(0.0), multiple=True, default=(0.02, 0.3, 0.45), show_default=True,
              help="Load of a wall from the side, over its weight; may take several numbers.")  # fmt: skip
def benchmark_wall(blocks: tuple[int, ...], load: tuple[float, ...]) -> Plan:
    """Measure the time to solve walls of n × n blocks with dry joints between their courses, pushed from the side.

    Times are CPU seconds. A wall that is pushed by 0.02 of its weight sticks, by 0.3 it opens and slips, by 0.45 it is
    close to its limit.

    \b
    Example:
        python -m comparisons benchmark-wall --blocks 8 16
    """  # noqa: D301
    from comparisons.benchmark import report, study

    return Plan([study.walls(blocks, load)], report.wall_report)


@click.command(cls=ListCommand, short_help="The verification manual: numbers beside known ones.")
@click.option("--out", metavar="FOLDER", callback=folder_option, help="Folder for Markdown, HTML page and picture.")
@click.option("--only", metavar="NAME…", multiple=True, help="Chapters or problems to run, such as ssnv128.")
@click.option("--quick", is_flag=True, help="Coarse meshes and few cases of every problem.")
@click.option("-v", "--verbose", is_flag=True, help="Print the table of the chapters too.")
def verify(out: Path | None, only: tuple[str, ...], quick: bool, verbose: bool) -> int:
    """Compare numbers of this package with known ones, row by row: the verification manual.

    References are closed forms, equilibrium, printed numbers, other codes, and other methods of this package. The exit
    status is 0 if every row passed, 1 if not.

    \b
    Examples:
        python -m comparisons verify --out comparisons/reports/verification
        python -m comparisons verify --only ssnv128 limits --quick
    """  # noqa: D301
    from comparisons.lab.studies import progress
    from comparisons.verification import report as manual
    from qvi_contact.basics.writing import writable_folder

    chapters = manual.choose(only)
    folder = None if out is None else writable_folder(out, "--out")
    # first, so that a picture that fails does not lose computed rows
    drawings = manual.drawings([name for problems in chapters.values() for name in problems]) if folder else {}
    with progress("verify", sum(map(len, chapters.values()))) as advance:
        done = manual.run(chapters, quick, advance)
    report = manual.report(done, drawings, quick, only)
    report.show(report.write(folder) if folder else [], tables=verbose)
    return int(report.failed)


@experiment(timeout=30.0, memory=4096, short_help="Solvers of quadratic and conic programs compared.")
@click.option("--quick", is_flag=True, help="Few problems, a minute or two.")
@click.option("--only", multiple=True, metavar="NAME…", help="Only these solvers.")
def solvers(quick: bool, only: tuple[str, ...]) -> Plan:
    """Compare solvers of quadratic and conic programs on frictional contact, judged by the package's certificate.

    The tasks are single inner problems, sequences of them, and whole outer loops, in all unknowns and condensed, at
    three accuracies. The problems are well or badly conditioned, have open or sticking contacts, redundant rows, or no
    solution.

    \b
    Examples:
        python -m comparisons solvers --quick --workers 2
        python -m comparisons solvers --only qp:osqp --out results/osqp
    """  # noqa: D301
    from comparisons.solvers import report, study
    from comparisons.solvers.accuracies import TABLE, installed
    from solvers.inner.registry import available, how_to_install

    present = installed()
    for name in only:
        if name not in present:
            known = f"is not installed: {how_to_install(name)}" if name in TABLE else "there is no such solver"
            raise InputError("only", name, f"{known}; choose among {', '.join(present)}")
    if not only:
        for name in (each for each in TABLE if each not in present):
            click.echo(f"not installed, left out: {name} ({how_to_install(name)})", err=True)
        for name in (each for each in available() if each not in TABLE):
            click.echo(f"left out: {name} has no row in comparisons/solvers/accuracies.py", err=True)
    return Plan([study.declared([name for name in present if not only or name in only], quick)], report.report)


def _convergence(name: str, short_help: str, about: str) -> Experiment:
    """The command of the study in `comparisons.convergence.NAME`."""

    def plan(quick: bool) -> Plan:
        module = import_module(f"comparisons.convergence.{name}")
        return Plan([module.study(quick)], module.report)

    plan.__name__ = f"convergence_{name}"
    plan.__doc__ = f"{about}\n\n\b\nExample:\n    python -m comparisons convergence-{name} --quick"
    quick_option = click.option("--quick", is_flag=True, help="Few and small cases.")
    return experiment(timeout=600.0, short_help=short_help)(quick_option(plan))


_CONVERGENCE: Final = (
    ("mesh", "How answers converge with the mesh.",
     "Measure errors of forces and energies on uniform, graded and adaptive meshes, for several degrees."),
    ("outer", "How loops over the friction bound converge.",
     "Measure iterations over the friction bound against μ: plain, damped, Anderson's, and the condensed method."),
    ("uzawa", "How the paper's iteration converges.",
     "Measure the paper's iteration: how many iterations it needs, and with which steps it settles."),
)  # fmt: skip


@experiment(timeout=300.0, short_help="Accuracy and cost beside displacement codes.")
@click.option("--friction", type=FiniteRange(0.0), multiple=True, default=(0.2, 0.1, 0.05, 1.0), show_default=True,
              help="Coefficients of friction; may take several numbers.")  # fmt: skip
@click.option("--cells", type=COUNT, multiple=True, default=(8, 16, 32), show_default=True,
              help="Cells along a side of equal and of corner-graded meshes; may take several numbers.")  # fmt: skip
@click.option("--levels", type=click.IntRange(1, LEVELS), default=LEVELS, show_default=True,
              help="Number of meshes graded to the corner and to the end of the stick zone.")  # fmt: skip
@click.option("--repeat", type=COUNT, default=5, show_default=True,
              help="Largest number of repetitions within 5 s.")  # fmt: skip
@click.option("--getfem", metavar="PYTHON", help="Python interpreter that has GetFEM, if this one has not.")
def peers(friction: tuple[float, ...], cells: tuple[int, ...], levels: int, repeat: int, getfem: str | None) -> Plan:
    """Compare the accuracy and cost of the force of the compressed plate with displacement codes.

    The codes are NGSolve (Nitsche's method, degrees 2 to 8), GetFEM (its contact brick, degrees 2 to 4), and this
    package on triangles of degree 3 to 8, which also computes bounds of the force.

    The meshes have equal cells, cells graded to the free corner, and cells graded to the corner and to the end of the
    stick zone. The report has force, unknowns, time and memory. Each case runs in a process of its own, on one thread.
    For a code that is not installed the report says how to get it. On a cluster the environment variable
    PYTHON_WITH_GETFEM of each worker names its Python for GetFEM.

    \b
    Examples:
        python -m comparisons peers --getfem /usr/bin/python3
        python -m comparisons peers --friction 0.2 --cells 8 16 --levels 3 --store small.sqlite --out results/small
    """  # noqa: D301
    from comparisons.peers import report, study

    if getfem is not None:
        os.environ[study.GETFEM] = getfem
    return Plan([study.peers_study(friction, cells, repeat, levels)], report.report)


@experiment(timeout=600.0, needs=("ngsolve",), short_help="Bounds beside displacements of another code, NGSolve.")
@click.option("--count", type=COUNT, metavar="NUMBER", default=140, show_default=True,
              help="Problems of each family, and as many more with springs.")  # fmt: skip
@click.option("--polygons", type=COUNT, metavar="NUMBER", default=650, show_default=True,
              help="Polygons that are refined to 1 % where they slip; about half of them do.")  # fmt: skip
def bounds(count: int, polygons: int) -> Plan:
    """Bound the errors of generated problems with friction, temperature and springs, and compare with NGSolve.

    NGSolve's displacements of degree 5 on graded meshes, with a frictional contact iteration of their own, stand for
    the exact solution. The report says whether they are within the bounds of stress, displacement and forces, and how
    much larger the bounds are than the errors. The exit status is 1 if a solution is outside. It needs
    `python -m pip install ngsolve`.

    \b
    Example:
        python -m comparisons bounds --count 3 --polygons 10
    """  # noqa: D301
    from comparisons.bounds import study

    return Plan([study.declared(count), study.refined(polygons)], study.report)


@experiment(timeout=120.0, memory=4096, needs=("daqp", "quadprog"),
            short_help="Generated problems: is every answer right?")  # fmt: skip
@click.option("--each", type=COUNT, metavar="NUMBER", default=20, show_default=True, help="Problems of each family.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True,
              help="Number of the first problem; each number determines a problem.")  # fmt: skip
@click.option("--only", multiple=True, metavar="FAMILY…", help="Only these families.")
def wild(each: int, seed: int, only: tuple[str, ...]) -> Plan:
    """Solve generated problems as unusual as users may state them, and check every answer.

    They have thin bodies, odd units, large friction, polygons, arcs, holes, joints, several bodies, meshes from files,
    distant gaps, every contact law, plates with moments, or no load at all. An answer that is called solved is checked
    from its stresses and the data alone. The exit status is 1 if such an answer is wrong, if an exception is not one of
    the package's own, or if a problem takes more than --timeout or --memory.

    \b
    Examples:
        python -m comparisons wild --each 5
        python -m comparisons wild --each 50 --seed 1000 --only gaps idle --timeout 60 --out results/gaps
    """  # noqa: D301
    from comparisons.wild import study

    return Plan([study.declared(only, each, seed)], study.report)


@experiment(timeout=300.0, short_help="Limit loads of generated bodies, and their proofs.")
@click.option("--count", type=COUNT, metavar="NUMBER", default=200, show_default=True, help="Problems.")
def limits(count: int) -> Plan:
    """Bound the limit loads of generated bodies that yield, with contacts, from both sides, and prove both bounds.

    The report says whether lower bounds are below upper bounds, and whether the proofs hold in exact arithmetic.

    \b
    Example:
        python -m comparisons limits --count 6
    """  # noqa: D301
    from comparisons.wild import limits as study

    return Plan([study.declared(count)], study.report)


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

    if penalty is not None and not 1.0 < penalty < math.inf:
        raise InputError("--penalty", penalty, "give a number above 1")
    source, result = _solved(problem, file, ".hdf5")
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

    _, result = _solved(problem, file, ".npz")
    save_qvi(file, result.solution.problem, result.solution)
    return _written(file, result)


def _solved(path: str, file: str, suffix: str) -> "tuple[ProblemFile, ContactResult]":
    """The problem file, and its result with the file's own options; of a history the first step.

    The name of `file` is checked before the solve, and a missing folder is made.
    """
    import numpy as np

    from qvi_contact.basics.writing import check_suffix, writable_folder
    from qvi_contact.files.problem_file import load_problem
    from qvi_contact.solution.solver import solve

    check_suffix("FILE", file, suffix)
    writable_folder(Path(file).parent)
    source = load_problem(path)
    with source.named_errors(), np.errstate(all="ignore"):
        return source, solve(source.problem, **source.solve_options)


def _written(file: str, result: "ContactResult") -> int:
    click.echo(f"{file}: {result.message}")
    return 0 if result.solution.solved else 1


for command in (
    paper, benchmark, benchmark_wall, verify, solvers, *(_convergence(*entry) for entry in _CONVERGENCE), peers, bounds,
    wild, limits, export,
):  # fmt: skip
    group.add_command(command)
