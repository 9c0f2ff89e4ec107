"""The fields of a result as data for the page's own script, which draws them and answers the pointer."""

import base64
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.basics.units import Units
from qvi_contact.mesh.edges import Edges
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.plots.tractions import pieces_along
from qvi_contact.problem.initial_strain import is_strained
from qvi_contact.solution.contact_line import ContactLine, ContactState
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.stress import BodySamples, held_along_z, out_of_plane_factors, sample_body

if TYPE_CHECKING:
    from qvi_contact.companion import CompanionResult

_PARTS: Final = (64, 48, 32, 24, 16, 8, 1)  # along the body's length: the first with few enough points is taken
_MOST_POINTS: Final = 9_000
_SHORT: Final = 65_536  # so many numbers two bytes can tell apart
_LARGEST: Final = 120_000  # points: with more the page would be too heavy to mail
_COLOURS: Final = 33  # of a colour map
_LONGEST: Final = 0.08  # share of the body's length at which the largest displacement is drawn


def field_data(result: ContactResult, companion: "CompanionResult | None", units: Units) -> dict[str, Any] | None:
    """Points, small triangles, stresses and displacements of a result; None where there are too many for a page.

    Arrays are little-endian, in base64: float32, triangles as uint16 or uint32, materials as uint16.
    """
    samples = _samples(result)
    if len(samples.points) > _LARGEST:
        return None
    strained = is_strained(result.problem) and result.problem.material.plane == "strain"
    mesh, wide = result.problem.mesh, 2 if len(samples.points) <= _SHORT else 4
    moved = None if companion is None else companion.displacement_in(samples.cells, samples.reference[:, -2:])
    return {
        "units": {"length": units.length, "stress": units.stress},
        "points": _floats(samples.points),
        "triangles": _encoded(samples.triangles.astype("<u2" if wide == 2 else "<u4")),
        "bytes": wide,
        "stress": _floats(samples.stress),
        "material": _encoded(result.problem.cell_materials[samples.cells].astype("<u2")),
        "factor": out_of_plane_factors(result.problem),
        "held": _floats(held_along_z(result.problem, samples.cells, *samples.points.T)) if strained else None,
        "displacement": None if moved is None else _floats(moved),
        "factorOfDisplacement": 0.0 if moved is None else _round_factor(_LONGEST * mesh.length, moved),
        "outline": _segments(mesh, mesh.boundary, companion),
        "mesh": _segments(mesh, mesh.interior, companion),
        "contacts": [_segments(mesh, mesh.edges(contact.edges), companion) for contact in result.problem.contacts],
        "colours": {name: _colours(name) for name in ("cividis", "cividis_r", "PuOr_r")},
    }


def contact_data(line: ContactLine, units: Units) -> dict[str, Any]:
    """The points of a contact as its picture shows them from left to right, numbers with seven digits."""
    pieces = pieces_along(line)[0]
    order, places = (np.concatenate(part) for part in zip(*((piece.points, piece.s) for piece in pieces), strict=True))
    bound = np.where(np.isfinite(line.friction_bound), line.friction_bound, np.nan)
    columns = {
        "x": line.x, "y": line.y, "pressure": -line.effective_normal_stress, "shear": line.tangential_stress,
        "bound": bound, "gap": line.gap, "slip": line.slip,
    }  # fmt: skip
    found: dict[str, Any] = {name: _rounded(values[order]) for name, values in columns.items()}
    if line.has_fluid:
        found["fluid"] = _rounded(line.pore_pressure[order])
    found |= {"s": _rounded(places), "units": {"length": units.length, "stress": units.stress}}
    return found | {"state": [ContactState(state).name.lower() for state in line.state[order].tolist()]}


def _samples(result: ContactResult) -> BodySamples:
    """As many points as a page should have, or the fewest there can be."""
    for parts in _PARTS:
        samples = sample_body(result, parts)
        if len(samples.points) <= _MOST_POINTS:
            break
    return samples


def _encoded(values: Any) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")


def _floats(values: FloatArray) -> str:
    return _encoded(values.astype("<f4"))


def _rounded(values: FloatArray) -> list[float | None]:
    return [float(f"{value:.7g}") if np.isfinite(value) else None for value in values.tolist()]


def _segments(mesh: TriangleMesh, edges: Edges, companion: "CompanionResult | None") -> dict[str, Any]:
    """Both ends of the two halves of edges, x and y of each, and their displacements in the first cell beside."""
    points = np.stack(mesh.points_along(edges, np.array([0.0, 0.5, 1.0])), axis=-1)
    moved = None
    if companion is not None:
        flat, cells = points.reshape(-1, 2), np.repeat(edges.cells[:, 0], 3)
        reference = mesh.reference(cells, flat)[:, -2:]
        moved = companion.displacement_in(cells, reference).reshape(points.shape)
    halves = [None if values is None else _floats(values[:, [0, 1, 1, 2]]) for values in (points, moved)]
    return {"points": halves[0], "displacement": halves[1]}


def _colours(name: str) -> list[list[int]]:
    """Red, green and blue from 0 to 255 along a colour map."""
    from matplotlib import colormaps

    colours = colormaps[name](np.linspace(0.0, 1.0, _COLOURS))[:, :3]
    found: list[list[int]] = np.round(255 * colours).astype(int).tolist()
    return found


def _round_factor(longest: float, moved: FloatArray) -> float:
    """The largest of 1, 2, 5 times a power of ten by which no displacement is drawn longer than this."""
    largest = float(np.hypot(*moved.T).max())
    if largest == 0.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(longest / largest))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= longest / largest * (1 + 1e-12)))
