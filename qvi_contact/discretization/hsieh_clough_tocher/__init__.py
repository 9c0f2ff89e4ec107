"""Airy functions of Hsieh-Clough-Tocher elements on meshes of triangles."""
