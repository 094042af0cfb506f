"""Figure of one buffer: cycle with fit, residual, spectrum, harmonics."""

import numpy as np

from catseye.gateways.writers.drawing import BAD, FAINT, INK, SERIES, Figure, styled
from catseye.reduction.detection.buffer_phase import BufferPhase
from catseye.signal.detection.harmonics import DISTORTED, SURE

DRAWN = 4000  # samples as points at most


def buffer_figure(buffer: BufferPhase) -> Figure:
    """Figure of a buffer in four panels.

    buffer   from `buffer_phase`
    """
    with styled():
        figure = Figure(figsize=(11.0, 7.0))
        edges = {"left": 0.075, "right": 0.985, "bottom": 0.08, "top": 0.91, "hspace": 0.36, "wspace": 0.22}
        cycle, spectrum, residual, harmonics = figure.subplots(2, 2, gridspec_kw=edges).flat
        _cycle(cycle, buffer)
        _residual(residual, buffer)
        _spectrum(spectrum, buffer)
        _harmonics(harmonics, buffer)
        sampling = buffer.sampling
        title = f"{buffer.name}: {sampling.cycles} cycles of {sampling.samples_per_cycle} samples"
        figure.suptitle(title, x=0.075, ha="left", fontsize=11, fontweight="bold", color=INK)
        return figure


def _cycle(ax, buffer: BufferPhase) -> None:
    n = buffer.sampling.samples_per_cycle
    step = max(1, len(buffer.volts) // (DRAWN // n * n) if len(buffer.volts) > DRAWN else 1)
    rows = buffer.volts.reshape(-1, n)[::step]
    at = np.tile(np.arange(n), len(rows))
    ax.plot(at, rows.ravel(), ".", ms=2.0, color=FAINT, alpha=0.35, label="samples")
    ax.plot(np.arange(n), buffer.mean_cycle, "o", ms=3.0, color=SERIES[0], label="mean of the cycles")
    ax.plot(np.arange(n), buffer.fitted, color=SERIES[1], lw=1.3, label="fitted fundamental")
    step_volt = buffer.sampling.volts_per_code
    for end in buffer.sampling.ends:
        if abs(end * step_volt) < 1.4 * np.max(np.abs(buffer.volts)):
            ax.axhline(end * step_volt, color=BAD, lw=0.8, ls=":")
    low, high = buffer.volts.min(), buffer.volts.max()
    ax.set(title="One cycle", xlabel="sample of the cycle", ylabel="volts (V)", xlim=(-0.5, n - 0.5))
    ax.set_ylim(low - 0.05 * (high - low), high + 0.28 * (high - low))
    ax.legend(loc="upper center", ncols=3, markerscale=2.0)


def _residual(ax, buffer: BufferPhase) -> None:
    n, m = buffer.sampling.samples_per_cycle, buffer.sampling.cycles
    remainder = 1e3 * (buffer.mean_cycle - buffer.fitted)
    noise = 1e3 * float(buffer.detection.noise) / np.sqrt(m)
    if np.isfinite(noise):
        ax.axhspan(-2.0 * noise, 2.0 * noise, color=SERIES[0], alpha=0.12, lw=0.0, label="2 u of the noise")
    ax.plot(np.arange(n), remainder, "o-", ms=3.0, lw=1.0, color=SERIES[0], label="mean less fundamental")
    ax.set(
        title="Residual of the mean cycle", xlabel="sample of the cycle", ylabel="residual (mV)", xlim=(-0.5, n - 0.5)
    )
    top = 1.6 * max(float(np.max(np.abs(remainder))), 2.2 * noise if np.isfinite(noise) else 0.0, 1e-9)
    ax.set_ylim(-top, top)
    ax.legend(loc="upper center", ncols=2)


def _spectrum(ax, buffer: BufferPhase) -> None:
    frequency, size = buffer.spectrum()
    size = np.maximum(size, 1e-12 * max(float(size.max()), 1e-300))
    ax.loglog(frequency, size, color=SERIES[0], lw=0.7)
    centre = buffer.sampling.intermediate_hz
    orders = np.array([1, *(h.order for h in buffer.harmonics)])
    sizes = np.array([float(buffer.detection.amplitude), *(h.amplitude for h in buffer.harmonics)])
    ax.loglog(
        orders * centre, np.maximum(sizes, 1e-12), "o", ms=4.0, color=SERIES[1], label="fundamental and harmonics"
    )
    ax.set(title="Spectrum", xlabel="frequency (Hz)", ylabel="amplitude (V)")
    ax.set_ylim(max(float(np.quantile(size, 0.02)) / 3.0, 1e-10), 4.0 * float(np.max([*size, *sizes])))
    ax.legend(loc="upper right")


def _harmonics(ax, buffer: BufferPhase) -> None:
    if not buffer.harmonics:
        ax.text(0.5, 0.5, "no harmonic is resolved", transform=ax.transAxes, ha="center", color=FAINT)
        ax.set(title="Harmonics")
        return
    order = np.array([h.order for h in buffer.harmonics])
    share = 100.0 * np.array([h.relative for h in buffer.harmonics])
    u = 100.0 * buffer.harmonics[0].u_relative
    over = (share - SURE * u > 100.0 * DISTORTED) & (order <= 3)
    ax.bar(order, share, width=0.6, color=[BAD if item else SERIES[0] for item in over])
    ax.errorbar(
        order, share, yerr=2.0 * u if np.isfinite(u) else None, fmt="none", ecolor=INK, elinewidth=0.9, capsize=2.0
    )
    ax.axhline(100.0 * DISTORTED, color=BAD, lw=1.0, ls=(0, (4, 2)))
    top = 1.25 * max(100.0 * DISTORTED, float(np.max(share + (2.0 * u if np.isfinite(u) else 0.0))))
    ax.text(
        order[-1] + 0.45,
        100.0 * DISTORTED + 0.015 * top,
        "limit of 2 and 3",
        color=BAD,
        fontsize=8,
        ha="right",
        va="bottom",
    )
    ax.set(title="Harmonics over the fundamental", xlabel="order", ylabel="share (%), bars of 2 u", ylim=(0.0, top))
    ax.set_xticks(order)
