"""The contact problem as the user states it: mesh, material, conditions, body force."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from qvi_contact.basics.checks import Field, FloatArray, IntArray, check_field
from qvi_contact.errors import InputError
from qvi_contact.mesh.rectilinear import HORIZONTAL, VERTICAL, RectilinearMesh
from qvi_contact.problem.conditions import Condition, Contact, Displacement, Symmetry, Traction
from qvi_contact.problem.material import Material, Region, material_numbers

_COMPONENTS = ("x", "y")
_OVERLAP = "drop one, or name parts of the side by with_edges()"


@dataclass(frozen=True, eq=False)
class ContactProblem:
    """A body, what it is made of, and what happens on its boundary.

    Parameters
    ----------
    mesh : RectilinearMesh
        The body and its cells.
    material : Material
        Its material.
    conditions : sequence of Traction, Displacement, Symmetry, Contact
        One condition for every component of every boundary edge.
    body_potential : float or function of (x, y)
        Potential φ of the body force b = −∇φ [stress]; under gravity φ = ρ g y. Zero by default.
    regions : sequence of Region
        Parts of other material; where they overlap the later one counts.

    Raises
    ------
    InputError
        If a condition names an unknown edge set, two conditions overlap, a component of an edge has none, or two
        contacts share a name.

    """

    mesh: RectilinearMesh
    material: Material
    conditions: Sequence[Condition]
    body_potential: Field = 0.0
    regions: Sequence[Region] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.mesh, RectilinearMesh):
            raise InputError("ContactProblem.mesh", self.mesh, "give a RectilinearMesh")
        if not isinstance(self.material, Material):
            raise InputError("ContactProblem.material", self.material, "give a Material")
        object.__setattr__(self, "conditions", _checked_conditions(self.conditions))
        check_field("ContactProblem.body_potential", self.body_potential)
        object.__setattr__(self, "regions", _checked_regions(self.regions, self.material))
        names = [contact.name for contact in self.contacts]
        for name in names:
            if names.count(name) > 1:
                raise InputError("Contact.name", name, "give each contact a name of its own")
        _check_joints(self)
        _check_complete(self)
        _check_holes(self)
        _ = self.material_numbers  # refuses regions off the grid lines

    @cached_property
    def material_numbers(self) -> IntArray:
        """Index into `materials` for each cell, shape (ny, nx)."""
        return material_numbers(self.mesh, self.regions)

    @property
    def materials(self) -> tuple[Material, ...]:
        """The body's own material and those of the regions."""
        return (self.material, *(region.material for region in self.regions))

    @cached_property
    def compliances(self) -> FloatArray:
        """Compliance of each active cell, row by row, shape (cells, 3, 3) [1/stress]."""
        matrices = np.stack([material.compliance for material in self.materials])
        return np.asarray(matrices[self.material_numbers[self.mesh.active]])

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
        """Index of the condition that rules each component of each boundary edge, shape (2, edges); −1 for none."""
        owner = np.full((2, len(self.mesh.boundary)), -1)
        for index, condition in enumerate(self.conditions):
            if condition in self.joints:
                continue
            chosen = _edges_of(self.mesh, condition)
            for component in _components_of(condition):
                taken = owner[component, chosen]
                if (taken >= 0).any():
                    other = self.conditions[taken[taken >= 0][0]]
                    edge = chosen[np.argmax(taken >= 0)]
                    _raise_on_edge(
                        self.mesh,
                        condition.edges,
                        component,
                        edge,
                        f"is already ruled by {_name(other)}: drop one, or name parts of the side by with_edges()",
                    )
                owner[component, chosen] = index
        return owner

    def refined(self, largest: float, smallest: float | None = None, ratio: float = 0.5) -> "ContactProblem":
        """The same problem on a finer mesh, graded towards re-entrant corners and the ends of all contacts.

        See `RectilinearMesh.refined`: cells of about `largest` shrink by `ratio` to `smallest` [length].
        """
        towards = [contact.edges for contact in self.contacts]
        return replace(self, mesh=self.mesh.refined(largest, towards, smallest, ratio))

    def on_lines(self, x: ArrayLike, y: ArrayLike) -> "ContactProblem":
        """The same problem on other grid lines x, y [length]; see `RectilinearMesh.on_lines`."""
        return replace(self, mesh=self.mesh.on_lines(x, y))

    def prescribed(self, kind: type[Traction] | type[Displacement]) -> Iterator[tuple[int, IntArray, Field]]:
        """Prescribed data of one kind as (component, boundary edges, values), symmetry lines included."""
        for condition in self.conditions:
            if isinstance(condition, Contact):
                continue
            edges = self.mesh.edge_set(condition.edges)
            if isinstance(condition, kind):
                for component, name in enumerate(_COMPONENTS):
                    value: Field | None = getattr(condition, name)
                    if value is not None:
                        yield component, edges, value
            elif isinstance(condition, Symmetry):
                axis = self.mesh.boundary.axis[edges]
                for component in (0, 1):
                    along = axis == (HORIZONTAL if component == 0 else VERTICAL)
                    chosen = edges[along if kind is Traction else ~along]
                    if len(chosen):
                        yield component, chosen, 0.0


def _checked_regions(regions: object, material: Material) -> tuple[Region, ...]:
    if not isinstance(regions, Sequence) or not all(isinstance(region, Region) for region in regions):
        raise InputError("ContactProblem.regions", regions, "give a list of Region")
    for region in regions:
        if region.material.plane != material.plane:
            raise InputError(
                "Region.material", region.material, f"give a material in plane {material.plane}, as the body"
            )
    return tuple(regions)


def _checked_conditions(conditions: object) -> tuple[Condition, ...]:
    if not isinstance(conditions, Sequence) or isinstance(conditions, str):
        raise InputError("ContactProblem.conditions", conditions, "give a list of boundary conditions")
    for condition in conditions:
        if not isinstance(condition, (Traction, Displacement, Symmetry, Contact)):
            remedy = "each entry must be a Traction, Displacement, Symmetry or Contact"
            raise InputError("ContactProblem.conditions", condition, remedy)
    return tuple(conditions)


def _components_of(condition: Condition) -> tuple[int, ...]:
    if isinstance(condition, (Traction, Displacement)):
        return tuple(i for i, name in enumerate(_COMPONENTS) if getattr(condition, name) is not None)
    return 0, 1


def _edges_of(mesh: RectilinearMesh, condition: Condition) -> IntArray:
    try:
        return mesh.edge_set(condition.edges)
    except InputError as error:
        raise InputError(f"{type(condition).__name__}.edges", condition.edges, error.remedy) from error


def _name(condition: Condition) -> str:
    return f"{type(condition).__name__}({condition.edges!r})"


def _check_joints(problem: ContactProblem) -> None:
    """Joints must not share edges, and are driven by no plate."""
    mesh = problem.mesh
    taken: dict[int, str] = {}
    for joint in problem.joints:
        if joint.plate is not None:
            raise InputError("Contact.plate", joint.name, "a joint lies between two blocks: no plate drives it")
        for edge in mesh.joint_set(joint.edges).tolist():
            if edge in taken:
                remedy = f"shares an edge with {taken[edge]!r}: give them ranges that do not overlap"
                raise InputError("Contact.edges", joint.name, remedy)
            taken[edge] = joint.name


def _check_complete(problem: ContactProblem) -> None:
    missing = problem.owners < 0
    if missing.any():
        component, edge = np.argwhere(missing)[0]
        mesh = problem.mesh
        names = [name for name in mesh.edge_names if edge in mesh.edge_set(name)]
        remedy = "has no condition; add a Traction (0 if it is free), Displacement, Symmetry or Contact"
        _raise_on_edge(mesh, names[0], int(component), int(edge), remedy)


def _check_holes(problem: ContactProblem) -> None:
    """A hole whose boundary is not free of supports may carry a force, which a single-valued Airy function cannot."""
    mesh = problem.mesh
    if not mesh.hole_edges.any():
        return
    loaded = np.zeros(problem.owners.shape, dtype=bool)
    for component, edges, _ in problem.prescribed(Traction):
        loaded[component, edges] = True
    held = mesh.hole_edges & ~loaded
    if held.any():
        component, edge = np.argwhere(held)[0]
        names = [name for name in mesh.edge_names if edge in mesh.edge_set(name)]
        remedy = "bounds a hole and is not a Traction; supports and contacts on holes are not supported, only tractions"
        _raise_on_edge(mesh, names[-1], int(component), int(edge), remedy)


def _raise_on_edge(mesh: RectilinearMesh, name: str, component: int, edge: int, remedy: str) -> None:
    x, y = mesh.boundary_midpoints[edge]
    place = f"component {_COMPONENTS[component]} of the edge around ({x:.6g}, {y:.6g})"
    raise InputError("ContactProblem.conditions", name, f"{place} {remedy}")
