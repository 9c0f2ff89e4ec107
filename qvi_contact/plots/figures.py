"""Whole figures: a result, a load history, a problem, a mesh, and the motion of a body that fails at its limit load."""

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
from qvi_contact.plots.body import NOTHING, Scales, draw_body
from qvi_contact.plots.problem import draw_problem, draw_symbols
from qvi_contact.plots.style import Labels, beside, lines
from qvi_contact.plots.tractions import contact_tractions
from qvi_contact.problem.conditions import Displacement
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.contact_line import ContactLine
from qvi_contact.solution.history import History
from qvi_contact.solution.result import ContactResult
from qvi_contact.units import Rounding, Units
from solvers import Status

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PARTS: Final = (style.BLUE, style.VERMILLION, style.GREEN, style.PURPLE, style.ORANGE, style.SKY)  # of named edges
_WIDTH: Final = 6.3  # width of the figure of a result [inch]: that of the text on a page
_BODY: Final = 4.6  # width of the body in it [inch], about
_PASSES: Final = 6  # enlargements of the box until it holds the texts beside the body
_CHART: Final = 1.5  # height of a chart [inch]
_NAMED: Final = 2  # contacts whose forces the answer states, and charts unless `panels` asks for others
_CANCELLED: Final = 1e-6  # resultant over the sum of its parts, below which it has no direction
_SHARE: Final = 0.005  # least share of a contact's length of which the answer states the state


def result_figure(
    result: ContactResult,
    units: Units | None = None,
    title: str = "",
    panels: Sequence[str] | None = None,
    scales: Scales | None = None,
) -> "Figure":
    """A result for a report: the deformed body, and charts of pressure and friction along contacts.

    The title and the answer stand above, the solver's message below. `draw_body` has what is drawn. Each contact in
    `panels` has a chart; by default these are the two of one line with the largest forces, obstacles before joints.
    Give `scales` to compare results. Without a stress state the loads are drawn, and the motion of the mechanism, if
    there is one. `InputError` if there is no contact of a name.
    """
    units = style.plain_units(units)
    instance_of(ContactResult, "result", result, "give a ContactResult, such as solve returns, or one of the steps")
    names = [contact.name for contact in result.problem.contacts]
    if panels is not None:
        panels = names_among("panels", panels, "contacts", names, least=0)
    if not result.has_state:
        reason_text = result.message.removesuffix(result.solution.message).rstrip(": ")
        reason = f"{reason_text or f'Not solved: {result.status.words}'}. {result.status.advice}"
        proof = result.solution.message.removesuffix(result.status.advice).rstrip()
        return _motion_figure(result.problem, result.mechanism, title, reason, proof, units)
    joints, contacts = {joint.name for joint in result.problem.joints}, result.contacts.values()
    ranked = sorted(contacts, key=lambda line: (line.name in joints, float(f"{-abs(line.normal_force):.6e}")))
    if panels is None:
        leading = [line.name for line in ranked if len(line.path.lines) == 1][:_NAMED]
        panels = [name for name in result.contacts if name in leading]
    with style.settings():
        figure = style.new_figure(_WIDTH, _WIDTH)
        body, *charts = figure.subplots(1 + len(panels), 1, squeeze=False)[:, 0]
        drawn = draw_body(body, result, units, scales)
        if callable(result.problem.body_potential):
            body.plot([], [], " ", label=f"{_body_force(result.problem)} body force".strip())
        style.legend_below(body, [body], 3)
        for chart, name in zip(charts, panels, strict=True):
            line, top = result.contacts[name], float(np.abs(result.gauss_stress()[2]).max())
            contact_tractions(chart, line, units)
            if np.hypot(line.normal_stress, line.tangential_stress).max() <= max(NOTHING * top, result.rounding.stress):
                chart.set_ylim(0.0, top if top > result.rounding.stress else 1.0)  # rather than rounding
            if len(names) > 1:
                chart.set_title(style.plain_text(name), loc="left", fontsize="medium")
        if charts:
            style.legend_below(charts[-1], charts, 6)
        _lay_out(figure, drawn.box, title, _answer(result, ranked, units), result.solution.message, drawn.labels)
    return figure


def _lay_out(figure: "Figure", box: FloatArray, title: str, answer: str, foot: str, labels: Labels) -> None:
    """Write title, answer and foot, and size the figure for the box (2, 2) [length], which grows to hold the texts."""
    body, *charts = figure.axes
    cell = body.get_subplotspec()
    assert cell is not None  # the axes were made by `subplots`
    grid = cell.get_gridspec()
    title = style.plain_text(title)
    unbroken = ((text.replace(" = ", "\u00a0=\u00a0"), count) for text, count in ((answer, 88), (foot, 140)))
    answer, foot = (textwrap.fill(text, count).replace("\u00a0", " ") for text, count in unbroken)
    above = 0.1 + 0.22 * bool(title) + 0.17 * (answer.count("\n") + bool(answer))  # heights in inches
    below = 0.06 + 0.12 * (foot.count("\n") + 1)
    texts = [
        figure.text(0.01, 1.0, title, va="top", fontsize="large", fontweight="bold"),
        figure.text(0.01, 1.0, style.plain_text(answer), va="top"),
        figure.text(0.01, 0.0, style.plain_text(foot), va="bottom", fontsize=6.0, color=style.GREY),
    ]
    for _ in range(_PASSES):
        across, up = box[1] - box[0]
        height = float(np.clip(_BODY * up / across, 1.5, 4.6))
        heights = [height + 0.75, *[_CHART] * len(charts)]
        total = sum(heights) + above + below
        figure.set_size_inches(_WIDTH, total)
        grid.set_height_ratios(heights)
        figure.set_layout_engine("constrained", rect=(0.0, below / total, 1.0, 1.0 - (above + below) / total))
        for text, offset in zip(texts, (-0.07, -0.1 - 0.22 * bool(title), 0.05), strict=True):  # from top or bottom
            text.set_y(offset / total + (offset < 0.0))
        body.set(xlim=box[:, 0], ylim=box[:, 1])
        body.locator_params(axis="x", nbins=max(2, round(min(_BODY, height * across / up) / 0.7)))
        body.locator_params(axis="y", nbins=max(2, round(min(height, _BODY * up / across) / 0.5)))
        held, box = box, labels.fit(box)
        if np.array_equal(held, box):
            break


def _answer(result: ContactResult, ranked: Sequence[ContactLine], units: Units) -> str:
    """Forces and states of the first of the ranked contacts; the status if not solved."""
    sentences, verbs = [], {"open": "open", "stick": "sticks", "slip": "slips", "closed": "closed"}
    for line in ranked[:_NAMED]:
        normal, tangential = beside(line.forces)
        effective = f" (effective {beside([line.effective_normal_force])[0]})" if line.has_fluid else ""
        along = "" if line.frictionless else f", T = {tangential}"
        parts = [f"N = {normal}{effective}{along}\u00a0{units.force}"]
        shares = {verbs[name]: f"{100.0 * share:.0f}\u00a0%" for name, share in line.shares.items() if share >= _SHARE}
        parts += [f"all\u00a0{verb}" if len(shares) == 1 else f"{share}\u00a0{verb}" for verb, share in shares.items()]
        motion = result.plates.get(line.name)
        if motion is not None and np.hypot(motion.x, motion.y) > line.rounding.displacement:
            parts.append(f"moves {beside([float(np.hypot(motion.x, motion.y))])[0]}\u00a0{units.length}")
        sentences.append(f"{line.name}: {', '.join(parts)}")
    status = "" if result.status is Status.SOLVED else f"Not solved ({result.status.words}). "
    return status + "; ".join(sentences) + ("." if sentences else "")


def _body_force(problem: ContactProblem) -> str:
    """An arrow in the direction of the total body force; empty if its parts cancel out."""
    edges = problem.mesh.boundary
    x, y = problem.mesh.points_along(edges, np.array([0.5]))
    values = evaluate("ContactProblem.body_potential", problem.body_potential, x[:, 0], y[:, 0])
    force = -(values * edges.length) @ edges.normal  # ∫ −∇φ dx
    if np.hypot(*force) <= _CANCELLED * (np.abs(values) @ edges.length):
        return ""
    return "→↗↑↖←↙↓↘"[round(float(np.arctan2(force[1], force[0])) / (np.pi / 4.0)) % 8]


def mesh_figure(mesh: TriangleMesh) -> "Figure":
    """A mesh: its triangles, and its named edges and joints, which differ in colour and line style."""
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
    """A problem: mesh, materials, conditions, loads, contacts, joints."""
    instance_of(ContactProblem, "problem", problem, "give a ContactProblem, such as load_problem(FILE).problem")
    with style.settings():
        sides = np.ptp(problem.mesh.vertices, axis=0)
        scale = 6.0 / max(1.25 * sides[0], 1.5 * sides[1])  # with room for the symbols around the body
        figure = style.new_figure(scale * sides[0] + 6.5, max(3.2, scale * (sides[1] + 0.4 * max(sides)) + 0.7))
        draw_problem(figure.subplots(), problem, units)
    return figure


def limit_figure(
    problem: ContactProblem, limit: LimitLoad, units: Units | None = None, title: str = "", answer: str = ""
) -> "Figure":
    """A limit load: the motion in which the body fails, as `draw_mechanism` draws it, with the loads as small arrows.

    `limit` is the result of `limit_load_factor`. `problem` is the problem on the mesh of that analysis, after a
    refinement `LimitRefinement.problem`. The title and the answer, the loads that can be carried, stand above.
    `InputError` if there is no mechanism: then there is no upper limit, or no multiple can be carried.
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
    """The motion in which a body fails, moved blocks or plastic flow, with obstacles, loads and supports."""
    mesh = problem.mesh
    with style.settings():
        figure = style.new_figure(_WIDTH, _WIDTH)
        axes = figure.subplots()
        words, ends = "", [mesh.vertices]
        if motion is None:
            style.draw_outline(axes, mesh)
        else:
            ends.append(draw_mechanism(axes, mesh, motion))
            words = "Motion in which the body fails, magnified; dashed: the body at rest."
            words += " Orange: where it yields." * isinstance(motion, Collapse)
        ends += draw_symbols(axes, problem, obstacles=True)
        axes.set_title(words, fontsize="small", loc="left")
        box = style.show_all(axes, np.concatenate(ends), units)
        _lay_out(figure, box, title, answer, foot, Labels(axes))
    return figure


_DEEPEST: Final = 0.95  # quantile of the dissipation per area at which the colour is deepest
_OPEN: Final = 1e-6  # opening of an interior edge, over the body's length, above which both of its sides are drawn


def draw_mechanism(axes: "Axes", mesh: TriangleMesh, motion: Mechanism | Collapse) -> FloatArray:
    """Draw a body moved by a motion, over its dashed outlines at rest; returns the ends of all outlines (n, 2).

    Motions are small. They are magnified until the largest displacement is 8 % of the body's length; magnified
    rotations leave blocks their size. Triangles that yield are orange, the deeper the more power they dissipate per
    area. `ContactResult.mechanism`, `LimitLoad.mechanism` and `LimitLoad.collapse` are motions, on the mesh of the
    analysis. Axes are in units of length. `InputError` if the mesh is another one.
    """
    from matplotlib.collections import PolyCollection

    if len(motion.blocks if isinstance(motion, Mechanism) else motion.gap) != mesh.cell_count:
        raise InputError("mesh", mesh, "is not that of the limit analysis: give LimitRefinement.problem")
    after, scale = mesh.corners.copy(), style.LONGEST * mesh.length
    colours: str | FloatArray = "#d6e6f2"
    if isinstance(motion, Mechanism):
        for number, rigid in enumerate(motion.motions):
            in_block = motion.blocks == number
            arms = turned(after[in_block] - rigid.centre, np.arctan(scale * rigid.rotation))
            after[in_block] = rigid.centre + arms + scale * np.array([rigid.x, rigid.y])
    else:
        flow, (a, b, c) = motion.motion, mesh.corners.swapaxes(0, 1)
        second = -isqrt(2 * flow.velocities.shape[2])  # coefficient at the second corner of a part; 0 at the first
        velocity = flow.velocities[:, [1, 0, 0], [0, 0, second]]  # at the corners of each triangle
        after += scale / max(float(np.hypot(*velocity.T).max()), 1e-300) * velocity
        density = flow.dissipation / np.abs(cross(b - a, c - a))
        shade = np.sqrt(np.minimum(density / max(float(np.quantile(density, _DEEPEST)), 1e-300), 1.0))
        colours = np.column_stack([np.tile([0.9, 0.45, 0.0], (len(shade), 1)), 0.85 * shade])

    def moved_ends(edges: Edges, side: int) -> FloatArray:
        cells = edges.cells[:, side]
        corners = ((mesh.cells[cells] == nodes[:, None]).argmax(axis=1) for nodes in (edges.first, edges.second))
        return np.stack([after[cells, corner] for corner in corners], axis=1)

    axes.add_collection(PolyCollection(list(after), facecolors=colours, antialiased=False, zorder=1.0))
    near, far = moved_ends(mesh.interior, 0), moved_ends(mesh.interior, 1)
    is_open = np.abs(near - far).max(axis=(1, 2)) > _OPEN * mesh.length
    moved = np.concatenate([moved_ends(mesh.boundary, 0), near[is_open], far[is_open]])
    rest = mesh.vertices[mesh.topology.ends[np.append(mesh.topology.outer, mesh.topology.inner[is_open])]]
    axes.add_collection(lines(rest, style.GREY, (0, (4, 3)), 0.7))
    axes.add_collection(lines(moved, style.BLUE, "solid", 1.0, "mechanism"))
    return np.concatenate([rest.reshape(-1, 2), moved.reshape(-1, 2)])


_LETTERS: Final = 13  # letters of a heading on an inch
_LOOPS: Final = 4  # largest number of loops, and of charts of forces


def history_figure(
    history: History, units: Units | None = None, times: Sequence[float] | None = None, title: str = ""
) -> "Figure":
    """A load history: the deformed body in the last step, hysteresis loops of up to four contacts, and contact forces.

    A loop needs a moving obstacle or a prescribed displacement; under loads alone only forces are drawn. With `times`,
    the value of t in each step, forces are drawn over t instead of the number of the step. A hollow square marks the
    first step. The body is that of the last step with a stress state. The title and the message of the history stand
    above. Steps are read one by one.

    `InputError` if there is nothing to draw, or not a time for each step.
    """
    instance_of(History, "history", history)
    units, title = style.plain_units(units), style.plain_text(title)
    abscissa = None if times is None else real_array("times", times)
    forces: dict[str, list[tuple[float, float]]] = {}
    last = None
    for number, step in enumerate(history.steps, 1):
        if step.has_state:
            last = number, step
            for name, line in step.contacts.items():
                forces.setdefault(name, []).append(line.forces)
    loops = {} if last is None else _loops(history, last[1].problem)
    if last is None or not (forces or loops):
        raise InputError("history", history, "there is no contact whose loop or forces could be drawn")
    count = max(map(len, forces.values()), default=0)
    if abscissa is not None and (abscissa.ndim != 1 or len(abscissa) < count):
        raise InputError("times", times, f"give the times of all {count} steps")
    groups: Any = [(_draw_loop, loops, units), (_draw_forces, forces, abscissa)]
    charts = [(draw, *item, more) for draw, items, more in groups for item in list(items.items())[:_LOOPS]]
    columns = max(min(2, len(charts)), -(-len(charts) // 2))
    rows, right_width = -(-len(charts) // columns), 3.0 * columns
    with style.settings():
        figure = style.new_figure(3.8 + right_width, 0.4 + 3.0 * rows)
        left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=[3.8, right_width])[0]
        body, (last_number, last_step) = left.subplots(), last
        picture = draw_body(body, last_step, units)
        body.set_anchor("N")
        label = f"step {last_number}" if abscissa is None else f"t = {abscissa[last_number - 1]:g}"
        body.set_title(f"{label}; displacements × {beside([picture.factor])[0]}", fontsize="medium")
        for place, (draw, name, values, more) in enumerate(charts, 1):
            axes = right.add_subplot(rows, columns, place)
            axes.set_ylabel(f"force [{units.force}]")
            draw(axes, style.plain_text(name), values, more)
        left_out = {"loops": list(loops)[_LOOPS:], "forces": list(forces)[_LOOPS:]}
        notes = [f"not shown: {what} of {', '.join(names)}" for what, names in left_out.items() if names]
        width = int(_LETTERS * (3.8 + right_width))
        texts = (title, f"{history.message}; squares: the first step", *notes)
        heading = "\n".join(textwrap.fill(text, width) for text in texts if text)
        figure.suptitle(style.plain_text(heading), x=0.02, ha="left", fontsize="medium")
        box = picture.box
        for _ in range(_PASSES):
            body.set(xlim=box[:, 0], ylim=box[:, 1])
            held, box = box, picture.labels.fit(box)
            if np.array_equal(held, box):
                break
    return figure


_Loop: TypeAlias = tuple[str, FloatArray, FloatArray]
"""As `History.driven` returns it: "along", "x", "y" or "rotation", the motion, and the force or moment."""


def _loops(history: History, problem: ContactProblem) -> dict[str, _Loop]:
    """Loops of contacts that move, and of edge sets whose displacement is prescribed.

    A loop whose displacement never changes, but for rounding, as under loads alone, is left out.
    """
    supports = [condition.edges for condition in problem.conditions if isinstance(condition, Displacement)]
    loops: dict[str, _Loop] = {}
    for name in (*(contact.name for contact in problem.contacts), *supports):
        with suppress(InputError):  # raised for an obstacle at rest
            loops.setdefault(name, history.driven(name))
    least = Rounding.largest(step.rounding for step in history.steps if step.has_state) if loops else Rounding()
    rest = {"rotation": least.rotation}
    return {name: loop for name, loop in loops.items() if np.ptp(loop[1]) > rest.get(loop[0], least.displacement)}


_FIRST: Final[dict[str, Any]] = {"color": style.GREY, "marker": "s", "markersize": 7, "fillstyle": "none"}


def _draw_loop(axes: "Axes", name: str, loop: _Loop, units: Units) -> None:
    """Draw force over displacement, or moment over rotation: a dot for each step, the first in a square."""
    what, displacement, force = loop
    axes.axhline(0.0, color="#dddddd", linewidth=0.5, zorder=0)
    axes.axvline(0.0, color="#dddddd", linewidth=0.5, zorder=0)
    axes.plot(displacement, force, color=style.BLUE, marker="o", markersize=3, linewidth=1.0)
    axes.plot(displacement[:1], force[:1], **_FIRST)
    axes.ticklabel_format(scilimits=(-3, 4))
    axes.locator_params(axis="x", nbins=6)
    axes.set_title(name, fontsize="medium")
    axes.set_xlabel(f"displacement [{units.displacement}]")
    if what == "rotation":
        axes.set(xlabel="rotation [rad]", ylabel=f"moment [{units.moment}]")


def _draw_forces(axes: "Axes", name: str, forces: list[tuple[float, float]], times: FloatArray | None) -> None:
    """Draw normal and tangential force (steps, 2) of one contact over the steps, or over t if times are given."""
    place = np.arange(1, len(forces) + 1) if times is None else times[: len(forces)]
    looks = (("N", style.GREY, "s", "-"), ("T", style.BLUE, "o", "--"))
    for (label, colour, marker, dashes), values in zip(looks, np.array(forces).T, strict=True):
        axes.plot(place, values, dashes, color=colour, marker=marker, markersize=3, linewidth=1.0, label=label)
        axes.plot(place[:1], values[:1], **_FIRST)
    axes.set_title(f"{name}: forces", fontsize="medium")
    axes.set_xlabel("step" if times is None else "t")
    axes.locator_params(axis="x", integer=times is None)
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.2 * (high - low))  # with room for the legend
    axes.legend(frameon=False, loc="upper center", ncols=2)


def notebook_png(shown: TriangleMesh | ContactProblem) -> bytes | None:
    """The picture that a notebook shows for a mesh or a problem at the end of a cell; None without matplotlib."""
    if find_spec("matplotlib") is None:
        return None
    return style.png_bytes(problem_figure(shown) if isinstance(shown, ContactProblem) else mesh_figure(shown))
