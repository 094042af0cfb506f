"""Charts of the report of an EDM baseline."""

from typing import TYPE_CHECKING

import numpy as np

from catseye.constants import MILLIMETRE, PPM, TWO_PI
from catseye.gateways.writers.report import ChartBlock
from catseye.gateways.writers.report_parts import Axis, Chart

if TYPE_CHECKING:
    from catseye.reduction.baseline.result import BaselineCalibration

FAR = 0.25  # of the longest distance: shorter lines do not show the air


def baseline_charts(calibration: "BaselineCalibration") -> dict[str, ChartBlock]:
    """Line of the pillars, residuals by distance and weather, corrections, cyclic terms."""
    blocks = [_line(calibration), _residuals(calibration), _weather(calibration), *_corrections(calibration)]
    if calibration.cyclic:
        blocks += _cyclic(calibration)
    return {block.key: block for block in blocks}


def _marks(calibration: "BaselineCalibration", x: Axis, y: Axis, rows: np.ndarray | None = None) -> Chart:
    """Scatter chart of shots by set-up; `rows` of the shots, None for all."""
    shots = calibration.observations
    at = np.arange(len(shots.start)) if rows is None else rows
    first = [int(np.argmax(shots.setup == k)) for k in range(int(shots.setup.max()) + 1)]
    groups = [f"set-up {k + 1}, from {calibration.names[shots.start[row]]}" for k, row in enumerate(first)]
    names = [f"{calibration.names[shots.start[k]]} - {calibration.names[shots.end[k]]}" for k in at]
    return Chart("scatter", x, y, names=names, group=shots.setup[at], groups=groups, limits=(0.0,))


def _line(calibration: "BaselineCalibration") -> ChartBlock:
    s = calibration.solution
    rows, covariance = s.places
    u = np.zeros(2 * len(s.x))
    u[rows] = np.sqrt(np.diag(covariance))
    x = Axis("distance along the line", "m", s.x, digits=5)
    y = Axis("offset to the left", "mm", s.y / MILLIMETRE, digits=4)
    chart = Chart("scatter", x, y, u=u[len(s.x) :] / MILLIMETRE, names=calibration.names)
    return ChartBlock("line", chart, "Pillars along the line from the first to the last, and their offsets from it.")


def _residuals(calibration: "BaselineCalibration") -> ChartBlock:
    x = Axis("horizontal distance", "m", calibration.lengths.distance, digits=4)
    y = Axis("observed minus adjusted", "mm", calibration.shot_residuals / MILLIMETRE, digits=5)
    settings = calibration.settings
    return ChartBlock(
        "residuals",
        _marks(calibration, x, y),
        "All shots, by set-up. Shots of a set lie together if the scatter is between sets, not between shots. The "
        f"claimed u is {settings.specified_mm:g} mm + {settings.specified_ppm:g} ppm of the distance.",
    )


def _weather(calibration: "BaselineCalibration") -> ChartBlock:
    """Residuals over the change of the index: a slope shows that the light does not follow the sensors' index."""
    lengths = calibration.lengths
    residual = calibration.shot_residuals / lengths.distance / PPM
    change = -(lengths.index - lengths.index[calibration.keep].mean()) / PPM
    rows = np.flatnonzero(lengths.distance > FAR * lengths.distance.max())
    x = Axis("change of the corrected length by weather", "ppm", change[rows], digits=4)
    y = Axis("residual over distance", "ppm", residual[rows], digits=4)
    share, u = calibration.weather
    followed = f" The light followed {share:.2f} ± {u:.2f} of it." if np.isfinite(share) else ""
    return ChartBlock(
        "weather",
        _marks(calibration, x, y, rows),
        "Residuals of the longer lines over the change of the corrected length by weather: flat if the light follows "
        f"the weather readings, rising if the correction is too large.{followed}",
    )


def _corrections(calibration: "BaselineCalibration") -> list[ChartBlock]:
    lengths = calibration.lengths
    x = Axis("distance", "m", lengths.distance, digits=4)
    return [
        ChartBlock(
            f"correction-{k}",
            Chart("scatter", x, Axis("correction", unit, values / scale, digits=4), limits=(0.0,)),
            f"{name} added to the displayed lengths.",
        )
        for k, (name, values, unit, scale) in enumerate(
            (
                ("First velocity correction", lengths.first, "mm", MILLIMETRE),
                ("Second velocity correction and chord", lengths.second + lengths.chord, "µm", 1e-6),
                ("Correction from slope to level", lengths.level, "mm", MILLIMETRE),
            ),
            start=1,
        )
    ]


def cyclic_error(calibration: "BaselineCalibration", share: np.ndarray) -> np.ndarray:
    """Adjusted cyclic error, m, at shares (n,) of the unit length."""
    total = np.zeros_like(share)
    for order in range(1, len(calibration.cyclic) // 2 + 1):
        for name, wave in (("cosine", np.cos), ("sine", np.sin)):
            total = total + calibration.solution.of(f"cyclic {name} {order}")[0] * wave(TWO_PI * order * share)
    return total


def _cyclic(calibration: "BaselineCalibration") -> list[ChartBlock]:
    unit = calibration.settings.unit_length
    assert unit is not None
    share, curve = calibration.observations.slope / unit % 1.0, np.linspace(0.0, 1.0, 201)
    place = "position in the unit length"
    values = calibration.shot_residuals + cyclic_error(calibration, share)
    marks = _marks(
        calibration,
        Axis(place, "m", share * unit, digits=4),
        Axis("cyclic term and residual", "mm", values / MILLIMETRE, digits=4),
    )
    term = Axis("cyclic term", "mm", cyclic_error(calibration, curve) / MILLIMETRE, digits=5)
    line = Chart("line", Axis(place, "m", curve * unit, digits=4), term)
    return [
        ChartBlock("cyclic", marks, f"Cyclic terms over the unit length of {unit:g} m, with residuals."),
        ChartBlock("cyclic-term", line, "Adjusted cyclic terms together."),
    ]
