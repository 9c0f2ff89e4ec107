"""Which element a mesh has."""

from typing import Final, Literal, TypeAlias, get_args

from qvi_contact.basics.checks import one_of, whole_number
from qvi_contact.discretization.basis import Basis, RowKind
from qvi_contact.discretization.bogner_fox_schmit import BognerFoxSchmit
from qvi_contact.discretization.hsieh_clough_tocher.basis import TriangleBasis
from qvi_contact.element.hsieh_clough_tocher import hsieh_clough_tocher
from qvi_contact.errors import InputError
from qvi_contact.mesh.mesh import Mesh
from qvi_contact.mesh.rectilinear import RectilinearMesh
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.problem import ContactProblem

ElementName: TypeAlias = Literal["bfs", "hct"]
"""The elements by name: Bogner-Fox-Schmit on rectangles, Hsieh-Clough-Tocher on triangles."""

CELLS: Final[dict[ElementName, str]] = {"bfs": "rectangles", "hct": "triangles"}
"""What cells each element has."""

DEFAULT_ELEMENT: Final[ElementName] = "hct"
"""Element of a problem on rectangles where none is named."""

LONGEST_RECTANGLE: Final = 500.0
"""Ratio of sides above which rectangles are not cut by default: triangles may be twice as long, at most."""

FORCES_ON_HOLES: Final = "take element 'hct', on which holes carry forces"
"""What to do where the Airy function would have several values around a hole."""

DEFAULT_DEGREE: Final = 4
"""Degree on triangles where none is given."""


def element_on(mesh: Mesh) -> ElementName:
    """The element that functions on this very mesh have, by name."""
    return "bfs" if isinstance(mesh, RectilinearMesh) else "hct"


def element_by_default(mesh: Mesh) -> ElementName:
    """The element of a problem on a mesh where none is named, see `with_element`."""
    if not isinstance(mesh, RectilinearMesh):
        return "hct"
    return "bfs" if mesh.elongation > LONGEST_RECTANGLE else DEFAULT_ELEMENT


def with_element(problem: ContactProblem, element: ElementName | None = None) -> ContactProblem:
    """The problem on a mesh that the element needs.

    Parameters
    ----------
    problem : ContactProblem
        The problem.
    element : "bfs" or "hct", optional
        For "hct" rectangles are cut into triangles, see `ContactProblem.triangulated`, and triangles stay what they
        are; "bfs" wants rectangles. By default "hct", but "bfs" where a rectangle is more than 500 times as long as
        wide.

    Raises
    ------
    InputError
        If there is no such element, or it does not fit the mesh.

    """
    rectangles = isinstance(problem.mesh, RectilinearMesh)
    if element is None:
        element = element_by_default(problem.mesh)
    one_of("element", element, get_args(ElementName), "give 'bfs' (rectangles) or 'hct' (triangles)")
    if element == "bfs" and not rectangles:
        remedy = "the Bogner-Fox-Schmit element needs rectangles, and this is a mesh of triangles: leave this out"
        raise InputError("element", element, remedy)
    if element == "bfs":
        problem.refuse_supported_holes(f"on rectangles only tractions act on holes; {FORCES_ON_HOLES}")
    return problem.triangulated() if element == "hct" and rectangles else problem


def _among(rows: object, *known: str) -> bool:
    """Whether rows are left out, or among those."""
    return rows is None or (isinstance(rows, str) and rows in known)


def basis_for(mesh: Mesh, degree: int | None = None, contact_rows: RowKind | None = None) -> Basis:
    """The space of Airy functions on a mesh: Bogner-Fox-Schmit on rectangles, Hsieh-Clough-Tocher on triangles.

    Parameters
    ----------
    mesh : Mesh
        The mesh.
    degree : int, optional
        Degree of the functions, where the mesh leaves a choice.
    contact_rows : "bernstein" or "gauss", optional
        What the rows of contacts are, where the element leaves a choice.

    Raises
    ------
    InputError
        If the mesh has no element of that degree, or no such rows.

    """
    if degree is not None:
        whole_number("degree", degree)
    if isinstance(mesh, RectilinearMesh):
        if degree not in (None, BognerFoxSchmit.degree):
            remedy = (
                "rectangles have the Bogner-Fox-Schmit element of degree 3: leave this out, or cut them into triangles "
                "by element 'hct'"
            )
            raise InputError("degree", degree, remedy)
        if not _among(contact_rows, "gauss"):
            remedy = (
                "on rectangles rows are tractions at Gauss points: leave this out, cut them into triangles by element "
                "'hct'"
            )
            raise InputError("contact_rows", contact_rows, remedy)
        return BognerFoxSchmit(mesh)
    if isinstance(mesh, TriangleMesh):
        if not _among(contact_rows, "bernstein", "gauss"):
            raise InputError("contact_rows", contact_rows, "give 'bernstein' or 'gauss'")
        _ = hsieh_clough_tocher(DEFAULT_DEGREE if degree is None else degree)  # refuses degrees that are not offered
        return TriangleBasis(mesh, DEFAULT_DEGREE if degree is None else int(degree), contact_rows or "bernstein")
    raise InputError("ContactProblem.mesh", type(mesh).__name__, "there is no element for this mesh: give another one")
