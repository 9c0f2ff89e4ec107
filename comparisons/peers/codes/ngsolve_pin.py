"""The loaded pin with NGSolve: displacements of degree p on arcs of degree p, contact tractions as multipliers.

Find u in both bodies and tractions (λ_n, λ_t) of degree p − 1, continuous along the hole, so that for all v and μ

    ∫ σ(u):ε(v) dx − ∫ t v_x ds − ∫ λ_n [v_n] + λ_t [v_t] ds = 0,
    ∫ (λ_n − p_n) μ_n + (λ_t − p_t) μ_t ds = 0,       p_n = min(λ_n − ρ [u_n], 0),
                                                      p_t = λ_t − ρ [u_t] cut off at ±μ |p_n|,

where [·] is pin minus sheet along the normal of the hole and its tangent: the augmented Lagrangian of Alart and Curnier
in its non-symmetric form, by Newton's method with a line search. Plane strain; strains small, or, "finite", those of
Green and Lagrange with the same law (Saint Venant and Kirchhoff), the contact being between the same points still.

Stresses in MPa, lengths in mm. NGSolve is loaded by `build`, not before.
"""

from collections.abc import Callable
from importlib import import_module
from typing import Any, Final

ACCEPTED: Final = 1e-11
"""Largest residual of a solution: norm at the free unknowns over the force; equations of the contact are lengths."""

_STEPS: Final = 50
_SHORTEST: Final = 1.0 / 16.0  # step of the line search
_DECREASE: Final = 1e-4  # of the residual, relative to the step
_FIRST: Final = 0.1  # mm that the pin is moved by before the first step, so that it touches
_STIFF: Final = 10.0  # ρ over E of the sheet by the radius


def build(case: dict[str, Any], order: int = 3, finite: bool = False) -> Callable[[], dict[str, Any]]:
    """What solves the pin of a case (see `comparisons.peers.pin.study.plain_pin`)."""
    return MultiplierPin(case, order, finite).solve


class MultiplierPin:
    """Mesh, space and form of a case; `solve` starts from zero each time."""

    def __init__(self, case: dict[str, Any], order: int, finite: bool) -> None:
        self._ng: Any = import_module("ngsolve")
        self._np: Any = import_module("numpy")
        self._ng.SetNumThreads(1)
        self._case, self._order, self._finite = case, order, finite
        self._mesh = self._made()
        self._curve()
        self._space, self._free = self._spaces()
        self._form = self._forms()
        self._found = self._ng.GridFunction(self._space)
        self._residual, self._step, self._old = (self._found.vec.CreateVector() for _ in range(3))

    def solve(self) -> dict[str, Any]:
        """Solve from zero: what `pin.study.MEASURED` names, unknowns, Newton steps, residual, status."""
        self._found.vec[:] = 0.0
        self._found.components[2].Set(_FIRST, definedon=self._mesh.Materials("pin"))
        residual, iterations = self._newton()
        solved = residual <= ACCEPTED
        return {
            "status": "solved" if solved else "not converged",
            "message": "" if solved else f"residual {residual:.1e} after {iterations} Newton steps",
            **self._measured(),
            "unknowns": sum(self._free),
            "iterations": iterations,
            "residual": residual,
            "version": self._ng.__version__,
        }

    def _newton(self) -> tuple[float, int]:
        """Residual over the force, and the steps taken."""
        force, norm = self._case["force"], self._norm()
        for done in range(_STEPS):
            if norm <= ACCEPTED * force:
                return norm / force, done
            self._form.AssembleLinearization(self._found.vec)
            self._step.data = self._form.mat.Inverse(self._free, inverse="umfpack") * self._residual
            norm = self._search(norm)
        return norm / force, _STEPS

    def _search(self, norm: float) -> float:
        """Go as far along the step as the residual falls."""
        length = 1.0
        self._old.data = self._found.vec
        while True:
            self._found.vec.data = self._old - length * self._step
            found = self._norm()
            if found <= (1.0 - _DECREASE * length) * norm or length <= _SHORTEST:
                return found
            length /= 2.0

    def _norm(self) -> float:
        """Norm of the residual at the free unknowns; the residual is left in place."""
        self._form.Apply(self._found.vec, self._residual)
        self._ng.Projector(self._free, True).Project(self._residual)
        return float(self._residual.Norm())

    def _measured(self) -> dict[str, float]:
        """Displacement of the sheet where the axis meets the hole, forces along the hole."""
        ng, order = self._ng, 2 * self._order + 4
        sheet_x, _, _, _, normal, shear = self._found.components
        hole = self._mesh.Boundaries("hole")
        (vertex,) = (each.nr for each in self._mesh.vertices if each.point == (self._case["radius"], 0.0))
        (unknown,) = self._space.components[0].GetDofNrs(ng.NodeId(ng.VERTEX, vertex))
        return {
            "moved": float(sheet_x.vec[unknown]),
            "normal": -float(ng.Integrate(normal, self._mesh, definedon=hole, order=order)),
            "shear": float(ng.Integrate(shear, self._mesh, definedon=hole, order=order)),
            "carried": -float(
                ng.Integrate(normal * self._normal()[0] - shear * self._normal()[1], self._mesh, definedon=hole,
                             order=order)
            ),
        }  # fmt: skip

    def _normal(self) -> Any:
        ng = self._ng
        distance = ng.sqrt(ng.x**2 + ng.y**2)
        return ng.CF((ng.x / distance, ng.y / distance))

    def _made(self) -> Any:
        """The mesh of the case, with straight edges."""
        np, case = self._np, self._case
        meshing: Any = import_module("netgen.meshing")
        vertices, cells, inside = (np.asarray(case[name]) for name in ("vertices", "cells", "pin"))
        mesh = meshing.Mesh(dim=2)
        mesh.AddPoints(np.column_stack([vertices, np.zeros(len(vertices))]))
        for name, chosen in (("sheet", cells[~inside]), ("pin", cells[inside])):
            mesh.AddElements(dim=2, index=mesh.AddRegion(name, dim=2), data=chosen.astype(np.int32), base=0)
        for name, edges in case["sides"].items():
            mesh.AddElements(dim=1, index=mesh.AddRegion(name, dim=1), data=np.array(edges, dtype=np.int32), base=0)
        return self._ng.Mesh(mesh)

    def _curve(self) -> None:
        """Move the chords of arcs out to their circles."""
        ng = self._ng
        moves = ng.GridFunction(ng.VectorH1(self._mesh, order=self._order))
        radius = self._mesh.BoundaryCF(self._case["arcs"], default=1.0)
        away = (radius / ng.sqrt(ng.x**2 + ng.y**2) - 1.0) * ng.CF((ng.x, ng.y))
        moves.Set(away, definedon=self._mesh.Boundaries("|".join(self._case["arcs"])))
        self._mesh.SetDeformation(moves)
        self._moves = moves  # the mesh does not keep it

    def _spaces(self) -> tuple[Any, Any]:
        """(u_x, u_y) of the sheet, (u_x, u_y) of the pin, (λ_n, λ_t), and which of these unknowns are free."""
        ng, mesh, order = self._ng, self._mesh, self._order
        held = (("sheet", "wall"), ("sheet", "wall|axis"), ("pin", ""), ("pin", "axis|load"))
        parts = [ng.H1(mesh, order=order, definedon=mesh.Materials(body), dirichlet=sides) for body, sides in held]
        hole = mesh.Boundaries("hole")
        parts += [ng.H1(mesh, order=order - 1, definedon=hole) for _ in range(2)]
        space = ng.FESpace(parts)
        # a part also counts unknowns of edges of the other body
        free = ng.BitArray(space.ndof)
        free.Clear()
        for number, part in enumerate(parts):
            for element in (mesh.Materials(held[number][0]) if number < len(held) else hole).Elements():
                for unknown in part.GetDofNrs(element):
                    free[space.Range(number).start + unknown] = True
        return space, free & space.FreeDofs()

    def _forms(self) -> Any:
        ng, case = self._ng, self._case
        (ax, ay, bx, by, pressure, shear), (avx, avy, bvx, bvy, of_pressure, of_shear) = self._space.TnT()
        form = ng.BilinearForm(self._space)
        for body, here, test in (("sheet", (ax, ay), (avx, avy)), ("pin", (bx, by), (bvx, bvy))):
            form += self._work(case["young"][body], here, test).Compile() * ng.dx(body, bonus_intorder=2)
        form += -ng.CF(case["traction"]) * bvx.Trace() * ng.ds("load")
        normal = self._normal()
        apart, test = (
            ng.CF((there_x.Trace() - here_x.Trace(), there_y.Trace() - here_y.Trace()))
            for here_x, here_y, there_x, there_y in ((ax, ay, bx, by), (avx, avy, bvx, bvy))
        )
        along = ng.CF((-normal[1], normal[0]))
        rho = _STIFF * case["young"]["sheet"] / case["radius"]
        pushed, rubbed = pressure - rho * apart * normal, shear - rho * apart * along
        pushed = ng.IfPos(pushed, 0.0, pushed)
        bound = -case["friction"] * pushed
        rubbed = ng.IfPos(rubbed - bound, bound, ng.IfPos(-rubbed - bound, -bound, rubbed))
        contact = pressure * (test * normal) + shear * (test * along)
        contact += ((pressure - pushed) * of_pressure + (shear - rubbed) * of_shear) / rho
        form += (-contact).Compile() * ng.ds("hole", bonus_intorder=6)
        return form

    def _work(self, young: float, here: Any, test: Any) -> Any:
        """Virtual work of the stresses of a body."""
        ng, poisson = self._ng, self._case["poisson"]
        shear, lame = young / (2.0 * (1.0 + poisson)), young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
        gradient, of_test = (ng.CF(tuple(ng.grad(each) for each in pair), dims=(2, 2)) for pair in (here, test))
        strain, turned = (gradient + gradient.trans) / 2.0, ng.Id(2)
        if self._finite:
            strain, turned = strain + gradient.trans * gradient / 2.0, ng.Id(2) + gradient
        stress = 2.0 * shear * strain + lame * ng.Trace(strain) * ng.Id(2)
        return ng.InnerProduct(turned * stress, of_test)
