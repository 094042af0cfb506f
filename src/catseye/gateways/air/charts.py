"""Charts of the reports on acoustic and refractometer paths."""

from typing import TYPE_CHECKING

import numpy as np

from catseye.constants import PPM
from catseye.gateways.writers.report import ChartBlock
from catseye.gateways.writers.report_parts import Axis, Chart
from catseye.reduction.air.group_index import phase_slope

if TYPE_CHECKING:
    from catseye.reduction.air.refractometer_calibration import PathCalibration
    from catseye.reduction.air.sound_path import AcousticPath, ChannelTrace

DIRECTIONS = {"ab": "towards the target", "ba": "towards the ranger", "loop": "loop-back"}
NEAR = 8.0  # samples on either side of a correlation's peak
MINUTES = 1440.0  # in a day


def acoustic_charts(path: "AcousticPath", tail: str) -> list[ChartBlock]:
    """Recording and correlation of the first shot by channel, temperature and wind over time.

    tail   end of the charts' keys
    """
    blocks = [block for trace in path.shots.traces or () for block in _acoustic_channel(trace, tail)]
    return blocks + (_acoustic_in_time(path, tail) if path.used.any() else [])


def _acoustic_channel(trace: "ChannelTrace", tail: str) -> list[ChartBlock]:
    name = f"{trace.channel}, {DIRECTIONS[trace.channel]} ({trace.file})"
    middle = trace.arrival if np.isfinite(trace.arrival) else trace.lag[np.argmax(trace.correlation)]
    close = np.abs(trace.lag - middle) <= NEAR * (trace.lag[1] - trace.lag[0])
    arrival = f" Detected arrival: {trace.arrival * 1e3:.4f} ms." if np.isfinite(trace.arrival) else ""
    recording = Chart(
        "line",
        Axis("time since the file's first sample", "ms", trace.time * 1e3, digits=4),
        Axis("sample", "", trace.samples),
    )
    wide = Chart(
        "line",
        Axis("delay since the file's first sample", "ms", trace.lag * 1e3, digits=4),
        Axis("correlation", "", trace.correlation),
    )
    near = Chart(
        "line",
        Axis("delay from the detected arrival", "µs", (trace.lag[close] - middle) * 1e6, digits=3),
        Axis("correlation", "", trace.correlation[close]),
    )
    key = f"{trace.channel}{tail}"
    return [
        ChartBlock(f"recording-{key}", recording, f"{name}: recording around the predicted arrival.{arrival}"),
        ChartBlock(f"correlation-{key}", wide, f"{name}: correlation with the known signal over the window."),
        ChartBlock(f"peak-{key}", near, f"{name}: around its peak; the arrival is interpolated between samples."),
    ]


def _acoustic_in_time(path: "AcousticPath", tail: str) -> list[ChartBlock]:
    used, air, sheet = path.used, path.temperatures, path.sheet
    minutes = (path.shots.mjd[used] - path.shots.mjd[0]) * MINUTES
    label = f"time from MJD {path.shots.mjd[0]:.5f} UTC"
    count = len(minutes)
    station = np.broadcast_to(path.shots.weather[0], used.shape)[used]
    temperature = Chart(
        "scatter",
        Axis(label, "min", np.tile(minutes, 2), digits=3),
        Axis("mean temperature of the path", "°C", np.concatenate([air.temperature_c[used], station]), digits=4),
        u=np.concatenate([air.u_temperature_c[used], np.full(count, np.nan)]),
        group=[0] * count + [1] * count,
        groups=("acoustic", "thermometer"),
    )
    blocks = [
        ChartBlock(
            f"temperature{tail}",
            temperature,
            "Mean temperature of the path. Its u includes what all shots share: length, electronics, humidity, "
            "crosswind, formula; from shot to shot only "
            f"{float(np.median(air.parts_c['time'][used])):.3f} °C (median) varies.",
        )
    ]
    if path.shots.time_ba is not None:
        wind = Axis(f"wind, {sheet.ranger} to {sheet.target}", "m/s", air.wind[used], digits=3)
        chart = Chart("scatter", Axis(label, "min", minutes, digits=3), wind, u=air.u_wind[used], limits=(0.0,))
        blocks.append(ChartBlock(f"wind{tail}", chart, "Wind along the path."))
    return blocks


def refractometer_charts(calibration: "PathCalibration") -> list[ChartBlock]:
    """Index, residuals and temperature over the night; phase against weather."""
    return [_index(calibration), _residual(calibration), _temperature(calibration), _slope(calibration)]


def _refractometer_hours(calibration: "PathCalibration", rows: np.ndarray | None = None) -> Axis:
    hours = calibration.readings.hours if rows is None else calibration.readings.hours[rows]
    return Axis(f"time since MJD {calibration.readings.mjd_utc[0]:.4f} UTC", "h", hours, digits=4)


def _index(calibration: "PathCalibration") -> ChartBlock:
    count = len(calibration.readings.hours)
    both = np.tile(np.arange(count), 2)
    index = np.concatenate([calibration.refractivity, calibration.weather.mean]) / PPM
    starts = [f"{calibration.readings.hours[s.first]:.2f} h" for s in calibration.followed.sections[1:]]
    jumps = f" A jump, or a gap after which the whole cycles are unknown, at {', '.join(starts)}." if starts else ""
    chart = Chart(
        "line",
        _refractometer_hours(calibration, both),
        Axis("n_g − 1", "ppm", index, digits=3),
        group=np.repeat((0, 1), count),
        groups=("from phase", "from weather"),
    )
    return ChartBlock("index", chart, f"Group index of the path from phase and from weather.{jumps}")


def _residual(calibration: "PathCalibration") -> ChartBlock:
    used = np.array([status == "good" for status in calibration.status])
    out = np.array([status == "weather off" for status in calibration.status])
    rows = np.flatnonzero((used | out) & np.isfinite(calibration.residual))
    chart = Chart(
        "scatter",
        _refractometer_hours(calibration, rows),
        Axis("weather − path", "ppm", calibration.residual[rows] / PPM, digits=4),
        group=np.where(used[rows], 0, 1),
        groups=("used", "excluded"),
        limits=(0.0,),
    )
    return ChartBlock("residual", chart, "Their difference.")


def _temperature(calibration: "PathCalibration") -> ChartBlock:
    chart = Chart(
        "line",
        _refractometer_hours(calibration),
        Axis("mean temperature of the path", "°C", calibration.temperature_c, digits=4),
        u=calibration.u_temperature_c,
    )
    text = "Mean temperature equivalent to the index at the measured pressure and humidity."
    return ChartBlock("temperature", chart, text)


def _slope(calibration: "PathCalibration") -> ChartBlock:
    sheet = calibration.readings.sheet
    slope = float(phase_slope(sheet.path_length_m, modulation_hz=sheet.modulation_hz))
    used = np.array([status == "good" for status in calibration.status])
    phase = ((calibration.refractivity - calibration.index_0) * slope)[used]  # without drift and jumps
    weather = (calibration.refractivity + calibration.residual)[used]  # from the thermometers in use
    ends = np.array([np.nanmin(weather), np.nanmax(weather)])
    chart = Chart(
        "scatter",
        Axis("n_g − 1 from weather", "ppm", np.concatenate([weather, ends]) / PPM, digits=3),
        Axis(
            "phase relative to the reference phase",
            "rad",
            np.concatenate([phase, (ends - calibration.index_0) * slope]),
            digits=5,
        ),
        group=[0] * len(weather) + [1, 1],
        groups=("readings", "ends of the theoretical line, −(4πf/c) L"),
    )
    return ChartBlock(
        "slope",
        chart,
        "Phase against weather: the phase falls as the index rises. The theoretical slope is not fitted: readings "
        "along it show that the path's air changes as the air at the sensors.",
    )
