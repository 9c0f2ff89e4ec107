"""Solvers compared on frictional contact: inner problems, sequences of them, and whole outer loops."""
