"""Numbers that the benchmark is compared with: forces of the plate, targets, and what other codes reported."""

from typing import Final, NamedTuple

from comparisons.settled import SETTLED as EVERY_SETTLED

CONVERGED: Final = {
    32: 214.10403803,
    64: 214.15964926,
    128: 214.19115763,
    256: 214.20909600,
    512: 214.21935490,
}
"""Converged P/2 of `compressed_plate` with μ = 0.2 on n × n equal cells, by n [MPa × length]."""

CONVERGED_FRICTION: Final = 0.2

SETTLED: Final = {friction: EVERY_SETTLED[friction] for friction in (0.2, 1.0)}
"""P/2 on which displacement codes settle, by μ (1: the contact sticks everywhere) [MPa × length]."""

MEANINGLESS: Final = 1e-7
"""Relative errors below this say nothing: so uncertain are the values of `SETTLED`."""

ACCURACY_TARGETS: Final = ((1e-4, 0.020), (1e-5, 0.060), (3e-6, 0.200))
"""Relative error of P/2 and the time [s] in which it should be reached, with one thread."""

GROWTH_TARGET: Final = 1.25
"""Largest exponent p of time ~ unknownsᵖ from 128² to 512² cells."""

GROWTH_SPAN: Final = (128, 512)


class Peer(NamedTuple):
    """A run of another code on the plate, μ = 0.2: cells a side, P/2 [MPa × length], reported seconds of its solve."""

    code: str
    cells: int | None
    half_force: float
    seconds: float


PEERS: Final = (
    Peer("GetFEM, Q2", 8, 214.23508, 0.02),
    Peer("GetFEM, Q2", 16, 214.23389, 0.03),
    Peer("GetFEM, Q2", 32, 214.23321, 0.45),
    Peer("GetFEM, Q2", 64, 214.23319, 1.8),
    Peer("GetFEM, Q2", 128, 214.23323, 7.0),
    Peer("GetFEM, Q2", 256, 214.23323, 38.0),
    Peer("NGSolve, Nitsche, p = 2", None, 214.23746, 0.04),
    Peer("NGSolve, Nitsche, p = 2", None, 214.23420, 0.08),
    Peer("NGSolve, Nitsche, p = 2", None, 214.23348, 0.4),
    Peer("NGSolve, Nitsche, p = 2", None, 214.23331, 2.5),
    Peer("NGSolve, Nitsche, p = 2", None, 214.23325, 10.0),
    Peer("CalculiX, mortar, C3D20", None, 214.23552, 0.43),
    Peer("CalculiX, mortar, C3D20", None, 214.23304, 2.6),
    Peer("CalculiX, mortar, C3D20", None, 214.23296, 13.0),
)
"""Reported: measured once, on another day and outside this repository, the solve alone timed. Not part of a run."""


def relative_error(half_force: float | None, cells: int, friction: float) -> float | None:
    """|P/2| error relative to `CONVERGED`; None where that has no value."""
    converged = CONVERGED.get(cells) if friction == CONVERGED_FRICTION else None
    return None if converged is None or half_force is None else abs(half_force / converged - 1.0)


def settled_error(half_force: float | None, friction: float) -> float | None:
    """|P/2| error relative to `SETTLED`; None where that has no value."""
    settled = SETTLED.get(friction)
    return None if settled is None or half_force is None else abs(half_force / settled - 1.0)
