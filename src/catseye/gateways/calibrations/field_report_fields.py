"""Fields of the notes' two calibration reports as objects and text."""

from datetime import date
from typing import Any

import numpy as np

from catseye.constants import ARCSECOND, DEGREE
from catseye.gateways.calibrations.summary import rounded
from catseye.gateways.writers.passage import Passage
from catseye.reduction.calibrations.field_report import FORMS, Report, ReportField

LEAST_PLACES = 6  # decimals of a matrix, as the notes print them


def report_object(report: Report, written: str | None) -> dict[str, Any]:
    """Object that `catseye certificate --json` prints; units beside the values, null if missing.

    written   path of the page, as the user gave it
    """
    return {
        "kind": report.kind,
        "record": report.file or None,
        "sha256": report.sha256 or None,
        "fields": [
            {"name": f.entry.name, "key": f.entry.key, "value": f.value, "u": f.u, "unit": f.entry.unit or None}
            for f in report.fields
        ],
        "notes": report.notes or None,
        "missing": [entry.key for entry in report.missing],
        "written": written,
    }


def report_passages(report: Report) -> list[Passage]:
    """Title and number of the report, and the fields that its record lacks."""
    number = report.fields[0].value
    passages = [Passage("Report", FORMS[report.kind].title + (f", {number}" if number else ", blank"))]
    if report.missing:
        names = ", ".join(entry.key for entry in report.missing)
        count = f"{len(report.missing)} of {len(report.fields)}"
        passages.append(Passage("Left blank", f"{count}, not in {report.file}: {names}"))
    return passages


def written_value(field: ReportField) -> str:
    """Value with the digits that its u justifies; as in the record if u is unknown.

    >>> from catseye.reduction.calibrations.field_report import ReportEntry
    >>> at = ReportEntry("x", "x_mm", "mm")
    >>> [written_value(ReportField(at, value, u)) for value, u in ((29503.7431, 0.1), (-2.4e-5, None), (12, 0.3))]
    ['29503.74', '-0.000024', '12']
    """
    value = field.value
    if value is None:
        return ""
    if not isinstance(value, float):
        return value.isoformat() if isinstance(value, date) else str(value)
    return rounded(value, field.u)[0] if field.u else np.format_float_positional(value, trim="0")


def written_u(field: ReportField) -> str:
    """Standard uncertainty with two digits; "held" where it is zero, for a fixed coordinate."""
    if field.u is None or field.value is None:
        return ""
    return rounded(0.0, field.u)[1] if field.u else "held"


def written_aid(field: ReportField) -> str:
    """Angle in degrees, minutes and seconds, or in seconds only.

    >>> from catseye.reduction.calibrations.field_report import ReportEntry
    >>> written_aid(ReportField(ReportEntry("azimuth", "azimuth_deg", "deg", aid="dms"), 122.19722))
    '122° 11′ 50.0″'
    """
    if field.number is None or not field.entry.aid:
        return ""
    seconds = field.number * (1.0 if field.entry.unit == "rad" else DEGREE) / ARCSECOND
    if field.entry.aid == "arcsec":
        return f"{round(seconds, 1) + 0.0:+.1f}″"  # + 0.0 turns minus zero into zero
    minutes, tenths = divmod(round(abs(seconds) * 10.0), 600)
    return f"{'-' if seconds < -0.05 else ''}{minutes // 60}° {minutes % 60:02d}′ {tenths / 10.0:04.1f}″"


def written_matrix(fields: tuple[ReportField, ...]) -> list[str]:
    """Elements with the decimals of the largest u among them, at least six."""
    numbers = [field.number for field in fields if field.number is not None]
    if not numbers:
        return ["" for _ in fields]
    stated = [field.u for field in fields if field.u]
    places = max(LEAST_PLACES, len(rounded(0.0, max(stated))[0].partition(".")[2]) if stated else 0)
    return [f"{round(number, places) + 0.0:.{places}f}" for number in numbers]
