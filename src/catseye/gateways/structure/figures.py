"""Figures of a structure: motion with elevation, residuals, spectra."""

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.gateways.writers.drawing import BAD, FAINT, INK, SERIES, STYLE, Figure, mpl
from catseye.reduction.structure.check import LeaveOut
from catseye.reduction.structure.series import StructureFit
from catseye.reduction.structure.vibration import Vibration

AXES = ("x", "y", "z")
BAND = 2.0  # standard uncertainties shown


def motion_figure(fit: StructureFit) -> Figure:
    """Shift and rotation of the group with elevation, with u and each epoch's residual motion."""
    series = fit.series
    e = np.asarray(series.posture.elevation, dtype=float)
    grid = np.linspace(e.min(), e.max(), 121)
    predicted = fit.predict(grid)
    at, motion = fit.predict(e), fit.residual_motion  # without temperature and direction terms
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.2, 5.4), layout="constrained")
        axes = figure.subplots(2, 3, sharex=True)
        for c in range(6):
            scale, unit = (MILLIMETRE, "mm") if c < 3 else (ARCSECOND, "arc seconds")
            panel, value = axes[c // 3, c % 3], predicted.six[:, c] / scale
            u = BAND * np.sqrt(np.maximum(predicted.six_covariance[:, c, c], 0.0)) / scale
            panel.fill_between(grid / DEGREE, value - u, value + u, color=SERIES[0], alpha=0.18, linewidth=0)
            panel.plot(grid / DEGREE, value, color=SERIES[0])
            panel.plot(e / DEGREE, at.six[:, c] / scale + motion[:, c] / scale, "o", color=INK, markersize=2.6)
            panel.set_title(f"{'shift' if c < 3 else 'turn about'} {AXES[c % 3]}, {unit}")
            if c >= 3:
                panel.set_xlabel("elevation (°)")
        return figure


def residual_figure(fit: StructureFit, check: LeaveOut | None) -> Figure:
    """Map of residuals, points downwards, epochs by elevation; and left-out epochs over their claim."""
    order = np.argsort(np.asarray(fit.series.posture.elevation))
    residual = fit.fit.residual[order] / MILLIMETRE
    limit = float(np.nanquantile(np.abs(residual), 0.98)) or 1.0
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        figure = Figure(figsize=(9.2, 5.2), layout="constrained")
        grid = figure.add_gridspec(2, 3, height_ratios=[1.6, 1.0])
        for i, axis in enumerate(AXES):
            panel = figure.add_subplot(grid[0, i])
            image = panel.imshow(
                residual[:, :, i].T, aspect="auto", cmap="RdBu_r", vmin=-limit, vmax=limit, interpolation="nearest"
            )
            panel.set_title(f"residual {axis}")
            panel.set_xlabel("epochs by elevation")
            if i == 0 and len(fit.series.names) <= 30:
                panel.set_yticks(range(len(fit.series.names)), fit.series.names)
                panel.tick_params(axis="y", labelsize=7)
            elif len(fit.series.names) <= 30:
                panel.set_yticks([])
            else:
                panel.set_ylabel("point" if i == 0 else "")
        figure.colorbar(image, ax=figure.axes, label="mm", pad=0.01)
        below = figure.add_subplot(grid[1, :])
        if check is None:
            below.hist(residual[np.isfinite(residual)], bins=40, color=SERIES[0])
            below.set_xlabel("residual (mm)")
        else:
            u = np.sqrt(np.einsum("tnii->tni", check.covariance))
            ratio = (check.residual / u)[np.isfinite(check.residual)]
            x = np.linspace(-5.0, 5.0, 201)
            below.hist(np.clip(ratio, -5.0, 5.0), bins=50, range=(-5, 5), density=True, color=SERIES[0], alpha=0.75)
            below.plot(x, np.exp(-0.5 * x**2) / np.sqrt(2.0 * np.pi), color=BAD)
            below.set_xlabel(
                "epochs left out: measured minus predicted, in claimed standard uncertainties (clipped at 5)"
            )
        below.set_yticks([])
        below.set_title("Claims are correct if the bars match the red curve" if check is not None else "Residuals")
        return figure


def spectrum_figure(vibration: Vibration) -> Figure:
    """Densities of all series with the first one's confidence band, peaks named."""
    f, density = vibration.spectrum.frequency_hz, vibration.spectrum.density / MILLIMETRE**2
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.2, 4.2), layout="constrained")
        panel = figure.subplots()
        band = vibration.spectrum.interval(0.95)[:, 0] / MILLIMETRE**2
        panel.fill_between(f, band[:, 0], band[:, 1], color=SERIES[0], alpha=0.15, linewidth=0)
        for a, one in enumerate(vibration.series):
            panel.plot(f, density[:, a], color=SERIES[a % len(SERIES)], linewidth=1.0, label=one.name)
        panel.set_yscale("log")
        top = float(density.max())
        for peak in vibration.peaks[:6]:
            x = peak.peak.frequency_hz
            panel.axvline(x, color=FAINT, linewidth=0.7, linestyle=":")
            label = f"{peak.likely_hz:.3g} Hz" + ("" if peak.decided else "?")
            panel.text(x, top * 30.0, label, rotation=90, ha="right", va="top", fontsize=8, color=INK)
        panel.set_ylim(top=top * 50.0)
        limit = float(vibration.spectrum.nyquist_hz.min())
        panel.axvline(limit, color=BAD, linewidth=0.9)
        panel.text(limit, top * 0.5, "Nyquist limit", rotation=90, ha="right", va="top", fontsize=8, color=BAD)
        panel.set_xlim(0.0, 1.02 * f[-1])
        panel.set_xlabel("frequency (Hz)")
        panel.set_ylabel("density of the range (mm²/Hz)")
        if len(vibration.series) <= 12:
            figure.legend(*panel.get_legend_handles_labels(), loc="outside lower center", ncols=4)
        return figure
