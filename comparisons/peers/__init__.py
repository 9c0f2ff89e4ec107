"""The compressed plate by displacement codes in the same run: accuracy for its cost beside this package."""

from typing import Final

LEVELS: Final = 8
"""Members of the families of meshes that are graded to corner and transition, counted from 0."""
