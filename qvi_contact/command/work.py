"""The work behind the commands: a function for each command of `cli`, which returns the exit status.

Modules that only one command needs are imported in its function, so that the others start faster.
"""

from __future__ import annotations

import json
import math
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click
import numpy as np

import qvi_contact
from qvi_contact import export, files
from qvi_contact.basics.schema import Missing, keys_of
from qvi_contact.basics.terminal import solving
from qvi_contact.basics.writing import check_suffix, check_writable, identity, open_regular, unwritable, write_text
from qvi_contact.command import report
from qvi_contact.command.cli import TARGETS
from qvi_contact.errors import InputError, QVIError
from qvi_contact.files.problem_file import ProblemFile, SweepPlan, evenly, load_problem
from qvi_contact.problem.conditions import has_coulomb
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.settings import PARAMETERS, RefineOptions, Settings
from qvi_contact.solution.solver import solve as solve_one
from solvers import available
from solvers.basics.progress import deadline
from solvers.errors import known_name
from solvers.factorisation.base import DENSE
from solvers.factorisation.choice import available_backends, missing_backends
from solvers.settings import METHODS

if TYPE_CHECKING:
    from qvi_contact.bracket import Bracket

_MOST_VALUES: Final = 1_000_000  # largest number of values in --set NAME=START:STOP:COUNT
_MAY_SLIDE: Final = (
    "Under Coulomb friction the body may slide all the same: check it by qvi-contact solve, or give a displacement in "
    "place of the load, whose force grows until the body slides."
)
_RESERVED: Final = (*PARAMETERS, "title", "solved", "steps")  # keys of JSON: there a constant is constants.NAME


@contextmanager
def _problem_file(
    file: str, given: dict[str, Any], single: str = ""
) -> Iterator[tuple[ProblemFile, dict[str, str], dict[str, Any]]]:
    """The problem in a file, the files to write, and arguments of `solve`, from the file and the command line.

    Input errors in the block get their paths in the file. A task `single` is refused for a file with load steps.
    """
    targets = _checked_targets(file, {name: given[name] for name in TARGETS if given.get(name) is not None})
    problem_file = load_problem(file)
    input_files = set(map(identity, problem_file.files.values()))
    for name, path in targets.items():
        if input_files.intersection(map(identity, _files_of(name, path))):
            raise InputError(_option_name(name), path, "is a file that the problem reads: give a file of its own")
    if single and problem_file.times:
        remedy = f"{single} needs a single problem: give a file without [history]"
        raise InputError("history", f"{len(problem_file.times)} steps", remedy)
    option_names = keys_of(Settings)
    command_options = {name: value for name, value in given.items() if name in option_names and value is not None}
    with problem_file.named_errors(), np.errstate(all="ignore"):  # a result that overflows fails its certificate
        options = dict(problem_file.solve_options)
        if "method" in command_options and command_options["method"] != Settings.of(None, options).chosen:
            options = {name: value for name, value in options.items() if name in option_names}
        yield problem_file, targets, options | command_options


def _print_answer(
    file: ProblemFile, as_json: bool, document: dict[str, Any], lines: Iterable[str], good: bool, complete: bool = True
) -> int:
    """Print a JSON document, or title, description and lines of text; returns the exit status."""
    heading = filter(None, (file.title, *file.description.strip().splitlines()))
    click.echo(_json_text(document) if as_json else "\n".join((*heading, *lines)))
    return 2 if not complete else 0 if good else 1


def solve(file: str, verbose: bool, as_json: bool, swept: tuple[str, ...], panels: str | None, **given: Any) -> int:
    """Solve a problem, its history, or a sweep."""
    with _problem_file(file, given) as (problem_file, targets, options):
        problem_file, plan = _with_settings(problem_file, swept)
        charts = None
        if panels is not None:
            if not {"plot", "report"} & targets.keys():
                raise InputError("--panels", panels, "is for pictures: give --plot or --report too")
            names = [contact.name for contact in problem_file.problem.contacts]  # a name may have a comma
            asked = [panels] if panels in names else [part.strip() for part in panels.split(",") if panels != "none"]
            charts = [known_name("--panels", name, {"contacts": names}) for name in asked]
        if _is_stored(problem_file, plan, given) and plan is not None:
            store_options = {name: given[name] for name in ("store", "workers", "dask") if given[name] is not None}
            sweep = _sweep(problem_file, plan, options, verbose, **store_options)
            return _report_stored(problem_file, sweep, targets, as_json)
        series, steps = _solve_series(problem_file, plan, options, verbose, given["store"])
        solved = (steps[0] if series is None else series.results).status == "solved"
        document = {"title": problem_file.title, "solved": solved}
        if as_json or "save_json" in targets:
            summaries = [export.summary(step, problem_file.units) for step in steps]
            document |= summaries[0] if series is None else series.document(summaries, problem_file.units)
        complete = _write_all(
            targets, problem_file, steps[-1], document,
            time_limit=options.get("time_limit"), panels=charts, series=series,
        )  # fmt: skip
    lines = report.result_lines(steps[0], problem_file.units) if series is None else series.lines(problem_file.units)
    return _print_answer(problem_file, as_json, document, lines, solved, complete)


def verify(result: str, tolerance: float | None, verbose: bool, as_json: bool) -> int:
    """Check a stored result."""
    from qvi_contact.verification import verify_file

    verification = verify_file(result, tolerance)
    click.echo(_json_text(verification.document()) if as_json else verification.table(failures_only=not verbose))
    return 0 if verification.passed else 1


def check(file: str, as_json: bool, **given: Any) -> int:
    """Print what a problem file describes."""
    with _problem_file(file, given) as (problem_file, targets, options):
        problem, outline = report.outline(problem_file, options)
    if "plot" in targets:
        from qvi_contact import plots

        plots.save_figure(targets["plot"], plots.problem_figure(problem, problem_file.units))
    return _print_answer(problem_file, as_json, outline, report.outline_lines(outline, problem_file.units), True)


def bracket(file: str, degree: int | None, verbose: bool, as_json: bool, **given: Any) -> int:
    """Bound energy and forces by a displacement model."""
    from qvi_contact.bracket import bounds, outcome

    with _problem_file(file, given, "a bracket") as (problem_file, targets, options):
        limit, title, units = options.pop("time_limit", None), problem_file.title or "bracket", problem_file.units
        with solving(title, 3, verbose=verbose) as advance, deadline(limit):
            result = solve_one(problem_file.problem, **options, verbose=verbose)
            advance("stress model solved")
            tolerance = given["tolerance"]
            energy_bracket = bounds.bracket(result, degree, tolerance, verbose=verbose) if result.has_state else None
            advance("energy bounded, contact forces follow")
            if energy_bracket is not None:
                _ = energy_bracket.forces  # computed here, as progress is shown: the longest part on large meshes
        complete = _write_all(targets, problem_file, result, {}, known_bracket=energy_bracket)
    document = {"title": problem_file.title, **export.summary(result, units)}
    document["bracket"] = None if energy_bracket is None else outcome.document(energy_bracket, units)
    more = () if energy_bracket is None else ("", *outcome.lines(energy_bracket, units))
    is_bounded = energy_bracket is not None and result.status == "solved" and math.isfinite(energy_bracket.gap)
    lines = (*report.result_lines(result, units), *more)
    return _print_answer(problem_file, as_json, document, lines, is_bounded, complete)


def refine(file: str, verbose: bool, as_json: bool, **given: Any) -> int:
    """Refine the mesh until a number is accurate."""
    from qvi_contact.refinement import refine as refine_mesh

    with _problem_file(file, given, "a refinement") as (problem_file, targets, options):
        refine_options = {name: given[name] for name in keys_of(RefineOptions) if given[name] is not None}
        units = problem_file.units
        with solving(problem_file.title or "refine", verbose=verbose) as advance:
            refined: Any = refine_mesh(
                problem_file.problem, **{**problem_file.refine_options, **refine_options}, **options,
                callback=lambda done: advance(report.so_far(done)), verbose=verbose,
            )  # fmt: skip
        document = {"title": problem_file.title, **export.summary(refined.result, units)}
        document["refinement"] = report.refinement_document(refined, units)
        complete = _write_all(
            targets, problem_file, refined.result, document,
            time_limit=options.get("time_limit"), refinement=refined,
        )  # fmt: skip
    last = [line for line in report.result_lines(refined.result, units) if not line or line not in refined.message]
    lines = (*report.refinement_lines(refined, units), *([""] if last else []), *last)
    return _print_answer(problem_file, as_json, document, lines, refined.status == "reached", complete)


def limit(file: str, loads: tuple[str, ...], verbose: bool, as_json: bool, **given: Any) -> int:
    """Bound the largest multiple of loads."""
    from qvi_contact.limit.load_factor import OPTIONS, checked_loads, limit_load_factor
    from qvi_contact.refinement import LimitFactor
    from qvi_contact.refinement import refine as refined

    rounds: Any = {name: given[name] for name in ("target", "max_unknowns") if given[name] is not None}
    with (
        _problem_file(file, given) as (problem_file, targets, options),
        solving(problem_file.title or "limit", verbose=verbose),
    ):
        loads, settings = tuple(dict.fromkeys(loads)), dict[str, Any]({name: options.get(name) for name in OPTIONS})
        problem, refinement, proof_lines = problem_file.problem, None, list[str]()
        if "proof" in targets and not loads:
            unused_options = {**rounds, **targets, "proof": None}
            return _prove_not_carried(targets["proof"], problem_file, settings, unused_options, as_json)
        named: list[Any] = list(loads) or [Missing()]
        if not report.act(problem, checked_loads(problem, named, "--load")):
            told = ["is 0: name a load to multiply", *_time_remark(problem_file)]
            raise InputError("--load", ", ".join(loads), ". ".join(told))
        if not rounds:
            limit_load = limit_load_factor(problem, loads=list(loads), verbose=verbose, **settings)
        else:
            refinement = refined(problem, quantity=LimitFactor(list(loads)), verbose=verbose, **rounds, **settings)
            limit_load, problem = refinement.limit, refinement.problem
    is_missed = refinement is not None and refinement.status != "reached"
    refined_lines = [] if refinement is None else [refinement.message, *[refinement.status.advice] * is_missed]
    units, reasons, remarks = problem_file.units, dict[str, str](), _time_remark(problem_file)
    if limit_load.missing:
        remarks.append(f"The other bound was not found: {limit_load.missing.removeprefix('limit load: ')}.")
    elif limit_load.upper == math.inf:
        remarks.append("If other loads act, a multiple, even 1, may be too small to hold the body.")
        remarks += [_MAY_SLIDE] * any(map(has_coulomb, problem.contacts))
    lines = [f"{', '.join(loads)}: {report.limit_sentence(limit_load)}", *refined_lines, *remarks]
    if limit_load.mechanism is None and limit_load.collapse is None:
        reasons["plot"] = "there is no mechanism to draw in"
    if limit_load.collapse is None:
        reasons["vtk"] = "no part of the body yields, or it has no largest load: there is no flow to write to"

    def plot(path: str) -> None:
        from qvi_contact import plots

        plots.save_figure(path, plots.limit_figure(problem, limit_load, units, problem_file.title, f"{lines[0]}."))

    def page(path: str) -> None:
        from qvi_contact.command.page import limit_page

        write_text(path, limit_page(problem_file, problem, limit_load, lines))

    vtk = partial(export.write_collapse_vtu, problem=problem, limit=limit_load, units=units)
    proof = partial(_write_proof, problem=problem, loads=loads, settings=settings, told=proof_lines)
    complete = _write_files(problem_file, targets, {"plot": plot, "vtk": vtk, "report": page, "proof": proof}, reasons)
    document = {"loads": list(loads), **report.limit_document(limit_load, refinement), "remarks": remarks}
    click.echo(_json_text(document) if as_json else "\n".join([*lines, *proof_lines]))
    return 2 if not complete else 0 if not (limit_load.missing or is_missed) and limit_load != -math.inf else 1


def _time_remark(file: ProblemFile) -> list[str]:
    """The remark that a limit analysis took the loads at the first time, if the file has a history."""
    return [f"These loads are those at t = {file.times[0]:g}, the first time of the history."] if file.times else []


def _prove_not_carried(
    path: str, file: ProblemFile, settings: Mapping[str, Any], unused_options: Mapping[str, Any], as_json: bool
) -> int:
    """Prove that the given loads cannot be carried; `unused_options` need --load, and must not be given without it."""
    for name, value in unused_options.items():
        if value is not None:
            raise InputError(_option_name(name), value, "needs loads that are multiplied: give --load")
    proof_lines = list[str]()
    _write_proof(path, file.problem, (), settings, proof_lines)
    document = {"loads": [], "message": "; ".join(proof_lines), "remarks": _time_remark(file)}
    click.echo(_json_text(document) if as_json else "\n".join([*proof_lines, *_time_remark(file)]))
    return 0


def _write_proof(
    path: str, problem: ContactProblem, loads: Iterable[str], settings: Mapping[str, Any], told: list[str]
) -> None:
    """Write a proof file; adds its statements as lines of text to `told`."""
    from qvi_contact.limit import check_proof as proofs
    from qvi_contact.limit.proof import limit_proof, save_proof

    proof = limit_proof(problem, list(loads), **settings)
    save_proof(path, proof)
    told += proofs.sentences(*proofs.check(proof)[:2])
    told += [f"not proved: the {side} bound ({reason})" for side, reason in proof["missing"].items()]


def safety(file: str, of: tuple[str, ...], accuracy: float, verbose: bool, as_json: bool, **given: Any) -> int:
    """Bound the factor of safety."""
    from qvi_contact.limit.load_factor import OPTIONS, strength_reduction_factor

    with (
        _problem_file(file, given) as (problem_file, _, options),
        solving(problem_file.title or "safety", verbose=verbose),
    ):
        settings = {name: options.get(name) for name in OPTIONS}
        factor = strength_reduction_factor(
            problem_file.problem, of=list(of) or None, accuracy=accuracy, verbose=verbose, **settings
        )
    late = "The time limit ended the search: both bounds hold, but more time would bring them closer."
    may_slide = factor.upper == math.inf and any(map(has_coulomb, problem_file.problem.contacts))
    remarks = [*_time_remark(problem_file), *[late] * (not factor.in_time), *[_MAY_SLIDE] * may_slide]
    sides = {"lower": factor.lower, "upper": factor.upper, "bounds": factor.guaranteed}
    document = {"of": list(of), **sides, "message": report.safety_sentence(factor), "remarks": remarks}
    click.echo(_json_text(document) if as_json else "\n".join([report.safety_sentence(factor), *remarks]))
    return 0 if factor.lower >= 1.0 else 1


def check_proof(file: str) -> int:
    """Check a proof file."""
    from qvi_contact.limit import check_proof as proofs

    remedy = "give a file written by qvi-contact limit --proof"
    try:
        with open_regular(file) as stream:
            text, status = proofs.told(stream.read())
    except (OSError, ValueError) as error:
        raise InputError("file", file, f"cannot be read ({getattr(error, 'strerror', error)}): {remedy}") from error
    if status == 2:
        raise InputError("file", file, f"is {text}: {remedy}")
    click.echo(text)
    return status


def keys(name: str) -> None:
    """List keys of problem files."""
    click.echo("\n".join(files.listed(name)))


def methods(as_json: bool) -> None:
    """List methods, inner solvers and factorisations."""
    factorisations = {DENSE: "up to 400 unknowns", **available_backends()}
    if as_json:
        document = {"methods": list(METHODS), "inner": list(available()), "factorisation": factorisations}
        click.echo(_json_text(document))
        return
    missing = {name: f"not installed: {install}" for name, install in missing_backends().items()}
    lines = tuple(f"{name}  ({what})" for name, what in (factorisations | missing).items())
    for title, names in {"methods": METHODS, "inner solvers": available(), "factorisations": lines}.items():
        click.echo("\n  ".join([title, *names]))


# Several results of one problem file: load steps of a history, or values of a sweep.


def _solve_series(
    file: ProblemFile, plan: SweepPlan | None, options: dict[str, Any], verbose: bool, store: str | None
) -> tuple[report.Series | None, Sequence[ContactResult]]:
    """Solve a file: a sweep if there is a plan, a history if the file has one, else a single problem."""
    if plan is not None:
        solve_plan = _sweep if plan.parameter in PARAMETERS else _sweep_constant
        sweep = solve_plan(file, plan, options, verbose)
        return report.Series(sweep, plan.parameter, plan.values, plan.of), sweep.steps
    if not file.times:
        with solving(file.title or "solve", verbose=verbose):
            return None, (solve_one(file.problem, **options, verbose=verbose),)
    with solving(file.title or "history", count := len(file.times), verbose=verbose) as advance:
        history = qvi_contact.solve_history(
            file.problems, lambda number, _: advance(f"step {number} of {count} solved", number),
            store=store, **options, verbose=verbose,
        )  # fmt: skip
    return report.Series(history, "t", file.times), history.steps


def _sweep_constant(file: ProblemFile, plan: SweepPlan, options: dict[str, Any], verbose: bool) -> qvi_contact.Sweep:
    """Sweep a constant of the file; each value is solved as a separate problem."""
    steps, limit = list[ContactResult](), options.get("time_limit")
    with solving(file.title or "sweep", len(plan.values), verbose=verbose) as advance, deadline(limit):
        for value in plan.values:
            if not (steps and deadline.over):
                problem = file.with_constants({plan.parameter.rpartition(".")[2]: value}).problem
                steps.append(solve_one(problem, **options, verbose=verbose))
                advance()
    return qvi_contact.Sweep(plan.parameter, plan.values, tuple(steps))


def _sweep(file: ProblemFile, plan: SweepPlan, options: dict[str, Any], verbose: bool, **stored: Any) -> Any:
    """Sweep a parameter of a file; `stored` has the store for the rows, and workers or a cluster, if they are given."""
    solve_sweep: Any = qvi_contact.solve_sweep  # its overloads depend on `store`
    with solving(file.title or "sweep", len(plan.values), verbose=verbose) as advance:
        if stored:
            with suppress(InputError):  # solve_sweep will report a wrong store
                advance("", len(qvi_contact.read_sweep(stored["store"]).statuses))
        swept = plan.parameter, plan.values, plan.of
        try:
            return solve_sweep(file.problem, *swept, lambda *_: advance(), **stored, **options, verbose=verbose)
        except InputError as error:
            if error.field not in ("parameter", "values", "of"):  # also keys of [sweep]
                raise
            place = f"sweep.{error.field}" if plan is file.sweep else "--set"
            raise type(error)(place, error.value, error.remedy) from error


def _is_stored(file: ProblemFile, plan: SweepPlan | None, options: Mapping[str, Any]) -> bool:
    """Whether a sweep goes to a store; `InputError` for options that cannot be combined with it, or need it."""
    is_stored = plan is not None and options["store"] is not None
    if is_stored:
        remedy = "needs a result, but a sweep with --store keeps only rows of numbers: leave one of them out"
        refused = dict.fromkeys(("plot", "vtk", "npz", "report"), remedy)
    else:
        remedy = "is for values of a sweep: give --store FILE with --set, or with a [sweep] in the problem file"
        refused = dict.fromkeys(("workers", "dask"), remedy)
    if plan is None and not file.times:
        remedy = "keeps steps of a history or rows of a sweep: give --set, or a file with a [history] or a [sweep]"
        refused = {"store": remedy} | refused
    elif plan is not None and plan.parameter not in PARAMETERS:
        refused = {"store": f"keeps rows of {', '.join(PARAMETERS)}: sweep a constant without it"} | refused
    for name, remedy in refused.items():
        if options[name] is not None:
            raise InputError(f"--{name}", options[name], remedy)
    return is_stored


def _report_stored(file: ProblemFile, sweep: qvi_contact.StoredSweep, targets: Mapping[str, str], as_json: bool) -> int:
    """Print the outcome of a sweep in a store, and write it to the file of --save-json; returns the exit status."""
    statuses, is_solved = Counter(sweep.statuses), sweep.status == "solved"
    document = {
        "title": file.title, "solved": is_solved, "store": str(sweep.path), "parameter": sweep.parameter,
        "values": len(sweep.values), "statuses": {str(each): count for each, count in statuses.items()},
        "message": sweep.message,
    }  # fmt: skip
    writers = {"save_json": lambda path: write_text(path, _json_text(document) + "\n")}
    complete = _write_files(file, targets, writers, {})
    lines = [f"{sweep.parameter}: {len(sweep.values)} values from {min(sweep.values):g} to {max(sweep.values):g}"]
    lines.append(", ".join(f"{count} {status.words}" for status, count in statuses.items()) or "no values done")
    lines += [*([] if is_solved else [sweep.message]), f"rows: {sweep.path}"]
    return _print_answer(file, as_json, document, lines, is_solved, complete)


def _with_settings(file: ProblemFile, assignments: Sequence[str]) -> tuple[ProblemFile, SweepPlan | None]:
    """Apply the options --set to a file: constants with one value are replaced, several values are a sweep.

    Returns the file, and this sweep or else that of the file. An assignment is `NAME=V1,V2,…` or
    `NAME=START:STOP:COUNT`, NAME a constant, a parameter of sweeps, CONTACT.PARAMETER, load.NAME or constants.NAME.
    """
    plans, constants = list[SweepPlan](), dict[str, float]()
    for text in assignments:
        name, separator, value_list = text.rpartition("=")  # a contact's name may have this letter
        owner, _, parameter = name.strip().rpartition(".")
        if name.strip().startswith("load.") and parameter not in PARAMETERS:
            parameter, _, owner = name.strip().partition(".")  # in load.NAME the parameter comes first
        values: tuple[float, ...] = ()
        with suppress(ValueError, TypeError):
            start, colon, rest = value_list.partition(":")
            stop, _, count = rest.partition(":")
            if not colon:
                values = tuple(float(part) for part in value_list.split(","))
            elif int(count) <= _MOST_VALUES:
                values = evenly(float(start), float(stop), int(count))
        if not (separator and parameter and values):
            remedy = (
                "write friction=0.1,0.2,0.3 (or load, gap, offset, a constant of the file), friction=0.1:0.3:21 for 21 "
                "values, or with a name base.friction=0.1,0.2 or load.thrust=1.2"
            )
            raise InputError("--set", text, remedy)
        names = {} if owner == "constants" else {"parameters": PARAMETERS}
        known_name("--set", parameter, names | ({"constants": file.constants} if owner in ("", "constants") else {}))
        if owner == "constants" or parameter not in PARAMETERS:
            if len(values) == 1:
                constants[parameter] = values[0]
                continue
            owner, parameter = "", f"constants.{parameter}" if parameter in _RESERVED else parameter
        plans.append(SweepPlan(parameter, values, (owner,) if owner else None))
    if len(plans) > 1 or len({*constants, *(plan.parameter for plan in plans)}) < len(assignments):
        remedy = "only one quantity can have several values, and each name may be given once: leave the others out"
        raise InputError("--set", " ".join(assignments), remedy)
    if plans and file.times:
        raise InputError("--set", assignments[0], "a file with a [history] cannot be swept: give one without")
    file = file.with_constants(constants) if constants else file
    return file, plans[0] if plans else file.sweep


# Files are checked before the work begins. If one cannot be written, the others still are.


def _checked_targets(source: str, paths: Mapping[str, str]) -> dict[str, str]:
    """The files to write, by option, after a check.

    `InputError` if a file cannot be written, is the problem file, is given twice, or needs a package that is missing.
    """
    uses = {identity(source): "the problem file"}
    for option, path in paths.items():
        name = _option_name(option)
        if path in ("", "-") or os.path.isdir(path):  # Path.is_dir raises for invalid names
            raise InputError(name, path, "give the name of a file")
        for written_file in _files_of(option, path):
            check_writable(written_file, name)
            place = identity(written_file)
            if place in uses:
                raise InputError(name, written_file, f"is {uses[place]}: give a file of its own")
            uses[place] = f"the file of {name} too"
        target = TARGETS[option]
        if target.library and find_spec(target.library) is None:
            raise InputError(name, path, f"needs {target.library}: python -m pip install {target.library}")
        if target.suffixes:
            check_suffix(name, path, *target.suffixes.split())
        if target.library == "matplotlib":
            from qvi_contact.plots.style import require_matplotlib

            require_matplotlib()
    return dict(paths)


def _files_of(option: str, path: str) -> tuple[str, ...]:
    """The files that an option writes; --vtk writes a second one, for contacts."""
    whole = Path(path)
    return (path, str(whole.with_name(f"{whole.stem}_contacts{whole.suffix}"))) if option == "vtk" else (path,)


def _write_all(
    targets: Mapping[str, str],
    file: ProblemFile,
    result: ContactResult,
    document: dict[str, Any],
    *,
    known_bracket: Bracket | None = None,
    time_limit: float | None = None,
    **page_arguments: Any,
) -> bool:
    """Write all files, with a message for each that cannot be written; returns whether all were.

    The picture shows the result, or a history. Pages and fields need the bracket, which is computed in at most
    `time_limit` seconds if it is not known. `page_arguments` are those of `result_page`.
    """
    series: Any = page_arguments.get("series")
    units = file.units

    @cache
    def bracketed() -> tuple[Bracket | None, str]:
        """The bracket, or the reason why there is none, such as an incompressible material."""
        from qvi_contact.bracket import bracket

        if known_bracket is not None or not result.has_state:
            return known_bracket, "there is no stress state"
        try:
            return bracket(result, time_limit=time_limit), ""
        except InputError as error:
            return None, error.remedy

    def plot(path: str) -> None:
        from qvi_contact import plots

        if file.times and series.results.steps[0].has_state and result.problem.contacts:
            plots.save_figure(path, plots.history_figure(series.results, units, file.times, file.title))
        else:
            where = "" if series is None else f"{series.label} = {series.values[len(series.results.steps) - 1]:g}"
            title = ", ".join(filter(None, (file.title, where)))
            plots.save_figure(path, plots.result_figure(result, units, title, page_arguments.get("panels")))

    def page(path: str) -> None:
        from qvi_contact.command.page import result_page

        write_text(path, result_page(file, result, bracketed, **page_arguments))

    def fields(path: str) -> None:
        bracket, _ = bracketed()
        moved = bracket if bracket is not None and bracket.companion.has_state else None
        export.write_vtu(path, result, units, bracket=moved)
        if result.contacts:
            export.write_contacts_vtu(_files_of("vtk", path)[1], result, units)

    writers: dict[str, Callable[[str], None]] = {
        "save_json": lambda path: write_text(path, _json_text(document) + "\n"),
        "plot": plot,
        "npz": lambda path: export.write_npz(path, result, units, file.title),
        "report": page,
        "vtk": fields,
    }
    stateless = {} if result.has_state else dict.fromkeys(("vtk", "npz"), "there is no stress state to write to")
    with solving(f"{file.title or 'solve'}: files"):  # bounds for a page may take longer than the answer
        return _write_files(file, targets, writers, stateless)


def _write_files(
    file: ProblemFile,
    targets: Mapping[str, str],
    writers: Mapping[str, Callable[[str], None]],
    reasons: Mapping[str, str],
) -> bool:
    """Write files by option, with a message for each that is not written; returns whether no writing failed.

    `reasons` has the options for which there is nothing to write, and why: that is no failure.
    """
    complete = True
    for option, path in targets.items():
        try:
            if option in reasons:
                click.echo(f"qvi-contact: {reasons[option]} {path}", err=True)
            else:
                with file.named_errors():
                    writers[option](path)
        except (QVIError, OSError, MemoryError) as error:  # also raised by libraries while they draw
            failure = error if isinstance(error, QVIError) else unwritable(Path(path), error)
            if isinstance(failure, InputError):
                name = _option_name(option) if failure.field == "output" else failure.field
                failure = InputError(name, failure.value, failure.remedy)
            click.echo(f"qvi-contact: {' '.join(str(failure).split())}", err=True)
            complete = False
    return complete


def _option_name(name: str) -> str:
    """The option as it is typed."""
    return f"--{name.replace('_', '-')}"


def _json_text(document: object) -> str:
    """A document as JSON; numbers that are not finite are null."""
    return json.dumps(files.json_ready(document), indent=2, allow_nan=False)
