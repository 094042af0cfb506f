"""When a known pulse arrived in 1 s of sound at 48 kHz, beside what a user would write instead: time and scatter.

Medians of interleaved rounds. `once` is one recording a call; `many` is 100 a call, per recording. Scatter is the root
mean square of 400 delays over the Cramer-Rao bound, at 40 dB and at 0 dB of signal over noise within the pulse; the
floor is what is left without noise, at worst over a sample. scipy correlates the whole second and a parabola goes
through three samples; the same within the window about the predicted arrival is shown beside it.
python benchmarks/bench_delay.py
"""

import statistics
import sys
import time
from collections.abc import Callable

import numpy as np
from scipy.signal import correlate
from threadpoolctl import threadpool_limits

from catseye.signal.delay.arrival import DelayPlan
from catseye.signal.delay.waveform import chirp, sampled

ROUNDS, ONCE, MANY = 15, 20, 100
SAMPLING_HZ, EXPECTED, WINDOW, TRIALS = 48e3, 0.3, 2e-3, 400
SIGNAL = {"start_hz": 2e3, "stop_hz": 8e3, "duration": 10e-3}
TEMPLATE = sampled("chirp", SAMPLING_HZ, **SIGNAL)
TIME = np.arange(int(SAMPLING_HZ)) / SAMPLING_HZ


def recordings(delays: np.ndarray, decibel: float, seed: int = 0) -> np.ndarray:
    """(b, n) of pulses in white noise, evaluated as functions of time; infinite decibels are without noise."""
    heard = np.stack([chirp(TIME - delay, **SIGNAL) for delay in delays])
    sigma = np.sqrt(np.mean(TEMPLATE**2)) * 10.0 ** (-decibel / 20.0)
    return heard + sigma * np.random.default_rng(seed).standard_normal(heard.shape)


def parabola(correlation: np.ndarray) -> float:
    at = int(np.argmax(correlation))
    before, here, after = correlation[at - 1 : at + 2]
    return at + 0.5 * (before - after) / (before - 2.0 * here + after)


def scipy_whole(heard: np.ndarray) -> float:
    return parabola(correlate(heard, TEMPLATE, mode="valid")) / SAMPLING_HZ


def scipy_window(heard: np.ndarray) -> float:
    first = int((EXPECTED - WINDOW) * SAMPLING_HZ)
    last = int((EXPECTED + WINDOW) * SAMPLING_HZ) + len(TEMPLATE)
    return (first + parabola(correlate(heard[first:last], TEMPLATE, mode="valid"))) / SAMPLING_HZ


def took(job: Callable[[], object], times: int) -> float:
    start = time.perf_counter()
    for _ in range(times):
        job()
    return (time.perf_counter() - start) / times


def main() -> None:
    compiled = DelayPlan(TEMPLATE, sampling_hz=SAMPLING_HZ, window=WINDOW, compiled=True)
    plain = DelayPlan(TEMPLATE, sampling_hz=SAMPLING_HZ, window=WINDOW, compiled=False)
    forms: dict[str, Callable[[np.ndarray], np.ndarray]] = {
        "catseye": lambda x: compiled(x, EXPECTED).delay,
        "catseye's plain form (numpy)": lambda x: plain(x, EXPECTED).delay,
        "scipy.signal.correlate, parabola": lambda x: np.array([scipy_whole(row) for row in np.atleast_2d(x)]),
        "the same, within the window": lambda x: np.array([scipy_window(row) for row in np.atleast_2d(x)]),
    }
    rng = np.random.default_rng(7)
    true = EXPECTED + rng.uniform(-1e-3, 1e-3, TRIALS)
    noisy = {db: recordings(true, db) for db in (40.0, 0.0)}
    fine = EXPECTED + np.linspace(0.0, 1.0 / SAMPLING_HZ, 41)
    silent = recordings(fine, np.inf)
    once: dict[str, list[float]] = {name: [] for name in forms}
    many: dict[str, list[float]] = {name: [] for name in forms}
    with threadpool_limits(1):
        for form in forms.values():
            form(noisy[40.0][:2])
        for _ in range(ROUNDS):
            for name, form in forms.items():
                once[name].append(took(lambda form=form: form(noisy[40.0][0]), ONCE))  # type: ignore[misc]
                share = MANY if name.startswith("catseye") else 5
                many[name].append(took(lambda form=form, n=share: form(noisy[40.0][:n]), 1) / share)  # type: ignore[misc]
    ours = statistics.median(once["catseye"])
    sys.stdout.write(f"a chirp of {len(TEMPLATE)} samples in {len(TIME)}, window {WINDOW * 1e3:g} ms either way\n")
    sys.stdout.write(f"{'':<36}{'once':>10}{'ratio':>9}{'many':>10}{'40 dB':>9}{'0 dB':>9}{'floor':>12}\n")
    for name, form in forms.items():
        spent, each = statistics.median(once[name]), statistics.median(many[name])
        energy = np.sum(TEMPLATE**2) / np.mean(TEMPLATE**2)
        over = [
            np.sqrt(np.mean((form(noisy[db]) - true) ** 2)) / float(compiled.bound(energy * 10.0 ** (db / 10.0)))
            for db in noisy
        ]
        floor = np.abs(form(silent) - fine).max()
        sys.stdout.write(
            f"  {name:<34}{spent * 1e6:7.0f} us{spent / ours:7.1f} x{each * 1e6:7.0f} us"
            f"{over[0]:8.2f} {over[1]:8.2f} {floor * 1e9:9.3f} ns\n"
        )


if __name__ == "__main__":
    main()
