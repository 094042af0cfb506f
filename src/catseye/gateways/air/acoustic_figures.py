"""Figures of acoustic paths: signature, recordings, correlations, temperature over time."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from catseye.gateways.air.charts import DIRECTIONS
from catseye.gateways.writers.drawing import BAD, FAINT, SERIES, Figure, styled
from catseye.signal.delay.waveform import sampled

if TYPE_CHECKING:
    from catseye.reduction.air.sound_path import AcousticPath, ChannelTrace


def acoustic_drawings(path: "AcousticPath") -> dict[str, Figure]:
    """Figures of one path, by name."""
    with styled():
        drawn: dict[str, Figure] = {}
        if path.shots.traces and path.sheet.signal is not None:
            drawn["signature"] = _signature(path)
        if path.shots.traces:
            drawn["recording"] = _recording(path.shots.traces)
            drawn["correlation"] = _correlation(path.shots.traces)
        if path.used.any():
            drawn["temperature"] = _in_time(path)
        return drawn


def _signature(path: "AcousticPath") -> Figure:
    """Pure wave that is sent, and its autocorrelation, at the recording's rate.

    Source: [PARKER04] chapter 8, acoustic thermometry, figure 1.
    """
    assert path.sheet.signal is not None
    step = float(np.median(np.diff(path.shots.traces[0].time)))
    wave = sampled(path.sheet.signal.kind, 1.0 / step, **path.sheet.signal.values)
    time = step * np.arange(len(wave))
    autocorrelation = np.correlate(wave, wave, mode="full") / float(wave @ wave)
    lag = step * (np.arange(len(autocorrelation)) - len(wave) + 1)
    figure = Figure(figsize=(9.4, 2.9), layout="constrained")
    pure, peak = figure.subplots(1, 2, width_ratios=(2.2, 1.0))
    pure.plot(time * 1e3, wave, color=SERIES[0], lw=0.7)
    pure.set(xlabel="time (ms)", ylabel="signal (units of the sheet)")
    pure.set_title(f"Signature: {path.sheet.signal.kind}, {len(wave)} samples")
    pure.margins(x=0.0)
    peak.plot(lag * 1e3, autocorrelation, color=SERIES[2], lw=0.7)
    peak.axhline(0.0, color=FAINT, lw=0.6)
    peak.set(xlabel="delay (ms)", title="Its autocorrelation")
    width = 0.1 * float(time[-1])
    peak.set_xlim(-width * 1e3, width * 1e3)
    return figure


def _recording(traces: Sequence["ChannelTrace"]) -> Figure:
    figure = Figure(figsize=(9.4, 1.7 * len(traces) + 0.5), layout="constrained")
    for ax, trace, colour in zip(figure.subplots(len(traces), 1, squeeze=False)[:, 0], traces, SERIES, strict=False):
        ax.plot(trace.time * 1e3, trace.samples, color=colour, lw=0.6)
        if np.isfinite(trace.arrival):
            ax.axvline(trace.arrival * 1e3, color=BAD, lw=1.0)
        ax.set_title(f"{trace.channel}, {DIRECTIONS[trace.channel]} ({trace.file})")
        ax.margins(x=0.0)
    figure.supylabel("signal (units of the recorder)", fontsize=9.0)
    figure.supxlabel("time since the file's first sample (ms); red line: detected arrival", fontsize=9.0)
    return figure


def _correlation(traces: Sequence["ChannelTrace"]) -> Figure:
    figure = Figure(figsize=(9.4, 1.9 * len(traces) + 0.5), layout="constrained")
    panels = figure.subplots(len(traces), 2, squeeze=False, gridspec_kw={"width_ratios": (2.2, 1.0)})
    for (wide, near), trace, colour in zip(panels, traces, SERIES, strict=False):
        middle = trace.arrival if np.isfinite(trace.arrival) else trace.lag[np.argmax(trace.correlation)]
        step = trace.lag[1] - trace.lag[0]
        close = np.abs(trace.lag - middle) <= 8.0 * step
        wide.plot(trace.lag * 1e3, trace.correlation, color=colour, lw=0.7)
        near.plot((trace.lag[close] - middle) * 1e6, trace.correlation[close], "o-", color=colour, ms=3, lw=0.8)
        for ax, at in ((wide, middle * 1e3), (near, 0.0)):
            if np.isfinite(trace.arrival):
                ax.axvline(at, color=BAD, lw=0.9)
            ax.axhline(0.0, color=FAINT, lw=0.6)
        wide.set_title(f"{trace.channel}, {DIRECTIONS[trace.channel]}")
        wide.margins(x=0.0)
    figure.supylabel("correlation (units of the recorder)", fontsize=9.0)
    panels[-1, 0].set_xlabel("delay since the file's first sample (ms)")
    panels[-1, 1].set_xlabel("relative to the detected arrival (µs)")
    return figure


def _in_time(path: "AcousticPath") -> Figure:
    used, air, sheet = path.used, path.temperatures, path.sheet
    minutes = (path.shots.mjd[used] - path.shots.mjd[0]) * 1440.0
    t, u, noise = air.temperature_c[used], air.u_temperature_c[used], air.parts_c["time"][used]
    bidirectional = path.shots.time_ba is not None
    figure = Figure(figsize=(9.4, 5.2 if bidirectional else 3.2), layout="constrained")
    panels = figure.subplots(2 if bidirectional else 1, 1, sharex=True, squeeze=False)[:, 0]
    panels[0].fill_between(
        minutes, t - u, t + u, color="#dfe9f3", lw=0, label="standard uncertainty, incl. common part"
    )
    panels[0].errorbar(minutes, t, noise, fmt="o", color=SERIES[0], ms=4, elinewidth=1.0, label="acoustic (bar: noise)")
    station = path.shots.weather[0][used]
    if np.isfinite(station).any():
        label = f"thermometer: {path.weather_of}"
        panels[0].plot(minutes, station, color=SERIES[1], lw=1.1, ls="--", label=label)
    panels[0].set_ylabel("mean temperature of the path (°C)")
    panels[0].legend(loc="best")
    if bidirectional:
        panels[1].errorbar(minutes, air.wind[used], air.u_wind[used], fmt="o", color=SERIES[2], ms=4, elinewidth=1)
        panels[1].axhline(0.0, color=FAINT, lw=0.7)
        panels[1].set_ylabel(f"wind, {sheet.ranger} to {sheet.target} (m/s)")
    panels[-1].set_xlabel(f"minutes from MJD {path.shots.mjd[0]:.5f} UTC")
    return figure
