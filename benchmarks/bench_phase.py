"""200 MB of 16-bit samples to phase and amplitude, beside what a user would write; medians of interleaved rounds.

python benchmarks/bench_phase.py

The limit is a compiled sum of the same memory as 64-bit words. The others work on a part of it and count by the byte.
"""

import statistics
import sys
import time
from collections.abc import Callable

import numpy as np
from numba import njit
from scipy.signal import butter, sosfiltfilt
from threadpoolctl import threadpool_limits

from catseye.signal.detection.channels import ChannelStream, interleaved_phasors
from catseye.signal.detection.phase import detect, phasors

ROUNDS = 7
BYTES, CYCLES, VOLTS = 200_000_000, 128, 10 / 32768
TARGETS = {64: (0.7, 20, 100), 16: (0.45, 12, 60)}  # samples a cycle: of the limit, times rfft, times lock-in


@njit(error_model="numpy", fastmath=True)
def _read(words: np.ndarray) -> int:
    total = 0
    for i in range(len(words)):
        total += words[i]
    return total


def samples(n: int) -> np.ndarray:
    """Buffers (b, CYCLES n) of a return of 3 V with 0.1 V of noise, phases all round."""
    rng = np.random.default_rng(n)
    count = BYTES // (2 * CYCLES * n)
    phase = rng.uniform(0.0, 2 * np.pi, 256)
    wave = 9830 * np.cos(2 * np.pi * np.arange(CYCLES * n) / n - phase[:, None])
    few = np.rint(wave + 328 * rng.standard_normal(wave.shape)).astype(np.int16)
    return np.resize(few, (count, CYCLES * n))


def polar(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Amplitude and phase."""
    return np.abs(z), np.angle(z)


def naive(codes: np.ndarray, n: int) -> np.ndarray:
    """Eq. 5.1 and 5.2 as one writes them."""
    volts = codes * VOLTS
    angle = 2 * np.pi * np.arange(codes.shape[1]) / n
    a, b = np.sum(volts * np.cos(angle), axis=1), np.sum(volts * np.sin(angle), axis=1)
    return (2 / codes.shape[1]) * (a + 1j * b)


def transformed(codes: np.ndarray, n: int) -> np.ndarray:
    """The bin of numpy's FFT."""
    return np.fft.rfft(codes, axis=1)[:, CYCLES].conj() * (2 * VOLTS / codes.shape[1])


def lock_in(codes: np.ndarray, n: int) -> np.ndarray:
    """Mixer and low-pass, the mean of its middle half."""
    volts = codes * VOLTS
    angle = 2 * np.pi * np.arange(codes.shape[1]) / n
    sos = butter(4, 0.1 / n, fs=1.0, output="sos")
    quarter = codes.shape[1] // 4
    re, im = (sosfiltfilt(sos, volts * wave, axis=1)[:, quarter:-quarter] for wave in (np.cos(angle), np.sin(angle)))
    return 2.0 * (re.mean(axis=1) + 1j * im.mean(axis=1))


def race(contenders: dict[str, tuple[Callable[[], object], float]]) -> dict[str, float]:
    """GB/s of each, the median of rounds in which every one has its turn."""
    times: dict[str, list[float]] = {name: [] for name in contenders}
    for work, _ in contenders.values():
        work()  # compiled, loaded, memory touched
    for _ in range(ROUNDS):
        for name, (work, _) in contenders.items():
            start = time.perf_counter()
            work()
            times[name].append(time.perf_counter() - start)
    return {name: 1e-9 * size / statistics.median(times[name]) for name, (_, size) in contenders.items()}


def compare(n: int) -> bool:
    """The table of one number of samples a cycle, and whether its targets are met."""
    codes = samples(n)
    part, few = codes[: len(codes) // 10], codes[: len(codes) // 40]
    turns = np.ascontiguousarray(part[: len(part) // 4 * 4].reshape(-1, 4, CYCLES * n).transpose(0, 2, 1)).reshape(
        -1, 4
    )
    woven = codes[: len(codes) // 4 * 4].reshape(-1, CYCLES * n, 4)  # the same memory read as four channels
    words = codes.reshape(-1).view(np.int64)
    limit, ours = "the limit: one compiled read", "catseye: amplitude and phase"
    fft, mixer = "numpy rfft", "scipy lock-in (sosfiltfilt)"
    contenders: dict[str, tuple[Callable[[], object], float]] = {
        limit: (lambda: _read(words), codes.nbytes),
        ours: (lambda: polar(phasors(codes, n, VOLTS)), codes.nbytes),
        "catseye: everything (detect)": (lambda: detect(codes, n, VOLTS), codes.nbytes),
        "catseye, plain: amplitude and phase": (lambda: polar(phasors(part, n, VOLTS, compiled=False)), part.nbytes),
        "catseye, plain: everything (detect)": (lambda: detect(part, n, VOLTS, compiled=False), part.nbytes),
        "catseye, plain: stream of 4 channels, everything": (
            lambda: ChannelStream(4, n, CYCLES, VOLTS).feed(turns),
            part.nbytes,
        ),
        "catseye: 4 interleaved channels, amplitude and phase": (
            lambda: polar(interleaved_phasors(woven, n, VOLTS)),
            woven.nbytes,
        ),
        "naive numpy sums": (lambda: polar(naive(few, n)), few.nbytes),
        fft: (lambda: polar(transformed(few, n)), few.nbytes),
        mixer: (lambda: polar(lock_in(few, n)), few.nbytes),
    }
    rate = race(contenders)
    sys.stdout.write(f"{codes.nbytes / 1e6:.0f} MB of int16, {n} a cycle, {CYCLES} cycles: {len(codes)} buffers\n")
    for name, each in rate.items():
        sys.stdout.write(f"  {name:<50} {each:8.3f} GB/s {rate[ours] / each:8.2f} x slower than ours\n")
    met = True
    for against, least in zip((limit, fft, mixer), TARGETS[n], strict=True):
        ratio = rate[ours] / rate[against]
        met &= ratio >= least
        verdict = "met" if ratio >= least else "MISSED"
        sys.stdout.write(f"  {ratio:7.2f} times {against:<34} target {least:6.2f}: {verdict}\n")
    answer = phasors(few, n, VOLTS)
    for name, other in (("naive", naive(few, n)), ("rfft", transformed(few, n)), ("lock-in", lock_in(few, n))):
        sys.stdout.write(f"  largest difference to {name}: {np.abs(other - answer).max():.1e} V\n")
    return met


def main() -> None:
    """Both tables."""
    with threadpool_limits(limits=1, user_api="blas"):
        met = [compare(n) for n in TARGETS]
    sys.stdout.write("all targets met\n" if all(met) else "a target is missed\n")


if __name__ == "__main__":
    main()
