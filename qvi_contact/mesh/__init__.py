"""Meshes and their edges."""

from qvi_contact.mesh.grid import graded_lines
from qvi_contact.mesh.triangles import TriangleMesh
from solvers.basics.front import front

__all__ = ["TriangleMesh", "graded_lines"]

__getattr__ = front(__name__)
