"""What every method uses: types, checks, the words for how a solve ended."""

from solvers.basics.front import front

__getattr__ = front(__name__)
