"""Sparse Cholesky factorisation with the dense Schur complement on a few unknowns, by whichever library is installed.

    from solvers.factorisation import factorise
    factor = factorise(K, interface)                 # S = K_ΓΓ − K_ΓI K_II⁻¹ K_IΓ in factor.schur
    reduced, state = factor.reduce(g)                # g_Γ − K_ΓI K_II⁻¹ g_I
    x = factor.expand(state, values)                 # x_Γ = values, x_I = K_II⁻¹ (g_I − K_IΓ values)

Back ends: Intel MKL's PARDISO (package mkl, extra fast), and "multifrontal", which needs SciPy alone: LAPACK on dense
fronts.
"""

from solvers.basics.front import front

__all__ = [
    "BACKENDS", "Factorisation", "FactorisationError", "available_backends", "factorise", "missing_backends", "resolve",
]  # fmt: skip

__getattr__ = front(__name__)
