"""The one drawing that answers: the deformed body with a field in bands, and what its contacts carry drawn on them.

How a stress state deforms the body is the displacement whose strains are nearest to those of the stresses. The stress
model has none inside the body. On contacts, obstacles and supports it has u_N = g − gap − σ_N'/k_N and
u_T = w + slip − σ_T/k_T, the last terms of springs. The displacement v of degree 2 that is drawn makes

    ∫ |ε(v) − c σ − ε⁰|² dx  +  α Σ w |v·d − known|²

least, ε⁰ the initial strain, the sum over points of contacts and supports with their weights w and directions d. It
takes one linear solve, and there is one for every stress state: for steps of a history too, whose Coulomb's law has no
energy.
"""

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from qvi_contact.basics.checks import FloatArray, IntArray, evaluate
from qvi_contact.companion import Elasticity
from qvi_contact.discretization.displacements import DisplacementSpace, triangle
from qvi_contact.element.edge import bernstein_basis, gauss_legendre
from qvi_contact.mesh.edges import Edges, cross, vectors_along
from qvi_contact.plots import style
from qvi_contact.plots.problem import SPRING, between, draw_symbols, ground, spaced, springs
from qvi_contact.plots.style import Written, alignment, beside, write
from qvi_contact.plots.tractions import pieces_along
from qvi_contact.problem.conditions import SPRINGS, Displacement
from qvi_contact.problem.material import stress_along_z, stress_at_rest
from qvi_contact.solution.contact_line import enclosed_beyond
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.stress import sample_body, stress_component, stress_in_cells
from qvi_contact.units import Units

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.tri import TriContourSet

_SAMPLES: Final = 120  # parts of the body's length that a field is drawn with
_TALL: Final = 0.25  # least height of the scale of colours over the width of the drawing, for bodies that are flat
_CALM: Final = 0.75  # displacements are drawn smaller than those of a mechanism
_HEIGHT: Final = 0.14  # of the largest pressure, as a share of the body's length
_IN_BLOCKS: Final = 0.3  # the same at most, as a share of the width of a block
_SPACING: Final = 0.032  # of arrows along contacts, as a share of the body's length
_LONGEST: Final = 0.2  # length of the arrow of the largest resultant, as a share of the body's length
_LEAST: Final = 0.02  # share of the largest value below which nothing is drawn
_LABELLED: Final = 8  # so many lines of contacts have arrows and numbers; of more those of obstacles alone
_NOTHING: Final = 1e-6  # tractions below this share of the stress in the body count as none
_CENTRAL: Final = 0.005  # eccentricity over the length of a line below which it is not written
_DEEP: Final = 0.005  # of the body's length: overlap of bodies that is not seen
_HATCH: Final = 0.016  # of obstacles, as a share of the body's length
_SHORTEST_SPRING, _LONGEST_SPRING = 0.3, 4.0  # of springs as they are drawn, over their length at rest

_DEGREE: Final = 2
_KNOWN: Final = 100.0  # α: what is known of displacements outweighs strains
_SOFTEST: Final = 1e-9  # the same for all displacements: motions that nothing determines stay small
_ISOTROPIC: Final = np.diag([1.0, 1.0, 0.5])  # |ε|² of (ε_xx, ε_yy, 2ε_xy)

_ARROW: Final[dict[str, Any]] = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "units": "inches"}
_PRESSURE: Final[dict[str, Any]] = {"color": style.VERMILLION, "width": 0.007, "headwidth": 5.0, "headlength": 6.0}
_FRICTION: Final[dict[str, Any]] = {"color": "black", "width": 0.011, "headwidth": 4.5, "headlength": 5.0}
_RESULTANT: Final[dict[str, Any]] = {"color": "black", "width": 0.025, "headwidth": 4.0, "headlength": 4.5}
_THRUST: Final = ("black", (0, (6, 1.5, 1, 1.5)), 1.1)


@dataclass(frozen=True, eq=False)
class Shape:
    """A displacement of the body, with faces of their own on both sides of joints."""

    space: DisplacementSpace
    """Elements of degree 2 on the mesh."""
    coefficients: FloatArray
    """Their coefficients [length], (n, 2)."""

    @classmethod
    def of(cls, result: ContactResult) -> "Shape":
        """The displacement of a stress state, see above."""
        problem, scales = result.problem, result.discretization.scales
        space = DisplacementSpace.of(problem, triangle(_DEGREE), scales.length)
        body = Elasticity(space, np.tile(_ISOTROPIC, (len(space.table), 1, 1)))
        t, weights = body.points()
        cells = np.arange(len(space.table))
        places = problem.mesh.origin + scales.length * space.points(slice(None), t)
        at, coefficients = problem.mesh.reference(cells, places), result.discretization.coefficients(result.dofs)
        stress = stress_in_cells(result.discretization, coefficients, cells, at)[1] * scales.stress
        stress = stress - stress_at_rest(problem, cells, places[..., 0], places[..., 1])
        strain = stress @ problem.compliances.swapaxes(1, 2)
        load = body.virtual_work((strain @ _ISOTROPIC) * weights[..., None], t)
        matrix, right = _known(result, space)
        K = body.stiffness() + _KNOWN * matrix.T @ matrix + _SOFTEST * sparse.eye_array(space.size)
        factor = splu(sparse.csc_array(K), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
        v = factor.solve(load + _KNOWN * (matrix.T @ right / scales.length))
        return cls(space, scales.length * v.reshape(-1, 2))

    def at(self, cells: IntArray, t: FloatArray) -> FloatArray:
        """Displacements at one reference point each, (n, 2), of cells (n,), shape (n, 2) [length]."""
        shapes = self.space.cell.values(self.space.own(cells, t[:, None]))
        return np.asarray((shapes @ self.coefficients[self.space.table[cells]])[:, 0])

    def along(self, edges: Edges, t: FloatArray, *, other: bool = False) -> FloatArray:
        """Displacements at t (q,), 0 to 1, of edges, (edges, q, 2) [length]; with `other` those of the far side."""
        return np.asarray(bernstein_basis(_DEGREE, t) @ self.coefficients[self.space.along(edges, other=other)])


def _known(result: ContactResult, space: DisplacementSpace) -> tuple[sparse.csr_array, FloatArray]:
    """Rows (k, size) of what is known of displacements, and their values (k,) [length], both times √w."""
    problem, scales, mesh = result.problem, result.discretization.scales, result.problem.mesh
    blocks, values = [sparse.csr_array((0, space.size))], [np.empty(0)]

    def add(edges: Edges, t: FloatArray, direction: FloatArray, known: FloatArray, joint: bool = False) -> None:
        """Rows for values (e, q) along directions (e, q, 2) at t (q,) of edges, of a joint those of the jump."""
        shape = bernstein_basis(space.degree, t)
        roots = np.sqrt(edges.length[:, None] / (scales.length * len(t)) * np.ones(len(t)))
        entries = roots[..., None, None] * shape[:, :, None] * direction[:, :, None]
        starts = np.arange(0, entries.size + 1, 2 * shape.shape[1])
        for other in (False, True) if joint else (False,):
            columns = np.broadcast_to(2 * space.along(edges, other=other)[:, None, :, None] + [0, 1], entries.shape)
            rows = sparse.csr_array((entries.ravel(), columns.ravel(), starts), shape=(known.size, space.size))
            blocks.append(blocks.pop() - rows if other else rows)
        values.append((roots * known).ravel())

    t = gauss_legendre(_DEGREE + 1)[0]
    for given in problem.prescribed(Displacement):
        places = mesh.points_along(given.edges, t)
        along = vectors_along(given.edges, given.direction, t, turns=given.turns)
        add(given.edges, t, along, evaluate(given.name, given.value, *places))
    for contact, rows in zip(problem.contacts, result.discretization.contacts, strict=True):
        body, _ = faces(result, contact.name)
        points, line = rows.points, result.contacts[contact.name]
        shaped = (len(points.edges), points.count)
        for direction in (points.normals, points.tangents)[: 1 if line.frictionless else 2]:
            known = (body * direction).sum(axis=1).reshape(shaped)
            add(points.edges, points.reference, direction.reshape(*shaped, 2), known, rows.joint)
    return sparse.csr_array(sparse.vstack(blocks)), np.concatenate(values)


def faces(result: ContactResult, name: str) -> tuple[FloatArray, FloatArray]:
    """Displacements (m, 2) of the body at the points of a contact, and where the obstacle stands beside them [length].

    Those of the body follow from gap, slip and what springs stretch by, with the motion of a plate; of a joint they are
    the jump. An obstacle stands at its gap g, and where its plate moves it; w along it is left out, which changes
    nothing of what it looks like. In a load history slip counts from its beginning.
    """
    discretization, line = result.discretization, result.contacts[name]
    index = next(i for i, rows in enumerate(discretization.contacts) if rows.name == name)
    rows, unit = discretization.contacts[index], discretization.scales.displacement
    normal, along = rows.points.normals, rows.points.tangents
    contact, gap = result.problem.contacts[index], unit * rows.gap
    outwards, sideways = gap - line.gap, unit * (rows.offset + rows.slip) + line.slip
    borne = (outwards, line.effective_normal_stress), (sideways, line.tangential_stress)
    for kind, (moved, stress) in zip(SPRINGS, borne, strict=True):
        if getattr(contact, kind) is not None:
            moved -= stress / evaluate(f"Contact.{kind}", getattr(contact, kind), line.x, line.y)
    body, obstacle = outwards[:, None] * normal + sideways[:, None] * along, gap[:, None] * normal
    if name in result.plates:  # one that is driven by force
        rigid = result.plates[name].at(np.column_stack([line.x, line.y]))
        body, obstacle = body + rigid, obstacle + rigid
    return body, obstacle


@dataclass(frozen=True, eq=False)
class Carried:
    """What one line of a contact carries, at its k points and both ends, where it is drawn.

    Places are those of the deformed face of the body and of the obstacle, the normal points outwards (k, 2). Pressure
    −σ_N, shear σ_T and fluid p_w are stresses, weights those of integrals along the line, zero at the ends. Blocks are
    that inside and that beyond, −1 on obstacles (k, 2).
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
        """Force of some points on the body inside [stress × length], and the centre of pressure [length].

        Where the line is curved the centre is moved onto the line of action, to where that meets the contact, unless
        that is far away: what acts around a whole circle may next to balance itself.
        """
        pull = -self.pressure[chosen, None] * self.normal[chosen] + self.shear[chosen, None] * self.tangent[chosen]
        place, weights = self.place[chosen], self.weights[chosen]
        forces = weights[:, None] * pull
        share = weights * np.maximum(self.pressure[chosen], 0.0)
        share = share if share.any() else weights
        centre, force = share @ place / share.sum(), forces.sum(axis=0)
        size, moment = float(np.hypot(*force)), float(cross(place - centre, forces).sum())
        near = abs(moment) < size * float(np.ptp(place, axis=0).max())
        if near and np.ptp(self.normal[chosen], axis=0).max() > 1e-6:
            centre = centre + moment / size**2 * np.array([force[1], -force[0]])
            loaded = place[share > 0.1 * share.max()] - centre
            nearest = loaded[np.argmin(np.abs(cross(loaded, force)))]
            centre = centre + force * (nearest @ force) / size**2
        return force, centre

    @property
    def turns(self) -> bool:
        """Whether the line is not straight, so that pressure on it may balance itself."""
        return bool(np.ptp(self.normal, axis=0).max() > 1e-6)

    @property
    def eccentricity(self) -> float:
        """Distance of the centre of pressure from the middle of a straight line [length]; 0 on others."""
        share = self.weights * self.pressure
        if self.turns or share.sum() <= _NOTHING * np.abs(share).sum():
            return 0.0
        return abs(float(share @ self.s / share.sum() - (self.s[0] + self.s[-1]) / 2.0))


@dataclass(frozen=True)
class Scales:
    """What drawings that are looked at beside each other have in common."""

    factor: float
    """By how much displacements are exaggerated."""
    pressure: float
    friction: float
    """The largest on contacts [stress]."""
    stress: tuple[float, float] | None = None
    """Ends of the bands of colour [stress]; None for those of each drawing."""

    @classmethod
    def of(cls, results: Iterable[ContactResult], component: str = "von_mises") -> "Scales":
        """Those of results such as the steps of a history.

        Displacements are exaggerated no more than keeps bodies from being drawn inside each other.
        """
        moved, most, pressure, friction, ranges = 0.0, np.inf, 0.0, 0.0, []
        for result in results:
            shape, least = Shape.of(result), style.LEAST * result.discretization.scales.displacement
            moved = max(moved, least, float(np.hypot(*shape.coefficients.T).max()))
            most = min(most, _separate(result, shape, style.magnified(moved, _CALM * result.problem.mesh.length)))
            for line in result.contacts.values():
                pressure = max(pressure, float(np.abs(line.normal_stress).max()))
                friction = max(friction, float(np.abs(line.tangential_stress).max()))
            x, y, stress = result.gauss_stress()
            zz = stress_along_z(result.problem, np.arange(len(x)), x, y, stress)
            ranges.append(usual_range(stress_component(stress, component, zz)))
        low, high = np.array(ranges).reshape(-1, 2).T
        common = (float(low.min()), float(high.max())) if len(ranges) > 1 else None
        return cls(most if np.isfinite(most) else 1.0, pressure, friction, common)


@dataclass(frozen=True)
class Drawn:
    """What a drawing of a body says of itself."""

    factor: float
    """By how much displacements are exaggerated."""
    box: FloatArray
    """Lower left and upper right corner of all that is drawn [length], (2, 2)."""
    pressure: float
    """The largest on all contacts [stress]."""
    written: list[Written]
    """Numbers of resultants, each with other places that it may have, see `style.spread`."""


def draw_body(
    axes: "Axes",
    result: ContactResult,
    component: str = "von_mises",
    units: Units | None = None,
    scales: Scales | None = None,
) -> Drawn:
    """Draw the deformed body with a stress as a field with contour lines, and its contacts as a textbook does.

    On each contact stand the pressure, as a diagram in one scale for all contacts, with arrows towards the body; the
    friction stress on the body, as arrows inside it; and the resultant, as a heavy arrow with its number, on straight
    contacts with its eccentricity e. Blocks that are pressed from two sides have a line of thrust between the centres
    of pressure. Loads, supports and obstacles are small symbols. Displacements are those of `Shape`, exaggerated by one
    factor; dashed lines show the body before. Axes are in units of length.

    The component is "xx", "yy", "xy" (tension positive), "von_mises" (with σ_zz in plane strain), or "first", "second":
    the principal stresses σ₁ ≥ σ₂ in the plane. Scales are those of several results that are looked at beside each
    other; by default those of this one. `InputError` if there is no such stress, or no stress state.
    """
    from scipy.spatial import cKDTree

    units, mesh, shape = style.plain_units(units), result.problem.mesh, Shape.of(result)
    scales = Scales.of([result], component) if scales is None else scales
    factor, length, t = scales.factor, mesh.length, np.linspace(0.0, 1.0, style.CHORDS + 1)
    samples = sample_body(result, _SAMPLES)
    values = stress_component(samples.stress, component, samples.along_z)
    size = float(np.abs(samples.stress).max())
    values = values * (size > result.rounding.stress)
    places = samples.points + factor * shape.at(samples.cells, samples.reference[:, -2:])
    part_of = shape.space.block + (shape.space.block.max() + 1) * result.problem.cell_materials
    field = draw_contours(
        axes, samples.points, places, samples.triangles, values, part_of[samples.cells], scales.stress
    )

    def face(edges: Edges, *, other: bool = False) -> FloatArray:
        return np.stack(mesh.points_along(edges, t), axis=-1) + factor * shape.along(edges, t, other=other)

    before, after = np.stack(mesh.points_along(mesh.boundary, t), axis=-1), face(mesh.boundary)
    label = f"before; displacements × {factor:g}"
    axes.add_collection(style.lines(style.edge_lines(mesh, mesh.boundary), style.GREY, (0, (4, 3)), 0.6, label))
    axes.add_collection(style.lines(after, "#333333", "solid", 0.8))
    for joint in result.problem.joints:
        for other in (False, True):
            side = face(mesh.edges(joint.edges), other=other)
            axes.add_collection(style.lines(side, "#333333", "solid", 0.6))
    carried = [part for name in result.contacts for part in _carried(result, name, shape, factor)]
    sprung = {contact.name for contact in result.problem.contacts if contact.has_springs}
    extent = [before.reshape(-1, 2), after.reshape(-1, 2)]
    tree, moves = cKDTree(extent[0]), extent[1] - extent[0]  # beside the boundary all move as its nearest point does
    extent += draw_symbols(axes, result.problem, lambda points: np.asarray(points + moves[tree.query(points)[1]]))
    extent += [_obstacle(axes, part, length, SPRING * length * (part.name in sprung)) for part in carried]
    pressure = max((float(np.abs(part.pressure).max()) for part in carried), default=0.0)
    friction = max((float(np.abs(part.shear).max()) for part in carried), default=0.0)
    if pressure <= max(_NOTHING * size, result.rounding.stress):
        pressure, friction, carried = 0.0, 0.0, []
    height = _HEIGHT * length
    if result.problem.joints:
        areas = np.bincount(shape.space.block, shape.space.areas / 2.0) * result.discretization.scales.length**2
        height = min(height, _IN_BLOCKS * float(np.sqrt(np.median(areas))))
    few, most = len(carried) <= _LABELLED, beside([pressure, friction], 3)
    reach = 1.8 * _SPACING * length / max(scales.friction, _LEAST * scales.pressure, 1e-300)
    low, high = (float(end(end(part.pressure) for part in carried)) if carried else 0.0 for end in (min, max))
    ends = dict.fromkeys(beside([low, high], 3)) if low < -_LEAST * abs(high) else ["up to " + beside([high], 3)[0]]
    name = f"pressure, {' to '.join(ends)} {units.stress}"  # tells the largest, or the range where there is tension
    for part in carried:
        scale, spacing = height / max(scales.pressure, 1e-300), _SPACING * length if few else np.inf
        extent.append(_tractions(axes, part, scale, reach, spacing, name))
    if friction > 0.0 and most[1] != "0":
        look: dict[str, Any] = {"color": "black", "linewidth": 0.9, "marker": ">", "markersize": 3}
        axes.plot([], [], label=f"friction, up to {most[1]} {units.stress}", **look)
    _thrust(axes, carried)
    labelled = [part for part in carried if few or not part.joint]
    written: list[Written] = []
    if 0 < len(labelled) <= _LABELLED:
        covered, written = _resultants(axes, labelled, length, units)
        extent.append(covered)
    box = style.show_all(axes, np.concatenate(extent), units)
    across, up = box[1] - box[0]
    width, tall = 0.04 * max(1.0, float(up / across)), max(1.0, _TALL * float(across / up))
    scale_of = axes.inset_axes((1.0 + 0.8 * width, (1.0 - tall) / 2.0, width, tall))
    axes.figure.colorbar(field, cax=scale_of, label=f"{COMPONENT_LABELS[component]} [{units.stress}]", extend=None)
    return Drawn(factor, box, pressure, written)


def _separate(result: ContactResult, shape: Shape, factor: float) -> float:
    """The largest of 1, 2, 5 times a power of ten up to the factor that draws no block inside another; at least 1."""
    mesh, block, cells = result.problem.mesh, shape.space.block, np.arange(result.problem.mesh.cell_count)
    t = np.linspace(0.0, 1.0, style.CHORDS + 1)
    owner = np.repeat(block[mesh.boundary.cells[:, 0]], len(t))
    before = np.stack(mesh.points_along(mesh.boundary, t), axis=-1).reshape(-1, 2)
    inwards = np.repeat(mesh.corners[mesh.boundary.cells[:, 0]].mean(axis=1), len(t), axis=0) - before  # off joints too
    before += np.minimum(1.0, _DEEP * mesh.length / np.linalg.norm(inwards, axis=1, keepdims=True)) * inwards
    moved = shape.along(mesh.boundary, t).reshape(-1, 2)
    corners = np.stack([shape.at(cells, np.tile(at, (len(cells), 1))) for at in np.eye(3)[:, 1:]], axis=1)

    def apart(factor: float) -> bool:
        points, triangles = before + factor * moved, mesh.corners + factor * corners
        for number in np.unique(block).tolist():
            own = triangles[block == number]
            low, high = own.min(axis=(0, 1)), own.max(axis=(0, 1))
            near = points[(owner != number) & ((points > low) & (points < high)).all(axis=1)]
            a = own[:, None]
            turns = [cross(a[:, :, k - 2] - a[:, :, k], near - a[:, :, k]) > 0.0 for k in range(3)]
            if np.logical_and.reduce(turns).any():
                return False
        return True

    while factor > 1.0 and not apart(factor):
        factor = style.rounded_down(0.99 * factor)
    return factor


def _carried(result: ContactResult, name: str, shape: Shape, factor: float) -> list[Carried]:
    """The lines of a contact."""
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
    if rows.joint:  # around a block: what acts on that one
        turned = np.repeat(enclosed_beyond(result.problem.mesh.vertices, edges), points.count)
        normals[turned], tangents[turned], blocks[turned] = -normals[turned], -tangents[turned], blocks[turned, ::-1]
        beyond = shape.along(edges, points.reference, other=True).reshape(-1, 2)
        face[turned] = (place + factor * beyond)[turned]
    stresses = {"pressure": -line.normal_stress, "shear": line.tangential_stress, "fluid": line.pore_pressure}
    vectors = {"place": face, "obstacle": obstacle, "normal": normals, "tangent": tangents}
    return [
        Carried(
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


def _obstacle(axes: "Axes", part: Carried, length: float, spring: float) -> FloatArray:
    """An obstacle beside a line that is none of a joint, and springs; what these cover (n, 2).

    Springs are of this length [length] at rest, or another one if they were too short or long to be seen else.
    """
    away = spring * part.normal
    if spring > 0.0:
        stretch = ((part.obstacle - part.place) * part.normal).sum(axis=1) / spring
        away *= max(min(1.0, _LONGEST_SPRING - stretch.max()), _SHORTEST_SPRING - stretch.min())
        at = spaced(part.s, 2.0 * _SPACING * length)
        ends = part.place - part.joint * away / 2.0, part.obstacle + away * (0.5 if part.joint else 1.0)
        springs(axes, *(between(at, part.s, end) for end in ends))
    if not part.joint:
        ground(axes, part.obstacle + away, part.normal, _HATCH * length)
    return part.obstacle + away if spring > 0.0 else part.place


def _tractions(axes: "Axes", part: Carried, scale: float, reach: float, spacing: float, label: str) -> FloatArray:
    """Pressure and friction of a line, drawn `scale` and `reach` [length / stress] long; what they cover (k, 2)."""
    from matplotlib.colors import to_rgba
    from matplotlib.patches import Polygon

    outer = part.place + scale * part.pressure[:, None] * part.normal
    look: dict[str, Any] = {"facecolor": to_rgba(style.VERMILLION, 0.22), "edgecolor": "none", "label": label}
    axes.add_patch(Polygon(np.concatenate([part.place, outer[::-1]]), zorder=3, **look))
    border = np.concatenate([part.place[:1], outer, part.place[-1:]])
    axes.plot(*border.T, color=style.VERMILLION, linewidth=0.9, zorder=3.2)
    if part.fluid.any():
        fluid = part.place + scale * part.fluid[:, None] * part.normal
        dashed: dict[str, Any] = {"linestyle": (0, (4, 1.5)), "label": "pressure of the fluid"}
        axes.plot(*fluid.T, color=style.BLUE, linewidth=0.9, zorder=3.3, **dashed)
    at = spaced(part.s, spacing, least=0)  # none where there is no room for one
    place, normal, tangent = (between(at, part.s, values) for values in (part.place, part.normal, part.tangent))
    pressure, shear = (np.interp(at, part.s, values) for values in (part.pressure, part.shear))
    pushed, rubbed = -scale * pressure[:, None] * normal, reach * shear[:, None] * tangent
    drawn = scale * np.abs(pressure) > 0.35 * spacing
    axes.quiver(*(place - pushed)[drawn].T, *pushed[drawn].T, zorder=3.1, **_ARROW, **_PRESSURE)
    drawn = (reach * np.abs(shear) > 0.3 * spacing) & (np.arange(len(at)) % 2 == 0)
    tails = place - 0.55 * spacing * normal - rubbed / 2.0
    axes.quiver(*tails[drawn].T, *rubbed[drawn].T, zorder=4, **_ARROW, **_FRICTION)
    return outer


def _resultants(
    axes: "Axes", carried: Sequence[Carried], length: float, units: Units
) -> tuple[FloatArray, list[Written]]:
    """Resultants as heavy arrows with their numbers, and eccentricities; what they cover (n, 2), and the texts."""
    found = [part.resultant() for part in carried]
    sizes = [float(np.hypot(*force)) for force, _ in found]
    names, ends, written = beside(sizes), [np.empty((0, 2))], list[Written]()
    for part, (force, centre), size, number in zip(carried, found, sizes, names, strict=True):
        balanced = part.turns and size <= _LEAST * float(part.weights @ np.abs(part.pressure))
        if balanced or size <= _LEAST * max(sizes):
            continue
        way = -force / size
        tail = centre + way * length * max(_LONGEST * size / max(sizes), 0.3 * _LONGEST)
        axes.quiver(*tail, *(centre - tail), zorder=5, **_ARROW, **_RESULTANT)
        ends.append(np.array([tail, centre]))
        text = f"{part.name}: {number} {units.force}"
        if part.eccentricity > _CENTRAL * (part.s[-1] - part.s[0]):
            text += f"\ne = {beside([part.eccentricity], 3)[0]} {units.length}"
        side = np.array([-way[1], way[0]])
        written.append(write(axes, text, [(tail + 0.015 * length * to, alignment(to)) for to in (way, side, -side)]))
    return np.concatenate(ends), written


def _thrust(axes: "Axes", carried: Sequence[Carried]) -> None:
    """Draw lines of thrust.

    What presses a block is parted into what pushes along the largest of its forces and what pushes against it; the line
    of thrust leads between the centres of the two.
    """
    pushing: dict[int, list[tuple[FloatArray, FloatArray]]] = {}
    for part in carried:
        for pair in np.unique(part.blocks, axis=0).tolist():
            force, centre = part.resultant((part.blocks == pair).all(axis=1))
            for block, sign in zip(pair, (1.0, -1.0), strict=True):
                if block >= 0:
                    pushing.setdefault(block, []).append((sign * force, centre))
    largest = max((float(np.hypot(*force)) for found in pushing.values() for force, _ in found), default=0.0)
    drawn = []
    for found in pushing.values() if any(part.joint for part in carried) else ():
        forces, centres = (np.array(values) for values in zip(*found, strict=True))
        weights = np.hypot(*forces.T)
        along = forces @ forces[np.argmax(weights)]
        groups = [chosen for chosen in (along > 0.0, along < 0.0) if weights[chosen].sum() > _LEAST * largest]
        if len(groups) > 1:
            drawn.append([weights[chosen] @ centres[chosen] / weights[chosen].sum() for chosen in groups])
    if drawn:
        axes.add_collection(style.lines(np.array(drawn), *_THRUST, "line of thrust"), autolim=False)


COMPONENT_LABELS: Final = {
    "xx": "$\\sigma_{xx}$",
    "yy": "$\\sigma_{yy}$",
    "xy": "$\\sigma_{xy}$",
    "von_mises": "von Mises stress",
    "first": "$\\sigma_1$ in the plane",
    "second": "$\\sigma_2$ in the plane",
}

_LEVELS: Final = 8  # about so many contour lines
_ALL_BUT_FEW: Final = 0.99  # share of the points whose values set the range of contour lines
_UNIFORM: Final = 1e-4  # range of values over their size below which there is nothing to see


def usual_range(values: FloatArray) -> tuple[float, float]:
    """The range of values, without a few that are much larger than all others, as in corners."""
    sizes = np.abs(values)
    size, usual = float(sizes.max()) or 1.0, float(np.quantile(sizes, _ALL_BUT_FEW))
    end = usual if usual < 0.7 * size else size
    return max(float(values.min()), -end), min(float(values.max()), end)


def draw_contours(
    axes: "Axes",
    points: FloatArray,
    places: FloatArray,
    triangles: IntArray,
    values: FloatArray,
    part: IntArray,
    ends: tuple[float, float] | None = None,
) -> "TriContourSet":
    """Draw values (n,) at points (n, 2) as bands with contour lines between, at the `places` (n, 2) of the drawing.

    Where points of one `part` (n,) coincide they have the mean of their values. Bands end at `ends`, by default at the
    `usual_range`. Values of both signs have a map that is white at zero.
    """
    from matplotlib import colormaps
    from matplotlib.ticker import MaxNLocator
    from matplotlib.tri import Triangulation

    rounded = np.round((points - points.min(axis=0)) / max(float(np.ptp(points, axis=0).max()), 1e-300), 9)
    _, first, one = np.unique(np.column_stack([rounded, part]), axis=0, return_index=True, return_inverse=True)
    one = one.ravel()
    means = np.bincount(one, values) / np.bincount(one)
    low, high = usual_range(means) if ends is None else ends
    size = float(np.abs(means).max())
    if size == 0.0 and high == low:
        low, high = 0.0, 1.0
    elif high - low <= _UNIFORM * size:
        middle = (low + high) / 2.0
        low, high = middle - 0.05 * size, middle + 0.05 * size
    end = max(abs(low), abs(high))
    both = low < -0.05 * end and high > 0.05 * end
    low, high = (-end, end) if both else (low, high)
    levels = MaxNLocator(_LEVELS, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high)
    share = np.linspace(0.0, 1.0, len(levels) + 1)
    pale = 0.04 + 0.62 * (share if high > -low else share[::-1])
    colours = colormaps["PuOr_r"](share) if both else colormaps["Blues"](pale)
    below, above = int(means.min() < levels[0]), int(means.max() > levels[-1])
    extend = ("neither", "max", "min", "both")[2 * below + above]
    look: dict[str, Any] = {"colors": colours[1 - below : len(levels) + above], "extend": extend}
    shape = Triangulation(places[first, 0], places[first, 1], one[triangles])
    bands: TriContourSet = axes.tricontourf(shape, means, levels, zorder=0.5, **look)
    with warnings.catch_warnings():  # Matplotlib 3.10 cannot, and says so
        warnings.filterwarnings("ignore", "Rasterization")
        bands.set_rasterized(True)
    axes.tricontour(shape, means, levels, colors="#08306b", linewidths=0.35, linestyles="solid", zorder=0.6)
    return bands
