"""`report_of`: the report of a written result, as data."""

import os
from pathlib import Path
from typing import Any


def report_of(path: "str | os.PathLike[str]") -> dict[str, Any]:
    """Report of a written result: title, verdict, sections, tables, scenes, charts.

    path   directory that a command wrote, with its report.html, or a page that holds a report

    Returns the object of docs/formats/results.md, "Data of a report": SI units without suffix, columns of equal
    lengths, None for an unknown number. Raises InputError for a path without a report, a page of an older catseye,
    one that is damaged, and one of more than 64 MB unpacked.
    """
    from catseye.records.files.report_file import read_report

    return read_report(Path(path))
