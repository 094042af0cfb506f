"""Texts, rows and JSON of one buffer."""

import math
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np

from catseye.gateways.writers.passage import Passage
from catseye.reduction.detection.buffer_phase import BufferPhase
from catseye.signal.detection.harmonics import DISTORTED


def buffer_passages(buffer: BufferPhase) -> list[Passage]:
    """Samples, phase, amplitude and harmonics in words.

    buffer   from `buffer_phase`
    """
    sampling, seen, first = buffer.sampling, buffer.detection, buffer.methods[0]
    scale = "volts" if sampling.volts_per_code == 1.0 else f"codes of {1e3 * sampling.volts_per_code:.4g} mV"
    passages = [
        Passage(
            "Samples",
            f"{buffer.name}: {sampling.cycles} cycles of {sampling.samples_per_cycle} {scale} at "
            f"{sampling.sample_rate_hz:g}/s, {buffer.status}; {int(seen.clipped)} clipped, largest "
            f"{float(seen.largest):.4g} V, offset {1e3 * float(seen.offset):.3g} mV, noise "
            f"{_text(1e3 * float(seen.noise), '.3g', 'unknown')} mV a sample",
        ),
        Passage(
            "Phase",
            f"{first.phase:.6f} rad (u {_text(first.u_phase, '.6f', 'unknown')}), amplitude {first.amplitude:.5f} V "
            f"(u {_text(first.u_amplitude, '.5f', 'unknown')})",
        ),
    ]
    largest = buffer.largest_harmonic
    if largest is not None:
        bound = (
            "" if math.isnan(buffer.folded) else f"; clipping alike turns the phase by {buffer.folded:.1e} rad at most"
        )
        passages.append(
            Passage(
                "Harmonics",
                f"largest is {largest.order}, {100 * largest.relative:.2f} % of the fundamental (u "
                f"{100 * largest.u_relative:.2f} %; limit of the second and third {100 * DISTORTED:g} %){bound}",
            )
        )
    return passages


def buffer_rows(buffer: BufferPhase) -> Iterator[str]:
    """Methods side by side and harmonics as lines of text.

    buffer   from `buffer_phase`
    """
    yield ""
    yield f"{'method':<22}{'phase':>11}{'u':>10}{'amplitude':>11}{'u':>9}{'difference':>12}{'expected':>10}{'u':>9}"
    yield f"{'':<22}{'rad':>11}{'rad':>10}{'V':>11}{'V':>9}{'mrad':>12}{'mrad':>10}{'mrad':>9}"
    for each in buffer.methods:
        size, spread = _text(each.amplitude, ".5f"), _text(each.u_amplitude, ".5f")
        apart = [""] * 3
        if each is not buffer.methods[0]:
            apart = [f"{1e3 * v:.3f}" for v in (each.difference, each.expected_difference, each.u_difference)]
        line = f"{each.name:<22}{each.phase:11.6f}{_text(each.u_phase, '.6f'):>10}{size:>11}{spread:>9}"
        yield f"{line}{apart[0]:>12}{apart[1]:>10}{apart[2]:>9}".rstrip()
    if math.isfinite(buffer.frequency_hz):
        u = _text(buffer.u_frequency_hz, ".4f", "unknown")
        yield f"{'strongest tone':<22}{buffer.frequency_hz:.4f} Hz (u {u})"
    if not buffer.harmonics:
        return
    yield ""
    yield f"{'harmonic':<10}{'amplitude':>11}{'share':>9}{'u':>8}{'effect, synchronous':>21}{'zero crossings':>16}"
    yield f"{'':<10}{'V':>11}{'%':>9}{'%':>8}{'mrad':>21}{'mrad':>16}"
    for h in buffer.harmonics:
        shares = f" {100 * h.relative:8.3f}{_text(100 * h.u_relative, '.3f'):>8}"
        yield f"{h.order:<10}{h.amplitude:11.5f}{shares}{1e3 * h.effect:21.3f}{_text(1e3 * h.crossing, '.3f'):>16}"


def buffer_object(buffer: BufferPhase) -> dict[str, Any]:
    """JSON object of a buffer, SI units.

    buffer   from `buffer_phase`
    """
    observed, sampling = buffer.detection, buffer.sampling
    largest = buffer.largest_harmonic
    return {
        "verdict": buffer.verdict.to_object(),
        "name": buffer.name,
        "status": buffer.status,
        "samples_per_cycle": sampling.samples_per_cycle,
        "cycles": sampling.cycles,
        "intermediate_hz": sampling.intermediate_hz,
        "sample_rate_hz": sampling.sample_rate_hz,
        "volts_per_code": sampling.volts_per_code,
        "phase": buffer.methods[0].phase,
        "u_phase": buffer.methods[0].u_phase,
        "amplitude_volt": buffer.methods[0].amplitude,
        "u_amplitude_volt": buffer.methods[0].u_amplitude,
        "phasor_volt": [float(np.real(observed.phasor)), float(np.imag(observed.phasor))],
        "u_phasor_volt": float(observed.u_phasor),
        "offset_volt": float(observed.offset),
        "noise_volt": float(observed.noise),
        "largest_volt": float(observed.largest),
        "clipped": int(observed.clipped),
        "frequency_hz": buffer.frequency_hz,
        "u_frequency_hz": buffer.u_frequency_hz,
        "methods": [{**asdict(item), "agrees": item.agrees} for item in buffer.methods],
        "harmonics": [asdict(item) for item in buffer.harmonics],
        "largest_harmonic": None if largest is None else largest.order,
        "harmonic_limit": DISTORTED,
        "folded_bound": buffer.folded,
    }


def _text(value: float, form: str, unknown: str = "") -> str:
    return format(value, form) if math.isfinite(value) else unknown
