"""Figures of a refractometer path: data as acquired, the night with residuals, phase against weather."""

from typing import TYPE_CHECKING

import numpy as np

from catseye.constants import PPM, TWO_PI
from catseye.gateways.writers.drawing import BAD, FAINT, INK, SERIES, Figure, styled, svg
from catseye.reduction.air.group_index import phase_slope

if TYPE_CHECKING:
    from catseye.reduction.air.refractometer_calibration import PathCalibration


def refractometer_figures(calibration: "PathCalibration") -> dict[str, Figure]:
    """Figures of the data as acquired, of the night with residuals, and phase against weather."""
    with styled():
        return {"acquired": _acquired(calibration), "night": _night(calibration), "slope": _line(calibration)}


def acquired_svg(calibration: "PathCalibration") -> str:
    """SVG text of the figure of the data as acquired."""
    with styled():
        return svg(_acquired(calibration))


def night_svg(calibration: "PathCalibration") -> str:
    """SVG text of the night's figure."""
    with styled():
        return svg(_night(calibration))


def _acquired(calibration: "PathCalibration") -> Figure:
    """Data as acquired: the phase within its turn, each thermometer, pressure and humidity.

    Source: [PARKER04] chapter 8, refractivity, figure 1 (D0309_1).
    """
    readings = calibration.readings
    hours = readings.hours
    figure = Figure(figsize=(9.4, 7.2), layout="constrained")
    phase, warm, pressure, humid = figure.subplots(4, 1, sharex=True)
    phase.scatter(hours, np.mod(readings.phase, TWO_PI), s=4, c=SERIES[0], lw=0)
    phase.set(ylabel="phase (rad)", ylim=(-0.2, TWO_PI + 0.2))
    phase.set_title(f"{readings.sheet.path}: data as acquired, {len(hours)} readings")
    for k, name in enumerate(readings.thermometers):
        label = name.removeprefix("temperature_").removesuffix("_c")
        colour = SERIES[k % len(SERIES)]
        warm.plot(hours, readings.temperature_c[:, k], color=colour, lw=0.6, alpha=0.8, label=label)
    warm.set_ylabel("temperature (°C)")
    warm.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), title="thermometer", title_fontsize=8.5)
    pressure.scatter(hours, readings.pressure_hpa, s=4, c=SERIES[1], lw=0)
    pressure.set_ylabel("pressure (hPa)")
    pressure.ticklabel_format(axis="y", useOffset=False)
    humid.scatter(hours, readings.humidity_percent, s=4, c=SERIES[2], lw=0)
    humid.set(ylabel="humidity (%)", xlabel=f"hours since MJD {readings.mjd_utc[0]:.4f} UTC")
    return figure


def _night(calibration: "PathCalibration") -> Figure:
    hours, good = calibration.readings.hours, np.isfinite(calibration.refractivity)
    used = np.array([s == "good" for s in calibration.status])
    off = np.array([s == "weather off" for s in calibration.status])
    figure = Figure(figsize=(9.4, 6.4), layout="constrained")
    index, residual, warm = figure.subplots(3, 1, sharex=True, gridspec_kw={"height_ratios": (3, 2, 2)})
    index.scatter(hours, calibration.weather.mean / PPM, s=5, c=SERIES[1], lw=0, alpha=0.6, label="from weather")
    path = np.where(good, calibration.refractivity, np.nan) / PPM
    gaps = np.flatnonzero(np.diff(hours) > 10.0 * np.median(np.diff(hours))) + 1
    lines = [np.insert(v, gaps, np.nan) for v in (hours, path, calibration.temperature_c, calibration.u_temperature_c)]
    index.plot(lines[0], lines[1], color=SERIES[0], lw=1.2, label="from phase")
    for row in np.flatnonzero([s == "stray" for s in calibration.status]):
        index.axvline(hours[row], color=BAD, lw=0.6, ls=":", alpha=0.6)
    low, high = np.nanpercentile(path, [0, 100])
    index.set_ylim(low - 0.25 * (high - low) - 0.2, high + 0.25 * (high - low) + 0.2)
    index.set_ylabel("n_g − 1 (ppm)")
    index.set_title(f"{calibration.readings.sheet.path}: group index of the path (dotted: stray phases)")
    residual.axhline(0.0, color=FAINT, lw=0.8)
    residual.scatter(hours[used], calibration.residual[used] / PPM, s=5, c=INK, lw=0, alpha=0.7, label="used")
    residual.scatter(hours[off], calibration.residual[off] / PPM, s=14, c=BAD, marker="x", lw=0.8, label="excluded")
    spread = 6.0 * float(np.nanstd(calibration.residual[used])) / PPM
    residual.set_ylim(-spread, spread)
    residual.set_ylabel("weather − path (ppm)")
    when, _, t, u = lines
    warm.fill_between(when, t - u, t + u, color=SERIES[0], alpha=0.25, lw=0, label="± u")
    warm.plot(when, t, color=SERIES[0], lw=1.0, label="path mean")
    warm.set_ylabel("°C")
    warm.set_xlabel(f"hours since MJD {calibration.readings.mjd_utc[0]:.4f} UTC")
    for ax in (index, residual, warm):
        for s in calibration.followed.sections[1:]:
            ax.axvline(hours[s.first], color=BAD, lw=1.0)
        ax.legend(loc="best", ncols=2)
    return figure


def _line(calibration: "PathCalibration") -> Figure:
    sheet = calibration.readings.sheet
    slope = float(phase_slope(sheet.path_length_m, modulation_hz=sheet.modulation_hz))
    figure = Figure(figsize=(9.4, 4.2), layout="constrained")
    ax = figure.add_subplot()
    used = np.array([s == "good" for s in calibration.status])
    drift = (calibration.refractivity - calibration.index_0) * slope  # phase without drift and jumps
    weather = calibration.refractivity + calibration.residual  # from the thermometers in use
    ax.scatter(weather[used] / PPM, drift[used], s=8, c=SERIES[0], lw=0, alpha=0.6, label="readings")
    ends = np.array([np.nanmin(weather[used]), np.nanmax(weather[used])])
    ax.plot(ends / PPM, (ends - calibration.index_0) * slope, color=INK, lw=1.1, label="theory: −(4πf/c) L")
    ax.set_xlabel("n_g − 1 from weather (ppm)")
    ax.set_ylabel("phase relative to the reference phase (rad)")
    ax.set_title("Phase against weather: the phase falls as the index rises")
    ax.legend(loc="best")
    return figure
