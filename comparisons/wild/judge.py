"""Is a stress state what it is said to be? Judged by sampled stresses and the problem's own data alone.

`ContactResult.stress` is sampled at 4 × 4 points of every cell. Inside a cell stresses less the body potential are
polynomials of degree 3 in x and in y, which the samples determine; everything below is computed from these.

| what               | checked                                                                                      |
|--------------------|----------------------------------------------------------------------------------------------|
| equilibrium        | div (σ − φ 1) = 0 in every cell, the tractions of neighbours agree along their common edges  |
| prescribed         | force and normal moment of every edge with a given traction                                  |
| plates             | force and moment of every plate                                                              |
| law                | σ_N' ≤ 0 and |σ_T| ≤ min(c + μ|σ_N'|, t_max) at four Gauss points of every edge, σ_N' = σ_N  |
|                    | and the pressure of a fluid in the contact, as it was taken                                  |
| fluid              | its pressure has the given force and moment on every edge; another value at a point is said  |
| compatibility      | no stress with the same friction bounds has less complementary energy, see `compare`         |
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import Final

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval
from scipy.integrate import quad_vec

from qvi_contact import Contact, ContactProblem, ContactResult, Displacement, Traction
from qvi_contact.basics.checks import Field, FloatArray
from qvi_contact.element.hermite import gauss_legendre
from qvi_contact.mesh.rectilinear import HORIZONTAL, GridEdges, RectilinearMesh

_DISTANCE: Final = 1e-3
"""Distance of two states in the energy norm, relative, that is none: errors of 1e-8 in energy allow 1e-4."""

_TOLERANCE: Final = 1e-6
"""Errors relative to the largest stress of the body, or of the contact, that are no errors."""

_SAID: Final = 4.0
"""Times `ContactResult.stress_rounding`, which the result says of itself, that are no errors either."""


_POINTS, _WEIGHTS = gauss_legendre(4)
_INTEGRATED, _INTERVALS = 1e-9, 1000  # accuracy of a fluid's force, and parts of edges for it
_NOTHING: Final = 1e-6  # share of the stress that the data suggest
_ZERO: Final = 1e-14  # share of the largest compliance that is none
_REST: Final = 1e-6  # strain whose stress is taken where they suggest none; ν → −1 is far stiffer than E


_LAGRANGE: Final = np.linalg.inv(np.vander(_POINTS, increasing=True))
"""Coefficients (4, 4) by powers of the four polynomials that are 1 at one sample point each."""
_DERIVATIVE: Final = polyval(_POINTS, polyder(_LAGRANGE)).T
"""Derivatives at the sample points from the values there; (4, 4)."""
_ENDS: Final = polyval(np.array([0.0, 1.0]), _LAGRANGE).T
"""Values at both ends; (2, 4)."""


def _places(lines: FloatArray) -> FloatArray:
    """Where the samples are between grid lines; (cells, 4)."""
    return np.asarray(lines[:-1, None] + np.diff(lines)[:, None] * _POINTS)


def _values(field: Field, x: FloatArray, y: FloatArray) -> FloatArray:
    return np.array(np.broadcast_to(np.asarray(field(x, y) if callable(field) else field, dtype=float), np.shape(x)))


def floor(problem: ContactProblem) -> float:
    """A stress that is as good as none: 1e-6 of the largest that loads, supports and obstacles pushed in suggest."""
    mesh = problem.grid
    stiffest = max(1.0 / _least(material.compliance) for material in problem.materials)
    stresses, moves = [_REST / _NOTHING * stiffest], [0.0]
    for kind, sizes in ((Traction, stresses), (Displacement, moves)):
        for _, chosen, value in problem.by_component(kind):
            points = mesh.points_along(mesh.boundary.take(chosen), _POINTS)
            sizes.append(float(np.abs(_values(value, *points)).max()))
    for contact in problem.contacts:
        edges = mesh.edges(contact.edges)
        gap, offset = (_values(value, *mesh.points_along(edges, _POINTS)) for value in (contact.gap, contact.offset))
        stresses.append(float(_values(contact.pore_pressure, *mesh.points_along(edges, _POINTS)).max()))
        pushed = -gap if contact.law == "unilateral" else np.abs(gap)
        moves += [float(pushed.max()), float(np.abs(offset).max())]
        if contact.plate is not None:
            length = float(mesh.edge_lengths(edges).sum())
            stresses += [abs(force or 0.0) / length for force in (contact.plate.force_x, contact.plate.force_y)]
    return _NOTHING * max(*stresses, stiffest * max(moves) / mesh.length)


def _least(compliance: FloatArray) -> float:
    """The smallest eigenvalue that is not zero: an incompressible body is not compressed by any pressure."""
    compliances = np.linalg.eigvalsh(compliance)
    return float(compliances[compliances > _ZERO * compliances.max()].min())


@dataclass(frozen=True, eq=False)
class Samples:
    """Stresses at 4 × 4 points of every cell.

    Attributes
    ----------
    problem : the problem
    stress : (rows, columns, 4 along y, 4 along x, 3) [stress]; zero where there is no cell

    """

    problem: ContactProblem
    stress: FloatArray

    @classmethod
    def of(cls, result: ContactResult) -> "Samples":
        """Samples of a result."""
        mesh = result.problem.grid
        x, y = (_places(lines).ravel() for lines in (mesh.x, mesh.y))
        rows, columns = mesh.shape
        inside = np.repeat(np.repeat(mesh.active, 4, axis=0), 4, axis=1)
        values = np.zeros((*inside.shape, 3))
        grid_y, grid_x = np.meshgrid(y, x, indexing="ij")
        values[inside] = result.stress(grid_x[inside], grid_y[inside])
        return cls(result.problem, values.reshape(rows, 4, columns, 4, 3).swapaxes(1, 2))

    @cached_property
    def largest(self) -> float:
        """The largest stress component, not below what `floor` calls nothing [stress]."""
        return max(float(np.abs(self.stress).max()), floor(self.problem))

    @cached_property
    def sizes(self) -> tuple[FloatArray, FloatArray]:
        """Width (columns,) and height (rows,) of cells [length]."""
        return np.diff(self.problem.grid.x), np.diff(self.problem.grid.y)

    @cached_property
    def potential(self) -> FloatArray:
        """The potential at the samples, (rows, columns, 4, 4) [stress]."""
        mesh = self.problem.grid
        x, y = _places(mesh.x), _places(mesh.y)
        shape = (*mesh.shape, 4, 4)
        everywhere = (np.broadcast_to(x[None, :, None, :], shape), np.broadcast_to(y[:, None, :, None], shape))
        return np.where(mesh.active[..., None, None], _values(self.problem.body_potential, *everywhere), 0.0)

    def on(self, edges: GridEdges) -> FloatArray:
        """Stresses at four Gauss points of edges, seen from the cell they belong to; (edges, 4, 3)."""
        cells = self.stress[edges.row, edges.column]
        upper = (edges.sign > 0.0).astype(int)
        horizontal = np.einsum("eq,eqpk->epk", _ENDS[upper], cells)
        vertical = np.einsum("eq,epqk->epk", _ENDS[upper], cells)
        return np.asarray(np.where((edges.axis == HORIZONTAL)[:, None, None], horizontal, vertical))

    def beyond(self, edges: GridEdges) -> FloatArray:
        """The same of edges inside the body from the cell above or to the right."""
        horizontal = edges.axis == HORIZONTAL
        cells = self.stress[edges.row + horizontal, edges.column + ~horizontal]
        below, beside = np.einsum("q,eqpk->epk", _ENDS[0], cells), np.einsum("q,epqk->epk", _ENDS[0], cells)
        return np.asarray(np.where(horizontal[:, None, None], below, beside))


def tractions(edges: GridEdges, stress: FloatArray) -> FloatArray:
    """σn on edges with the outward normal n; (edges, points, 2) from (edges, points, 3)."""
    x, y = edges.normal.T[:, :, None]
    xx, yy, xy = np.moveaxis(stress, -1, 0)
    return np.stack([xx * x + xy * y, xy * x + yy * y], axis=-1)


def normal_and_shear(edges: GridEdges, stress: FloatArray) -> tuple[FloatArray, FloatArray]:
    """σ_N = n·σn and σ_T, the component of σn along +x or +y; (edges, points) each."""
    traction = tractions(edges, stress)
    return np.einsum("epk,ek->ep", traction, edges.normal), np.einsum("epk,ek->ep", traction, edges.tangent)


def wrong(result: ContactResult) -> list[str]:
    """What is wrong with a state that is called solved, in words; compatibility apart."""
    samples = Samples.of(result)
    if not np.isfinite(samples.stress).all():
        return ["stresses are not finite"]
    stresses = (_equilibrium(samples), _prescribed(samples), _plates(samples))
    contacts = (_laws(samples, result), _fluids(samples, result), _reported(samples, result))
    allowed = _TOLERANCE + _SAID * _relative(result.stress_rounding, samples.largest)
    return [f"{name}: {error:.1e}" for name, error in chain(*stresses, *contacts) if not error <= allowed]


def _relative(error: FloatArray | float, size: float) -> float:
    """The largest error over a size; no error is zero whatever the size."""
    largest = float(np.abs(error).max(initial=0.0)) if isinstance(error, np.ndarray) else abs(error)
    return largest / size if largest > 0.0 else 0.0


def _equilibrium(samples: Samples) -> Iterator[tuple[str, float]]:
    """Inside cells, and across the edges between them."""
    width, height = (part[None, :, None, None] if i == 0 else part[:, None, None, None]
                     for i, part in enumerate(samples.sizes))  # fmt: skip
    xx, yy, xy = np.moveaxis(samples.stress, -1, 0)
    xx, yy = xx - samples.potential, yy - samples.potential
    along_x = [np.einsum("ij,abkj->abki", _DERIVATIVE, part) / width for part in (xx, xy)]
    along_y = [np.einsum("ij,abjk->abik", _DERIVATIVE, part) / height for part in (xy, yy)]
    smallest = np.minimum(width, height)
    for name, first, second in zip("xy", along_x, along_y, strict=True):
        yield f"equilibrium along {name}", _relative((first + second) * smallest, samples.largest)
    inside = samples.problem.grid.interior
    jump = tractions(inside, samples.on(inside)) - tractions(inside, samples.beyond(inside))
    yield "tractions of neighbours", _relative(jump, samples.largest)


def _prescribed(samples: Samples) -> Iterator[tuple[str, float]]:
    """Force and normal moment on every edge, over the largest stress and what it does there."""
    mesh = samples.problem.grid
    for component, chosen, value in samples.problem.by_component(Traction):
        edges = mesh.boundary.take(chosen)
        x, y = mesh.points_along(edges, _POINTS)
        error = tractions(edges, samples.on(edges))[..., component]
        error = error @ _WEIGHTS - _mean(samples.problem, edges, value)
        yield f"prescribed traction {'xy'[component]}", _relative(error, samples.largest)
        across = (edges.axis == HORIZONTAL) == (component == 1)
        moments = tractions(edges, samples.on(edges))[..., component] - _values(value, x, y)
        if not callable(value):
            yield "prescribed moment", _relative((moments @ (_WEIGHTS * (_POINTS - 0.5)))[across], samples.largest)


def _mean(problem: ContactProblem, edges: GridEdges, value: Field) -> FloatArray:
    """The mean of a field on each edge (edges,)."""
    points, weights = gauss_legendre(8)
    x, y = problem.grid.points_along(edges, points)
    return np.asarray(_values(value, x, y) @ weights)


def _plates(samples: Samples) -> Iterator[tuple[str, float]]:
    """Resultants over the largest traction times the length of the contact, and its reach from the pivot."""
    mesh = samples.problem.grid
    for contact in samples.problem.contacts:
        if contact.plate is None:
            continue
        plate, edges = contact.plate, mesh.edges(contact.edges)
        lengths = mesh.edge_lengths(edges)
        traction = tractions(edges, samples.on(edges))
        weights = lengths[:, None] * _WEIGHTS
        force_x, force_y = (float((weights * traction[..., i]).sum()) for i in (0, 1))
        size = samples.largest * float(lengths.sum())
        for name, found, wanted in (("x", force_x, plate.force_x), ("y", force_y, plate.force_y)):
            if wanted is not None:
                yield f"force_{name} of the plate", _relative(found - wanted, max(size, abs(wanted)))
        if plate.moment is not None:
            x, y = mesh.points_along(edges, _POINTS)
            arm_x, arm_y = x - plate.pivot[0], y - plate.pivot[1]
            moment = float((weights * (arm_x * traction[..., 1] - arm_y * traction[..., 0])).sum())
            reach = max(float(np.abs(arm_x).max()), float(np.abs(arm_y).max()))
            yield "moment of the plate", _relative(moment - plate.moment, max(size * reach, abs(plate.moment)))


def _bound(contact: Contact, x: FloatArray, y: FloatArray, normal: FloatArray) -> FloatArray:
    """min(c + μ|σ_N|, t_max)."""
    bound = _values(contact.cohesion, x, y) + _values(contact.friction, x, y) * np.abs(normal)
    return bound if contact.shear_limit is None else np.minimum(bound, _values(contact.shear_limit, x, y))


def _laws(samples: Samples, result: ContactResult) -> Iterator[tuple[str, float]]:
    """What pulls and what exceeds the bound, over the largest stress."""
    mesh = samples.problem.grid
    for contact in samples.problem.contacts:
        edges = mesh.edges(contact.edges)
        x, y = mesh.points_along(edges, _POINTS)
        normal, shear = normal_and_shear(edges, samples.on(edges))
        normal = normal + result.contacts[contact.name].pore_pressure.reshape(normal.shape)
        if contact.law == "unilateral":
            yield f"tension on {contact.name}", _relative(np.maximum(normal, 0.0), samples.largest)
        if contact.law != "tied":
            steepness = 1.0 + float(_values(contact.friction, x, y).max())
            excess = np.maximum(np.abs(shear) - _bound(contact, x, y, normal), 0.0) / steepness
            yield f"friction on {contact.name}", _relative(excess, samples.largest)


def _fluids(samples: Samples, result: ContactResult) -> Iterator[tuple[str, float]]:
    """The pressure that is taken for a fluid's, a polynomial on every edge: its force and moment, and its values."""
    mesh = samples.problem.grid
    for contact in samples.problem.contacts:
        edges, field = mesh.edges(contact.edges), contact.pore_pressure
        taken = result.contacts[contact.name].pore_pressure.reshape(-1, len(_POINTS))
        missed = np.abs(taken - _values(field, *mesh.points_along(edges, _POINTS))).max(initial=0.0)
        said = any(repr(contact.name) in remark and "pore pressure" in remark for remark in result.remarks)
        yield f"pore pressure on {contact.name}, not said", 0.0 if said else _relative(float(missed), samples.largest)
        found = np.stack([taken @ _WEIGHTS, taken @ (_WEIGHTS * (_POINTS - 0.5))])
        yield f"pore pressure on {contact.name}", _relative(found - _moments(mesh, edges, field), samples.largest)


def _moments(mesh: RectilinearMesh, edges: GridEdges, field: Field) -> FloatArray:
    """∫ p dt and ∫ (t − ½) p dt over every edge (2, edges), also of fields that jump."""

    def weighted(t: float) -> FloatArray:
        values = _values(field, *mesh.points_along(edges, np.array([t])))[:, 0]
        return np.stack([values, (t - 0.5) * values])

    return np.asarray(quad_vec(weighted, 0.0, 1.0, epsrel=_INTEGRATED, limit=_INTERVALS)[0])


def _reported(samples: Samples, result: ContactResult) -> Iterator[tuple[str, float]]:
    """The tractions that contacts report, beside the sampled ones."""
    mesh = samples.problem.grid
    for contact in samples.problem.contacts:
        line, edges = result.contacts[contact.name], mesh.edges(contact.edges)
        normal, shear = normal_and_shear(edges, samples.on(edges))
        yield f"reported σ_N on {contact.name}", _relative(line.normal_stress - normal.ravel(), samples.largest)
        yield f"reported σ_T on {contact.name}", _relative(line.tangential_stress - shear.ravel(), samples.largest)


@dataclass(frozen=True)
class Comparison:
    """A state beside that of another method with the same friction bounds.

    With bounds held fixed there is one state of least complementary energy J, so the two agree or one of them is wrong.

    Attributes
    ----------
    distance : √∫ c(σ − τ) : (σ − τ) dx over that of the larger state
    gain : J(σ) − J(τ) over the strain energy of the larger one: positive if it is σ that is not the least

    """

    distance: float
    gain: float

    @property
    def differs(self) -> bool:
        """Whether the first state is not the one of least energy."""
        return self.distance > _DISTANCE and self.gain > 0.5 * _DISTANCE**2


def compare(result: ContactResult, other: ContactResult) -> Comparison:
    """Compare a state with that of another method.

    J(σ) = ½ ∫ cσ : σ dx − ∫_{Γ_u} U · σn ds − ∫_{Γ_μ} (g σ_N + w σ_T) ds, plates driven by force left out.
    """
    first, second = Samples.of(result), Samples.of(other)
    change = second.stress - first.stress
    size = max(_strain(first, first.stress, first.stress), _strain(second, second.stress, second.stress))
    area = float((first.sizes[1][:, None] * first.sizes[0])[first.problem.grid.active].sum())
    size = max(size, floor(first.problem) ** 2 * area / max(each.young for each in first.problem.materials))
    middle = (first.stress + second.stress) / 2.0
    gain = _work(first, change) - 2.0 * _strain(first, middle, change)
    return Comparison(float(np.sqrt(_strain(first, change, change) / size)), gain / size)


def _strain(samples: Samples, one: FloatArray, two: FloatArray) -> float:
    """½ ∫ c σ : τ dx."""
    width, height = samples.sizes
    mesh, problem = samples.problem.grid, samples.problem
    compliance = np.zeros((*mesh.shape, 3, 3))
    compliance[mesh.active] = problem.compliances
    work = np.einsum("rcijk,rckl,rcijl,i,j->rc", one, compliance, two, _WEIGHTS, _WEIGHTS)
    return 0.5 * float((work * height[:, None] * width).sum())


def _work(samples: Samples, stress: FloatArray) -> float:
    """∫_{Γ_u} U · σn ds + ∫_{Γ_μ} (g σ_N + w σ_T) ds of any stresses at the samples."""
    problem, total = samples.problem, 0.0
    mesh, moved = problem.grid, Samples(problem, stress)
    for component, chosen, value in problem.by_component(Displacement):
        edges = mesh.boundary.take(chosen)
        x, y = mesh.points_along(edges, _POINTS)
        work = _values(value, x, y) * tractions(edges, moved.on(edges))[..., component]
        total += float(mesh.edge_lengths(edges) @ (work @ _WEIGHTS))
    for contact in problem.contacts:
        edges = mesh.edges(contact.edges)
        x, y = mesh.points_along(edges, _POINTS)
        normal, shear = normal_and_shear(edges, moved.on(edges))
        work = _values(contact.gap, x, y) * normal + _values(contact.offset, x, y) * shear
        total += float(mesh.edge_lengths(edges) @ (work @ _WEIGHTS))
    return total
