"""When a known pulse arrived in 1 s of sound at 48 kHz, beside what a user would write instead: time and scatter.

python benchmarks/bench_delay.py [--quick]

One recording a call, then many a call. Scatter is the root mean square of 400 delays over the Cramer-Rao bound, at 40
dB and at 0 dB of signal over noise within the pulse; the floor is the largest error without noise over a sample. scipy
correlates the whole second, or the window about the predicted arrival, and a parabola goes through three samples. The
limit reads the samples that the pulse and its window need.
"""

import time
from collections.abc import Callable, Iterator

import numpy as np
from scipy.signal import correlate

import limits
from catseye.signal.delay.arrival import DelayPlan
from catseye.signal.delay.waveform import chirp, sampled
from harness import LIMIT, Contender, Row, main, raced

MANY, FEW = 100, 10
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


def each(form: Callable[[np.ndarray], float], heard: np.ndarray) -> np.ndarray:
    """Delays of recordings one after another."""
    return np.array([form(row) for row in np.atleast_2d(heard)])


def accuracy(form: Callable[[np.ndarray], np.ndarray], bound: Callable[[float], float]) -> str:
    """Scatter over the bound at 40 and 0 dB, and the error without noise."""
    true = EXPECTED + np.random.default_rng(7).uniform(-1e-3, 1e-3, TRIALS)
    fine = EXPECTED + np.linspace(0.0, 1.0 / SAMPLING_HZ, 41)
    energy = np.sum(TEMPLATE**2) / np.mean(TEMPLATE**2)
    over = [
        np.sqrt(np.mean((form(recordings(true, db)) - true) ** 2)) / bound(energy * 10.0 ** (db / 10.0))
        for db in (40.0, 0.0)
    ]
    floor = np.abs(form(recordings(fine, np.inf)) - fine).max()
    return f"{over[0]:.2f} and {over[1]:.2f} of the bound, floor {floor * 1e9:.2g} ns"


def rows(quick: bool) -> Iterator[Row]:
    """One recording a call, and a hundred."""
    compiled, plain = (
        DelayPlan(TEMPLATE, sampling_hz=SAMPLING_HZ, window=WINDOW, compiled=flag) for flag in (True, False)
    )
    forms: dict[str, Callable[[np.ndarray], np.ndarray]] = {
        "catseye": lambda x: compiled(x, EXPECTED).delay,
        "scipy.signal.correlate, parabola": lambda x: each(scipy_whole, x),
        "the same within the window": lambda x: each(scipy_window, x),
        "catseye, plain numpy": lambda x: plain(x, EXPECTED).delay,
    }
    words = np.zeros(len(TEMPLATE) + int(2 * WINDOW * SAMPLING_HZ), dtype=np.int64)
    heard = recordings(np.full(MANY, EXPECTED), 40.0)
    compared = () if quick else ("catseye", "scipy.signal.correlate, parabola")
    note = "; ".join(f"{name}: {accuracy(forms[name], lambda snr: float(compiled.bound(snr)))}" for name in compared)
    yield raced(
        "delay of a pulse",
        f"{len(TIME)} samples, one recording a call",
        {name: Contender(lambda form=form: form(heard[0])) for name, form in forms.items()}  # type: ignore[misc]
        | {LIMIT: Contender(lambda: limits.read(words))},
        quick=quick,
        clock=time.process_time,
        note=note,
    )
    yield raced(
        "delay of a pulse",
        f"{MANY} recordings a call",
        {
            name: Contender(
                lambda form=form, count=count: form(heard[:count]),  # type: ignore[misc]
                count / MANY,
            )
            for name, form in forms.items()
            for count in [MANY if name.startswith("catseye") else FEW]
        },
        quick=quick,
        clock=time.process_time,
    )


if __name__ == "__main__":
    main(rows)
