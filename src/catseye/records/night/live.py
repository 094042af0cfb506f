"""Records exchanged by a live site, its journal and replay: shots, weather, posture, events.

Times are `ticks`, integer steps of 1e-8 day = 864 000 ns since MJD 0, as in a ZY's stamps: they transfer exactly.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

TICKS_PER_DAY = 10**8
TICK_SECONDS = 864e-6


@dataclass(frozen=True, eq=False)
class LiveShot:
    """Buffer of a ranger, or the ranger's own result if the buffer was not transferred.

    ranger, target   names; a shot on the internal cube has the target ZRG
    ticks            time of the first sample
    cycles, samples_per_cycle, if_hz   settings of the buffer
    volts_per_code   V
    samples          (cycles samples_per_cycle,) int16, or None: then `amplitude` and `phase` are used
    amplitude        V, as reported by the ranger (MAG); NaN if not reported
    phase            rad, likewise (RAD)
    number           in its run, counted from 1 by the receiver; 0 before that
    """

    ranger: str
    target: str
    ticks: int
    cycles: int
    samples_per_cycle: int
    if_hz: int
    volts_per_code: float
    samples: NDArray[np.int16] | None
    amplitude: float = float("nan")
    phase: float = float("nan")
    number: int = 0

    @property
    def duration(self) -> float:
        """Duration of the buffer, s."""
        return self.cycles / self.if_hz

    @property
    def middle_mjd(self) -> float:
        """Middle of the buffer, time of its mean phase, MJD."""
        return self.ticks / TICKS_PER_DAY + 0.5 * self.duration / 86_400.0


@dataclass(frozen=True, slots=True)
class LiveWeather:
    """Reading of a weather station; NaN for a sensor without a value."""

    station: str
    ticks: int
    temperature_c: float
    pressure_hpa: float
    humidity_percent: float


@dataclass(frozen=True, slots=True)
class LivePosture:
    """Reported telescope position: azimuth from north clockwise and elevation, rad, and rates, rad/s."""

    ticks: int
    azimuth: float
    elevation: float
    azimuth_rate: float = 0.0
    elevation_rate: float = 0.0


Severity = Literal["debug", "note", "warning", "alarm"]


@dataclass(frozen=True, slots=True)
class Happening:
    """Event for operators and analysts.

    ticks      time
    who        a ranger, a station, "telescope", "coordinator", "journal"
    kind       hyphenated word for programs: "connected", "lost", "blocked", "sun-refused" ...
    text       one line for people: event, value, limit, remedy
    severity   debug (routine: a single shot, a single line), note, warning, alarm
    details    values for programs
    """

    ticks: int
    who: str
    kind: str
    text: str
    severity: Severity = "note"
    details: dict[str, float | str] = field(default_factory=dict)
