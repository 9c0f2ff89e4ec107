"""What the commands do and write: a function for each command of `cli`, which returns the exit status.

Rooms that only one of them needs are loaded in its function, or by a name of the package, when it comes to them.
"""

from __future__ import annotations

import json
import math
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache
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
from qvi_contact.errors import InputError
from qvi_contact.files.problem_file import ELEMENT_OPTIONS, ProblemFile, SweepPlan, load_problem
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

_MOST: Final = 1_000_000  # values that are asked for at once
_TAKEN: Final = (*PARAMETERS, "title", "solved", "steps")  # what constants are not called alone in documents


@contextmanager
def _opened(
    file: str, given: dict[str, Any], single: str = ""
) -> Iterator[tuple[ProblemFile, dict[str, str], dict[str, Any]]]:
    """The problem in a file, the files to write, and arguments of `solve`: those of the file and those given.

    Input errors in the block have their paths in the file. `single` is what a file with load steps is refused for.
    """
    targets = _checked_targets(file, {name: given[name] for name in TARGETS if given.get(name) is not None})
    problem_file = load_problem(file)
    read = set(map(identity, problem_file.files.values()))
    for name, path in targets.items():
        if read.intersection(map(identity, _files_of(name, path))):
            raise InputError(_option_name(name), path, "is a file that the problem reads: give a file of its own")
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


def _ended(
    file: ProblemFile, as_json: bool, document: dict[str, Any], lines: Iterable[str], good: bool, complete: bool = True
) -> int:
    """Print a document for programs, or title, description and lines for people; the exit status."""
    heading = filter(None, (file.title, *file.description.strip().splitlines()))
    click.echo(_json_text(document) if as_json else "\n".join((*heading, *lines)))
    return 2 if not complete else 0 if good else 1


def solve(file: str, verbose: bool, as_json: bool, swept: tuple[str, ...], panels: str | None, **given: Any) -> int:
    """Solve a problem, its history, or a sweep."""
    with _opened(file, given) as (problem_file, targets, options):
        problem_file, plan = _asked(problem_file, swept)
        units = problem_file.units
        charts = _asked_panels(problem_file, panels)
        if panels is not None and not {"plot", "report"} & targets.keys():
            raise InputError("--panels", panels, "is for pictures: give --plot or --report too")
        if _check_asked(problem_file, plan, given) and plan is not None:
            stored = {name: given[name] for name in ("store", "workers", "dask") if given[name] is not None}
            sweep = _swept(problem_file, plan, options, verbose, **stored)
            return _told(problem_file, sweep, targets, as_json)
        series, steps = _solved_series(problem_file, plan, options, verbose, given["store"])
        solved = (steps[0] if series is None else series.results).status == "solved"
        document = {"title": problem_file.title, "solved": solved}
        if as_json or "save_json" in targets:
            found = [export.summary(step, units) for step in steps]
            document |= found[0] if series is None else series.document(found, units)
        complete = _write_all(
            targets, problem_file, steps[-1], document,
            time_limit=options.get("time_limit"), panels=charts, series=series,
        )  # fmt: skip
    lines = report.result_lines(steps[0], units) if series is None else series.lines(units)
    return _ended(problem_file, as_json, document, lines, solved, complete)


def verify(result: str, tolerance: float | None, verbose: bool, as_json: bool) -> int:
    """Check a stored result."""
    from qvi_contact.verification import verify_file

    with np.errstate(all="ignore"):  # what overflows fails
        found = verify_file(result, tolerance)
    click.echo(_json_text(found.document()) if as_json else found.table(failures_only=not verbose))
    return 0 if found.passed else 1


def check(file: str, as_json: bool, **given: Any) -> int:
    """Print what a problem file describes."""
    with _opened(file, given) as (problem_file, targets, options):
        element: dict[str, Any] = {name: options[name] for name in ELEMENT_OPTIONS if name in options}
        problem, found = report.outline(problem_file, element)
    if "plot" in targets:
        from qvi_contact import plots

        plots.save_figure(targets["plot"], plots.problem_figure(problem, problem_file.units))
    return _ended(problem_file, as_json, found, report.outline_lines(found, problem_file.units), good=True)


def bracket(file: str, degree: int | None, verbose: bool, as_json: bool, **given: Any) -> int:
    """Bound energy and forces by a displacement model."""
    from qvi_contact.bracket import bounds, outcome

    with _opened(file, given, "a bracket") as (problem_file, targets, options):
        limit, title, units = options.pop("time_limit", None), problem_file.title or "bracket", problem_file.units
        with solving(title, 3, verbose=verbose) as advance, deadline(limit):
            result = solve_one(problem_file.problem, **options, verbose=verbose)
            advance("stress model solved")
            tolerance = given["tolerance"]
            found = bounds.bracket(result, degree, tolerance, verbose=verbose) if result.has_state else None
            advance("energy bounded, contact forces follow")
            if found is not None:
                _ = found.forces  # takes longest on large meshes: here, where progress is shown
        complete = _write_all(targets, problem_file, result, {}, known=found)
    document = {"title": problem_file.title, **export.summary(result, units)}
    document["bracket"] = None if found is None else outcome.document(found, units)
    more = () if found is None else ("", *outcome.lines(found, units))
    bounded = found is not None and result.status == "solved" and math.isfinite(found.gap)
    return _ended(problem_file, as_json, document, (*report.result_lines(result, units), *more), bounded, complete)


def refine(file: str, verbose: bool, as_json: bool, **given: Any) -> int:
    """Refine the mesh until a number is accurate."""
    from qvi_contact.refinement import refine as refined

    with _opened(file, given, "a refinement") as (problem_file, targets, options):
        asked = {name: given[name] for name in keys_of(RefineOptions) if given[name] is not None}
        units = problem_file.units
        with solving(problem_file.title or "refine", verbose=verbose) as advance:
            found: Any = refined(
                problem_file.problem, **{**problem_file.refine_options, **asked}, **options,
                callback=lambda done: advance(report.so_far(done)), verbose=verbose,
            )  # fmt: skip
        document = {"title": problem_file.title, **export.summary(found.result, units)}
        document["refinement"] = report.refinement_document(found, units)
        complete = _write_all(
            targets, problem_file, found.result, document,
            time_limit=options.get("time_limit"), refinement=found,
        )  # fmt: skip
    last = [line for line in report.result_lines(found.result, units) if not line or line not in found.message]
    lines = (*report.refinement_lines(found, units), *([""] if last else []), *last)
    return _ended(problem_file, as_json, document, lines, found.status == "reached", complete)


def limit(file: str, loads: tuple[str, ...], target: float | None, verbose: bool, as_json: bool, **given: Any) -> int:
    """Bound the largest multiple of loads."""
    from qvi_contact.limit.load_factor import OPTIONS, checked_loads, limit_load_factor
    from qvi_contact.refinement import LimitFactor
    from qvi_contact.refinement import refine as refined

    with (
        _opened(file, given) as (problem_file, targets, options),
        solving(problem_file.title or "limit", verbose=verbose),
    ):
        told = {name: options.get(name) for name in OPTIONS}
        problem, refinement, proof = problem_file.problem, None, targets.pop("proof", None)
        if proof is not None and not loads:
            return _without_loads(proof, problem_file, told, {"target": target, **targets}, as_json)
        named: list[Any] = list(loads) or [Missing()]
        if not report.act(problem, checked_loads(problem, named, "--load")):
            raise InputError("--load", ", ".join(loads), f"is 0{_first_time(problem_file)}: name a load to multiply")
        if target is None:
            found = limit_load_factor(problem, loads=list(loads), verbose=verbose, **told)
        else:
            quantity = LimitFactor(list(loads))
            refinement = refined(problem, target=target, quantity=quantity, verbose=verbose, **told)
            found, problem = refinement.limit, refinement.problem
        proved = [] if proof is None else _write_proof(proof, problem, loads, told)
    said, units, missing = report.limit_lines(loads, found, refinement), problem_file.units, {}
    remarks = _meant(problem_file)
    if found.upper == math.inf:
        but = "Smaller multiples, also 1, may be too small to hold the body. Under Coulomb friction it may slide at any"
        remarks.append(f"{but}: check a load by qvi-contact solve.")
    said += remarks
    if found.mechanism is None and found.collapse is None:
        missing["plot"] = "there is no mechanism to draw in"
    if found.collapse is None:
        missing["vtk"] = "no part of the body yields, or it has no largest load: there is no flow to write to"

    def plot(path: str) -> None:
        from qvi_contact import plots

        plots.save_figure(path, plots.limit_figure(problem, found, units, problem_file.title, f"{said[0]}."))

    def page(path: str) -> None:
        from qvi_contact.command.page import limit_page

        write_text(path, limit_page(problem_file, problem, found, said))

    writers = {"plot": plot, "vtk": lambda path: export.write_collapse_vtu(path, problem, found, units), "report": page}
    complete = _written(targets, writers, missing)
    document = {"loads": list(loads), **report.limit_document(found, refinement), "remarks": remarks}
    click.echo(_json_text(document) if as_json else "\n".join([*said, *proved]))
    missed = refinement is not None and refinement.status != "reached"
    return 2 if not complete else 1 if missed or found == -math.inf else 0


def _first_time(file: ProblemFile) -> str:
    """When the loads of a limit analysis act, where the file has a history."""
    return f" at t = {file.times[0]:g}, the first time of the history" if file.times else ""


def _meant(file: ProblemFile) -> list[str]:
    """Which loads a limit analysis has had, if that is to be said."""
    return [f"These loads are those{_first_time(file)}."] if file.times else []


def _without_loads(
    path: str, file: ProblemFile, told: Mapping[str, Any], more: Mapping[str, Any], as_json: bool
) -> int:
    """Prove that the loads as they are cannot be carried; `more` are options that have no sense here."""
    for name, value in more.items():
        if value is not None:
            raise InputError(_option_name(name), value, "needs loads that are multiplied: give --load")
    proved = _write_proof(path, file.problem, (), told)
    document = {"loads": [], "message": "; ".join(proved), "remarks": _meant(file)}
    click.echo(_json_text(document) if as_json else "\n".join([*proved, *_meant(file)]))
    return 0


def _write_proof(path: str, problem: ContactProblem, loads: Iterable[str], told: Mapping[str, Any]) -> list[str]:
    """Write a proof file; what people read of it."""
    from qvi_contact.limit import check_proof as proofs
    from qvi_contact.limit.proof import limit_proof, save_proof

    proof = limit_proof(problem, list(loads), **told)
    save_proof(path, proof)
    found = proofs.sentences(*proofs.check(proof)[:2])
    return found + [f"not proved: the {side} bound ({reason})" for side, reason in proof["missing"].items()]


def safety(file: str, of: tuple[str, ...], accuracy: float, verbose: bool, as_json: bool, **given: Any) -> int:
    """Bound the factor of safety."""
    from qvi_contact.limit.load_factor import OPTIONS, strength_reduction_factor

    with (
        _opened(file, given) as (problem_file, _, options),
        solving(problem_file.title or "safety", verbose=verbose),
    ):
        told = {name: options.get(name) for name in OPTIONS}
        found = strength_reduction_factor(problem_file.problem, of=list(of) or None, accuracy=accuracy, **told)
    above = f"divided by {found.upper:.6g} they do not on any mesh" if found.upper < math.inf else "no bound above"
    said = f"strengths divided by {found.lower:.6g} carry the loads on this mesh; {above}"
    late = "The time limit ended the search: both bounds hold, but more time would bring them closer."
    remarks = [*_meant(problem_file), *[late] * (not found.in_time)]
    document = {"of": list(of), "lower": found.lower, "upper": found.upper, "remarks": remarks}
    click.echo(_json_text(document) if as_json else "\n".join([said, *remarks]))
    return 0 if found.lower >= 1.0 else 1


def check_proof(file: str) -> int:
    """Check a proof file."""
    from qvi_contact.limit import check_proof as proofs

    remedy = "give a file written by qvi-contact limit --proof"
    try:
        with open_regular(file) as stream:
            said, status = proofs.told(stream.read())
    except (OSError, ValueError) as error:
        raise InputError("file", file, f"cannot be read ({getattr(error, 'strerror', error)}): {remedy}") from error
    if status == 2:
        raise InputError("file", file, f"is {said}: {remedy}")
    click.echo(said)
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
    shown = tuple(f"{name}  ({what})" for name, what in (factorisations | missing).items())
    for title, names in {"methods": METHODS, "inner solvers": available(), "factorisations": shown}.items():
        click.echo("\n  ".join([title, *names]))


# several results of one problem file: load steps of a history, or values of a sweep


def _solved_series(
    file: ProblemFile, plan: SweepPlan | None, options: dict[str, Any], verbose: bool, store: str | None
) -> tuple[report.Series | None, Sequence[ContactResult]]:
    """The results of a file: of its history, of a sweep if there is a plan, or one."""
    if plan is not None:
        swept = _swept if plan.parameter in PARAMETERS else _swept_constant
        sweep = swept(file, plan, options, verbose)
        return report.Series(sweep, plan.parameter, plan.values, plan.of), sweep.steps
    if not file.times:
        with solving(file.title or "solve", verbose=verbose):
            return None, (solve_one(file.problem, **options, verbose=verbose),)
    with solving(file.title or "history", len(file.times), verbose=verbose) as advance:

        def told(number: int, _result: ContactResult) -> None:
            advance(f"step {number} of {len(file.times)} solved", number)

        history = qvi_contact.solve_history(file.problems, told, store=store, **options, verbose=verbose)
    return report.Series(history, "t", file.times), history.steps


def _swept_constant(file: ProblemFile, plan: SweepPlan, options: dict[str, Any], verbose: bool) -> qvi_contact.Sweep:
    """The sweep of a constant: each value is a problem of its own."""
    steps, limit = list[ContactResult](), options.get("time_limit")
    with solving(file.title or "sweep", len(plan.values), verbose=verbose) as advance, deadline(limit):
        for value in plan.values:
            if not (steps and deadline.over):
                problem = file.with_constants({plan.parameter.rpartition(".")[2]: value}).problem
                steps.append(solve_one(problem, **options, verbose=verbose))
                advance()
    return qvi_contact.Sweep(plan.parameter, plan.values, tuple(steps))


def _swept(file: ProblemFile, plan: SweepPlan, options: dict[str, Any], verbose: bool, **stored: Any) -> Any:
    """The sweep of a file; `stored` are a store, where its rows are kept then, and those who share it."""
    solved: Any = qvi_contact.solve_sweep  # with a store or without
    with solving(file.title or "sweep", len(plan.values), verbose=verbose) as advance:
        if stored:
            with suppress(InputError):  # what is no store will be told
                advance("", len(qvi_contact.read_sweep(stored["store"]).statuses))
        asked = plan.parameter, plan.values, plan.of
        try:
            return solved(file.problem, *asked, lambda *_: advance(), **stored, **options, verbose=verbose)
        except InputError as error:
            if error.field not in ("parameter", "values", "of"):  # also keys of [sweep]
                raise
            place = f"sweep.{error.field}" if plan is file.sweep else "--set"
            raise type(error)(place, error.value, error.remedy) from error


def _check_asked(file: ProblemFile, plan: SweepPlan | None, asked: Mapping[str, Any]) -> bool:
    """Whether a sweep goes to a file; refuse options, by name, that have no sense with one or without."""
    streams = plan is not None and asked["store"] is not None
    if streams:
        remedy = "needs a result, and a sweep with --store keeps rows of numbers alone: leave one of them out"
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
        if asked[name] is not None:
            raise InputError(f"--{name}", asked[name], remedy)
    return streams


def _told(file: ProblemFile, sweep: qvi_contact.StoredSweep, targets: Mapping[str, str], as_json: bool) -> int:
    """Print what became of a sweep in a store, keep its document in a file if one is named; the exit status."""
    statuses, solved = Counter(sweep.statuses), sweep.status == "solved"
    document = {
        "title": file.title, "solved": solved, "store": str(sweep.path), "parameter": sweep.parameter,
        "values": len(sweep.values), "statuses": {str(each): count for each, count in statuses.items()},
        "message": sweep.message,
    }  # fmt: skip
    complete = _written(targets, {"save_json": lambda path: write_text(path, _json_text(document) + "\n")}, {})
    lines = [f"{sweep.parameter}: {len(sweep.values)} values from {min(sweep.values):g} to {max(sweep.values):g}"]
    lines.append(", ".join(f"{count} {status.words}" for status, count in statuses.items()) or "none done")
    lines += [*([] if solved else [sweep.message]), f"rows: {sweep.path}"]
    return _ended(file, as_json, document, lines, solved, complete)


def _asked(file: ProblemFile, given: Sequence[str]) -> tuple[ProblemFile, SweepPlan | None]:
    """The file with constants that options --set give one value, and the sweep that another one or the file asks for.

    Each is `NAME=V1,V2,…`, or `NAME=START:STOP:COUNT`. The name is that of a constant of the file, of a parameter of
    sweeps, or `CONTACT.PARAMETER`, `load.NAME` or `constants.NAME`.
    """
    plans, constants = list[SweepPlan](), dict[str, float]()
    for text in given:
        name, separator, listed = text.partition("=")
        owner, _, parameter = name.strip().rpartition(".")
        if owner == "load" and parameter not in PARAMETERS:
            owner, parameter = parameter, owner
        values: tuple[float, ...] = ()
        with suppress(ValueError, TypeError):
            start, colon, rest = listed.partition(":")
            stop, _, count = rest.partition(":")
            if not colon:
                values = tuple(float(part) for part in listed.split(","))
            elif int(count) <= _MOST:
                values = tuple(np.linspace(float(start), float(stop), int(count)).tolist())
        if not (separator and parameter and values):
            remedy = (
                "write friction=0.1,0.2,0.3 (or load, gap, offset, a constant of the file), friction=0.1:0.3:21 for 21 "
                "values, or with a name base.friction=0.1,0.2 or load.thrust=1.2"
            )
            raise InputError("--set", text, remedy)
        known = {} if owner == "constants" else {"parameters": PARAMETERS}
        known_name("--set", parameter, {**known, "constants": () if owner not in ("", "constants") else file.constants})
        if owner == "constants" or parameter not in PARAMETERS:
            if len(values) == 1:
                constants[parameter] = values[0]
                continue
            owner, parameter = "", f"constants.{parameter}" if parameter in _TAKEN else parameter
        plans.append(SweepPlan(parameter, values, (owner,) if owner else None))
    if len(plans) > 1 or len({*constants, *(plan.parameter for plan in plans)}) < len(given):
        remedy = "name a number once, sweep one at a time: give one value of constants, one option for something else"
        raise InputError("--set", " ".join(given), remedy)
    if plans and file.times:
        raise InputError("--set", given[0], "a file with a [history] cannot be swept: give one without")
    file = file.with_constants(constants) if constants else file
    return file, plans[0] if plans else file.sweep


# files, checked before the work begins, and written as far as they can be


def _checked_targets(source: str, given: Mapping[str, str]) -> dict[str, str]:
    """The files asked for, by option.

    `InputError` if one cannot be written, is the problem file or another option's, or needs a package that is missing.
    """
    taken = {identity(source): "the problem file"}
    for option, path in given.items():
        name = _option_name(option)
        if path in ("", "-") or os.path.isdir(path):  # Path's raises for names that no file can have
            raise InputError(name, path, "give the name of a file")
        for each in _files_of(option, path):
            check_writable(each, name)
            place = identity(each)
            if place in taken:
                raise InputError(name, each, f"is {taken[place]}: give a file of its own")
            taken[place] = f"the file of {name} too"
        target = TARGETS[option]
        if target.library and find_spec(target.library) is None:
            raise InputError(name, path, f"needs {target.library}: python -m pip install {target.library}")
        if target.suffixes:
            check_suffix(name, path, *target.suffixes.split())
        if target.library == "matplotlib":
            from qvi_contact.plots.style import require_matplotlib

            require_matplotlib()
    return dict(given)


def _files_of(option: str, path: str) -> tuple[str, ...]:
    """What an option writes; a VTU file has one of contacts beside it."""
    whole = Path(path)
    return (path, str(whole.with_name(f"{whole.stem}_contacts{whole.suffix}"))) if option == "vtk" else (path,)


def _asked_panels(file: ProblemFile, panels: str | None) -> list[str] | None:
    """The contacts that --panels names, none for "none"; None for those that pictures choose."""
    names = [contact.name for contact in file.problem.contacts]
    if panels is None or panels in names:
        return None if panels is None else [panels]
    found = [] if panels == "none" else [part.strip() for part in panels.split(",")]
    return [known_name("--panels", name, {"contacts": names}) for name in found]


def _write_all(
    targets: Mapping[str, str],
    file: ProblemFile,
    result: ContactResult,
    document: dict[str, Any],
    *,
    known: Bracket | None = None,
    time_limit: float | None = None,
    **more: Any,
) -> bool:
    """Write the files asked for, as many as can be; whether all could be, and a line for each that could not.

    The picture is that of the result, or of a history. Pages and fields have the bracket, which takes at most
    `time_limit` seconds if it is not known. Other arguments are those of `result_page`.
    """
    series: Any = more.get("series")
    units = file.units

    @cache
    def bracketed() -> tuple[Bracket | None, str]:
        """The bracket, or why there is none: for incompressible materials, and after earlier slip on arcs."""
        from qvi_contact.bracket import bracket

        if known is not None or not result.has_state:
            return known, "there is no stress state"
        try:
            return bracket(result, time_limit=time_limit), ""
        except InputError as error:
            return None, error.remedy

    def plot(path: str) -> None:
        from qvi_contact import plots

        if file.times and series.results.steps[0].has_state and result.problem.contacts:
            plots.save_figure(path, plots.history_figure(series.results, units, file.times, file.title))
        else:
            plots.save_figure(path, plots.result_figure(result, units, file.title, more.get("panels")))

    def page(path: str) -> None:
        from qvi_contact.command.page import result_page

        write_text(path, result_page(file, result, bracketed, **more))

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
    return _written(targets, writers, stateless)


def _written(
    targets: Mapping[str, str], writers: Mapping[str, Callable[[str], None]], missing: Mapping[str, str]
) -> bool:
    """Write files by option, as many as can be, with a line for each that is not; whether none failed.

    Words for what there is nothing to write to stand in `missing`.
    """
    complete = True
    for option, path in targets.items():
        try:
            if option in missing:
                click.echo(f"qvi-contact: {missing[option]} {path}", err=True)
            else:
                writers[option](path)
        except (InputError, OSError, MemoryError) as error:  # also of a library that cannot open its fonts, or draw
            failure = error if isinstance(error, InputError) else unwritable(Path(path), error)
            name = _option_name(option) if failure.field == "output" else failure.field
            failure = InputError(name, failure.value, failure.remedy)
            click.echo(f"qvi-contact: {' '.join(str(failure).split())}", err=True)
            complete = False
    return complete


def _option_name(name: str) -> str:
    """How an option is typed."""
    return f"--{name.replace('_', '-')}"


def _json_text(document: object) -> str:
    """A document as JSON; numbers that are not finite are null."""
    return json.dumps(files.json_ready(document), indent=2, allow_nan=False)
