"""What the commands do: a function for each command of `cli`, with its options; what it returns is the exit status.

Rooms that only one of them needs are loaded in its function, or by a name of the package, when it comes to them.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

import click
import numpy as np

import qvi_contact
from qvi_contact import files
from qvi_contact.basics.schema import keys_of
from qvi_contact.basics.writing import write_text
from qvi_contact.command import report
from qvi_contact.command.cli import TARGETS
from qvi_contact.command.outputs import SecondModel, asked_panels, checked_targets, json_text, write_all, written
from qvi_contact.command.progress_line import solving
from qvi_contact.errors import InputError
from qvi_contact.files.problem_file import ProblemFile, SweepPlan, load_problem
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.settings import RefineOptions, Settings
from qvi_contact.solution.solver import solve as solve_one
from solvers import available
from solvers.basics.progress import deadline
from solvers.errors import known_name
from solvers.factorisation import available_backends, missing_backends
from solvers.factorisation.base import DENSE
from solvers.settings import METHODS

_MOST: Final = 1_000_000  # values that are asked for at once
_PARAMETERS: Final = ("friction", "load", "gap", "offset")
_OWN: Final = ("parameter", "values", "of")  # arguments of `solve_sweep`, and keys of [sweep]


@contextmanager
def _opened(
    file: str, given: dict[str, Any], single: str = ""
) -> Iterator[tuple[ProblemFile, dict[str, str], dict[str, Any]]]:
    """The problem in a file, the files to write, and arguments of `solve`: those of the file and those given.

    Input errors in the block have their paths in the file. `single` is what a file with load steps is refused for.
    """
    targets = checked_targets(file, {name: given[name] for name in TARGETS if given.get(name) is not None})
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


def _some(options: dict[str, Any], *names: str) -> dict[str, Any]:
    return {name: options[name] for name in names if name in options}


def _show(file: ProblemFile, found: dict[str, Any] | Iterable[str]) -> None:
    """Print a document for programs, or title, description and lines for people."""
    heading = filter(None, (file.title, *file.description.strip().splitlines()))
    click.echo(json_text(found) if isinstance(found, dict) else "\n".join((*heading, *found)))


def solve(
    file: str,
    verbose: bool,
    as_json: bool,
    swept: tuple[str, ...],
    store: str | None,
    panels: str | None,
    **given: Any,
) -> int:
    """Solve a problem, its history, or a sweep."""
    with _opened(file, given) as (problem_file, targets, options):
        problem_file, plan = _asked(problem_file, swept)
        units = problem_file.units
        charts = asked_panels(problem_file, panels)
        _check_asked(plan, store, given)
        if plan is not None and store is not None:
            shared = {name: given[name] for name in ("workers", "dask") if given[name] is not None}
            sweep = _swept(problem_file, plan, options, verbose, store=store, **shared)
            return _told(problem_file, sweep, targets.get("save_json"), as_json)
        series, steps = _solved_series(problem_file, plan, options, verbose, store)
        solved = (steps[0] if series is None else series.results).status == "solved"
        document = {"title": problem_file.title, "solved": solved}
        if as_json or "save_json" in targets:
            found = [files.summary(step, units) for step in steps]
            document |= found[0] if series is None else series.document(found, units)
        second = SecondModel(steps[-1], options.get("time_limit"))
        complete = write_all(file, targets, problem_file, second, document, charts, series=series)
    lines = report.result_lines(steps[0], units) if series is None else series.lines(units)
    _show(problem_file, document if as_json else lines)
    return 2 if not complete else 0 if solved else 1


def verify(result: str, tolerance: float | None, verbose: bool, as_json: bool) -> int:
    """Check a stored result."""
    from qvi_contact.verification import verify_file

    with np.errstate(all="ignore"):  # what overflows fails
        found = verify_file(result, tolerance)
    click.echo(json_text(found.document()) if as_json else found.table(failures_only=not verbose))
    return 0 if found.passed else 1


def check(file: str, as_json: bool, **given: Any) -> None:
    """Print what a problem file describes."""
    with _opened(file, given) as (problem_file, targets, options):
        problem, found = report.outline(problem_file, _some(options, "degree", "law_on"))
    if "plot" in targets:
        from qvi_contact import plots

        plots.save_figure(targets["plot"], plots.problem_figure(problem, problem_file.units))
    _show(problem_file, found if as_json else report.outline_lines(found, problem_file.units))


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
        complete = write_all(file, targets, problem_file, SecondModel(result, known=found), {})
    if as_json:
        document = {"title": problem_file.title, **files.summary(result, units)}
        _show(problem_file, document | {"bracket": None if found is None else outcome.document(found, units)})
    else:
        more = () if found is None else ("", *outcome.lines(found, units))
        _show(problem_file, (*report.result_lines(result, units), *more))
    bounded = found is not None and result.status == "solved" and math.isfinite(found.gap)
    return 2 if not complete else 0 if bounded else 1


def branches(file: str, verbose: bool, as_json: bool, **given: Any) -> int:
    """Look for other solutions."""
    from qvi_contact.bracket import other_solutions

    with _opened(file, given, "a search for other solutions") as (problem_file, targets, options):
        limit, title, units = options.pop("time_limit", None), problem_file.title or "branches", problem_file.units
        with solving(title, 2, verbose=verbose) as advance, deadline(limit):
            result = solve_one(problem_file.problem, **options, verbose=verbose)
            advance("solved; friction is followed from other values")
            found = other_solutions(result) if result.status == "solved" else None
        document = {"title": problem_file.title, **report.branches_document(result, found, units)}
        second = SecondModel(result if found is None else found.preferred, given["time_limit"])
        complete = write_all(file, targets, problem_file, second, document)
    _show(problem_file, document if as_json else report.branches_lines(result, found, units))
    return 2 if not complete else 0 if result.status == "solved" else 1


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
        document = {"title": problem_file.title, **files.summary(found.result, units)}
        document["refinement"] = report.refinement_document(found, units)
        second = SecondModel(found.result, options.get("time_limit"))
        complete = write_all(file, targets, problem_file, second, document, refinement=found)
    last = [line for line in report.result_lines(found.result, units) if not line or line not in found.message]
    _show(
        problem_file, document if as_json else (*report.refinement_lines(found, units), *([""] if last else []), *last)
    )
    return 2 if not complete else 0 if found.status == "reached" else 1


def limit(file: str, loads: tuple[str, ...], target: float | None, verbose: bool, as_json: bool, **given: Any) -> int:
    """Bound the largest multiple of loads."""
    from qvi_contact.limit.load_factor import checked_loads, limit_load_factor
    from qvi_contact.refinement import LimitFactor
    from qvi_contact.refinement import refine as refined

    with (
        _opened(file, given) as (problem_file, targets, options),
        solving(problem_file.title or "limit", verbose=verbose),
    ):
        space = _some(options, "degree")
        told: dict[str, Any] = {**space, "time_limit": given["time_limit"], "verbose": verbose}
        problem, refinement, proof = problem_file.problem, None, targets.pop("proof", None)
        if proof is not None and not loads:
            click.echo("\n".join(_write_proof(proof, problem, (), space.get("degree"))))
            return 0
        checked_loads(problem, loads, "--load")
        if target is None:
            found = limit_load_factor(problem, loads=list(loads), **told)
        else:
            refinement = refined(problem, target=target, quantity=LimitFactor(list(loads)), **told)
            found, problem = refinement.limit, refinement.problem
        proved = [] if proof is None else _write_proof(proof, problem, loads, space.get("degree"))
    said, units, missing = report.limit_lines(loads, found, refinement), problem_file.units, {}
    if found.mechanism is None and found.collapse is None:
        missing["plot"] = "there is no mechanism to draw in"
    if found.collapse is None:
        missing["vtk"] = "no part of the body yields, or it has no largest load: there is no flow to write to"

    def plot(path: str) -> None:
        from qvi_contact import plots

        plots.save_figure(path, plots.limit_figure(problem, found, units, problem_file.title, f"{said[0]}."))

    def page(path: str) -> None:
        from qvi_contact.command.page import Request, limit_page

        write_text(path, limit_page(Request.read(file, problem_file), problem, found, said))

    writers = {"plot": plot, "vtk": lambda path: files.write_collapse_vtu(path, problem, found, units), "report": page}
    complete = written(targets, writers, missing)
    if as_json:
        _show(problem_file, {"loads": list(loads), **report.limit_document(found, refinement)})
    else:
        click.echo("\n".join([*said, *proved]))
    missed = refinement is not None and refinement.status != "reached"
    return 2 if not complete else 1 if missed or found == -math.inf else 0


def _write_proof(path: str, problem: ContactProblem, loads: Iterable[str], degree: int | None) -> list[str]:
    """Write a proof file; what people read of it."""
    from qvi_contact.limit import check_proof as proofs
    from qvi_contact.limit.proof import limit_proof, save_proof

    proof = limit_proof(problem, list(loads), degree=degree)
    save_proof(path, proof)
    found = proofs.sentences(*proofs.check(proof)[:2])
    return found + [f"not proved: the {side} bound ({reason})" for side, reason in proof["missing"].items()]


def safety(file: str, of: tuple[str, ...], accuracy: float, verbose: bool, as_json: bool, **given: Any) -> int:
    """Bound the factor of safety."""
    from qvi_contact.limit.load_factor import strength_reduction_factor

    with (
        _opened(file, given) as (problem_file, _, options),
        solving(problem_file.title or "safety", verbose=verbose),
    ):
        found = strength_reduction_factor(
            problem_file.problem, of=list(of) or None, accuracy=accuracy, time_limit=given["time_limit"],
            **_some(options, "degree"),
        )  # fmt: skip
    if as_json:
        _show(problem_file, {"of": list(of), "lower": found.lower, "upper": found.upper})
    else:
        above = f"divided by {found.upper:.6g} they do not on any mesh" if found.upper < math.inf else "no bound above"
        click.echo(f"strengths divided by {found.lower:.6g} carry the loads on this mesh; {above}")
    return 0 if found.lower >= 1.0 else 1


def check_proof(file: str) -> int:
    """Check a proof file."""
    from qvi_contact.limit import check_proof as proofs

    remedy = "give a file written by qvi-contact limit --proof"
    try:
        *proved, counted = proofs.check(json.loads(Path(file).read_text(encoding="utf-8")))
    except OSError as error:
        raise InputError("file", file, f"cannot be read ({error.strerror}): {remedy}") from error
    except (LookupError, TypeError, AttributeError, ArithmeticError, UnicodeError, json.JSONDecodeError) as error:
        raise InputError("file", file, f"is no proof file of this version: {remedy}") from error
    except ValueError as error:
        click.echo(f"not proved: {error}")
        return 1
    checked = ", ".join(f"{count} {name}" for name, count in counted.items())
    click.echo("\n".join([*proofs.sentences(*proved), f"checked: {checked}"]))
    return 0


def keys(name: str) -> None:
    """List keys of problem files."""
    click.echo("\n".join(files.listed(name)))


def methods(as_json: bool) -> None:
    """List methods, inner solvers and factorisations."""
    factorisations = {DENSE: "up to 400 unknowns", **available_backends()}
    if as_json:
        document = {"methods": list(METHODS), "inner": list(available()), "factorisation": factorisations}
        click.echo(json_text(document))
        return
    missing = {name: f"not installed: {install}" for name, install in missing_backends().items()}
    shown = tuple(f"{name}  ({what})" for name, what in (factorisations | missing).items())
    for title, names in {"methods": METHODS, "inner solvers": available(), "factorisations": shown}.items():
        click.echo("\n  ".join([title, *names]))


# several results of one problem file: load steps of a history, or values of a sweep


def _solved_series(
    file: ProblemFile, plan: SweepPlan | None, options: dict[str, Any], verbose: bool, store: str | None = None
) -> tuple[report.Series | None, Sequence[ContactResult]]:
    """The results of a file: of its history, of a sweep if there is a plan, or one."""
    if store is not None and not file.times:
        remedy = "keeps steps of a history or rows of a sweep: give --set, or a file with a [history] or a [sweep]"
        raise InputError("--store", store, remedy)
    if plan is not None:
        swept = _swept if plan.parameter in _PARAMETERS else _swept_constant
        sweep = swept(file, plan, options, verbose)
        return report.Series(sweep, plan.parameter, plan.values), sweep.steps
    if not file.times:
        with solving(file.title or "solve", verbose=verbose):
            return None, (solve_one(file.problem, **options, verbose=verbose),)
    done = 0
    with solving(file.title or "history", len(file.times), verbose=verbose) as advance:

        def told(number: int, _result: ContactResult) -> None:
            nonlocal done
            while done < number:  # the first that is told need not be the first of all
                done += 1
                advance(f"step {done} of {len(file.times)} solved")

        history = qvi_contact.solve_history(file.problems, told, store=store, **options, verbose=verbose)
    return report.Series(history, "t", file.times), history.steps


def _swept_constant(file: ProblemFile, plan: SweepPlan, options: dict[str, Any], verbose: bool) -> qvi_contact.Sweep:
    """The sweep of a constant: each value is a problem of its own."""
    steps, limit = list[ContactResult](), options.pop("time_limit", None)
    with solving(file.title or "sweep", len(plan.values), verbose=verbose) as advance, deadline(limit):
        for value in plan.values:
            if not (steps and deadline.over):
                problem = file.with_constants({plan.parameter: value}).problem
                steps.append(solve_one(problem, **options, verbose=verbose))
                advance()
    return qvi_contact.Sweep(plan.parameter, plan.values, tuple(steps))


def _swept(file: ProblemFile, plan: SweepPlan, options: dict[str, Any], verbose: bool, **stored: Any) -> Any:
    """The sweep of a file; `stored` are a store, where its rows are kept then, and those who share it."""
    solved: Any = qvi_contact.solve_sweep  # with a store or without
    with solving(file.title or "sweep", len(plan.values), verbose=verbose) as advance:
        if stored:
            with suppress(InputError):  # what is no store will be told
                for _ in qvi_contact.read_sweep(stored["store"]).statuses:
                    advance()
        asked = plan.parameter, plan.values, plan.of
        try:
            return solved(file.problem, *asked, lambda *_: advance(), **stored, **options, verbose=verbose)
        except InputError as error:
            if error.field not in _OWN:
                raise
            place = f"sweep.{error.field}" if plan is file.sweep else "--set"
            raise type(error)(place, error.value, error.remedy) from error


def _check_asked(plan: SweepPlan | None, store: str | None, asked: Mapping[str, Any]) -> None:
    """Refuse options, by name, that have no sense without a sweep that goes to a file, or with one."""
    streams = plan is not None and store is not None
    if streams and plan is not None and plan.parameter not in _PARAMETERS:
        raise InputError("--store", store, f"keeps rows of {', '.join(_PARAMETERS)}: sweep a constant without it")
    for name in ("workers", "dask"):
        if not streams and asked[name] is not None:
            remedy = "is for values of a sweep: give --store FILE with --set, or with a [sweep] in the problem file"
            raise InputError(f"--{name}", asked[name], remedy)
    for name in ("plot", "vtk", "npz", "report"):
        if streams and asked[name]:
            remedy = "needs a result, and a sweep with --store keeps rows of numbers alone: leave one of them out"
            raise InputError(f"--{name}", asked[name], remedy)


def _told(file: ProblemFile, sweep: qvi_contact.StoredSweep, kept: str | None, as_json: bool) -> int:
    """Print what became of a sweep in a store, keep its document in a file if one is named; the exit status."""
    statuses, solved = Counter(sweep.statuses), sweep.status == "solved"
    document = {
        "title": file.title, "solved": solved, "store": str(sweep.path), "parameter": sweep.parameter,
        "values": len(sweep.values), "statuses": {str(each): count for each, count in statuses.items()},
        "message": sweep.message,
    }  # fmt: skip
    if kept is not None:
        write_text(kept, json_text(document) + "\n")
    lines = [f"{sweep.parameter}: {len(sweep.values)} values from {min(sweep.values):g} to {max(sweep.values):g}"]
    lines.append(", ".join(f"{count} {status.words}" for status, count in statuses.items()) or "none done")
    lines += [*([] if solved else [sweep.message]), f"rows: {sweep.path}"]
    _show(file, document if as_json else lines)
    return 0 if solved else 1


def _asked(file: ProblemFile, given: Sequence[str]) -> tuple[ProblemFile, SweepPlan | None]:
    """The file with constants that options --set give one value, and the sweep that another one or the file asks for.

    Each is `NAME=V1,V2,…`, or `NAME=START:STOP:COUNT`. The name is that of a constant of the file, of a parameter of
    sweeps, or `CONTACT.PARAMETER`, `load.NAME` or `constants.NAME`.
    """
    plans, constants = list[SweepPlan](), dict[str, float]()
    for text in given:
        name, separator, listed = text.partition("=")
        owner, _, parameter = name.strip().rpartition(".")
        if owner == "load" and parameter not in _PARAMETERS:
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
        known = {} if owner == "constants" else {"parameters": _PARAMETERS}
        known_name("--set", parameter, {**known, "constants": () if owner not in ("", "constants") else file.constants})
        if owner == "constants" or parameter not in _PARAMETERS:
            if len(values) == 1:
                constants[parameter] = values[0]
                continue
            owner = ""
        plans.append(SweepPlan(parameter, values, (owner,) if owner else None))
    if len(plans) > 1:
        remedy = "one number can be swept at a time: give one value of constants, and one option for something else"
        raise InputError("--set", " ".join(given), remedy)
    if plans and file.times:
        raise InputError("--set", given[0], "a file with a [history] cannot be swept: give one without")
    return file.with_constants(constants) if constants else file, plans[0] if plans else file.sweep
