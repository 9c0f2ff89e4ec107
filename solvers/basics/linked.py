"""Things that pairs join into sets, such as triangles by edges, or contact points by unknowns."""

import numpy as np

from solvers.basics.types import IntVector


def lowest_linked(first: IntVector, second: IntVector, count: int) -> IntVector:
    """The lowest thing (count,) that each of so many is joined to by pairs, itself if it is."""
    least = np.arange(count)  # as far as is known
    while True:
        one, other = least[first], least[second]
        apart = one != other
        if not np.count_nonzero(apart):
            return least
        one, other = one[apart], other[apart]
        np.minimum.at(least, np.maximum(one, other), np.minimum(one, other))
        while (least[least] < least).any():
            least = least[least]


def linked(first: IntVector, second: IntVector, count: int) -> IntVector:
    """Numbers (count,) of the sets into which pairs join so many things, from 0 in the order of their first things."""
    least = lowest_linked(first, second, count)
    return np.unique(least, return_inverse=True)[1] if least.any() else least
