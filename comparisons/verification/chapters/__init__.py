"""The manual's problems, a module a chapter or a part of one: bodies, known values, rows."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "curves": (
            "M", "NU", "OUTER", "ellipse", "kirsch", "kirsch_energy", "lame", "lame_energy", "sheet", "stretched",
            "zeta_of",
        ),
    },
)  # fmt: skip
