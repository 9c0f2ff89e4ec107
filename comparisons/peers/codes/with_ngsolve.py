"""NGSolve: the plate by Nitsche's method.

Displacements have degree p. Find u with u_x = 0 on x = 0, u_y = 0 on y = 0 and for all such v

    ∫ σ(u):ε(v) dx − ∫ θ/γ σ_n(u)·σ_n(v) ds
        + ∫ [p_N (θ σ_yy(v)/γ − v_y) + p_T (θ σ_xy(v)/γ − v_x)] ds = 0,      ds on the top only,

    p_N = min(σ_yy(u) − γ (u_y + U), 0),      p_T = σ_xy(u) − γ u_x cut off at ±μ |p_N|,      γ = γ₀ p² E / h,

where σ_n = (σ_xy, σ_yy) and h is the height of the cell below. θ = 1 is the symmetric variant, θ = 0 the incomplete
one, θ = −1 the skew-symmetric one. Semismooth Newton with a line search on the residual; if that stalls, γ is raised to
its value in steps, skew-symmetric until the last. P is the reaction of the line of symmetry y = 0.

To save time, only cells below the top are assembled in each step, all others once; the unknowns inside cells are
condensed; UMFPACK or PARDISO, by its size, factorises the remaining matrix.

Source: Chouly, Fabre, Hild, Mlika, Pousin, Renard, *An overview of recent results on Nitsche's method for contact
problems*, 2017. Stresses in MPa, lengths in units of the plate.

NGSolve is imported when a problem is built.
"""

from collections.abc import Callable
from importlib import import_module
from typing import Any, Final

VARIANTS: Final = {"symmetric": 1.0, "incomplete": 0.0, "skew": -1.0}
"""Variant of the method → θ."""

PENALTY: Final = 2.5
"""γ₀. The symmetric variant needs some times the constant of the inverse inequality; Newton's method a small γ₀."""

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
    """A function that solves the plate of a case (see `study.plate`)."""
    return NitschePlate(case, order, VARIANTS[variant]).solve


class NitschePlate:
    """Mesh, space and forms of a case; `solve` starts from zero each time."""

    def __init__(self, case: dict[str, Any], order: int, theta: float) -> None:
        self._ng: Any = import_module("ngsolve")
        self._np: Any = import_module("numpy")
        self._ng.SetNumThreads(1)
        vertices, cells = self._np.asarray(case["vertices"]), self._np.asarray(case["cells"])
        mesh = _mesh(vertices, cells, case["sides"])
        self._space = self._ng.VectorH1(mesh, order=order, dirichletx="left", dirichlety="bottom")
        self._theta_target, self._theta = theta, self._ng.Parameter(theta)
        self._share = self._ng.Parameter(1.0)  # of γ
        # cells with an edge on the top, and the distance of each cell's lowest vertex from the top
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
        if residual > ACCEPTED:  # again from zero, with γ raised in steps from that of the tallest cells, or less
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
        """Newton's method, at most so many steps; returns the relative residual."""
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
        """Solve for the step with the condensed matrix, which is not symmetric, then inside the cells."""
        free, forms = self._space.FreeDofs(True), (self._fixed, self._moving)
        inverse = matrix.Inverse(free, inverse="umfpack" if sum(free) <= _SMALL else "pardiso")
        for form in forms:
            self._residual.data += form.harmonic_extension_trans * self._residual
        self._step.data = inverse * self._residual
        for form in forms:
            self._step.data += form.harmonic_extension * self._step
        for form in forms:
            self._step.data += form.inner_solve * self._residual

    def _search(self, norm: float) -> tuple[float, float]:
        """Halve the step until the residual falls enough, and take it."""
        length = 1.0
        while True:
            self._trial.data = self._u.vec - length * self._step
            found, scale = self._evaluate(self._trial)
            if found <= (1.0 - _DECREASE * length) * norm or length <= _SHORTEST_STEP:
                self._u.vec.data = self._trial
                return found, scale
            length /= 2.0

    def _evaluate(self, vector: Any) -> tuple[float, float]:
        """Compute the residual; return its norm at the free unknowns, and its norm with the reactions."""
        self._apply(vector)
        scale = float(self._residual.Norm())
        self._free.Project(self._residual)
        return float(self._residual.Norm()), scale

    def _apply(self, vector: Any) -> None:
        self._fixed.Apply(vector, self._residual)
        self._moving.Apply(vector, self._part)
        self._residual.data += self._part

    def _forms(self, case: dict[str, Any], on_top: Any, gamma: Any, edge: float) -> tuple[Any, Any, Any]:
        """The form above in cells away from the top, and in cells below it; the stiffness of all. Plane stress."""
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
        trial_normal = tyu - gamma * (u[1] + case["displacement"])
        pressure = ng.IfPos(trial_normal, 0.0, trial_normal)
        trial_shear, bound = txu - gamma * u[0], -case["friction"] * pressure
        friction = ng.IfPos(trial_shear - bound, bound, ng.IfPos(-trial_shear - bound, -bound, trial_shear))
        nitsche = (
            pressure * (theta / gamma * tyv - v[1]) + friction * (theta / gamma * txv - v[0])
            - theta / gamma * (txu * txv + tyu * tyv)
        )  # fmt: skip
        energy = ng.InnerProduct(stress(u), strain(v))
        fixed, moving, whole = (ng.BilinearForm(self._space, condense=True) for _ in range(3))
        fixed += energy * ng.dx(definedonelements=away)
        moving += energy * ng.dx(definedonelements=below)
        # as an integral over cell borders, where NGSolve has the full gradient, not only its part along the boundary
        moving += (ng.IfPos(ng.y - edge, 1.0, 0.0) * nitsche).Compile() * ng.dx(
            element_boundary=True, definedonelements=below
        )
        whole += energy * ng.dx
        fixed.Assemble()
        whole.Assemble()
        return fixed, moving, whole


class _Sum:
    """Sum of a fixed and a moving matrix in the sparsity pattern of a third one, which contains both."""

    def __init__(self, np: Any, pattern: Any, fixed: Any, moving: Any) -> None:
        self._np, self._form, self._fixed, self._moving = np, pattern, fixed, moving
        self._order: Any = None

    def matrix(self) -> Any:
        """The sum for the present values of the moving matrix."""
        matrix = self._form.mat
        if self._order is None:
            self._order, self._base = self._places()
        values = matrix.AsVector().FV().NumPy()
        values[:] = self._base
        values[self._order] += self._moving.mat.AsVector().FV().NumPy()
        return matrix

    def _places(self) -> tuple[Any, Any]:
        """Positions of the moving matrix's entries in the pattern, and the fixed matrix's values there."""
        np = self._np
        keys = self._keys(self._form.mat)
        order = np.argsort(keys)
        base = np.zeros(len(keys))
        base[order[np.searchsorted(keys[order], self._keys(self._fixed.mat))]] = self._fixed.mat.AsVector().FV().NumPy()
        return order[np.searchsorted(keys[order], self._keys(self._moving.mat))], base

    def _keys(self, matrix: Any) -> Any:
        """A number for row and column of each entry."""
        rows, columns, _ = matrix.COO()
        return self._np.array(rows, dtype=self._np.int64) * matrix.width + self._np.array(columns)


def _mesh(vertices: Any, cells: Any, sides: dict[str, Any]) -> Any:
    """The mesh of a case, with straight edges by named side."""
    np: Any = import_module("numpy")
    meshing: Any = import_module("netgen.meshing")
    mesh = meshing.Mesh(dim=2)
    mesh.AddPoints(np.column_stack([vertices, np.zeros(len(vertices))]))
    mesh.AddElements(dim=2, index=mesh.AddRegion("body", dim=2), data=cells.astype(np.int32), base=0)
    for name, edges in sides.items():
        mesh.AddElements(dim=1, index=mesh.AddRegion(name, dim=1), data=np.array(edges, dtype=np.int32), base=0)
    return import_module("ngsolve").Mesh(mesh)
