"""200 MB of 16-bit samples to phase and amplitude, beside what a user would write.

python benchmarks/bench_phase.py [--quick]

The limit is one compiled read of the same memory. The others work on a part of it and count by the byte.
"""

import time
from collections.abc import Iterator

import numpy as np
from scipy.signal import butter, sosfiltfilt

import limits
from catseye.signal.detection.channels import ChannelStream, interleaved_phasors
from catseye.signal.detection.phase import detect, phasors
from harness import LIMIT, Contender, Row, main, raced

BYTES, CYCLES, VOLTS = 200_000_000, 128, 10 / 32768


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


def folded(codes: np.ndarray, n: int) -> np.ndarray:
    """Sums of eq. 5.1 and 5.2 after the cycles were added up as integers."""
    cycle = codes.reshape(len(codes), -1, n).sum(axis=1, dtype=np.int32)
    return cycle @ np.exp(2j * np.pi * np.arange(n) / n) * (2 * VOLTS / codes.shape[1])


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


ALTERNATIVES = {
    "numpy, cycles folded as integers": folded,
    "numpy rfft": transformed,
    "numpy, sums as written": naive,
    "scipy lock-in (sosfiltfilt)": lock_in,
}


def rows(quick: bool) -> Iterator[Row]:
    """Amplitude and phase, everything that `detect` says, and interleaved channels, at 64 and 16 samples a cycle."""
    for n in (64, 16):
        codes = samples(n)
        few = codes[: len(codes) // 40]
        part = len(few) / len(codes)
        words = codes.reshape(-1).view(np.int64)
        reading = Contender(lambda words=words: limits.read(words))  # type: ignore[misc]
        size = f"{codes.nbytes / 1e6:.0f} MB of int16, {n} a cycle"
        answer = phasors(few, n, VOLTS)
        apart = max(float(np.abs(form(few, n) - answer).max()) for form in (folded, transformed, naive))
        yield raced(
            "synchronous detection",
            size,
            {
                "catseye": Contender(lambda c=codes, n=n: polar(phasors(c, n, VOLTS))),  # type: ignore[misc]
                LIMIT: reading,
                **{
                    name: Contender(lambda form=form, c=few, n=n: polar(form(c, n)), part)  # type: ignore[misc]
                    for name, form in ALTERNATIVES.items()
                },
            },
            quick=quick,
            clock=time.process_time,
            note=f"phasors agree to {apart:.0e} V, the lock-in's to {np.abs(lock_in(few, n) - answer).max():.0e} V",
        )
        yield raced(
            "detection with noise, harmonics, faults",
            size,
            {
                "catseye": Contender(lambda c=codes, n=n: detect(c, n, VOLTS)),  # type: ignore[misc]
                "catseye, plain numpy": Contender(lambda c=few, n=n: detect(c, n, VOLTS, compiled=False), part),  # type: ignore[misc]
                LIMIT: reading,
            },
            quick=quick,
            clock=time.process_time,
        )
        turns = few[: len(few) // 4 * 4].reshape(-1, 4, CYCLES * n).transpose(0, 2, 1).reshape(-1, 4).copy()
        woven = codes[: len(codes) // 4 * 4].reshape(-1, CYCLES * n, 4)  # the same memory read as four channels
        yield raced(
            "detection in four interleaved channels",
            size,
            {
                "catseye": Contender(lambda w=woven, n=n: polar(interleaved_phasors(w, n, VOLTS))),  # type: ignore[misc]
                "catseye, plain numpy": Contender(
                    lambda t=turns, n=n: ChannelStream(4, n, CYCLES, VOLTS).feed(t),  # type: ignore[misc]
                    turns.nbytes / codes.nbytes,
                ),
                LIMIT: reading,
            },
            quick=quick,
            clock=time.process_time,
        )


if __name__ == "__main__":
    main(rows)
