"""How a load moves the blocks that it cannot be carried by."""

from typing import TYPE_CHECKING, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.mechanism import Mechanism
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.plots.style import BLUE, lines

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FARTHEST: Final = 0.08  # share of the body's length at which the largest displacement is drawn


def draw_mechanism(axes: "Axes", mesh: TriangleMesh, mechanism: Mechanism) -> None:
    """Draw the outlines of all blocks where a mechanism moves them, as dashed lines.

    Its motions are small; they are drawn so large that the largest displacement is 8 % of the body's length, and
    rotations without the growth that comes with that.

    Parameters
    ----------
    axes : matplotlib axes
        Where to draw, over a picture of the problem; axes are in units of length.
    mesh : TriangleMesh
        The mesh of the problem.
    mechanism : Mechanism
        What `ContactResult.mechanism` or `LimitLoad.mechanism` gives.

    """
    axes.add_collection(lines(moved_outlines(mesh, mechanism), BLUE, (0, (5, 2)), 1.4, "mechanism"))


def moved_outlines(mesh: TriangleMesh, mechanism: Mechanism) -> FloatArray:
    """Ends (n, 2, 2) of the edges around all blocks, moved [length]."""
    boundary, interior = mesh.boundary, mesh.interior
    beside = mechanism.blocks[interior.cells]
    joints = interior.take(beside[:, 0] != beside[:, 1])
    first = np.concatenate([boundary.first, joints.first, joints.first])
    second = np.concatenate([boundary.second, joints.second, joints.second])
    cells = np.concatenate([boundary.cells[:, 0], joints.cells[:, 0], joints.cells[:, 1]])
    ends = np.stack([mesh.vertices[first], mesh.vertices[second]], axis=1)
    for number, motion in enumerate(mechanism.motions):
        chosen = mechanism.blocks[cells] == number
        scale = _FARTHEST * mesh.length
        turn = np.arctan(scale * motion.rotation)
        arm = ends[chosen] - motion.centre
        cosine, sine = np.cos(turn), np.sin(turn)
        rotated = np.stack([cosine * arm[..., 0] - sine * arm[..., 1], sine * arm[..., 0] + cosine * arm[..., 1]], -1)
        ends[chosen] = motion.centre + rotated + scale * np.array([motion.x, motion.y])
    return np.asarray(ends)
