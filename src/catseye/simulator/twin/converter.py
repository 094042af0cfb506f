"""Simulated A/D converter of a return that changes while sampled."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catseye.constants import TWO_PI
from catseye.ranger.head import SamplingSettings
from catseye.simulator.night.faults import Streams
from catseye.simulator.night.head import HARMONICS, VOLT_PER_CODE

SLOW_HZ = 100  # below this intermediate frequency a return may turn considerably within one cycle
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Converter:
    """Electronics between detector and codes.

    offset   V, of the mean
    noise    V rms, of one sample
    """

    offset: float
    noise: float

    @staticmethod
    def of(ranger: str, seed: int) -> "Converter":
        """Converter of a ranger, drawn as the night's heads.

        An offset of -0.25 to 0.25 V, a noise of 0.165 to 0.245 V.
        """
        rng = Streams(seed)(f"samples/{ranger}")
        return Converter(float(rng.uniform(-0.25, 0.25)), float(rng.uniform(0.165, 0.245)))

    def codes(
        self,
        at: NDArray[np.float64],
        phasors: Complex,
        *,
        sampling: SamplingSettings,
        generator: np.random.Generator,
        gain: float = 1.0,
    ) -> NDArray[np.int16]:
        """Codes (m n,) of a buffer.

        offset + Re(z e^-ij) with harmonics, noise, rounding and the converter's ends at 10 V.

        at          (k,) s since the first sample, ascending
        phasors     (k,) V: the return at these times; linear between but for its mean rotation
        sampling    m cycles of n samples
        generator   of the noise and of the harmonics' phases
        gain        on the return, before the converter's ends
        """
        n, m, hertz = sampling.samples, sampling.cycles, sampling.frequency_hz
        phases = generator.uniform(0.0, TWO_PI, len(HARMONICS))
        harmonics = HARMONICS * np.exp(1j * phases)
        if hertz < SLOW_HZ:
            signal = _sample_by_sample(at, gain * phasors, sampling, harmonics)
        else:
            signal = _cycle_by_cycle(_between(at, gain * phasors, np.arange(m + 1) / hertz), n, harmonics)
        volts = generator.standard_normal((m, n), dtype=np.float32)
        volts *= np.float32(self.noise / VOLT_PER_CODE)
        volts += (signal + self.offset / VOLT_PER_CODE).astype(np.float32)
        np.rint(volts, out=volts)
        np.clip(volts, -32768.0, 32767.0, out=volts)
        return volts.astype(np.int16).reshape(m * n)


def _cycle_by_cycle(edges: Complex, n: int, harmonics: Complex) -> NDArray[np.float64]:
    """Codes (m, n) of a return (m + 1,) V at cycle edges, interpolated linearly.

    Harmonics as at the middle.
    """
    share = np.arange(n) / n
    turn = np.exp(-1j * TWO_PI * share)
    first, change = edges[:-1], np.diff(edges)
    size = np.abs(first + 0.5 * change)
    overtone = harmonics[0] * turn**2 + harmonics[1] * turn**3
    rows = np.column_stack([first.real, -first.imag, change.real, -change.imag, size])
    columns = np.stack([turn.real, turn.imag, share * turn.real, share * turn.imag, overtone.real])
    return (rows @ columns) / VOLT_PER_CODE


def _sample_by_sample(
    at: NDArray[np.float64], phasors: Complex, sampling: SamplingSettings, harmonics: Complex
) -> NDArray[np.float64]:
    """Codes for a slow intermediate frequency: the return at every sample."""
    j = np.arange(sampling.cycles * sampling.samples)
    z = _between(at, phasors, j / (sampling.samples * sampling.frequency_hz))
    turn = np.exp(-1j * TWO_PI / sampling.samples * j)
    volts = np.real(z * turn + np.abs(z) * (harmonics[0] * turn**2 + harmonics[1] * turn**3))
    return volts.reshape(sampling.cycles, sampling.samples) / VOLT_PER_CODE


def _between(at: NDArray[np.float64], phasors: Complex, times: NDArray[np.float64]) -> Complex:
    """Return at other times, interpolated with its mean rotation removed.

    So a steady range rate is exact, and a return that fades and recovers keeps its phase.
    """
    steps = np.diff(at)
    rate = float(np.angle(np.vdot(phasors[:-1], phasors[1:]))) / float(steps.mean())
    still = phasors * np.exp(-1j * rate * at)
    i = np.clip(np.searchsorted(at, times, side="right") - 1, 0, len(at) - 2)
    share = (times - at[i]) / steps[i]
    return (still[i] + share * (still[i + 1] - still[i])) * np.exp(1j * rate * times)
