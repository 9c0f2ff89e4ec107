"""What every method uses: types, checks, the words for how a solve ended."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "checks": ("one_of", "real_array", "whole_number"),
        "foreign": ("foreign_code", "handlers_kept"),
        "progress": ("Deadline", "Log", "Progress", "deadline", "listening", "report"),
        "types": ("IntVector", "Kept", "Matrix", "Vector"),
    },
)
