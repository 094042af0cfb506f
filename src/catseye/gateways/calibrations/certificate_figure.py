"""Figure of a calibration: readings and fit, and residuals, spectrum, noise of averages if present."""

import numpy as np

from catseye.gateways.writers.drawing import BAD, FAINT, SERIES, Figure, styled
from catseye.reduction.calibrations.calibration import Calibration


def calibration_figure(calibration: Calibration) -> Figure:
    """Readings, fit and residuals of a calibration."""
    with styled():
        return _drawn(calibration)


def _drawn(calibration: Calibration) -> Figure:
    below = [draw for name, draw in PANELS.items() if name in calibration.curve]
    heights = [2.0 if not calibration.equal_axes else 1.0, *([1.0] * len(below))]
    figure = Figure(figsize=(8.6, 5.6 if calibration.equal_axes else 2.6 * sum(heights) / 1.7), layout="constrained")
    panels = np.atleast_1d(figure.subplots(1 + len(below), 1, height_ratios=heights))
    _main(panels[0], calibration)
    for draw, ax in zip(below, panels[1:], strict=True):
        draw(ax, calibration)
    return figure


def _main(ax, calibration: Calibration) -> None:
    ax.plot(*calibration.curve["fit"], color=SERIES[1], lw=1.1, label="fit", zorder=2)
    ax.plot(*calibration.curve["readings"], "o", ms=3.2, color=SERIES[0], mew=0, label="readings used", zorder=3)
    x, y = calibration.curve.get("left out", (np.zeros(0), np.zeros(0)))
    if len(x):
        ax.plot(x, y, "x", ms=6, color=BAD, mew=1.4, label="excluded", zorder=4)
    ax.set_xlabel(calibration.axes[0])
    ax.set_ylabel(calibration.axes[1])
    if calibration.equal_axes:
        ax.set_aspect("equal", adjustable="datalim")
    ax.ticklabel_format(useOffset=False)
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))


def _residuals(ax, calibration: Calibration) -> None:
    x, v = calibration.curve["residuals"]
    ax.axhline(0.0, color=FAINT, lw=0.8)
    ax.vlines(x, 0.0, v, color=SERIES[5], lw=0.9)
    ax.plot(x, v, "o", ms=3.0, color=SERIES[0], mew=0)
    ax.set_xlabel(calibration.axes[0])
    unit = calibration.axes[1].rpartition("(")[2]
    # The residual column's unit takes precedence over the readings', which may be coarser.
    column = next((c for c in calibration.columns if c.startswith("residual")), "")
    word = column.rpartition("_")[2].replace("um", "µm")
    ax.set_ylabel(f"residual ({word or unit.rstrip(')')})")


def _spectrum(ax, calibration: Calibration) -> None:
    period, height = calibration.curve["spectrum"]
    ax.plot(period, height, color=SERIES[2], lw=0.9)
    ax.set_xscale("log")
    ax.set_xlabel("period along the rail (mm)")
    ax.set_ylabel("amplitude of residuals (µm)")
    ax.set_ylim(bottom=0.0)


def _averages(ax, calibration: Calibration) -> None:
    number, deviation = calibration.curve["averages"]
    ax.plot(number, deviation, "-o", ms=3.0, color=SERIES[0], mew=0, lw=0.9)
    ax.set_xlabel("readings averaged")
    ax.set_ylabel("Allan deviation (mrad)")
    ax.set_ylim(bottom=0.0)


PANELS = {"residuals": _residuals, "spectrum": _spectrum, "averages": _averages}
