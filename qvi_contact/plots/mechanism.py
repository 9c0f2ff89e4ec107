"""How a load moves the blocks that it cannot be carried by, and how bodies that yield flow."""

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.limit.load_factor import Collapse
from qvi_contact.mechanism import Mechanism
from qvi_contact.mesh.edges import cross, turned
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.plots.style import BLUE, GREY, LONGEST, lines

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DEEPEST: Final = 0.95  # share of the triangles that dissipate less than what has the deepest colour
_STILL: Final = 0.02  # share of the largest velocity below which nothing is drawn
_ARROW: Final = 0.002  # width of arrows, as a share of the picture's


def draw_mechanism(axes: "Axes", mesh: TriangleMesh, mechanism: Mechanism) -> FloatArray:
    """Draw all blocks where a mechanism moves them, over dashed outlines of where they were; the corners (n, 2).

    Its motions are small; they are drawn so large that the largest displacement is 8 % of the body's length, and
    rotations without the growth that comes with that.

    Parameters
    ----------
    axes : matplotlib axes
        Where to draw; axes are in units of length.
    mesh : TriangleMesh
        The mesh of the problem.
    mechanism : Mechanism
        What `ContactResult.mechanism` or `LimitLoad.mechanism` gives.

    """
    from matplotlib.collections import PolyCollection

    cells = _moved(mesh, mechanism, mesh.corners, mechanism.blocks)
    look: dict[str, Any] = {"facecolors": "#d6e6f2", "edgecolors": "#d6e6f2", "linewidths": 0.3}
    axes.add_collection(PolyCollection(list(cells), zorder=1.0, **look))
    before, after = block_outlines(mesh, mechanism)
    axes.add_collection(lines(before, GREY, (0, (4, 3)), 0.7))
    axes.add_collection(lines(after, BLUE, "solid", 1.0, "mechanism"))
    return np.concatenate([before.reshape(-1, 2), after.reshape(-1, 2)])


def draw_collapse(axes: "Axes", mesh: TriangleMesh, collapse: Collapse) -> None:
    """Draw where a body yields, how it flows, and which contacts slide.

    The deeper the orange of a triangle, the more power it dissipates for its area; white ones dissipate none. Arrows
    are velocities in the middle of triangles. Contacts that slide are thick blue lines.

    Parameters
    ----------
    axes : matplotlib axes
        Where to draw, over a picture of the problem; axes are in units of length.
    mesh : TriangleMesh
        The mesh of the analysis.
    collapse : Collapse
        What `LimitLoad.collapse` gives.

    """
    from matplotlib.collections import PolyCollection

    motion = collapse.motion
    a, b, c = mesh.corners.swapaxes(0, 1)
    density = motion.dissipation / np.abs(cross(b - a, c - a))
    shade = np.sqrt(np.minimum(density / max(float(np.quantile(density, _DEEPEST)), 1e-300), 1.0))
    colours = np.column_stack([np.tile([0.9, 0.45, 0.0], (len(shade), 1)), 0.85 * shade])
    axes.add_collection(PolyCollection(list(mesh.corners), facecolors=colours, edgecolors="none", zorder=1.5))
    speed = motion.velocities.mean(axis=1)
    largest = float(np.hypot(*speed.T).max())
    moving = np.hypot(*speed.T) > _STILL * largest
    x, y = mesh.corners.mean(axis=1)[moving].T
    u, v = speed[moving].T * (LONGEST * mesh.length / max(largest, 1e-300))
    axes.quiver(x, y, u, v, angles="xy", scale_units="xy", scale=1.0, width=_ARROW, color=BLUE, zorder=4)
    for name, moved in motion.contacts.items():
        edges = mesh.edges(name) if name in (*mesh.edge_names, *mesh.joint_names) else None
        sliding = np.abs(moved.slip).max(axis=1) > _STILL * largest
        if edges is not None and sliding.any():
            ends = mesh.vertices[np.stack([edges.first, edges.second], axis=1)][sliding]
            axes.add_collection(lines(ends, BLUE, "solid", 3.0, f"sliding {name}"))


def block_outlines(mesh: TriangleMesh, mechanism: Mechanism) -> tuple[FloatArray, FloatArray]:
    """Ends (n, 2, 2) of the edges around all blocks, before a mechanism moves them and after [length]."""
    boundary, interior = mesh.boundary, mesh.interior
    beside = mechanism.blocks[interior.cells]
    joints = interior.take(beside[:, 0] != beside[:, 1])
    first = np.concatenate([boundary.first, joints.first, joints.first])
    second = np.concatenate([boundary.second, joints.second, joints.second])
    cells = np.concatenate([boundary.cells[:, 0], joints.cells[:, 0], joints.cells[:, 1]])
    ends = mesh.vertices[np.stack([first, second], axis=1)]
    return ends, _moved(mesh, mechanism, ends, mechanism.blocks[cells])


def _moved(mesh: TriangleMesh, mechanism: Mechanism, points: FloatArray, blocks: IntArray) -> FloatArray:
    """Points (n, k, 2) of blocks (n,) where they are drawn [length]."""
    found, scale = np.array(points), LONGEST * mesh.length
    for number, motion in enumerate(mechanism.motions):
        chosen = blocks == number
        arm = points[chosen] - motion.centre
        turn = np.arctan(scale * motion.rotation)
        found[chosen] = motion.centre + turned(arm, turn) + scale * np.array([motion.x, motion.y])
    return found
