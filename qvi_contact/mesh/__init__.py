"""Meshes and their edges."""

from qvi_contact.mesh.grid import graded_lines
from qvi_contact.mesh.triangles import TriangleMesh
from solvers.basics.front import front

__all__ = ["TriangleMesh", "graded_lines"]

__getattr__ = front(
    __name__,
    {
        "curves": ("Curve",),
        "edges": ("Topology", "arc_offsets", "cross", "frames_along", "outward_normals"),
        "grid": ("SIDES",),
        "outline": ("divided_corners", "polygons"),
        "selection": ("edges_on_segment",),
    },
)
