"""Displacements of a contact problem by NGSolve, with a frictional contact iteration of its own.

The module shares the problem statement and the mesh classes with the package, but nothing of `solvers`, of the Airy
functions or of the displacement model. NGSolve assembles displacements u of degree p, condensed on the Gauss-Lobatto
nodes of the contacts: stiffness S, load f, nodal forces r = Su − f. The law |r_T| ≤ μ|r_N| holds node by node. A
semismooth Newton method (Alart and Curnier) solves it; if it cycles, only half of the nodes in a wrong state change
their state. With springs of nodal compliances C the law holds for y = u + Cr, r = (1 + SC)⁻¹(Sy − f).

Each triangle of the problem's mesh is cut in three at its centre, as Hsieh, Clough and Tocher do, so that the package's
stress is one polynomial on each cell. Then the mesh is graded to corners, ends of conditions and joints, and, in two
steps, to the places where the state of the nodes changes.

The problems are those of `study.stated`: data are polynomials, conditions are along x and y, contacts are straight, do
not meet, and are unilateral or tied; joints do not end inside the body.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any, Final, NamedTuple

import numpy as np
from scipy import sparse
from scipy.linalg import block_diag
from scipy.sparse.linalg import splu

from qvi_contact import Contact, ContactProblem, Displacement, Symmetry, Traction, TriangleMesh
from qvi_contact.basics.checks import FloatArray, IntArray, evaluate
from qvi_contact.problem.conditions import components
from qvi_contact.problem.problem import direction_of
from solvers.basics.linked import linked

ng: Any = import_module("ngsolve")  # it has no types

STEPS: Final = ((3, 3, 0), (4, 2, 3), (5, 2, 3))
"""Degree, and halvings of triangles at corners and at changes of state, of each step. The last one is the answer."""

_STATES: Final = {2.0: "sticks", 3.0: "slips forwards", 1.0: "slips backwards", 4.0: "presses", 0.0: "opens"}
_STEPS: Final = 90  # most steps of Newton's method
_TURN: Final = 1e-6  # turns of the boundary below this are rounding


class NoReferenceError(RuntimeError):
    """The contact iteration did not end."""


class Reference(NamedTuple):
    """Stress of the last step at points of its mesh, and the change from the step before; forces (value, change)."""

    x: FloatArray
    y: FloatArray
    weights: FloatArray
    cells: IntArray
    stress: FloatArray
    doubt: FloatArray
    forces: dict[str, tuple[float, float]]
    states: str
    unknowns: int


def reference(problem: ContactProblem) -> Reference:
    """Solve in `STEPS`; `NoReferenceError` where that fails."""
    mesh, changes, found = _split(problem.mesh), np.zeros((0, 2)), []
    corners = _corners(problem)
    for order, at_corners, at_changes in STEPS:
        mesh = mesh.graded(corners, at_corners)
        mesh = mesh.graded(changes, at_changes) if len(changes) else mesh
        found.append(_Model(problem, mesh, order))
        changes = found[-1].solve()
    last, before = found[-1], found[-2]
    rule = ng.IntegrationRule(ng.TRIG, 2 * STEPS[-1][0] - 2)
    places = last.mesh.MapToAllElements(rule, ng.VOL)
    x, y = np.array(ng.CF((ng.x, ng.y))(places)).T
    area = np.abs(np.linalg.det(np.diff(mesh.corners, axis=1)))
    stress = np.array(last.stress(places))
    return Reference(
        x, y, np.outer(area, rule.weights).ravel(), np.repeat(mesh.parents(problem.mesh), len(rule.weights)),
        stress, stress - np.array(before.stress(before.mesh(x, y))),
        {name: (value, abs(value - before.forces[name])) for name, value in last.forces.items()}, last.states,
        last.unknowns,
    )  # fmt: skip


def _split(mesh: TriangleMesh) -> TriangleMesh:
    """Each triangle cut in three at its centre."""
    centre = len(mesh.vertices) + np.arange(mesh.cell_count)
    cells = np.concatenate([np.column_stack([mesh.cells[:, pair], centre]) for pair in ([0, 1], [1, 2], [0, 2])])
    return TriangleMesh(np.concatenate([mesh.vertices, mesh.corners.mean(axis=1)]), cells, mesh.edge_sets)


def _corners(problem: ContactProblem) -> FloatArray:
    """Vertices where stresses may be singular: ends of conditions and joints, corners except convex loaded ones."""
    mesh, sides = problem.mesh, list[tuple[int, int, bool, FloatArray]]()  # vertex, set of edges, whether held, normal
    held = {each.edges for each in problem.conditions if not isinstance(each, Traction)}
    for number, name in enumerate(dict.fromkeys(each.edges for each in problem.conditions)):
        edges = mesh.edges(name)
        for ends in (edges.first, edges.second):
            sides += [
                (at, number, name in held, normal) for at, normal in zip(ends.tolist(), edges.normal, strict=True)
            ]
    arms = np.roll(mesh.corners, -1, axis=1) - mesh.corners
    arms /= np.linalg.norm(arms, axis=2, keepdims=True)
    turns = np.arccos(np.clip(-(arms * np.roll(arms, 1, axis=1)).sum(axis=2), -1.0, 1.0))
    angles = np.bincount(mesh.cells.ravel(), turns.ravel())
    found = []
    for vertex in sorted({each[0] for each in sides}):
        _, numbers, fixed, normals = zip(*(each for each in sides if each[0] == vertex), strict=True)
        even = len(set(numbers)) == 1 and (np.array(normals) @ normals[0] > 1.0 - _TURN).all()
        mild = not any(fixed) and angles[vertex] < np.pi + _TURN
        if not mild and not (even and len(numbers) == 2):
            found.append(vertex)
    return mesh.vertices[found]


def _function(field: Any) -> Any:
    """A number or a `Polynomial` as a coefficient function of NGSolve."""
    if not callable(field):
        return ng.CF(float(field or 0.0))
    rows = enumerate(field.coefficients)
    return sum((c * ng.x**i * ng.y**j for i, row in rows for j, c in enumerate(row) if c), ng.CF(0.0))


def _lobatto(order: int) -> tuple[FloatArray, FloatArray]:
    """The order + 1 Gauss-Lobatto points on [0, 1], and their weights."""
    legendre = np.polynomial.Legendre.basis(order)
    points = np.concatenate([[-1.0], np.sort(legendre.deriv().roots().real), [1.0]])
    return (points + 1.0) / 2.0, 1.0 / (order * (order + 1) * legendre(points) ** 2)


class _Nodes(NamedTuple):
    """A contact, points (k, 2) and lengths (k,) of its nodes, and the indices of their normal displacements in y."""

    contact: Contact
    at: FloatArray
    length: FloatArray
    where: IntArray

    def values(self, name: str) -> FloatArray:
        """A field of the contact at the nodes; cohesion as a nodal force, a stiffness as a nodal compliance."""
        value = getattr(self.contact, name)
        if value is None:
            return np.zeros(len(self.at))
        values = evaluate(name, value, *self.at.T)
        if name.endswith("_stiffness"):
            return 1.0 / (values * self.length)
        return values * self.length if name == "cohesion" else values


class _Model:
    """The problem in displacements of one degree on one mesh."""

    def __init__(self, problem: ContactProblem, mesh: TriangleMesh, order: int) -> None:
        self._problem, self._order = problem, order
        self._names = list(dict.fromkeys(each.edges for each in problem.conditions))
        self._fine, self.mesh = mesh, self._made(mesh)
        given, loads = self._conditions()
        self._space = ng.FESpace([ng.H1(self.mesh, order=order, dirichlet="|".join(sides)) for sides in given])
        self._u = ng.GridFunction(self._space)
        for axis, sides in enumerate(given):
            if sides:
                here = self.mesh.Boundaries("|".join(sides))
                self._u.components[axis].Set(self.mesh.BoundaryCF(sides, default=0.0), definedon=here)
        self._assemble(loads)

    def _conditions(self) -> tuple[tuple[dict[str, Any], dict[str, Any]], dict[str, Any]]:
        """Prescribed displacements along x and along y, and tractions, by the names of their edges."""
        given: tuple[dict[str, Any], dict[str, Any]] = ({}, {})
        loads: dict[str, list[Any]] = {}
        for each in self._problem.conditions:
            stated = components(each) if isinstance(each, Displacement | Traction) else {}
            for name, field in ({"normal": 0.0} if isinstance(each, Symmetry) else stated).items():
                edges = self._fine.edges(each.edges)
                direction = direction_of(name, edges.normal, edges.tangent)[0]
                axis = int(np.abs(direction).argmax())
                value = ng.CF(direction[axis]) * _function(field)
                if isinstance(each, Traction):
                    loads.setdefault(each.edges, [ng.CF(0.0), ng.CF(0.0)])[axis] = value
                else:
                    given[axis][each.edges] = value
        return given, {name: ng.CF(tuple(parts)) for name, parts in loads.items()}

    def _made(self, mesh: TriangleMesh) -> Any:
        """The mesh for NGSolve; along joints the two sides have separate vertices."""
        inside, cells = mesh.interior, mesh.cells
        joints = [name for name in self._names if name in mesh.joint_names]
        apart = np.zeros(len(inside.first), dtype=bool)
        for name in joints:
            apart[mesh.joint_set(name)] = True

        def corner(numbers: IntArray, vertices: IntArray) -> IntArray:
            return np.asarray(3 * numbers + (cells[numbers] == vertices[:, None]).argmax(axis=1))

        kept = inside.take(~apart)
        pairs = [[corner(kept.cells[:, side], end) for end in (kept.first, kept.second)] for side in (0, 1)]
        one, other = map(np.concatenate, pairs)
        labels = linked(one, other, cells.size)
        places = np.zeros((labels.max() + 1, 3))
        places[labels, :2] = mesh.vertices[cells.ravel()]
        clockwise = np.linalg.det(np.diff(mesh.corners, axis=1)) < 0.0
        turned = np.where(clockwise[:, None], labels.reshape(-1, 3)[:, ::-1], labels.reshape(-1, 3))
        made = import_module("netgen.meshing").Mesh(dim=2)
        made.AddPoints(places)
        made.AddElements(dim=2, index=made.AddRegion("body", dim=2), data=turned.astype(np.int32), base=0)
        for name in self._names:
            edges = mesh.edges(name)
            for side in (0, 1) if name in joints else (0,):
                ends = [labels[corner(edges.cells[:, side], end)] for end in (edges.first, edges.second)]
                index = made.AddRegion(f"{name}{' beyond' * side}", dim=1)
                made.AddElements(dim=1, index=index, data=np.column_stack(ends).astype(np.int32), base=0)
        return ng.Mesh(made)

    def _assemble(self, loads: dict[str, Any]) -> None:
        """Assemble the stiffness, with unknowns inside cells condensed, and the loads."""
        problem, mesh = self._problem, self._fine
        numbers = problem.cell_materials[mesh.parents(problem.mesh)]
        constants = np.array([
            (each.young / (2.0 * (1.0 + nu)),
             each.young * nu / ((1.0 - nu**2) if flat else (1.0 + nu) * (1.0 - 2.0 * nu)),
             -each.young * each.expansion / (1.0 - nu if flat else 1.0 - 2.0 * nu))
            for each in problem.materials for nu, flat in [(each.poisson, each.plane == "stress")]
        ])[numbers]  # fmt: skip
        fields = [ng.GridFunction(ng.L2(self.mesh, order=0)) for _ in range(3)]
        for field, values in zip(fields, constants.T, strict=True):
            field.vec.FV().NumPy()[:] = values
        shear, lame, swelling = fields
        at_rest = swelling * _function(problem.temperature) * ng.Id(2)

        def strain(parts: Any) -> Any:
            gradient = ng.CF(tuple(ng.grad(each) for each in parts), dims=(2, 2))
            return (gradient + gradient.trans) / 2.0

        def elastic(e: Any) -> Any:
            return 2.0 * shear * e + lame * ng.Trace(e) * ng.Id(2)

        u, v = self._space.TnT()
        self._form = ng.BilinearForm(self._space, condense=True)
        self._form += ng.InnerProduct(elastic(strain(u)), strain(v)) * ng.dx
        self._form.Assemble()
        work, potential = ng.LinearForm(self._space), _function(problem.body_potential)
        # b = −∇φ
        work += -(potential.Diff(ng.x) * v[0] + potential.Diff(ng.y) * v[1]) * ng.dx
        work += -ng.InnerProduct(at_rest, strain(v)) * ng.dx(bonus_intorder=4)
        for name, load in loads.items():
            work += (load[0] * v[0].Trace() + load[1] * v[1].Trace()) * ng.ds(name, bonus_intorder=4)
        work.Assemble()
        self._load = work.vec
        whole = elastic(strain(self._u.components)) + at_rest
        self.stress = ng.CF((whole[0, 0], whole[1, 1], whole[0, 1]))

    def solve(self) -> FloatArray:
        """Solve; return the points (k, 2) where the state of the contact nodes changes."""
        self._nodes()
        form, u, matrix = self._form, self._u, self._form.mat
        rows, columns, values = matrix.COO()
        A = sparse.csr_array((np.array(values), (np.array(rows), np.array(columns))), matrix.shape)
        free, inner = np.array(list(self._space.FreeDofs(True)), dtype=bool), self._inner
        self.unknowns = sum(self._space.FreeDofs())
        free[inner] = False
        rest = np.flatnonzero(free)
        load = u.vec.CreateVector()
        load.data = self._load + form.harmonic_extension_trans * self._load
        whole, f = u.vec.FV().NumPy(), load.FV().NumPy()
        held = whole[inner].copy()
        whole[inner] = 0.0
        f -= A @ whole
        A_RI = A[rest][:, inner]
        factors = splu(A[rest][:, rest].tocsc(), "MMD_AT_PLUS_A", 0.0, options={"SymmetricMode": True})
        S = A[inner][:, inner].toarray() - A_RI.T @ factors.solve(A_RI.toarray())
        Z, f_I = self._basis, f[inner] - A_RI.T @ factors.solve(f[rest])
        y = self._contact(Z.T @ S @ Z, Z.T @ f_I, np.linalg.solve(Z, held))
        whole[inner] = Z @ y
        whole[rest] += factors.solve(f[rest] - A_RI @ whole[inner])
        u.vec.data += form.harmonic_extension * u.vec
        u.vec.data += form.inner_solve * self._load
        return self._changes

    def _nodes(self) -> None:
        """Find the nodes along the contacts, and the matrix from nodal displacements to NGSolve's unknowns."""
        order, mesh = self._order, self.mesh
        points, weights = _lobatto(order)
        rule = ng.IntegrationRule([(s,) for s in points], weights.tolist())
        mapped = mesh.MapToAllElements(rule, ng.BND)
        scalar = self._space.components[0]
        places = np.array(ng.CF((ng.x, ng.y))(mapped)).reshape(-1, order + 1, 2)
        elements = list(scalar.Elements(ng.BND))
        dofs = np.array([list(each.dofs) for each in elements])
        one, shapes = ng.GridFunction(scalar), []
        for k in range(2, order + 1):
            one.vec.FV().NumPy()[:] = 0.0
            one.vec.FV().NumPy()[np.unique(dofs[:, k])] = 1.0
            shapes.append(np.array(one(mapped)).reshape(-1, order + 1))
        vertices = np.array([mesh.vertices[v].point for v in range(mesh.nv)])
        second = self._space.Range(1).start
        self._contacts: list[_Nodes] = []
        inner, blocks, start = list[IntArray](), [], 0
        for contact in self._problem.contacts:
            edges = self._fine.edges(contact.edges)
            n, t = edges.normal[0], edges.tangent[0]
            sides = []
            for region in (contact.edges, f"{contact.edges} beyond"):
                chosen = np.array([k for k, each in enumerate(elements) if each.mat == region], dtype=int)
                if not len(chosen):
                    continue
                chosen = chosen[np.argsort(places[chosen].mean(axis=1) @ t)]
                numbers = np.unique(dofs[chosen])
                values = np.zeros((len(numbers), len(numbers)))  # shape functions of the unknowns at the nodes
                at, length = np.zeros((len(numbers), 2)), np.zeros(len(numbers))
                for e, k in enumerate(chosen):
                    along, size = np.argsort(places[k] @ t), np.ptp(places[k] @ t)
                    nodes = order * e + np.arange(order + 1)
                    at[nodes] = places[k][along]
                    length[nodes] += weights * size
                    hats = [1.0 - np.abs((at[nodes] - end) @ t) / size for end in vertices[dofs[k, :2]]]
                    own = np.column_stack([*hats, *(shape[k][along] for shape in shapes)])
                    values[np.ix_(nodes, np.searchsorted(numbers, dofs[k]))] = own
                sides.append((numbers, np.linalg.inv(values), at, length))
            (numbers, basis, at, length), *beyond = sides
            # unknowns: normal and tangential displacement (relative on joints), then x and y of the far side
            turned = np.block([[n[i] * basis, t[i] * basis] for i in (0, 1)])
            inner += [numbers, second + numbers]
            if beyond:
                far, basis_far, *_ = beyond[0]
                inner += [far, second + far]
                both, other = block_diag(basis, basis), block_diag(basis_far, basis_far)
                turned = np.block([[turned, both], [np.zeros((len(other), len(turned))), other]])
            blocks.append(turned)
            self._contacts.append(_Nodes(contact, at, length, start + np.arange(len(numbers))))
            start += turned.shape[1]
        self._inner = np.concatenate(inner)
        self._basis = np.asarray(block_diag(*blocks))

    def _contact(self, S: FloatArray, f: FloatArray, known: FloatArray) -> FloatArray:
        """The nodal displacements u whose forces Su − f obey the law; `known` has the displacements of held nodes."""
        free, where = self._space.FreeDofs(), [each.where for each in self._contacts]
        share_held = abs(self._basis.T) @ np.array([float(not free[k]) for k in self._inner.tolist()])
        is_held = share_held > _TURN
        N, T = np.concatenate(where), np.concatenate([each + len(each) for each in where])
        gap, offset, friction, cohesion, normal_compliance, shear_compliance = (
            np.concatenate([each.values(name) for each in self._contacts])
            for name in ("gap", "offset", "friction", "cohesion", "normal_stiffness", "tangential_stiffness")
        )
        is_tied = np.concatenate([np.full(len(each.where), each.contact.law == "tied") for each in self._contacts])
        C = np.zeros(len(f))
        C[N], C[T] = normal_compliance, shear_compliance
        C[is_held] = 0.0
        S, f = (np.asarray(np.linalg.solve(np.eye(len(f)) + S * C, each), np.float64) for each in (S, f))
        is_closed, slip_direction = np.ones(len(N), dtype=bool), np.zeros(len(N))
        stiff, dice = S.diagonal(), np.random.default_rng(0)
        for step in range(_STEPS):
            M, b = S.copy(), f.copy()

            def prescribe(rows: IntArray, values: FloatArray, M: FloatArray = M, b: FloatArray = b) -> None:
                M[rows], b[rows] = 0.0, values
                M[rows, rows] = 1.0

            is_slipping, is_pressed = slip_direction != 0.0, is_closed & ~is_held[N]
            coupled = is_slipping & is_pressed & (friction > 0.0)
            factor = (slip_direction * friction)[coupled]
            b[T] -= slip_direction * cohesion
            M[T[coupled]] -= factor[:, None] * S[N[coupled]]
            b[T[coupled]] -= factor * f[N[coupled]]
            prescribe(N[is_closed], gap[is_closed])
            prescribe(T[~is_slipping], offset[~is_slipping])
            prescribe(np.flatnonzero(is_held), known[is_held])
            y: FloatArray = np.asarray(np.linalg.solve(M, b), np.float64)
            r = S @ y - f
            pressure = np.where(is_held[N], 0.0, np.maximum(-r[N], 0.0))
            bound = np.where(is_tied, np.inf, cohesion + friction * pressure)
            trial_shear = -r[T] + stiff[T] * (y[T] - offset)
            trial_pressure = np.where(is_tied, 1.0, -r[N] + stiff[N] * (y[N] - gap))
            state = np.where(np.abs(trial_shear) < bound, 0.0, np.where(trial_shear < 0.0, -1.0, 1.0))
            state[(state == -slip_direction) & (bound > 0.0)] = 0.0  # a node sticks before it slips back
            wrong = np.flatnonzero((is_closed != (trial_pressure > 0.0)) | (slip_direction != state))
            if not len(wrong):
                break
            if step >= _STEPS // 6:  # probably a cycle: change half of the nodes, by chance
                wrong = wrong[dice.random(len(wrong)) < 0.5]
            is_closed[wrong], slip_direction[wrong] = trial_pressure[wrong] > 0.0, state[wrong]
        else:
            raise NoReferenceError("the contact iteration did not end")
        self.forces, changes, states = {}, [], set[str]()
        for each in self._contacts:
            chosen = np.isin(N, each.where)
            normal, shear = (np.where(is_held[rows], 0.0, r[rows])[chosen] for rows in (N, T))
            self.forces[f"{each.contact.name}.normal_force"] = float(-normal.sum())
            self.forces[f"{each.contact.name}.tangential_force"] = float(shear.sum())
            has_friction = is_tied | (friction > 0.0) | (cohesion > 0.0)
            state = np.where(is_closed, np.where(has_friction, 2.0 + slip_direction, 4.0), 0.0)[chosen]
            states |= {_STATES[value] for value in np.unique(state).tolist()}
            state[is_held[N][chosen] | is_held[T][chosen]] = np.nan
            changed = np.flatnonzero(np.abs(np.diff(state)) > 0.0)
            changes.append((each.at[changed] + each.at[changed + 1]) / 2.0)
        self.states = ", ".join(name for name in _STATES.values() if name in states)
        self._changes = np.concatenate(changes)
        return y - C * r
