"""Quadrant detector on the feed arm for a minute: two damped modes in the wind, 20 samples a second.

Every number is chosen, none measured. The oscillators are integrated in steps of a millisecond, which knows nothing of
the filter's formulas; frequencies and damping differ from the structural model's by one to two of its u.

    python examples/vibration/make_example.py
"""

from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
MODES = {"x": (0.80, 0.005, 1.5e-3), "y": (1.02, 0.006, 1.0e-3)}  # Hz, damping ratio, rms m on the detector
REST = {"x": 0.2e-3, "y": -0.1e-3}  # m, spot at rest
SLOPE = 10e-3  # m of the spot over the difference of halves over the sum
NOISE = 2e-3  # V of each quadrant, of 1 V
RATE_HZ, SECONDS, STEP = 20, 60, 1e-3


def swing(frequency_hz: float, damping: float, size: float, rng: np.random.Generator) -> np.ndarray:
    """Displacement, m, at every step, by semi-implicit Euler; the force keeps the rms at `size`."""
    w = 2.0 * np.pi * frequency_hz / np.sqrt(1.0 - damping**2)
    kick = size * np.sqrt(4.0 * damping * w**3 * STEP)
    phase = rng.uniform(0.0, 2.0 * np.pi)
    x, v = size * np.sqrt(2.0) * np.cos(phase), -w * size * np.sqrt(2.0) * np.sin(phase)
    out = np.empty(int(SECONDS / STEP) + 1)
    for i, force in enumerate(kick * rng.standard_normal(len(out))):
        out[i] = x
        v += -(2.0 * damping * w * v + w**2 * x) * STEP + force
        x += v * STEP
    return out


def signals(seed: int = 2461) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times (n,), s, displacements (n, 2), m, and signals (n, 4), V."""
    rng = np.random.default_rng(seed)
    every = round(1.0 / (RATE_HZ * STEP))
    place = np.stack([swing(*MODES[axis], rng)[::every] + REST[axis] for axis in "xy"], axis=-1)
    place = place[: SECONDS * RATE_HZ]
    ratio = place / SLOPE
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])  # quadrants counter-clockwise from that of positive x and y
    clean = 1.0 + ratio @ signs.T
    return np.arange(len(place)) / RATE_HZ, place, clean + NOISE * rng.standard_normal(clean.shape)


def main() -> None:
    """Write quadrant.csv."""
    times, _, values = signals()
    rows = [f"{t:.2f}," + ",".join(f"{v:.5f}" for v in row) for t, row in zip(times, values, strict=True)]
    (HERE / "quadrant.csv").write_text("time_s,q1,q2,q3,q4\n" + "\n".join(rows) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
