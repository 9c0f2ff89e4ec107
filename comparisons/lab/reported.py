"""How every command that runs a study ends: rows become a report and a file, then tables or JSON on the terminal."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from comparisons.lab.report import Document, findings_of, show, write_report
from comparisons.lab.study import RunOptions, StoredStudy, Study, read_study, write_csv
from comparisons.lab.study.rows import finite_json
from qvi_contact.basics.writing import writable_folder


@dataclass(frozen=True)
class Reported:
    """The rows of a store, the report of them, and the files of both."""

    stored: StoredStudy
    report: Document
    written: list[Path]

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
    options: RunOptions, study: Study, report_of: Callable[[StoredStudy], Document], out: Path
) -> Reported:
    """Run what is missing in the store, and write the report of its rows, and the rows, to a folder.

    A folder that cannot be written is found before anything is run.
    """
    folder = writable_folder(out)
    options.run(study)
    stored = read_study(options.store)
    report = report_of(stored)
    written = [*write_report(report, folder), folder / f"{report.name}.csv.gz"]
    write_csv(written[-1], stored.rows)
    return Reported(stored, report, written)


def print_json(document: Mapping[str, Any]) -> None:
    """One JSON document on standard output; numbers that JSON has not are "nan", "inf" and "-inf"."""
    click.echo(json.dumps(finite_json(document), indent=1, ensure_ascii=False, allow_nan=False))
