"""Bodies of several chapters: the compressed plate under any law; and such as slip in one sense."""

from dataclasses import replace

import numpy as np

from qvi_contact import Contact, ContactProblem, Displacement, Material, Region, Traction
from qvi_contact.gallery import compressed_plate
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import Condition


def plate_under(contact: Contact, cells: int, grading: float = 1.0) -> ContactProblem:
    """The compressed plate with this contact on its top."""
    plate = compressed_plate(1.0, (cells, cells), grading=grading)
    rest = [condition for condition in plate.conditions if not isinstance(condition, Contact)]
    return replace(plate, conditions=[*rest, contact])


def half_disc(friction: float = 0.3, push: tuple[float, float] = (2e-3, -2e-3), *, held: bool = True) -> ContactProblem:
    """A half disc of radius 1 as a polygon, its flat side on a rough plane in full contact, its crown displaced."""
    angle = np.linspace(0.0, np.pi, 13)
    rim = np.column_stack([np.cos(angle), np.sin(angle)])
    vertices = np.vstack([[0.0, 0.0], rim])
    cells = np.column_stack([np.zeros(12, dtype=int), np.arange(1, 13), np.arange(2, 14)])
    mesh = TriangleMesh(vertices, cells)
    mesh = mesh.with_edges("base", lambda _, y: y < 1e-9).with_edges("crown", lambda _, y: y > 0.9)
    mesh = mesh.with_edges("flank", lambda _, y: (y >= 1e-9) & (y <= 0.9))
    crown: Condition = Displacement("crown", x=push[0], y=push[1]) if held else Traction("crown", x=1.0, y=-10.0)
    conditions: list[Condition] = [Contact("base", friction, name="base"), crown, Traction("flank", x=0.0, y=0.0)]
    return ContactProblem(mesh, Material(1000.0, 0.3, "strain"), conditions)


def half_discs(
    friction: float = 0.3, push: tuple[float, float] = (6e-3, -2e-3), below: float = 1000.0
) -> ContactProblem:
    """Two such half discs on each other, that below held at its foot, of a Young's modulus of its own."""
    above = half_disc().mesh
    shared = above.vertices[:, 1] < 1e-9
    other = np.where(shared, np.arange(len(shared)), len(shared) - 1 + np.cumsum(~shared))
    vertices = np.vstack([above.vertices, (above.vertices * [1.0, -1.0])[~shared]])
    mesh = TriangleMesh(vertices, np.vstack([above.cells, other[above.cells]]))
    mesh = mesh.with_joint("seam", lambda _, y: np.abs(y) < 1e-9).with_region("lower", lambda _, y: y < 0.0)
    mesh = mesh.with_edges("crown", lambda _, y: y > 0.9).with_edges("foot", lambda _, y: y < -0.9)
    conditions: list[Condition] = [
        Contact("seam", friction),
        Displacement("crown", x=push[0], y=push[1]),
        Displacement("foot", x=0.0, y=0.0),
        Traction("flank", x=0.0, y=0.0),
    ]
    mesh = mesh.with_edges("flank", lambda _, y: np.abs(y) <= 0.9)
    stiff, soft = Material(1000.0, 0.3, "strain"), Material(below, 0.3, "strain")
    return ContactProblem(mesh, stiff, conditions, regions=[Region(soft, name="lower")])


def sheared_layer(friction: float = 0.2, drag: float = 5e-3) -> ContactProblem:
    """A layer 4 × 1 pressed on rough ground by its top, which moves to the side; its ends are free."""
    mesh = TriangleMesh.rectangle((4, 1), 4.0, 1.0)
    conditions: list[Condition] = [
        Contact("bottom", friction, name="base"),
        Displacement("top", x=drag, y=-2e-3),
        Traction("left", x=0.0, y=0.0),
        Traction("right", x=0.0, y=0.0),
    ]
    return ContactProblem(mesh, Material(1000.0, 0.2), conditions)
