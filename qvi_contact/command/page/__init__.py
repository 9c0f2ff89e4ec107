"""A result as one HTML page, with style, script, pictures and data inside: it loads no other file.

Numbers have five digits unless said otherwise, rounding noise is shown as 0, and the minus sign is a true one. Fields
are data that the page's script draws; it also shows the values under the pointer.
"""

import base64
import platform
import sys
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from hashlib import sha256
from shlex import quote
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from markupsafe import Markup

from qvi_contact import __version__
from qvi_contact.basics.checks import FloatArray
from qvi_contact.basics.writing import page_template
from qvi_contact.bracket import Bracket
from qvi_contact.command import report
from qvi_contact.companion import CompanionResult
from qvi_contact.discretization.space import FAMILY
from qvi_contact.files.problem_file import ProblemFile
from qvi_contact.limit.load_factor import LimitLoad
from qvi_contact.mesh.edges import Edges
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.plots.body import Scales
from qvi_contact.plots.figures import limit_figure, problem_figure, result_figure
from qvi_contact.plots.style import inline_image, magnified, new_figure, png_bytes, settings, svg_text
from qvi_contact.plots.tractions import contact_tractions, pieces_along
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.refinement import Refinement
from qvi_contact.solution.contact_line import SUMMARY, ContactLine, ContactState
from qvi_contact.solution.result import PLATE_COLUMNS, RESULTANT, ContactResult, contact_numbers
from qvi_contact.solution.stress import sample_body
from qvi_contact.units import Rounding, Units, shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_CHART_SIZE: Final = (9.0, 3.2)  # width and height of a chart of tractions [inch]
_MOST_STEPS: Final = 16  # steps with a picture: the page has to be small enough for mail


def result_page(
    file: ProblemFile,
    result: ContactResult,
    bracketed: Callable[[], tuple[Bracket | None, str]],
    refinement: Refinement | None = None,
    series: report.Series | None = None,
    panels: Sequence[str] | None = None,
) -> str:
    """The page of a result: of a solve, of a refinement, or of the last result of a series.

    `bracketed` returns the bracket of this result, or why there is none. Contacts in `panels`, or all, have charts.
    """
    steps = (result,) if series is None else series.results.steps
    bracket, missing = bracketed()
    companion = bracket.companion if bracket is not None and bracket.companion.has_state else None
    lines = result.contacts.values() if result.has_state else ()
    contacts = [_contact(line, file.units) for line in lines if panels is None or line.name in panels]
    several = [] if series is None or len(steps) == 1 else list(series.tables(file.units))
    return page_template("qvi_contact.command.page").render(
        **_frame(file, result.problem, "Contact problem"),
        result=result,
        number=number,
        bracket=bracket,
        missing=missing,
        refinement=refinement,
        refinement_table=report.refinement_table(refinement, file.units) if refinement else None,
        trust=report.trust(refinement, file.units) if refinement else "",
        several=[(*named, [[cell.replace("-", "−") for cell in row] for row in rows]) for *named, rows in several],
        said=() if series is None else tuple(series.said(file.units)),
        step_label="t" if series is None else series.label + series.owners,
        pictures=_pictures(steps, None if series is None else series.values, file),
        settings=_settings(result),
        field=field_data(result, companion, file.units) if result.has_state else None,
        contacts=contacts,
        tables=result_tables(result, file.units) if result.has_state else [],
    )


def limit_page(file: ProblemFile, problem: ContactProblem, limit: LimitLoad, lines: Sequence[str]) -> str:
    """The page of a limit load: its lines of text, and a picture of the motion on the mesh of the analysis."""
    mechanism, picture = limit.mechanism, ""
    if mechanism is not None or limit.collapse is not None:
        figure = limit_figure(problem, limit, file.units, answer=f"{lines[0]}.")
        picture = _picture(figure, "How the body gives way")
    contacts = {} if mechanism is None else mechanism.contacts
    return page_template("qvi_contact.command.page", "limit.html").render(
        **_frame(file, problem, "Limit load"),
        lines=lines,
        picture=picture,
        motions=[(name, *(number(value, 3, 1e-6) for value in (at.opening, at.slip))) for name, at in contacts.items()],
    )


def _frame(file: ProblemFile, problem: ContactProblem, title: str) -> dict[str, Any]:
    """Values for the frame of all pages: title, description, the problem, and how to repeat the computation."""
    files = [(name, sha256(path.read_bytes()).hexdigest()) for name, path in file.files.items()]
    return {
        "title": file.title or title,
        "paragraphs": [part for part in file.description.split("\n\n") if part.strip()],
        "made": datetime.now(tz=UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "command": " ".join(["qvi-contact", *map(quote, sys.argv[1:])]),
        "text": file.text,
        "files": [(f"file {name}", f"SHA-256 {digest}") for name, digest in files],
        "units": file.units,
        "problem": _picture(problem_figure(problem, file.units), "The problem: mesh, loads, contacts"),
    }


def _pictures(
    steps: Sequence[ContactResult], values: Sequence[float] | None, file: ProblemFile
) -> list[tuple[str, Markup]]:
    """The picture of a result, or pictures of at most _MOST_STEPS results of a series, each with its value."""
    if values is None or len(steps) == 1:
        figure = result_figure(steps[-1], file.units, panels=())
        return [("", _picture(figure, "The deformed body and what its contacts carry"))]
    numbers = np.unique(np.linspace(0, len(steps) - 1, min(len(steps), _MOST_STEPS)).round().astype(int)).tolist()
    pictures, scales = [], Scales.of(step for step in map(steps.__getitem__, numbers) if step.has_state)
    for index in numbers:
        picture = png_bytes(result_figure(steps[index], file.units, panels=(), scales=scales))
        source = f"data:image/png;base64,{base64.b64encode(picture).decode('ascii')}"
        pictures.append((f"{values[index]:g}", Markup('<img src="{}" alt="The deformed body">').format(source)))
    return pictures


def _contact(line: ContactLine, units: Units) -> dict[str, Any]:
    """Chart of the tractions, position of its axes in the picture, and values at the contact points."""
    with settings():
        figure = new_figure(*_CHART_SIZE)
        axes = figure.subplots()
        contact_tractions(axes, line, units)
        figure.legend(loc="outside right upper", frameon=False)
    picture = _picture(figure, f"Tractions along contact {line.name}")
    box, (low, high) = axes.get_position(), axes.get_xlim()  # valid after the picture was drawn
    frame = {"low": low, "high": high, "left": float(box.x0), "right": float(box.x1)}
    return {"name": line.name, "picture": picture, "data": contact_data(line, units) | frame}


def _picture(figure: "Figure", label: str) -> Markup:
    return Markup(inline_image(svg_text(figure, "picture"), label))


def _settings(result: ContactResult) -> list[tuple[str, str]]:
    """How the result was computed: element, method, tolerance, versions."""
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


def number(value: float, digits: int = 5, least: float = 0.0) -> str:
    """A number as text."""
    return shown(value, least, digits).replace("-", "−")


def _row(name: str, numbers: Mapping[str, float], columns: Mapping[str, str], least: Rounding) -> list[str]:
    """A row of a table: a name, and the numbers of these columns."""
    return [name, *(cell.replace("-", "−") for cell in report.cells(numbers, columns, least, digits=5))]


def contacts_table(lines: Sequence[ContactLine], units: Units) -> report.Titled:
    """The table of contacts: forces, extremes, shares of their length in each state."""
    states = [state for state in report.STATES if any(state in line.shares for line in lines)]
    labels = ("N", "T", "largest pressure", "largest |σ_T|", "largest gap", "largest |slip|")
    rows = [
        [*_row(line.name, line.summary(), SUMMARY, line.rounding), *report.shares(line.shares, states)]
        for line in lines
    ]
    return "Contacts", ["contact", *report.with_units(labels, SUMMARY, units), *states], rows


def result_tables(result: ContactResult, units: Units) -> list[report.Titled]:
    """The tables of a result: contacts, resultants on the edge sets of conditions, plates and pins."""
    least, numbers = result.rounding, contact_numbers(result)
    of_edges = {each.edges: result.resultant(each.edges) for each in result.problem.conditions}
    place, forces = report.about_middle(result.problem, of_edges)
    about = report.with_units(("F_x", "F_y", f"moment about {place}"), RESULTANT, units)
    resultants = [_row(name, force, RESULTANT, least) for name, force in forces.items()]
    plates = [_row(name, numbers[name], PLATE_COLUMNS, least) for name in result.plates]
    tables = [
        contacts_table(list(result.contacts.values()), units),
        ("Resultants of the tractions on the body", ["edges", *about], resultants),
        ("Rigid plates and pins, at their pivots", ["contact", *report.plate_headings(units)], plates),
    ]
    return [table for table in tables if table[2]]


def result_html(result: ContactResult) -> Markup:
    """Message, remarks and tables of a result, which a notebook shows at the end of a cell."""
    sentences = [result.message, *(f"Remark: {remark}" for remark in result.remarks)]
    lines = [Markup("<div>{}</div>").format(line) for line in sentences]
    tables = result_tables(result, Units()) if result.has_state else []
    return Markup("<div>{}</div>").format(Markup("").join([*lines, *map(_table_html, tables)]))


def contact_html(line: ContactLine) -> Markup:
    """The table of one contact, which a notebook shows at the end of a cell."""
    return _table_html(contacts_table([line], Units()))


def _table_html(table: report.Titled) -> Markup:
    _, headings, rows = table
    module: Any = page_template("qvi_contact.command.page", "table.html").module
    return Markup(module.table(headings, rows))


_PARTS: Final = (64, 48, 32, 24, 16, 8, 1)  # samples along the body's length, tried until at most _MOST_POINTS result
_MOST_POINTS: Final = 9_000
_LARGEST: Final = 120_000  # largest number of points on a page, which has to be small enough for mail
_COLOURS: Final = 33  # samples of a colour map


def field_data(result: ContactResult, companion: CompanionResult | None, units: Units) -> dict[str, Any] | None:
    """Points, small triangles, stresses and displacements of a result; None if there are too many points for a page.

    Arrays are little-endian in base64: float32, triangles uint32. Points are relative to the mesh's origin.
    """
    from matplotlib import colormaps

    for parts in _PARTS:
        samples = sample_body(result, parts)
        if len(samples.points) <= _MOST_POINTS:
            break
    if len(samples.points) > _LARGEST:
        return None
    mesh, reference = result.problem.mesh, samples.reference[:, None, -2:]
    moved = None if companion is None else companion.displacement_in(samples.cells, reference)[:, 0]
    largest = 0.0 if moved is None else float(np.hypot(*moved.T).max())
    return {
        "units": {"length": units.length, "stress": units.stress},
        "origin": mesh.origin.tolist(),
        "size": mesh.length,
        "points": _floats(samples.points - mesh.origin),
        "triangles": _encoded(samples.triangles.astype("<u4")),
        "stress": _floats(samples.stress),
        "alongZ": _floats(samples.along_z) if samples.along_z.any() else None,
        "displacement": None if moved is None else _floats(moved),
        "factorOfDisplacement": 0.0 if moved is None else magnified(largest, mesh.length) if largest else 1.0,
        "outline": _segments(mesh, mesh.boundary, companion),
        "mesh": _segments(mesh, mesh.interior, companion),
        "contacts": [_segments(mesh, mesh.edges(contact.edges), companion) for contact in result.problem.contacts],
        "colours": {  # red, green and blue from 0 to 255 along colour maps
            name: np.round(255 * colormaps[name](np.linspace(0.0, 1.0, _COLOURS))[:, :3]).astype(int).tolist()
            for name in ("cividis", "cividis_r", "PuOr_r")
        },
    }


def contact_data(line: ContactLine, units: Units) -> dict[str, Any]:
    """The points of a contact in the order of its chart, from left to right, with values of seven digits."""
    pieces = pieces_along(line)[0]
    order, places = (np.concatenate(part) for part in zip(*((piece.points, piece.s) for piece in pieces), strict=True))
    columns = {
        "pressure": -line.effective_normal_stress, "shear": line.tangential_stress,
        "bound": line.friction_bound, "gap": line.gap, "slip": line.slip,
    }  # fmt: skip
    document: dict[str, Any] = {name: _rounded(values[order]) for name, values in columns.items()}
    if line.has_fluid:
        document["fluid"] = _rounded(line.pore_pressure[order])
    document |= {"x": line.x[order].tolist(), "y": line.y[order].tolist(), "s": places.tolist()}
    document |= {"units": {"length": units.length, "stress": units.stress}}
    return document | {"state": [ContactState(state).name.lower() for state in line.state[order].tolist()]}


def _encoded(values: Any) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")


def _floats(values: FloatArray) -> str:
    return _encoded(values.astype("<f4"))


def _rounded(values: FloatArray) -> list[float | None]:
    return [float(f"{value:.7g}") if np.isfinite(value) else None for value in values.tolist()]


def _segments(mesh: TriangleMesh, edges: Edges, companion: CompanionResult | None) -> dict[str, Any]:
    """Both halves of edges as line segments, (x, y) of their ends, and displacements there in the first cell."""
    points = np.stack(mesh.points_along(edges, np.array([0.0, 0.5, 1.0])), axis=-1)
    moved = None
    if companion is not None:
        cells = edges.cells[:, 0]
        moved = companion.displacement_in(cells, mesh.reference(cells, points)[..., -2:])
    halves = [None if values is None else _floats(values[:, [0, 1, 1, 2]]) for values in (points - mesh.origin, moved)]
    return {"points": halves[0], "displacement": halves[1]}
