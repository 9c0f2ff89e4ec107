"""Meshes, problems and results as pieces of HTML, which notebooks show for an object at the end of a cell."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from markupsafe import Markup

from qvi_contact.basics.checks import FloatArray
from qvi_contact.basics.schema import defaults_of
from qvi_contact.basics.units import shown
from qvi_contact.mesh.edges import Edges, points_along
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.contact_line import ContactLine
from qvi_contact.solution.result import ContactResult

_SIZE: Final = 280.0  # of the longer side of a drawing [pixels]
_MARGIN: Final = 8.0
_CHORDS: Final = 8  # that an arc is drawn as
_MOST_EDGES: Final = 6000  # inside the body: more are left out, and the outline stays
_COLOURS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_DASHES: Final = ("none", "7 3", "2 3", "9 3 2 3", "12 4", "4 4")
"""Looks of named parts in turn, which differ without colour too."""


def mesh_html(mesh: TriangleMesh) -> Markup:
    """The mesh in one line, drawn with its named parts in colours that a legend explains.

    Edges inside are thin, the boundary is thick, named parts have their looks.
    """
    lower, upper = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    scale = _SIZE / float((upper - lower).max())
    width, height = ((upper - lower) * scale + 2.0 * _MARGIN).tolist()
    places = (mesh.vertices - lower) * [scale, -scale] + [_MARGIN, height - _MARGIN]
    inner = mesh.interior if len(mesh.interior) <= _MOST_EDGES else mesh.interior.take(np.empty(0, dtype=np.int64))
    paths = [Markup('<path d="{}" stroke="#bbb" stroke-width="0.5"/>').format(_path(places, inner))]
    paths.append(Markup('<path d="{}" stroke="#444"/>').format(_path(places, mesh.boundary)))
    legend = []
    for number, name in enumerate((*mesh.edge_names, *mesh.joint_names)):
        colour, dashes = (looks[number % len(looks)] for looks in (_COLOURS, _DASHES))
        look = Markup('stroke="{}" stroke-width="2.5" stroke-dasharray="{}"').format(colour, dashes)
        path = _path(places, mesh.edges(name))
        paths.append(Markup('<path d="{}" {}><title>{}</title></path>').format(path, look, name))
        line = Markup('<svg xmlns="http://www.w3.org/2000/svg" width="28" height="8"><path d="M0 4L28 4" {}/></svg>')
        legend.append(Markup('<span style="white-space:nowrap">{} {}</span>').format(line.format(look), name))
    frame = Markup(
        '<svg xmlns="http://www.w3.org/2000/svg" role="img" width="{:.0f}" height="{:.0f}" fill="none">{}</svg>'
    )
    drawing = frame.format(width, height, Markup("").join(paths))
    return Markup("<div><div>{}</div>{}<div>{}</div></div>").format(repr(mesh)[1:-1], drawing, Markup(" ").join(legend))


def problem_html(problem: ContactProblem) -> Markup:
    """The mesh of a problem, and a table of its materials and conditions, without what goes without saying."""
    rows = [["material", "", str(material)] for material in problem.materials]
    for condition in problem.conditions:
        usual, given = defaults_of(type(condition)), []
        for name in type(condition).__dataclass_fields__:
            value = getattr(condition, name)
            if name in ("edges", "name") or value is None or (not callable(value) and value == usual.get(name)):
                continue
            given.append(f"{name} = {'a function' if callable(value) else value}")
        rows.append([type(condition).__name__.lower(), condition.edges, ", ".join(given)])
    return Markup("<div>{}{}</div>").format(mesh_html(problem.mesh), _table(["", "edges", "given"], rows))


def result_html(result: ContactResult) -> Markup:
    """How a solve ended, and what its contacts carry."""
    lines = [result.message, *(f"Remark: {remark}" for remark in result.remarks)]
    found = Markup("").join(Markup("<div>{}</div>").format(line) for line in lines)
    if result.has_state and result.contacts:
        found += contacts_html(list(result.contacts.values()))
    return Markup("<div>{}</div>").format(found)


def contacts_html(lines: Sequence[ContactLine]) -> Markup:
    """What contacts carry, how they move, and in what states they are: forces, extremes, shares of the length."""
    states, rows = list(dict.fromkeys(name for line in lines for name in line.shares)), []
    for line in lines:
        stress, displacement = line.rounding.stress, line.rounding.displacement
        largest = [(-line.normal_stress, stress), (np.abs(line.tangential_stress), stress)]
        largest += [(line.gap, displacement), (np.abs(line.slip), displacement)]
        shares = [f"{100.0 * line.shares[name]:.1f} %" if name in line.shares else "-" for name in states]
        extremes = [shown(float(values.max()), least) for values, least in largest]
        rows.append([line.name, str(len(line.x)), *line.shown_forces, *extremes, *shares])
    forces = ["N [stress × length]", "T [stress × length]"]
    extremes = ["largest pressure [stress]", "|σ_T| [stress]", "gap [length]", "|slip| [length]"]
    return Markup("<div>{}</div>").format(_table(["contact", "points", *forces, *extremes, *states], rows))


def _table(heading: Sequence[str], rows: Sequence[Sequence[str]]) -> Markup:
    """Rows of cells."""
    cells = [Markup("").join(Markup("<td>{}</td>").format(cell) for cell in row) for row in rows]
    top = Markup("").join(Markup("<th>{}</th>").format(name) for name in heading)
    body = Markup("").join(Markup("<tr>{}</tr>").format(row) for row in cells)
    return Markup("<table><thead><tr>{}</tr></thead><tbody>{}</tbody></table>").format(top, body)


def _path(places: FloatArray, edges: Edges) -> str:
    """Edges between places (n, 2) on the page, where y points down, as lines, and arcs as chains of chords."""
    bent = edges.bent
    straight, arcs = edges.take(~bent), edges.take(bent)
    mirrored = replace(arcs, bend=-arcs.bend)
    chords = points_along(places, mirrored, np.linspace(0.0, 1.0, _CHORDS + 1))
    lines = np.stack([places[straight.first], places[straight.second]], axis=1)
    return "".join(
        "M" + "L".join(f"{x:g} {y:g}" for x, y in line)
        for line in (*lines.round(1).tolist(), *chords.round(1).tolist())
    )
