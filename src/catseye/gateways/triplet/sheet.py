"""Sheet of a triplet's calibration, text and report, replacing the spreadsheet TRPCAL."""

import math
from collections.abc import Iterator, Sequence
from datetime import datetime
from typing import Any

from catseye.gateways.triplet.symbols import PLACEMENT, PLATE, POINTS, UNIT, Symbol, point_places, symbol_values
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.report import (
    Block,
    Card,
    ChartBlock,
    ReportSection,
    ResultReport,
    TableBlock,
    Text,
    origin_section,
)
from catseye.gateways.writers.report_parts import Axis, Chart, ReportTable, number, text
from catseye.reduction.triplet.result import TOLERANCE, TripletReduction
from catseye.reduction.triplet.unit import NOT_A_TRIANGLE, SLIPPED

TITLE = "Triplet calibration"
SIDE_BY_SIDE = 3  # placements in one table of the text
SHORT = {NOT_A_TRIANGLE: "no triangle", SLIPPED: "cycles doubted"}  # status in a column of the text
PLACES = {"mm": 4, "rad": 6, "°C": 2, "hPa": 2, "%": 1}
FINE = {"alpha": 6, "n": 6, "eta_A": 9, "eta_A_fp": 9, "eta_G": 6, "HWLV": 6, "HWLA": 6, "HWLA_fp": 6,
        "dPc_1": 7, "dPc_2": 7, "margin": 1}  # fmt: skip


def results(reduction: TripletReduction) -> list[tuple[str, str]]:
    """Title and text of each paragraph on a calibration, after the verdict."""
    u_h = _plain(reduction.u_h_corr * 1e3, ".4f")
    low, high = reduction.plate.paint or (math.nan, math.nan)
    lines = [
        (
            "H_corr",
            f"{_signed(reduction.h_corr)}, u {u_h}: ball's centre above the prisms' mid-point, towards the prism side",
        ),
        (
            "L_MPBC",
            f"{reduction.l_mpbc * 1e3:+.4f} mm, u {reduction.u_l_mpbc * 1e3:.4f}: the same from the surface plate",
        ),
        (
            "Difference",
            f"{_signed(reduction.difference)}, u {_plain(reduction.u_difference * 1e3, '.4f')}; limit 0.15 mm: "
            f"{'accepted' if reduction.accepted else 'NOT ACCEPTED'}, probability of conformity "
            f"{_probability(reduction)}",
        ),
        ("Placements", _agreement(reduction)),
        (
            "Paint",
            f"{low * 1e3:.3f} to {high * 1e3:.3f} mm puts all three points within 0.15 mm of the bare top plate"
            if reduction.plate.paint
            else "no thickness puts all three points within 0.15 mm of the bare top plate",
        ),
    ]
    return lines + [("Notes" if k == 0 else "", note) for k, note in enumerate(reduction.notes)]


def _probability(reduction: TripletReduction) -> str:
    p = reduction.conformity_probability
    return (
        "unknown"
        if math.isnan(p)
        else f"{p:.4f}"
        if 5e-5 < p < 0.99995
        else "above 0.9999"
        if p > 0.5
        else "below 0.0001"
    )


def _agreement(reduction: TripletReduction) -> str:
    count = len(reduction.h)
    if not reduction.degrees_of_freedom:
        return "1, nothing to compare it with" if count == 1 else f"{count}, not enough to compare"
    agree = "agree" if reduction.p >= 0.05 else "DO NOT AGREE"
    freedom = f"{reduction.degrees_of_freedom} degrees of freedom"
    return f"{count} {agree}: chi-square {reduction.chi_square:.2f}, {freedom}, p {reduction.p:.3f}"


def cell(symbol: Symbol, value: Any) -> str:
    """Value as printed: lengths in mm.

    >>> from catseye.gateways.triplet.symbols import UNIT
    >>> cell(UNIT[4], 0.635)
    '635.0000'
    """
    if isinstance(value, int):
        return str(value)
    if not math.isfinite(value):
        return "–"
    scaled = value * 1e3 if symbol.unit == "mm" else value
    return f"{scaled:.{FINE.get(symbol.name, PLACES.get(symbol.unit, 6))}f}"


def text_sheet(reduction: TripletReduction, file: str) -> str:
    """Sheet as lines of text.

    reduction   the calibration of a unit
    file        name of its sheet
    """
    m = reduction.measurement
    lines = [
        f"TRIPLET {m.triplet}   prisms {m.left_prism.serial} (left), {m.right_prism.serial} (right)   {file}",
        f"measured on {m.measured_on} by {m.by}; lengths mm, angles rad; air by {m.air_model}",
        "",
        f"{'Verdict':<12}{reduction.verdict.text}",
        *(f"{title:<12}{text}" for title, text in results(reduction)),
        "",
        "UNIT",
        *_text_rows(UNIT, reduction, slice(0, 1)),
        "",
        "SURFACE PLATE",
        *_text_rows(PLATE, reduction, slice(0, 1)),
    ]
    for start in range(0, len(reduction.h), SIDE_BY_SIDE):
        rows = slice(start, min(start + SIDE_BY_SIDE, len(reduction.h)))
        heads = "".join(f"{'no. ' + str(k + 1):>15}" for k in range(rows.start, rows.stop))
        lines += ["", f"{'PLACEMENTS':<14}{'':<5}{heads}", *_text_rows(PLACEMENT, reduction, rows)]
        spacers = "".join(f"{p.spacer_mm:>15.3f}" for p in m.placement[rows])
        lines += [f"{'spacer':<14}{'mm':<5}{spacers}  spacer in front of the stops"]
        lines += [
            f"{'u (H_corr)':<14}{'mm':<5}"
            + "".join(f"{_plain(u * 1e3, '.4f'):>15}" for u in reduction.u[rows])
            + "  of one placement",
            f"{'w':<14}{'':<5}"
            + "".join(f"{_plain(w, '.2f'):>15}" for w in reduction.statistics[rows])
            + "  standardised residual",
            f"{'status':<14}{'':<5}" + "".join(f"{SHORT.get(s, s):>15}" for s in reduction.status[rows]),
        ]
    lines += ["", "POINTS (mm from S: along the prisms, up, towards the ranger)"]
    for name, at in point_places(reduction).items():
        for k, place in enumerate(at, start=1):
            cells = "".join(f"{_plain(1e3 * x, '.4f'):>15}" for x in place)
            lines.append(f"{name if k == 1 else '':<13}no.{k:>3}{cells}  {POINTS[name] if k == 1 else ''}".rstrip())
    return "\n".join(lines) + "\n"


def _text_rows(symbols: Sequence[Symbol], reduction: TripletReduction, rows: slice) -> Iterator[str]:
    for symbol in symbols:
        values = symbol_values(symbol, reduction)
        values = values * (rows.stop - rows.start) if len(values) == 1 else values[rows]
        cells = "".join(f"{cell(symbol, value):>15}" for value in values)
        yield f"{symbol.label:<14}{symbol.unit:<5}{cells}  {symbol.meaning}"


def triplet_report(reduction: TripletReduction, file: str, when: datetime, digest: str) -> ResultReport:
    """Report of a triplet's calibration.

    reduction   the calibration of a unit
    file        name of its sheet; `digest` its SHA-256
    when        UTC, of the computation
    """
    m = reduction.measurement
    return ResultReport(
        title=f"{TITLE}: {m.triplet}",
        subtitle=(
            f"prisms {m.left_prism.serial} (left) and {m.right_prism.serial} (right); measured on {m.measured_on} by "
            f"{m.by}; air by {m.air_model}; u = standard uncertainty, 1σ"
        ),
        verdict=reduction.verdict,
        cards=_cards(reduction),
        passages=[Passage(title, words) for title, words in results(reduction)],
        sections=[
            ReportSection("placements", "Placements", [_placements_chart(reduction), *_budget(reduction)]),
            ReportSection("unit", "Unit", [TableBlock("unit", _table(UNIT, reduction))]),
            ReportSection(
                "plate", "Surface plate", [TableBlock("plate", _table(PLATE, reduction)), *_paint(reduction)]
            ),
            ReportSection("ranges", "Ranges", [TableBlock("ranges", _placement_table(reduction))]),
            ReportSection("points", "Points", [TableBlock("points", _points(reduction))]),
            origin_section(when, {file: digest}),
        ],
    )


def _cards(reduction: TripletReduction) -> list[Card]:
    u = f"u = {_plain(reduction.u_h_corr * 1e3, '.4f')} mm, by ranging"
    plate = f"u = {reduction.u_l_mpbc * 1e3:.4f} mm, surface plate"
    return [
        Card("H_corr", _signed(reduction.h_corr), u),
        Card("L_MPBC", f"{reduction.l_mpbc * 1e3:+.4f} mm", plate),
        Card(
            "accepted" if reduction.accepted else "NOT ACCEPTED",
            _signed(reduction.difference),
            f"limit ± 0.15 mm; conformity {_probability(reduction)}",
        ),
    ]


def _placements_chart(reduction: TripletReduction) -> ChartBlock:
    """H_corr of each placement against the surface plate and the limits."""
    known = [k for k, h in enumerate(reduction.h) if math.isfinite(h)]
    names = [f"no. {k + 1}" for k in known]
    odd = set(reduction.suspects)
    chart = Chart(
        "scatter",
        Axis("placement", "", list(range(len(known))), names, digits=0),
        Axis("ball above the prisms' mid-point", "µm", [reduction.h[k] * 1e6 for k in known], digits=2),
        u=[reduction.u[k] * 1e6 for k in known],
        names=names,
        group=[1 if k in odd else 0 for k in known],
        groups=("placement", "contradicted, retained"),
        limits=[(reduction.l_mpbc + side * TOLERANCE) * 1e6 for side in (-1.0, 0.0, 1.0)],
    )
    text_ = "H_corr of each placement with its u; dashed: L_MPBC of the surface plate and its limits, ± 150 µm."
    return ChartBlock("placements", chart, text_)


def _budget(reduction: TripletReduction) -> list[Block]:
    shares = sorted(reduction.budget.items(), key=lambda item: -item[1])
    names = [name for name, _ in shares]
    values = Axis("share in u of H_corr", "µm", [value * 1e6 for _, value in shares], digits=3)
    chart = Chart("bars", Axis("cause", "", list(range(len(names))), names, digits=0), values, names=names)
    return [ChartBlock("budget", chart, "Budget: shares in u of H_corr.")]


def _symbols(rows: Sequence[Sequence[str]], values: Sequence[str]) -> ReportTable:
    """Table of symbols; the values have as many decimals as each symbol's unit asks for."""
    return ReportTable.of_rows(
        rows,
        text("symbol", "symbol"),
        text("description", "description", kind="long"),
        text("design", "design value"),
        *(text(f"value_{k + 1}", head) for k, head in enumerate(values)),
        text("unit", "unit"),
    )


def _table(symbols: Sequence[Symbol], reduction: TripletReduction) -> ReportTable:
    rows = [
        (s.label, s.meaning, s.design or "–", cell(s, symbol_values(s, reduction)[0]), s.unit or "–") for s in symbols
    ]
    return _symbols(rows, ("value",))


def _placement_table(reduction: TripletReduction) -> ReportTable:
    every = range(len(reduction.h))
    spacers = (f"{placement.spacer_mm:.3f}" for placement in reduction.measurement.placement)
    rows: list[tuple[str, ...]] = [("spacer", "in front of the rear stops", "–", *spacers, "mm")]
    for s in PLACEMENT:
        values = symbol_values(s, reduction)
        cells = [cell(s, values[k if len(values) > 1 else 0]) for k in every]
        rows.append((s.label, s.meaning, s.design or "–", *cells, s.unit or "–"))
    rows.append(("u(H_corr)", "of one placement", "–", *(_plain(reduction.u[k] * 1e3, ".4f") for k in every), "mm"))
    rows.append(("w", "standardised residual", "–", *(_plain(reduction.statistics[k], ".2f") for k in every), "–"))
    rows.append(("status", "", "", *(reduction.status[k] for k in every), ""))
    return _symbols(rows, [f"no. {k + 1}" for k in every])


def _plain(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "–"


def _signed(value: float) -> str:
    return f"{value * 1e3:+.4f} mm" if math.isfinite(value) else "unknown"


def _paint(reduction: TripletReduction) -> list[Block]:
    table = ReportTable.of_rows(
        [
            (name, low * 1e3, high * 1e3)
            for name, (low, high) in zip(("T₁", "T₂", "BC"), reduction.plate.departure, strict=True)
        ],
        text("point", "point above the bare top plate"),
        number("thin", "paint 0.05 mm", unit="mm", digits=4),
        number("thick", "paint 0.15 mm", unit="mm", digits=4),
    )
    design = reduction.plate.paint_from_design * 1e3
    words = f"Paint that would put the mean of the three in the bare top plate: {design:.4f} mm."
    if reduction.plate.sampled:
        low, mean, high = (1e3 * height for height in reduction.plate.sampled)
        words += f" Painted surface above the synthetic plane: {low:+.4f} to {high:+.4f} mm, mean {mean:+.4f} mm."
    return [TableBlock("paint", table), Text(words)]


def _points(reduction: TripletReduction) -> ReportTable:
    return ReportTable.of_rows(
        [
            (name, POINTS[name], k, *(1e3 * x for x in place))
            for name, at in point_places(reduction).items()
            for k, place in enumerate(at, start=1)
        ],
        text("point", "point"),
        text("description", "description", kind="long"),
        number("placement", "no.", digits=0),
        number("along", "along", unit="mm", digits=4),
        number("up", "up", unit="mm", digits=4),
        number("towards", "towards the ranger", unit="mm", digits=4),
    )
