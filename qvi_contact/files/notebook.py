"""Meshes, problems and results as pieces of HTML, which notebooks show for an object at the end of a cell."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from markupsafe import Markup

from qvi_contact.basics.checks import FloatArray
from qvi_contact.basics.schema import defaults_of
from qvi_contact.basics.shown import shown
from qvi_contact.mesh.edges import Edges, points_along
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import Condition
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
    """The mesh in one line, drawn with its named parts in colours that a legend explains."""
    names = (*mesh.edge_names, *mesh.joint_names)
    keys = Markup(" ").join(
        Markup('<span style="white-space:nowrap">{} {}</span>').format(_stroke(number), name)
        for number, name in enumerate(names)
    )
    return Markup("<div><div>{}</div>{}<div>{}</div></div>").format(repr(mesh)[1:-1], _drawing(mesh, names), keys)


def problem_html(problem: ContactProblem) -> Markup:
    """The mesh of a problem, and a table of its materials and conditions."""
    rows = [["material", "", str(material)] for material in problem.materials]
    rows += [[type(c).__name__.lower(), c.edges, _given(c)] for c in problem.conditions]
    return Markup("<div>{}{}</div>").format(mesh_html(problem.mesh), _table(["", "edges", "given"], rows))


def result_html(result: ContactResult) -> Markup:
    """How a solve ended, and what its contacts carry."""
    lines = [result.message, *(f"Remark: {remark}" for remark in result.remarks)]
    found = Markup("").join(Markup("<div>{}</div>").format(line) for line in lines)
    if result.has_state and result.contacts:
        found += _contacts(result.contacts.values())
    return Markup("<div>{}</div>").format(found)


def contact_html(line: ContactLine) -> Markup:
    """What one contact carries, and how it moves."""
    tractions = {"pressure": -line.normal_stress, "|σ_T|": np.abs(line.tangential_stress)}
    motions = {"gap": line.gap, "|slip|": np.abs(line.slip)}
    rows = [["points", str(len(line.x))]]
    for group, unit, least in (
        (tractions, "stress", line.rounding.stress),
        (motions, "length", line.rounding.displacement),
    ):
        rows += [[f"largest {name} [{unit}]", shown(float(values.max()), least)] for name, values in group.items()]
    return Markup("<div>{}{}</div>").format(_contacts([line]), _table(["", line.name], rows))


def _contacts(lines: Iterable[ContactLine]) -> Markup:
    """Forces and shares of the length by contact."""
    lines = list(lines)
    states = list(dict.fromkeys(name for line in lines for name in line.shares))
    rows = [
        [
            line.name,
            *line.shown_forces,
            *(f"{100.0 * line.shares[name]:.1f} %" if name in line.shares else "-" for name in states),
        ]
        for line in lines
    ]
    return _table(["contact", "N [stress × length]", "T [stress × length]", *states], rows)


def _given(condition: Condition) -> str:
    """What a condition gives, without what goes without saying."""
    names = [name for name in type(condition).__dataclass_fields__ if name not in ("edges", "name")]
    values = {name: getattr(condition, name) for name in names}
    usual = defaults_of(type(condition))
    values = {name: value for name, value in values.items() if callable(value) or value != usual.get(name)}
    named = {name: "a function" if callable(value) else value for name, value in values.items() if value is not None}
    return ", ".join(f"{name} = {value}" for name, value in named.items())


def _table(heading: Sequence[str], rows: Sequence[Sequence[str]]) -> Markup:
    """Rows of cells."""
    cells = [Markup("").join(Markup("<td>{}</td>").format(cell) for cell in row) for row in rows]
    top = Markup("").join(Markup("<th>{}</th>").format(name) for name in heading)
    body = Markup("").join(Markup("<tr>{}</tr>").format(row) for row in cells)
    return Markup("<table><thead><tr>{}</tr></thead><tbody>{}</tbody></table>").format(top, body)


def _drawing(mesh: TriangleMesh, names: Sequence[str]) -> Markup:
    """The mesh as an inline picture: edges inside thin, the boundary thick, named parts in their looks."""
    lower, upper = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    scale = _SIZE / float((upper - lower).max())
    width, height = ((upper - lower) * scale + 2.0 * _MARGIN).tolist()
    places = (mesh.vertices - lower) * [scale, -scale] + [_MARGIN, height - _MARGIN]
    inner = mesh.interior if len(mesh.interior) <= _MOST_EDGES else mesh.interior.take(np.empty(0, dtype=np.int64))
    paths = [Markup('<path d="{}" stroke="#bbb" stroke-width="0.5"/>').format(_path(places, inner))]
    edges = mesh.boundary
    paths.append(Markup('<path d="{}" stroke="#444"/>').format(_path(places, edges)))
    for number, name in enumerate(names):
        edges = mesh.edges(name)
        path = _path(places, edges)
        paths.append(Markup('<path d="{}" {}><title>{}</title></path>').format(path, _look(number), name))
    size = Markup('width="{:.0f}" height="{:.0f}"').format(width, height)
    frame = Markup('<svg xmlns="http://www.w3.org/2000/svg" role="img" {} fill="none">{}</svg>')
    return frame.format(size, Markup("").join(paths))


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


def _look(number: int) -> Markup:
    colour, dashes = (looks[number % len(looks)] for looks in (_COLOURS, _DASHES))
    return Markup('stroke="{}" stroke-width="2.5" stroke-dasharray="{}"').format(colour, dashes)


def _stroke(number: int) -> Markup:
    """A short line in the look of a named part."""
    frame = Markup('<svg xmlns="http://www.w3.org/2000/svg" width="28" height="8"><path d="M0 4L28 4" {}/></svg>')
    return frame.format(_look(number))
