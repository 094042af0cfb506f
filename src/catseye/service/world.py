"""Options of a twin: equal options make equal truth and time."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from catseye.clock import Clock, SystemClock
from catseye.errors import InputError
from catseye.simulator.twin.conditions import DEWY_NIGHT, LIVING_NIGHT, WINDY_DAY
from catseye.simulator.twin.faults import Fault, FaultBoard
from catseye.simulator.twin.motion import AxisMotion

if TYPE_CHECKING:
    from catseye.records.site.folder import SiteFolder
    from catseye.simulator.twin.head import TwinHead
    from catseye.simulator.twin.site import Twin

CONDITIONS = {"night": LIVING_NIGHT, "windy-day": WINDY_DAY, "dewy-night": DEWY_NIGHT}
MOTION = "track 145.3 45"


@dataclass(frozen=True)
class TwinWords:
    """Options of a twin, as text.

    start_mjd    UTC, where its seconds begin
    seed         of every random draw
    offset       s, of its time against this machine's UTC
    motion       of the telescope, as typed
    conditions   name of the weather: night, windy-day, dewy-night
    faults       as typed: KIND WHOM [START [END [SIZE]]]
    structure    file of the structural model that bends the site's telescope; "": the site's own, if any

    Raises InputError: an unknown motion, weather or fault.
    """

    start_mjd: float
    seed: int = 1
    offset: float = 0.0
    motion: str = MOTION
    conditions: str = "night"
    faults: tuple[str, ...] = ()
    structure: str = ""

    def __post_init__(self) -> None:
        AxisMotion.parse(self.motion)
        for text in self.faults:
            Fault.parse(text)
        if self.conditions not in CONDITIONS:
            raise InputError(f"conditions {self.conditions!r} (expected one of {', '.join(CONDITIONS)})")

    @staticmethod
    def starting_now(start_mjd: float, **others: Any) -> "TwinWords":
        """Options of a twin whose time is `start_mjd` now."""
        return TwinWords(start_mjd, offset=SystemClock.starting_at(start_mjd).offset, **others)

    def late(self, seconds: float) -> "TwinWords":
        """The same with its time set earlier.

        What is made ready until then is ready at the start.
        """
        return replace(self, offset=self.offset - seconds)

    def clock(self) -> SystemClock:
        """The clock of the twin's time."""
        return SystemClock(self.offset)

    def twin(self, site: "SiteFolder") -> "Twin":
        """The twin.

        Raises InputError: faults on devices that the site does not have, an impossible motion.
        """
        from catseye.simulator.twin.site import Twin

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
        words += [f"--structure={self.structure}"] if self.structure else []
        return ["--twin", *words, *(f"--fault={fault}" for fault in self.faults)]


def twin_heads(twin: "Twin", rangers: tuple[str, ...], clock: Clock) -> "dict[str, TwinHead]":
    """Simulated heads by ranger.

    Their tracks are as fast as the mirror's record, or a ZY's default, permits moves.
    """
    from catseye.coordinator.visibility.vantage import pace_by
    from catseye.simulator.twin.head import HeadBuild, TwinHead
    from catseye.simulator.twin.mirror import MirrorTuning, travel_of

    heads = {}
    for name in rangers:
        mirror = twin.site.mirror_of(name)
        pace = pace_by(mirror)
        tuning = MirrorTuning(velocity=min(pace.velocity), acceleration=min(pace.acceleration))
        heads[name] = TwinHead(
            name, twin, clock, seed=twin.seed, faults=twin.faults, tuning=tuning, build=HeadBuild(travel_of(mirror))
        )
    return heads


def _refuse_stranger(fault: Fault, site: "SiteFolder") -> None:
    """Refuse a fault on an unknown device: it would have no effect."""
    whom, _, part = fault.whom.partition(":")
    if fault.kind in ("lying-station", "silent-station"):
        names, what = [s.name for s in site.site.weather_station], "weather station"
    elif fault.kind == "silent-telescope":
        names, what = ["telescope"], "telescope"
    elif fault.kind == "dew":
        names, what = list(site.target_names), "target"
    else:
        names, what = list(site.rangers), "ranger"
    if whom != "*" and whom not in names:
        few = f"{', '.join(names[:3])}{', ...' if len(names) > 3 else ''}"
        raise InputError(f"fault {fault.kind} {fault.whom}: unknown {what} {whom} (expected {few} or *)")
    if part and fault.kind in ("stuck-axis", "lost-index") and part not in ("0", "1"):
        raise InputError(
            f"fault {fault.kind} {fault.whom}: {part} is not an axis (expected 0 for azimuth or 1 for elevation)"
        )
    if part and fault.kind in ("blocked-beam", "wrong-target") and part not in site.target_names:
        raise InputError(f"fault {fault.kind} {fault.whom}: unknown target {part}")
