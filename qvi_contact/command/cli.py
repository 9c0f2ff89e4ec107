"""The command `qvi-contact`."""

from shlex import quote
from typing import TYPE_CHECKING, Any

import click

from qvi_contact.basics.terminal import Group, run
from qvi_contact.version import __version__

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from qvi_contact.bracket import Bracket
    from qvi_contact.command.second_model import SecondModel
    from qvi_contact.command.series import Series
    from qvi_contact.files.problem_file import ProblemFile
    from qvi_contact.files.sweep_store import StoredSweep
    from qvi_contact.limit.load_factor import LimitLoad
    from qvi_contact.refinement import LimitRefinement, Refinement
    from qvi_contact.solution.history import History
    from qvi_contact.solution.result import ContactResult
    from qvi_contact.verification.verification import Verification


def _methods() -> "Iterable[str]":
    from solvers.solve import METHODS

    return METHODS


def _inner() -> "Iterable[str]":
    from solvers import available

    return available()


def _factorisations() -> "Iterable[str]":
    from solvers.factorisation import available_backends
    from solvers.factorisation.choice import OTHERS

    return (*OTHERS, *available_backends())


def _completed(known: "Callable[[], Iterable[str]]") -> "Callable[[Any, Any, str], list[str]]":
    """What the shell offers for an option: the words that can be used here."""
    return lambda _context, _option, begun: [word for word in known() if word.startswith(begun)]


_METHOD = click.option("--method", help="Outer method, see: qvi-contact methods", shell_complete=_completed(_methods))
_INNER = click.option(
    "--inner", help="Inner solver of the fixed point, see: qvi-contact methods", shell_complete=_completed(_inner)
)
_FACTORISATION = click.option(
    "--factorisation", help="Sparse factorisation, see: qvi-contact methods",
    shell_complete=_completed(_factorisations),
)  # fmt: skip
_FILE = click.argument("file", metavar="FILE", type=click.Path())  # of any kind: the shell completes its name
_TIME_LIMIT = click.option(
    "--time-limit", type=float, metavar="SECONDS", help="Seconds for all solves together.  [default: none]"
)
_DEGREE = click.option("--degree", type=int, help="Degree of the element, from 3.  [default: 4]")
_ROWS = click.option(
    "--contact-rows",
    type=click.Choice(["bernstein", "gauss"]),
    help="The contact law on whole edges, or at Gauss points.  [default: bernstein; gauss if "
    "friction varies or a contact with friction is bilateral]",
)
_VERBOSE = click.option("-v", "--verbose", is_flag=True, help="Print what the solver does, on standard error.")
_JSON = click.option("--json", "as_json", is_flag=True, help="Print one JSON document and nothing else.")

_PLOT = click.option("--plot", metavar="PICTURE", help="Draw the result: a file name that ends in .png, .svg or .pdf.")
_VTK = click.option(
    "--vtk", metavar="VTU", help="Write the fields for ParaView (.vtu), and the contacts to …_contacts.vtu."
)
_DEFORMED = click.option(
    "--deformed",
    metavar="PICTURE",
    help="Draw the deformed body by displacement elements on the same mesh.",
)
_NPZ = click.option(
    "--npz", metavar="NPZ", help="Write problem and result as NumPy arrays (.npz), for qvi-contact verify."
)
_SAVE_JSON = click.option("--save-json", metavar="JSON", help="Write what --json prints to a file.")
_REPORT = click.option("--report", metavar="HTML", help="Write a report on one page (.html): pictures, forces, bounds.")


@click.group(cls=Group, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__)
def group() -> None:
    """Frictional contact computed from the stress side.

    The unknown is an Airy stress function, so every computed stress is in equilibrium. Contact with Coulomb friction
    is a complementarity problem on the contact. Every answer has a certificate, computed from the original data.

    \b
    Problems are TOML files; the folder examples has commented ones:
        qvi-contact check examples/punch.toml --plot punch.png
        qvi-contact solve examples/punch.toml --plot answer.png --npz answer.npz
        qvi-contact verify answer.npz
    \b
    Reproduce the paper that the method comes from:
        python -m comparisons paper
    """  # noqa: D301  # click wants the character \b, not the two


@group.command(short_help="Solve a problem: forces, states, certificate.")
@_FILE
@_DEGREE
@_ROWS
@_METHOD
@_INNER
@_FACTORISATION
@click.option(
    "--threads", type=int, help="Threads of the linear algebra.  [default: one; all to factorise large meshes]"
)
@click.option("--tolerance", type=float, help="Accuracy that the certificate must confirm.  [default: 1e-8]")
@_TIME_LIMIT
@_VERBOSE
@_JSON
@_PLOT
@_DEFORMED
@_VTK
@_NPZ
@_SAVE_JSON
@_REPORT
@click.option("--certificate", is_flag=True, help="Compute the certificate again and print it as a table.")
@click.option(
    "--set",
    "swept",
    multiple=True,
    metavar="NAME=V1,V2,…",
    help="Solve for several values, or START:STOP:COUNT: of friction, of a factor of load, of what is added to gap or "
    "offset.",
)
@click.option(
    "--store",
    metavar="PLACE",
    help="Keep steps of a history in a folder, or rows of a sweep in an SQLite file; the same command again goes on.",
)
@click.option("--workers", type=int, help="Processes that share a sweep with --store.  [default: 1]")
@click.option(
    "--dask", metavar="ADDRESS", help="Share a sweep with --store on a Dask cluster: its scheduler's address."
)
def solve(
    file: str,
    degree: int | None,
    contact_rows: str | None,
    method: str | None,
    inner: str | None,
    factorisation: str | None,
    threads: int | None,
    tolerance: float | None,
    time_limit: float | None,
    verbose: bool,
    as_json: bool,
    plot: str | None,
    deformed: str | None,
    vtk: str | None,
    npz: str | None,
    save_json: str | None,
    report: str | None,
    certificate: bool,
    swept: tuple[str, ...],
    store: str | None,
    workers: int | None,
    dask: str | None,
) -> int:
    """Solve the problem in FILE and report forces and states of its contacts.

    Options override [solve] in the file. After --time-limit seconds the result is the best state found so far, with the
    status time_limit.

    A file with a [history] is solved step by step. Its picture shows forces and loops, and its fields are those of the
    last step. With --store each step is written to a folder as soon as it is done. After an interruption the same
    command goes on with the next step. --set, or a [sweep] in the file, solves for several values of the friction, of a
    load factor, or of what is added to gap or offset. Files that are written hold the last value. For thousands of
    values give --store: each value's forces and shares are a row of an SQLite file as soon as it is done, and --workers
    or --dask share the values.

    --certificate computes every number of the result (of each step) again and compares them. The exit status is 1 if
    any differ, and --json lists them as "verification". --report writes one page. Its energy bounds take a second
    solve, of at most --time-limit seconds, by displacement elements. So do the displacements in the file of --vtk, and
    the picture of --deformed. Steps of a history have no such displacement.

    \b
    Exit status: 0 solved, with a passing certificate
                 1 not solved, or a check of --certificate failed: the message gives the reason
                 2 something is wrong with the input

    \b
    Examples:
        qvi-contact solve examples/compressed_plate.toml
        qvi-contact solve examples/punch.toml --inner socp:clarabel --plot punch.png
        qvi-contact solve examples/punch.toml --degree 5
        qvi-contact solve examples/punch.toml --certificate
        qvi-contact solve examples/punch.toml --npz punch.npz && qvi-contact verify punch.npz
        qvi-contact solve examples/punch.toml --report punch.html
        qvi-contact solve examples/cyclic_shear.toml --json > cycle.json
        qvi-contact solve examples/cyclic_shear.toml --store cycle
        qvi-contact solve examples/punch.toml --set friction=0.1,0.2,0.3
        qvi-contact solve examples/punch.toml --set friction=0.1:0.5:41 --store punch.sqlite
    """  # noqa: D301
    import numpy as np

    from qvi_contact.command.second_model import SecondModel
    from qvi_contact.command.series import check_asked, plan_of, solved_series, stored_sweep
    from qvi_contact.command.targets import checked_targets
    from qvi_contact.files.problem_file import load_problem

    targets = checked_targets(file, plot=plot, deformed=deformed, vtk=vtk, npz=npz, save_json=save_json, report=report)
    problem_file = load_problem(file)
    given = {
        "method": method, "inner": inner, "tolerance": tolerance, "factorisation": factorisation, "threads": threads,
        "time_limit": time_limit, "degree": degree, "contact_rows": contact_rows,
    }  # fmt: skip
    with problem_file.named_errors(), np.errstate(all="ignore"):  # what overflows fails its certificate
        options, plan = _options(problem_file, _given(**given)), plan_of(problem_file, swept)
        asked = {
            "plot": plot, "deformed": deformed, "vtk": vtk, "npz": npz, "report": report, "certificate": certificate,
        }  # fmt: skip
        check_asked(plan, store, {**asked, "workers": workers, "dask": dask})
        if plan is not None and store is not None:
            shared = _given(workers=workers, dask=dask)
            sweep = stored_sweep(problem_file, plan, options, verbose, store, shared)
            return _tell_stored(problem_file, sweep, save_json, as_json)
        series, steps = solved_series(problem_file, plan, options, verbose, store)
        checked = _verified(steps, tolerance) if certificate else ()
        document = _as_document(problem_file, series, steps, checked) if as_json or save_json else {}
        second = SecondModel(steps[-1], options.get("time_limit"))
        page = _page(file, problem_file, steps, second, series=series)
        history = None if series is None else series.history
        complete = _write(problem_file, history, second, targets, document, page)
    if as_json:
        click.echo(_json(document))
    else:
        _show(problem_file, series, steps, checked)
    if not complete:
        return 2
    return 0 if _all_solved(series, steps) and all(found.passed for found in checked) else 1


@group.command(short_help="Check a stored result, from its file alone.")
@click.argument("result", metavar="RESULT", type=click.Path())
@click.option("--tolerance", type=float, help="Tolerance of the certificate.  [default: that of the result]")
@click.option("-v", "--verbose", is_flag=True, help="Print every check, not only those that failed.")
@_JSON
def verify(result: str, tolerance: float | None, verbose: bool, as_json: bool) -> int:
    """Check the stored result RESULT against the problem stored with it.

    RESULT is an archive written by "qvi-contact solve --npz" or qvi_contact.export.write_npz. It holds the problem,
    which is discretised again. The certificate is computed again from unknowns and multipliers. Tractions, gaps, slips,
    states, forces, energies and stresses are computed again and compared with those in the file. The output lists the
    checks that failed, each with its value, limit and meaning. The last line is the verdict.

    A result that was not solved fails. If its accuracy is good enough for you, give that accuracy as --tolerance. A
    problem with Python functions for loads or gaps cannot be stored, so its result cannot be checked.

    \b
    Exit status: 0 everything holds
                 1 a check failed: the last line names it
                 2 the file cannot be read, or is not a result

    \b
    Examples:
        qvi-contact verify answer.npz
        qvi-contact verify answer.npz -v
        qvi-contact verify answer.npz --tolerance 1e-6 --json
    """  # noqa: D301
    import numpy as np

    from qvi_contact.verification.verification import verify_file

    with np.errstate(all="ignore"):  # what overflows fails
        found = verify_file(result, tolerance)
    click.echo(_json(found.document()) if as_json else found.table(failures_only=not verbose))
    return 0 if found.passed else 1


@group.command(short_help="Show what was understood, without solving.")
@_FILE
@_DEGREE
@_ROWS
@click.option("--plot", metavar="PICTURE", help="Draw mesh, boundary parts and loads: .png, .svg or .pdf.")
@_JSON
def check(
    file: str,
    degree: int | None,
    contact_rows: str | None,
    plot: str | None,
    as_json: bool,
) -> None:
    """Read FILE and print what it describes, without solving.

    Builds the mesh, assigns a condition to every part of the boundary, adds up the loads, and counts the unknowns.

    \b
    Example:
        qvi-contact check examples/bracket.toml --plot bracket.png
    """  # noqa: D301
    from qvi_contact.command.outline import outline
    from qvi_contact.command.report import heading_lines, outline_lines
    from qvi_contact.command.targets import checked_targets
    from qvi_contact.files.problem_file import load_problem

    checked_targets(file, plot=plot)
    problem_file = load_problem(file)
    given = _given(degree=degree, contact_rows=contact_rows)
    problem, found = outline(problem_file, given)
    if plot is not None:
        from qvi_contact.plots import problem_figure, save_figure

        save_figure(plot, problem_figure(problem, problem_file.units))
    if as_json:
        click.echo(_json(found))
        return
    for line in (*heading_lines(problem_file), *outline_lines(found, problem_file.units)):
        click.echo(line)


@group.command(short_help="Bound the energy, and a force, from both sides.")
@_FILE
@click.option(
    "--degree",
    type=int,
    help="Degree of the displacements, 1 to 5.  [default: that of the stress function, at most 5]",
)
@click.option(
    "--tolerance", type=float, default=1e-8, show_default=True, help="Tolerance of both solves, at most 1e-6."
)
@_TIME_LIMIT
@_VERBOSE
@_JSON
@click.option("--plot", metavar="PICTURE", help="Draw the duality gap over the body: .png, .svg or .pdf.")
@click.option("--vtk", metavar="VTU", help="Write the displacements for ParaView (.vtu).")
def bracket(
    file: str,
    degree: int | None,
    tolerance: float,
    time_limit: float | None,
    verbose: bool,
    as_json: bool,
    plot: str | None,
    vtk: str | None,
) -> int:
    """Solve the problem in FILE by stresses and by displacements, and bound the error of the answer.

    The stress model gives a lower bound of the energy, a displacement model on the same mesh an upper bound. The bounds
    are guaranteed for straight contacts without Coulomb friction. If one prescribed displacement drives the problem,
    its force is bounded too. With Coulomb friction the error of the stresses and the forces of contacts are bounded,
    whatever sticks, slips or opens; the bounds are guaranteed or estimated. The output gives every reason why bounds
    are not guaranteed.

    \b
    Exit status: 0 solved, and both bounds found
                 1 not solved, or a bound is missing: the message gives the reason
                 2 something is wrong with the input

    \b
    Examples:
        qvi-contact bracket examples/punch.toml --plot apart.png
        qvi-contact bracket examples/compressed_plate.toml --degree 3 --json
    """  # noqa: D301
    import math

    import numpy as np

    from qvi_contact.bracket.bounds import bracket as bracketed
    from qvi_contact.command.solve_line import solving
    from qvi_contact.command.targets import checked_targets
    from qvi_contact.files.problem_file import load_problem
    from qvi_contact.solution.solver import solve as solve_one
    from solvers.basics.progress import watched

    targets = checked_targets(file, plot=plot, vtk=vtk)
    problem_file = load_problem(file)
    _refuse_history(problem_file, "a bracket")
    with problem_file.named_errors(), np.errstate(all="ignore"):
        options = _options(problem_file, _given(tolerance=tolerance, time_limit=time_limit))
        limit, title = options.pop("time_limit", None), problem_file.title or "bracket"
        with solving(title, 3, verbose=verbose) as advance, watched(limit):
            result = solve_one(problem_file.problem, **options, verbose=verbose)
            advance("stress model solved")
            found = bracketed(result, degree, tolerance, verbose=verbose) if result.has_state else None
            advance("energy bounded, contact forces follow")
            if found is not None:
                _ = found.forces  # takes longest on large meshes: here, where progress is shown
        _write_bracket(problem_file, found, targets)
    _show_bracket(problem_file, result, found, as_json)
    return 0 if found is not None and result.status == "solved" and math.isfinite(found.gap) else 1


@group.command(short_help="Look for other solutions of the same problem.")
@_FILE
@_DEGREE
@_ROWS
@click.option("--tolerance", type=float, help="Accuracy that certificates must confirm.  [default: 1e-8]")
@_TIME_LIMIT
@_VERBOSE
@_JSON
@_PLOT
@_VTK
@_NPZ
@_SAVE_JSON
def branches(
    file: str,
    degree: int | None,
    contact_rows: str | None,
    tolerance: float | None,
    time_limit: float | None,
    verbose: bool,
    as_json: bool,
    plot: str | None,
    vtk: str | None,
    npz: str | None,
    save_json: str | None,
) -> int:
    """Solve the problem in FILE and look for other solutions of it, which large friction may have.

    Friction is followed to its value from smaller and larger ones. That takes about as long as ten to thirty solves,
    and up to a hundred. If several certified solutions are found, a displacement model on the same mesh is solved too.
    The table lists the solutions by how far their strains are from those of that model, the nearest first. Files that
    are written hold the first one. If no other solution is found, there may still be one.

    \b
    Exit status: 0 solved, whatever the number of solutions
                 1 not solved: the message gives the reason
                 2 something is wrong with the input

    \b
    Examples:
        qvi-contact branches examples/ssnv128.toml --time-limit 60
        qvi-contact branches examples/ssnv128.toml --npz nearest.npz
    """  # noqa: D301
    import numpy as np

    from qvi_contact.bracket import other_solutions
    from qvi_contact.command.branches_line import document, lines
    from qvi_contact.command.report import heading_lines
    from qvi_contact.command.second_model import SecondModel
    from qvi_contact.command.solve_line import solving
    from qvi_contact.command.targets import checked_targets
    from qvi_contact.files.problem_file import load_problem
    from qvi_contact.solution.solver import solve as solve_one
    from solvers.basics.progress import watched

    targets = checked_targets(file, plot=plot, vtk=vtk, npz=npz, save_json=save_json)
    problem_file = load_problem(file)
    _refuse_history(problem_file, "a search for other solutions")
    given = _given(degree=degree, contact_rows=contact_rows, tolerance=tolerance, time_limit=time_limit)
    with problem_file.named_errors(), np.errstate(all="ignore"):  # what overflows fails its certificate
        options = _options(problem_file, given)
        limit, title = options.pop("time_limit", None), problem_file.title or "branches"
        with solving(title, 2, verbose=verbose) as advance, watched(limit):
            result = solve_one(problem_file.problem, **options, verbose=verbose)
            advance("solved; friction is followed from other values")
            found = other_solutions(result) if result.status == "solved" else None
        told = {"title": problem_file.title, **document(result, found, problem_file.units)}
        last = SecondModel(result if found is None else found.preferred, time_limit)
        complete = _write(problem_file, None, last, targets, told, str)
    if as_json:
        click.echo(_json(told))
    else:
        for line in (*heading_lines(problem_file), *lines(result, found, problem_file.units)):
            click.echo(line)
    return 2 if not complete else 0 if result.status == "solved" else 1


@group.command(short_help="Refine the mesh until a number is accurate.")
@_FILE
@click.option("--target", type=float, help="Largest relative error.  [default: 1e-3]")
@click.option(
    "--quantity",
    metavar="NAME",
    help="energy, a contact's CONTACT.normal_force or CONTACT.tangential_force, or a plate's or pin's CONTACT.force_x, "
    "force_y, moment, x, y or rotation.  [default: energy]",
)
@click.option("--max-unknowns", type=int, metavar="N", help="Largest number of unknowns.  [default: 20000]")
@click.option("--max-rounds", type=int, metavar="N", help="Largest number of meshes.  [default: 60]")
@click.option(
    "--guaranteed/--estimated",
    default=None,
    help="Force of a contact with friction: refine until guaranteed bounds, or an estimate, meet the target.  "
    "[default: estimated]",
)
@click.option("--degree", type=int, help="Degree of the element, 3 to 11.  [default: 5]")
@_ROWS
@_METHOD
@_INNER
@click.option("--tolerance", type=float, help="Accuracy that certificates must confirm.  [default: 1e-8]")
@_TIME_LIMIT
@_VERBOSE
@_JSON
@_PLOT
@_VTK
@_NPZ
@_SAVE_JSON
@_REPORT
def refine(
    file: str,
    target: float | None,
    quantity: str | None,
    max_unknowns: int | None,
    max_rounds: int | None,
    guaranteed: bool | None,
    degree: int | None,
    contact_rows: str | None,
    method: str | None,
    inner: str | None,
    tolerance: float | None,
    time_limit: float | None,
    verbose: bool,
    as_json: bool,
    plot: str | None,
    vtk: str | None,
    npz: str | None,
    save_json: str | None,
    report: str | None,
) -> int:
    """Refine the mesh of the problem in FILE until a number is as accurate as you ask.

    The first mesh is the one in the file: make it coarse. Each round solves the problem, computes the error of the
    quantity, and divides the cells that contribute most to it. The table has a row for each round: unknowns, value, and
    relative error. The error is a guaranteed bound or an estimate. It is a bound if no contact has Coulomb friction,
    for the energy, and for the force of a contact that one prescribed displacement drives. With --guaranteed the force
    of a contact with Coulomb friction is bounded too, which takes more unknowns. The files written are those of
    "qvi-contact solve", for the answer on the last mesh.

    Options override [refine] and [solve] in the file. After --time-limit seconds the answer is that of the last round
    done in time. The energy bounds on the page of --report take one more solve.

    \b
    Exit status: 0 the target was reached
                 1 it was not: the message gives the reason, and the answer is the best one found
                 2 something is wrong with the input

    \b
    Examples:
        qvi-contact refine examples/trapezoid.toml --target 1e-4 --quantity base.normal_force
        qvi-contact refine examples/punch.toml --target 1e-4 --degree 4 --plot punch.png
        qvi-contact refine examples/compressed_plate.toml --quantity plate.normal_force --guaranteed
        qvi-contact refine examples/trapezoid.toml --npz answer.npz && qvi-contact verify answer.npz
        qvi-contact refine examples/trapezoid.toml --json --report trapezoid.html > trapezoid.json
    """  # noqa: D301
    import numpy as np

    from qvi_contact.command.refine_line import refined
    from qvi_contact.command.second_model import SecondModel
    from qvi_contact.command.targets import checked_targets
    from qvi_contact.files.problem_file import load_problem

    targets = checked_targets(file, plot=plot, vtk=vtk, npz=npz, save_json=save_json, report=report)
    problem_file = load_problem(file)
    _refuse_history(problem_file, "a refinement")
    given = _given(
        degree=degree, contact_rows=contact_rows, method=method, inner=inner, tolerance=tolerance,
        time_limit=time_limit,
    )  # fmt: skip
    asked = _given(
        target=target, quantity=quantity, max_unknowns=max_unknowns, max_rounds=max_rounds, guaranteed=guaranteed,
    )  # fmt: skip
    with problem_file.named_errors(), np.errstate(all="ignore"):
        options = _options(problem_file, given)
        found = refined(problem_file, {**problem_file.refine_options, **asked}, options, verbose=verbose)
        document = _refinement_document(problem_file, found)
        second = SecondModel(found.result, options.get("time_limit"))
        page = _page(file, problem_file, (found.result,), second, found)
        complete = _write(problem_file, None, second, targets, document, page)
    if as_json:
        click.echo(_json(document))
    else:
        _show_refinement(problem_file, found)
    return 2 if not complete else 0 if found.status == "reached" else 1


@group.command(short_help="Largest multiple of loads that contacts carry.")
@_FILE
@click.option(
    "--load",
    "loads",
    metavar="NAME",
    multiple=True,
    required=True,
    help="Name of a load to multiply; may be given several times.",
)
@click.option(
    "--target", type=float, help="Refine the mesh until the two bounds agree to this relative difference, such as 1e-4."
)
@_DEGREE
@_ROWS
@_TIME_LIMIT
@_VERBOSE
@_JSON
@click.option("--plot", metavar="PICTURE", help="Draw how the body gives way beyond the limit: .png, .svg or .pdf.")
@click.option("--proof", metavar="FILE", help="Write a proof of the first number, for check-proof: .json.")
def limit(
    file: str,
    loads: tuple[str, ...],
    target: float | None,
    degree: int | None,
    contact_rows: str | None,
    time_limit: float | None,
    verbose: bool,
    as_json: bool,
    plot: str | None,
    proof: str | None,
) -> int:
    """Bounds of the largest multiple of the named loads that contacts and body can carry. The other loads are fixed.

    The first number is a multiple that stresses of this mesh carry within the contact laws, and within the strength of
    materials that have one. The second is a multiple that no stress of the body exceeds, proved by a mechanism of rigid
    blocks, or by a flow of bodies that yield. With --target the mesh is refined until
    the difference is within this share of the second number. Under Coulomb friction the body may slide below these
    loads; check a load by "qvi-contact solve". NAME is the name of a traction (its edge set if it has none), of a
    contact whose plate is driven by force, or "body" for the body force. Loads of one name are multiplied together.
    With a [history] the problem at its first time is used. The exit status is 1 if the mesh carries no multiple, or if
    the target was not reached.

    \b
    Examples:
        qvi-contact limit examples/dragged_block_holds.toml --load drag
        qvi-contact limit examples/dragged_block_holds.toml --load drag --target 1e-4
        qvi-contact limit examples/dragged_block_holds.toml --load drag --plot drag.png
        qvi-contact limit examples/dragged_block_holds.toml --load drag --proof drag.json
    """  # noqa: D301
    from qvi_contact.command.limit_line import computed, document, lines, write_proof
    from qvi_contact.command.solve_line import solving
    from qvi_contact.command.targets import checked_targets
    from qvi_contact.files.problem_file import load_problem

    checked_targets(file, plot=plot, proof=proof)
    problem_file = load_problem(file)
    with problem_file.named_errors(), solving(problem_file.title or "limit", verbose=verbose):
        space = problem_file.element | _given(degree=degree, contact_rows=contact_rows)
        told = {"time_limit": time_limit, "verbose": verbose}
        found, refinement = computed(problem_file.problem, loads, target, **space, **told)
        if proof is not None:
            write_proof(proof, problem_file.problem if refinement is None else refinement.problem, loads, **space)
    if plot is not None:
        _draw_limit(problem_file, loads, found, refinement, plot)
    if as_json:
        click.echo(_json({"loads": list(loads), **document(found, refinement)}))
    else:
        for line in lines(loads, found, refinement):
            click.echo(line)
    missed = refinement is not None and refinement.status != "reached"
    return 1 if missed or found == -float("inf") else 0


@group.command(short_help="Bound the factor of safety on strength and friction.")
@click.argument("file", type=click.Path())
@click.option(
    "--of", metavar="NAME", multiple=True, help="Contact, region or body to weaken; may be given several times."
)
@click.option("--accuracy", type=float, default=1e-3, show_default=True, help="Relative width of each bisection.")
@_DEGREE
@_ROWS
@_TIME_LIMIT
@_VERBOSE
@_JSON
def safety(
    file: str,
    of: tuple[str, ...],
    accuracy: float,
    degree: int | None,
    contact_rows: str | None,
    time_limit: float | None,
    verbose: bool,
    as_json: bool,
) -> int:
    """Bounds of the factor by which friction, cohesion and strengths may be divided until the loads are just carried.

    The first number is a factor at which stresses of this mesh carry all loads, the second one at which no stress does.
    By default all contacts and materials are weakened together; name some of them by --of. "body" is the material of
    the body. With a [history] the problem at its first time is used. The exit status is 1 if the first number is below
    1.

    \b
    Examples:
        qvi-contact safety examples/gravity_dam.toml
        qvi-contact safety examples/gravity_dam.toml --of base
    """  # noqa: D301
    from qvi_contact.command.solve_line import solving
    from qvi_contact.files.problem_file import load_problem
    from qvi_contact.limit.load_factor import strength_reduction_factor

    problem_file = load_problem(file)
    with problem_file.named_errors(), solving(problem_file.title or "safety", verbose=verbose):
        space: dict[str, Any] = problem_file.element | _given(degree=degree, contact_rows=contact_rows)
        found = strength_reduction_factor(
            problem_file.problem, of=list(of) or None, accuracy=accuracy, time_limit=time_limit, **space
        )
    if as_json:
        upper = found.upper if found.upper < float("inf") else None
        click.echo(_json({"of": list(of), "lower": found.lower, "upper": upper}))
    else:
        click.echo(
            f"strengths divided by {found.lower:.6g} carry the loads on this mesh; divided by {found.upper:.6g} they "
            "do not on any mesh"
        )
    return 0 if found.lower >= 1.0 else 1


@group.command("check-proof", short_help="Check a proof file of limit in exact arithmetic.")
@click.argument("file", type=click.Path())
def check_proof(file: str) -> int:
    """Check a proof that a body carries its loads times a factor, written by "qvi-contact limit --proof".

    All arithmetic is exact. The check is the script qvi_contact/limit/check_proof.py, which needs nothing but Python's
    standard library. The exit status is 1 if something does not hold.

    \b
    Example:
        qvi-contact check-proof drag.json
    """  # noqa: D301
    from qvi_contact.command.limit_line import checked_proof

    holds, line = checked_proof(file)
    click.echo(line)
    return 0 if holds else 1


@group.command(short_help="List what can be used on this machine.")
@_JSON
def methods(as_json: bool) -> None:
    """List the methods, inner solvers and factorisations that can be used here.

    Inner solvers are names for the argument `inner` of qvi_contact.solve: "qp:…" are quadratic programs through
    qpsolvers, "direct:…" solvers that keep their set-up between outer iterations, "socp:…" second-order cone programs
    through cvxpy. In a copy of the repository "python -m pip install '.[solvers]'" installs
    more back ends. The list also names factorisations that are not installed, and how to install them.
    """
    from solvers import available
    from solvers.factorisation import available_backends, missing_backends
    from solvers.factorisation.base import DENSE
    from solvers.solve import METHODS

    factorisations = {DENSE: "up to 500 unknowns", **available_backends()}
    if as_json:
        document = {"methods": list(METHODS), "inner": list(available()), "factorisation": factorisations}
        click.echo(_json(document))
        return
    missing = {name: f"not installed: {install}" for name, install in missing_backends().items()}
    listed = tuple(f"{name}  ({what})" for name, what in (factorisations | missing).items())
    groups = {"methods": METHODS, "inner solvers": available(), "factorisations": listed}
    for title, names in groups.items():
        click.echo("\n  ".join([title, *names]))


def _given(**options: Any) -> dict[str, Any]:
    """The options that were typed."""
    return {name: value for name, value in options.items() if value is not None}


def _options(file: "ProblemFile", given: dict[str, Any]) -> dict[str, Any]:
    """Arguments of `solve`: those of the file, less the options of a method that is not taken, and those given."""
    from solvers.solve import Settings

    options = {name: value for name, value in file.solve_options.items() if name not in file.element}
    if "method" in given and given["method"] != Settings.of(**options).method:
        kept = ("inner", "tolerance", "factorisation", "threads", "time_limit")
        options = {name: value for name, value in options.items() if name in kept}
    return options | file.element | given


def _all_solved(series: "Series | None", steps: "Sequence[ContactResult]") -> bool:
    return (steps[0] if series is None else series.results).status == "solved"


def _verified(steps: "Sequence[ContactResult]", tolerance: float | None) -> "tuple[Verification, ...]":
    from qvi_contact.verification.verification import verify_result

    return tuple(verify_result(step, tolerance) for step in steps)


def _as_document(
    file: "ProblemFile",
    series: "Series | None",
    steps: "Sequence[ContactResult]",
    checked: "tuple[Verification, ...]",
) -> dict[str, Any]:
    """Summaries, with what was verified, if it was."""
    from qvi_contact.files.export import summary

    found = [summary(step, file.units) for step in steps]
    for step, verification in zip(found, checked, strict=False):
        step["verification"] = verification.document()
    heading = {"title": file.title, "solved": _all_solved(series, steps)}
    return heading | (found[0] if series is None else series.document(found, file.units))


def _refuse_history(file: "ProblemFile", what: str) -> None:
    if file.times:
        from qvi_contact.errors import InputError

        raise InputError(
            "history", f"{len(file.times)} steps", f"{what} needs a single problem: give a file without [history]"
        )


def _refinement_document(file: "ProblemFile", found: "Refinement") -> dict[str, Any]:
    """The summary of the last answer, with what the refinement says."""
    from qvi_contact.command.refine_line import document
    from qvi_contact.files.export import summary

    return {"title": file.title, **summary(found.result, file.units), "refinement": document(found, file.units)}


def _show_refinement(file: "ProblemFile", found: "Refinement") -> None:
    """Rounds, how far the number can be trusted, and the last answer, for people."""
    from qvi_contact.command.refine_line import lines
    from qvi_contact.command.report import heading_lines, result_lines

    told = list(lines(found, file.units))
    last = [line for line in result_lines(found.result, file.units) if not line or line not in found.message]
    for line in (*heading_lines(file), *told, *([""] if last else []), *last):
        click.echo(line)


def _draw_limit(
    file: "ProblemFile",
    loads: "Sequence[str]",
    found: "LimitLoad",
    refinement: "LimitRefinement | None",
    path: str,
) -> None:
    """The mechanism, if there is one."""
    from qvi_contact.command.limit_line import drawn
    from qvi_contact.plots import save_figure

    if found.mechanism is None and found.collapse is None:
        click.echo(f"qvi-contact: there is no mechanism to draw in {path}", err=True)
        return
    save_figure(path, drawn(loads, file.problem, found, refinement, file.units))


def _write_bracket(file: "ProblemFile", found: "Bracket | None", targets: dict[str, str]) -> None:
    """Write the files asked for, as far as there is a displacement and a gap."""
    import math

    companion = None if found is None else found.companion
    if found is None or companion is None or not companion.has_state:
        if targets:
            click.echo(f"qvi-contact: there is no displacement to write to {', '.join(targets.values())}", err=True)
        return
    if "plot" in targets and not math.isfinite(found.gap):
        click.echo(
            f"qvi-contact: a bound is missing, so there is no duality gap to draw in {targets['plot']}", err=True
        )
    elif "plot" in targets:
        from qvi_contact.plots.bounds import bracket_figure
        from qvi_contact.plots.style import save_figure

        save_figure(targets["plot"], bracket_figure(found, file.units, file.title))
    if "vtk" in targets:
        from qvi_contact.files.vtu import write_companion_vtu

        write_companion_vtu(targets["vtk"], companion, file.units)


def _show_bracket(file: "ProblemFile", result: "ContactResult", found: "Bracket | None", as_json: bool) -> None:
    """Result and bracket for people, or as one JSON document."""
    from qvi_contact.bracket.outcome import document, lines
    from qvi_contact.command.report import heading_lines, result_lines
    from qvi_contact.files.export import summary

    if as_json:
        bounds = None if found is None else document(found, file.units)
        click.echo(_json({"title": file.title, **summary(result, file.units), "bracket": bounds}))
        return
    for line in (*heading_lines(file), *result_lines(result, file.units)):
        click.echo(line)
    for line in () if found is None else ("", *lines(found, file.units)):
        click.echo(line)


def _write(
    file: "ProblemFile",
    history: "History | None",
    second: "SecondModel",
    targets: dict[str, str],
    document: dict[str, Any],
    page: "Callable[[], str]",
) -> bool:
    """Write the files asked for, as many as can be; whether all could be, and a line for each that could not."""
    from qvi_contact.command.targets import written

    last = second.result

    def save_json(path: str) -> None:
        from qvi_contact.basics.writing import write_text

        write_text(path, _json(document) + "\n")

    def plot(path: str) -> None:
        from qvi_contact import plots

        if history is not None and history.steps[0].has_state and last.problem.contacts:
            plots.save_figure(path, plots.history_figure(history, file.units, file.times))
        else:
            plots.save_figure(path, plots.result_figure(last, file.units))

    def npz(path: str) -> None:
        from qvi_contact.files.export import write_npz

        write_npz(path, last, file.units, file.title)

    def report(path: str) -> None:
        from qvi_contact.basics.writing import write_text

        write_text(path, page())

    of_state = ("deformed", "vtk", "npz")
    fields = {option: path for option, path in targets.items() if option in of_state and not last.has_state}
    if fields:
        click.echo(f"qvi-contact: there is no stress state to write to {', '.join(fields.values())}", err=True)
    writers = {
        "save_json": save_json, "plot": plot, "npz": npz, "report": report,
        "vtk": lambda path: second.write(path, file.units),
        "deformed": lambda path: second.draw(path, file.units),
    }  # fmt: skip
    failures = written({option: path for option, path in targets.items() if option not in fields}, writers)
    for failure in failures:
        click.echo(f"qvi-contact: {' '.join(str(failure).split())}", err=True)
    return not failures


def _page(
    path: str,
    file: "ProblemFile",
    steps: "Sequence[ContactResult]",
    second: "SecondModel",
    refinement: "Refinement | None" = None,
    series: "Series | None" = None,
) -> "Callable[[], str]":
    """What makes the page of --report."""

    def made() -> str:
        import sys

        from qvi_contact.command.page.page import Request, result_page

        command = " ".join(["qvi-contact", *map(quote, sys.argv[1:])])
        request = Request.read(path, file, command)
        return result_page(request, steps, second, refinement, series)

    return made


def _show(
    file: "ProblemFile",
    series: "Series | None",
    steps: "Sequence[ContactResult]",
    checked: "tuple[Verification, ...]",
) -> None:
    """The report for people."""
    from qvi_contact.command.report import heading_lines, result_lines, verification_lines

    lines = result_lines(steps[0], file.units) if series is None else series.lines(file.units)
    verified = verification_lines(checked, *((), "t") if series is None else (series.values, series.label))
    for line in (*heading_lines(file), *lines, *verified):
        click.echo(line)


def _tell_stored(file: "ProblemFile", sweep: "StoredSweep", save_json: str | None, as_json: bool) -> int:
    """What became of a sweep whose rows are in a file; the exit status."""
    from qvi_contact.basics.writing import write_text
    from qvi_contact.command.report import heading_lines
    from qvi_contact.command.series import stored_document, stored_lines

    if save_json is not None:
        write_text(save_json, _json(stored_document(file, sweep)) + "\n")
    if as_json:
        click.echo(_json(stored_document(file, sweep)))
    else:
        for line in (*heading_lines(file), *stored_lines(sweep)):
            click.echo(line)
    return 0 if sweep.status == "solved" else 1


def _json(document: object) -> str:
    import json

    return json.dumps(document, indent=2, allow_nan=False)


def main() -> None:
    """Entry point."""
    run(group, "qvi-contact")
