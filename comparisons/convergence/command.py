"""The command `convergence`."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from comparisons.lab.options import json_option, out_option
from comparisons.lab.run_options import RunOptions, study_options
from qvi_contact.basics.terminal import Command

if TYPE_CHECKING:
    from comparisons.lab.study import Study

NAMES: Final = ("mesh", "outer", "uzawa")
"""The studies; each is a package beside this module."""

SCHEMA: Final = "qvi-contact/convergence/1"

_FOLDER: Final = "results/convergence"


@click.command(cls=Command, short_help="How answers converge with the mesh and with iterations.")
@click.argument("names", metavar="[STUDY]...", nargs=-1, type=click.Choice(NAMES))
@study_options(_FOLDER, timeout=600.0, folder=True)
@click.option("--quick", is_flag=True, help="Few and small cases, kept in other files.")
@out_option(_FOLDER)
@json_option
def convergence(run: RunOptions, names: tuple[str, ...], quick: bool, out: Path, as_json: bool) -> None:
    """Measure how answers converge, with the mesh and with the iterations.

    \b
    mesh   errors of forces, energy, tractions and stick zones on uniform, graded and adaptive meshes
    outer  iterations over the friction bound against μ: plain, damped, Anderson's, and the condensed method
    uzawa  the paper's iteration: which steps are stable, and how many iterations it needs

    Without STUDY all three are run. Finished cases are kept in --store. An interrupted run goes on where it stopped,
    and a report can be written again without computing anything. Two workers take about half the time.

    \b
    Examples:
        python -m comparisons convergence --quick
        python -m comparisons convergence mesh --workers 2 --out results/convergence
    """  # noqa: D301
    from comparisons.lab.reported import print_json
    from qvi_contact.basics.writing import writable_folder

    _check_store(run.store)
    writable_folder(out)
    chosen = dict.fromkeys(names or NAMES)
    studies = {name: import_module(f"comparisons.convergence.{name}.study").study(quick) for name in chosen}
    runs = {name: run.inside(f"{name}{'_quick' if quick else ''}.sqlite") for name in studies}
    for name, study in studies.items():
        runs[name].check(study)
    documents = [_done(name, study, runs[name], quick, out, as_json) for name, study in studies.items()]
    if as_json:
        print_json({"schema": SCHEMA, "quick": quick, "studies": documents})


def _check_store(folder: Path) -> None:
    """A file in the place of the folder, or no name at all, is found before anything is computed."""
    from qvi_contact.errors import InputError

    if folder == Path() or (folder.exists() and not folder.is_dir()):
        raise InputError("--store", str(folder), "give the name of a folder")


def _done(name: str, study: Study, run: RunOptions, quick: bool, out: Path, as_json: bool) -> dict[str, Any]:
    """Run what is missing, write the report, show it; the JSON of it."""
    from comparisons.lab.reported import run_and_report

    report = import_module(f"comparisons.convergence.{name}.report").report
    found = run_and_report(run, study, lambda stored: report(stored.rows, quick), out)
    if not as_json:
        found.tell(None)
    return {"name": name, **found.document(rows=[row.flat() for row in found.stored.rows])}
