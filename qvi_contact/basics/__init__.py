"""What every room uses: checks of input, writing of files, the terminal."""

from solvers.basics.front import front

__getattr__ = front(__name__)
