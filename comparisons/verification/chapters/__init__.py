"""The manual's problems, a module a chapter or a part of one: bodies, known values, rows."""
