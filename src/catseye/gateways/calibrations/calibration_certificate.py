"""Certificate of a calibration from a table of readings: its tests, figure, readings and record."""

import math
from typing import Any, cast

from catseye.gateways.calibrations.certificate_figure import calibration_figure
from catseye.gateways.calibrations.certificate_record import record_lines
from catseye.gateways.certificates.document import Block, CellTable, Chapter, Listing, Paragraph, SvgPicture
from catseye.gateways.certificates.statement import CertifiedSubject
from catseye.gateways.writers.drawing import svg
from catseye.reduction.calibrations.calibration import Calibration
from catseye.reduction.calibrations.check_outcome import CheckOutcome


def calibration_subject(calibration: Calibration) -> CertifiedSubject:
    """Calibration as a certificate shows it."""
    provenance = calibration.provenance
    return CertifiedSubject(
        title=calibration.title,
        identity=provenance,
        verdict=calibration.verdict,
        quantities=calibration.quantities,
        method=calibration.method,
        conventions=(),
        covariance=calibration.covariance,
        conditions=calibration.conditions,
        chapters=(
            _tests(calibration),
            Chapter("figure", "Readings and residuals", _pictures(calibration)),
            _readings(calibration),
            *_to_copy(calibration.record),
        ),
        hashes=cast(dict[str, str], provenance["inputs_sha256"]),
        settings=cast(dict[str, object], provenance["sheet"]),
    )


def _tests(calibration: Calibration) -> Chapter:
    degrees = (
        f"Variance factor {calibration.variance_factor:.3g} from {calibration.degrees_of_freedom} degrees of freedom "
        "(expected 1)."
        if math.isfinite(calibration.variance_factor)
        else f"{calibration.degrees_of_freedom} degrees of freedom."
    )
    notes = tuple(Paragraph(f"Note: {note}.") for note in calibration.notes)
    outcomes = tests_grid((*calibration.decisions, *calibration.plausible))
    return Chapter("tests", "Tests of the readings", (Paragraph(degrees), outcomes, *notes))


def tests_grid(outcomes: tuple[CheckOutcome, ...]) -> CellTable:
    """Tests with value, limit and outcome."""
    rows = tuple((o.name, _number(o.statistic, ".4g"), _limit(o), _outcome(o), o.text) for o in outcomes)
    return CellTable(("test", "value", "limit", "outcome", "what it means"), "wnntw", rows)


def _limit(decision: CheckOutcome) -> str:
    """Limit of a test with its sign, ≤ or ≥."""
    text = _number(decision.limit, ".4g")
    return text if decision.limit != decision.limit else f"{'≥' if decision.least else '≤'} {text}"


def _outcome(decision: CheckOutcome) -> str:
    return "–" if decision.passed is None else "passed" if decision.passed else "FAILED"


def _pictures(calibration: Calibration) -> tuple[Block, ...]:
    return (SvgPicture(svg(calibration_figure(calibration)), calibration.title),)


def _readings(calibration: Calibration) -> Chapter:
    kinds = "".join("t" if isinstance(cell, str) else "n" for cell in calibration.rows[0])
    forms = [_form(name) for name in calibration.columns]
    rows = tuple(tuple(_cell(cell, form) for cell, form in zip(row, forms, strict=True)) for row in calibration.rows)
    return Chapter("readings", f"{len(rows)} readings", (CellTable(calibration.columns, kinds, rows),))


def _to_copy(record: dict[str, Any]) -> tuple[Chapter, ...]:
    if not record:
        return ()
    lines = tuple(record_lines(_readable(record)))
    return (Chapter("record", "For the instrument's record", (Listing("Keys and values to copy", lines),)),)


def _readable(value: Any) -> Any:
    """Numbers to nine digits, far below any uncertainty; the record file has full precision."""
    if isinstance(value, dict):
        return {key: _readable(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_readable(item) for item in value]
    return float(f"{value:.9g}") if isinstance(value, float) else value


def _form(column: str) -> str:
    """Number format of a column: lengths to 0.1 µm or finer, statistics with two decimals."""
    if column.endswith(("_m", "_mm")):
        return ".7f" if column.endswith("_m") else ".5f"
    if column.split("|")[-1] in ("w", "tau", ""):
        return ".2f"
    return "+.3f" if column.startswith("residual") else ".7g"


def _cell(value: Any, form: str) -> str:
    return value if isinstance(value, str) else _number(value, form)


def _number(value: float, form: str) -> str:
    if not math.isfinite(value):
        return "–"
    return str(value) if isinstance(value, int) else format(value, form)
