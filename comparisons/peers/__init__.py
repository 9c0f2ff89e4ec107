"""The compressed plate by displacement codes beside this package: accuracy for its cost."""

from typing import Final

LEVELS: Final = 8
"""Members of the families of meshes that are graded to corner and transition, counted from 0."""
