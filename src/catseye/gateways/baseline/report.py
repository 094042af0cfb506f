"""Report of an EDM baseline."""

from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catseye.constants import MILLIMETRE, PPM
from catseye.estimation.baseline.iso17123 import FullTest
from catseye.gateways.baseline.objects import passages
from catseye.gateways.baseline.report_charts import baseline_charts
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
from catseye.gateways.writers.report_parts import ReportTable, number, text, uncertainty

if TYPE_CHECKING:
    from catseye.reduction.baseline.result import BaselineCalibration


def baseline_report(calibration: "BaselineCalibration", when: datetime, inputs: Mapping[str, str]) -> ResultReport:
    """Report of a baseline.

    calibration   a calibration
    when          UTC
    inputs        SHA-256 of each input file, by name
    """
    charts = baseline_charts(calibration)
    settings = {key: str(value) for key, value in vars(calibration.settings).items()}
    return ResultReport(
        title=f"{Path(calibration.observations.file).name}: EDM baseline",
        subtitle=(
            f"adjusted by catseye on {when:%Y-%m-%d %H:%M} UTC; u = standard uncertainty, 1σ; observed = (1 + scale) × "
            "distance + zero + cyclic"
        ),
        verdict=calibration.verdict,
        cards=_cards(calibration),
        passages=[p for p in passages(calibration) if p.title != "Test"],
        sections=[
            _pillars(calibration, charts.pop("line")),
            ReportSection("residuals", "Residuals", list(charts.values())),
            _tests(calibration),
            _budget(calibration),
            _sets(calibration),
            origin_section(when, inputs, settings),
        ],
        label="catseye: EDM baseline",
    )


def _cards(calibration: "BaselineCalibration") -> list[Card]:
    s, test = calibration.solution, calibration.test
    zero, u_zero = (v / MILLIMETRE for v in s.of("zero"))
    scale, u_scale = (v / PPM for v in s.of("scale"))
    valid = np.isfinite(scale)
    longest = max(calibration.spans, key=lambda span: span.distance)
    return [
        Card("Zero", f"{zero:+.3f} ± {u_zero:.3f} mm", "observed minus true"),
        Card("Scale", f"{scale:+.2f} ± {u_scale:.2f} ppm" if valid else "not determined", "positive: reads too long"),
        Card(
            "s of one distance",
            f"{test.s / MILLIMETRE:.3f} mm" if isinstance(test, FullTest) else "unknown",
            f"{test.degrees_of_freedom} degrees of freedom" if isinstance(test, FullTest) else test,
        ),
        Card(f"{longest.start} to {longest.end}", f"{longest.distance:.4f} m", f"u = {longest.u / MILLIMETRE:.2f} mm"),
    ]


def _pillars(calibration: "BaselineCalibration", line: ChartBlock) -> ReportSection:
    pillars = ReportTable.of_rows(
        [(name, p.x, p.u_x / MILLIMETRE, p.y, p.u_y / MILLIMETRE, p.height) for name, p in calibration.pillars.items()],
        text("pillar", "pillar"),
        number("x", "x", unit="m", digits=5),
        uncertainty("u_x", "u x", unit="mm", digits=3),
        number("y", "y", unit="m", digits=5),
        uncertainty("u_y", "u y", unit="mm", digits=3),
        number("height", "height", unit="m", digits=4),
        name="pillar",
    )
    spans = ReportTable.of_rows(
        [(a, b, d, u / MILLIMETRE) for a, b, d, u in calibration.spans],
        text("from", "from"),
        text("to", "to"),
        number("distance", "distance", unit="m", digits=5),
        uncertainty("u", "u", unit="mm", digits=3),
    )
    height = (
        "one height" if calibration.reference_height is None else f"the height {calibration.reference_height:.3f} m"
    )
    lead = f"Horizontal distances at {height}; their full covariance is in baseline.json and BASELINE.toml."
    return ReportSection(
        "pillars", "Pillars", [line, TableBlock("pillars", pillars), Text(lead), TableBlock("distances", spans)]
    )


def _tests(calibration: "BaselineCalibration") -> ReportSection:
    outcome = {True: "passed", False: "failed", None: "not possible"}
    table = ReportTable.of_rows(
        [(d.name, d.statistic, d.limit, outcome[d.passed], d.text) for d in calibration.decisions],
        text("test", "test", kind="long"),
        number("statistic", "statistic"),
        number("limit", "limit"),
        text("outcome", "outcome"),
        text("meaning", "meaning", kind="long"),
    )
    failed = [d.name for d in calibration.decisions if d.passed is False]
    lead = (
        f"All at the level {calibration.settings.level:g}. Limits follow from claim and degrees of freedom, "
        "not from the scatter under test. A set, its repeats averaged, counts as one distance."
    )
    first = Text(f"Failed: {'; '.join(failed)}." if failed else "Every test passes.")
    return ReportSection("tests", "Tests", [first, Text(lead), TableBlock("tests", table)])


def _budget(calibration: "BaselineCalibration") -> ReportSection:
    s = calibration.solution
    last = f"x {calibration.order[-1]}"
    parameters = [n for n in ("zero", "scale", *calibration.cyclic, last) if n in s.names]
    at = [s.names.index(n) for n in parameters]
    unit = [PPM if n == "scale" else MILLIMETRE for n in parameters]
    rows = [(cause, *(part[i] / u for i, u in zip(at, unit, strict=True))) for cause, part in s.parts.items()]
    rows.append(("combined", *(s.of(n)[1] / u for n, u in zip(parameters, unit, strict=True))))
    heads = [f"x of {calibration.names[calibration.order[-1]]}" if n == last else n for n in parameters]
    columns = (
        uncertainty(f"u_{k + 1}", head, unit="ppm" if n == "scale" else "mm", digits=4)
        for k, (head, n) in enumerate(zip(heads, parameters, strict=True))
    )
    return ReportSection(
        "budget",
        "Budget",
        [
            Text("Standard uncertainty by cause; causes are independent and add in quadrature."),
            TableBlock("budget", ReportTable.of_rows(rows, text("cause", "cause"), *columns)),
        ],
    )


def _sets(calibration: "BaselineCalibration") -> ReportSection:
    s, shots = calibration.solution, calibration.observations
    first = np.flatnonzero(calibration.keep)[s.used.first]
    residuals = calibration.shot_residuals[calibration.keep]
    scatter = [float(np.std(residuals[s.used.set == k])) / MILLIMETRE for k in range(len(s.residual))]
    table = ReportTable(
        (
            text("from", "from", [calibration.names[shots.start[row]] for row in first]),
            text("to", "to", [calibration.names[shots.end[row]] for row in first]),
            number("shots", "shots", s.used.shots, digits=0),
            number("distance", "distance", calibration.lengths.distance[first], "m", 4),
            number("temperature", "temperature", shots.temperature_c[first], "°C", 1),
            number("residual", "residual", s.residual / MILLIMETRE, "mm", 3),
            number("repeats", "repeats", scatter, "mm", 3),
            number("w", "w", s.w_set, digits=2),
            number("redundancy", "redundancy", s.redundancy, digits=2),
        )
    )
    left_out = [f"row {k + 1}: {why}" for k, why in enumerate(calibration.rejected) if why]
    blocks: list[Block] = [Text("Excluded: " + "; ".join(left_out))] if left_out else []
    return ReportSection(
        "sets", "Sets", [*blocks, TableBlock("sets", table), Text("All shots are in observations.csv.")]
    )
