"""Figures of measured scans: amplitudes along an axis or over a raster, with the fitted spot."""

import numpy as np

from catseye.gateways.steering.tracking_figures import search_figure
from catseye.gateways.writers.drawing import BAD, FAINT, SERIES, Figure, styled
from catseye.reduction.scans.scan import ScanFit
from catseye.reduction.steering.spot_fit import FOUND, Spot

FINE = 601


def scan_figures(fits: tuple[ScanFit, ...]) -> dict[str, Figure]:
    """Figure of each scan, by the stem of its file."""
    return {fit.readings.name.removesuffix(".csv"): scan_figure(fit) for fit in fits}


def scan_figure(fit: ScanFit) -> Figure:
    """Amplitudes of one scan with the spot: a profile of one axis, or a map of both."""
    return raster_figure(fit) if fit.axes == "both" else profile_figure(fit)


def raster_figure(fit: ScanFit) -> Figure:
    """Amplitudes over azimuth and elevation, and the centre."""
    spot = Spot(
        FOUND,
        counts=fit.values[:2],
        covariance=fit.covariance[:2, :2],
        amplitude=float(fit.values[3]),
        radius=float(fit.values[2]),
        flatness=float(fit.values[5]),
        looked_at=fit.readings.counts,
        seen=fit.readings.amplitude,
    )
    return search_figure(spot, fit.head.zeros, fit.readings.name)


def profile_figure(fit: ScanFit) -> Figure:
    """Amplitude by counts of one axis, the fitted spot, its width and centre; residuals below."""
    k = 0 if fit.axes == "azimuth" else 1
    n, a = fit.readings.counts[:, k], fit.readings.amplitude
    line = np.tile(fit.values[:2], (FINE, 1))
    line[:, k] = np.linspace(n.min(), n.max(), FINE)
    centre, u, peak = fit.values[k], fit.u[k], fit.values[3]
    curve = fit.at(line)
    with styled():
        figure = Figure(figsize=(7.4, 4.8), layout="constrained")
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
        above.axvspan(centre - u, centre + u, color=BAD, alpha=0.25, lw=0)
        above.axvline(centre, color=BAD, lw=1.0, label=f"centre {centre:.2f} ± {u:.2f} counts")
        above.plot(line[:, k], curve, color=SERIES[1], lw=1.5, label=f"spot, flatness {fit.values[5]:.1f}")
        half = line[curve > fit.values[4] + 0.5 * peak, k]
        level = fit.values[4] + 0.5 * peak
        width = f"{1e3 * fit.width:.3f} mrad wide at half"
        above.plot([half[0], half[-1]], [level, level], color=FAINT, lw=1.0, ls="--", label=width)
        above.errorbar(n, a, fit.sigma, fmt="o", ms=3.5, lw=0.8, color=SERIES[0], label="readings, u")
        above.set_ylabel("amplitude (V)")
        above.set_title(f"{fit.readings.name}: {fit.axes} scan, peak {peak:.3f} ± {fit.u[3]:.3f} V")
        above.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        below.axhline(0.0, color=FAINT, lw=0.8)
        below.errorbar(n, fit.residual, fit.sigma, fmt="o", ms=3.5, lw=0.8, color=SERIES[0])
        below.set(xlabel=f"{fit.axes} (counts)", ylabel="residual (V)")
        below.ticklabel_format(axis="x", useOffset=False)
        return figure
