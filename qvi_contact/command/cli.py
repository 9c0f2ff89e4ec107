"""The command `qvi-contact`."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Final

import click

from qvi_contact.basics.schema import Choice, Number, Whole, defaults_of, described, keys_of
from qvi_contact.basics.terminal import Group, run
from qvi_contact.files.options import RefineOptions
from qvi_contact.solution.settings import Settings
from qvi_contact.version import __version__

if TYPE_CHECKING:
    from qvi_contact.files.problem_file import ProblemFile

_Command = Callable[..., Any]

_TARGETS: Final = {
    "plot": ("PICTURE", "Draw the result: a file name that ends in .png, .svg or .pdf."),
    "vtk": ("VTU", "Write the fields for ParaView (.vtu), and the contacts to …_contacts.vtu."),
    "npz": ("NPZ", "Write problem and result as NumPy arrays (.npz), for qvi-contact verify."),
    "save_json": ("JSON", "Write what --json prints to a file."),
    "report": ("HTML", "Write a report on one page (.html): pictures, forces, bounds."),
    "proof": ("FILE", "Write a proof of both numbers, for check-proof: .json."),
}
"""Files that commands write, by option: what stands for their names, and what they are."""

_SPACE: Final = ("degree", "law_on")
_METAVARS: Final = {"time_limit": "SECONDS", "quantity": "NAME", "max_unknowns": "N", "max_rounds": "N"}


def _words(_context: object, option: click.Parameter, begun: str) -> list[str]:
    """What the shell offers for an option: words that can be used here."""
    from solvers import available
    from solvers.factorisation import available_backends
    from solvers.factorisation.choice import OTHERS
    from solvers.settings import METHODS

    known: dict[str | None, Iterable[str]] = {"method": METHODS, "inner": available()}
    return [word for word in known.get(option.name, (*OTHERS, *available_backends())) if word.startswith(begun)]


def _options(declared: type, *names: str, **texts: str) -> Callable[[_Command], _Command]:
    """Options as a class declares them, with other texts for some."""
    said = {name: text.rpartition(": `")[0] + "." for name, text in described(declared).items()}
    given = {name: value for name, value in defaults_of(declared).items() if value is not None and name in said}
    said |= {name: f"{said[name]}  [default: {value}]" for name, value in given.items()} | texts

    def decorated(command: _Command) -> _Command:
        for name in reversed(names):
            kind = keys_of(declared)[name].kind
            more: dict[str, Any] = {}
            if isinstance(kind, Choice):
                more["type"] = click.Choice(kind.words)
            elif isinstance(kind, Number | Whole):
                more["type"] = float if isinstance(kind, Number) else int
            if name in ("method", "inner", "factorisation"):
                more["shell_complete"] = _words
            if name in _METAVARS:
                more["metavar"] = _METAVARS[name]
            command = click.option(f"--{name.replace('_', '-')}", help=said.get(name), **more)(command)
        return command

    return decorated


def _writes(*names: str, **texts: str) -> Callable[[_Command], _Command]:
    """Options for files to be written, with other texts for some."""

    def decorated(command: _Command) -> _Command:
        for name in reversed(names):
            metavar, text = _TARGETS[name]
            command = click.option(f"--{name.replace('_', '-')}", metavar=metavar, help=texts.get(name, text))(command)
        return command

    return decorated


_FILE = click.argument("file", metavar="FILE", type=click.Path())  # of any kind: the shell completes its name
_ELEMENT = _options(Settings, "degree", "law_on")
_TIME_LIMIT = _options(Settings, "time_limit")
_VERBOSE = click.option("-v", "--verbose", is_flag=True, help="Print what the solver does, on standard error.")
_JSON = click.option("--json", "as_json", is_flag=True, help="Print one JSON document and nothing else.")


@contextmanager
def _opened(
    file: str, given: dict[str, Any], single: str = ""
) -> "Iterator[tuple[ProblemFile, dict[str, str], dict[str, Any]]]":
    """The problem in a file, the files to write, and arguments of `solve`: those of the file and those given.

    Input errors in the block have their paths in the file. `single` is what a file with load steps is refused for.
    """
    import numpy as np

    from qvi_contact.command.outputs import checked_targets
    from qvi_contact.errors import InputError
    from qvi_contact.files.problem_file import load_problem

    targets = checked_targets(file, **{name: given[name] for name in _TARGETS if name in given})
    problem_file = load_problem(file)
    if single and problem_file.times:
        remedy = f"{single} needs a single problem: give a file without [history]"
        raise InputError("history", f"{len(problem_file.times)} steps", remedy)
    known = keys_of(Settings)
    typed = {name: value for name, value in given.items() if name in known and value is not None}
    with problem_file.named_errors(), np.errstate(all="ignore"):  # what overflows fails its certificate
        element, stated = problem_file.element, problem_file.solve_options
        options = {name: value for name, value in stated.items() if name not in element}
        if "method" in typed and typed["method"] != Settings.of(None, options).chosen:
            options = {name: value for name, value in options.items() if name in known}
        yield problem_file, targets, options | element | typed


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
    Exit status: 0 the answer was found and passes its checks
                 1 it was not, or a check failed: the message gives the reason
                 2 something is wrong with the input, or a file cannot be written

    \b
    Reproduce the paper that the method comes from:
        python -m comparisons paper
    """  # noqa: D301  # click wants the character \b, not the two


@group.command(short_help="Solve a problem: forces, states, certificate.")
@_FILE
@_ELEMENT
@_options(Settings, "method", "inner", "factorisation", "threads", "tolerance", "time_limit")
@_VERBOSE
@_JSON
@_writes("plot", "vtk", "npz", "save_json", "report")
@click.option(
    "--panels",
    metavar="NAMES",
    help="Contacts with a chart of pressure and friction in pictures, as base,wall; none without charts.  [default: at "
    "most two]",
)
@click.option(
    "--set",
    "swept",
    multiple=True,
    metavar="NAME=V1,V2,…",
    help="Solve for these values, or START:STOP:COUNT: of a constant of the file, of friction, of a factor of load, of "
    "what is added to gap or offset; also load.NAME, CONTACT.friction.",
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
    verbose: bool,
    as_json: bool,
    swept: tuple[str, ...],
    store: str | None,
    panels: str | None,
    **given: Any,
) -> int:
    """Solve the problem in FILE and report forces and states of its contacts.

    Options override [solve] in the file. After --time-limit seconds the result is the best state found so far, with the
    status time_limit.

    A file with a [history] is solved step by step. Its picture shows forces and loops, and its fields are those of the
    last step. With --store each step is written to a folder as soon as it is done. After an interruption the same
    command goes on with the next step.

    --set, or a [sweep] in the file, solves for several values of the friction, of a load factor, or of what is added to
    gap or offset; --set also of a constant of the file. One value of a constant changes the file, so that it goes with
    a history and with another --set. Files that are written hold the last value. For thousands of values give --store:
    each value's forces and shares are a row of an SQLite file as soon as it is done, and --workers or --dask share the
    values.

    --report writes one page. Its energy bounds take a second solve, of at most --time-limit seconds, by displacement
    elements. So do the displacements in the file of --vtk. A step of a history is bounded for itself, with the slip
    before it as it was computed.

    \b
    Examples:
        qvi-contact solve examples/compressed_plate.toml
        qvi-contact solve examples/punch.toml --degree 5 --plot punch.png
        qvi-contact solve examples/punch.toml --npz punch.npz && qvi-contact verify punch.npz
        qvi-contact solve examples/punch.toml --report punch.html
        qvi-contact solve examples/cyclic_shear.toml --json > cycle.json
        qvi-contact solve examples/cyclic_shear.toml --store cycle
        qvi-contact solve examples/punch.toml --set P=50 --set friction=0.1,0.2
        qvi-contact solve examples/punch.toml --set friction=0.1:0.5:41 --store punch.sqlite
    """  # noqa: D301
    from qvi_contact.basics.writing import write_text
    from qvi_contact.command import series as several
    from qvi_contact.command.outputs import SecondModel, asked_panels, json_text, page_of, write_all
    from qvi_contact.command.report import result_lines
    from qvi_contact.files.export import summary

    with _opened(file, given) as (problem_file, targets, options):
        problem_file, plan = several.asked(problem_file, swept)
        units = problem_file.units
        charts = asked_panels(problem_file, panels)
        several.check_asked(plan, store, given)
        if plan is not None and store is not None:
            shared = {name: given[name] for name in ("workers", "dask") if given[name] is not None}
            sweep = several.swept(problem_file, plan, options, verbose, store=store, **shared)
            document = several.stored_document(problem_file, sweep)
            if "save_json" in targets:
                write_text(targets["save_json"], json_text(document) + "\n")
            _show(problem_file, document if as_json else several.stored_lines(sweep))
            return 0 if sweep.status == "solved" else 1
        series, steps = several.solved_series(problem_file, plan, options, verbose, store)
        solved = (steps[0] if series is None else series.results).status == "solved"
        document = {"title": problem_file.title, "solved": solved}
        if as_json or "save_json" in targets:
            found = [summary(step, units) for step in steps]
            document |= found[0] if series is None else series.document(found, units)
        second = SecondModel(steps[-1], options.get("time_limit"))
        page = page_of(file, problem_file, steps, second, series=series, panels=charts)
        history = None if series is None else series.history
        complete = write_all(targets, problem_file, second, document, page, history, charts)
    lines = result_lines(steps[0], units) if series is None else series.lines(units)
    _show(problem_file, document if as_json else lines)
    return 2 if not complete else 0 if solved else 1


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
    Examples:
        qvi-contact verify answer.npz
        qvi-contact verify answer.npz -v
        qvi-contact verify answer.npz --tolerance 1e-6 --json
    """  # noqa: D301
    import numpy as np

    from qvi_contact.command.outputs import json_text
    from qvi_contact.verification.verification import verify_file

    with np.errstate(all="ignore"):  # what overflows fails
        found = verify_file(result, tolerance)
    click.echo(json_text(found.document()) if as_json else found.table(failures_only=not verbose))
    return 0 if found.passed else 1


@group.command(short_help="Show what was understood, without solving.")
@_FILE
@_ELEMENT
@_writes("plot", plot="Draw mesh, boundary parts and loads: .png, .svg or .pdf.")
@_JSON
def check(file: str, as_json: bool, **given: Any) -> None:
    """Read FILE and print what it describes, without solving.

    Builds the mesh, assigns a condition to every part of the boundary, adds up the loads, and counts the unknowns.

    \b
    Example:
        qvi-contact check examples/bracket.toml --plot bracket.png
    """  # noqa: D301
    from qvi_contact.command.outline import outline
    from qvi_contact.command.report import outline_lines

    with _opened(file, given) as (problem_file, targets, options):
        problem, found = outline(problem_file, {name: options[name] for name in _SPACE if name in options})
    if "plot" in targets:
        from qvi_contact.plots import problem_figure, save_figure

        save_figure(targets["plot"], problem_figure(problem, problem_file.units))
    _show(problem_file, found if as_json else outline_lines(found, problem_file.units))


@group.command(short_help="Bound the energy, and a force, from both sides.")
@_FILE
@click.option(
    "--degree",
    type=int,
    help="Degree of the displacements, 1 to 5; that of the stress function by default, at most 5.",
)
@click.option(
    "--tolerance", type=float, default=1e-8, show_default=True, help="Tolerance of both solves, at most 1e-6."
)
@_TIME_LIMIT
@_VERBOSE
@_JSON
@_writes("vtk", vtk="Write the fields for ParaView (.vtu), with what each cell adds to the gap of the bounds.")
def bracket(file: str, degree: int | None, verbose: bool, as_json: bool, **given: Any) -> int:
    """Solve the problem in FILE by stresses and by displacements, and bound the error of the answer.

    The stress model gives a lower bound of the energy, a displacement model on the same mesh an upper bound. The bounds
    are guaranteed for straight contacts without Coulomb friction. If one prescribed displacement drives the problem,
    its force is bounded too. With Coulomb friction the error of the stresses and the forces of contacts are bounded,
    whatever sticks, slips or opens; the bounds are guaranteed or estimated. The output gives every reason why bounds
    are not guaranteed.

    \b
    Examples:
        qvi-contact bracket examples/punch.toml --vtk apart.vtu
        qvi-contact bracket examples/compressed_plate.toml --degree 3 --json
    """  # noqa: D301
    import math

    from qvi_contact.bracket.bounds import bracket as bracketed
    from qvi_contact.bracket.outcome import document, lines
    from qvi_contact.command.outputs import SecondModel, write_all
    from qvi_contact.command.progress_line import solving
    from qvi_contact.command.report import result_lines
    from qvi_contact.files.export import summary
    from qvi_contact.solution.solver import solve as solve_one
    from solvers.basics.progress import deadline

    with _opened(file, given, "a bracket") as (problem_file, targets, options):
        limit, title, units = options.pop("time_limit", None), problem_file.title or "bracket", problem_file.units
        with solving(title, 3, verbose=verbose) as advance, deadline(limit):
            result = solve_one(problem_file.problem, **options, verbose=verbose)
            advance("stress model solved")
            tolerance = given["tolerance"]
            found = bracketed(result, degree, tolerance, verbose=verbose) if result.has_state else None
            advance("energy bounded, contact forces follow")
            if found is not None:
                _ = found.forces  # takes longest on large meshes: here, where progress is shown
        complete = write_all(targets, problem_file, SecondModel(result, known=found), {})
    if as_json:
        bounds = None if found is None else document(found, units)
        _show(problem_file, {"title": problem_file.title, **summary(result, units), "bracket": bounds})
    else:
        _show(problem_file, (*result_lines(result, units), *(() if found is None else ("", *lines(found, units)))))
    bounded = found is not None and result.status == "solved" and math.isfinite(found.gap)
    return 2 if not complete else 0 if bounded else 1


@group.command(short_help="Look for other solutions of the same problem.")
@_FILE
@_ELEMENT
@_options(Settings, "tolerance", "time_limit")
@_VERBOSE
@_JSON
@_writes("plot", "vtk", "npz", "save_json")
def branches(file: str, verbose: bool, as_json: bool, **given: Any) -> int:
    """Solve the problem in FILE and look for other solutions of it, which large friction may have.

    Friction is followed to its value from smaller and larger ones. That takes about as long as ten to thirty solves,
    and up to a hundred. If several certified solutions are found, a displacement model on the same mesh is solved too.
    The table lists the solutions by how far their strains are from those of that model, the nearest first. Files that
    are written hold the first one. If no other solution is found, there may still be one.

    \b
    Examples:
        qvi-contact branches examples/ssnv128.toml --time-limit 60
        qvi-contact branches examples/ssnv128.toml --npz nearest.npz
    """  # noqa: D301
    from qvi_contact.bracket import other_solutions
    from qvi_contact.command.outputs import SecondModel, write_all
    from qvi_contact.command.progress_line import solving
    from qvi_contact.command.report import branches_document, branches_lines
    from qvi_contact.solution.solver import solve as solve_one
    from solvers.basics.progress import deadline

    with _opened(file, given, "a search for other solutions") as (problem_file, targets, options):
        limit, title, units = options.pop("time_limit", None), problem_file.title or "branches", problem_file.units
        with solving(title, 2, verbose=verbose) as advance, deadline(limit):
            result = solve_one(problem_file.problem, **options, verbose=verbose)
            advance("solved; friction is followed from other values")
            found = other_solutions(result) if result.status == "solved" else None
        document = {"title": problem_file.title, **branches_document(result, found, units)}
        second = SecondModel(result if found is None else found.preferred, given["time_limit"])
        complete = write_all(targets, problem_file, second, document)
    _show(problem_file, document if as_json else branches_lines(result, found, units))
    return 2 if not complete else 0 if result.status == "solved" else 1


@group.command(short_help="Refine the mesh until a number is accurate.")
@_FILE
@_options(RefineOptions, "target", "quantity", "max_unknowns", "max_rounds")
@click.option(
    "--guaranteed/--estimated",
    default=None,
    help="Force of a contact with friction: refine until guaranteed bounds, or an estimate, meet the target.  "
    "[default: estimated]",
)
@_options(
    Settings, "degree", "law_on", "method", "inner", "tolerance", "time_limit",
    degree="Degree of the element, 3 to 11; 5 by default.",
)  # fmt: skip
@_VERBOSE
@_JSON
@_writes("plot", "vtk", "npz", "save_json", "report")
def refine(file: str, verbose: bool, as_json: bool, **given: Any) -> int:
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
    Examples:
        qvi-contact refine examples/trapezoid.toml --target 1e-4 --quantity base.normal_force
        qvi-contact refine examples/punch.toml --target 1e-4 --degree 4 --plot punch.png
        qvi-contact refine examples/cylinder_on_block.toml --quantity contact.largest_pressure
        qvi-contact refine examples/compressed_plate.toml --quantity plate.normal_force --guaranteed
        qvi-contact refine examples/trapezoid.toml --npz answer.npz && qvi-contact verify answer.npz
        qvi-contact refine examples/trapezoid.toml --json --report trapezoid.html > trapezoid.json
    """  # noqa: D301
    from qvi_contact.command.outputs import SecondModel, page_of, write_all
    from qvi_contact.command.progress_line import solving
    from qvi_contact.command.report import refinement_document, refinement_lines, result_lines, so_far
    from qvi_contact.files.export import summary
    from qvi_contact.refinement import Refinement
    from qvi_contact.refinement import refine as refined

    with _opened(file, given, "a refinement") as (problem_file, targets, options):
        asked, units = (
            {name: given[name] for name in keys_of(RefineOptions) if given[name] is not None},
            problem_file.units,
        )
        with solving(problem_file.title or "refine", verbose=verbose) as advance:
            found: Refinement = refined(
                problem_file.problem, **{**problem_file.refine_options, **asked}, **options,
                callback=lambda done: advance(so_far(done)), verbose=verbose,
            )  # fmt: skip
        document = {"title": problem_file.title, **summary(found.result, units)}
        document["refinement"] = refinement_document(found, units)
        second = SecondModel(found.result, options.get("time_limit"))
        page = page_of(file, problem_file, (found.result,), second, refinement=found)
        complete = write_all(targets, problem_file, second, document, page)
    last = [line for line in result_lines(found.result, units) if not line or line not in found.message]
    _show(problem_file, document if as_json else (*refinement_lines(found, units), *([""] if last else []), *last))
    return 2 if not complete else 0 if found.status == "reached" else 1


@group.command(short_help="Largest multiple of loads that contacts carry.")
@_FILE
@click.option(
    "--load",
    "loads",
    metavar="NAME",
    multiple=True,
    help="Name of a load to multiply; may be given several times.",
)
@click.option(
    "--target", type=float, help="Refine the mesh until the two bounds agree to this relative difference, such as 1e-4."
)
@_ELEMENT
@_TIME_LIMIT
@_VERBOSE
@_JSON
@_writes(
    "plot", "vtk", "report", "proof", plot="Draw how the body gives way beyond the limit: .png, .svg or .pdf.",
    vtk="Write how a body that yields gives way for ParaView (.vtu).",
    report="Write a report on one page (.html): both numbers, and how the body gives way.",
)  # fmt: skip
def limit(file: str, loads: tuple[str, ...], target: float | None, verbose: bool, as_json: bool, **given: Any) -> int:
    """Bounds of the largest multiple of the named loads that contacts and body can carry. The other loads are fixed.

    The first number is a multiple that stresses of this mesh carry within the contact laws, and within the strength of
    materials that have one. The second is a multiple that no stress of the body exceeds, proved by a mechanism of rigid
    blocks, or by a flow of bodies that yield. With --target the mesh is refined until
    the difference is within this share of the second number. Under Coulomb friction the body may slide below these
    loads; check a load by "qvi-contact solve". NAME is the name of a traction (its edge set if it has none), of a
    contact whose plate is driven by force, or "body" for the body force. Loads of one name are multiplied together.
    With a [history] the problem at its first time is used. With --proof and without a --load the file proves that the
    loads as they are cannot be carried, by a mechanism of rigid blocks. The exit status is 1 if the mesh carries no
    multiple, or if the target was not reached.

    \b
    Examples:
        qvi-contact limit examples/dragged_block_holds.toml --load drag
        qvi-contact limit examples/dragged_block_holds.toml --load drag --target 1e-4
        qvi-contact limit examples/dragged_block_holds.toml --load drag --plot drag.png
        qvi-contact limit examples/dragged_block_holds.toml --load drag --proof drag.json
    """  # noqa: D301
    from qvi_contact.command.outputs import write_limit, write_proof
    from qvi_contact.command.progress_line import solving
    from qvi_contact.command.report import limit_document, limit_lines
    from qvi_contact.limit.load_factor import limit_load_factor
    from qvi_contact.refinement import LimitFactor
    from qvi_contact.refinement import refine as refined

    with (
        _opened(file, given) as (problem_file, targets, options),
        solving(problem_file.title or "limit", verbose=verbose),
    ):
        space: dict[str, Any] = {name: options[name] for name in _SPACE if name in options}
        told: dict[str, Any] = {**space, "time_limit": given["time_limit"], "verbose": verbose}
        problem, refinement, degree = problem_file.problem, None, space.get("degree")
        if not loads and "proof" in targets:
            click.echo("\n".join(write_proof(targets["proof"], problem, (), degree)))
            return 0
        if target is None:
            found = limit_load_factor(problem, loads=list(loads), **told)
        else:
            refinement = refined(problem, target=target, quantity=LimitFactor(list(loads)), **told)
            found, problem = refinement.limit, refinement.problem
        proofs = write_proof(targets["proof"], problem, list(loads), degree) if "proof" in targets else []
    said = limit_lines(loads, found, refinement)
    for line in write_limit(targets, file, problem_file, problem, found, said):
        click.echo(f"qvi-contact: {line}", err=True)
    if as_json:
        _show(problem_file, {"loads": list(loads), **limit_document(found, refinement)})
    else:
        click.echo("\n".join([*said, *proofs]))
    missed = refinement is not None and refinement.status != "reached"
    return 1 if missed or found == -float("inf") else 0


@group.command(short_help="Bound the factor of safety on strength and friction.")
@_FILE
@click.option(
    "--of", metavar="NAME", multiple=True, help="Contact, region or body to weaken; may be given several times."
)
@click.option("--accuracy", type=float, default=1e-3, show_default=True, help="Relative width of each bisection.")
@_ELEMENT
@_TIME_LIMIT
@_VERBOSE
@_JSON
def safety(file: str, of: tuple[str, ...], accuracy: float, verbose: bool, as_json: bool, **given: Any) -> int:
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
    from qvi_contact.command.progress_line import solving
    from qvi_contact.limit.load_factor import strength_reduction_factor

    with (
        _opened(file, given) as (problem_file, _, options),
        solving(problem_file.title or "safety", verbose=verbose),
    ):
        space: dict[str, Any] = {name: options[name] for name in _SPACE if name in options}
        found = strength_reduction_factor(
            problem_file.problem, of=list(of) or None, accuracy=accuracy, time_limit=given["time_limit"], **space
        )
    if as_json:
        _show(problem_file, {"of": list(of), "lower": found.lower, "upper": found.upper})
    else:
        above = (
            f"divided by {found.upper:.6g} they do not on any mesh" if found.upper < float("inf") else "no bound above"
        )
        click.echo(f"strengths divided by {found.lower:.6g} carry the loads on this mesh; {above}")
    return 0 if found.lower >= 1.0 else 1


@group.command("check-proof", short_help="Check a proof file of limit in exact arithmetic.")
@_FILE
def check_proof(file: str) -> int:
    """Check a proof of what a body carries and of what it does not, written by "qvi-contact limit --proof".

    All arithmetic is exact. The check is the script qvi_contact/limit/check_proof.py, which needs nothing but Python's
    standard library. The exit status is 1 if something does not hold.

    \b
    Example:
        qvi-contact check-proof drag.json
    """  # noqa: D301
    from qvi_contact.command.report import checked_proof

    holds, line = checked_proof(file)
    click.echo(line)
    return 0 if holds else 1


@group.command(short_help="List the keys of problem files.")
@click.argument("name", metavar="[NAME]", default="")
def keys(name: str) -> None:
    """List the tables of problem files with their keys, or say all about the table or key called NAME.

    Of each key there are the values that it takes, its default, its meaning with the unit, and an example.

    \b
    Examples:
        qvi-contact keys
        qvi-contact keys contacts
        qvi-contact keys contacts.friction
        qvi-contact keys mesh.outline
    """  # noqa: D301
    from qvi_contact.files.keys import listed

    click.echo("\n".join(listed(name)))


@group.command(short_help="List what can be used on this machine.")
@_JSON
def methods(as_json: bool) -> None:
    """List the methods, inner solvers and factorisations that can be used here.

    Inner solvers are names for the argument `inner` of qvi_contact.solve: "qp:…" are quadratic programs through
    qpsolvers, "direct:…" solvers that keep their set-up between outer iterations, "socp:…" second-order cone programs
    through cvxpy. In a copy of the repository "python -m pip install '.[solvers]'" installs
    more back ends. The list also names factorisations that are not installed, and how to install them.
    """
    from qvi_contact.command.outputs import json_text
    from solvers import available
    from solvers.factorisation import available_backends, missing_backends
    from solvers.factorisation.base import DENSE
    from solvers.settings import METHODS

    factorisations = {DENSE: "up to 500 unknowns", **available_backends()}
    if as_json:
        document = {"methods": list(METHODS), "inner": list(available()), "factorisation": factorisations}
        click.echo(json_text(document))
        return
    missing = {name: f"not installed: {install}" for name, install in missing_backends().items()}
    listed = tuple(f"{name}  ({what})" for name, what in (factorisations | missing).items())
    groups = {"methods": METHODS, "inner solvers": available(), "factorisations": listed}
    for title, names in groups.items():
        click.echo("\n  ".join([title, *names]))


def _show(file: "ProblemFile", found: dict[str, Any] | Iterable[str]) -> None:
    """A document for programs, or title and lines for people."""
    from qvi_contact.command.outputs import json_text
    from qvi_contact.command.report import heading_lines

    click.echo(json_text(found) if isinstance(found, dict) else "\n".join((*heading_lines(file), *found)))


def main() -> None:
    """Entry point."""
    run(group, "qvi-contact")
