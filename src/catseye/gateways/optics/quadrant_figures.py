"""Figure of a quadrant detector as SVG text: saturation, noise, and the loop that centres a spot."""

from typing import Any

import numpy as np

from catseye.gateways.writers.drawing import FAINT, SERIES, Figure, Svg, styled, svg
from catseye.optics.detector import quadrant_position, quadrant_signals
from catseye.optics.quadrant import centre_slope, centred_places, place_of_ratio, place_uncertainty, settled_noise

MICROMETRE = 1e-6  # m
FINE = 241
FARTHEST = 1.5  # radii drawn
SIGNS = np.array([1.0, -1.0, -1.0, 1.0])  # quadrants of the right half less those of the left


def quadrant_plot(
    spot: float, *, gap: float, u_signal: float, gain: float, offset: float, steps: int, seed: int
) -> tuple[Svg, dict[str, Any]]:
    """Place read against true place, its noise, and a centred spot in time, as SVG text and numbers.

    spot       m, radius at 1/e^2
    gap        m, dead width between the quadrants
    u_signal   noise of each quadrant over the sum of all four
    gain       of the servo, a step
    offset     m, of the spot at the start, in x; half of it in y
    steps      of the servo
    seed       of the noise

    Raises ValidityError for invalid sizes and a gain that is not stable.
    """
    rng = np.random.default_rng(seed)
    x = np.linspace(-FARTHEST * spot, FARTHEST * spot, FINE)
    signals = quadrant_signals(x, 0.0, spot, gap)
    ratio = signals @ SIGNS / signals.sum(axis=-1)
    slope = centre_slope(spot)
    linear, spread = quadrant_position(signals, slope=slope, u_signal=u_signal)
    places = centred_places([offset, 0.5 * offset], spot, gain=gain, u_signal=u_signal, steps=steps, rng=rng, gap=gap)
    noise = settled_noise(spot, gain=gain, u_signal=u_signal)
    um = 1.0 / MICROMETRE
    with styled():
        figure = Figure(figsize=(11.4, 3.9), layout="constrained")
        read, noise_panel, loop = figure.subplots(1, 3)
        read.plot(x * um, x * um, color=FAINT, lw=0.9, ls="--", label="true")
        read.plot(x * um, linear[:, 0] * um, color=SERIES[1], lw=1.5, label="to first order: saturates")
        read.plot(x * um, place_of_ratio(ratio, spot) * um, color=SERIES[0], lw=1.5, label="Gaussian inverted")
        read.set(xlabel="place of the spot (µm)", ylabel="place read (µm)")
        read.set_title("Saturation")
        read.legend(loc="upper left")
        noise_panel.plot(
            x * um, place_uncertainty(x, spot, u_signal) * um, color=SERIES[0], lw=1.5, label="Gaussian inverted"
        )
        noise_panel.plot(x * um, np.sqrt(spread[:, 0, 0]) * um, color=SERIES[1], lw=1.5, label="to first order")
        noise_panel.set_yscale("log")
        noise_panel.set(xlabel="place of the spot (µm)", ylabel="u of the place read (µm)")
        noise_panel.set_title(f"Noise, {100 * u_signal:.3g} % of the sum in each quadrant")
        noise_panel.legend(loc="upper center")
        for k, name in enumerate("xy"):
            loop.plot(np.arange(steps + 1), places[:, k] * um, ".-", ms=4, lw=1.0, color=SERIES[k], label=name)
        loop.axhspan(
            -2.0 * noise * um, 2.0 * noise * um, color=FAINT, alpha=0.25, lw=0, label="2 u of the settled spot"
        )
        loop.set(xlabel="step", ylabel="place of the spot (µm)")
        loop.set_title(f"Centring, gain {gain:g}")
        loop.legend(loc="upper right")
        text = svg(figure)
    inside = np.flatnonzero(np.all(np.abs(places) <= np.maximum(3.0 * noise, 0.01 * spot), axis=1))
    outside = np.setdiff1d(np.arange(steps + 1), inside)
    return text, {
        "spot": spot,
        "centre_slope": slope,
        "u_place_centre": float(place_uncertainty(0.0, spot, u_signal)),
        "u_settled": noise,
        "settled_after_steps": None if len(outside) and outside[-1] == steps else int(outside.max(initial=-1)) + 1,
        "reads_90_percent_to": float(_reach(x, linear[:, 0])),
    }


def _reach(x: np.ndarray, linear: np.ndarray) -> float:
    """Largest place, m, that the first order reads to 90 %."""
    right = x > 0.0
    good = linear[right] >= 0.9 * x[right]
    return float(x[right][good].max()) if good.any() else 0.0
