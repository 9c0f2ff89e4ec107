"""Convergence: in the mesh, of the outer loop, and of the paper's Uzawa iteration.

Each study is a package with two modules: `study`, whose function ``study(quick) -> Study`` declares it, and `report`,
whose function ``report(rows) -> Report`` makes the report from the stored rows alone.
"""
