"""NGSolve: the plate by Nitsche's method, the loaded pin with contact tractions as multipliers.

**The plate**, displacements of degree p. Find u with u_x = 0 on x = 0, u_y = 0 on y = 0 and for all such v

    ∫ σ(u):ε(v) dx − ∫ θ/γ σ_n(u)·σ_n(v) ds
        + ∫ [p_N (θ σ_yy(v)/γ − v_y) + p_T (θ σ_xy(v)/γ − v_x)] ds = 0,      ds on the top only,

    p_N = min(σ_yy(u) − γ (u_y + U), 0),      p_T = σ_xy(u) − γ u_x cut off at ±μ |p_N|,      γ = γ₀ p² E / h,

where σ_n = (σ_xy, σ_yy) and h is the height of the cell below. θ = 1 is the symmetric variant, θ = 0 the incomplete
one, θ = −1 the skew-symmetric one. Semismooth Newton with a line search on the residual; if that stalls, γ is raised to
its value in steps, skew-symmetric until the last. P is the reaction of the line of symmetry y = 0.

What can be saved is saved: cells away from the top are assembled once, only those below it in each step; the unknowns
inside cells are condensed; the smaller matrix is factorised by UMFPACK or PARDISO, by its size.

Source: Chouly, Fabre, Hild, Mlika, Pousin, Renard, *An overview of recent results on Nitsche's method for contact
problems*, 2017. Stresses in MPa, lengths in units of the plate.

**The pin**, displacements of degree p on arcs of degree p. Find u in both bodies and tractions (λ_n, λ_t) of degree
p − 1, continuous along the hole, so that for all v and μ

    ∫ σ(u):ε(v) dx − ∫ t v_x ds − ∫ λ_n [v_n] + λ_t [v_t] ds = 0,
    ∫ (λ_n − p_n) μ_n + (λ_t − p_t) μ_t ds = 0,       p_n = min(λ_n − ρ [u_n], 0),
                                                      p_t = λ_t − ρ [u_t] cut off at ±μ |p_n|,

where [·] is pin minus sheet along the normal of the hole and its tangent: the augmented Lagrangian of Alart and Curnier
in its non-symmetric form, by Newton's method with a line search. Plane strain; strains small, or, "finite", those of
Green and Lagrange with the same law (Saint Venant and Kirchhoff), the contact being between the same points still.
Stresses in MPa, lengths in mm.

NGSolve is loaded by what builds a problem, not before.
"""

from collections.abc import Callable
from importlib import import_module
from typing import Any, Final

VARIANTS: Final = {"symmetric": 1.0, "incomplete": 0.0, "skew": -1.0}
"""Variant of the method → θ."""

PENALTY: Final = 2.5
"""γ₀. The symmetric variant needs a few times the constant of the inverse inequality; Newton's method likes it low."""

ACCEPTED: Final = 1e-8
"""Largest residual of a solution of the plate: norm at the free unknowns over that of the reactions."""

_NEWTON_STEPS: Final = 40
_APPROACH_STEPS: Final = 8
_APPROACH_ACCURACY: Final = 1e-4
_APPROACH_FACTOR: Final = 4.0
_SHORTEST_STEP: Final = 1.0 / 64.0  # of the line search
_DECREASE: Final = 1e-4  # of the residual, relative to the step
_SMALL: Final = 700  # condensed unknowns up to which UMFPACK is the quicker one
_NEAR: Final = 1e-3  # of the lowest cell below the top: points of quadrature within this distance are on the top


def plate(case: dict[str, Any], order: int = 2, variant: str = "symmetric") -> Callable[[], dict[str, Any]]:
    """What solves the plate of a case (see `study.plate`)."""
    return NitschePlate(case, order, VARIANTS[variant]).solve


class NitschePlate:
    """Mesh, space and forms of a case; `solve` starts from zero each time."""

    def __init__(self, case: dict[str, Any], order: int, theta: float) -> None:
        self._ng: Any = import_module("ngsolve")
        self._np: Any = import_module("numpy")
        self._ng.SetNumThreads(1)
        vertices, cells = self._np.asarray(case["vertices"]), self._np.asarray(case["cells"])
        mesh = _mesh(vertices, {"body": cells}, case["sides"])
        self._space = self._ng.VectorH1(mesh, order=order, dirichletx="left", dirichlety="bottom")
        self._theta_target, self._theta = theta, self._ng.Parameter(theta)
        self._share = self._ng.Parameter(1.0)  # of γ
        # which cells have an edge on the top, and the heights of all below the top
        y = vertices[cells][:, :, 1]
        on_top, heights = (y == y.max()).sum(axis=1) == 2, y.max() - y.min(axis=1)
        self._range = float(heights[on_top].min() / self._np.ptp(y, axis=1).max())
        by_cell = self._ng.GridFunction(self._ng.L2(mesh, order=0))
        by_cell.vec.FV().NumPy()[:] = heights
        penalty = self._share * PENALTY * order**2 * case["young"] / by_cell
        edge = float(vertices[:, 1].max() - _NEAR * heights[on_top].min())
        self._fixed, self._moving, stiffness = self._forms(case, on_top, penalty, edge)
        self._tangent = _Sum(self._np, stiffness, self._fixed, self._moving)
        self._u = self._ng.GridFunction(self._space)
        self._residual, self._part, self._step, self._trial = (self._u.vec.CreateVector() for _ in range(4))
        self._free = self._ng.Projector(self._space.FreeDofs(), True)
        self._upwards = self._ng.GridFunction(self._space)
        self._upwards.components[1].Set(1.0)
        self._iterations = 0

    def solve(self) -> dict[str, Any]:
        """Solve from zero: P/2, unknowns, Newton steps, residual, status."""
        self._iterations = 0
        self._u.vec[:] = 0.0
        residual = self._newton(_NEWTON_STEPS, ACCEPTED)
        if residual > ACCEPTED:  # again from zero, γ raised from that of the tallest cells, or below, to all of it
            self._u.vec[:] = 0.0
            self._theta.Set(VARIANTS["skew"])
            share = min(self._range, 1.0 / _APPROACH_FACTOR)
            while share < 1.0:
                self._share.Set(share)
                self._newton(_APPROACH_STEPS, _APPROACH_ACCURACY)
                share *= _APPROACH_FACTOR
            self._share.Set(1.0)
            self._theta.Set(self._theta_target)
            residual = self._newton(_NEWTON_STEPS, ACCEPTED)
        self._apply(self._u.vec)
        solved = residual <= ACCEPTED
        return {
            "status": "solved" if solved else "not converged",
            "message": "" if solved else f"residual {residual:.1e} after {self._iterations} Newton steps",
            "half_force": float(self._ng.InnerProduct(self._upwards.vec, self._residual)),
            "unknowns": sum(self._space.FreeDofs()),
            "iterations": self._iterations,
            "residual": residual,
            "version": self._ng.__version__,
        }

    def _newton(self, steps: int, accuracy: float) -> float:
        """At most so many steps; returns the residual reached."""
        norm, scale = self._evaluate(self._u.vec)
        for _ in range(steps):
            if norm <= accuracy * scale:
                break
            self._moving.AssembleLinearization(self._u.vec)
            self._find_step(self._tangent.matrix())
            self._iterations += 1
            norm, scale = self._search(norm)
        return norm / scale if scale > 0.0 else float("inf")

    def _find_step(self, matrix: Any) -> None:
        """Solve with the condensed matrix, then inside the cells."""
        free, forms = self._space.FreeDofs(True), (self._fixed, self._moving)
        # it is not symmetric
        inverse = matrix.Inverse(free, inverse="umfpack" if sum(free) <= _SMALL else "pardiso")
        for form in forms:
            self._residual.data += form.harmonic_extension_trans * self._residual
        self._step.data = inverse * self._residual
        for form in forms:
            self._step.data += form.harmonic_extension * self._step
        for form in forms:
            self._step.data += form.inner_solve * self._residual

    def _search(self, norm: float) -> tuple[float, float]:
        """Go as far along the step as the residual falls."""
        length = 1.0
        while True:
            self._trial.data = self._u.vec - length * self._step
            found, scale = self._evaluate(self._trial)
            if found <= (1.0 - _DECREASE * length) * norm or length <= _SHORTEST_STEP:
                self._u.vec.data = self._trial
                return found, scale
            length /= 2.0

    def _evaluate(self, vector: Any) -> tuple[float, float]:
        """Norms of the residual, which is left in place: at the free unknowns, and with the reactions."""
        self._apply(vector)
        scale = float(self._residual.Norm())
        self._free.Project(self._residual)
        return float(self._residual.Norm()), scale

    def _apply(self, vector: Any) -> None:
        self._fixed.Apply(vector, self._residual)
        self._moving.Apply(vector, self._part)
        self._residual.data += self._part

    def _forms(self, case: dict[str, Any], on_top: Any, gamma: Any, edge: float) -> tuple[Any, Any, Any]:
        """The form above in cells away from the top, and in those below it; the stiffness of all. Plane stress."""
        ng, theta = self._ng, self._theta
        u, v = self._space.TnT()
        shear = case["young"] / (2.0 * (1.0 + case["poisson"]))
        lame = case["young"] * case["poisson"] / (1.0 - case["poisson"] ** 2)

        def strain(w: Any) -> Any:
            return 0.5 * (ng.Grad(w) + ng.Grad(w).trans)

        def stress(w: Any) -> Any:
            return 2.0 * shear * strain(w) + lame * ng.Trace(strain(w)) * ng.Id(2)

        below, away = ng.BitArray(len(on_top)), ng.BitArray(len(on_top))
        for number, found in enumerate(on_top):
            below[number], away[number] = bool(found), not found
        (txu, tyu), (txv, tyv) = ((stress(w)[0, 1], stress(w)[1, 1]) for w in (u, v))
        pressure = _cut(ng, tyu - gamma * (u[1] + case["displacement"]), None)
        friction = _cut(ng, txu - gamma * u[0], -case["friction"] * pressure)
        nitsche = (
            pressure * (theta / gamma * tyv - v[1]) + friction * (theta / gamma * txv - v[0])
            - theta / gamma * (txu * txv + tyu * tyv)
        )  # fmt: skip
        energy = ng.InnerProduct(stress(u), strain(v))
        fixed, moving, whole = (ng.BilinearForm(self._space, condense=True) for _ in range(3))
        fixed += energy * ng.dx(definedonelements=away)
        moving += energy * ng.dx(definedonelements=below)
        # over the borders of cells, since there gradients are whole, not only along the boundary
        moving += (ng.IfPos(ng.y - edge, 1.0, 0.0) * nitsche).Compile() * ng.dx(
            element_boundary=True, definedonelements=below
        )
        whole += energy * ng.dx
        fixed.Assemble()
        whole.Assemble()
        return fixed, moving, whole


class _Sum:
    """Sum of a fixed and a moving matrix whose entries are among those of a third one."""

    def __init__(self, np: Any, pattern: Any, fixed: Any, moving: Any) -> None:
        self._np, self._form, self._fixed, self._moving = np, pattern, fixed, moving
        self._order: Any = None

    def matrix(self) -> Any:
        """The sum as the moving form is now."""
        matrix = self._form.mat
        if self._order is None:
            self._order, self._base = self._places()
        values = matrix.AsVector().FV().NumPy()
        values[:] = self._base
        values[self._order] += self._moving.mat.AsVector().FV().NumPy()
        return matrix

    def _places(self) -> tuple[Any, Any]:
        """Where the entries of the moving matrix are, and the values of the fixed one."""
        np = self._np
        keys = self._keys(self._form.mat)
        order = np.argsort(keys)
        base = np.zeros(len(keys))
        base[order[np.searchsorted(keys[order], self._keys(self._fixed.mat))]] = self._fixed.mat.AsVector().FV().NumPy()
        return order[np.searchsorted(keys[order], self._keys(self._moving.mat))], base

    def _keys(self, matrix: Any) -> Any:
        """A number for the place of each entry."""
        rows, columns, _ = matrix.COO()
        return self._np.array(rows, dtype=self._np.int64) * matrix.width + self._np.array(columns)


def _cut(ng: Any, value: Any, bound: Any) -> Any:
    """A value cut off at ± bound; without bound the negative part."""
    if bound is None:
        return ng.IfPos(value, 0.0, value)
    return ng.IfPos(value - bound, bound, ng.IfPos(-value - bound, -bound, value))


def _mesh(vertices: Any, regions: dict[str, Any], sides: dict[str, Any]) -> Any:
    """The mesh of a case, with straight edges: cells by region, edges by named side."""
    np: Any = import_module("numpy")
    meshing: Any = import_module("netgen.meshing")
    mesh = meshing.Mesh(dim=2)
    mesh.AddPoints(np.column_stack([vertices, np.zeros(len(vertices))]))
    for name, cells in regions.items():
        mesh.AddElements(dim=2, index=mesh.AddRegion(name, dim=2), data=cells.astype(np.int32), base=0)
    for name, edges in sides.items():
        mesh.AddElements(dim=1, index=mesh.AddRegion(name, dim=1), data=np.array(edges, dtype=np.int32), base=0)
    return import_module("ngsolve").Mesh(mesh)


ACCEPTED_PIN: Final = 1e-11
"""Largest residual of the pin's solution: norm at the free unknowns over the force; contact equations are lengths."""

_NEWTON_STEPS_PIN: Final = 50
_SHORTEST_STEP_PIN: Final = 1.0 / 16.0  # of the line search
_FIRST: Final = 0.1  # mm that the pin is moved by before the first step, so that it touches
_STIFF: Final = 10.0  # ρ over E of the sheet by the radius


def _pin_space(ng: Any, mesh: Any, order: int) -> tuple[Any, Any]:
    """(u_x, u_y) of the sheet, (u_x, u_y) of the pin, (λ_n, λ_t), and which of these unknowns are free."""
    hole = mesh.Boundaries("hole")
    held = (("sheet", "wall"), ("sheet", "wall|axis"), ("pin", ""), ("pin", "axis|load"))
    parts = [ng.H1(mesh, order=order, definedon=mesh.Materials(body), dirichlet=sides) for body, sides in held]
    parts += [ng.H1(mesh, order=order - 1, definedon=hole) for _ in range(2)]
    space = ng.FESpace(parts)
    free = ng.BitArray(space.ndof)  # a part also counts unknowns of edges of the other body
    free.Clear()
    for number, part in enumerate(parts):
        for element in (mesh.Materials(held[number][0]) if number < len(held) else hole).Elements():
            for unknown in part.GetDofNrs(element):
                free[space.Range(number).start + unknown] = True
    return space, free & space.FreeDofs()


def pin(case: dict[str, Any], order: int = 3, finite: bool = False) -> Callable[[], dict[str, Any]]:
    """What solves the pin of a case (see `comparisons.peers.pin.plain_pin`), from zero each time.

    It tells what `comparisons.peers.pin.MEASURED` names, unknowns, Newton steps, residual, status.
    """
    ng: Any = import_module("ngsolve")
    np: Any = import_module("numpy")
    ng.SetNumThreads(1)
    vertices, cells, inside = (np.asarray(case[name]) for name in ("vertices", "cells", "pin"))
    mesh = _mesh(vertices, {"sheet": cells[~inside], "pin": cells[inside]}, case["sides"])
    hole, distance = mesh.Boundaries("hole"), ng.sqrt(ng.x**2 + ng.y**2)
    # the chords of arcs are moved out to their circles
    moves = ng.GridFunction(ng.VectorH1(mesh, order=order))
    away = (mesh.BoundaryCF(case["arcs"], default=1.0) / distance - 1.0) * ng.CF((ng.x, ng.y))
    moves.Set(away, definedon=mesh.Boundaries("|".join(case["arcs"])))
    mesh.SetDeformation(moves)

    space, free = _pin_space(ng, mesh, order)

    def work(young: float, here: Any, test: Any) -> Any:
        """Virtual work of the stresses of a body."""
        poisson = case["poisson"]
        shear, lame = young / (2.0 * (1.0 + poisson)), young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
        gradient, of_test = (ng.CF(tuple(ng.grad(each) for each in pair), dims=(2, 2)) for pair in (here, test))
        strain, turned = (gradient + gradient.trans) / 2.0, ng.Id(2)
        if finite:
            strain, turned = strain + gradient.trans * gradient / 2.0, ng.Id(2) + gradient
        stress = 2.0 * shear * strain + lame * ng.Trace(strain) * ng.Id(2)
        return ng.InnerProduct(turned * stress, of_test)

    (ax, ay, bx, by, pressure, shear), (avx, avy, bvx, bvy, of_pressure, of_shear) = space.TnT()
    form = ng.BilinearForm(space)
    for body, here, test in (("sheet", (ax, ay), (avx, avy)), ("pin", (bx, by), (bvx, bvy))):
        form += work(case["young"][body], here, test).Compile() * ng.dx(body, bonus_intorder=2)
    form += -ng.CF(case["traction"]) * bvx.Trace() * ng.ds("load")
    normal, along = ng.CF((ng.x / distance, ng.y / distance)), ng.CF((-ng.y / distance, ng.x / distance))
    apart, test = (
        ng.CF((there_x.Trace() - here_x.Trace(), there_y.Trace() - here_y.Trace()))
        for here_x, here_y, there_x, there_y in ((ax, ay, bx, by), (avx, avy, bvx, bvy))
    )
    rho = _STIFF * case["young"]["sheet"] / case["radius"]
    pushed = _cut(ng, pressure - rho * apart * normal, None)
    rubbed = _cut(ng, shear - rho * apart * along, -case["friction"] * pushed)
    contact = pressure * (test * normal) + shear * (test * along)
    contact += ((pressure - pushed) * of_pressure + (shear - rubbed) * of_shear) / rho
    form += (-contact).Compile() * ng.ds("hole", bonus_intorder=6)

    found = ng.GridFunction(space)
    residual, step, old = (found.vec.CreateVector() for _ in range(3))

    def missed() -> float:
        """Norm of the residual at the free unknowns, over the force; the residual is left in place."""
        form.Apply(found.vec, residual)
        ng.Projector(free, True).Project(residual)
        return float(residual.Norm()) / float(case["force"])

    def solve() -> dict[str, Any]:
        _ = moves  # the mesh does not keep it
        found.vec[:] = 0.0
        found.components[2].Set(_FIRST, definedon=mesh.Materials("pin"))
        norm, steps = missed(), 0
        while norm > ACCEPTED_PIN and steps < _NEWTON_STEPS_PIN:
            form.AssembleLinearization(found.vec)
            step.data = form.mat.Inverse(free, inverse="umfpack") * residual
            old.data, length, steps = found.vec, 1.0, steps + 1
            while True:  # as far along the step as the residual falls
                found.vec.data = old - length * step
                after = missed()
                if after <= (1.0 - _DECREASE * length) * norm or length <= _SHORTEST_STEP_PIN:
                    break
                length /= 2.0
            norm = after
        solved = norm <= ACCEPTED_PIN
        lambda_n, lambda_t = found.components[4:]
        (vertex,) = (each.nr for each in mesh.vertices if each.point == (case["radius"], 0.0))
        (unknown,) = space.components[0].GetDofNrs(ng.NodeId(ng.VERTEX, vertex))

        def along_hole(value: Any) -> float:
            return float(ng.Integrate(value, mesh, definedon=hole, order=2 * order + 4))

        return {
            "status": "solved" if solved else "not converged",
            "message": "" if solved else f"residual {norm:.1e} after {steps} Newton steps",
            "moved": float(found.components[0].vec[unknown]),
            "normal": -along_hole(lambda_n),
            "shear": along_hole(lambda_t),
            "carried": -along_hole(lambda_n * normal[0] - lambda_t * normal[1]),
            "unknowns": sum(free),
            "iterations": steps,
            "residual": norm,
            "version": ng.__version__,
        }

    return solve
