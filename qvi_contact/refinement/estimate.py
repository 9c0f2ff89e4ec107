"""Errors from the differences of three nested grids, cell by cell.

With stresses on a grid, on it with every interval bisected, and on it with every second line left out, the differences
Δ₁ (coarsest to middle) and Δ₂ (middle to finest) of `differences` give a rate p wherever they can be compared,

    Δ₁/Δ₂ = s^p,        error of the finest ≈ Δ₂ / (2^p − 1),

s the ratio by which cells shrink from the coarsest to the middle grid. Stresses in the cells have a rate of their own
in each coarsest cell: 4 where they are smooth, 2λ in a corner with stresses like r^(λ−1). The contact terms have one
at each end of a contact, where free shear beside friction costs 1, and one common to the rest of the contacts: where
stick, slip and open zones meet, single cells say little.

In `docs/theory.md`: (D13).
"""

from dataclasses import dataclass

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray
from qvi_contact.mesh.rectilinear import RectilinearMesh
from qvi_contact.refinement.differences import cell_energy, contact_defect, directional_energy, gauss_stress
from qvi_contact.refinement.grids import spread, summed
from qvi_contact.solution.result import ContactResult

_HIGHEST = 4.0  # rate of the energy for smooth stresses
_LOWEST_IN_CELLS = 0.8
_LOWEST_ON_CONTACTS = 1.0
_UNKNOWN = 1.0  # rate where grids are too much alike to compare
_ALIKE = 0.2  # ln s below which they are
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class CellErrors:
    """Complementary energy that the cells of the finest grid miss [stress × length²], arrays of shape (ny, nx).

    Attributes
    ----------
    difference : array
        Δ₂, from the middle to the finest grid.
    along_x, along_y : array
        What is left, Δ₂/(2^p − 1), by the direction in which bisecting would help.
    factor_x, factor_y : array
        The factors 2^−p by which bisecting would reduce them.

    """

    difference: FloatArray
    along_x: FloatArray
    along_y: FloatArray
    factor_x: FloatArray
    factor_y: FloatArray

    @property
    def cells(self) -> FloatArray:
        """Error of every cell."""
        return self.along_x + self.along_y

    @property
    def total(self) -> float:
        """Error of the finest result."""
        return float(self.cells.sum())


def cell_errors(coarsest: ContactResult | None, middle: ContactResult, finest: ContactResult) -> CellErrors:
    """Errors of the finest of three results; without the coarsest one all rates count as 1."""
    fine, coarse = finest.problem.grid, middle.problem.grid
    stress = gauss_stress(middle, fine)
    energy = cell_energy(finest, gauss_stress(finest, fine) - stress)
    defect = contact_defect(finest, middle)
    if coarsest is None:
        rate = contact_rate = np.full(fine.shape, _UNKNOWN)
    else:
        base = coarsest.problem.grid
        first = summed(cell_energy(finest, stress - gauss_stress(coarsest, fine)), fine, base)
        first_defect = summed(contact_defect(middle, coarsest), coarse, base)
        rate = spread(_rates(first, energy, fine, base), base, fine)
        contact_rate = spread(_contact_rates(first_defect, defect, fine, coarsest), base, fine)
    in_cells, on_contacts = energy / (2.0**rate - 1.0), defect / (2.0**contact_rate - 1.0)
    share, contact_share = _share_along_x(finest, coarse), _contact_share_along_x(coarse, fine)
    along_x = in_cells * share + on_contacts * contact_share
    along_y = in_cells * (1.0 - share) + on_contacts * (1.0 - contact_share)
    reduced_x = in_cells * share * 2.0**-rate + on_contacts * contact_share * 2.0**-contact_rate
    reduced_y = in_cells * (1.0 - share) * 2.0**-rate + on_contacts * (1.0 - contact_share) * 2.0**-contact_rate
    return CellErrors(energy + defect, along_x, along_y, reduced_x / (along_x + _TINY), reduced_y / (along_y + _TINY))


def _rates(first: FloatArray, second: FloatArray, fine: RectilinearMesh, base: RectilinearMesh) -> FloatArray:
    """Rate p in each cell of the coarsest grid; `second` is given on the finest."""
    total, shrinking = summed(second, fine, base), _log_shrinking(second, fine, base)
    return _rate(first, total, shrinking, _LOWEST_IN_CELLS)


def _contact_rates(first: FloatArray, second: FloatArray, fine: RectilinearMesh, coarsest: ContactResult) -> FloatArray:
    """Rate p of the contact terms in each cell of the coarsest grid: its own at ends of contacts, else a common one."""
    base = coarsest.problem.grid
    total, shrinking = summed(second, fine, base), _log_shrinking(second, fine, base)
    rates = _rate(first, total, shrinking, _LOWEST_ON_CONTACTS)
    inner = ~_end_cells(coarsest)
    weight = np.array([total[inner].sum()])
    mean = (total * shrinking)[inner].sum() / (weight + _TINY)
    common = _rate(np.array([first[inner].sum()]), weight, mean, _LOWEST_ON_CONTACTS)
    return np.where(inner, common, rates)


def _rate(first: FloatArray, second: FloatArray, shrinking: FloatArray, lowest: float) -> FloatArray:
    """Rate p = ln(Δ₁/Δ₂)/ln s, kept between `lowest` and 4."""
    ratio = np.log(np.maximum(first, _TINY)) - np.log(np.maximum(second, _TINY))
    rate = np.where(shrinking > _ALIKE, ratio / np.maximum(shrinking, _ALIKE), _UNKNOWN)
    return np.clip(rate, lowest, _HIGHEST)


def _log_shrinking(weight: FloatArray, fine: RectilinearMesh, base: RectilinearMesh) -> FloatArray:
    """The logarithm of s in each coarsest cell: its size over the weighted mean size of its middle cells."""
    total = summed(weight, fine, base)
    logarithm = np.zeros(base.shape)
    for lines, sizes in (
        (np.diff(base.x)[None, :], np.diff(fine.x)[None, :]),
        (np.diff(base.y)[:, None], np.diff(fine.y)[:, None]),
    ):
        mean = summed(2.0 * weight * sizes, fine, base) / np.where(total > 0.0, total, 1.0)
        logarithm += 0.5 * np.log(lines / np.where(total > 0.0, mean, lines))
    return logarithm


def _end_cells(result: ContactResult) -> BoolArray:
    """Cells at the ends of contacts, shape (ny, nx)."""
    mesh = result.problem.grid
    found = np.zeros(mesh.shape, dtype=bool)
    for contact in result.problem.contacts:
        edges = mesh.edges(contact.edges)
        node, times = np.unique(np.concatenate([edges.first, edges.second]), return_counts=True)
        single = node[times == 1]
        ends = np.isin(edges.first, single) | np.isin(edges.second, single)
        found[edges.row[ends], edges.column[ends]] = True
    return found


def _share_along_x(finest: ContactResult, coarse: RectilinearMesh) -> FloatArray:
    """How much of the stress error of each middle cell is due to its width, 0 to 1, shape of the finest grid."""
    fine = finest.problem.grid
    in_x, in_y = (summed(energy, fine, coarse) for energy in directional_energy(finest, coarse))
    return spread(in_x / np.maximum(in_x + in_y, _TINY), coarse, fine)


def _contact_share_along_x(coarse: RectilinearMesh, fine: RectilinearMesh) -> FloatArray:
    """The same for contact terms, which want cells about as deep as they are wide: h_x²/(h_x² + h_y²)."""
    width, height = np.diff(coarse.x)[None, :] ** 2, np.diff(coarse.y)[:, None] ** 2
    return spread(width / (width + height), coarse, fine)
