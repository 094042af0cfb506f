"""Frequencies, sampling and disturbances as rows and JSON; timing of the converter as a figure."""

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np

from catseye.gateways.writers.drawing import BAD, FAINT, INK, SERIES, Figure, styled
from catseye.gateways.writers.passage import Passage
from catseye.reduction.detection.frequency_chain import FrequencyChain, limits

SHOWN_CYCLES = 3  # of the signal in the timing diagram
SHOWN_PULSES = 24  # trigger pulses a cycle in it, at most: more would be a grey band


def frequency_passages(chain: FrequencyChain) -> list[Passage]:
    """Plan, sidebands, sampling and disturbance in words.

    chain   from `frequency_chain`
    """
    plan, sampling, bands, noise = chain.plan, chain.sampling, chain.bands, chain.disturbance
    falls = "falls" if plan.phase_sign < 0 else "grows"
    return [
        Passage(
            "Plan",
            f"{plan.reference_hz / 1e6:g} MHz times {plan.multiple} modulate the laser at "
            f"{plan.modulation_hz / 1e6:.6f} MHz; the oscillator is locked to the reference at "
            f"{chain.local_oscillator_hz / 1e6:.6f} MHz, {plan.oscillator} it by the intermediate frequency, "
            f"{sampling.intermediate_hz:g} Hz: the phase {falls} with distance, "
            f"{abs(plan.phase_gradient(chain.group_index)):.4f} rad/m, and repeats every "
            f"{1e3 * chain.half_wavelength:.6f} mm",
        ),
        Passage(
            "Sidebands",
            f"{bands.lower_hz / 1e9:.1f} and {bands.upper_hz / 1e9:.1f} GHz about {bands.carrier_hz / 1e9:.1f} GHz "
            f"({1e3 * chain.wavelength_um:g} nm): the index of their beat is 1 + {1e6 * bands.refractivity:.6f} ppm, "
            f"by the derivative {1e6 * (chain.group_index - 1.0):.6f} ppm; the modulation's wavelength "
            f"{2e3 * chain.half_wavelength:.6f} mm",
        ),
        Passage(
            "Sampling",
            f"{sampling.cycles} cycles of {sampling.samples_per_cycle}, {sampling.samples} samples at "
            f"{sampling.sample_rate_hz:g}/s in {1e3 * sampling.duration:g} ms; the phase is that of "
            f"{1e3 * sampling.centre:.4f} ms after the trigger; harmonics that fold back: "
            f"{', '.join(str(k) for k in chain.folding[:4]) or 'none up to 130'}",
        ),
        Passage(
            "Disturbance",
            f"of the same frequency, 1:{1.0 / noise.ratio:g}" if noise.ratio > 0.0 else "none",
        ),
    ]


def frequency_rows(chain: FrequencyChain) -> Iterator[str]:
    """Effects on phase and range as lines of text.

    chain   from `frequency_chain`
    """
    noise = chain.disturbance
    yield ""
    yield f"{'disturbance in quadrature':<34}{1e3 * noise.phase_error:10.4f} mrad{1e6 * noise.range_error:10.3f} µm"
    turned = noise.worst * np.pi * 2.0 / chain.half_wavelength
    yield f"{'at the worst of all phases':<34}{1e3 * turned:10.4f} mrad{1e6 * noise.worst:10.3f} µm"
    yield f"{'root mean square over phases':<34}{'':>15}{1e6 * noise.rms:10.3f} µm"
    if chain.multipath is not None:
        yield f"{'as a second path, range too long':<34}{'':>15}{1e6 * chain.multipath:10.3f} µm"
    per_radian = chain.half_wavelength / (2.0 * np.pi)
    jitter = f"{1e3 * chain.u_jitter_phase:10.4f} mrad{1e6 * chain.u_jitter_phase * per_radian:10.3f} µm"
    yield f"{'u of 1 µs jitter of each sample':<34}{jitter}"
    for hz, share in chain.lines.items():
        yield f"{f'line of {hz:g} Hz in the phase':<34}{share:10.4f} of it remain"
    if chain.motion is not None:
        motion = chain.motion
        yield f"{'range at the phase less at trigger':<34}{'':>15}{1e6 * float(motion.range_since_trigger):10.3f} µm"
        yield f"{'amplitude of a moving target':<34}{float(motion.amplitude_factor):10.6f} of that at rest"


def frequency_object(chain: FrequencyChain) -> dict[str, Any]:
    """JSON object of a plan, SI units.

    chain   from `frequency_chain`
    """
    plan, sampling, motion = chain.plan, chain.sampling, chain.motion
    moving = None
    if motion is not None:
        moving = {
            "phase_rate": float(motion.phase_rate),
            "epoch": motion.epoch,
            "range_since_trigger": float(motion.range_since_trigger),
            "amplitude_factor": float(motion.amplitude_factor),
            "phase_bias_bound": float(motion.phase_bias_bound),
        }
    return {
        "verdict": chain.verdict.to_object(),
        "reference_hz": plan.reference_hz,
        "multiple": plan.multiple,
        "modulation_hz": plan.modulation_hz,
        "local_oscillator_hz": chain.local_oscillator_hz,
        "intermediate_hz": sampling.intermediate_hz,
        "phase_sign": plan.phase_sign,
        "phase_gradient": plan.phase_gradient(chain.group_index),
        "half_wavelength": chain.half_wavelength,
        "group_index": chain.group_index,
        "air_model": chain.air_model,
        "wavelength_um": chain.wavelength_um,
        "carrier_hz": float(chain.bands.carrier_hz),
        "lower_sideband_hz": float(chain.bands.lower_hz),
        "upper_sideband_hz": float(chain.bands.upper_hz),
        "beat_index": 1.0 + float(chain.bands.refractivity),
        "samples_per_cycle": sampling.samples_per_cycle,
        "cycles": sampling.cycles,
        "samples": sampling.samples,
        "sample_rate_hz": sampling.sample_rate_hz,
        "duration": sampling.duration,
        "centre": sampling.centre,
        "limits": limits(),
        "folding_harmonics": list(chain.folding),
        "lines": [{"frequency_hz": hz, "response": share} for hz, share in chain.lines.items()],
        "disturbance": asdict(chain.disturbance),
        "multipath": chain.multipath,
        "motion": moving,
        "u_jitter_phase": chain.u_jitter_phase,
    }


def timing_figure(chain: FrequencyChain) -> Figure:
    """Timing diagram of the converter: gate, trigger pulses, square wave, signal.

    chain   from `frequency_chain`
    """
    sampling = chain.sampling
    n, m, period = sampling.samples_per_cycle, sampling.cycles, 1e3 / sampling.intermediate_hz
    complete = min(m, SHOWN_CYCLES)
    every = max(1, -(-n // SHOWN_PULSES))
    before, after = 0.3 * period, (complete + 0.45) * period
    with styled():
        figure = Figure(figsize=(10.5, 5.2))
        edges = {"left": 0.17, "right": 0.98, "bottom": 0.12, "top": 0.88}
        ax = figure.subplots(gridspec_kw=edges)
        start, end = -before, after
        closes = [m * period] if m <= SHOWN_CYCLES else []
        gate = [3.2, 4.0, 3.2, 3.2] if closes else [3.2, 4.0, 4.0]
        ax.step([start, 0.0, *closes, end], gate, where="post", color=INK, lw=1.4)
        ticks = np.arange(-int(0.3 * n), int(1.45 * n) + (complete - 1) * n)
        at = ticks[ticks % every == 0] * period / n
        chosen = (at >= 0.0) & (ticks[ticks % every == 0] < m * n)
        inside = at[chosen]
        ax.vlines(at[~chosen], 2.1, 2.8, color=FAINT, lw=0.8, alpha=0.5)
        ax.vlines(inside, 2.1, 2.8, color=SERIES[0], lw=0.9)
        edge = np.arange(-1, 2 * (complete + 1)) * 0.5 * period
        edge = edge[(edge > start) & (edge < end)]
        level = np.where(np.floor(2.0 * edge / period + 0.5).astype(int) % 2 == 0, 1.8, 1.1)
        first = 1.1 if level[0] == 1.8 else 1.8
        ax.step([start, *edge, end], [first, *level, level[-1]], where="post", color=SERIES[2], lw=1.4)
        time = np.linspace(start, end, 1500)
        ax.plot(time, 0.4 + 0.38 * np.cos(2.0 * np.pi * time / period - 1.0), color=FAINT, lw=1.0)
        ax.plot(inside, 0.4 + 0.38 * np.cos(2.0 * np.pi * inside / period - 1.0), "o", ms=2.6, color=SERIES[1])
        for mark in range(complete + 1):
            ax.axvline(mark * period, color=BAD if mark == 0 else FAINT, lw=0.8, ls=":", zorder=0)
        names = ("signal and samples", "square wave of the IF", f"{n} trigger pulses a cycle", "gate")
        ax.set_yticks([0.4, 1.45, 2.45, 3.6], names)
        ax.tick_params(axis="y", length=0, labelcolor=INK)
        ax.grid(visible=False, axis="y")
        ax.set(xlabel="time after the gate opens (ms)", xlim=(start, end), ylim=(-0.15, 4.35))
        drawn = f"; one pulse in {every} is drawn" if every > 1 else ""
        ax.set_title(
            f"{m} cycles of {n} samples at {sampling.intermediate_hz:g} Hz: gate of {1e3 * sampling.duration:g} ms, "
            f"a pulse every {1e3 * period / n:.4g} µs{drawn}"
        )
        return figure
