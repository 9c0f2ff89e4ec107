"""The command `peers`."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import click

from comparisons.lab.options import COUNT, FiniteRange, ListCommand, json_option, out_option
from comparisons.lab.run_options import RunOptions, study_options
from comparisons.peers import LEVELS

_FOLDER = "results/peers"
_PLATE, _PIN = "plate", "pin"
_FRICTION: Final[dict[str, tuple[float, ...]]] = {_PLATE: (0.2, 0.1, 0.05, 1.0), _PIN: (0.0, 0.1)}
_CELLS: Final[dict[str, tuple[int, ...]]] = {_PLATE: (8, 16, 32), _PIN: (6, 12)}


def _shown(defaults: Mapping[str, tuple[float, ...]]) -> str:
    """Defaults of an option as the help says them."""
    plate, pin = (", ".join(map(str, defaults[problem])) for problem in (_PLATE, _PIN))
    return f"{plate}; of the pin {pin}"


@click.command(cls=ListCommand, short_help="Accuracy and cost beside displacement codes.")
@study_options(f"{_FOLDER}/peers.sqlite", timeout=300.0)
@click.option("--problem", type=click.Choice([_PLATE, _PIN]), default=_PLATE, show_default=True,
              help="The compressed plate, or the loaded pin of NAFEMS.")  # fmt: skip
@click.option("--friction", type=FiniteRange(0.0), multiple=True, show_default=_shown(_FRICTION),
              help="Coefficients of friction; may take several numbers.")  # fmt: skip
@click.option("--cells", type=COUNT, multiple=True, show_default=_shown(_CELLS),
              help="Cells along a side of equal and of corner-graded meshes, or edges of the pin in a quarter; "
              "may take several numbers.")  # fmt: skip
@click.option("--levels", type=click.IntRange(1, LEVELS), default=LEVELS, show_default=True,
              help="Number of meshes of the plate graded to the corner and to the end of the stick zone.")  # fmt: skip
@click.option("--repeat", type=COUNT, default=5, show_default=True,
              help="Largest number of repetitions within 5 s, for the plate.")  # fmt: skip
@click.option("--getfem", metavar="PYTHON", help="Python interpreter that has GetFEM, if this one has not.")
@json_option
@out_option(_FOLDER)
def peers(
    options: RunOptions,
    problem: str,
    friction: tuple[float, ...],
    cells: tuple[int, ...],
    levels: int,
    repeat: int,
    getfem: str | None,
    as_json: bool,
    out: Path,
) -> None:
    """Compare the force of the compressed plate with that of displacement codes, for its cost.

    With --problem pin it is the loaded pin of NAFEMS R0094-4: displacements and forces on the same triangles by
    NGSolve, GetFEM and this package side by side, with small strain and with finite strain.

    The codes are NGSolve (Nitsche's method, degrees 2 to 6), GetFEM (its contact brick, degrees 2 to 4), and this
    package on triangles of degree 3 to 6. Its stresses and displacements together also bound the force, under slip too.

    The meshes have equal cells, cells graded to the free corner, and cells graded to the corner and to the end of the
    stick zone. Measured are force, unknowns, time and memory. Each case runs in a process of its own, on one thread.
    For a code that is not installed the report says how to get it. On a cluster the environment variable
    PYTHON_WITH_GETFEM of each worker names its Python for GetFEM.

    \b
    Examples:
        python -m comparisons peers --getfem /usr/bin/python3
        python -m comparisons peers --problem pin --getfem /usr/bin/python3
        python -m comparisons peers --friction 0.2 --cells 8 16 --levels 3 --store small.sqlite --out results/small
    """  # noqa: D301
    from comparisons.lab.reported import run_and_report
    from comparisons.peers.pin.report import document_of as document_of_pins
    from comparisons.peers.pin.report import report as pin_report
    from comparisons.peers.pin.study import pin_study
    from comparisons.peers.report import document_of, report
    from comparisons.peers.study import GETFEM, missing_codes, peers_study
    from qvi_contact.errors import InputError

    if options.threads != 1:
        raise InputError("threads", options.threads, "leave it at 1: every code runs on one thread")
    if getfem is not None:
        os.environ[GETFEM] = getfem
    friction, cells = friction or _FRICTION[problem], cells or _CELLS[problem]
    if problem == _PIN:
        options = options.apart(f"{_FOLDER}/pin.sqlite", "")
        pins = pin_study(friction, cells, missing_codes())
        found = run_and_report(options, pins, lambda stored: pin_report(stored.rows), out)
        found.tell(document_of_pins(found.stored.rows, found.report) if as_json else None)
        return
    study = peers_study(friction, cells, repeat, levels)
    found = run_and_report(options, study, lambda stored: report(stored.rows), out)
    found.tell(document_of(found.stored.rows, found.report) if as_json else None)
