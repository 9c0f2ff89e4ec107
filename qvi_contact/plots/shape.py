"""How a stress state deforms the body: the displacement whose strains are nearest to those of the stresses.

The stress model has no displacement inside the body. On contacts, obstacles and supports it has:
u_N = g − gap − σ_N'/k_N and u_T = w + slip − σ_T/k_T, the last terms of springs. The displacement v of
degree 2 that is drawn makes

    ∫ |ε(v) − c σ − ε⁰|² dx  +  α Σ w |v·d − known|²

least, ε⁰ the initial strain, the sum over points of contacts and supports with their weights w and directions d. It
takes one linear solve, and there is one for every stress state: for steps of a history too, whose Coulomb's law has no
energy.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from qvi_contact.basics.checks import FloatArray, IntArray, evaluate
from qvi_contact.companion import DisplacementSpace, Elasticity
from qvi_contact.companion.space import barycentric, triangle
from qvi_contact.element import bernstein
from qvi_contact.element.legendre import gauss_legendre
from qvi_contact.mechanism import RigidMotion
from qvi_contact.mesh.edges import Edges, vectors_along
from qvi_contact.problem.conditions import SPRINGS, Displacement
from qvi_contact.problem.material import stress_at_rest
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.stress import stress_in_cells

_DEGREE: Final = 2
_KNOWN: Final = 100.0  # α: what is known of displacements outweighs strains
_NOTHING: Final = 1e-9  # the same for all displacements: motions that nothing determines stay small
_ISOTROPIC: Final = np.diag([1.0, 1.0, 0.5])  # |ε|² of (ε_xx, ε_yy, 2ε_xy)


@dataclass(frozen=True, eq=False)
class Shape:
    """A displacement of the body, with faces of their own on both sides of joints."""

    space: DisplacementSpace
    """Elements of degree 2 on the mesh."""
    coefficients: FloatArray
    """Their coefficients [length], (n, 2)."""

    @classmethod
    def of(cls, result: ContactResult) -> "Shape":
        """The displacement of a stress state, see above."""
        problem, scales = result.problem, result.discretization.scales
        space = DisplacementSpace.of(problem, triangle(_DEGREE), scales.length)
        body = Elasticity(space, np.tile(_ISOTROPIC, (len(space.table), 1, 1)))
        t, weights = body.points()
        cells = np.arange(len(space.table))
        places = problem.mesh.origin + scales.length * space.points(slice(None), t)
        at = np.broadcast_to(barycentric(t), (len(cells), len(t), 3)).copy()
        bent = space.curved.numbers
        if len(bent):
            numbers = np.repeat(bent, len(t))
            at[bent] = problem.mesh.reference(numbers, places[bent].reshape(-1, 2)).reshape(len(bent), -1, 3)
        coefficients = result.discretization.coefficients(result.dofs)
        stress = stress_in_cells(result.discretization, coefficients, cells, at)[1] * scales.stress
        stress = stress - stress_at_rest(problem, cells, places[..., 0], places[..., 1])
        strain = stress @ problem.compliances.swapaxes(1, 2)
        load = body.virtual_work((strain @ _ISOTROPIC) * weights[..., None], t)
        matrix, right = _known(result, space)
        K = body.stiffness() + _KNOWN * matrix.T @ matrix + _NOTHING * sparse.eye_array(space.size)
        factor = splu(sparse.csc_array(K), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
        v = factor.solve(load + _KNOWN * (matrix.T @ right / scales.length))
        return cls(space, scales.length * v.reshape(-1, 2))

    def at(self, cells: IntArray, t: FloatArray) -> FloatArray:
        """Displacements at one reference point each, (n, 2), of cells (n,), shape (n, 2) [length]."""
        own = self.space.own(cells, t[:, None])[:, 0] if len(self.space.curved) else t
        shapes = self.space.cell.values(own)[:, None]
        return np.asarray((shapes @ self.coefficients[self.space.table[cells]])[:, 0])

    def along(self, edges: Edges, t: FloatArray, *, other: bool = False) -> FloatArray:
        """Displacements at t (q,), 0 to 1, of edges, (edges, q, 2) [length]; with `other` those of the far side."""
        return np.asarray(bernstein.basis(_DEGREE, t) @ self.coefficients[self.space.along(edges, other=other)])


def _known(result: ContactResult, space: DisplacementSpace) -> tuple[sparse.csr_array, FloatArray]:
    """Rows (k, size) of what is known of displacements, and their values (k,) [length], both times √w."""
    problem, scales, mesh = result.problem, result.discretization.scales, result.problem.mesh
    blocks, values = [sparse.csr_array((0, space.size))], [np.empty(0)]

    def add(edges: Edges, t: FloatArray, direction: FloatArray, known: FloatArray, joint: bool = False) -> None:
        """Rows for values (e, q) along directions (e, q, 2) at t (q,) of edges, of a joint those of the jump."""
        shape = bernstein.basis(space.degree, t)
        roots = np.sqrt(edges.length[:, None] / (scales.length * len(t)) * np.ones(len(t)))
        entries = roots[..., None, None] * shape[:, :, None] * direction[:, :, None]
        starts = np.arange(0, entries.size + 1, 2 * shape.shape[1])
        for other in (False, True) if joint else (False,):
            columns = np.broadcast_to(2 * space.along(edges, other=other)[:, None, :, None] + [0, 1], entries.shape)
            rows = sparse.csr_array((entries.ravel(), columns.ravel(), starts), shape=(known.size, space.size))
            blocks.append(blocks.pop() - rows if other else rows)
        values.append((roots * known).ravel())

    t = gauss_legendre(_DEGREE + 1)[0]
    for given in problem.prescribed(Displacement):
        places = mesh.points_along(given.edges, t)
        along = vectors_along(given.edges, given.direction, t, turns=given.turns)
        add(given.edges, t, along, evaluate(given.name, given.value, *places))
    for contact, rows in zip(problem.contacts, result.discretization.contacts, strict=True):
        body, _ = faces(result, contact.name)
        points, line = rows.points, result.contacts[contact.name]
        shaped = (len(points.edges), points.count)
        for direction in (points.normals, points.tangents)[: 1 if line.frictionless else 2]:
            known = (body * direction).sum(axis=1).reshape(shaped)
            add(points.edges, points.reference, direction.reshape(*shaped, 2), known, rows.joint)
    return sparse.csr_array(sparse.vstack(blocks)), np.concatenate(values)


def faces(result: ContactResult, name: str) -> tuple[FloatArray, FloatArray]:
    """Displacements (m, 2) of the body at the points of a contact, and where the obstacle stands beside them [length].

    Those of the body follow from gap, slip and what springs stretch by, with the motion of a plate; of a joint they are
    the jump. An obstacle stands at its gap g, and where its plate moves it; w along it is left out, which changes
    nothing of what it looks like. In a load history slip counts from its beginning.
    """
    discretization, line = result.discretization, result.contacts[name]
    index = next(i for i, rows in enumerate(discretization.contacts) if rows.name == name)
    rows, unit = discretization.contacts[index], discretization.scales.displacement
    normal, along = rows.points.normals, rows.points.tangents
    contact, gap = result.problem.contacts[index], unit * rows.gap
    outwards, sideways = gap - line.gap, unit * (rows.offset + rows.slip) + line.slip
    borne = (outwards, line.effective_normal_stress), (sideways, line.tangential_stress)
    for kind, (moved, stress) in zip(SPRINGS, borne, strict=True):
        if getattr(contact, kind) is not None:
            moved -= stress / evaluate(f"Contact.{kind}", getattr(contact, kind), line.x, line.y)
    body, obstacle = outwards[:, None] * normal + sideways[:, None] * along, gap[:, None] * normal
    plate = contact.plate
    if plate is not None and name in result.plates:  # one that is driven by force
        motion = result.plates[name]
        rigid = RigidMotion(motion.x, motion.y, motion.rotation, plate.pivot).at(np.column_stack([line.x, line.y]))
        body, obstacle = body + rigid, obstacle + rigid
    return body, obstacle
