"""Simulated recordings of sound along a path through moving air.

There is a loudspeaker and a microphone at both ends.

The travel time is the integral of 1/(sqrt(c² - w_across²) + w_along) over the path, c by a separate formula. The
signal is a function of time and is evaluated where it arrives, never shifted as samples.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

NODES, WEIGHTS = np.polynomial.legendre.leggauss(24)
# [CRAMER93] eq. 15 and table III, coded twice on purpose: temperature, humidity, pressure, carbon dioxide
A = (331.5024, 0.603055, -0.000528, 51.471935, 0.1495874, -0.000782, -1.82e-7, 3.73e-8, -2.93e-10, -85.20931, -0.228525,
     5.91e-5, -2.835149, -2.15e-13, 29.179762, 0.000486)  # fmt: skip

Profile = Callable[[NDArray], NDArray]


def sound_speed(temperature_c, pressure_hpa, humidity_percent, *, co2_ppm=450.0):
    """Speed of sound in moist air, m/s.

    temperature_c      0 to 30 °C
    pressure_hpa       750 to 1020 hPa
    humidity_percent   relative humidity over liquid water, 0 to 100
    co2_ppm            up to 10 000

    Source: [CRAMER93] eq. 15, to 300 ppm; vapour by [PARKER04] eqs. 1.3 and 1.5.

    >>> round(float(sound_speed(0.0, 1013.25, 0.0, co2_ppm=314.0)), 2)
    331.45
    """
    t, p = np.asarray(temperature_c, float), np.asarray(pressure_hpa, float) * 100.0
    saturation = 6.1121 * (1.0007 + 3.46e-6 * p / 100.0) * np.exp(17.502 * t / (240.97 + t))
    w, c = saturation * humidity_percent / p, co2_ppm * 1e-6  # mole fractions; saturation in hPa, humidity in %
    return (
        A[0] + A[1] * t + A[2] * t**2
        + (A[3] + A[4] * t + A[5] * t**2) * w
        + (A[6] + A[7] * t + A[8] * t**2) * p
        + (A[9] + A[10] * t + A[11] * t**2) * c
        + A[12] * w**2 + A[13] * p**2 + A[14] * c**2 + A[15] * w * p * c
    )  # fmt: skip


@dataclass(frozen=True)
class SoundPath:
    """Air between A and B as functions of the share of the path, 0 to 1.

    length             m
    temperature_c      °C
    wind_along         m/s, from A to B
    wind_across        m/s
    pressure_hpa, humidity_percent, co2_ppm   constant along the path
    dispersion_ppm     relative increase of speed at the sound's frequency (relaxation of nitrogen and oxygen)
    """

    length: float
    temperature_c: Profile
    wind_along: Profile = np.zeros_like
    wind_across: Profile = np.zeros_like
    pressure_hpa: float = 933.0
    humidity_percent: float = 50.0
    co2_ppm: float = 450.0
    dispersion_ppm: float = 0.0

    def travel_times(self) -> tuple[float, float]:
        """Travel times from A to B and B to A, s, by Gauss-Legendre quadrature."""
        share = 0.5 * (NODES + 1.0)
        c = sound_speed(self.temperature_c(share), self.pressure_hpa, self.humidity_percent, co2_ppm=self.co2_ppm)
        c = c * (1.0 + 1e-6 * self.dispersion_ppm)
        ahead, along = np.sqrt(c**2 - self.wind_across(share) ** 2), self.wind_along(share)
        half = 0.5 * self.length * WEIGHTS
        return float(half @ (1.0 / (ahead + along))), float(half @ (1.0 / (ahead - along)))

    def mean_temperature_c(self) -> float:
        return float(0.5 * WEIGHTS @ self.temperature_c(0.5 * (NODES + 1.0)))


@dataclass(frozen=True)
class Recorder:
    """Microphone with its converter.

    sampling_hz    Hz
    bits           of the converter, whose ends are plus and minus 1 V
    noise_volt     rms of white noise
    rumble_volt    rms of noise that falls with frequency (wind on the microphone), a first-order walk
    rumble_hz      its corner
    level_volt     amplitude of the signal at 1 m from the loudspeaker: it falls with the distance
    echoes         (extra path in m, share of the amplitude after the reflection, below zero inverts it)
    delay          s, of loudspeaker, microphone and electronics
    clock_ahead    s, lead of this recorder's clock over the emission's
    offset_volt    constant
    """

    sampling_hz: float
    bits: int = 16
    noise_volt: float = 1e-3
    rumble_volt: float = 0.0
    rumble_hz: float = 50.0
    level_volt: float = 10.0
    echoes: Sequence[tuple[float, float]] = ()
    delay: float = 0.0
    clock_ahead: float = 0.0
    offset_volt: float = 0.0

    def volts(
        self,
        signal: Profile,
        emissions: Sequence[float],
        *,
        travel_time: float | Sequence[float],
        distance: float,
        samples: int,
        rng: np.random.Generator,
    ) -> NDArray:
        """Microphone voltages (samples,): all signals with echoes, and noise.

        signal        function of time, zero outside its duration
        emissions     s, when each signal starts
        travel_time   s, one for all or one each
        distance      m, 0 for a loop-back wire, without fading or echoes
        """
        time = np.arange(samples) / self.sampling_hz - self.clock_ahead
        voltage = self._noise(samples, rng) + self.offset_volt
        flights = np.broadcast_to(np.asarray(travel_time, float), (len(emissions),))
        for emission, flight in zip(emissions, flights, strict=True):
            direct = time - emission - flight - self.delay
            if distance == 0.0:
                voltage += 0.5 * signal(direct)
                continue
            voltage += self.level_volt / distance * signal(direct)
            for extra, share in self.echoes:
                late = extra * flight / distance
                voltage += share * self.level_volt / (distance + extra) * signal(direct - late)
        return voltage

    def codes(self, volts: NDArray) -> NDArray[np.int32]:
        """Converter codes of the voltages, rounded and clipped."""
        top = 2 ** (self.bits - 1)
        return np.clip(np.rint(volts * top), -top, top - 1).astype(np.int32)

    def _noise(self, samples: int, rng: np.random.Generator) -> NDArray:
        white = self.noise_volt * rng.standard_normal(samples)
        if self.rumble_volt == 0.0:
            return white
        from scipy.signal import lfilter

        keep = np.exp(-2.0 * np.pi * self.rumble_hz / self.sampling_hz)
        drive = np.sqrt(1.0 - keep**2) * rng.standard_normal(samples)
        first = keep * rng.standard_normal()
        return white + self.rumble_volt * lfilter([1.0], [1.0, -keep], drive, zi=[first])[0]
