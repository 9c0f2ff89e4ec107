"""Meshes and their edges."""

from qvi_contact.mesh.lines import graded_lines
from qvi_contact.mesh.rectilinear import RectilinearMesh
from qvi_contact.mesh.triangles import TriangleMesh

__all__ = ["RectilinearMesh", "TriangleMesh", "graded_lines"]
