"""Acoustic paths and their reduction: shots, temperatures, means, verdict."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from catseye.atmosphere.weather.humidity import humidity_doubts
from catseye.names import counted
from catseye.records.night.recording import AcousticSheet
from catseye.records.site.validity import expired
from catseye.reduction.air.acoustic import USED, PathTemperatures
from catseye.verdict import Verdict

MOST_USED = 0.8  # least share of a path's shots for a good verdict


@dataclass(frozen=True, eq=False)
class ChannelTrace:
    """First shot of a channel, for a figure.

    time, samples       s from the file's first sample, and codes or volts about the arrival
    lag, correlation    s, and the amplitude of a signal there
    arrival             s, NaN without one
    """

    channel: str
    file: str
    time: np.ndarray
    samples: np.ndarray
    lag: np.ndarray
    correlation: np.ndarray
    arrival: float


@dataclass(frozen=True, eq=False)
class SoundShots:
    """Times, travel times and status of k shots.

    mjd                of the emission, UTC
    time_ab, time_ba   s, clock offset and loop-back subtracted; NaN without a result; time_ba None for one direction
    u_time             (2, k) s
    snr                (2, k) of the correlations, NaN for a table of times
    texts              status of each shot: "ab: good; ba: good", or "" for a table's row
    weather            temperature °C, pressure hPa, humidity %, each (k,)
    file               of each shot
    traces             for figures
    """

    mjd: np.ndarray
    time_ab: np.ndarray
    time_ba: np.ndarray | None
    u_time: np.ndarray
    snr: np.ndarray
    texts: tuple[str, ...]
    weather: tuple[np.ndarray, np.ndarray, np.ndarray]
    file: tuple[str, ...]
    traces: tuple[ChannelTrace, ...] = ()


class PathMean(NamedTuple):
    """Mean temperature (°C), wind (m/s) and refractivity of a path, with uncertainties."""

    used: int
    temperature_c: float
    u_temperature_c: float
    wind: float
    refractivity: float
    u_refractivity: float


@dataclass(frozen=True, eq=False)
class AcousticPath:
    """One path at k times.

    sheet         of the path
    sheet_file    its name
    shots         the travel times
    temperatures  of the air, with wind and index
    model         formula of the speed of sound
    air_model     formula of the index
    hashes        SHA-256 of each file read
    weather_of    source of pressure and humidity
    u_weather     standard uncertainties of pressure, hPa, and humidity, %
    doubts        on the weather
    """

    sheet: AcousticSheet
    sheet_file: str
    shots: SoundShots
    temperatures: PathTemperatures
    model: str
    air_model: str
    hashes: dict[str, str]
    weather_of: str
    u_weather: tuple[float, float]
    doubts: tuple[str, ...] = ()

    @property
    def used(self) -> np.ndarray:
        """True (k,) for shots with a temperature."""
        return np.array([status == USED for status in self.temperatures.status])

    def status(self, shot: int) -> str:
        """Status of one shot as a text."""
        text, formula = self.shots.texts[shot], self.temperatures.status[shot]
        return "; ".join(part for part in (text, "" if formula == USED else formula) if part) or USED

    @property
    def mean(self) -> PathMean:
        """Means over the used shots, with the full covariance."""
        used, air = self.used, self.temperatures
        count = int(used.sum())
        if count == 0:
            return PathMean(0, *(np.nan,) * 5)
        block = np.ix_(used, used)
        return PathMean(
            used=count,
            temperature_c=float(air.temperature_c[used].mean()),
            u_temperature_c=float(np.sqrt(air.covariance_c2[block].sum())) / count,
            wind=float(air.wind[used].mean()),
            refractivity=float(air.group_refractivity[used].mean()),
            u_refractivity=float(np.sqrt(air.covariance_group[block].sum())) / count,
        )


@dataclass(frozen=True, eq=False)
class AcousticReduction:
    """Acoustic paths, one a sheet."""

    paths: tuple[AcousticPath, ...]

    @property
    def verdict(self) -> Verdict:
        """Verdict on used shots, validity of the sheets and humidities."""
        doubts: list[str] = []
        for path in self.paths:
            ends = f"{path.sheet.ranger} to {path.sheet.target}"
            doubts += expired({ends: path.sheet}, float(path.shots.mjd[-1]))
            doubts += (*path.doubts, *humidity_doubts(path.shots.weather[2]))
        return _use_of_shots(self.paths).hearing(doubts)

    @property
    def inputs(self) -> dict[str, str]:
        """SHA-256 by file; equal names have their path's as a prefix."""
        digests: dict[str, str] = {}
        for path in self.paths:
            for name, digest in path.hashes.items():
                double = digests.get(name, digest) != digest
                digests[f"{path.sheet.ranger} to {path.sheet.target}/{name}" if double else name] = digest
        return digests


def _use_of_shots(paths: Sequence[AcousticPath]) -> Verdict:
    """Verdict on the share of used shots."""
    unusable = [path for path in paths if not path.used.any()]
    if unusable and len(unusable) == len(paths):
        return Verdict("failed", "no usable shot of any path")
    if unusable:
        return Verdict("doubtful", f"no usable shot of {unusable[0].sheet.ranger} to {unusable[0].sheet.target}")
    thin = [path for path in paths if path.used.mean() < MOST_USED]
    if thin:
        share = 100.0 * float(thin[0].used.mean())
        return Verdict("doubtful", f"only {share:.0f} % of the shots of {thin[0].sheet.ranger} could be used")
    shots = counted(sum(int(path.used.sum()) for path in paths), "shot")
    return Verdict("good", f"{shots} used of {counted(len(paths), 'path')}")
