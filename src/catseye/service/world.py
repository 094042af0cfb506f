"""What makes a twin: two processes that are given the same make the same truth, and read the same time."""

from dataclasses import dataclass, replace
from typing import Any

from catseye.clock import Clock, SystemClock
from catseye.coordinator.visibility.vantage import pace_by
from catseye.errors import InputError
from catseye.records.site.folder import SiteFolder
from catseye.simulator.twin.conditions import DEWY_NIGHT, LIVING_NIGHT, WINDY_DAY
from catseye.simulator.twin.faults import Fault, FaultBoard
from catseye.simulator.twin.head import HeadBuild, TwinHead
from catseye.simulator.twin.mirror import MirrorTuning, travel_of
from catseye.simulator.twin.motion import AxisMotion
from catseye.simulator.twin.site import Twin

CONDITIONS = {"night": LIVING_NIGHT, "windy-day": WINDY_DAY, "dewy-night": DEWY_NIGHT}
MOTION = "track 145.3 45"


@dataclass(frozen=True)
class TwinWords:
    """A twin in words.

    start_mjd    UTC, where its seconds begin
    seed         of every draw
    offset       s, of its time against this machine's UTC
    motion       of the telescope, as people type it
    conditions   name of the weather: night, windy-day, dewy-night
    faults       as people type them: KIND WHOM [START [END [SIZE]]]

    Raises InputError: a motion, weather or fault that there is not.
    """

    start_mjd: float
    seed: int = 1
    offset: float = 0.0
    motion: str = MOTION
    conditions: str = "night"
    faults: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        AxisMotion.parse(self.motion)
        for text in self.faults:
            Fault.parse(text)
        if self.conditions not in CONDITIONS:
            raise InputError(f"conditions {self.conditions!r} (expected one of {', '.join(CONDITIONS)})")

    @staticmethod
    def starting_now(start_mjd: float, **others: Any) -> "TwinWords":
        """One whose time is `start_mjd` at this moment."""
        return TwinWords(start_mjd, offset=SystemClock.starting_at(start_mjd).offset, **others)

    def late(self, seconds: float) -> "TwinWords":
        """The same, its time so much earlier: what is made ready until then is ready at the start."""
        return replace(self, offset=self.offset - seconds)

    def clock(self) -> SystemClock:
        """The clock of the twin's time."""
        return SystemClock(self.offset)

    def twin(self, site: SiteFolder) -> Twin:
        """The truth. Raises InputError: faults on what the site does not have, a motion that it cannot have."""
        faults = [Fault.parse(text) for text in self.faults]
        for fault in faults:
            _refuse_stranger(fault, site)
        return Twin(
            site,
            seed=self.seed,
            start_mjd=self.start_mjd,
            motion=AxisMotion.parse(self.motion),
            conditions=CONDITIONS[self.conditions],
            faults=FaultBoard(faults),
        )

    def options(self) -> list[str]:
        """The same as options of `catseye zy`."""
        words = [f"--seed={self.seed}", f"--start={self.start_mjd!r}", f"--clock-offset-s={self.offset!r}"]
        words += [f"--motion={self.motion}", f"--conditions={self.conditions}"]
        return ["--twin", *words, *(f"--fault={fault}" for fault in self.faults)]


def twin_heads(twin: Twin, rangers: tuple[str, ...], clock: Clock) -> dict[str, TwinHead]:
    """A head for each of some rangers; its tracks go as fast as its mirror's record, or a ZY's boot, lets moves go."""
    heads = {}
    for name in rangers:
        mirror = twin.site.mirror_of(name)
        pace = pace_by(mirror)
        tuning = MirrorTuning(velocity=min(pace.velocity), acceleration=min(pace.acceleration))
        heads[name] = TwinHead(
            name, twin, clock, seed=twin.seed, faults=twin.faults, tuning=tuning, build=HeadBuild(travel_of(mirror))
        )
    return heads


def _refuse_stranger(fault: Fault, site: SiteFolder) -> None:
    """A fault on nobody would do nothing, and nobody would know."""
    whom, _, part = fault.whom.partition(":")
    if fault.kind in ("lying-station", "silent-station"):
        known, what = [s.name for s in site.site.weather_station], "weather station"
    elif fault.kind == "silent-telescope":
        known, what = ["telescope"], "telescope"
    elif fault.kind == "dew":
        known, what = list(site.target_names), "target"
    else:
        known, what = list(site.rangers), "ranger"
    if whom != "*" and whom not in known:
        few = f"{', '.join(known[:3])}{', ...' if len(known) > 3 else ''}"
        raise InputError(f"fault {fault.kind} {fault.whom}: {whom} is no {what} of the site (expected {few} or *)")
    if part and fault.kind in ("stuck-axis", "lost-index") and part not in ("0", "1"):
        raise InputError(f"fault {fault.kind} {fault.whom}: {part} is no axis (expected 0 azimuth or 1 elevation)")
    if part and fault.kind in ("blocked-beam", "wrong-target") and part not in site.target_names:
        raise InputError(f"fault {fault.kind} {fault.whom}: {part} is no target of the site")
