"""Finite elements for the Airy stress function, one file each, and the polynomials they are made of."""
