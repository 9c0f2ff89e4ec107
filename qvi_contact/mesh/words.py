"""A mesh in one line."""

from qvi_contact.mesh.mesh import Mesh

_NAMES = 8  # at most so many are listed


def mesh_line(mesh: Mesh, cells: str) -> str:
    """The mesh in one line, with its cells as a text such as "3 × 2 cells": size of the body, names of its parts."""
    width, height = (mesh.vertices[mesh.body_vertices].max(axis=0) - mesh.origin).tolist()
    parts = [("edges", mesh.edge_names), ("joints", mesh.joint_names), ("regions", mesh.region_names)]
    listed = "; ".join(f"{kind} {_some(names)}" for kind, names in parts if names)
    return f"<{type(mesh).__name__}: {cells}, body of {width:.6g} × {height:.6g}{'; ' if listed else ''}{listed}>"


def _some(names: tuple[str, ...]) -> str:
    """The first few names, and how many more."""
    more = len(names) - _NAMES
    return ", ".join(names[:_NAMES]) + (f" and {more} more" if more > 0 else "")
