"""What every method uses: types, checks, statuses, progress and calls of other libraries."""

from solvers.basics.front import front

__getattr__ = front(__name__)
