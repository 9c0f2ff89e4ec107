"""From the document of a problem file to its mesh of triangles."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from qvi_contact.basics.checks import IntArray
from qvi_contact.errors import InputError
from qvi_contact.files.located import located
from qvi_contact.files.outline_builder import outlined
from qvi_contact.files.problem_document import (
    ArcTable,
    Document,
    EdgesTable,
    JointTable,
    MeshTable,
    RegionTable,
    quoted,
)
from qvi_contact.mesh.bends import AnyArc
from qvi_contact.mesh.circles import Arc
from qvi_contact.mesh.curve_fit import ellipse, fitted
from qvi_contact.mesh.curves import Curve, checked_bends
from qvi_contact.mesh.selection import edges_in_box, edges_on_segment, triangles_in_box
from qvi_contact.mesh.triangle_checks import checked_pairs
from qvi_contact.mesh.triangles import TriangleMesh


def triangle_mesh(document: Document, folder: Path | None) -> TriangleMesh:
    """The triangles of a mesh file or of the problem file itself, with its named edges, joints and regions."""
    mesh = _bare(document.mesh, folder)
    sets, regions = dict(mesh.edge_sets), dict(mesh.regions)
    parts: list[tuple[str, EdgesTable | JointTable]] = [
        *((f"edges[{index}]", table) for index, table in enumerate(document.edges)),
        *((f"joints[{index}]", table) for index, table in enumerate(document.joints)),
    ]
    for path, part in parts:
        with located(path, part):
            if part.name in sets:
                raise InputError("name", part.name, "this edge set exists already: choose another name")
            sets[part.name] = _edges(mesh, part)
    for index, region in enumerate(document.regions):
        if region.x is not None or region.y is not None:
            with located(f"regions[{index}]", region):
                name = region_name(region, index)
                if name in regions:
                    raise InputError("name", name, "this region exists already: choose another name, or no ranges")
                regions[name] = triangles_in_box(mesh.vertices, mesh.cells, region.x, region.y)
    mesh = replace(mesh, edge_sets=sets, regions=regions)
    for index, table in enumerate(document.mesh.arcs):
        with located(f"mesh.arcs[{index}]", table):
            mesh = replace(mesh, arcs=(*mesh.arcs, _arc(mesh, table)))
    return mesh


def _arc(mesh: TriangleMesh, table: ArcTable) -> AnyArc:
    """The edges of the table on their circle, ellipse or other curve."""
    if table.bends is not None:
        edges = np.array(table.edges, dtype=np.int64).reshape(-1, 2)
        return Curve(edges, checked_bends("bends", table.bends, len(edges))).checked("", mesh.vertices, mesh.topology)
    if table.name is not None:
        pairs = mesh.pairs(table.name)
    else:
        pairs = checked_pairs("edges", table.edges or [], mesh.topology, mesh.vertices)
    assert table.centre is not None
    centre = (table.centre[0], table.centre[1])
    if table.axes is not None:
        curve = ellipse(centre, (table.axes[0], table.axes[1]), table.angle or 0.0)
        return fitted("axes", curve, 0.0, 2.0 * np.pi, pairs, mesh.vertices)
    return Arc(centre, table.radius or 0.0, pairs).checked("", mesh.vertices, mesh.topology)


def region_name(table: RegionTable, index: int) -> str:
    """What a region is called in the mesh."""
    if table.name is None and table.x is table.y is None:
        raise InputError("name", None, "say which triangles are meant: name a region of the mesh, or give x and y")
    return table.name or f"region {index + 1}"


def _bare(table: MeshTable, folder: Path | None) -> TriangleMesh:
    """The mesh with the names it brings along."""
    if table.outline is not None:
        return outlined(table.outline)
    return _inline(table) if table.file is None else _loaded(table.file, folder)


def _loaded(name: str, folder: Path | None) -> TriangleMesh:
    with located("mesh.file"):
        if folder is None:
            remedy = "the mesh file of a text without a place is not known: read the problem file by load_problem"
            raise InputError("file", name, remedy)
        return TriangleMesh.load(folder / name)


def _inline(table: MeshTable) -> TriangleMesh:
    vertices, cells = (np.array(values) for values in (table.vertices, table.triangles))
    edges = {name: np.array(pairs).reshape(-1, 2) for name, pairs in table.edges.items()}
    regions = {name: np.array(chosen, dtype=np.int64) for name, chosen in table.regions.items()}
    try:
        return TriangleMesh(vertices, cells, edges, regions)
    except InputError as error:
        raise type(error)(_place(table, error), error.value, error.remedy) from error


def _place(table: MeshTable, error: InputError) -> str:
    """Where in [mesh] the fault is that `TriangleMesh` has found."""
    for key, names in (("edges", table.edges), ("regions", table.regions)):
        for name in names:
            if name in (error.field, error.value if isinstance(error.value, str) else None):
                return f"mesh.{key}.{quoted(name)}"
    return {"vertices": "mesh.vertices", "cells": "mesh.triangles"}.get(error.field.split(".")[-1], "mesh")


def _edges(mesh: TriangleMesh, table: EdgesTable | JointTable) -> IntArray:
    """Edges (k, 2) by their vertices."""
    if table.segment is not None:
        return edges_on_segment(mesh.vertices, mesh.topology, *table.segment, inside=isinstance(table, JointTable))
    if isinstance(table, EdgesTable) and table.box is not None:
        return edges_in_box(mesh.vertices, mesh.topology, table.box.x, table.box.y)
    remedy = "sides and directions are for grids: on triangles give a segment between two points"
    raise InputError("segment", None, remedy + (", or a box" if isinstance(table, EdgesTable) else ""))
