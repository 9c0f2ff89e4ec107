"""Names of version 0.1 that are gone, each with what to do instead."""

from collections.abc import Mapping
from typing import Any, Final

from qvi_contact.errors import InputError

RETIRED: Final = {
    "RectilinearMesh": "was retired in version 0.2: give its lines and cells to TriangleMesh.grid, or take "
    "TriangleMesh.rectangle",
    "triangulated": "was retired in version 0.2: grids have triangles from the start, so leave the call out",
    "on_lines": "was retired in version 0.2: give other lines to TriangleMesh.grid, or take refine",
    "refined": "was retired in version 0.2: take refine(problem, target=…), or refined and graded of the mesh",
    "element": "was retired in version 0.2: there is one element, on triangles, into which grids are cut; leave it out",
    "contact_rows": "was renamed in version 0.2: give law_on='edges' for 'bernstein', 'points' for 'gauss'",
    "refined_where_apart": "was retired in version 0.2: call refine(problem, quantity='energy'), or bisect what holds "
    "most of result.bracket.cell_gaps by the mesh's own refined",
    "stream_sweep": "was retired in version 0.2: call solve_sweep(problem, parameter, values, of, store=FILE)",
}
"""By name of what could be imported, called or given."""


def refuse_retired(name: str) -> None:
    """`InputError` with what to do instead if this name was retired."""
    if name in RETIRED:
        raise InputError("name", name, RETIRED[name])


def refuse_arguments(given: Mapping[str, Any]) -> None:
    """`InputError` with what to do instead for a retired argument, `TypeError` for any other that is unknown."""
    for name, value in given.items():
        if name in RETIRED:
            raise InputError(name, value, RETIRED[name])
        raise TypeError(f"unexpected keyword argument {name!r}")
