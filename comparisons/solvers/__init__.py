"""Solvers of quadratic and conic programs compared on frictional contact, judged by the certificate of the package."""
