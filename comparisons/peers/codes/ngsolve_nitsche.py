"""The plate with NGSolve: displacements of degree p on quadrilaterals, Nitsche's method for contact with friction.

Find u with u_x = 0 on x = 0, u_y = 0 on y = 0 and for all such v

    ∫ σ(u):ε(v) dx − ∫ θ/γ σ_n(u)·σ_n(v) ds
        + ∫ [p_N (θ σ_yy(v)/γ − v_y) + p_T (θ σ_xy(v)/γ − v_x)] ds = 0,      ds on the top only,

    p_N = min(σ_yy(u) − γ (u_y + U), 0),      p_T = σ_xy(u) − γ u_x cut off at ±μ |p_N|,      γ = γ₀ p² E / h,

where σ_n = (σ_xy, σ_yy) and h is the height of the topmost cells. θ = 1 is the symmetric variant, θ = 0 the incomplete
one, θ = −1 the skew-symmetric one. Semismooth Newton with a line search on the residual; if that stalls, γ is raised to
its value in steps, skew-symmetric until the last. P is the reaction of the line of symmetry y = 0.

Source: Chouly, Fabre, Hild, Mlika, Pousin, Renard, *An overview of recent results on Nitsche's method for contact
problems*, 2017. Stresses in MPa, lengths in units of the plate. NGSolve is loaded by `build`, not before.
"""

from collections.abc import Iterator, Sequence
from importlib import import_module
from typing import Any, Final

MODULE: Final = "ngsolve"

VARIANTS: Final = {"symmetric": 1.0, "incomplete": 0.0, "skew": -1.0}
"""Variant of the method → θ."""

PENALTY: Final = 2.5
"""γ₀. The symmetric variant needs a few times the constant of the inverse inequality; Newton's method likes it low."""

ACCEPTED: Final = 1e-9
"""Largest residual of a solution: norm at the free unknowns over that of the reactions."""

_STEPS: Final = 40
_APPROACH_STEPS: Final = 8
_APPROACH_ACCURACY: Final = 1e-4
_APPROACH_FACTOR: Final = 4.0
_SHORTEST: Final = 1.0 / 64.0  # step of the line search
_DECREASE: Final = 1e-4  # of the residual, relative to the step


def build(case: dict[str, Any], order: int = 2, variant: str = "symmetric") -> "NitschePlate":
    """The plate of a case (see `cases`), ready to be solved."""
    return NitschePlate(case, order, VARIANTS[variant])


class NitschePlate:
    """Mesh, space and form of a case; `solve` starts from zero each time."""

    def __init__(self, case: dict[str, Any], order: int, theta: float) -> None:
        self._ng: Any = import_module("ngsolve")
        self._ng.SetNumThreads(1)
        self._height = case["y"][-1] - case["y"][-2]
        self._target = PENALTY * order**2 * case["young"] / self._height
        self._theta_target = theta
        self._penalty, self._theta = self._ng.Parameter(self._target), self._ng.Parameter(theta)
        mesh = _mesh(case["x"], case["y"])
        self._space = self._ng.VectorH1(mesh, order=order, dirichletx="left", dirichlety="bottom")
        self._form = self._weak_form(mesh, case)
        self._u = self._ng.GridFunction(self._space)
        self._residual, self._step, self._trial = (self._u.vec.CreateVector() for _ in range(3))
        self._free = self._ng.Projector(self._space.FreeDofs(), True)
        self._upwards = self._ng.GridFunction(self._space)
        self._upwards.components[1].Set(1.0)
        self._largest = self._height / float(max(b - a for a, b in zip(case["y"], case["y"][1:], strict=False)))
        self._iterations = 0

    def solve(self) -> dict[str, Any]:
        """Solve from zero: P/2, unknowns, Newton steps, residual, status."""
        self._iterations = 0
        self._u.vec[:] = 0.0
        residual = self._newton(_STEPS, ACCEPTED)
        if residual > ACCEPTED:
            residual = self._approached()
        self._form.Apply(self._u.vec, self._residual)
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

    def _approached(self) -> float:
        """Newton's method again from zero, with γ raised in steps."""
        self._u.vec[:] = 0.0
        self._theta.Set(VARIANTS["skew"])
        for penalty in self._penalties():
            self._penalty.Set(penalty)
            self._newton(_APPROACH_STEPS, _APPROACH_ACCURACY)
        self._penalty.Set(self._target)
        self._theta.Set(self._theta_target)
        return self._newton(_STEPS, ACCEPTED)

    def _penalties(self) -> Iterator[float]:
        """From that of the tallest cells, or below, up to γ, without γ itself."""
        penalty = min(self._largest, 1.0 / _APPROACH_FACTOR) * self._target
        while penalty < self._target:
            yield penalty
            penalty *= _APPROACH_FACTOR

    def _newton(self, steps: int, accuracy: float) -> float:
        """At most so many steps; returns the residual reached."""
        norm, scale = self._evaluate(self._u.vec)
        for _ in range(steps):
            if norm <= accuracy * scale:
                break
            self._form.AssembleLinearization(self._u.vec)
            inverse = self._form.mat.Inverse(self._space.FreeDofs(), inverse="umfpack")  # it is not symmetric
            self._step.data = inverse * self._residual
            self._iterations += 1
            norm, scale = self._search(norm)
        return norm / scale if scale > 0.0 else float("inf")

    def _search(self, norm: float) -> tuple[float, float]:
        """Go as far along the step as the residual falls."""
        length = 1.0
        while True:
            self._trial.data = self._u.vec - length * self._step
            found, scale = self._evaluate(self._trial)
            if found <= (1.0 - _DECREASE * length) * norm or length <= _SHORTEST:
                self._u.vec.data = self._trial
                return found, scale
            length /= 2.0

    def _evaluate(self, vector: Any) -> tuple[float, float]:
        """Norms of the residual, which is left in place: at the free unknowns, and with the reactions."""
        self._form.Apply(vector, self._residual)
        scale = float(self._residual.Norm())
        self._free.Project(self._residual)
        return float(self._residual.Norm()), scale

    def _weak_form(self, mesh: Any, case: dict[str, Any]) -> Any:
        """The form above; plane stress."""
        ng, gamma, theta = self._ng, self._penalty, self._theta
        u, v = self._space.TnT()
        shear = case["young"] / (2.0 * (1.0 + case["poisson"]))
        lame = case["young"] * case["poisson"] / (1.0 - case["poisson"] ** 2)

        def strain(w: Any) -> Any:
            return 0.5 * (ng.Grad(w) + ng.Grad(w).trans)

        def stress(w: Any) -> Any:
            return 2.0 * shear * strain(w) + lame * ng.Trace(strain(w)) * ng.Id(2)

        tangential, normal = (stress(u)[0, 1], stress(v)[0, 1]), (stress(u)[1, 1], stress(v)[1, 1])
        pressure = _cut(ng, normal[0] - gamma * (u[1] + case["displacement"]), None)
        friction = _cut(ng, tangential[0] - gamma * u[0], -case["friction"] * pressure)
        # with skeleton, gradients on the boundary are whole, not only along it
        top = ng.ds(skeleton=True, definedon=mesh.Boundaries("top"))
        form = ng.BilinearForm(self._space)
        form += ng.InnerProduct(stress(u), strain(v)) * ng.dx
        form += -theta / gamma * (tangential[0] * tangential[1] + normal[0] * normal[1]) * top
        form += pressure * (theta / gamma * normal[1] - v[1]) * top
        form += friction * (theta / gamma * tangential[1] - v[0]) * top
        return form


def _cut(ng: Any, value: Any, bound: Any) -> Any:
    """A value cut off at ± bound; without bound the negative part."""
    if bound is None:
        return ng.IfPos(value, 0.0, value)
    return ng.IfPos(value - bound, bound, ng.IfPos(-value - bound, -bound, value))


def _mesh(x: Sequence[float], y: Sequence[float]) -> Any:
    """Quadrilaterals between grid lines; sides named bottom, right, top, left."""
    columns, rows = len(x) - 1, len(y) - 1
    meshes: Any = import_module("ngsolve.meshes")

    def place(s: float, t: float) -> tuple[float, float]:
        return float(x[round(s * columns)]), float(y[round(t * rows)])

    return meshes.MakeStructured2DMesh(quads=True, nx=columns, ny=rows, mapping=place)
