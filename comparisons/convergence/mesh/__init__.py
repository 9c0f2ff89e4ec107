"""Convergence in the mesh: degrees of triangles on equal, graded and adaptive meshes, and the paper's element."""
