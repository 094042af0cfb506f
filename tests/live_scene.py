"""A living site for the tests of the live reduction: the twin's shots, fed to `Live` round by round, and the truth."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from catseye.records.night.live import TICKS_PER_DAY, LivePosture, LiveShot, LiveWeather
from catseye.records.site.folder import REFERENCE, SiteFolder, read_site
from catseye.reduction.live.live import EpochAnswer, Live, LiveSettings
from catseye.reduction.live.shots import ShotAnswer
from catseye.reduction.site.motion import ground_from
from catseye.simulator.twin.faults import Fault, FaultBoard
from catseye.simulator.twin.motion import AxisMotion
from catseye.simulator.twin.site import Twin
from repository import ROOT

START = 60635.125  # MJD, 22 h local mean time at Green Bank
ROUND = 10.0  # s: a reference and nine targets a ranger
SHOT = 0.95  # s, from shot to shot of a ranger: turning, settling, measuring
BRIGHT = 0.5  # V, what a target must return to be asked for again
GRID = 48  # instants whose mean is the truth of an epoch
DISH = ("DP01C", "DP20C", "DP20P10", "DP33N15", "DP44C")


@cache
def site() -> SiteFolder:
    """Green Bank with five prisms on the dish: nothing else of it changes, and it is read in no time."""
    whole = read_site(ROOT / "examples/sites/gbt")
    return replace(whole, targets={n: t for n, t in whole.targets.items() if not n.startswith("DP") or n in DISH})


def twin(motion: str = "track 145.3 45", *, seed: int = 1, faults: tuple[str, ...] = (), **more) -> Twin:
    board = FaultBoard(Fault.parse(text) for text in faults)
    return Twin(site(), seed=seed, start_mjd=START, motion=AxisMotion.parse(motion), faults=board, **more)


def sights(world: Twin, seconds: float, *, rangers: tuple[str, ...] = ()) -> dict[str, list[str]]:
    """What each ranger sees well at a time: targets on the structure for the ground's, triplets for the arm's."""
    names = [*world.site.targets, *(n for t in world.site.triplets.values() for n in t.targets)]
    names = [n for n in names if n not in DISH]
    benches = {(row.ranger, row.target) for row in world.site.benchmarks}
    found = {}
    for ranger in rangers or tuple(world.site.rangers):
        if ranger in world.site.monuments:
            asked = [n for n in names if n.startswith("Z") or n.endswith("-B")]
            asked = [n for n in asked if not n.startswith("ZBM") or (ranger, n) in benches]
        else:
            asked = [n for n in names if n.startswith("TR") and not n.endswith("-B")]
        back = [abs(world.phasors(ranger, world.counts(ranger, n, seconds), seconds)[0]) for n in asked]
        found[ranger] = [n for n, volts in zip(asked, back, strict=True) if volts > BRIGHT]
    return found


@dataclass(frozen=True)
class Feed:
    """What a coordinator would have handed to `Live`, in its order."""

    items: tuple[LiveShot | LiveWeather | LivePosture, ...]

    @property
    def shots(self) -> list[LiveShot]:
        return [item for item in self.items if isinstance(item, LiveShot)]

    def into(self, live: Live) -> list[ShotAnswer]:
        """What `Live` says to each shot."""
        said = []
        for item in self.items:
            if isinstance(item, LiveWeather):
                live.weather(item)
            elif isinstance(item, LivePosture):
                live.posture(item)
            else:
                said.append(live.shot(item))
        return said


@dataclass
class Night:
    """A twin whose rangers shoot rounds; `seen` is renewed each round where the telescope slews."""

    world: Twin
    seed: int = 1
    postures_hz: float = 10.0
    targets: int = 9
    number: int = 0
    seen: dict[str, list[str]] | None = None
    renew: bool = False

    def on_tick(self, seconds: float) -> float:
        """The time of the nearest tick, as requests are scheduled: in half a tick a slew goes 0.2 mm."""
        return self.world.seconds_of_ticks(self.world.ticks(seconds))

    def before(self) -> Feed:
        """Three minutes of weather."""
        stations = [s.name for s in self.world.site.site.weather_station]
        return Feed(tuple(self.world.weather(name, s) for s in np.arange(-180.0, 0.0, 10.0) for name in stations))

    def round(self, k: int, *, rangers: tuple[str, ...] = (), without: tuple[str, ...] = ()) -> Feed:
        """Round k: postures from a second before it, a reading of each station, the shots in order of time."""
        begin, rng = k * ROUND, np.random.default_rng([self.seed, k])
        if self.seen is None or self.renew:
            self.seen = sights(self.world, begin + 0.5 * ROUND)
        asked = []
        for ranger, targets in self.seen.items():
            names = [REFERENCE, *rng.permutation(targets)[: self.targets].tolist()]
            times = begin + 0.3 + SHOT * np.arange(len(names)) + rng.uniform(0.0, 0.2, len(names))
            times = [self.on_tick(t) for t in times]
            if (not rangers or ranger in rangers) and ranger not in without:
                asked += [(t, ranger, name) for t, name in zip(times, names, strict=True)]
        steps = np.arange(begin - 1.0, begin + ROUND + 1.0, 1.0 / self.postures_hz)
        told = [self.world.live_posture(self.world.ticks(s)) for s in steps]
        stations = [s.name for s in self.world.site.site.weather_station]
        read = [self.world.weather(name, begin + 0.5 * ROUND) for name in stations]
        shots = []
        for seconds, ranger, name in sorted(asked):
            if self.world.faults.active("dead-ranger", ranger, at=seconds) is None:
                self.number += 1
                shots.append(replace(self.world.shot(ranger, name, seconds), number=self.number))
        return Feed((*told, *read, *shots))

    def ticks(self, k: int) -> int:
        """The middle of round k."""
        return self.world.ticks((k + 0.5) * ROUND)

    def truth(self, live: Live, found: EpochAnswer, k: int, names: list[str]) -> np.ndarray:
        """(n, 3) m: mean of the true places over round k, in each point's frame, carried to the epoch."""
        grid = k * ROUND + np.linspace(0.3, ROUND - 0.5, GRID)
        true = self.world.points(names, grid)
        mjd = np.array([self.world.ticks(s) / TICKS_PER_DAY for s in grid])
        now = found.ticks / TICKS_PER_DAY
        means = np.empty((len(names), 3))
        for i, name in enumerate(names):
            frame = live.frames[name]
            own = ground_from(self.world.site, frame, *live.track.at(mjd)).inverse().points(true[:, i])
            means[i] = ground_from(self.world.site, frame, *live.track.at(now)).single.points(own.mean(axis=0))
        return means


def lasting(live: Live, found: EpochAnswer, *, fewest: int = 0) -> list[str]:
    """Lasting points of an epoch with so many shots in it."""
    return [n for n, shots in zip(found.names, found.shots, strict=True) if n in live.lasting and shots >= fewest]


def deviations(night: Night, live: Live, found: EpochAnswer, k: int, names: list[str]) -> np.ndarray:
    """(n, 3): error of each coordinate in standard uncertainties, along the axes of each point's own covariance."""
    true = night.truth(live, found, k, names)
    rows = []
    for name, x in zip(names, true, strict=True):
        place, covariance = found.point(name)
        rows.append(np.linalg.solve(np.linalg.cholesky(covariance), place - x))
    return np.array(rows)


def begun(motion: str = "track 145.3 45", *, seed: int = 1, settings: LiveSettings | None = None, **more):
    """A night and a `Live` that has its weather."""
    night = Night(twin(motion, seed=seed, **more), seed)
    live = Live(night.world.site, settings)
    night.before().into(live)
    return night, live
