"""Reports of a structure's model and of its vibration."""

from collections.abc import Mapping
from dataclasses import replace
from datetime import datetime

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.gateways.structure.objects import structure_passages, vibration_passages
from catseye.gateways.writers.report import (
    Block,
    Card,
    ChartBlock,
    DrawingBlock,
    ReportSection,
    ResultReport,
    TableBlock,
    Text,
    origin_section,
)
from catseye.gateways.writers.report_parts import Axis, Chart, ReportTable, categories, number, text, uncertainty
from catseye.reduction.structure.check import LeaveOut
from catseye.reduction.structure.findings import StructureFindings
from catseye.reduction.structure.series import StructureFit
from catseye.reduction.structure.vibration import Vibration

GRID = 61  # points of a model's curve
MOST_RESIDUALS = 20_000  # drawn


def structure_report(found: StructureFindings, when: datetime, inputs: Mapping[str, str]) -> ResultReport:
    """Report of a structure's model.

    when     UTC
    inputs   SHA-256 of each input file, by name
    """
    series = found.fit.series
    return ResultReport(
        title=f"Structure: {series.group}",
        subtitle=f"fitted by catseye on {when:%Y-%m-%d %H:%M} UTC; frame {series.frame}; u = standard uncertainty, 1σ",
        verdict=found.verdict,
        cards=_cards(found),
        passages=structure_passages(replace(found, predicted=None)),
        sections=[
            ReportSection(
                "motion", "Motion of the group", [*_motion(found.fit), TableBlock("motion", _six(found.fit))]
            ),
            ReportSection("residuals", "Residuals", _residuals(found.fit, found.check)),
            _prediction(found),
            origin_section(when, inputs),
        ],
        label=f"Structure: {series.group}",
    )


def _cards(found: StructureFindings) -> list[Card]:
    fit, check, s = found.fit, found.check, found.fit.series
    scatter = f"of the group's shift, and {fit.scatter.u_point * 1e3:.3f} mm of each coordinate: not predictable"
    cards = [
        Card("Epochs", str(len(s)), f"{len(s.names)} points of {s.group}, frame {s.frame}"),
        Card("Variance factor", f"{fit.fit.variance_factor:.2f}", f"{fit.fit.degrees_of_freedom} degrees of freedom"),
        Card("Scatter between epochs", f"{1e3 * np.linalg.norm(fit.scatter.u_six[:3]):.2f} mm", scatter),
    ]
    if check is not None:
        cards.append(Card("Epochs left out", f"{check.rms * 1e3:.3f} mm rms", f"{check.ratio:.2f} of the claim"))
    return cards


def _motion(fit: StructureFit) -> list[Block]:
    """Shift and rotation by elevation: model with its u, and epochs."""
    e = np.asarray(fit.series.posture.elevation, dtype=float)
    grid = np.linspace(e.min(), e.max(), GRID)
    predicted, at, motion = fit.predict(grid), fit.predict(e), fit.residual_motion
    blocks: list[Block] = []
    for c in range(6):
        scale, unit = (MILLIMETRE, "mm") if c < 3 else (ARCSECOND, "″")
        u = np.sqrt(np.maximum(predicted.six_covariance[:, c, c], 0.0))
        name = f"{'shift along' if c < 3 else 'rotation about'} {'xyz'[c % 3]}"
        chart = Chart(
            "scatter",
            Axis("elevation", "°", np.concatenate([grid, e]) / DEGREE, digits=3),
            Axis(name, unit, np.concatenate([predicted.six[:, c], at.six[:, c] + motion[:, c]]) / scale, digits=5),
            u=np.concatenate([u / scale, np.full(len(e), np.nan)]),
            group=[0] * GRID + [1] * len(e),
            groups=("model, with u of a future epoch", "epochs"),
        )
        blocks.append(ChartBlock(f"motion-{c + 1}", chart, f"{name[:1].upper()}{name[1:]}."))
    lead = (
        "Shift and rotation about the pivot from the mean of the epochs, at the reference temperature. Bars: "
        "standard uncertainty of a future epoch. Epochs are without temperature and direction terms."
    )
    return [Text(lead), *blocks]


def _six(fit: StructureFit) -> ReportTable:
    six, q = fit.six_of()
    u = np.sqrt(np.maximum(np.diag(q), 0.0)).reshape(-1, 6).T
    units = np.repeat([MILLIMETRE, ARCSECOND], 3)
    columns = [
        column
        for c in range(6)
        for name, unit in [(f"{'shift' if c < 3 else 'turn'} {'xyz'[c % 3]}", "mm" if c < 3 else "″")]
        for column in (
            number(f"c_{c + 1}", name, six[c] / units[c], unit, 3, u=f"u_{c + 1}"),
            uncertainty(f"u_{c + 1}", f"u {name}", u[c] / units[c], unit, 3),
        )
    ]
    return ReportTable((text("function", "function", fit.model.functions), *columns))


def _residuals(fit: StructureFit, check: LeaveOut | None) -> list[Block]:
    """Residuals by point and by elevation, and epochs left out against the claim."""
    residual = fit.fit.residual / MILLIMETRE
    known = np.argwhere(np.isfinite(residual))
    if len(known) > MOST_RESIDUALS:
        size = -np.abs(residual[tuple(known.T)])
        known = known[np.sort(np.argsort(size, kind="stable")[:MOST_RESIDUALS])]
    names = [fit.series.names[k] for k in known[:, 1]]
    value = Axis("measured minus model", "mm", residual[tuple(known.T)], digits=4)
    elevation = np.asarray(fit.series.posture.elevation, dtype=float)[known[:, 0]] / DEGREE
    blocks: list[Block] = [
        ChartBlock(
            f"residuals-by-{word}",
            Chart("scatter", x, value, names=names, group=known[:, 2], groups=tuple("xyz"), limits=(0.0,)),
            caption,
        )
        for word, x, caption in (
            ("point", categories("point", names), "Measured minus model, for each point and epoch."),
            ("elevation", Axis("elevation of the epoch", "°", elevation, digits=3), "The same by elevation."),
        )
    ]
    if check is None:
        return [*blocks, ChartBlock("residual-histogram", Chart("histogram", value), "Histogram of the residuals.")]
    u = np.sqrt(np.einsum("tnii->tni", check.covariance))
    ratio = (check.residual / u)[np.isfinite(check.residual)]
    x = Axis("measured minus predicted, in claimed standard uncertainties", "", ratio, digits=3)
    caption = "Epochs left out: claims are correct if the bars match the normal distribution."
    return [*blocks, ChartBlock("left-out", Chart("histogram", x), caption)]


def _prediction(found: StructureFindings) -> ReportSection | None:
    """Predicted points; None without a request."""
    predicted = found.predicted
    if predicted is None:
        return None
    lines = [
        (float(e), name, *predicted.place[k, i], *(np.sqrt(np.diag(predicted.covariance[k, i])) / MILLIMETRE))
        for k, e in enumerate(found.request.elevation_deg)
        for i, name in enumerate(predicted.names)
    ]
    table = ReportTable.of_rows(
        lines,
        number("elevation", "elevation", unit="°"),
        text("point", "point"),
        *(number(axis, axis, unit="m", digits=5) for axis in "xyz"),
        *(uncertainty(f"u_{axis}", f"u {axis}", unit="mm", digits=3) for axis in "xyz"),
        name="point",
    )
    warned = [Text(words) for words in predicted.outside]
    return ReportSection("prediction", "Predicted points", [*warned, TableBlock("prediction", table)])


def vibration_report(vibration: Vibration, when: datetime, inputs: Mapping[str, str]) -> ResultReport:
    """Report of a vibration; arguments as for `structure_report`."""
    from catseye.gateways.structure.figures import spectrum_figure  # matplotlib is heavy
    from catseye.gateways.writers.drawing import svg

    drawing = DrawingBlock(
        "spectra",
        svg(spectrum_figure(vibration)),
        "One-sided density of each range; the band is the 95 % interval of the first one's density. Red: half "
        "the rate. A question mark: it may be an alias.",
    )
    return ResultReport(
        title="Vibration",
        subtitle=f"by catseye on {when:%Y-%m-%d %H:%M} UTC; u = standard uncertainty, 1σ",
        verdict=vibration.verdict,
        passages=vibration_passages(vibration),
        sections=[
            ReportSection("spectra", "Spectra", [drawing, TableBlock("peaks", _peaks(vibration))]),
            ReportSection("modes", "Modes", [TableBlock("modes", _modes(vibration))]),
            origin_section(when, inputs),
        ],
    )


def _peaks(vibration: Vibration) -> ReportTable:
    names = [s.name for s in vibration.series]
    rows = [
        (
            p.peak.frequency_hz,
            p.likely_hz if p.decided else None,
            "" if p.decided else "open",
            ", ".join(f"{f:.2f}" for f in p.may_be_hz),
            p.peak.over,
            None if p.shape is None else p.shape.rms.max() * 1e6,
            "" if p.shape is None else names[int(np.argmax(p.shape.rms))],
        )
        for p in vibration.peaks
    ]
    return ReportTable.of_rows(
        rows,
        number("observed", "observed", unit="Hz", digits=3),
        number("true", "true", unit="Hz", digits=3),
        text("remark", "remark"),
        text("possible", "possible (Hz)"),
        number("over", "times the background", digits=1),
        number("rms", "largest rms in the band", unit="µm", digits=1),
        text("range", "at"),
    )


def _modes(vibration: Vibration) -> ReportTable:
    rows = [
        (
            m.frequency_hz,
            m.u_frequency_hz,
            m.damping_ratio,
            float(np.exp(m.u_damping)),
            float(np.sqrt(m.covariance[0, 0])) * 1e6,
        )
        for m in vibration.modes
    ]
    return ReportTable.of_rows(
        rows,
        number("frequency", "frequency", unit="Hz", digits=4, u="u_frequency"),
        uncertainty("u_frequency", "u", unit="Hz", digits=4),
        number("damping", "damping ratio", digits=4),
        number("factor", "damping × or ÷", digits=2),
        number("rms", "rms", unit="µm", digits=1),
    )
