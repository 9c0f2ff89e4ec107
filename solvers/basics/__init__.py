"""What every method uses: types, files, the words for how a solve ended."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "archives": ("LARGEST",),
        "checks": ("one_of", "real_array", "whole_number"),
        "files": ("_put",),
        "foreign": ("foreign_code",),
        "narration": ("ITERATIONS", "narrated"),
        "types": ("IntVector", "Matrix", "Vector"),
        "watch": ("Progress", "expired", "left", "tell", "watched"),
    },
)
