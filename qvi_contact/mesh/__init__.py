"""Meshes and their edges."""

from qvi_contact.mesh.lines import graded_lines
from qvi_contact.mesh.rectilinear import RectilinearMesh

__all__ = ["RectilinearMesh", "graded_lines"]
