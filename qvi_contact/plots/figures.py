"""Whole figures: a result, a history with its loops, a problem, a mesh, how a body gives way at its limit load."""

import textwrap
from collections.abc import Sequence
from contextlib import suppress
from importlib.util import find_spec
from math import isqrt
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np

from qvi_contact.basics.checks import FloatArray, evaluate, instance_of, names_among, real_array
from qvi_contact.errors import InputError
from qvi_contact.limit.load_factor import Collapse, LimitLoad
from qvi_contact.mechanism import Mechanism
from qvi_contact.mesh.edges import Edges, cross, turned
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.plots import style
from qvi_contact.plots.body import Scales, draw_body
from qvi_contact.plots.problem import draw_problem, draw_symbols
from qvi_contact.plots.style import Written, beside, lines, spread
from qvi_contact.plots.tractions import contact_tractions
from qvi_contact.problem.conditions import CARTESIAN, Displacement, components
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.history import History
from qvi_contact.solution.result import ContactResult
from qvi_contact.units import Units
from solvers import Status

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PARTS: Final = (style.BLUE, style.VERMILLION, style.GREEN, style.PURPLE, style.ORANGE, style.SKY)  # of named edges
_PANELS: Final = 2  # at most so many charts unless some are asked for
_WIDTH: Final = 6.3  # of a picture of a result [inch]: that of the text on a page
_BODY: Final = 4.6  # about the width of the body in it
_PASSES: Final = 6  # until texts beside the body have room
_CHART: Final = 1.5  # height of a chart
_SAID: Final = 2  # contacts named in the answer
_CANCELLED: Final = 1e-6  # size of a resultant over its parts, up to which it has no direction
_SHARE: Final = 0.005  # of a contact's length from which on a state is named


def result_figure(
    result: ContactResult,
    units: Units | None = None,
    title: str = "",
    panels: Sequence[str] | None = None,
    component: str = "von_mises",
    scales: Scales | None = None,
) -> "Figure":
    """A result as one would put it in a report: the deformed body, and charts along contacts.

    The problem's title and the answer stand above, what the solver says small below. `draw_body` says what is drawn,
    and which stresses `component` names. Without a stress state, as of an infeasible problem, the loads are drawn, and
    how the mechanism moves the blocks, if there is one. Contacts in `panels` have a chart of pressure and friction
    each; by default at most two, which are no more than one line. `scales` are those of several results that are looked
    at beside each other. `InputError` if there is no contact of a name, or no such stress.
    """
    units = style.plain_units(units)
    instance_of(ContactResult, "result", result, "give a ContactResult, such as solve returns, or one of the steps")
    names = [contact.name for contact in result.problem.contacts]
    if panels is not None:
        panels = names_among("panels", panels, "contacts", names, least=0)
    if not result.has_state:
        said = result.message.removesuffix(result.solution.message).rstrip(": ")
        reason = f"{said or f'Not solved: {result.status.words}'}. {result.status.advice}"
        return _motion_figure(result.problem, result.mechanism, title, reason, result.solution.message, units)
    if panels is None:
        panels = [line.name for line in result.contacts.values() if len(line.path.lines) == 1][:_PANELS]
    with style.settings():
        figure = style.new_figure(_WIDTH, _WIDTH)
        body, *charts = figure.subplots(1 + len(panels), 1, squeeze=False)[:, 0]
        drawn = draw_body(body, result, component, units, scales)
        if callable(result.problem.body_potential):
            body.plot([], [], " ", label=f"{_body_force(result.problem)} body force".strip())
        style.legend_below(body, [body], 3)
        for panel, name in zip(charts, panels, strict=True):
            contact_tractions(panel, result.contacts[name], units)
            if drawn.pressure == 0.0:
                most = float(np.abs(result.gauss_stress()[2]).max())
                panel.set_ylim(0.0, most if most > result.rounding.stress else 1.0)  # rather than rounding
            if len(names) > 1:
                panel.set_title(style.plain_text(name), loc="left", fontsize="medium")
        if charts:
            style.legend_below(charts[-1], charts, 6)
        _placed(figure, drawn.box, title, _answer(result, units), result.solution.message, drawn.written)
    return figure


def _placed(
    figure: "Figure", box: FloatArray, title: str, answer: str, foot: str, written: Sequence[Written] = ()
) -> None:
    """Write title, answer and foot; give the body the height its box (2, 2) [length] wants, and its texts room."""
    body, *charts = figure.axes
    place_of = body.get_subplotspec()
    assert place_of is not None  # all were made by `subplots`
    grid = place_of.get_gridspec()
    together = ((text.replace(" = ", "\u00a0=\u00a0"), count) for text, count in ((answer, 88), (foot, 140)))
    answer, foot = (textwrap.fill(text, count).replace("\u00a0", " ") for text, count in together)
    above = 0.1 + 0.22 * bool(title) + 0.17 * (answer.count("\n") + 1)
    below = 0.06 + 0.12 * (foot.count("\n") + 1)
    texts = [
        figure.text(0.01, 1.0, style.plain_text(title), va="top", fontsize="large", fontweight="bold"),
        figure.text(0.01, 1.0, style.plain_text(answer), va="top"),
        figure.text(0.01, 0.0, style.plain_text(foot), va="bottom", fontsize=6.0, color=style.GREY),
    ]
    for _ in range(_PASSES if written else 1):
        across, up = box[1] - box[0]
        height = float(np.clip(_BODY * up / across, 1.5, 4.6))
        heights = [height + 0.75, *[_CHART] * len(charts)]
        whole = sum(heights) + above + below
        figure.set_size_inches(_WIDTH, whole)
        grid.set_height_ratios(heights)
        figure.set_layout_engine("constrained", rect=(0.0, below / whole, 1.0, 1.0 - (above + below) / whole))
        for text, place in zip(texts, (-0.07, -0.1 - 0.22 * bool(title), 0.05), strict=True):
            text.set_y(place / whole + (place < 0.0))
        body.set(xlim=box[:, 0], ylim=box[:, 1])
        body.locator_params(axis="x", nbins=max(2, round(min(_BODY, height * across / up) / 0.7)))
        body.locator_params(axis="y", nbins=max(2, round(min(height, _BODY * up / across) / 0.5)))
        spread(body, written)
        for text, _ in written:
            low, high = body.transData.inverted().transform(text.get_window_extent().get_points())
            margin = 0.01 * (box[1] - box[0])
            box = np.array([np.minimum(box[0], low - margin), np.maximum(box[1], high + margin)])


def _answer(result: ContactResult, units: Units) -> str:
    """What the largest contacts carry and how they touch, obstacles first; why a result is not to be trusted."""
    joints = {joint.name for joint in result.problem.joints}
    lines = sorted(result.contacts.values(), key=lambda line: (line.name in joints, -abs(line.normal_force)))
    said, verbs = [], {"open": "open", "stick": "sticks", "slip": "slips", "closed": "closed"}
    for line in lines[:_SAID]:
        normal, tangential = beside(line.forces)
        effective = f" (effective {beside([line.effective_normal_force])[0]})" if line.has_fluid else ""
        along = "" if line.frictionless else f", T = {tangential}"
        words = [f"N = {normal}{effective}{along}\u00a0{units.force}"]
        shares = {verbs[name]: f"{100.0 * share:.0f}\u00a0%" for name, share in line.shares.items() if share >= _SHARE}
        words += [f"all\u00a0{verb}" if len(shares) == 1 else f"{share}\u00a0{verb}" for verb, share in shares.items()]
        motion = result.plates.get(line.name)
        if motion is not None and np.hypot(motion.x, motion.y) > line.rounding.displacement:
            words.append(f"moves {beside([float(np.hypot(motion.x, motion.y))])[0]}\u00a0{units.length}")
        said.append(f"{line.name}: {', '.join(words)}")
    status = "" if result.status is Status.SOLVED else f"Not solved ({result.status.words}). "
    return status + "; ".join(said) + ("." if said else "")


def _body_force(problem: ContactProblem) -> str:
    """Where the body force pulls, as an arrow; nothing where its parts cancel out."""
    edges = problem.mesh.boundary
    x, y = problem.mesh.points_along(edges, np.array([0.5]))
    values = evaluate("ContactProblem.body_potential", problem.body_potential, x[:, 0], y[:, 0])
    force = -(values * edges.length) @ edges.normal  # ∫ −∇φ dx
    if np.hypot(*force) <= _CANCELLED * (np.abs(values) @ edges.length):
        return ""
    return "→↗↑↖←↙↓↘"[round(float(np.arctan2(force[1], force[0])) / (np.pi / 4.0)) % 8]


def mesh_figure(mesh: TriangleMesh) -> "Figure":
    """One picture of a mesh: its triangles, and its named edges and joints, which differ without colour too."""
    with style.settings():
        sides = np.ptp(mesh.vertices, axis=0)
        figure = style.new_figure(*(5.0 * sides / sides.max() + [3.0, 1.0]))
        axes = figure.subplots()
        style.draw_grid(axes, mesh)
        style.draw_outline(axes, mesh)
        for number, name in enumerate((*mesh.edge_names, *mesh.joint_names)):
            look = _PARTS[number % 6], ("-", "--", ":", "-.")[number % 4], 2.0
            axes.add_collection(lines(style.edge_lines(mesh, mesh.edges(name)), *look, style.plain_text(name)))
        style.show_all(axes, mesh.vertices, Units())
        figure.legend(loc="outside right upper", frameon=False)
    return figure


def problem_figure(problem: ContactProblem, units: Units | None = None) -> "Figure":
    """One picture of a problem: mesh, materials, conditions, loads, contacts, joints."""
    instance_of(ContactProblem, "problem", problem, "give a ContactProblem, such as load_problem(FILE).problem")
    with style.settings():
        sides = np.ptp(problem.mesh.vertices, axis=0)
        scale = 6.0 / max(1.25 * sides[0], 1.5 * sides[1])  # what is around the body takes room too
        figure = style.new_figure(scale * sides[0] + 6.5, max(3.2, scale * (sides[1] + 0.4 * max(sides)) + 0.7))
        draw_problem(figure.subplots(), problem, units)
    return figure


def limit_figure(
    problem: ContactProblem, limit: LimitLoad, units: Units | None = None, title: str = "", answer: str = ""
) -> "Figure":
    """One picture of a limit load: how the body gives way, under its loads as small arrows.

    `draw_mechanism` says what is drawn. The problem is that on the mesh of the analysis, `LimitRefinement.problem`; the
    limit is what `limit_load_factor` has found. The problem's title and the answer, how much it carries, stand above.
    `InputError` if the limit load has no mechanism, since there is no upper limit, or no multiple at all.
    """
    instance_of(ContactProblem, "problem", problem)
    instance_of(LimitLoad, "limit", limit)
    motion = limit.mechanism or limit.collapse
    if motion is None:
        raise InputError("limit", repr(limit), "there is no mechanism to draw: no load is the largest one")
    return _motion_figure(problem, motion, title, answer or repr(limit), "", style.plain_units(units))


def _motion_figure(
    problem: ContactProblem, motion: Mechanism | Collapse | None, title: str, answer: str, foot: str, units: Units
) -> "Figure":
    """How a body gives way: blocks moved, or where it yields and flows; obstacles, loads and supports."""
    mesh = problem.mesh
    with style.settings():
        figure = style.new_figure(_WIDTH, _WIDTH)
        axes = figure.subplots()
        words, ends = "", [mesh.vertices]
        if motion is None:
            style.draw_outline(axes, mesh)
        else:
            ends.append(draw_mechanism(axes, mesh, motion))
            words = "How the body moves beyond that, magnified; dashed: where it is."
            words += " Orange: where it yields." * isinstance(motion, Collapse)
        ends += draw_symbols(axes, problem, obstacles=True)
        axes.set_title(words, fontsize="small", loc="left")
        box = style.show_all(axes, np.concatenate(ends), units)
        _placed(figure, box, title, answer, foot)
    return figure


_DEEPEST: Final = 0.95  # share of the triangles that dissipate less than what has the deepest colour
_APART: Final = 1e-6  # share of the body's length from which on sides of an edge are drawn apart


def draw_mechanism(axes: "Axes", mesh: TriangleMesh, motion: Mechanism | Collapse) -> FloatArray:
    """Draw a body where a motion takes it, over dashed outlines of where it was; the ends of both (n, 2).

    Motions are small; they are drawn so large that the largest displacement is 8 % of the body's length, and rotations
    of blocks without the growth that comes with that. Where a body yields it is orange, the deeper the more power it
    dissipates for its area. `ContactResult.mechanism`, `LimitLoad.mechanism` and `LimitLoad.collapse` give motions, on
    the mesh of the analysis; axes are in units of length.
    """
    from matplotlib.collections import PolyCollection

    after, scale = mesh.corners.copy(), style.LONGEST * mesh.length
    colours: str | FloatArray = "#d6e6f2"
    if isinstance(motion, Mechanism):
        for number, rigid in enumerate(motion.motions):
            own = motion.blocks == number
            arm = turned(after[own] - rigid.centre, np.arctan(scale * rigid.rotation))
            after[own] = rigid.centre + arm + scale * np.array([rigid.x, rigid.y])
    else:
        flow, (a, b, c) = motion.motion, mesh.corners.swapaxes(0, 1)
        second = -isqrt(2 * flow.velocities.shape[2])  # of a part's corners, after the first
        velocity = flow.velocities[:, [1, 0, 0], [0, 0, second]]  # at the corners of each triangle
        after += scale / max(float(np.hypot(*velocity.T).max()), 1e-300) * velocity
        density = flow.dissipation / np.abs(cross(b - a, c - a))
        shade = np.sqrt(np.minimum(density / max(float(np.quantile(density, _DEEPEST)), 1e-300), 1.0))
        colours = np.column_stack([np.tile([0.9, 0.45, 0.0], (len(shade), 1)), 0.85 * shade])

    def ends(edges: Edges, side: int) -> FloatArray:
        cells = edges.cells[:, side]
        corners = ((mesh.cells[cells] == nodes[:, None]).argmax(axis=1) for nodes in (edges.first, edges.second))
        return np.stack([after[cells, corner] for corner in corners], axis=1)

    axes.add_collection(PolyCollection(list(after), facecolors=colours, antialiased=False, zorder=1.0))
    one, other = ends(mesh.interior, 0), ends(mesh.interior, 1)
    apart = np.abs(one - other).max(axis=(1, 2)) > _APART * mesh.length
    moved = np.concatenate([ends(mesh.boundary, 0), one[apart], other[apart]])
    rest = mesh.vertices[mesh.topology.ends[np.append(mesh.topology.outer, mesh.topology.inner[apart])]]
    axes.add_collection(lines(rest, style.GREY, (0, (4, 3)), 0.7))
    axes.add_collection(lines(moved, style.BLUE, "solid", 1.0, "mechanism"))
    return np.concatenate([rest.reshape(-1, 2), moved.reshape(-1, 2)])


_LETTERS: Final = 13  # an inch
_ROOM: Final = 0.12  # for numbers around the body, as a share of its drawing
_LOOPS: Final = 4  # at most so many loops, and forces of contacts


def history_figure(
    history: History,
    units: Units | None = None,
    times: Sequence[float] | None = None,
    title: str = "",
) -> "Figure":
    """The deformed body in the last step, hysteresis loops of up to four contacts, and forces of contacts step by step.

    A loop needs something that moves, such as an obstacle or a prescribed displacement. Under loads alone there are
    forces only. Steps are read one by one. With `times`, the value of t in each step, forces are drawn over t instead
    of the number of the step, a hollow square at the first one. The body is that of the last step that has a state. The
    problem's title, and what the history says of itself, stand above.

    `InputError` if there is nothing to draw, or not a time for each step.
    """
    instance_of(History, "history", history)
    units = style.plain_units(units)
    abscissa = None if times is None else real_array("times", times)
    forces: dict[str, list[tuple[float, float]]] = {}
    last = None
    for number, each in enumerate(history.steps, 1):
        if each.has_state:
            last = number, each
            for name, line in each.contacts.items():
                forces.setdefault(name, []).append(line.forces)
    loops = {} if last is None else _loops(history, last[1].problem)
    if last is None or not (forces or loops):
        raise InputError("history", history, "there is no contact whose loop or forces could be drawn")
    count = max(map(len, forces.values()), default=0)
    if abscissa is not None and (abscissa.ndim != 1 or len(abscissa) < count):
        raise InputError("times", times, f"give the times of all {count} steps")
    known: Any = [(_draw_loop, loops, units), (_draw_forces, forces, abscissa)]
    rows = [(draw, list(found.items())[:_LOOPS], more) for draw, found, more in known if found]
    wide = 3.0 * max(len(row) for _, row, _ in rows)
    with style.settings():
        figure = style.new_figure(3.8 + wide, 0.4 + 3.0 * len(rows))
        left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=[3.8, wide])[0]
        body, (number, shown) = left.subplots(), last
        picture = draw_body(body, shown, units=units)
        low, high = picture.box + np.array([[-1.0], [1.0]]) * _ROOM * float(np.ptp(picture.box, axis=0).max())
        body.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), anchor="N")
        at = f"step {number}" if abscissa is None else f"t = {abscissa[number - 1]:g}"
        body.set_title(f"{at}; displacements × {picture.factor:g}", fontsize="medium")
        for part, (draw, row, more) in zip(right.subfigures(len(rows), 1, squeeze=False)[:, 0], rows, strict=True):
            for axes, (name, values) in zip(part.subplots(1, len(row), squeeze=False)[0], row, strict=True):
                axes.set_ylabel(f"force [{units.force}]")
                draw(axes, style.plain_text(name), values, more)
        left_out = [f"loops not shown: {', '.join(list(loops)[_LOOPS:])}"] if len(loops) > _LOOPS else []
        width = int(_LETTERS * (3.8 + wide))
        said = "\n".join(textwrap.fill(each, width) for each in (title, history.message, *left_out) if each)
        figure.suptitle(style.plain_text(said), x=0.02, ha="left", fontsize="medium")
    return figure


_Loop: TypeAlias = tuple[str, FloatArray, FloatArray]
"""What moves, its displacement or rotation, and the force or moment, as of `History.driven`."""


def _loops(history: History, problem: ContactProblem) -> dict[str, _Loop]:
    """Loops of what is moved sideways: contacts, and edge sets whose tangential displacement is prescribed.

    Edge sets moved across if these move the body; none if nothing moves, as under loads that change.
    """
    moved = [condition for condition in problem.conditions if isinstance(condition, Displacement)]
    driven = []
    for condition in moved:
        tangent = problem.mesh.edges(condition.edges).tangent[0]
        if {CARTESIAN[int(np.argmax(np.abs(tangent)))], "tangential"} & set(components(condition)):
            driven.append(condition.edges)
    loops: dict[str, _Loop] = {}
    for name in (*(contact.name for contact in problem.contacts), *driven):
        with suppress(InputError):  # an obstacle at rest while displacements move the body
            loops.setdefault(name, history.driven(name))
    for condition in moved if not loops else ():
        loops.setdefault(condition.edges, history.driven(condition.edges))
    return {name: loop for name, loop in loops.items() if np.ptp(loop[1]) > 0.0}


_FIRST: Final[dict[str, Any]] = {"color": style.GREY, "marker": "s", "markersize": 7, "fillstyle": "none"}


def _draw_loop(axes: "Axes", name: str, loop: _Loop, units: Units) -> None:
    """Force over displacement, or moment over rotation, of what moves: a dot a step, the first in a square."""
    what, displacement, force = loop
    axes.axhline(0.0, color="#dddddd", linewidth=0.5, zorder=0)
    axes.axvline(0.0, color="#dddddd", linewidth=0.5, zorder=0)
    axes.plot(displacement, force, color=style.BLUE, marker="o", markersize=3, linewidth=1.0)
    axes.plot(displacement[:1], force[:1], **_FIRST)
    axes.ticklabel_format(scilimits=(-3, 4), useMathText=True)
    axes.locator_params(axis="x", nbins=6)
    axes.set_title(name, fontsize="medium")
    axes.set_xlabel(f"displacement [{units.displacement}]")
    if what == "rotation":
        axes.set(xlabel="rotation [rad]", ylabel=f"moment [{units.moment}]")


def _draw_forces(axes: "Axes", name: str, forces: list[tuple[float, float]], times: FloatArray | None) -> None:
    """Normal and tangential force (steps, 2) of one contact step by step, over t where times are given."""
    place = np.arange(1, len(forces) + 1) if times is None else times[: len(forces)]
    looks = (("N", style.GREY, "s", "-"), ("T", style.BLUE, "o", "--"))
    for (label, colour, marker, dashes), values in zip(looks, np.array(forces).T, strict=True):
        axes.plot(place, values, dashes, color=colour, marker=marker, markersize=3, linewidth=1.0, label=label)
        if times is not None:
            axes.plot(place[:1], values[:1], **_FIRST)
    axes.set_title(f"{name}: forces", fontsize="medium")
    axes.set_xlabel("step [-]" if times is None else "t")
    axes.locator_params(axis="x", integer=times is None)
    axes.legend(frameon=False)


def notebook_png(shown: TriangleMesh | ContactProblem) -> bytes | None:
    """What a notebook shows for a mesh or a problem at the end of a cell; None without matplotlib."""
    if find_spec("matplotlib") is None:
        return None
    return style.png_bytes(problem_figure(shown) if isinstance(shown, ContactProblem) else mesh_figure(shown))
