"""Makes the mesh files of the examples; needs gmsh and meshio (the extra ``mesh``).

    python examples/meshes/make.py          # all of them
    python examples/meshes/make.py wedge    # one

Each function below is the outline of one body. The triangles are small where stresses change most: at corners of
contacts, in fillets, and where a contact ends.
"""

import math
import sys
from pathlib import Path

import meshio
import numpy as np
from scipy.spatial import Delaunay

from qvi_contact import Corner, TriangleMesh, gallery
from qvi_contact.mesh.curves import MeshParts
from qvi_contact.mesh.cutting import stacked

FOLDER = Path(__file__).parent


def gravity_dam() -> TriangleMesh:
    """A dam of 30 m with a sloped downstream face on a piece of rock, water to 28 m; the base is a joint [m]."""
    base, crest, height, level = 24.0, 5.0, 30.0, 28.0
    corners = [
        Corner((-30.0, -25.0), "underground"),
        Corner((54.0, -25.0), "rock right"),
        Corner((54.0, 0.0), "rock downstream"),
        Corner((base, 0.0), "downstream", size=0.3),
        Corner((crest, height), "crest"),
        Corner((0.0, height), "freeboard"),
        Corner((0.0, level), "upstream"),
        Corner((0.0, 0.0), "reservoir floor", size=0.3),
        Corner((-30.0, 0.0), "rock left"),
    ]
    return TriangleMesh.outline(
        corners, 8.0, joints={"base": [(0.0, 0.0), (base, 0.0)]}, sizes={(base / 2.0, 0.0): 1.0}
    )


def strip_footing() -> TriangleMesh:
    """Half of a strip of pressure 1 wide on ground 2 deep, with a fan around its end [m]; made without gmsh."""
    rays, radii = np.linspace(0.0, math.pi, 17), np.array([0.125, 0.25, 0.5, 1.0]) / math.sqrt(2.0)
    x, y = (np.multiply.outer(radii, part(rays)).ravel() for part in (np.cos, np.sin))
    fan = np.column_stack([1.0 + x, np.where(y > 1e-9, -y, 0.0)])
    far = np.stack(np.meshgrid(np.arange(9) / 2.0, -np.arange(5) / 2.0), axis=-1).reshape(-1, 2)
    far = far[np.hypot(*(far - [1.0, 0.0]).T) > 0.9]
    points = np.concatenate([[[1.0, 0.0]], fan, far])
    cells = Delaunay(points).simplices
    mesh = TriangleMesh(points, cells[np.abs(np.linalg.det(np.diff(points[cells], axis=1))) > 1e-9])
    mesh = mesh.with_edges("far", lambda x, y: (x > 3.999) | (y < -1.999)).with_edges("axis", lambda x, _: x < 1e-9)
    mesh = mesh.with_edges("footing", lambda x, y: (y > -1e-9) & (x < 1.0))
    return mesh.with_edges("surface", lambda x, y: (y > -1e-9) & (x > 1.0))


def dam_on_seam() -> TriangleMesh:
    """A dam of 30 m on a slab of rock of 5 m, which lies on a seam: a joint from the water in front to a cut [m]."""
    seam, length = -5.0, 40.0
    corners = [
        Corner((0.0, -15.0), "underground"),
        Corner((length, -15.0), "rock right"),
        Corner((length, seam), "cut"),
        Corner((length, 0.0), "ground"),
        Corner((24.0, 0.0), "downstream", size=2.0),
        Corner((5.0, 30.0), "crest"),
        Corner((0.0, 30.0), "freeboard"),
        Corner((0.0, 28.0), "upstream"),
        Corner((0.0, seam), "rock left"),
    ]
    return TriangleMesh.outline(corners, 6.0, joints={"seam": [(0.0, seam), (length, seam)]}, sizes={(20.0, seam): 3.0})


def wedge() -> TriangleMesh:
    """A block of 4 m with a flat top on a slope of 1 : 10 [m]."""
    corners = [Corner((0.0, 0.0), "slope"), Corner((4.0, 0.4), "right", size=0.05), Corner((4.0, 2.0), "top")]
    return TriangleMesh.outline([*corners, Corner((0.0, 2.0), "left")], 0.5)


def brake_pad() -> TriangleMesh:
    """A lining of 80 × 12 with chamfered ends on a steel plate of 5 [mm]."""
    corners = [
        Corner((8.0, 0.0), "face", size=1.0),
        Corner((72.0, 0.0), "free", size=1.0),
        Corner((80.0, 4.0), "free"),
        Corner((80.0, 12.0), "abutment"),
        Corner((80.0, 17.0), "free"),
        Corner((60.0, 17.0), "piston"),
        Corner((20.0, 17.0), "free"),
        Corner((0.0, 17.0), "free"),
        Corner((0.0, 12.0), "free"),
        Corner((0.0, 4.0), "free"),
    ]
    return TriangleMesh.outline(corners, 4.0, regions={"plate": [(0.0, 12.0), (80.0, 12.0), (80.0, 17.0), (0.0, 17.0)]})


def bolted_angle() -> TriangleMesh:
    """An angle 100 × 100 × 10 with a fillet of 10, held to a wall by a bolt, loaded on its other leg [mm]."""
    corners = [
        Corner((0.0, 0.0), "free", size=2.0),
        Corner((100.0, 0.0), "free"),
        Corner((100.0, 10.0), "load"),
        Corner((60.0, 10.0), "free"),
        Corner((20.0, 10.0), "fillet", centre=(20.0, 20.0), clockwise=True, size=1.2),
        Corner((10.0, 20.0), "free", size=1.2),
        Corner((10.0, 50.0), "bolt", size=3.0),
        Corner((10.0, 70.0), "free", size=3.0),
        Corner((10.0, 100.0), "free"),
        Corner((0.0, 100.0), "wall", size=4.0),
    ]
    return TriangleMesh.outline(corners, 6.0, sizes={(0.0, 70.0): 2.0})


def cylinder_on_block() -> TriangleMesh:
    """The right half of a half cylinder (radius 50) on a block of 200 × 200 [mm].

    Up to 1.5 beside the axis the two are one mesh, with the joint "contact" between them: the gap that the cylinder
    leaves there is given to the contact.
    """
    radius, joined = 50.0, 1.5
    centre = (0.0, math.sqrt(radius**2 - joined**2))
    axis, end = (0.0, 0.0), Corner((joined, 0.0), "cylinder", centre, size=0.3)
    further = [
        ((x, centre[1] - math.sqrt(radius**2 - x**2)), size) for x, size in ((3.0, 0.6), (10.0, 2.0), (25.0, 5.0))
    ]
    pieces = [Corner(at, "cylinder", centre, size=size) for at, size in further]
    round_part = [*pieces, Corner((radius, centre[1]), "load", size=16.0), Corner(centre, "axis")]
    block = [Corner((0.0, -200.0), "bottom"), Corner((100.0, -200.0), "side"), Corner((100.0, 0.0), "top")]
    return TriangleMesh.outline(
        [*block, end, *round_part, Corner(axis, "axis", size=0.07)],
        25.0,
        joints={"contact": [axis, (joined, 0.0)]},
        regions={"steel": [Corner(axis), end, *round_part]},
        sizes={(0.62, 0.0): 0.04},
    )


def half_discs() -> TriangleMesh:
    """Two half discs (radius 8), one on the other; one mesh with the joint "contact" up to 1.2 beside the axis [mm]."""
    radius, joined = 8.0, 1.2
    high = math.sqrt(radius**2 - joined**2)
    below, above, between = (0.0, -high), (0.0, high), math.sqrt(radius**2 - 3.0**2)
    corners = [
        Corner((-radius, -high), "bottom", size=1.6),
        Corner((radius, -high), "lower disc", below, size=1.6),
        Corner((3.0, between - high), "lower disc", below, size=0.6),
        Corner((joined, 0.0), "upper disc", above, size=0.3),
        Corner((3.0, high - between), "upper disc", above, size=0.6),
        Corner((radius, high), "top", size=1.6),
        Corner((-radius, high), "upper disc", above, size=1.6),
        Corner((-3.0, high - between), "upper disc", above, size=0.6),
        Corner((-joined, 0.0), "lower disc", below, size=0.3),
        Corner((-3.0, between - high), "lower disc", below, size=0.6),
    ]
    fine = {(x, 0.0): 0.06 for x in (-0.68, -0.5, 0.0, 0.5, 0.68)}
    return TriangleMesh.outline(corners, 2.5, joints={"contact": [(-joined, 0.0), (joined, 0.0)]}, sizes=fine)


def trapezoid() -> TriangleMesh:
    """A trapezoid 2 m wide, 1 m high, 1 m wide at its top [m]."""
    names = {"base": (0.0, 0.0), "right": (2.0, 0.0), "top": (1.5, 1.0), "left": (0.5, 1.0)}
    return TriangleMesh.outline([Corner(at, name) for name, at in names.items()], 0.5)


def lug() -> TriangleMesh:
    """A lug 40 wide with a round end about the origin and a bore of radius 10 in it, held 60 away [mm]."""
    half, length = 20.0, 60.0
    corners = [
        Corner((-length, -half), "free"),
        Corner((0.0, -half), "end", (0.0, 0.0), size=3.0),
        Corner((half, 0.0), "end", (0.0, 0.0), size=3.0),
        Corner((0.0, half), "free", size=3.0),
        Corner((-length, half), "held"),
    ]
    return TriangleMesh.outline(corners, 6.0, holes=[Corner.circle((0.0, 0.0), 10.0, name="bore", size=1.3)])


def shrink_fit() -> TriangleMesh:
    """A quarter of a shaft of radius 25 in a hub of radius 50 [mm]."""
    corners = [Corner((0.0, 0.0), "bottom"), Corner((50.0, 0.0), "outside", (0.0, 0.0)), Corner((0.0, 50.0), "left")]
    fit = [Corner((25.0, 0.0), centre=(0.0, 0.0)), (0.0, 25.0)]
    return TriangleMesh.outline(corners, 12.0, joints={"fit": fit}, regions={"shaft": [(0.0, 0.0), *fit]})


def masonry_wall() -> TriangleMesh:
    """Eight courses of six blocks with a door and a window [m]; made without gmsh."""
    return gallery.masonry_wall().mesh


def jointed_slope() -> TriangleMesh:
    """A slope of 12 m with bedding planes and cross joints [m]; made without gmsh."""
    return gallery.jointed_slope().mesh


def meshed_apart() -> list[TriangleMesh]:
    """A base of 50 by 30 and a block of 50 by 20 on it [mm], two bodies without common nodes; made without gmsh."""
    base = TriangleMesh.rectangle((5, 3), 50.0, 30.0).refined([3, 8, 17])
    block = TriangleMesh.rectangle((7, 3), 50.0, 20.0, origin=(0.0, 30.0), grading=(0.9, 1.0))
    names = {"left": "axis", "right": "free"}
    parts = []
    for mesh, own in ((base, {"bottom": "foot"}), (block, {"top": "roof"})):
        edges = {name: mesh.pairs(side) for side, name in (names | own).items()}
        parts.append(TriangleMesh(mesh.vertices, mesh.cells, edges))
    return parts


MAKERS = (
    gravity_dam, wedge, brake_pad, bolted_angle, cylinder_on_block, half_discs, trapezoid, lug, shrink_fit,
    masonry_wall, jointed_slope, strip_footing, dam_on_seam, meshed_apart,
)  # fmt: skip
BODIES = {made.__name__: made for made in MAKERS}


def save(made: TriangleMesh | list[TriangleMesh], path: Path) -> None:
    """Write vertices, triangles, named edges and regions as a .msh file of format 2.2. What no region has is "body"."""
    bodies = made if isinstance(made, list) else [made]
    mesh = stacked([MeshParts(body.vertices, body.cells, body.edge_sets, body.regions) for body in bodies])
    edges = [(name, 1, "line", pairs) for name, pairs in mesh.edge_sets.items()]
    others = np.setdiff1d(np.arange(len(mesh.cells)), [cell for numbers in mesh.regions.values() for cell in numbers])
    named = {name: numbers for name, numbers in {**mesh.regions, "body": others}.items() if len(numbers)}
    regions = [(name, 2, "triangle", mesh.cells[numbers]) for name, numbers in named.items()]
    blocks = edges + regions
    tags = [np.full(len(block[3]), tag) for tag, block in enumerate(blocks, start=1)]
    written = meshio.Mesh(
        np.column_stack([mesh.vertices, np.zeros(len(mesh.vertices))]),
        [(kind, cells) for _, _, kind, cells in blocks],
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={name: np.array([tag, dimension]) for tag, (name, dimension, *_) in enumerate(blocks, start=1)},
    )
    meshio.write(path, written, file_format="gmsh22", binary=False)


if __name__ == "__main__":
    for name in sys.argv[1:] or BODIES:
        mesh = BODIES[name]()
        save(mesh, FOLDER / f"{name}.msh")
        print(f"{name}.msh: {mesh!r}, {(FOLDER / f'{name}.msh').stat().st_size / 1000:.0f} kB")
