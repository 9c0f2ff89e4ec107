"""Walls with many contact points: n × n blocks of 4 × 4 cells, dry joints between the courses, pushed from the side."""

from typing import Final

from qvi_contact import Contact, ContactProblem, Material, RectilinearMesh, Traction

_CELLS: Final = 4  # a side of a block
_WEIGHT: Final = 24.0  # kN/m³
_FRICTION: Final = 0.6


def wall_of(blocks: int, load: float) -> ContactProblem:
    """A wall of blocks × blocks metres on the ground, under its weight and a load from the left, over that weight.

    Units are m and kPa. Pushed by 0.02 of its weight nothing slides but under single edges, by 0.3 beds open and slip;
    with the friction 0.6 every bed slides as a whole at 0.6.
    """
    cells, size = _CELLS * blocks, float(blocks)
    mesh = RectilinearMesh.rectangle((cells, cells), size, size)
    beds = [f"bed {course}" for course in range(1, blocks)]
    for course, name in enumerate(beds, start=1):
        mesh = mesh.with_joint(name, "horizontal", at=float(course))
    free = [Traction(edges, x=0.0, y=0.0) for edges in ("right", "top")]
    contacts = [Contact(name, friction=_FRICTION) for name in ("bottom", *beds)]
    push = Traction("left", x=load * _WEIGHT * size, y=0.0)
    weight = {"body_potential": lambda x, y: _WEIGHT * y + 0.0 * x}
    return ContactProblem(mesh, Material(5e6, 0.2), [push, *free, *contacts], **weight)  # type: ignore[arg-type]
