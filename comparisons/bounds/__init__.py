"""Bounds of the package against displacements of degree 5 by NGSolve, on generated problems."""
