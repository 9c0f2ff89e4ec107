"""Convergence: in the mesh, of the outer loop, and of the paper's Uzawa iteration."""
