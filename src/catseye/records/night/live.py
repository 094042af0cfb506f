"""What a living site hands from hand to hand: shots, weather, posture, and what happened. Journal, reduction, replay.

Times are `ticks`, whole steps of 1e-8 day = 864 000 ns since MJD 0, as a ZY's stamps are: they travel without loss.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

TICKS_PER_DAY = 10**8
TICK_SECONDS = 864e-6


@dataclass(frozen=True, eq=False)
class LiveShot:
    """One buffer of a ranger, or what the ranger itself made of it where the buffer did not travel.

    ranger, target   names; a shot on the internal cube has the target ZRG
    ticks            when the first sample was taken
    cycles, samples_per_cycle, if_hz   how the buffer was taken
    volts_per_code   V
    samples          (cycles samples_per_cycle,) int16, or None: then `amplitude` and `phase` count
    amplitude        V, as the ranger reports it (MAG); NaN where it said nothing
    phase            rad, the same (RAD); NaN
    number           in its run, counted from 1 by who receives it; 0 before that
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
        """How long the buffer took, s."""
        return self.cycles / self.if_hz

    @property
    def middle_mjd(self) -> float:
        """The middle of the buffer, where its mean phase belongs, MJD."""
        return self.ticks / TICKS_PER_DAY + 0.5 * self.duration / 86_400.0


@dataclass(frozen=True, slots=True)
class LiveWeather:
    """One reading of a weather station; a sensor that said nothing is NaN."""

    station: str
    ticks: int
    temperature_c: float
    pressure_hpa: float
    humidity_percent: float


@dataclass(frozen=True, slots=True)
class LivePosture:
    """Where the telescope says it is: azimuth clockwise from north and elevation, rad, and their rates, rad/s."""

    ticks: int
    azimuth: float
    elevation: float
    azimuth_rate: float = 0.0
    elevation_rate: float = 0.0


Severity = Literal["debug", "note", "warning", "alarm"]


@dataclass(frozen=True, slots=True)
class Happening:
    """Something that a person or an analyst should know.

    ticks      when
    who        a ranger, a station, "telescope", "coordinator", "journal"
    kind       one word with hyphens that programs compare: "connected", "lost", "blocked", "sun-refused" ...
    text       one line for people: what, the value, the limit, what to do
    severity   debug (routine: a single shot, a single line), note, warning, alarm
    details    values for programs
    """

    ticks: int
    who: str
    kind: str
    text: str
    severity: Severity = "note"
    details: dict[str, float | str] = field(default_factory=dict)
