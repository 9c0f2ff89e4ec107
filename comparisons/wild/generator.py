"""The generator: a family and a number determine a problem: a body, and the conditions on its boundary.

Each family has one unusual trait, and sometimes a trait of another family; "everything" has half of all traits.
"""

import random
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np

from qvi_contact import InputError, Polynomial, Region, TriangleMesh
from qvi_contact.gallery import arc, fan
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, RigidPlate, Symmetry, Traction
from qvi_contact.types import BoolArray, Condition, Field, FloatArray, IntArray

T = TypeVar("T")
SIDES: Final = ("bottom", "right", "top", "left")
_DISTORTION: Final = 0.2  # largest move of interior vertices, over the size of a cell
_NEAR: Final = 1e-9  # distance from a line, over the body's size, that counts as on it


class Dice:
    """Choices that are the same on every machine and under every version of the libraries.

    They are made by `random.Random.random` alone, whose sequence Python guarantees for a seed.
    """

    def __init__(self, *seed: object) -> None:
        self._random = random.Random(" ".join(map(str, seed)))  # not for secrets

    def between(self, low: float, high: float) -> float:
        """A number, uniformly distributed."""
        return low + (high - low) * self._random.random()

    def magnitude(self, low: float, high: float) -> float:
        """10 to the power of a number between low and high."""
        return float(10.0 ** self.between(low, high))

    def whole(self, low: int, high: int) -> int:
        """A whole number from low to high, both included."""
        return low + int((high + 1 - low) * self._random.random())

    def chance(self, probability: float) -> bool:
        """True with this probability."""
        return self._random.random() < probability

    def pick(self, values: Sequence[T]) -> T:
        """One of the values."""
        return values[self.whole(0, len(values) - 1)]


@dataclass(frozen=True)
class Part:
    """A named part of the boundary that faces one of `SIDES` best; `straight` if it is parallel to an axis."""

    name: str
    side: str
    is_hole: bool
    straight: bool


def body(dice: Dice, length: float, traits: frozenset[str]) -> TriangleMesh:
    """A mesh of a few cells; raises `InputError` if a mesh cannot have the mask of the grid.

    "polygons", "arcs" and "bodies" are not grids; "thin" grids are 1e-3 to 1e3 times as high as wide; "masks" leaves
    cells out, "joints" adds joints, "files" writes the mesh to a file and reads it.
    """
    if "arcs" in traits or "bodies" in traits:
        mesh = _round(dice, length, "bodies" in traits)
    elif "polygons" in traits:
        mesh = (
            _star(dice, length) if dice.chance(0.5) else quadrilateral(dice, length * dice.magnitude(-0.2, 0.5), length)
        )
        if dice.chance(0.5):
            angle = dice.between(0.1, 6.2)
            turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            mesh = TriangleMesh(mesh.vertices @ turn.T, mesh.cells, mesh.edge_sets, mesh.regions)
    else:
        mesh = _grid(dice, length, traits)
    if "joints" in traits:
        mesh = _with_joints(dice, mesh, dice.whole(1, 4))
    return _through_a_file(mesh, dice.pick(("msh", "inp", "med"))) if "files" in traits else mesh


def _grid(dice: Dice, length: float, traits: frozenset[str]) -> TriangleMesh:
    """A grid of 1 to 5 cells each way, uniform, graded, or of random sizes."""
    least = 3 if traits & {"masks", "joints"} else 1
    columns, rows = dice.whole(least, 5), dice.whole(least, 5)
    thin = "thin" in traits
    aspect = dice.magnitude(-3.0, 3.0) if thin else dice.magnitude(-0.5, 0.5)
    width, height = length / max(1.0, aspect), length * min(1.0, aspect)
    start = dice.pick((0.0, 0.0, 0.0, -0.5, 1.0, 100.0))
    x, y = (_lines(dice, n, size, thin, start) for n, size in ((columns, width), (rows, height)))
    active = np.ones((rows, columns), dtype=bool)
    if "masks" in traits:
        _leave_out(dice, active)
    return TriangleMesh.grid(x, y, active)


def _lines(dice: Dice, number: int, length: float, wild: bool, start: float) -> FloatArray:
    kind = dice.pick(("uniform", "uniform", "graded", "any"))
    steps = np.ones(number)
    if kind == "graded":
        steps = (dice.magnitude(-0.7, 0.7) if wild else dice.between(0.6, 1.6)) ** np.arange(float(number))
    elif kind == "any":
        reach = 1.5 if wild else 0.4
        steps = np.array([dice.magnitude(-reach, reach) for _ in range(number)])
    return np.asarray(start * length + np.concatenate([[0.0], np.cumsum(steps)]) * length / steps.sum())


def quadrilateral(dice: Dice, width: float, height: float) -> TriangleMesh:
    """A rectangle, trapezoid, parallelogram, L, or a distorted mesh, with its base on y = 0."""
    cells = (dice.whole(2, 5), dice.whole(2, 4))
    mesh = TriangleMesh.rectangle(cells, width, height)
    kind = dice.pick(("rectangle", "trapezoid", "skew", "step", "any"))
    x, y = mesh.vertices.T
    if kind == "step":  # an L: without the cells right of one line and above another
        at, above = width * dice.whole(1, cells[0] - 1) / cells[0], height * (1 - 1 / cells[1])
        centre = mesh.corners.mean(axis=1)
        whole = mesh.part(np.flatnonzero((centre[:, 0] < at) | (centre[:, 1] < above)), {})
        low, high = mesh.vertices.min(axis=0) + _NEAR, mesh.vertices.max(axis=0) - _NEAR
        whole = whole.with_edges("bottom", lambda _, y: y < low[1])
        whole = whole.with_edges("left", lambda x, y: (x < low[0]) & (y > low[1]))
        whole = whole.with_edges("top", lambda _, y: y > high[1])
        whole = whole.with_edges("right", lambda x, _: x > high[0])
        return whole.with_edges("step", lambda x, y: (x > low[0]) & (y > low[1]) & (y < high[1]) & (x < high[0]))
    if kind == "trapezoid":
        x = x + dice.between(-0.3, 0.5) * (x / width - 0.5) * (y / height) * width
    elif kind == "skew":
        x = x + dice.between(-0.6, 0.6) * y
    elif kind == "any":  # interior vertices are moved at random
        inside = (x > 0.0) & (x < width) & (y > 0.0) & (y < height)
        moves = np.array(
            [[dice.between(-_DISTORTION, _DISTORTION), dice.between(-_DISTORTION, _DISTORTION)] for _ in x]
        )
        x = x + inside * moves[:, 0] * width / cells[0]
        y = y + inside * moves[:, 1] * height / cells[1]
    return TriangleMesh(np.column_stack([x, y]), mesh.cells, mesh.edge_sets)


def _star(dice: Dice, length: float) -> TriangleMesh:
    """A polygon with random corners around a point, convex or not, sometimes with a hole of the same shape."""
    corners = dice.whole(5, 10)
    angles = 2.0 * np.pi * (np.arange(corners) + [dice.between(-0.3, 0.3) for _ in range(corners)]) / corners
    radii = np.array([dice.between(0.5, 1.0) for _ in range(corners)])
    outline = length / 2.0 * radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    layers = dice.whole(2, 3)
    lines = [outline * share for share in np.linspace(0.4, 1.0, layers)]
    return fan(lines, closed=True, centre=None if dice.chance(0.3) else (0.0, 0.0))


def _round(dice: Dice, length: float, nested: bool) -> TriangleMesh:
    """A disc or a ring, whole or half; nested: with a joint all round between an inner and an outer part."""
    sectors, whole = dice.pick((12, 16, 20)), dice.chance(0.6)
    angles = (
        2.0 * np.pi * np.arange(sectors) / sectors if whole else np.pi * np.arange(sectors // 2 + 1) / (sectors // 2)
    )
    hollow = dice.chance(0.5)
    radii = np.array([0.3, 0.6, 1.0]) * length / 2.0
    lines = [arc(radius, angles) for radius in radii]
    names = ["outer", *(["joint"] if nested else []), *(["inner"] if hollow and whole else [])]
    return fan(
        lines, closed=whole, centre=None if hollow else (0.0, 0.0), joints={"joint": 1} if nested else None,
        arcs=names if dice.chance(0.8) else (),
    )  # fmt: skip


def _with_joints(dice: Dice, mesh: TriangleMesh, number: int) -> TriangleMesh:
    """Joints along lines of vertices inside the body, whole or in part, that may cross each other."""
    size = float(np.ptp(mesh.vertices, axis=0).max())
    for index in range(number):
        axis = dice.whole(0, 1)
        along, across = (np.unique(np.round(mesh.vertices[:, i], 14)) for i in (axis, 1 - axis))
        if len(across) < 3:
            continue
        at = float(dice.pick(across[1:-1].tolist()))
        start = float(dice.pick(along[:-1].tolist())) if dice.chance(0.25) else -np.inf

        def on_it(x: FloatArray, y: FloatArray, axis: int = axis, at: float = at, start: float = start) -> BoolArray:
            run, off = (x, y) if axis == 0 else (y, x)
            return np.asarray((np.abs(off - at) <= _NEAR * size) & (run > start))

        with suppress(InputError):  # no edge between two cells lies on the line
            mesh = mesh.with_joint(f"joint {index}", on_it)
    return mesh


def _through_a_file(mesh: TriangleMesh, ending: str) -> TriangleMesh:
    """The mesh written to a file of this format and read again: arcs become chords, only joints keep names."""
    import meshio

    points = np.column_stack([mesh.vertices, np.zeros(len(mesh.vertices))])
    blocks: list[tuple[str, IntArray]] = [("triangle", mesh.cells)]
    blocks += [("line", mesh.edge_sets[name]) for name in mesh.joint_names]
    tags = [np.full(len(cells), number) for number, (_, cells) in enumerate(blocks, start=1)]
    if ending == "med" and len(blocks) > 2:  # all lines in one section
        blocks = [blocks[0], ("line", np.concatenate([pairs for _, pairs in blocks[1:]]))]
        tags = [tags[0], np.concatenate(tags[1:])]
    names = ["body", *(name.replace(" ", "_") for name in mesh.joint_names)]
    more: dict[str, Any] = {}
    if ending == "msh":
        more["cell_data"] = {"gmsh:physical": tags, "gmsh:geometrical": tags}
        more["field_data"] = {name: np.array([n, 2 if n == 1 else 1]) for n, name in enumerate(names, start=1)}
    elif ending == "med":
        more["cell_data"] = {"cell_tags": [-tag for tag in tags]}
    found: Any = meshio.Mesh(points, list[Any](blocks), **more)
    if ending == "med":
        found.cell_tags = {-n: [name] for n, name in enumerate(names, start=1)}
    elif ending == "inp":
        found.cell_sets = {
            name: [np.arange(len(cells)) if k == n else np.zeros(0, dtype=int) for k, (_, cells) in enumerate(blocks)]
            for n, name in enumerate(names)
        }
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"mesh.{ending}"
        options: dict[str, Any] = {"file_format": "gmsh22", "binary": False} if ending == "msh" else {}
        found.write(path, **options)
        return TriangleMesh.load(path)


def with_parts(dice: Dice, mesh: TriangleMesh) -> tuple[TriangleMesh, list[Part]]:
    """The boundary divided into named parts: by the direction of the normal, by lines, or at a random place."""
    edges, holes = mesh.boundary, mesh.hole_edges
    middle = mesh.points_along(edges, np.array([0.5]))
    middles = np.column_stack([each[:, 0] for each in middle])
    turned = np.floor(np.arctan2(edges.normal[:, 1], edges.normal[:, 0]) / (np.pi / 2.0) + 2.5 - 1e-9).astype(int) % 4
    side = np.array([3, 0, 1, 2])[turned]  # numbers in SIDES
    axial = (np.abs(edges.normal).max(axis=1) > 1.0 - 1e-12) & ~edges.bent
    sets = {name: mesh.edge_sets[name] for name in mesh.joint_names}
    parts = []
    for number, hole in ((number, hole) for hole in (False, True) for number in range(4)):
        chosen = np.flatnonzero((side == number) & (holes == hole))
        if not len(chosen):
            continue
        run = 0 if SIDES[number] in ("bottom", "top") else 1
        name, groups = f"{SIDES[number]}{' of a hole' if hole else ''}", [chosen]
        at = np.unique(np.round(middles[chosen, 1 - run], 12))
        if axial[chosen].all() and len(at) > 1 and (holes.any() or dice.chance(0.5)):
            groups = [chosen[np.isclose(middles[chosen, 1 - run], each, rtol=1e-9, atol=1e-11)] for each in at]
        elif len(chosen) > 1 and dice.chance(0.15):
            cut = float(dice.pick(sorted(middles[chosen, run].tolist())[:-1]))
            groups = [chosen[middles[chosen, run] <= cut], chosen[middles[chosen, run] > cut]]
        for count, group in enumerate(each for each in groups if len(each)):
            own = name if len(groups) == 1 else f"{name} {count}"
            sets[own] = np.column_stack([edges.first[group], edges.second[group]])
            parts.append(Part(own, SIDES[number], hole, bool(axial[group].all())))
    return replace(mesh, edge_sets=sets), parts


def _leave_out(dice: Dice, active: BoolArray) -> None:  # noqa: C901 - a case each
    """Set cells of a grid inactive, in a random pattern."""
    rows, columns = active.shape
    twice = ("comb", "comb", "slit", "slit")
    kinds = (*twice, "checkerboard", "touching", "corner", "stairs", "waist", "window", "window", "any")
    match dice.pick(kinds):
        case "comb":  # teeth that hang down, or stand up
            active[: dice.whole(1, rows - 1), dice.whole(0, 1) :: 2] = False
            if dice.chance(0.5):
                active[:] = active[::-1].copy()
        case "slit":  # a row or column cut out from one end, not to the other
            if dice.chance(0.5):
                active[dice.whole(0, rows - 1), : dice.whole(1, columns - 1)] = False
            else:
                active[: dice.whole(1, rows - 1), dice.whole(0, columns - 1)] = False
        case "checkerboard":  # cells that meet in corners only, held together by a row and a column
            row, column = np.indices(active.shape)
            active[(row + column) % 2 == 1] = False
            active[-1] = active[:, 0] = True
        case "touching":  # two cells missing that meet in a corner
            across, up = dice.whole(0, rows - 2), dice.whole(0, columns - 2)
            active[across, up] = active[across + 1, up + 1] = False
        case "corner":  # an L
            active[dice.whole(1, rows - 1) :, dice.whole(1, columns - 1) :] = False
        case "stairs":  # every row shorter than the one below
            for above in range(rows):
                active[above, max(1, columns - above) :] = False
        case "waist":  # cut in from both sides
            across = dice.whole(1, max(1, rows - 2))
            active[across, : dice.whole(0, 1)] = active[across, 2 + dice.whole(0, 1) :] = False
        case "window":  # a hole
            active[1 : dice.whole(2, rows - 1), 1 : dice.whole(2, columns - 1)] = False
        case _:
            for place in np.ndindex(active.shape):
                active[place] = not dice.chance(0.15)


FAMILIES: Final = (
    "thin", "units", "friction", "poisson", "masks", "joints", "gaps", "laws", "plates", "fluids", "incompressible",
    "polygons", "arcs", "bodies", "files", "degrees", "idle", "everything",
)  # fmt: skip
"""Families of problems; `report.md` describes their traits."""

_LATE: Final = ("fluids", "incompressible")
"""Traits added later. They have their own dice, so that the problems of older families stay the same."""

_TRAITS: Final = tuple(name for name in FAMILIES if name not in ("everything", "idle", *_LATE))
_STRAY: Final = 0.04
"""Probability of each trait of another family."""

_RATIOS: Final = (0.5, 0.499999, 0.4999, 0.49, -0.9, -0.99, -0.9999, -0.999999)
"""Poisson's ratios near both limits; 0.5 only in plane stress, "incompressible" has it in plane strain."""


class Wild(NamedTuple):
    """A generated problem, and keyword arguments for `solve`."""

    problem: ContactProblem
    settings: Mapping[str, Any]


def wild_problem(family: str, number: int) -> Wild:
    """Problem `number` of a family; raises `InputError` where the package refuses it."""
    dice = Dice(family, number)
    if family == "everything":
        traits = frozenset(name for name in _TRAITS if dice.chance(0.5))
    else:
        traits = frozenset({family, *(name for name in _TRAITS if dice.chance(_STRAY))})
    settings, often = Dice("settings", family, number), "degrees" in traits
    degree = settings.pick((3, 5, 6, 7, 8)) if settings.chance(0.9 if often else 0.15) else 4
    law_on = {"law_on": "points"} if settings.chance(0.5 if often else 0.1) else {}
    late = Dice("late", family, number)  # only in "everything", each with probability ½
    traits |= {name for name in _LATE if late.chance(0.5 if family == "everything" else 0.0)}
    return Wild(_problem(dice, traits), {"degree": degree, **law_on})


def _material(dice: Dice, young: float, traits: frozenset[str], plane: Any) -> Material:
    poisson = dice.pick((0.0, 0.2, 0.3, 0.45))
    if "poisson" in traits:
        poisson = dice.pick([value for value in _RATIOS if value < 0.5 or plane == "stress"])
    return Material(young, 0.5 if "incompressible" in traits else poisson, plane)


def _problem(dice: Dice, traits: frozenset[str]) -> ContactProblem:
    wild = "units" in traits
    length = dice.magnitude(-9.0, 12.0) if wild else dice.pick((1.0, 1.0, 0.04, 30.0))
    young = dice.magnitude(-9.0, 12.0) if wild else dice.pick((1.0, 1e3, 2.1e5))
    strain = dice.magnitude(-7.0, -1.0) if wild else dice.pick((1e-4, 1e-3, 1e-2))
    plane = dice.pick(("stress", "strain"))
    plane = "strain" if "incompressible" in traits else plane
    mesh, parts = with_parts(dice, body(dice, length, traits))
    wet = Dice("wet", dice.whole(0, 10**6)) if "fluids" in traits else None
    maker = Maker(dice, mesh, strain * young, strain * length, traits, wet)
    conditions: list[Condition] = [condition for part in parts for condition in maker.conditions(part)]
    conditions += [maker.contact(name, joint=True) for name in mesh.joint_names]
    material = _material(dice, young, traits, plane)
    regions = []
    if dice.chance(0.2 if "bodies" in traits else 0.1):
        other = _material(dice, young * dice.magnitude(-2.0, 2.0), traits, plane)
        half = np.flatnonzero(mesh.corners.mean(axis=1)[:, 0] < float(np.median(mesh.vertices[:, 0])))
        if 0 < len(half) < len(mesh.cells):
            mesh = mesh.with_region("half", half)
            regions.append(Region(other, name="half"))
    weight = strain * young / length if dice.chance(0.1) and "idle" not in traits else 0.0
    potential = Polynomial([[0.0, weight]]) if weight else 0.0
    return ContactProblem(mesh, material, conditions, potential, regions)


# Conditions on the parts of a boundary: loads, supports, contacts of every law, plates.


_NORMAL: Final = {
    "bottom": ("y", "x", -1.0), "right": ("x", "y", 1.0), "top": ("y", "x", 1.0), "left": ("x", "y", -1.0),
}  # fmt: skip
"""Side → component across it, component along it, sign of the outward normal; on slanted ones local components."""

_SLANTED: Final = ("normal", "tangential", 1.0)

_FREE: Final = 0.1
"""Probability of a condition that is not usual on its side."""


@dataclass(frozen=True)
class Maker:
    """Makes conditions for one body, with its scales of stress and displacement; fluids have their own dice `wet`."""

    dice: Dice
    mesh: TriangleMesh
    stress: float
    displacement: float
    traits: frozenset[str]
    wet: Dice | None = None

    def conditions(self, part: Part) -> list[Condition]:
        """The conditions on a part: mostly a support or a pressure, sometimes any condition."""
        dice, idle = self.dice, "idle" in self.traits
        if idle:
            kinds: tuple[str, ...] = ("contact", "contact", "nothing", "support", "clamped", "symmetry")
        else:
            usual = {"bottom": ("contact",), "top": ("pressed", "pushed", "contact", "plate")}
            kinds = usual.get(part.side, ("nothing", "nothing", "symmetry", "loaded", "contact"))
        if dice.chance(_FREE):
            kinds = ("nothing", "loaded", "support", "clamped", "symmetry", "contact", "plate", "pressed", "pushed")
        across, along, sign = _NORMAL[part.side] if part.straight else _SLANTED
        match kind := "loaded" if part.is_hole else dice.pick(kinds):
            case "loaded":
                return [Traction(part.name, self._field(self._load()), self._field(self._load()))]
            case "clamped":
                return [Displacement(part.name, 0.0, 0.0)]
            case "symmetry":
                return [Symmetry(part.name)]
            case "contact" | "plate":
                driven = kind == "plate" or ("plates" in self.traits and dice.chance(0.4))
                return [self.contact(part.name, plate=self._driver(part) if driven else None)]
            case "pressed":  # and some shear
                pressure = -sign * abs(self._load() or self.stress * (not idle))
                shear = self._field(self._load()) if dice.chance(0.3) else 0.0
                given: dict[str, Any] = {along: shear, across: self._field(pressure)}
                return [Traction(part.name, **given)]
            case "pushed" | "support":  # a displacement, most often into the body, and free or held along the side
                move = self._field(-sign * abs(self._move())) if kind == "pushed" else 0.0
                if kind == "pushed" and dice.chance(0.4):
                    return [Displacement(part.name, **{across: move, along: self._field(self._move())})]
                free: dict[str, Any] = {along: 0.0}
                return [Displacement(part.name, **{across: move}), Traction(part.name, **free)]
        return [Traction(part.name, 0.0, 0.0)]

    def contact(self, edges: str, *, joint: bool = False, plate: RigidPlate | None = None) -> Contact:
        """A contact of any law."""
        dice, traits = self.dice, self.traits
        law = dice.pick(("unilateral", "bilateral", "tied")) if "laws" in traits and dice.chance(0.5) else ""
        gap = self._gap(joint)
        offset = self._field(self._move()) if dice.chance(0.15) else 0.0
        fluid: Field = 0.0  # a constant pressure, or a function of any shape
        if self.wet is not None and law != "tied" and not self.wet.chance(0.2):
            size = abs(self.stress) * self.wet.pick((0.01, 0.1, 0.5, 1.0, 3.0, 100.0))
            fluid = replace(self, dice=self.wet)._field(size, True, 0.6)
        if law == "tied":
            return Contact(edges, 0.0, gap, offset, law="tied", plate=plate, pore_pressure=fluid)
        cohesion: Field = 0.0
        cap: float | None = None
        if "laws" in traits or dice.chance(0.1):
            size = abs(self.stress) * dice.pick((0.0, 0.03, 0.3, 1.0, 100.0))
            cap = abs(self.stress) * dice.pick((0.0, 0.01, 0.2, 1.0, 10.0)) if dice.chance(0.3) else None
            cohesion = self._field(size, True)
        if "friction" in traits:
            friction = dice.pick((0.0, dice.magnitude(-3.0, 3.0), dice.magnitude(-1.0, 1.0), 1000.0))
        else:
            friction = dice.pick((0.0, 0.05, 0.2, 0.3, 0.6, 1.0))
        return Contact(
            edges, self._field(friction, True), gap, offset, "", cohesion, cap,
            "bilateral" if law == "bilateral" else "unilateral", plate, fluid,
        )  # fmt: skip

    def _driver(self, part: Part) -> RigidPlate:
        """A plate with a force that mostly presses, and a moment about a pivot that may be far away."""
        dice, edges = self.dice, self.mesh.edges(part.name)
        extent = float(np.ptp(self.mesh.vertices, axis=0).max())
        force = self.stress * float(edges.length.sum())
        pressed = -dice.between(0.2, 2.0) * force
        if part.straight:
            across, along, sign = _NORMAL[part.side]
            given = {f"force_{across}": sign * pressed}
        else:
            x, y = edges.length @ edges.normal / edges.length.sum()
            along, given = "x", {"force_x": float(x) * pressed, "force_y": float(y) * pressed}
        if "plates" in self.traits:
            if dice.chance(0.3):
                given[f"force_{along}"] = given.get(f"force_{along}", 0.0) + force * dice.between(-0.4, 0.4)
            if dice.chance(0.5):
                given["moment"] = force * extent * dice.pick((0.0, 0.01, -0.05, 0.3))
            if dice.chance(0.15):
                given = {"moment": force * extent * dice.between(-0.3, 0.3)}
        if "idle" in self.traits:
            given = dict.fromkeys(given, 0.0)
        far = dice.magnitude(0.0, 4.0) if "plates" in self.traits and dice.chance(0.3) else dice.between(0.0, 1.0)
        near = (float(self.mesh.vertices[:, 0].mean()), float(self.mesh.vertices[:, 1].mean()))
        pivot = (near[0] + far * extent * dice.pick((-1.0, 1.0)), near[1] + extent * dice.between(-1.0, 1.0))
        if "moment" in given and dice.chance(0.7):  # the moment of the force in the middle, and a tenth more
            arms = (near[0] - pivot[0]) * given.get("force_y", 0.0) - (near[1] - pivot[1]) * given.get("force_x", 0.0)
            given["moment"] = arms + 0.1 * given["moment"]
        return RigidPlate(pivot=pivot, **given)

    def _load(self) -> float:
        if "idle" in self.traits:
            return 0.0
        return self.stress * self.dice.pick((0.0, 0.1, -0.1, 0.5, -0.5, 1.0, -1.0))

    def _move(self) -> float:
        return 0.0 if "idle" in self.traits else self.displacement * self.dice.pick((0.0, 0.2, -0.2, 1.0, -1.0))

    def _gap(self, joint: bool) -> Field:
        dice = self.dice
        if "idle" in self.traits:
            return self._field(dice.pick((0.0, 0.0, self.displacement, 1e4 * self.displacement)), True)
        if "gaps" in self.traits and dice.chance(0.7):
            far = self.displacement * dice.magnitude(1.0, 9.0)
            return self._field(dice.pick((abs(self._move()), far, self._move(), -self.displacement)), False, 0.9)
        if joint or dice.chance(0.6):
            return 0.0
        return self._field(self._move())

    def _field(self, value: float, positive: bool = False, varied: float = 0.15) -> Field:
        """The value itself, or a function of about this size: linear, with a kink, waves, or a jump on a grid line."""
        dice = self.dice
        if not value or not dice.chance(varied):
            return value
        axis = dice.whole(0, 1)
        lines = np.unique(np.round(self.mesh.vertices[:, axis], 14))
        low, size = float(lines[0]), float(np.ptp(lines))
        kind = dice.pick(("linear", "kink", "waves", "jump"))
        if kind == "linear":
            slope = value / size * (1.0 if positive else dice.pick((-1.0, 0.5)))
            start = (value if slope < 0.0 or not positive else 0.0) - slope * low
            return Polynomial([[start, 0.0], [slope, 0.0]] if axis == 0 else [[start, slope]])
        at = float(dice.pick(lines.tolist()))
        shapes: dict[str, Callable[[Any], Any]] = {
            "kink": lambda s: value * np.abs(s - at) / size,
            "waves": lambda s: value * np.sin(3.0 * (s - at) / size) ** 2,
            "jump": lambda s: np.where(s < at, value, 0.3 * value),
        }
        return lambda x, y: shapes[kind]((x, y)[axis])
