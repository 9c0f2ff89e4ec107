"""From the outline in a problem file to its mesh of triangles."""

from collections.abc import Sequence

from qvi_contact.errors import InputError
from qvi_contact.files.located import located
from qvi_contact.files.problem_document import CornerTable, OutlineTable, RingTable
from qvi_contact.mesh.outline import Corner
from qvi_contact.mesh.triangles import TriangleMesh

_PATH = "mesh.outline"


def outlined(table: OutlineTable) -> TriangleMesh:
    """The body divided into triangles; errors name the place in the file."""
    corners = _corners(f"{_PATH}.corners", table.corners)
    holes = [_ring(f"{_PATH}.holes[{k}]", ring, ring.name or "") for k, ring in enumerate(table.holes)]
    joints = {line.name: _corners(f"{_PATH}.joints[{k}].corners", line.corners) for k, line in enumerate(table.joints)}
    regions = {ring.name: _ring(f"{_PATH}.regions[{k}]", ring) for k, ring in enumerate(table.regions)}
    for kind, found, tables in (("joints", joints, table.joints), ("regions", regions, table.regions)):
        if len(found) < len(tables):
            names = [each.name for each in tables]
            twice = next(k for k, name in enumerate(names) if name in names[:k])
            raise InputError(f"{_PATH}.{kind}[{twice}].name", names[twice], "this name is taken: choose another one")
    sizes = {(entry.at[0], entry.at[1]): entry.size for entry in table.sizes}
    try:
        return TriangleMesh.outline(corners, table.size, holes=holes, joints=joints, regions=regions, sizes=sizes)
    except InputError as error:
        raise type(error)(_place(table, error.field), error.value, error.remedy) from error


def _place(table: OutlineTable, field: str) -> str:
    """Where in [mesh.outline] the fault is."""
    kind, _, name = field.partition(".")
    names = {"joints": [line.name for line in table.joints], "regions": [ring.name for ring in table.regions]}
    if name in names.get(kind, ()):
        return f"{_PATH}.{kind}[{names[kind].index(name)}]"
    return f"{_PATH}.{field}" if field.split("[")[0] in OutlineTable.model_fields else _PATH


def _corners(path: str, tables: Sequence[CornerTable]) -> list[Corner]:
    found = []
    for index, table in enumerate(tables):
        with located(f"{path}[{index}]", table):
            centre = None if table.centre is None else (table.centre[0], table.centre[1])
            at = (table.at[0], table.at[1])
            found.append(Corner(at, table.name or "", centre, table.clockwise, table.size))
    return found


def _ring(path: str, table: RingTable, name: str = "") -> Sequence[Corner]:
    """A closed line; the edges of a circle get the name."""
    if table.corners is not None:
        return _corners(f"{path}.corners", table.corners)
    assert table.centre is not None  # the table has checked both
    assert table.radius is not None
    with located(path, table):
        return Corner.circle((table.centre[0], table.centre[1]), table.radius, name, table.size)
