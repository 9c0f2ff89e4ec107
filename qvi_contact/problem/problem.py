"""The contact problem as the user states it: mesh, material, boundary conditions, body force; and its digest."""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, is_dataclass
from functools import cached_property, partial
from typing import Any, Final, NoReturn

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray, IntArray, check_field, instance_of
from qvi_contact.basics.schema import WithFields
from qvi_contact.element.triangle import triangle_lattice
from qvi_contact.errors import InputError, UnknownNameError, place_of
from qvi_contact.mesh.edges import Edges
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import (
    CARTESIAN,
    LOCAL,
    Condition,
    Contact,
    Displacement,
    Symmetry,
    Traction,
    components,
)
from qvi_contact.problem.fields import BodyForces, Expression, PointData, Polynomial, along_edges
from qvi_contact.problem.material import Material, Region, is_strained
from solvers.basics.types import PicklesFields

_OVERLAP: Final = "drop one, or name parts of the side by with_edges() or [[edges]]"
_LISTS: Final = (
    ("conditions", (Traction, Displacement, Symmetry, Contact), "Traction, Displacement, Symmetry or Contact"),
    ("regions", Region, "Region"),
)  # fields of a problem that are lists, the classes of their entries, and these classes in messages
_NAMES: Final = (*CARTESIAN, *LOCAL)  # of components
_NORMAL_ROUNDING: Final = 1e-12  # |d·n| of unit vectors d and n: a smaller value is rounding, d is tangential
_RATIO: Final = 1e16  # of Young's moduli: beyond it a sum of compliances loses the smaller one to rounding


@dataclass(frozen=True, eq=False)
class Prescribed:
    """One component of a traction or displacement, prescribed on edges of the boundary."""

    condition: Traction | Displacement | Symmetry
    """The condition that prescribes the component."""
    name: str
    """Name of the component in messages, such as "Traction.x"."""
    edges: Edges
    """The edges, n of them."""
    direction: FloatArray
    """Unit vector of the component on each edge, shape (n, 2)."""
    turns: bool
    """Whether the direction turns along arcs: true of normal and tangential components."""
    value: Field
    """The prescribed traction [stress] or displacement [length]."""


@dataclass(frozen=True, eq=False, repr=False)
class ContactProblem(WithFields, PicklesFields):
    """A body, its materials and its boundary conditions.

    `InputError` if a condition names an unknown edge set, two conditions overlap, a component of an edge has no
    condition, two contacts share a name, or a body that is incompressible everywhere has no prescribed normal traction,
    which would determine its pressure.
    """

    mesh: TriangleMesh
    """The body and its cells."""
    material: Material
    """The material of the body outside the regions."""
    conditions: Sequence[Condition]
    """One condition for every component of every boundary edge."""
    body_potential: Field = 0.0
    """Potential φ of the body force b = −∇φ [stress]; φ = ρ g y under gravity. `BodyForces` hold several by name."""
    regions: Sequence[Region] = ()
    """Parts of the body with another material; where two overlap, the later one counts."""
    temperature: Field = 0.0
    """Rise ΔT of temperature since the body was free of stress [temperature]. It strains materials that have an
    `expansion`; regions may have another one. See `problem.material`. Limit loads do not depend on it."""

    def __post_init__(self) -> None:
        instance_of(TriangleMesh, "ContactProblem.mesh", self.mesh)
        instance_of(Material, "ContactProblem.material", self.material)
        for name in ("body_potential", "temperature"):
            object.__setattr__(self, name, check_field(f"ContactProblem.{name}", getattr(self, name)))
        _check_parts(self)
        _ = self.owners, self.cell_materials  # refuse edges without conditions, and regions that cut triangles
        _check_pressure(self)
        least, most = min(moduli := [material.young for material in self.materials]), max(moduli)
        if most > _RATIO * least:
            remedy = f"is over {_RATIO:g} times that of another part, {least:g}: hold the stiff part by displacements"
            raise InputError("Material.young", most, remedy)

    def __repr__(self) -> str:
        named: dict[str, list[str]] = {}
        for condition in self.conditions:
            name = condition.name if isinstance(condition, Contact) else condition.edges
            listed = named.setdefault(type(condition).__name__.lower(), [])
            listed.extend([name] if name not in listed else [])
        conditions = "; ".join(f"{kind} {', '.join(names)}" for kind, names in named.items())
        return f"<ContactProblem: {conditions}; {self.mesh!r}>"

    _repr_png_ = TriangleMesh._repr_png_  # picture of mesh, materials and conditions for notebooks

    @cached_property
    def cell_materials(self) -> IntArray:
        """Index into `materials` for each cell, (cells,): 0 outside regions, else 1 + the number of its last region."""
        material_of_cell = np.zeros(self.mesh.cell_count, dtype=np.int64)
        for number, region in enumerate(self.regions):
            material_of_cell[region.cells(self.mesh, self.regions[:number])] = 1 + number
        return material_of_cell

    def __getstate__(self) -> dict[str, Any]:
        strengths = [material.strength for material in self.materials if material.strength is not None]
        data = [(f"BodyForces.{name}", function) for name, function in self.body_forces.items() if name != "body"]
        for part in (*strengths, *self.materials, *self.regions, *self.conditions, self):
            data += [(f"{type(part).__name__}.{each.name}", getattr(part, each.name)) for each in fields(part)]
        for name, value in data:
            for function in value if isinstance(value, tuple) else (value,):
                try:
                    pickle.dumps(function if callable(function) else None)
                except Exception as error:
                    remedy = "this function cannot be pickled: take an Expression, a Polynomial, or one of a module"
                    raise InputError(name, function, remedy) from error
        return super().__getstate__()

    def __deepcopy__(self, memo: object = None) -> ContactProblem:
        """The problem itself: nothing in it can be changed."""
        return self

    __copy__ = __deepcopy__

    @property
    def body_forces(self) -> Mapping[str, Field]:
        """The potentials of body forces by name; a single potential without a name is called "body"."""
        field = self.body_potential
        return field.parts if isinstance(field, BodyForces) else {"body": field}

    @property
    def yields(self) -> bool:
        """Whether a part of the body can yield: its material has a strength."""
        return any(self.materials[number].strength is not None for number in np.unique(self.cell_materials))

    @property
    def materials(self) -> tuple[Material, ...]:
        """The body's own material and those of the regions."""
        return (self.material, *(region.material for region in self.regions))

    @cached_property
    def compliances(self) -> FloatArray:
        """Compliance of each cell, shape (cells, 3, 3) [1/stress]."""
        matrices = np.stack([material.compliance for material in self.materials])
        return np.asarray(matrices[self.cell_materials])

    @cached_property
    def contacts(self) -> tuple[Contact, ...]:
        """The contact conditions, in the order given."""
        return tuple(condition for condition in self.conditions if isinstance(condition, Contact))

    @property
    def joints(self) -> tuple[Contact, ...]:
        """The contacts that lie inside the body."""
        return tuple(contact for contact in self.contacts if contact.edges in self.mesh.joint_names)

    @cached_property
    def owners(self) -> IntArray:
        """Index of the condition for each component of each boundary edge, shape (2, edges).

        The two components are x and y; on slanted edges whose conditions give normal and tangential components, these.
        The mesh keeps the array for all problems with the same edges and components: the values do not matter.
        """
        joints, given = self.joints, list[tuple[int, Sequence[str], IntArray]]()
        for index, condition in enumerate(self.conditions):
            if condition not in joints:
                names = tuple(components(condition)) if isinstance(condition, (Traction, Displacement)) else LOCAL
                given.append((index, names, _edges_of(self.mesh, condition)))
        key = ((index, names, edges.tobytes()) for index, names, edges in given)
        return self.mesh.kept(np.ndarray, ("owners", *key), partial(_owners_of, self, given))

    def prescribed(self, kind: type[Traction] | type[Displacement]) -> tuple[Prescribed, ...]:
        """All prescribed components of tractions or of displacements, with those of symmetry lines."""
        return self._prescribed[kind]

    @cached_property
    def _prescribed(self) -> dict[type[Traction] | type[Displacement], tuple[Prescribed, ...]]:
        prescribed: dict[type[Traction] | type[Displacement], list[Prescribed]] = {Traction: [], Displacement: []}
        for condition in self.conditions:
            if isinstance(condition, Contact):
                continue
            data: dict[tuple[Any, str], Field]
            if isinstance(condition, Symmetry):
                data = {(Traction, "tangential"): 0.0, (Displacement, "normal"): 0.0}
            else:
                data = {(type(condition), name): value for name, value in components(condition).items()}
            title, edges = type(condition).__name__, self.mesh.edges(condition.edges)
            for (kind, name), value in data.items():
                frame = direction_of(name, edges.normal, edges.tangent), name in LOCAL
                prescribed[kind].append(Prescribed(condition, f"{title}.{name}", edges, *frame, value))
        return {kind: tuple(each) for kind, each in prescribed.items()}


def direction_of(name: str, normals: FloatArray, tangents: FloatArray) -> FloatArray:
    """Unit vectors (n, 2) of the component "x", "y", "normal" or "tangential" where a line has these directions."""
    if name in LOCAL:
        return normals if name == "normal" else tangents
    return np.full(normals.shape, np.eye(2)[CARTESIAN.index(name)])


def with_contacts(problem: ContactProblem, changed: Callable[[Contact], Contact]) -> ContactProblem:
    """The problem with changed(contact), with the same edges and name, in place of each contact.

    Only data at the points of a contact and the plate that it has may change. All else was checked with the given
    problem, and both problems hold it; what they keep, but `contacts`, does not depend on these data.
    """
    _ = problem.prescribed(Traction)  # computed before, so that both hold it
    conditions = tuple(changed(each) if isinstance(each, Contact) else each for each in problem.conditions)
    new = object.__new__(type(problem))
    vars(new).update({name: each for name, each in vars(problem).items() if name != "contacts"}, conditions=conditions)
    return new


def _check_parts(problem: ContactProblem) -> None:
    """Make conditions and regions tuples; `InputError` if contacts share a name, or joints an edge or have a plate."""
    for name, kind, classes in _LISTS:
        entries = getattr(problem, name)
        bad = [each for each in entries if not isinstance(each, kind)] if isinstance(entries, Sequence) else [entries]
        if bad:
            raise InputError(f"ContactProblem.{name}", bad[0], f"give a list: each entry must be a {classes}")
        object.__setattr__(problem, name, tuple(entries))
    for region in problem.regions:
        if region.material.plane != problem.material.plane:
            remedy = f"give a material in plane {problem.material.plane}, as the body"
            raise InputError("Region.material", region.material, remedy)
    names = [contact.name for contact in problem.contacts]
    if len(set(names)) < len(names):
        raise InputError("Contact.name", max(names, key=names.count), "give each contact a name of its own")
    joint_of_edge: dict[int, str] = {}
    for joint in problem.joints:
        if joint.plate is not None:
            raise InputError("Contact.plate", joint.name, "a joint lies between two blocks: no plate drives it")
        for edge in problem.mesh.joint_set(joint.edges).tolist():
            if edge in joint_of_edge:
                remedy = f"shares an edge with {joint_of_edge[edge]!r}: give them ranges that do not overlap"
                raise InputError("Contact.edges", joint.name, remedy)
            joint_of_edge[edge] = joint.name


def _owners_of(problem: ContactProblem, given: Sequence[tuple[int, Sequence[str], IntArray]]) -> IntArray:
    """`ContactProblem.owners` from the index of each condition, the names of its components, and its boundary edges.

    `InputError` for a component with no or two conditions, or an edge with both frames.
    """
    mesh, boundary = problem.mesh, problem.mesh.boundary

    def middle(edge: int) -> str:
        return place_of(mesh.midpoints[boundary.number[edge]])

    def refuse(name: str, row: int, edge: int, remedy: str) -> NoReturn:
        component = f"{_NAMES[row]} component" if row >= len(CARTESIAN) else f"component {_NAMES[row]}"
        raise InputError("ContactProblem.conditions", name, f"{component} of the edge around {middle(edge)} {remedy}")

    # owners of the components x, y, normal, tangential; on edges parallel to an axis the last two are x and y
    owner_of_row = np.full((4, len(boundary)), -1)
    axis_parallel = (np.abs(boundary.tangent).max(axis=1) == 1.0) & ~boundary.bent
    normal_axis = np.abs(boundary.normal).argmax(axis=1)
    normal, tangential = np.where(axis_parallel, [normal_axis, 1 - normal_axis], [[2], [3]])
    row_of_component = dict(zip(_NAMES, (0 * normal, 0 * normal + 1, normal, tangential), strict=True))
    for index, names, edges in given:
        for name in names:
            rows = row_of_component[name][edges]
            taken = np.flatnonzero(owner_of_row[rows, edges] >= 0)
            if len(taken):
                row, edge = int(rows[taken[0]]), int(edges[taken[0]])
                earlier = problem.conditions[owner_of_row[row, edge]]
                remedy = f"already has the condition {type(earlier).__name__}({earlier.edges!r}): {_OVERLAP}"
                refuse(problem.conditions[index].edges, row, edge, remedy)
            owner_of_row[rows, edges] = index
    is_local = np.asarray((owner_of_row[2:] >= 0).any(axis=0))
    mixed = np.flatnonzero(is_local & (owner_of_row[:2] >= 0).any(axis=0))
    if len(mixed):
        edge = int(mixed[0])
        row = int(owner_of_row[:, edge].argmax())
        remedy = (
            f"gives the {_NAMES[row]} component of the slanted edge around {middle(edge)}, and another condition one "
            "of the other kind: give both components of an edge as x and y, or both as normal and tangential"
        )
        raise InputError("ContactProblem.conditions", problem.conditions[owner_of_row[row, edge]].edges, remedy)
    owners = np.where(is_local, owner_of_row[2:], owner_of_row[:2])
    if (owners < 0).any():
        row, edge = np.argwhere(owners < 0)[0].tolist()
        of_edge = [name for name in mesh.edge_names if edge in mesh.edge_set(name)]
        remedy = "has no condition; add a traction (0 if it is free), a displacement, a symmetry or a contact"
        if (owners[:, edge] < 0).all():
            remedy += '; in a problem file, free = "rest" makes all such edges free'
        refuse([*of_edge, "an edge without a name"][0], row + 2 * int(is_local[edge]), edge, remedy)
    owners.flags.writeable = False  # problems share it
    return owners


def _edges_of(mesh: TriangleMesh, condition: Condition) -> IntArray:
    """Indices of a condition's edges in `TriangleMesh.boundary`."""
    try:
        if isinstance(condition, Contact):
            mesh.edges(condition.edges)  # so the message lists joints too
        return mesh.edge_set(condition.edges)
    except UnknownNameError as error:
        raise UnknownNameError(f"{type(condition).__name__}.edges", condition.edges, error.remedy) from error


def _check_pressure(problem: ContactProblem) -> None:
    """`InputError` if an incompressible body has no prescribed normal traction, or an initial strain.

    A constant pressure does not strain such a body, so a traction must determine it. A plate's force or an open contact
    could determine it too, but then K of (D2) is singular. No stress can balance an initial strain of such parts.
    """
    is_incompressible = [problem.materials[number].incompressible for number in np.unique(problem.cell_materials)]
    if any(is_incompressible) and is_strained(problem):
        remedy = "temperature, shrinkage and prestress need a compressible material: take a number below 0.5"
        raise InputError("Material.poisson", 0.5, remedy)
    if not all(is_incompressible):
        return
    normal_parts = ((given.direction * given.edges.normal).sum(axis=1) for given in problem.prescribed(Traction))
    if not any((np.abs(normal_part) > _NORMAL_ROUNDING).any() for normal_part in normal_parts):
        remedy = (
            "in plane strain a constant pressure does not deform this body, so the loads do not determine it (forces "
            "on plates and contacts that open do not count): prescribe a normal traction on a part of the "
            "boundary (0 where it is free), or take a number just below 0.5, such as 0.499"
        )
        raise InputError("Material.poisson", 0.5, remedy)


# Digests: stored answers belong to the problem with the same digest. Expressions, polynomials and point data enter a
# digest by their data, other functions by sampled values.

_INERT = ("callback", "threads", "throw")  # options that change no answer
_PARTS_OF_SIDE = 12  # divisions of a triangle's sides in the lattice of points where functions are sampled


def run_digest(problems: Sequence[ContactProblem], options: Mapping[str, object]) -> str:
    """SHA-256 of problems on one mesh and of the options they are solved with, as hexadecimal text.

    Of the mesh, vertices, triangles, arcs and named parts count; options that are None or change no answer do not.
    """
    used = {name: value for name, value in sorted(options.items()) if name not in _INERT and value is not None}
    mesh = problems[0].mesh
    parts: list[object] = [type(mesh).__name__, mesh.vertices, mesh.cells, mesh.sides]
    for names, edges_of in ((mesh.edge_names, mesh.edge_set), (mesh.joint_names, mesh.joint_set)):
        parts += [part for name in names for part in (name, edges_of(name))]
    digest = hashlib.sha256(_digest(parts) + repr(_plain(used)).encode())
    for number in range(len(problems)):
        digest.update(problem_digest(problems[number]))
    return digest.hexdigest()


def _plain(value: Any) -> Any:
    """A number of Python for one of NumPy, also in mappings, so that equal options have one `repr`."""
    if isinstance(value, Mapping):
        return {name: _plain(each) for name, each in value.items()}
    return value.item() if isinstance(value, np.generic) else value


def problem_digest(problem: ContactProblem) -> bytes:
    """SHA-256 of everything but the mesh: names and values of all data of materials, regions and conditions."""
    mesh, t = problem.mesh, triangle_lattice(_PARTS_OF_SIDE)[0] * 0.99 + 0.01 / 3.0  # no point on an edge

    def inside(name: str, function: Any, corners: FloatArray = mesh.corners) -> Iterator[object]:
        a, b, c = corners.T[..., None].swapaxes(0, 1)  # no matrix product: it may round differently on other processors
        with np.errstate(all="ignore"), suppress(Exception):  # solve refuses a function that fails where it is used
            yield np.asarray(function(*(a * t[:, 0] + b * t[:, 1] + c * t[:, 2])), dtype=np.float64)
            return
        for half in np.array_split(corners, 2) if len(corners) > 1 else ():  # it may be defined in one region only
            yield from inside(name, function, half)

    def along(edges: Edges, name: str, function: Any) -> Iterator[object]:
        quadrature = along_edges(mesh, edges, name, function)  # samples on both sides of jumps
        yield from (quadrature.edge, quadrature.t, quadrature.values)

    whole = (problem.materials, problem.regions, problem.body_forces, problem.temperature)
    parts = [problem.cell_materials, *_digested(whole, inside)]
    for condition in problem.conditions:
        parts += _digested(condition, partial(along, mesh.edges(condition.edges)))
    return _digest(parts)


def _digested(part: Any, values: Callable[[str, Any], Iterator[object]], name: str = "") -> Iterator[object]:
    """The parts of a digest for a datum and everything in it; `values` samples functions that have no data."""
    if isinstance(part, PointData):
        yield from (part.mesh.vertices, part.mesh.cells, part.values)
    elif callable(part) and not isinstance(part, Expression | Polynomial):
        yield from values(name, part)
    elif is_dataclass(part) or isinstance(part, Mapping | tuple):
        yield type(part).__name__
        if is_dataclass(part):
            part = {each.name: getattr(part, each.name) for each in fields(part)}
        for key, each in enumerate(part) if isinstance(part, tuple) else sorted(part.items()):
            yield key
            yield from _digested(each, values, str(key))
    else:
        yield part


def _digest(parts: Iterable[object]) -> bytes:
    """SHA-256 of arrays by type, shape and bytes, of everything else by its repr, which keeps all bits of numbers."""
    digest = hashlib.sha256()
    for part in parts:
        if isinstance(part, np.ndarray):
            digest.update(f"{part.dtype.str}{part.shape}".encode())
            digest.update(np.ascontiguousarray(part).reshape(-1).view(np.uint8).data)
        else:
            digest.update(repr(part).encode())
        digest.update(b"\0")
    return digest.digest()


def by_cell(problem: ContactProblem, on_edges: Mapping[str, FloatArray]) -> FloatArray:
    """Sums (cells,) of values (edges,) on the edges of each contact; a joint's edge gives half to each of two cells."""
    cell_values = np.zeros(problem.mesh.cell_count)
    for contact in problem.contacts:
        if contact.name in on_edges:
            cells = problem.mesh.edges(contact.edges).cells
            n_cells = (cells >= 0).sum(axis=1)
            np.add.at(cell_values, cells[cells >= 0], np.repeat(on_edges[contact.name] / n_cells, n_cells))
    return cell_values
