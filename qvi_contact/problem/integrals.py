"""Fields of the problem along edges, at points that integrate them."""

from qvi_contact.basics.checks import Field, FloatArray, IntArray, check_field, evaluate
from qvi_contact.element.quadrature import EdgeQuadrature, adapted, constant
from qvi_contact.mesh.edges import Edges, rounding_along
from qvi_contact.mesh.triangles import TriangleMesh


def along_edges(
    mesh: TriangleMesh, edges: Edges, name: str, field: Field, points: int = 8, *, minimum: float | None = None
) -> EdgeQuadrature:
    """A field on edges; so many Gauss points on each, or on each of its parts where the field jumps or bends.

    Raises
    ------
    InputError
        If the field fails, is not finite or is below the minimum somewhere; `name` is what it is called then.

    """
    if not callable(field):
        check_field(name, field, minimum=minimum)
        return constant(field, len(edges), points)

    def values(edge: IntArray, t: FloatArray) -> FloatArray:
        return evaluate(name, field, *mesh.points_along(edges.take(edge), t), minimum=minimum)

    return adapted(values, len(edges), points, rounding_along(mesh.vertices, edges))
