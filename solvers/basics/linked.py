"""Connected components of a graph, such as triangles linked by edges, or contact points linked by unknowns."""

import numpy as np

from solvers.basics.types import IntVector


def lowest_linked(first: IntVector, second: IntVector, count: int) -> IntVector:
    """The lowest node (count,) of the component of each of `count` nodes, for links between nodes `first`, `second`."""
    least = np.arange(count)  # the lowest node found so far
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
    """Numbers (count,) of the components of `count` nodes, from 0 in the order of their lowest nodes."""
    least = lowest_linked(first, second, count)
    return np.unique(least, return_inverse=True)[1] if least.any() else least
