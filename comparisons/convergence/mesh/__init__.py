"""Convergence in the mesh: forces, energies, contact tractions, and the ends of contact and stick zones."""
