"""Solutions as vertices, by pivoting: exact where nothing is strict, and needs no start."""
