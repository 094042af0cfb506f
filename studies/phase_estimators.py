"""Does clipping bias the phase, and whose? Synchronous detection, zero crossings and Fourier transform, side by side.

python studies/phase_estimators.py DIRECTORY

Writes phase-estimators.svg into the directory and prints the table. Section 5.2 of the notes says that a wave clipped
on top lowers the average, shifts the comparator and so the phase. Every wave here is known exactly, 4096 points a
cycle: on these the comparator works, and the converter takes every 64th. The wave begins at places all along its cycle
and among the samples. Bias is against the phase of the fundamental before the distortion, in range at 1500 MHz.

What it shows. Clipping alone biases one edge, not the average of both edges that the Clark-Hess meter takes.
Synchronous detection is right on the mean too; sharp corners alias and spread it by a micrometre among the samples. AC
coupling after the clipping does bias the crossings, and only them: there the notes are right. Where the wave was not
symmetric in time before it was clipped, synchronous detection is biased about twice as much as the average of both
edges; and an amplifier slow to recover biases it where the crossings, far from the top, see nothing. Its plain
advantages are two: it reaches the bound under white noise, and harmonics short of those that alias do not touch it,
where odd ones move both edges alike.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from catseye.gateways.writers.drawing import FAINT, INK, SERIES, STYLE, Figure, mpl, svg
from catseye.signal.detection.frequency_plan import FrequencyPlan
from catseye.signal.detection.phase import detect
from catseye.signal.detection.spectral import bin_phasor, strongest_tone
from catseye.signal.detection.zero_crossing import crossing_phase

FINE = 4096  # points a cycle of the exact wave
PER_CYCLE = 64  # of them the converter takes
MICROMETRE = 1e-6
MICROMETRES_PER_RADIAN = 1.0 / FrequencyPlan().phase_gradient() / MICROMETRE  # below 0: phase falls with distance
METHODS = ("rising edge", "both edges", "synchronous", "FFT bin", "FFT peak")
TURN = 2 * np.pi * np.arange(FINE) / FINE


def harmonic(order: int, size: float, lag: float) -> np.ndarray:
    """Cosine of unit amplitude with one harmonic, at its own phase."""
    return np.cos(TURN) + size * np.cos(order * TURN - lag)


def clip_top(wave: np.ndarray, share: float) -> np.ndarray:
    """Cut off the top `share` of the amplitude."""
    return np.minimum(wave, 1.0 - share)


def recover_slowly(wave: np.ndarray, share: float, late: float) -> np.ndarray:
    """Clipped, and still saturated for a time of `late` cycles after the wave has come back."""
    cut = wave > 1.0 - share
    held = np.any([np.roll(cut, k) for k in range(int(late * FINE) + 1)], axis=0)
    return np.where(held, 1.0 - share, wave)


def high_pass(wave: np.ndarray, corner: float) -> np.ndarray:
    """AC coupling of one pole, steady state; corner in units of the wave's frequency."""
    order = np.arange(FINE // 2 + 1)
    return np.fft.irfft(np.fft.rfft(wave) * (1j * order / (1j * order + corner)), FINE)


@dataclass(frozen=True)
class Case:
    """A distorted wave, and the phase of its fundamental without the distortion."""

    name: str
    wave: np.ndarray
    phase: float = 0.0


def cases(clip: float = 0.2, size: float = 0.01, corner: float = 0.1, late: float = 0.02) -> list[Case]:
    """Clipped share of the amplitude, size of harmonics, corner of the coupling over the IF, recovery in cycles."""
    pure, coupled = np.cos(TURN), -np.arctan2(corner, 1.0)  # a high-pass leads: its phase phi falls by atan(corner)
    return [
        Case("pure", pure),
        Case("constant added, comparator at the mean", pure + 0.5),
        Case("clipped on top", clip_top(pure, clip)),
        Case("clipped on both sides", -clip_top(-clip_top(pure, clip), clip)),
        Case("2nd harmonic in quadrature", harmonic(2, size, np.pi / 2)),
        Case("3rd harmonic in phase", harmonic(3, size, 0.0)),
        Case("3rd harmonic in quadrature", harmonic(3, size, np.pi / 2)),
        Case("2nd harmonic in quadrature, clipped on top", clip_top(harmonic(2, size, np.pi / 2), clip)),
        Case("clipped on top, then AC coupled", high_pass(clip_top(pure, clip), corner), coupled),
        Case("clipped on top, slow to recover", recover_slowly(pure, clip, late)),
    ]


def by_transform(taken: np.ndarray, per_cycle: int) -> dict[str, np.ndarray]:
    """Phase of buffers (..., samples) by the three methods that use every sample."""
    turn = np.pi * (taken.shape[-1] - 1) / per_cycle  # 2 pi f t_c at the nominal f: from the middle to the start
    return {
        "synchronous": detect(taken, per_cycle).phase,
        "FFT bin": np.angle(bin_phasor(taken, per_cycle)),
        "FFT peak": strongest_tone(taken, float(per_cycle)).phase_centre + turn,
    }


def bias(case: Case, places: int = 128, per_cycle: int = PER_CYCLE, cycles: int = 16) -> dict[str, np.ndarray]:
    """Bias of the phase by each method, rad, (places,): the wave begun at that many places along its cycle."""
    starts = np.arange(places) * (FINE // places) + np.arange(places) % (FINE // per_cycle)  # all among the samples
    fine = np.stack([np.roll(case.wave, k) for k in starts])
    true = 2 * np.pi * starts / FINE + case.phase
    taken = np.tile(fine[:, :: FINE // per_cycle], cycles)
    edges = crossing_phase(np.tile(fine, 2), FINE)
    found = {"rising edge": edges.rising, "both edges": edges.phase} | by_transform(taken, per_cycle)
    return {method: np.angle(np.exp(1j * (phase - true))) for method, phase in found.items()}


def scatter(
    noise: float, *, buffers: int, per_cycle: int = PER_CYCLE, cycles: int = 16, seed: int = 5
) -> dict[str, float]:
    """Rms of the phase by each method over buffers of white noise, in units of the bound sqrt(2/mn) noise/amplitude."""
    rng = np.random.default_rng(seed)
    true = rng.uniform(0.0, 2 * np.pi, buffers)
    wave = np.cos(2 * np.pi * np.arange(per_cycle * cycles) / per_cycle - true[:, None])
    taken = wave + rng.normal(scale=noise, size=wave.shape)
    edges = crossing_phase(taken, per_cycle)
    found = {"rising edge": edges.rising, "both edges": edges.phase} | by_transform(taken, per_cycle)
    bound = noise * np.sqrt(2.0 / (per_cycle * cycles))
    errors = {method: np.angle(np.exp(1j * (phase - true))) for method, phase in found.items()}
    return {method: float(np.sqrt(np.mean(e**2)) / bound) for method, e in errors.items()}


def table(clip: float = 0.2) -> str:
    """Mean bias over all places, and the largest departure from it, micrometres of range."""
    lines = [f"bias, um of range: mean (largest departure from it among the samples); clipped share {clip:g}"]
    lines.append(f"{'':44s}" + "".join(f"{method:>20s}" for method in METHODS))
    for case in cases(clip):
        found = {method: MICROMETRES_PER_RADIAN * b for method, b in bias(case).items()}
        cells = (f"{np.mean(b) + 0.0:.2f} ({np.max(np.abs(b - np.mean(b))):.2f})" for b in found.values())
        lines.append(f"{case.name:44s}" + "".join(f"{cell.replace('-0.00', '0.00'):>20s}" for cell in cells))
    return "\n".join(lines)


def noise_table(levels: tuple[float, ...] = (0.003, 0.03, 0.1, 0.3), buffers: int = 4000) -> str:
    """Scatter of each method over the Cramer-Rao bound."""
    lines = ["scatter under white noise, over the bound sqrt(2/mn) noise/amplitude"]
    for level in levels:
        found = scatter(level, buffers=buffers)
        lines.append(f"noise {level:5.3f} of the amplitude{'':17s}" + "".join(f"{found[m]:20.3f}" for m in METHODS))
    return "\n".join(lines)


def figure() -> str:
    """Bias against clipping in three situations, and scatter against noise, as SVG text."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        drawn = Figure(figsize=(9.5, 6.8), layout="constrained")
        axes = drawn.subplots(2, 2)
        shares = np.linspace(0.0, 0.6, 25)
        panels = (
            ("clipped on top", "Clipped on top: one edge is biased, the average not"),
            ("clipped on top, then AC coupled", "Then AC coupled (100 Hz): the crossings are biased"),
            ("2nd harmonic in quadrature, clipped on top", "With 1 % second harmonic: all are biased"),
        )
        for ax, (name, title) in zip(axes.flat, panels, strict=False):
            _draw_bias(ax, name, shares)
            ax.set_title(title)
        _draw_scatter(axes[1, 1])
        drawn.legend(*axes[1, 1].get_legend_handles_labels(), loc="outside lower center", ncols=4)
        return svg(drawn)


def _draw_bias(ax, name: str, shares: np.ndarray) -> None:
    """Mean over the places as a line, all places as a band."""
    for method, colour in zip(("rising edge", "both edges", "synchronous"), SERIES, strict=False):
        values = []
        for share in shares:
            case = next(c for c in cases(float(share)) if c.name == name)
            values.append(MICROMETRES_PER_RADIAN * bias(case, places=64)[method])
        stack = np.array(values)
        ax.fill_between(100 * shares, stack.min(axis=1), stack.max(axis=1), color=colour, alpha=0.25, linewidth=0)
        line = "--" if method == "both edges" else "-"  # else hidden where it agrees with another
        ax.plot(100 * shares, stack.mean(axis=1), line, color=colour, label=method, zorder=3 if line == "--" else 2)
    ax.set_yscale("symlog", linthresh=1.0)
    ax.set_xlabel("clipped share of the amplitude, %")
    ax.set_ylabel("bias of range, µm")


def _draw_scatter(ax) -> None:
    levels = np.geomspace(0.003, 0.5, 10)
    found = [scatter(float(level), buffers=1500) for level in levels]
    for method, colour in zip(("rising edge", "both edges", "synchronous", "FFT peak"), SERIES, strict=False):
        ax.plot(
            levels,
            [f[method] for f in found],
            "." + ("--" if method == "both edges" else "-"),
            color=colour,
            label=method,
        )
    ax.axhline(np.sqrt(PER_CYCLE / 6), color=FAINT, linestyle=":", linewidth=1.0)
    ax.annotate("√(n/6)", (levels[0], np.sqrt(PER_CYCLE / 6)), (0, 4), textcoords="offset points", color=INK)
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xlabel("white noise over amplitude")
    ax.set_ylabel("scatter of phase over the bound")
    ax.set_title("White noise: crossings use four samples a cycle")


def main(directory: str) -> None:
    """Print both tables, write the figure."""
    target = Path(directory)
    target.mkdir(parents=True, exist_ok=True)
    (target / "phase-estimators.svg").write_text(figure(), encoding="utf-8")
    sys.stdout.write(f"{table()}\n\n{noise_table()}\n")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python studies/phase_estimators.py DIRECTORY")
    main(sys.argv[1])
