"""Whole figures: a result, a problem, a limit load."""

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, evaluate
from qvi_contact.basics.units import Units
from qvi_contact.errors import InputError
from qvi_contact.limit.load_factor import Collapse, LimitLoad
from qvi_contact.mechanism import Mechanism
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.plots.body import THRUST, Drawn, Scales, draw_body
from qvi_contact.plots.labels import Written, beside, spread
from qvi_contact.plots.mechanism import draw_collapse, draw_mechanism
from qvi_contact.plots.problem import draw_problem, draw_symbols
from qvi_contact.plots.style import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    bounding_box,
    draw_grid,
    draw_outline,
    edge_lines,
    legend_below,
    lines,
    new_figure,
    plain_text,
    plain_units,
    settings,
    show_all,
)
from qvi_contact.plots.tractions import contact_tractions
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.result import ContactResult
from solvers import Status
from solvers.basics.names import known_name

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PARTS: Final = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)  # of named edges
_PANELS: Final = 2  # at most so many charts unless some are asked for
_WIDTH: Final = 6.3  # of a picture of a result [inch]: that of the text on a page
_BODY: Final = 4.6  # about the width of the body in it
_PASSES: Final = 3  # until texts beside the body have room
_CHART: Final = 1.5  # height of a chart
_SAID: Final = 2  # contacts named in the answer
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

    Title and answer stand above, what the solver says small below. `draw_body` says what is drawn. Without a stress
    state, as of an infeasible problem, the loads are drawn, and how the mechanism moves the blocks, if there is one.

    Parameters
    ----------
    result : ContactResult
        The result.
    units : Units, optional
        Labels.
    title : str
        The problem's title.
    panels : sequence of str, optional
        Contacts with a chart of pressure and friction each; by default at most two, which are no more than one line.
    component : str
        The stress, see `draw_body`.
    scales : Scales, optional
        Those of several results that are looked at beside each other.

    Raises
    ------
    InputError
        If there is no contact of a name, or no such stress.

    """
    units = plain_units(units)
    names = [contact.name for contact in result.problem.contacts]
    for name in panels or ():
        known_name("panels", name, {"contacts": names})
    if not result.has_state:
        return _motion_figure(result.problem, result.mechanism, title, _reason(result), result.solution.message, units)
    if panels is None:
        panels = [line.name for line in result.contacts.values() if not line.path.line[-1]][:_PANELS]
    with settings():
        figure = new_figure(_WIDTH, _WIDTH)
        body, *charts = figure.subplots(1 + len(panels), 1, squeeze=False)[:, 0]
        drawn = draw_body(body, result, component, units, scales)
        _explained(body, drawn, result, units)
        for number, (panel, name) in enumerate(zip(charts, panels, strict=True), 1):
            contact_tractions(panel, result.contacts[name], units)
            if drawn.pressure == 0.0:
                panel.set_ylim(0.0, float(np.abs(result.gauss_stress()[2]).max()) or 1.0)  # rather than rounding
            if len(names) > 1:
                panel.set_title(plain_text(name), loc="left", fontsize="medium")
            if number == len(charts):
                handles = {
                    label: handle
                    for chart in charts
                    for handle, label in zip(*chart.get_legend_handles_labels(), strict=True)
                }
                legend_below(panel, list(handles.values()))
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
    answer, foot = (textwrap.fill(text, count) for text, count in ((answer, 88), (foot, 150)))
    above = 0.1 + 0.22 * bool(title) + 0.17 * (answer.count("\n") + 1)
    below = 0.06 + 0.12 * (foot.count("\n") + 1)
    texts = [
        figure.text(0.01, 1.0, plain_text(title), va="top", fontsize="large", fontweight="bold"),
        figure.text(0.01, 1.0, plain_text(answer), va="top"),
        figure.text(0.01, 0.0, plain_text(foot), va="bottom", fontsize=6.0, color=GREY),
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
        normal, tangential = beside([line.normal_force, line.tangential_force])
        effective = f" (effective {beside([line.effective_normal_force])[0]})" if line.has_fluid else ""
        along = "" if line.frictionless else f", T = {tangential}"
        words = [f"N = {normal}{effective}{along} {units.engineering_force}"]
        shares = {verbs[name]: f"{100.0 * share:.0f} %" for name, share in line.shares.items() if share >= _SHARE}
        words += [f"all {verb}" if len(shares) == 1 else f"{share} {verb}" for verb, share in shares.items()]
        motion = result.plates.get(line.name)
        if motion is not None and np.hypot(motion.x, motion.y) > line.rounding.displacement:
            words.append(f"moves {beside([float(np.hypot(motion.x, motion.y))])[0]} {units.length}")
        said.append(f"{line.name}: {', '.join(words)}")
    status = "" if result.status is Status.SOLVED else f"Not solved ({result.status.words}). "
    return status + "; ".join(said) + ("." if said else "")


def _reason(result: ContactResult) -> str:
    """Why there is no stress state, and what to do."""
    reason = result.message.removesuffix(result.solution.message).rstrip(": ") or f"Not solved: {result.status.words}"
    return f"{reason}. {result.status.advice}"


def _explained(axes: "Axes", drawn: Drawn, result: ContactResult, units: Units) -> None:
    """The legend of a drawing of the body."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    entries: list[Artist] = []
    pressure, friction = beside([drawn.pressure, drawn.friction], 3)
    if drawn.pressure > 0.0:
        entries.append(Patch(color=VERMILLION, alpha=0.4, label=f"pressure, up to {pressure} {units.stress}"))
    if any(line.has_fluid for line in result.contacts.values()):
        entries.append(Line2D([], [], color=BLUE, linestyle=(0, (4, 1.5)), linewidth=0.9, label="of it the fluid's"))
    if drawn.friction > 0.0 and friction != "0":
        look: dict[str, Any] = {"marker": ">", "markersize": 3, "color": "black", "linewidth": 0.9}
        entries.append(Line2D([], [], label=f"friction, up to {friction} {units.stress}", **look))
    if drawn.thrust:
        colour, style, width = THRUST
        entries.append(Line2D([], [], color=colour, linestyle=style, linewidth=width, label="line of thrust"))
    if callable(result.problem.body_potential):
        mesh, field = result.problem.mesh, result.problem.body_potential
        (x, y), edges = mesh.points_along(mesh.boundary, np.array([0.5])), mesh.boundary
        values = evaluate("ContactProblem.body_potential", field, x[:, 0], y[:, 0])
        force = -(values * edges.length) @ edges.normal  # ∫ −∇φ dx
        sign = "→↗↑↖←↙↓↘"[round(float(np.arctan2(force[1], force[0])) / (np.pi / 4.0)) % 8]
        entries.append(Line2D([], [], linestyle="none", label=f"{sign} body force"))
    text = f"before; displacements × {drawn.factor:g}"
    entries.append(Line2D([], [], color=GREY, linestyle=(0, (4, 3)), linewidth=0.6, label=text))
    legend_below(axes, entries)


def mesh_figure(mesh: TriangleMesh, units: Units | None = None) -> "Figure":
    """One picture of a mesh: its triangles, and its named edges and joints, which differ without colour too."""
    with settings():
        sides = np.ptp(mesh.vertices, axis=0)
        figure = new_figure(*(5.0 * sides / sides.max() + [3.0, 1.0]))
        axes = figure.subplots()
        draw_grid(axes, mesh)
        draw_outline(axes, mesh)
        for number, name in enumerate((*mesh.edge_names, *mesh.joint_names)):
            look = _PARTS[number % 6], ("-", "--", ":", "-.")[number % 4], 2.0
            axes.add_collection(lines(edge_lines(mesh, mesh.edges(name)), *look, plain_text(name)))
        show_all(axes, mesh.vertices, plain_units(units))
        figure.legend(loc="outside right upper", frameon=False)
    return figure


def problem_figure(problem: ContactProblem, units: Units | None = None) -> "Figure":
    """One picture of a problem: mesh, materials, conditions, loads, contacts, joints."""
    with settings():
        low, high = bounding_box(problem.mesh)
        sides = high - low
        scale = 6.0 / max(1.25 * sides[0], 1.5 * sides[1])  # what is around the body takes room too
        figure = new_figure(scale * sides[0] + 6.5, max(3.2, scale * (sides[1] + 0.4 * max(sides)) + 0.7))
        draw_problem(figure.subplots(), problem, units)
    return figure


def limit_figure(
    problem: ContactProblem, limit: LimitLoad, units: Units | None = None, title: str = "", answer: str = ""
) -> "Figure":
    """One picture of a limit load: how the body gives way, under its loads as small arrows.

    A mechanism moves blocks; a body that yields flows, see `plots.mechanism.draw_collapse`.

    Parameters
    ----------
    problem : ContactProblem
        The problem on the mesh of the analysis, such as `LimitRefinement.problem`.
    limit : LimitLoad
        What `limit_load_factor` has found.
    units : Units, optional
        Labels.
    title, answer : str
        What stands above: the problem's title, and how much it carries.

    Raises
    ------
    InputError
        If the limit load has no mechanism, since there is no upper limit, or no multiple at all.

    """
    if limit.mechanism is None and limit.collapse is None:
        raise InputError("limit", repr(limit), "there is no mechanism to draw: no load is the largest one")
    found = limit.mechanism if limit.mechanism is not None else limit.collapse
    return _motion_figure(problem, found, title, answer or repr(limit)[1:-1], "", plain_units(units))


def _motion_figure(
    problem: ContactProblem, motion: Mechanism | Collapse | None, title: str, answer: str, foot: str, units: Units
) -> "Figure":
    """How a body gives way: blocks moved, or where it yields and flows; obstacles, loads and supports."""
    mesh = problem.mesh
    with settings():
        figure = new_figure(_WIDTH, _WIDTH)
        axes = figure.subplots()
        words, ends = "", [mesh.vertices]
        if isinstance(motion, Mechanism):
            ends.append(draw_mechanism(axes, mesh, motion))
            words = "How the blocks move beyond that, magnified; dashed: where they are."
        else:
            draw_outline(axes, mesh)
        if isinstance(motion, Collapse):
            draw_collapse(axes, mesh, motion)
            words = "Orange: where the body yields. Arrows: how it moves. Thick lines: contacts that slide."
        ends += draw_symbols(axes, problem, obstacles=True)
        axes.set_title(words, fontsize="small", loc="left")
        box = show_all(axes, np.concatenate(ends), units)
        _placed(figure, box, title, answer, foot)
    return figure
