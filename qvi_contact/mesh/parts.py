"""What a mesh of triangles is made of, before it is checked."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.mesh.curves import AnyArc


@dataclass(frozen=True, eq=False)
class MeshParts:
    """The arguments of `TriangleMesh`.

    Attributes
    ----------
    vertices : (n, 2) array
        Coordinates [length].
    cells : (m, 3) int array
        Vertices of each triangle.
    edge_sets : mapping of str to (k, 2) int array
        Named edges by their vertices.
    regions : mapping of str to (k,) int array
        Named sets of triangles.
    arcs : sequence of Arc or Curve
        Edges that are curved.

    """

    vertices: FloatArray
    cells: IntArray
    edge_sets: Mapping[str, IntArray] = field(default_factory=dict)
    regions: Mapping[str, IntArray] = field(default_factory=dict)
    arcs: Sequence[AnyArc] = ()
