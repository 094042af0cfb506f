"""Certificate of calibration: one page to read, print and sign."""

import math
from collections.abc import Iterator
from datetime import datetime
from html import escape
from typing import Any, cast

from catseye.gateways.calibrations.certificate_figure import calibration_figure
from catseye.gateways.calibrations.certificate_record import record_lines
from catseye.gateways.writers.drawing import svg
from catseye.gateways.writers.objects import versions
from catseye.gateways.writers.page import folded, page, paragraph, picture, section, table
from catseye.gateways.writers.verdict import verdict_line
from catseye.reduction.calibrations.calibration import Calibration, Quantity
from catseye.reduction.calibrations.check_outcome import CheckOutcome

TITLE = "Certificate of calibration"
MARK = f"<title>{TITLE}"  # identifies a page of catseye
MOST_NAMED = 12  # readings named at most
SIGNATURES = ("measured by", "checked by", "approved by")
LINES = """<style>
.sign { display: grid; grid-template-columns: repeat(3, 1fr); gap: 2.2rem; margin: 3.4rem 0 1rem; }
.sign div { border-top: 1px solid var(--ink); padding-top: .3rem; font-size: .85rem; color: var(--faint); }
dl.head { grid-template-columns: 11rem 1fr; margin: .8rem 0; gap: .2rem 1rem; font-size: .95rem; }
@media print { .sign { break-inside: avoid; } }
</style>"""
HEAD = {
    "instrument": "instrument",
    "serial": "serial",
    "measured_on": "measured on",
    "valid_until": "valid until",
    "by": "measured by",
    "report": "report",
}


def certificate(calibration: Calibration, when: datetime) -> str:
    """HTML page of the certificate.

    calibration   the calibration
    when          UTC, of the computation
    """
    provenance = calibration.provenance
    rows = "".join(f"<dt>{name}</dt><dd>{escape(str(provenance[key]))}</dd>" for key, name in HEAD.items())
    body = [
        LINES,
        f'<header><h1>{TITLE}</h1><div class="faint">{escape(calibration.title)}</div></header>',
        verdict_line(calibration.verdict),
        f'<dl class="head">{rows}</dl>',
        _results(calibration),
        section("method", "Method", paragraph(calibration.method)),
        _tests(calibration),
        section("figure", "Readings and residuals", picture(svg(calibration_figure(calibration)), calibration.title)),
        _notes(calibration),
        _readings(calibration),
        _inputs(calibration, when),
        '<div class="sign">' + "".join(f"<div>{name}, date, signature</div>" for name in SIGNATURES) + "</div>",
    ]
    return page(f"{TITLE}: {calibration.title}", "\n".join(body))


def rounded(value: float, u: float) -> tuple[str, str]:
    """Value and u as text: u with two digits, the value to the same decimal place.

    >>> rounded(180.68514159, 0.00545), rounded(-173.7, 12.0), rounded(1.5, 0.0)
    (('180.6851', '0.0054'), ('-174', '12'), ('1.5', '0'))
    """
    if not (math.isfinite(value) and math.isfinite(u)):
        return f"{value:g}", "unknown"
    if u <= 0.0:
        return f"{value:.12g}", "0"
    places = max(0, 1 - math.floor(math.log10(u)))
    if float(f"{u:.1e}") >= 10.0 ** (2 - places) and places > 0:  # 0.0996 rounds up to 0.10, one digit fewer
        places -= 1
    return f"{value:.{places}f}", f"{u:.{places}f}"


def _results(calibration: Calibration) -> str:
    return section(
        "results",
        "Results",
        table(
            ("quantity", "value", "u", "k", "U = k u", "interval", "unit", "description"),
            [_result(q) for q in calibration.quantities],
            "tnnnnntw",
        ),
        paragraph(
            "u is the standard uncertainty (1σ) of all known causes, U = k u the expanded uncertainty; the "
            "interval contains the quantity with a probability of about 95 %. k is 2 for a normal quantity, more if u "
            "is based on few readings (Student).",
            "faint",
        ),
        _correlations(calibration),
        _to_copy(calibration.record),
    )


def _result(q: Quantity) -> tuple[str, ...]:
    value, u = rounded(q.value, q.u)
    places = len(value.partition(".")[2])
    low, high = q.value - q.coverage * q.u, q.value + q.coverage * q.u
    return (
        q.key,
        value,
        u,
        f"{q.coverage:.2f}",
        f"{q.coverage * q.u:.{places}f}",
        f"{low:.{places}f} to {high:.{places}f}",
        q.unit,
        q.meaning,
    )


def _correlations(calibration: Calibration) -> str:
    """Correlation coefficients, if there are several quantities."""
    if len(calibration.quantities) < 2:
        return ""
    u = [q.u or 1.0 for q in calibration.quantities]
    rows = [
        (f"{i + 1}  {q.key}", *(f"{calibration.covariance[i, j] / (u[i] * u[j]):+.3f}" for j in range(len(u))))
        for i, q in enumerate(calibration.quantities)
    ]
    return "<h3>Correlation</h3>" + table(("", *(str(j + 1) for j in range(len(u)))), rows, "t" + "n" * len(u))


def _to_copy(record: dict[str, Any]) -> str:
    if not record:
        return ""
    lines = "\n".join(record_lines(_readable(record)))
    return f"<h3>For the instrument's record</h3><pre>{escape(lines)}</pre>"


def _readable(value: Any) -> Any:
    """Numbers to nine digits, far below any uncertainty; the record file has full precision."""
    if isinstance(value, dict):
        return {key: _readable(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_readable(item) for item in value]
    return float(f"{value:.9g}") if isinstance(value, float) else value


def _tests(calibration: Calibration) -> str:
    rows = [
        (d.name, _number(d.statistic, ".4g"), _limit(d), _outcome(d), d.text)
        for d in (*calibration.decisions, *calibration.plausible)
    ]
    degrees = (
        f"Variance factor {calibration.variance_factor:.3g} from {calibration.degrees_of_freedom} degrees of freedom "
        "(expected 1)."
        if math.isfinite(calibration.variance_factor)
        else f"{calibration.degrees_of_freedom} degrees of freedom."
    )
    return section(
        "tests", "Tests", paragraph(degrees), table(("test", "value", "limit", "", "what it means"), rows, "tnntw")
    )


def _limit(decision: CheckOutcome) -> str:
    """Limit of a test with its sign, ≤ or ≥."""
    text = _number(decision.limit, ".4g")
    return text if decision.limit != decision.limit else f"{'≥' if decision.least else '≤'} {text}"


def _outcome(decision: CheckOutcome) -> str:
    return "–" if decision.passed is None else "passed" if decision.passed else "FAILED"


def _notes(calibration: Calibration) -> str:
    lines = "".join(f"<li>{escape(note)}</li>" for note in calibration.notes)
    return section("notes", "Notes", f'<ul class="notes">{lines}</ul>') if lines else ""


def _readings(calibration: Calibration) -> str:
    kinds = "".join("t" if isinstance(cell, str) else "n" for cell in calibration.rows[0])
    forms = [_form(name) for name in calibration.columns]
    rows = [tuple(_cell(cell, form) for cell, form in zip(row, forms, strict=True)) for row in calibration.rows]
    return section("readings", f"{len(rows)} readings", table(calibration.columns, rows, kinds))


def _inputs(calibration: Calibration, when: datetime) -> str:
    provenance = calibration.provenance
    sheet, hashes = (cast(dict[str, object], provenance[key]) for key in ("sheet", "inputs_sha256"))
    settings = [(key, str(value)) for key, value in sheet.items()]
    return section(
        "provenance",
        "Provenance",
        paragraph(f"Computed {when:%Y-%m-%d %H:%M:%S} UTC by catseye {versions()['catseye']}."),
        table(("input", "SHA-256"), [(name, str(digest)) for name, digest in hashes.items()], "th"),
        "<h3>Stated in the sheet</h3>",
        table(("key", "value"), settings, "tt"),
        folded("Programs", table(("part", "version"), list(versions().items()), "tt")),
    )


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


def test_line(decision: CheckOutcome) -> str:
    """One test as a line: number, limit, outcome and meaning.

    A comparison that chose a model has no outcome other than its text.

    >>> test_line(CheckOutcome("cyclic order 1: F", 1816.0, 4.541, None, "significant: kept"))
    'cyclic order 1: F 1816, limit 4.541: significant: kept'
    """
    if decision.passed is None:
        values = f" {decision.statistic:.4g}, limit {decision.limit:.4g}" if decision.comparison else ""
        return f"{decision.name}{values}: {'' if values else 'not judged; '}{decision.text}"
    outcome = "passed" if decision.passed else "FAILED"
    numbers = f" {decision.comparison}" if decision.comparison else ""
    return f"{decision.name}{numbers}: {outcome}; {decision.text}"


def passages(calibration: Calibration) -> Iterator[tuple[str, str]]:
    """Title and text of each paragraph that a terminal shows of a calibration."""
    provenance = calibration.provenance
    yield (
        "Calibration",
        f"{calibration.title}; serial {provenance['serial']}, measured on {provenance['measured_on']} by "
        f"{provenance['by']}, valid until {provenance['valid_until']}.",
    )
    for number, q in enumerate(calibration.quantities):
        value, u = rounded(q.value, q.u)
        yield "" if number else "Found", f"{q.key} = {value}, u {u} {q.unit}: {q.meaning}"
    for number, decision in enumerate((*calibration.decisions, *calibration.plausible)):
        yield "" if number else "Tests", test_line(decision)
    odd = [f"{number} ({state})" for number, state in enumerate(calibration.states, start=1) if state != "used"]
    if odd:
        more = f" and {len(odd) - MOST_NAMED} more" if len(odd) > MOST_NAMED else ""
        yield "Readings", f"{len(calibration.rows)}, of which {', '.join(odd[:MOST_NAMED])}{more}"
    elif calibration.states:
        yield "Readings", f"{len(calibration.rows)}, all used"
    for number, note in enumerate(calibration.notes):
        yield "" if number else "Notes", note
