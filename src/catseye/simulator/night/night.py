"""Synthetic night: file contents and truth."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from catseye.simulator.night.air import AirConditions
from catseye.simulator.night.head import TunedHead
from catseye.simulator.night.nature import CALM, Nature
from catseye.simulator.night.schedule import MODULATION_HZ, ScheduledShot
from catseye.simulator.night.stations import WeatherReading
from catseye.simulator.night.structure import Structure, TrueTarget
from catseye.simulator.night.truth import Truth
from catseye.simulator.night.warm_lines import Sounding
from catseye.simulator.night.world import (
    TrueBenchmark,
    TrueHead,
    TrueMonument,
)


@dataclass(frozen=True)
class Night:
    """Campaign: contents of its files (`write_night` makes them), and the `truth`."""

    name: str
    seed: int
    azimuth_deg: float
    elevation_deg: float
    start_mjd_utc: float
    conditions: AirConditions
    monuments: dict[str, TrueMonument]
    heads: dict[str, TrueHead]
    telescope: Structure
    benchmarks: list[TrueBenchmark]
    single_targets: list[TrueTarget]
    weather: list[WeatherReading]
    shots: list[ScheduledShot]  # by time; row i of frames is shot i + 1
    frames: np.ndarray  # int16, (shots, 8192)
    truth: Truth
    sounded: tuple[Sounding, ...] = ()  # rows of path_temperatures.csv; no file without
    nature: Nature = CALM
    modulation_hz: float = MODULATION_HZ  # as typed
    tuned: Mapping[str, tuple[TunedHead, ...]] = field(default_factory=dict)  # heads at further frequencies, by ranger
    lies: tuple[str, ...] = ()  # what is wrong on purpose
