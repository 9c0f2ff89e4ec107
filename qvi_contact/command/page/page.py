"""A result as one HTML page that loads nothing: style, script, pictures and data are inside."""

import base64
import io
import platform
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from markupsafe import Markup

from qvi_contact.basics.units import Units
from qvi_contact.basics.writing import page_template
from qvi_contact.command.outputs import SecondModel
from qvi_contact.command.page.fields import contact_data, field_data
from qvi_contact.command.page.numbers import (
    contact_headings,
    contact_rows,
    number,
    plate_rows,
    resultant_headings,
    resultant_rows,
    step_tables,
)
from qvi_contact.command.report import STATES, plate_headings, refinement_headings, refinement_rows, trust
from qvi_contact.command.series import Series
from qvi_contact.discretization.space import FAMILY
from qvi_contact.files.problem_file import ProblemFile
from qvi_contact.limit.load_factor import LimitLoad
from qvi_contact.plots.body import Scales
from qvi_contact.plots.figures import limit_figure, problem_figure, result_figure
from qvi_contact.plots.inline import inline_svg, svg_text
from qvi_contact.plots.style import laid_out, new_figure, settings
from qvi_contact.plots.tractions import contact_tractions
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.refinement import Refinement
from qvi_contact.solution.contact_line import ContactLine
from qvi_contact.solution.result import ContactResult
from qvi_contact.version import __version__

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from qvi_contact.bracket import Bracket

_WIDE: Final = (9.0, 3.2)  # of a picture of tractions [inch]
_MOST_STEPS: Final = 16  # with a picture: a page is to be mailed
_DOTS: Final = 120.0  # of their pixels, an inch


@dataclass(frozen=True)
class Request:
    """What was asked for.

    Attributes
    ----------
    file : ProblemFile
        The problem.
    text : str
        The problem file as it was read.
    command : str
        The command line.
    files : tuple of (name, SHA-256)
        Other files that were read.

    """

    file: ProblemFile
    text: str
    command: str
    files: tuple[tuple[str, str], ...] = ()

    @classmethod
    def read(cls, path: str, file: ProblemFile, command: str) -> "Request":
        """The problem file read again as text, and the mesh file that it names, if it does."""
        text = Path(path).read_text(encoding="utf-8-sig")
        name = tomllib.loads(text).get("mesh", {}).get("file")
        if name is None:
            return cls(file, text, command)
        digest = sha256((Path(path).parent / name).read_bytes()).hexdigest()
        return cls(file, text, command, ((name, digest),))


def result_page(
    request: Request,
    steps: Sequence[ContactResult],
    second: SecondModel | None = None,
    refinement: Refinement | None = None,
    series: Series | None = None,
    panels: Sequence[str] | None = None,
) -> str:
    """The page about the result of a solve, of a refinement, or of the last of several in a series.

    The bracket of a single result is that of the second model, which is computed for it. Contacts in `panels` have
    charts, all of them by default.
    """
    file, result = request.file, steps[-1]
    second = second or SecondModel(result)
    bracket, missing = (
        (second.bracket, second.missing)
        if len(steps) == 1
        else (None, "bounds are computed for a single solve only, and this is one of several results")
    )
    shown = (
        _shown(result, bracket, file.units, panels)
        if result.has_state
        else {"field": None, "contacts": [], "tables": []}
    )
    names = [contact.name for contact in result.problem.contacts]
    forces, plates = step_tables(steps, series.values) if series is not None and len(steps) > 1 else ([], {})
    text: str = page_template("qvi_contact.command.page").render(
        **_frame(request, result.problem, "Contact problem"),
        result=result,
        number=number,
        bracket=bracket,
        missing=missing,
        refinement=None if refinement is None else _refinement(refinement, file.units),
        steps=forces,
        step_label="t" if series is None else series.label,
        pictures=_pictures(steps, None if series is None else series.values, file),
        settings=[*_settings(result), *((f"file {name}", f"SHA-256 {digest}") for name, digest in request.files)],
        plate_steps=plates,
        plate_headings=plate_headings(file.units),
        step_headings=[f"{force} {name}" for name in names for force in "NT"],
        contact_data=[contact["data"] for contact in shown["contacts"]],
        **shown,
    )
    return text


def limit_page(request: Request, problem: ContactProblem, limit: LimitLoad, lines: Sequence[str]) -> str:
    """The page about a limit load: what people read of it, and how the body gives way, on the mesh of the analysis."""
    file, moved = request.file, limit.mechanism
    picture = ""
    if moved is not None or limit.collapse is not None:
        figure = limit_figure(problem, limit, file.units, answer=f"{lines[0]}.")
        picture = _picture(figure, "result", "How the body gives way")
    contacts = {} if moved is None else moved.contacts
    text: str = page_template("qvi_contact.command.page", "limit.html").render(
        **_frame(request, problem, "Limit load"),
        lines=lines,
        picture=picture,
        motions=[(name, *(number(value, 3, 1e-6) for value in (at.opening, at.slip))) for name, at in contacts.items()],
    )
    return text


def _frame(request: Request, problem: ContactProblem, title: str) -> dict[str, Any]:
    """What all pages say around their answer: title, description, the problem, how to repeat it."""
    file = request.file
    return {
        "title": file.title or title,
        "paragraphs": [part for part in file.description.split("\n\n") if part.strip()],
        "made": datetime.now(tz=UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "request": request,
        "units": file.units,
        "problem": _picture(problem_figure(problem, file.units), "problem", "The problem: mesh, loads, contacts"),
    }


def _refinement(found: Refinement, units: Units) -> dict[str, Any]:
    """Rounds of a refinement, how it ended, and how far the number can be trusted."""
    return {
        "message": found.message,
        "trust": trust(found, units),
        "headings": refinement_headings(found, units),
        "rounds": refinement_rows(found),
        "advice": "" if found.status == "reached" else found.status.advice,
    }


def _pictures(
    steps: Sequence[ContactResult], values: Sequence[float] | None, file: ProblemFile
) -> list[tuple[str, Markup]]:
    """The picture of a result; of several those of some of them, the first and the last among them, with the value."""
    if values is None or len(steps) == 1:
        figure = result_figure(steps[-1], file.units, panels=())
        return [("", _picture(figure, "result", "The deformed body and what its contacts carry"))]
    chosen = np.unique(np.linspace(0, len(steps) - 1, min(len(steps), _MOST_STEPS)).round().astype(int)).tolist()
    found, scales = [], Scales.of(step for step in map(steps.__getitem__, chosen) if step.has_state)
    for step in chosen:
        picture = io.BytesIO()
        figure = result_figure(steps[step], file.units, panels=(), scales=scales)
        with settings(), laid_out(figure, "png", _DOTS):
            figure.savefig(picture, format="png", dpi=_DOTS, metadata={"Software": None})
        source = f"data:image/png;base64,{base64.b64encode(picture.getvalue()).decode('ascii')}"
        found.append((f"{values[step]:g}", Markup('<img src="{}" alt="The deformed body">').format(source)))
    return found


def _shown(
    result: ContactResult, bracket: "Bracket | None", units: Units, panels: Sequence[str] | None
) -> dict[str, Any]:
    """Tables and pictures of a stress state."""
    lines = list(result.contacts.values())
    states = [state for state in STATES if any(state in line.shares for line in lines)]
    companion = bracket.companion if bracket is not None and bracket.companion is not None else None
    tables = [("Resultants of the tractions on the body", resultant_headings(units), resultant_rows(result))]
    if lines:
        tables.insert(0, ("Contacts", contact_headings(units, states), contact_rows(lines, states)))
    if result.plates:
        tables.append(("Rigid plates and pins", ["contact", *plate_headings(units)], plate_rows(result)))
    return {
        "field": field_data(result, companion if companion is not None and companion.has_state else None, units),
        "contacts": [
            _contact(line, f"contact-{number}", units)
            for number, line in enumerate(lines, 1)
            if panels is None or line.name in panels
        ],
        "tables": tables,
    }


def _contact(line: ContactLine, name: str, units: Units) -> dict[str, Any]:
    """Picture of the tractions, where its axes lie in it, and the values at the points."""
    with settings():
        figure = new_figure(*_WIDE)
        axes = figure.subplots()
        contact_tractions(axes, line, units)
        figure.legend(loc="outside right upper", frameon=False)
        with laid_out(figure, "svg", figure.dpi):
            box, (low, high) = axes.get_position(), axes.get_xlim()
    frame = {"low": low, "high": high, "left": float(box.x0), "right": float(box.x1)}
    return {
        "name": line.name,
        "id": name,
        "picture": _picture(figure, name, f"Tractions along contact {line.name}"),
        "data": contact_data(line, units) | frame,
    }


def _picture(figure: "Figure", name: str, label: str) -> Markup:
    return Markup(inline_svg(svg_text(figure, name), name, label))


def _settings(result: ContactResult) -> list[tuple[str, str]]:
    """How the answer was computed, and by what."""
    solution, space, qvi = result.solution, result.discretization.space, result.discretization.qvi
    used = {
        "element": f"{FAMILY}, degree {space.degree}",
        "mesh": repr(result.problem.mesh)[1:-1],
        "unknowns": f"{qvi.n}, and {qvi.m} contact points",
        "method": " ".join(filter(None, [solution.method, solution.inner])),
        "factorisation": solution.factorisation,
        "iterations": str(result.iterations),
        "tolerance": f"{result.certificate.tolerance:g}",
        "seconds": f"{sum(solution.timings.values()):.2g}",
        "qvi-contact": __version__,
        "Python": f"{platform.python_version()} on {platform.system()} {platform.machine()}",
        **solution.versions,
    }
    return [(name, value) for name, value in used.items() if value]
