"""Strict admissibility: σ_N ≤ 0 and |σ_T| ≤ thr on whole contact edges, not at their Gauss points only.

On an edge σ_N is affine: it is ≤ 0 everywhere if it is at both ends. A quadratic with Bernstein coefficients b is ≥ 0
on [0, 1] if and only if b₀, b₂ ≥ 0 and b₁ ≥ −√(b₀b₂); so with the bound θ, a quadratic as well, |σ_T| ≤ θ is two such
conditions, on θ − σ_T and θ + σ_T. Each is a rotated second-order cone with one slack.

`quadratics` has the cone and its dual, `threshold` the bound θ, `cones` the program for a given bound, `faces` its
edges whose bound is zero at an end, `direct_clarabel` and `cvxpy_cones` its back ends, `newton` the last digits,
`support` and `natural` what the certificate needs.
"""
