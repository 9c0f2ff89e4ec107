"""The companion's contact problem in its forces, and the way back to a displacement that meets all conditions.

With c = c_D + B w_Γ + B_q q the relative displacements (c_D from supports, q motions of plates), and all the maps of
`CondensedBody`, in which springs are a part of the body, forces that are in equilibrium minimise

    ½ τᵀ C τ − τᵀ W (g̃ − c_D − B G r),   C = W B G Bᵀ W,   g̃ = (g, w)

over the mean tractions τ = z / W that the laws admit, a `FrictionQVI`, subject to

    Rᵀ Bᵀ W τ = −Rᵀ r        equilibrium of what floats, with the rigid motions a as multiplier
    Mᵀ W τ = F               resultants of plates, with −q as multiplier; M is what c of the plate itself does.

The multipliers of its rows are W (g − c_N) ≥ 0 and −W (c_T − w): the conditions of (D2) are then those of the
displacement model. Unknowns come as all normal tractions, then all tangential ones. Those whose c nothing can change
(supports prescribe it, or the tip of a joint) get a compliance of their own and stay zero; so do those whose c follows
from others: in a corner where two contact lines end, or where joints cross, several forces act on one displacement, and
friction there is left to the other line.

A solution meets the contact conditions to a tolerance. Where a coefficient presses or sticks beyond doubt its
displacement is set to the obstacle's, an open one is kept at or below the gap, and one that must not slip, or slips
against the sense it is given, is held. The body is solved once more for these contact displacements.

In `docs/theory.md`: (D18), (D40).
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.companion.body import PARALLEL, CondensedBody
from qvi_contact.companion.space import spread
from qvi_contact.companion.traces import DisplacementContact
from qvi_contact.discretization.plates import independent_rows
from qvi_contact.errors import InputError
from qvi_contact.mesh.edges import linked
from solvers import FrictionQVI, QVISolution

_DEPENDENT = 1e-9  # length of an equality row, relative, left after those before it, that counts as nothing
_BALANCED = 1e-9
_STICKS = 1e3  # of the largest bound of friction: the bound of what must not slip

_SHARED = 1e-9  # singular value of rows that share unknowns, relative, that counts as zero
_VIOLATED = 1e-12


@dataclass(frozen=True, eq=False)
class Contacts:
    """All contacts together; arrays over the n coefficients of all traces, or over 2 n with the normal ones first."""

    traces: tuple[DisplacementContact, ...]
    # (2 n, size + k): c from the degrees of freedom of the body and the stretches d of its k springs, c = … − d
    rows: sparse.csr_array
    sprung: IntArray  # (k,): the coefficients that have springs
    springs: sparse.csr_array  # (k, k): their stiffness
    weights: FloatArray  # (2 n,): W
    obstacle: FloatArray  # (2 n,): g̃ = (g, w)
    motions: FloatArray  # (2 n, q): what c of the plates themselves does under each motion that a force drives
    moved: FloatArray  # (2 n,): what c of the plates themselves is under their given motions
    resultants: FloatArray  # (q,): the force or moment that goes with it, beyond that of a fluid in the contact
    fluid: FloatArray  # (2 n,): ∫ p_w B_i ds of fluids, 0 for tangential coefficients; their work is −Σ fluid c

    @classmethod
    def of(cls, traces: tuple[DisplacementContact, ...], size: int) -> "Contacts":
        """Stack the traces."""
        n = sum(trace.count for trace in traces)
        empty = sparse.csr_array((0, size))
        rows = sparse.vstack([empty, *(t.normal for t in traces), *(t.tangential for t in traces)])
        springs = sparse.csr_array((2 * n, 2 * n))
        obstacle = np.concatenate([np.empty(0), *(t.gap for t in traces), *(t.offset for t in traces)])
        weights = np.concatenate([np.empty(0), *(t.weights for t in traces)])
        columns, resultants = [np.zeros((2 * n, 0))], list[float]()
        for trace in traces:
            for first, blocks in zip((trace.start, n + trace.start), trace.stiffness, strict=True):
                if blocks is not None:
                    springs = springs + spread(first + trace.columns, first + trace.columns, blocks, 2 * n)
            for _, normal, tangential, resultant in trace.motions:
                column = np.zeros((2, n))
                column[:, trace.here] = normal, tangential
                columns.append(column.reshape(-1, 1))
                resultants.append(resultant)
        fluid = np.concatenate([np.empty(0), *(t.fluid for t in traces), np.zeros(n)])
        motions, moved = np.hstack(columns), np.hstack([np.empty((2, 0)), *(t.moved for t in traces)]).ravel()
        given = np.array(resultants) + motions.T @ fluid
        sprung = np.flatnonzero(springs.diagonal())
        rows = sparse.csr_array(sparse.hstack([rows, -sparse.eye_array(2 * n, format="csc")[:, sprung]]))
        stiff = sparse.csr_array(springs[sprung][:, sprung])
        return cls(traces, rows, sprung, stiff, np.tile(weights, 2), obstacle, motions, moved, given, fluid)

    def stretched(self, v: FloatArray) -> FloatArray:
        """Coefficients (2 n,) of the stretch of springs from v (size + k,); 0 where there are none."""
        found = np.zeros(2 * self.count)
        found[self.sprung] = v[len(v) - len(self.sprung) :]
        return found

    @property
    def count(self) -> int:
        """Number of coefficients n."""
        return len(self.weights) // 2

    def gathered(self, field: str) -> FloatArray:
        """An array of the traces, one after the other (n,)."""
        return np.concatenate([np.empty(0), *(getattr(trace, field) for trace in self.traces)])


@dataclass(frozen=True, eq=False)
class DualProblem:
    """The algebraic problem and the way back."""

    contacts: Contacts
    body: CondensedBody
    B: FloatArray  # (2 n, k): c from w_Γ
    constant: FloatArray  # (2 n,): c_D, plates moved as given
    movable: BoolArray  # (2 n,): where c can change
    live: BoolArray  # (2 n,): where there is a force: c can change, and does not follow from others
    limited: BoolArray  # (n,): coefficients that rows of the QVI belong to: those of contacts that are not tied
    equalities: IntArray  # which of the rigid motions, then plate motions, have a row of their own
    qvi: FrictionQVI

    def displacements(self, solution: QVISolution) -> tuple[FloatArray, FloatArray]:
        """(w_Γ, motions q of the plates) of a solution."""
        body, W = self.body, self.contacts.weights
        motion = np.zeros(body.R.shape[1] + self.contacts.motions.shape[1])
        motion[self.equalities] = solution.equality_multiplier
        rigid, plates = np.split(motion, [body.R.shape[1]])
        forces = self.B.T @ np.where(self.live, W * solution.z, 0.0) if len(W) else np.zeros(len(body.r))
        return body.relieve(body.r + forces) + body.R @ rigid, -plates


def dual_problem(contacts: Contacts, body: CondensedBody) -> DualProblem:
    """Pose the problem.

    Raises
    ------
    InputError
        If loads, or resultants of plates, contradict equilibrium.

    """
    W, touched = contacts.weights, contacts.rows @ body.supports.axes
    constant = touched @ body.fixed - contacts.moved
    B = touched[:, body.interface].toarray()
    movable = np.abs(B).sum(axis=1) > PARALLEL
    B[~movable] = 0.0
    live = movable.copy()
    live[_determined(B, contacts)] = False
    compliance = B @ body.relieve(np.ascontiguousarray(B.T)) if len(B) else np.zeros((0, 0))
    C = compliance * W * W[:, None]
    C = (C + C.T) / 2.0
    diagonal = np.diag(C).copy()
    C[~live], C[:, ~live] = 0.0, 0.0
    diagonal[~live] = np.median(diagonal[live]) if live.any() else 1.0
    np.fill_diagonal(C, diagonal)
    f = np.where(live, W * (contacts.obstacle - constant - B @ body.relieve(body.r)), 0.0)
    A = np.where(live, np.vstack([body.R.T @ B.T, contacts.motions.T]), 0.0) * W
    b = np.concatenate([-body.R.T @ body.r, contacts.resultants])
    kept = _independent(A, b, body.R.shape[1])
    limited = ~contacts.gathered("tied").astype(bool)
    rows, cohesion, sticks = (
        np.flatnonzero(limited),
        contacts.gathered("cohesion"),
        contacts.gathered("slipping") == 0.0,
    )
    cohesion = np.where(sticks, _STICKS * max(1.0, float(cohesion.max(initial=0.0))), cohesion)
    every, none = sparse.eye_array(2 * contacts.count, format="csr"), np.zeros(len(rows))
    qvi = FrictionQVI.from_arrays(
        K=sparse.csc_array(C),
        f=f,
        N=sparse.csc_array(every[rows]),
        n0=none,
        T=sparse.csc_array(every[contacts.count + rows]),
        t0=none,
        mu=contacts.gathered("friction")[rows],
        W=W[rows],
        cohesion=cohesion[rows],
        cap=contacts.gathered("shear_limit")[rows],
        bilateral=contacts.gathered("bilateral").astype(bool)[rows],
        A=sparse.csc_array(A[kept].reshape(len(kept), 2 * contacts.count)),
        b=b[kept],
    )
    return DualProblem(contacts, body, B, constant, movable, live, limited, kept, qvi)


def _determined(B: FloatArray, contacts: Contacts) -> IntArray:
    """Rows that follow from others: what is tied comes first, then what must not pass an obstacle, then friction."""
    n, found = contacts.count, list[int]()
    tied = np.tile(contacts.gathered("tied").astype(bool), 2)
    rank = np.where(tied, 0, np.where(np.arange(2 * n) < n, 1, 2))
    for rows in groups(sparse.csr_array(B)):
        columns = np.flatnonzero((B[rows] != 0.0).any(axis=0))
        base = np.zeros((0, len(columns)))
        for row in rows[np.argsort(rank[rows], kind="stable")].tolist():
            rest = B[row, columns]
            for _ in range(2):  # once more for orthogonality to rounding
                rest = rest - (base @ rest) @ base
            length = float(np.linalg.norm(rest))
            if length > _DEPENDENT:
                base = np.vstack([base, rest / length])
            else:
                found.append(row)
    return np.array(found, dtype=np.int64)


def groups(B: sparse.csr_array) -> list[IntArray]:
    """Rows that hang together over columns, two or more of them, in ascending order."""
    if not B.nnz:
        return []
    row, column = (np.asarray(part, dtype=np.int64) for part in B.nonzero())
    group = linked(row, column + B.shape[0], sum(B.shape))[: B.shape[0]]  # columns come after the rows
    order = np.argsort(group, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(group[order])) + 1)
    return [part for part in parts if len(part) > 1]


def _independent(A: FloatArray, b: FloatArray, rigid: int) -> IntArray:
    """Equality rows that those before them do not determine; a contradiction raises."""
    sizes = np.linalg.norm(A, axis=1)
    kept, combinations = independent_rows(A, _DEPENDENT * np.maximum(sizes, _DEPENDENT * sizes.max(initial=0.0)))
    for index, combination in combinations.items():
        contradiction = float(b[index] - combination @ b[kept[: len(combination)]])
        if abs(contradiction) > _BALANCED * max(1.0, float(np.abs(b).max())):
            if index >= rigid:
                remedy = (
                    "contradicts equilibrium with the other loads by this, dimensionless: correct it, or leave it out"
                )
                raise InputError("RigidPlate", contradiction, remedy)
            remedy = (
                "the loads on a body that nothing holds are out of balance by this, dimensionless: correct them, or "
                "support the body by a Displacement or Contact"
            )
            raise InputError("ContactProblem.conditions", contradiction, remedy)
    return np.array(kept, dtype=np.int64)


def _held(contacts: Contacts, c: FloatArray, tractions: FloatArray, bound: FloatArray, stress: float) -> BoolArray:
    """Which displacements (2 n,) are to be moved to the obstacle's.

    c are the displacements found, `tractions` τ, `bound` (n,) that of |τ_T|, and `stress` the unit of τ that a unit
    displacement is compared with.
    """
    n, bilateral, slipping = contacts.count, contacts.gathered("bilateral").astype(bool), contacts.gathered("slipping")
    opening, slip = contacts.obstacle[:n] - c[:n], c[n:] - contacts.obstacle[n:]
    held = (-tractions[:n] / stress > np.maximum(opening, 0.0)) | (opening < 0.0)
    sticks = ((bound - np.abs(tractions[n:])) / stress > np.abs(slip)) & (np.abs(slip) < 1e-6)
    sticks |= contacts.gathered("tied").astype(bool) | (slipping == 0.0) | (slipping * slip < 0.0)
    return np.concatenate([bilateral | (held & (np.abs(opening) < 1e-6)), sticks])


def moved(rows: sparse.csr_array, values: FloatArray, change: FloatArray) -> FloatArray:
    """Values (k,) with rows · values changed by `change` (j,), by the least change of values where rows share some."""
    wanted = rows @ values + change
    square = np.asarray(rows.multiply(rows).sum(axis=1)).ravel()
    shared = groups(rows)
    alone = square > 0.0
    for group in shared:
        alone[group] = False
    result = values.copy()
    for _ in range(2):  # once more for rounding
        error = wanted - rows @ result
        result += rows.T @ np.where(alone, error / np.where(alone, square, 1.0), 0.0)
        for group in shared:
            part = rows[group]
            columns = np.unique(part.indices)
            result[columns] += np.linalg.lstsq(part[:, columns].toarray(), error[group], _SHARED)[0]
    return result


def admissible(
    problem: DualProblem, values: FloatArray, plates: FloatArray, tractions: FloatArray, bound: FloatArray
) -> tuple[FloatArray, FloatArray, tuple[str, ...]]:
    """(v (size,), c (2 n,), reasons) that meets the contact conditions to rounding, from w_Γ and motions of plates."""
    contacts, rows = problem.contacts, sparse.csr_array(problem.B)
    beyond = problem.constant + contacts.motions @ (-plates)
    stress = max(1e-300, float(np.abs(tractions).max(initial=0.0)), 1.0)
    held = _held(contacts, rows @ values + beyond, tractions, bound, stress) & problem.movable
    held[contacts.count :] &= problem.live[contacts.count :] | contacts.gathered("tied").astype(bool)
    for _ in range(3):  # a correction in a corner may push another contact line over its gap
        c = rows @ values + beyond
        values = moved(sparse.csr_array(rows[np.flatnonzero(held)]), values, (contacts.obstacle - c)[held])
        over = np.flatnonzero(_excess(problem, rows @ values + beyond) > 0.0)
        over = over[problem.movable[over] & ~held[over]]
        if not len(over):
            break
        held[over] = True
    v = problem.body.expand(values)
    c = contacts.rows @ v - contacts.motions @ plates - contacts.moved
    excess = _excess(problem, c)
    worst = float(excess.max(initial=0.0)) / max(1.0, float(np.abs(c).max(initial=0.0)))
    if worst <= _VIOLATED:
        return v, c, ()
    names = [trace.name for trace in contacts.traces for _ in range(trace.count)]
    name = names[int(np.argmax(excess)) % contacts.count]
    return v, c, (f"Prescribed displacements contradict the obstacle of {name!r}, by {worst:.1e} of their size.",)


def _excess(problem: DualProblem, c: FloatArray) -> FloatArray:
    """By how much c_N exceeds the gap (2 n,), or differs where the contact keeps its distance, and c_T its offset."""
    contacts, n = problem.contacts, problem.contacts.count
    difference = c - contacts.obstacle
    bilateral, tied = contacts.gathered("bilateral").astype(bool), contacts.gathered("tied").astype(bool)
    normal = np.where(bilateral, np.abs(difference[:n]), np.maximum(difference[:n], 0.0))
    slipping = contacts.gathered("slipping")
    backwards = np.where(np.isnan(slipping), 0.0, np.maximum(-slipping * difference[n:], 0.0))
    return np.concatenate([normal, np.where(tied | (slipping == 0.0), np.abs(difference[n:]), backwards)])
