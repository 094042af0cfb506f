"""Figures of an EDM baseline."""

from typing import TYPE_CHECKING

import numpy as np

from catseye.constants import MILLIMETRE, PPM
from catseye.gateways.baseline.report_charts import cyclic_error
from catseye.gateways.writers.drawing import BAD, FAINT, INK, SERIES, Figure, styled

if TYPE_CHECKING:
    from catseye.reduction.baseline.result import BaselineCalibration

MARKERS = "osD^vP"


def baseline_figures(calibration: "BaselineCalibration") -> dict[str, Figure]:
    """Figures of the report, by name."""
    with styled():
        drawn = {
            "line": _line(calibration),
            "residuals": _residuals(calibration),
            "weather": _weather(calibration),
            "corrections": _corrections(calibration),
        }
        if calibration.cyclic:
            drawn["cyclic"] = _cyclic(calibration)
        return drawn


def _setups(calibration: "BaselineCalibration"):
    """Number, legend, colour and marker of each set-up."""
    shots = calibration.observations
    for k in range(int(shots.setup.max()) + 1):
        first = int(np.argmax(shots.setup == k))
        yield k, f"from {calibration.names[shots.start[first]]}", SERIES[k % len(SERIES)], MARKERS[k // len(SERIES) % 6]


def _line(calibration: "BaselineCalibration") -> Figure:
    s = calibration.solution
    figure = Figure(figsize=(9.4, 2.9), layout="constrained")
    ax = figure.add_subplot()
    rows, covariance = s.places
    u = np.zeros(2 * len(s.x))
    u[rows] = np.sqrt(np.diag(covariance))
    ax.axhline(0.0, color=FAINT, lw=0.8)
    ax.errorbar(s.x, s.y / MILLIMETRE, u[len(s.x) :] / MILLIMETRE, fmt="o", color=SERIES[0], ms=5, elinewidth=1.0)
    for name, x, y, ux in zip(calibration.names, s.x, s.y, u, strict=False):
        label = f"{name}   {x:.4f} m" + (f" ± {ux / MILLIMETRE:.2f} mm" if ux > 0.0 else "")
        ax.annotate(label, (x, y / MILLIMETRE), xytext=(5, 7), textcoords="offset points", fontsize=7.5, rotation=22)
    ax.margins(x=0.05, y=0.35)
    ax.set_xlim(right=s.x.max() + 0.25 * np.ptp(s.x))
    ax.set_ylim(top=ax.get_ylim()[1] + 0.35 * np.ptp(ax.get_ylim()))
    ax.set_xlabel("distance along the line (m)")
    ax.set_ylabel("offset to the left (mm)")
    return figure


def _residuals(calibration: "BaselineCalibration") -> Figure:
    shots, distance = calibration.observations, calibration.lengths.distance
    residual = calibration.shot_residuals / MILLIMETRE
    figure = Figure(figsize=(9.4, 4.3), layout="constrained")
    ax = figure.add_subplot()
    far = np.linspace(0.0, 1.03 * float(distance.max()), 101)
    settings = calibration.settings
    claim = settings.specified_mm + settings.specified_ppm * PPM * far / MILLIMETRE
    ax.fill_between(far, -2 * claim, 2 * claim, color="#eef2f5", lw=0, label="twice the claimed u")
    ax.axhline(0.0, color=FAINT, lw=0.8)
    for k, label, colour, marker in _setups(calibration):
        mine = shots.setup == k
        ax.scatter(distance[mine], residual[mine], s=22, c=colour, marker=marker, lw=0, alpha=0.75, label=label)
    out = ~calibration.keep
    for d in distance[out]:
        ax.axvline(d, color=BAD, lw=0.8, ls=":")
    ax.set_xlabel("horizontal distance (m)")
    ax.set_ylabel("observed minus adjusted (mm)")
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower left", ncols=7)
    return figure


def _weather(calibration: "BaselineCalibration") -> Figure:
    """Residuals in ppm over the change of the index.

    A slope shows that the light does not follow the sensors' index.
    """
    shots, lengths = calibration.observations, calibration.lengths
    residual = calibration.shot_residuals / lengths.distance / PPM
    change = -(lengths.index - lengths.index[calibration.keep].mean()) / PPM
    long = lengths.distance > 0.25 * lengths.distance.max()
    figure = Figure(figsize=(9.4, 4.0), layout="constrained")
    ax = figure.add_subplot()
    ax.axhline(0.0, color=FAINT, lw=0.8)
    for k, label, colour, marker in _setups(calibration):
        mine = long & (shots.setup == k)
        ax.scatter(change[mine], residual[mine], s=22, c=colour, marker=marker, lw=0, alpha=0.75, label=label)
    share, u = calibration.weather
    if np.isfinite(share):
        ends = np.array([change[long].min(), change[long].max()])
        ax.plot(ends, (1.0 - share) * ends, color=INK, lw=1.1, label=f"light followed {share:.2f} ± {u:.2f} of it")
    ax.set_xlabel("change of the corrected length by weather (ppm)")
    ax.set_ylabel("residual over distance (ppm)")
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower left", ncols=7)
    return figure


def _corrections(calibration: "BaselineCalibration") -> Figure:
    lengths = calibration.lengths
    figure = Figure(figsize=(9.4, 3.4), layout="constrained")
    panels = figure.subplots(1, 3)
    for ax, values, label, scale in (
        (panels[0], lengths.first, "first velocity (mm)", MILLIMETRE),
        (panels[1], lengths.second + lengths.chord, "second velocity, chord (µm)", 1e-6),
        (panels[2], lengths.level, "slope to level (mm)", MILLIMETRE),
    ):
        ax.scatter(lengths.distance, values / scale, s=10, c=SERIES[0], lw=0, alpha=0.7)
        ax.axhline(0.0, color=FAINT, lw=0.8)
        ax.set_title(label)
        ax.set_xlabel("distance (m)")
    return figure


def _cyclic(calibration: "BaselineCalibration") -> Figure:
    unit = calibration.settings.unit_length
    assert unit is not None
    shots = calibration.observations
    angle = np.linspace(0.0, 1.0, 201)

    share = shots.slope / unit % 1.0
    figure = Figure(figsize=(9.4, 3.6), layout="constrained")
    ax = figure.add_subplot()
    ax.plot(angle * unit, cyclic_error(calibration, angle) / MILLIMETRE, color=INK, lw=1.2, label="adjusted")
    values = (calibration.shot_residuals + cyclic_error(calibration, share)) / MILLIMETRE
    for k, label, colour, marker in _setups(calibration):
        mine = shots.setup == k
        ax.scatter(share[mine] * unit, values[mine], s=18, c=colour, marker=marker, lw=0, alpha=0.75, label=label)
    ax.set_xlabel(f"position in the unit length of {unit:g} m (m)")
    ax.set_ylabel("cyclic term and residual (mm)")
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower left", ncols=7)
    return figure
