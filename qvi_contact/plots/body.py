"""The picture of a result: the deformed body with a stress as coloured bands, and the tractions on its contacts.

The stress model has no displacements inside the body. On contacts, obstacles and supports it has the components

    u_N = g − gap − σ_N'/k_N,    u_T = w + slip − σ_T/k_T,

where the last terms stand for springs. The picture shows the displacement v of degree 2 whose strains are nearest to
those of the stresses σ with compliance c, and which agrees with the known components u in directions d: it minimises

    ∫ |ε(v) − c σ − ε⁰|² dx  +  α Σ w |v·d − u|²,

where ε⁰ is the initial strain, and the sum is over points of contacts and supports with weights w. That takes one
linear solve. Every stress state has such a displacement, also a step of a history, which minimises no energy.
"""

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from qvi_contact.basics.checks import FloatArray, IntArray, evaluate, instance_of
from qvi_contact.companion import Elasticity
from qvi_contact.discretization.displacements import DisplacementSpace, triangle
from qvi_contact.discretization.plates import pins
from qvi_contact.element.edge import bernstein_basis, gauss_legendre
from qvi_contact.mesh.edges import Edges, cross, vectors_along
from qvi_contact.plots import style
from qvi_contact.plots.problem import SPRING, between, draw_symbols, ground, spaced, springs
from qvi_contact.plots.style import Labels, beside
from qvi_contact.plots.tractions import pieces_along
from qvi_contact.problem.conditions import SPRINGS, Displacement
from qvi_contact.problem.material import stress_along_z, stress_at_rest
from qvi_contact.solution.contact_line import enclosed_beyond
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.stress import sample_body, stress_in_cells, von_mises
from qvi_contact.units import Units

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.tri import TriContourSet

# Lengths in the picture are shares of the body's length, unless said otherwise.
_SAMPLES: Final = 120  # parts of the body's length between points at which the stress is sampled
_TALL: Final = 0.25  # least height of the colour bar over the width of the picture, for flat bodies
_CALM: Final = 0.75  # displacements are drawn this much smaller than the motion of a mechanism
_HEIGHT: Final = 0.14  # height of the diagram at the largest pressure
_IN_BLOCKS: Final = 0.3  # largest height of the diagram between blocks, as a share of the side √(median block area)
_SPACING: Final = 0.032  # spacing of the arrows of pressure
_LONGEST: Final = 0.2  # arrow of the largest resultant
_LEAST: Final = 0.02  # stresses and forces below this share of the largest are not drawn
_LABELLED: Final = 8  # up to so many contact lines have arrows and numbers; of more lines, only obstacles have numbers
NOTHING: Final = 1e-6  # tractions below this share of the largest stress in the body count as zero
_CENTRAL: Final = 0.005  # eccentricities below this share of the contact line are not written
_DEEP: Final = 0.002  # overlap of bodies that the eye does not see
_HATCH: Final = 0.016  # spacing and size of the hatching of obstacles
_SHORTEST_SPRING, _LONGEST_SPRING = 0.3, 4.0  # drawn length of a deformed spring over SPRING, its length at rest

_DEGREE: Final = 2  # of the displacement v
_KNOWN: Final = 100.0  # α: the known components weigh more than the strains
_SOFTEST: Final = 1e-9  # weight of all coefficients of v: motions that nothing determines stay small
_ISOTROPIC: Final = np.diag([1.0, 1.0, 0.5])  # |ε|² as a quadratic form of (ε_xx, ε_yy, 2ε_xy)

_ARROW: Final[dict[str, Any]] = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "units": "inches"}
_PRESSURE: Final[dict[str, Any]] = {"color": style.VERMILLION, "width": 0.007, "headwidth": 5.0, "headlength": 6.0}
_FRICTION: Final[dict[str, Any]] = {"color": "black", "width": 0.011, "headwidth": 4.5, "headlength": 5.0}
_RESULTANT: Final[dict[str, Any]] = {"color": "black", "width": 0.025, "headwidth": 4.0, "headlength": 4.5}
_THRUST: Final = ("black", (0, (6, 1.5, 1, 1.5)), 1.1)


@dataclass(frozen=True, eq=False)
class Shape:
    """The displacement v of the body, discontinuous across joints."""

    space: DisplacementSpace
    """Elements of degree 2 on the mesh."""
    coefficients: FloatArray
    """Coefficients of v in the space [length], (n, 2)."""

    @classmethod
    def of(cls, result: ContactResult) -> "Shape":
        """The displacement v of a stress state, as the module's docstring defines it."""
        problem, discretization, scales = result.problem, result.discretization, result.discretization.scales
        space = DisplacementSpace.of(problem, triangle(_DEGREE))
        body = Elasticity(space, np.tile(_ISOTROPIC, (len(space.table), 1, 1)))
        # strains c (σ − σ_rest) at the quadrature points, where c σ_rest = −ε⁰
        t, weights = body.points()
        cells = np.arange(len(space.table))
        points = problem.mesh.origin + scales.length * space.points(slice(None), t)
        reference = problem.mesh.reference(cells, points)
        stress = stress_in_cells(discretization, result.dofs, cells, reference)[1] * scales.stress
        stress = stress - stress_at_rest(problem, cells, points[..., 0], points[..., 1])
        strain = stress @ problem.compliances.swapaxes(1, 2)
        # normal equations of the minimum, in units of length
        load = body.virtual_work((strain @ _ISOTROPIC) * weights[..., None], t)
        rows, known = _known(result, space)
        K = body.stiffness() + _KNOWN * rows.T @ rows + _SOFTEST * sparse.eye_array(space.size)
        factor = splu(sparse.csc_array(K), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
        v = factor.solve(load + _KNOWN * (rows.T @ known / scales.length))
        return cls(space, scales.length * v.reshape(-1, 2))

    def at(self, cells: IntArray, t: FloatArray) -> FloatArray:
        """Displacements (n, 2) [length] at one reference point t (n, 2) in each of the cells (n,)."""
        shapes = self.space.cell.values(self.space.own(cells, t[:, None]))
        return np.asarray((shapes @ self.coefficients[self.space.table[cells]])[:, 0])

    def along(self, edges: Edges, t: FloatArray, *, other: bool = False) -> FloatArray:
        """Displacements (edges, q, 2) [length] at t (q,), 0 to 1; with `other` on the far side of a joint."""
        return np.asarray(bernstein_basis(_DEGREE, t) @ self.coefficients[self.space.along(edges, other=other)])


def _known(result: ContactResult, space: DisplacementSpace) -> tuple[sparse.csr_array, FloatArray]:
    """Rows (k, size) of v·d at points of contacts and supports, and the known values (k,) [length], both times √w."""
    problem, scales, mesh = result.problem, result.discretization.scales, result.problem.mesh
    blocks, values = [sparse.csr_array((0, space.size))], [np.empty(0)]

    def add(edges: Edges, t: FloatArray, direction: FloatArray, known: FloatArray, joint: bool = False) -> None:
        """Add points t (q,) of edges: known components (e, q) in directions (e, q, 2); on a joint those of the jump."""
        shape = bernstein_basis(space.degree, t)
        roots = np.sqrt(edges.length[:, None] / (scales.length * len(t)) * np.ones(len(t)))  # √w
        entries = roots[..., None, None] * shape[:, :, None] * direction[:, :, None]
        starts = np.arange(0, entries.size + 1, 2 * shape.shape[1])
        for other in (False, True) if joint else (False,):
            columns = np.broadcast_to(2 * space.along(edges, other=other)[:, None, :, None] + [0, 1], entries.shape)
            rows = sparse.csr_array((entries.ravel(), columns.ravel(), starts), shape=(known.size, space.size))
            blocks.append(blocks.pop() - rows if other else rows)
        values.append((roots * known).ravel())

    t = gauss_legendre(_DEGREE + 1)[0]
    for support in problem.prescribed(Displacement):
        x, y = mesh.points_along(support.edges, t)
        directions = vectors_along(support.edges, support.direction, t, turns=support.turns)
        add(support.edges, t, directions, evaluate(support.name, support.value, x, y))
    for contact, rows in zip(problem.contacts, result.discretization.contacts, strict=True):
        body, _ = faces(result, contact.name)
        points, line = rows.points, result.contacts[contact.name]
        shape = (len(points.edges), points.count)
        for direction in (points.normals, points.tangents)[: 1 if line.frictionless else 2]:
            known = (body * direction).sum(axis=1).reshape(shape)
            add(points.edges, points.reference, direction.reshape(*shape, 2), known, rows.joint)
    return sparse.csr_array(sparse.vstack(blocks)), np.concatenate(values)


def faces(result: ContactResult, name: str) -> tuple[FloatArray, FloatArray]:
    """Displacements (m, 2) [length] of the body and of the obstacle's face at the points of a contact.

    The displacement of the body follows from gap, slip, elongation of springs, and the motion of a plate; on a joint it
    is the jump. The obstacle moves by its gap g and with its plate. Its tangential displacement w, and the rotation of
    a pin, are left out, as they do not change the picture. In a history the slip is that since the beginning.
    """
    discretization, line = result.discretization, result.contacts[name]
    index = next(i for i, rows in enumerate(discretization.contacts) if rows.name == name)
    rows, unit = discretization.contacts[index], discretization.scales.displacement
    normal, tangent = rows.points.normals, rows.points.tangents
    contact, gap = result.problem.contacts[index], unit * rows.gap
    u_n, u_t = gap - line.gap, unit * (rows.offset + rows.slip) + line.slip
    loaded = (u_n, line.effective_normal_stress), (u_t, line.tangential_stress)
    for stiffness, (displacement, stress) in zip(SPRINGS, loaded, strict=True):  # u −= σ/k
        if getattr(contact, stiffness) is not None:
            displacement -= stress / evaluate(f"Contact.{stiffness}", getattr(contact, stiffness), line.x, line.y)
    body, obstacle = u_n[:, None] * normal + u_t[:, None] * tangent, gap[:, None] * normal
    if name in result.plates:  # a plate driven by force or moment
        motion, points = result.plates[name], np.column_stack([line.x, line.y])
        is_pin = any(pin.name == name for pin in pins(result.problem))
        body = body + motion.at(points)
        obstacle = obstacle + (replace(motion, rotation=0.0) if is_pin else motion).at(points)
    return body, obstacle


@dataclass(frozen=True, eq=False)
class LineTractions:
    """The tractions on one line of a contact, at its k points in order and at both ends, where they are drawn.

    `place` has the points of the deformed face, `obstacle` those of the obstacle's face, `s` the length along the line;
    `normal` (k, 2) points away from the body inside. Pressure −σ_N, shear σ_T and the fluid's p_w are stresses.
    `weights` integrate along the line and are zero at its ends. `blocks` (k, 2) has the numbers of the blocks inside
    and beyond the line, −1 for an obstacle.
    """

    name: str
    joint: bool
    s: FloatArray
    place: FloatArray
    obstacle: FloatArray
    normal: FloatArray
    tangent: FloatArray
    pressure: FloatArray
    shear: FloatArray
    fluid: FloatArray
    weights: FloatArray
    blocks: IntArray

    def resultant(self, chosen: slice | FloatArray = slice(None)) -> tuple[FloatArray, FloatArray]:
        """Force of the chosen points on the body inside [stress × length], and the centre of pressure [length].

        On a curved line the centre moves along the line of action to where that meets the loaded part of the contact.
        The centre stays if the line of action is far away, as where tractions around a circle nearly cancel.
        """
        tractions = -self.pressure[chosen, None] * self.normal[chosen] + self.shear[chosen, None] * self.tangent[chosen]
        place, weights = self.place[chosen], self.weights[chosen]
        forces = weights[:, None] * tractions
        share = weights * np.maximum(self.pressure[chosen], 0.0)
        share = share if share.any() else weights
        centre, force = share @ place / share.sum(), forces.sum(axis=0)
        size, moment = float(np.hypot(*force)), float(cross(place - centre, forces).sum())
        is_near = abs(moment) < size * float(np.ptp(place, axis=0).max())
        if is_near and np.ptp(self.normal[chosen], axis=0).max() > 1e-6:
            centre = centre + moment / size**2 * np.array([force[1], -force[0]])  # on the line of action
            arms = place[share > 0.1 * share.max()] - centre
            nearest = arms[np.argmin(np.abs(cross(arms, force)))]
            centre = centre + force * (nearest @ force) / size**2
        return force, centre

    @property
    def turns(self) -> bool:
        """Whether the line is not straight, so that the pressure on it may balance itself."""
        return bool(np.ptp(self.normal, axis=0).max() > 1e-6)

    @property
    def eccentricity(self) -> float:
        """Distance of the centre of pressure from the middle of a straight line [length]; 0 on other lines."""
        share = self.weights * self.pressure
        if self.turns or share.sum() <= NOTHING * np.abs(share).sum():
            return 0.0
        return abs(float(share @ self.s / share.sum() - (self.s[0] + self.s[-1]) / 2.0))


@dataclass(frozen=True)
class Scales:
    """Scales that several drawings share, so that they can be compared."""

    factor: float
    """Factor by which displacements are magnified."""
    pressure: float
    """Largest pressure on contacts [stress]."""
    friction: float
    """Largest friction stress on contacts [stress]."""
    stress: tuple[float, float] | None = None
    """Ends of the colour bar [stress]; with None each drawing has its own."""

    @classmethod
    def of(cls, results: Iterable[ContactResult]) -> "Scales":
        """Scales for results such as the steps of a history; with the factor no body is drawn inside another."""
        moved, factor, pressure, friction, ranges = 0.0, np.inf, 0.0, 0.0, []
        for result in results:
            discretization, length = result.discretization, result.problem.mesh.length
            least = style.LEAST * discretization.scales.displacement
            moved = max(moved, least, float(np.hypot(*Shape.of(result).coefficients.T).max()))
            factor = min(factor, style.magnified(moved, _CALM * length))
            for rows, line in zip(discretization.contacts, result.contacts.values(), strict=True):
                if rows.joint:  # both faces lie on one line before: they overlap by factor × jump
                    jump = (faces(result, line.name)[0] * rows.points.normals).sum(axis=1).max() / length
                    factor = min(factor, max(1.0, style.rounded_down(_DEEP / max(jump, 1e-100))))
                pressure = max(pressure, float(np.abs(line.normal_stress).max()))
                friction = max(friction, float(np.abs(line.tangential_stress).max()))
            x, y, stress = result.gauss_stress()
            zz = stress_along_z(result.problem, np.arange(len(x)), x, y, stress)
            ranges.append(usual_range(von_mises(stress, zz)))
        low, high = np.array(ranges).reshape(-1, 2).T
        bar = (float(low.min()), float(high.max())) if len(ranges) > 1 else None
        return cls(factor if np.isfinite(factor) else 1.0, pressure, friction, bar)


@dataclass(frozen=True)
class Drawn:
    """What `draw_body` has drawn, for texts around the picture."""

    factor: float
    """Factor by which displacements are magnified."""
    box: FloatArray
    """Lower left and upper right corner of the drawing [length], (2, 2)."""
    pressure: float
    """Largest pressure on all contacts [stress]; 0 if no tractions were drawn."""
    labels: Labels
    """Numbers of resultants."""


def draw_body(axes: "Axes", result: ContactResult, units: Units | None = None, scales: Scales | None = None) -> Drawn:
    """Draw the deformed body with the von Mises stress as coloured bands, and the tractions on its contacts.

    Each contact shows the pressure as a diagram, in one scale for all contacts, with arrows towards the body; the
    friction stress on the body as arrows inside it; and the resultant as a heavy arrow with its number, on straight
    contacts with its eccentricity e. Blocks pressed from two sides have a line of thrust between the centres of
    pressure. Loads, supports and obstacles are small symbols. One factor magnifies all displacements, which are those
    of `Shape`; dashed lines show the undeformed body. Axes are in units of length.

    The von Mises stress has σ_zz in plane strain. Give `scales` if several results are to be compared; by default they
    are those of this result. `InputError` if there is no stress state.
    """
    from scipy.spatial import cKDTree

    units, mesh, shape = style.plain_units(units), result.problem.mesh, Shape.of(result)
    scales = Scales.of([result]) if scales is None else scales
    instance_of(Scales, "scales", scales)
    factor, length, t = scales.factor, mesh.length, np.linspace(0.0, 1.0, style.CHORDS + 1)
    # bands of stress at the deformed points; values are averaged where cells of one block and one material meet
    samples = sample_body(result, _SAMPLES)
    values = von_mises(samples.stress, samples.along_z)
    largest = float(np.abs(samples.stress).max())
    values = values * (largest > result.rounding.stress)
    deformed = samples.points + factor * shape.at(samples.cells, samples.reference[:, -2:])
    part = (shape.space.block + (shape.space.block.max() + 1) * result.problem.cell_materials)[samples.cells]
    bands = draw_contours(axes, samples.points, deformed, samples.triangles, values, part, scales.stress)

    # outlines before and after, and both faces of joints
    def face(edges: Edges, *, other: bool = False) -> FloatArray:
        return np.stack(mesh.points_along(edges, t), axis=-1) + factor * shape.along(edges, t, other=other)

    before, after = np.stack(mesh.points_along(mesh.boundary, t), axis=-1), face(mesh.boundary)
    label = f"before; displacements × {style.beside([factor])[0]}"
    axes.add_collection(style.lines(style.edge_lines(mesh, mesh.boundary), style.GREY, (0, (4, 3)), 0.6, label))
    axes.add_collection(style.lines(after, "#333333", "solid", 0.8))
    for joint in result.problem.joints:
        for other in (False, True):
            side = face(mesh.edges(joint.edges), other=other)
            axes.add_collection(style.lines(side, "#333333", "solid", 0.6))
    # symbols of loads and supports, which move as the nearest point of the boundary does; obstacles and springs
    lines = [line for name in result.contacts for line in _lines_of(result, name, shape, factor)]
    sprung = {contact.name for contact in result.problem.contacts if contact.has_springs}
    extent = [before.reshape(-1, 2), after.reshape(-1, 2)]
    tree, moves = cKDTree(extent[0]), extent[1] - extent[0]
    extent += draw_symbols(axes, result.problem, lambda points: np.asarray(points + moves[tree.query(points)[1]]))
    extent += [_obstacle(axes, line, length, SPRING * length * (line.name in sprung)) for line in lines]
    # scales of the tractions, and their ranges for the legend
    pressure = max((float(np.abs(line.pressure).max()) for line in lines), default=0.0)
    friction = max((float(np.abs(line.shear).max()) for line in lines), default=0.0)
    if pressure <= max(NOTHING * largest, result.rounding.stress):
        pressure, friction, lines = 0.0, 0.0, []
    height = _HEIGHT * length
    if result.problem.joints:
        areas = np.bincount(shape.space.block, shape.space.areas / 2.0) * result.discretization.scales.length**2
        height = min(height, _IN_BLOCKS * float(np.sqrt(np.median(areas))))
    pressure_scale = height / max(scales.pressure, 1e-300)
    friction_scale = 1.8 * _SPACING * length / max(scales.friction, _LEAST * scales.pressure, 1e-300)
    low, high = (float(end(end(line.pressure) for line in lines)) if lines else 0.0 for end in (min, max))
    ends = dict.fromkeys(beside([low, high], 3)) if low < -_LEAST * abs(high) else ["up to " + beside([high], 3)[0]]
    label = f"pressure, {' to '.join(ends)} {units.stress}"  # a range if there is tension
    # tractions, line of thrust, resultants
    is_few, friction_text = len(lines) <= _LABELLED, beside([pressure, friction], 3)[1]
    labels = Labels(axes, extent[2:])
    for line in lines:
        spacing = _SPACING * length if is_few else np.inf
        outer = _tractions(axes, line, pressure_scale, friction_scale, spacing, label)
        extent.append(outer)
        labels.drawn += [line.place + share * (outer - line.place) for share in (0.0, 0.3, 0.6, 0.9)]
    if is_few and friction > 0.0 and friction_text != "0":
        look: dict[str, Any] = {"color": "black", "linewidth": 0.9, "marker": ">", "markersize": 3}
        axes.plot([], [], label=f"friction, up to {friction_text} {units.stress}", **look)
    _thrust(axes, lines)
    labelled = [line for line in lines if is_few or not line.joint]
    if 0 < len(labelled) <= _LABELLED:
        extent.append(_resultants(axes, labelled, length, units, labels))
    # the box around all of it, and the colour bar beside it, at least _TALL as high as the box is wide
    box = style.show_all(axes, np.concatenate(extent), units)
    across, up = box[1] - box[0]
    width, tall = 0.04 * max(1.0, float(up / across)), max(1.0, _TALL * float(across / up))
    bar = axes.inset_axes((1.0 + 0.8 * width, (1.0 - tall) / 2.0, width, tall))
    axes.figure.colorbar(bands, cax=bar, label=f"von Mises stress [{units.stress}]", extend=None)
    return Drawn(factor, box, pressure, labels)


def _lines_of(result: ContactResult, name: str, shape: Shape, factor: float) -> list[LineTractions]:
    """The lines of a contact with their tractions, at displacements magnified by the factor."""
    line = result.contacts[name]
    rows = next(rows for rows in result.discretization.contacts if rows.name == name)
    points, edges = rows.points, rows.points.edges
    place = np.column_stack([line.x, line.y])
    face = place + factor * shape.along(edges, points.reference).reshape(-1, 2)
    obstacle = place + factor * faces(result, name)[1]
    blocks = np.where(edges.cells >= 0, shape.space.block[edges.cells], -1)
    blocks = np.repeat(blocks, points.count, axis=0)
    normals, tangents = points.normals.copy(), points.tangents.copy()
    pieces = pieces_along(line, coordinates=False)[0]
    if rows.joint:  # a closed joint shows the tractions on the block inside it
        far = np.repeat(enclosed_beyond(result.problem.mesh.vertices, edges), points.count)
        normals[far], tangents[far], blocks[far] = -normals[far], -tangents[far], blocks[far, ::-1]
        far_face = shape.along(edges, points.reference, other=True).reshape(-1, 2)
        face[far] = (place + factor * far_face)[far]
    stresses = {"pressure": -line.normal_stress, "shear": line.tangential_stress, "fluid": line.pore_pressure}
    vectors = {"place": face, "obstacle": obstacle, "normal": normals, "tangent": tangents}
    return [
        LineTractions(
            name=name,
            joint=rows.joint,
            s=piece.with_ends,
            weights=np.pad(line.weights[piece.points], 1),
            blocks=np.pad(blocks[piece.points], ((1, 1), (0, 0)), mode="edge"),
            **{kind: piece.extended(values) for kind, values in vectors.items()},
            **{kind: piece.closed(line, values) for kind, values in stresses.items()},
        )
        for piece in pieces
    ]


def _obstacle(axes: "Axes", line: LineTractions, length: float, spring: float) -> FloatArray:
    """Draw the obstacle beside a line, unless it is a joint, and springs of this length at rest; the points (n, 2)."""
    offset = spring * line.normal
    if spring > 0.0:
        stretch = ((line.obstacle - line.place) * line.normal).sum(axis=1) / spring
        # a length at rest at which no spring is drawn too short or too long
        offset *= max(min(1.0, _LONGEST_SPRING - stretch.max()), _SHORTEST_SPRING - stretch.min())
        at = spaced(line.s, 2.0 * _SPACING * length)
        ends = line.place - line.joint * offset / 2.0, line.obstacle + offset * (0.5 if line.joint else 1.0)
        springs(axes, *(between(at, line.s, end) for end in ends))
    if not line.joint:
        ground(axes, line.obstacle + offset, line.normal, _HATCH * length)
    return line.obstacle + offset if spring > 0.0 else line.place


def _tractions(
    axes: "Axes", line: LineTractions, pressure_scale: float, friction_scale: float, spacing: float, label: str
) -> FloatArray:
    """Draw the pressure and friction of a line in scales [length / stress]; returns the points they cover (k, 2)."""
    from matplotlib.colors import to_rgba
    from matplotlib.patches import Polygon

    outer = line.place + pressure_scale * line.pressure[:, None] * line.normal
    look: dict[str, Any] = {"facecolor": to_rgba(style.VERMILLION, 0.22), "edgecolor": "none", "label": label}
    axes.add_patch(Polygon(np.concatenate([line.place, outer[::-1]]), zorder=3, **look))
    border = np.concatenate([line.place[:1], outer, line.place[-1:]])
    axes.plot(*border.T, color=style.VERMILLION, linewidth=0.9, zorder=3.2)
    if line.fluid.any():
        fluid = line.place + pressure_scale * line.fluid[:, None] * line.normal
        dashed: dict[str, Any] = {"linestyle": (0, (4, 1.5)), "label": "pressure of the fluid"}
        axes.plot(*fluid.T, color=style.BLUE, linewidth=0.9, zorder=3.3, **dashed)
    at = spaced(line.s, spacing, least=0)  # empty if the line is too short for an arrow
    place, normal, tangent = (between(at, line.s, values) for values in (line.place, line.normal, line.tangent))
    pressure, shear = (np.interp(at, line.s, values) for values in (line.pressure, line.shear))
    push, rub = -pressure_scale * pressure[:, None] * normal, friction_scale * shear[:, None] * tangent
    is_long = pressure_scale * np.abs(pressure) > 0.35 * spacing
    axes.quiver(*(place - push)[is_long].T, *push[is_long].T, zorder=3.1, **_ARROW, **_PRESSURE)
    is_long = (friction_scale * np.abs(shear) > 0.3 * spacing) & (np.arange(len(at)) % 2 == 0)  # every second one
    tails = place - 0.55 * spacing * normal - rub / 2.0
    axes.quiver(*tails[is_long].T, *rub[is_long].T, zorder=4, **_ARROW, **_FRICTION)
    return outer


def _resultants(
    axes: "Axes", lines: Sequence[LineTractions], length: float, units: Units, labels: Labels
) -> FloatArray:
    """Draw resultants as heavy arrows with numbers and eccentricities; returns their ends (n, 2)."""
    resultants = [line.resultant() for line in lines]
    sizes = [float(np.hypot(*force)) for force, _ in resultants]
    numbers, ends = beside(sizes), [np.empty((0, 2))]
    for line, (force, centre), size, number in zip(lines, resultants, sizes, numbers, strict=True):
        is_balanced = line.turns and size <= _LEAST * float(line.weights @ np.abs(line.pressure))
        if is_balanced or size <= _LEAST * max(sizes):
            continue
        back = -force / size
        tail = centre + back * length * max(_LONGEST * size / max(sizes), 0.3 * _LONGEST)
        axes.quiver(*tail, *(centre - tail), zorder=5, **_ARROW, **_RESULTANT)
        ends.append(np.array([tail, centre]))
        text = f"{line.name}: {number} {units.force}"
        if line.eccentricity > _CENTRAL * (line.s[-1] - line.s[0]):
            text += f"\ne = {beside([line.eccentricity], 3)[0]} {units.length}"
        side, middle = np.array([-back[1], back[0]]), (tail + centre) / 2.0
        labels.write(text, [(tail, back), (tail, side), (tail, -side), (middle, side), (middle, -side)])
    return np.concatenate(ends)


def _thrust(axes: "Axes", lines: Sequence[LineTractions]) -> None:
    """Draw lines of thrust.

    The contact forces on a block form two groups: those along its largest force, and those against it. The line of
    thrust of the block joins the centres of the two groups.
    """
    forces_on: dict[int, list[tuple[FloatArray, FloatArray]]] = {}
    for line in lines:
        for pair in np.unique(line.blocks, axis=0).tolist():
            force, centre = line.resultant((line.blocks == pair).all(axis=1))
            for block, sign in zip(pair, (1.0, -1.0), strict=True):
                if block >= 0:
                    forces_on.setdefault(block, []).append((sign * force, centre))
    largest = max((float(np.hypot(*force)) for pairs in forces_on.values() for force, _ in pairs), default=0.0)
    thrusts = []
    for pairs in forces_on.values() if any(line.joint for line in lines) else ():
        forces, centres = (np.array(values) for values in zip(*pairs, strict=True))
        weights = np.hypot(*forces.T)
        along = forces @ forces[np.argmax(weights)]
        groups = [group for group in (along > 0.0, along < 0.0) if weights[group].sum() > _LEAST * largest]
        if len(groups) > 1:
            thrusts.append([weights[group] @ centres[group] / weights[group].sum() for group in groups])
    if thrusts:
        axes.add_collection(style.lines(np.array(thrusts), *_THRUST, "line of thrust"), autolim=False)


_LEVELS: Final = 8  # about so many contour lines
_ALL_BUT_FEW: Final = 0.99  # share of the points whose values set the range of the bands
_ROUNDING: Final = 1e-6  # share of the largest value to which values are rounded: else bands show a rounding error
_UNIFORM: Final = 1e-4  # range of a field over its size below which the field counts as uniform


def usual_range(values: FloatArray) -> tuple[float, float]:
    """The range of values ≥ 0 without a few that are much larger than all others, as near sharp corners."""
    largest, usual = float(values.max()), float(np.quantile(values, _ALL_BUT_FEW))
    return float(values.min()), usual if usual < 0.7 * largest else largest


def draw_contours(
    axes: "Axes",
    points: FloatArray,
    places: FloatArray,
    triangles: IntArray,
    values: FloatArray,
    part: IntArray,
    ends: tuple[float, float] | None = None,
) -> "TriContourSet":
    """Draw values (n,) ≥ 0 at points (n, 2) as coloured bands with contour lines, at `places` (n, 2) in the drawing.

    Where points of one `part` (n,) coincide their values are averaged. Bands end at `ends`, by default at the
    `usual_range`.
    """
    from matplotlib import colormaps
    from matplotlib.ticker import MaxNLocator
    from matplotlib.tri import Triangulation

    rounded = np.round((points - points.min(axis=0)) / max(float(np.ptp(points, axis=0).max()), 1e-300), 9)
    _, first, group = np.unique(np.column_stack([rounded, part]), axis=0, return_index=True, return_inverse=True)
    group = group.ravel()
    means = np.bincount(group, values) / np.bincount(group)
    size = float(means.max())
    means = np.round(means, -int(np.floor(np.log10(_ROUNDING * max(size, 1e-300)))))
    # range and levels of the bands
    low, high = usual_range(means) if ends is None else ends
    if size == 0.0 and high == low:
        low, high = 0.0, 1.0
    elif high - low <= _UNIFORM * size:
        middle = (low + high) / 2.0
        low, high = middle - 0.05 * size, middle + 0.05 * size
    levels = MaxNLocator(_LEVELS, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high)
    # colours, with one more band for values below or above the levels
    colours = colormaps["Blues"](np.linspace(0.04, 0.66, len(levels) + 1))
    below, above = int(means.min() < levels[0]), int(means.max() > levels[-1])
    extend = ("neither", "max", "min", "both")[2 * below + above]
    look: dict[str, Any] = {"colors": colours[1 - below : len(levels) + above], "extend": extend}
    shape = Triangulation(places[first, 0], places[first, 1], group[triangles])
    bands: TriContourSet = axes.tricontourf(shape, means, levels, zorder=0.5, **look)
    with warnings.catch_warnings():  # Matplotlib 3.10 warns that it cannot rasterise contours
        warnings.filterwarnings("ignore", "Rasterization")
        bands.set_rasterized(True)
    axes.tricontour(shape, means, levels, colors="#08306b", linewidths=0.35, linestyles="solid", zorder=0.6)
    return bands
