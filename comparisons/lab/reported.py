"""How every command that runs a study ends: rows become a report and a file, then tables or JSON on the terminal."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from comparisons.lab.report import Document, findings_of, show, write_report
from comparisons.lab.run_options import RunOptions
from comparisons.lab.study import StoredStudy, Study, read_study, write_csv
from comparisons.lab.study.rows import finite_json
from qvi_contact.basics.writing import writable_folder


@dataclass(frozen=True)
class Reported:
    """The rows of one store or several, the report of them, and the files of both."""

    studies: list[StoredStudy]
    report: Document
    written: list[Path]

    @property
    def stored(self) -> StoredStudy:
        """Of the first study."""
        return self.studies[0]

    def document(self, **more: Any) -> dict[str, Any]:
        """Declaration, findings and files, and what else there is, for JSON."""
        files = [str(path) for path in self.written]
        return {"study": self.stored.declaration, "findings": findings_of(self.report.text), **more, "files": files}

    def tell(self, document: Mapping[str, Any] | None) -> None:
        """Print the document, or without one findings and tables."""
        if document is None:
            show(self.report, self.written)
        else:
            print_json(document)


def run_and_report(
    options: RunOptions,
    study: Study,
    report_of: Callable[..., Document],
    out: Path,
    beside: Sequence[tuple[RunOptions, Study]] = (),
) -> Reported:
    """Run what is missing in the store, and write the report of its rows, and the rows, to a folder.

    `report_of` gets the `StoredStudy`, and those of the studies that belong to the same report, if there are any. A
    folder that cannot be written, and a store that cannot be used, are found before anything is run.
    """
    folder = writable_folder(out)
    parts = [(options, study), *beside]
    for chosen, each in parts:
        chosen.check(each)
    stored = [_finished(chosen, each) for chosen, each in parts]
    report = report_of(*stored)
    tables = [folder / f"{name}.csv.gz" for name in (report.name, *(each.name for _, each in beside))]
    written = [*write_report(report, folder), *tables]
    for path, found in zip(tables, stored, strict=True):
        write_csv(path, found.rows)
    return Reported(stored, report, written)


def _finished(options: RunOptions, study: Study) -> StoredStudy:
    options.run(study)
    return read_study(options.store)


def print_json(document: Mapping[str, Any]) -> None:
    """One JSON document on standard output; numbers that JSON has not are "nan", "inf" and "-inf"."""
    click.echo(json.dumps(finite_json(document), indent=1, ensure_ascii=False, allow_nan=False))
