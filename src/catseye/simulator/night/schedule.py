"""Shot schedule of a campaign, like night-01."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catseye.constants import DEGREE, SECONDS_PER_DAY
from catseye.errors import ValidityError
from catseye.records.night.campaign import LONGEST_CAMPAIGN
from catseye.simulator.night.faults import Faults, Streams
from catseye.simulator.night.posture import TruePosture
from catseye.simulator.night.structure import Structure, unit
from catseye.simulator.night.world import FEED_ARM_RANGERS, GROUND_RANGERS, TrueBenchmark, TrueMonument

REFERENCE = "ZRG"
MODULATION_HZ = 1.5e9
LOWEST_HZ, HIGHEST_HZ = 1e9, 2e9  # of a detector and an oscillator made for 1500 MHz
BUFFER_S = 0.128  # s, duration of a shot: 128 cycles of 1 kHz


@dataclass(frozen=True)
class Schedule:
    """Rhythm of the campaign.

    interval_s        between shots of a ranger
    jitter_s          each shot is early or late by up to this, never before the last buffer is complete
    reference_every   shots between two reference shots
    span_s            the ground rangers start anywhere that lets them end within it
    ball_rangers      ground rangers that shoot one ball, at most
    ball_angle_deg    largest angle from the axis of a ball
    weak_share        share of the dish prisms that the weak ranger shoots
    again             repeats of each dish prism by a feed-arm ranger; a fraction is a share of the prisms
    further_hz        further modulation frequencies: every shot is repeated at each, reference shots too
    """

    interval_s: float = 14.0
    jitter_s: float = 0.75
    reference_every: int = 8
    span_s: float = 3300.0
    ball_rangers: int = 5
    ball_angle_deg: float = 79.0
    weak_share: float = 2.0 / 3.0
    again: float = 0.0
    ground_repeats: int = 2
    certified_repeats: int = 4
    neighbour_repeats: int = 2
    further_hz: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not BUFFER_S < self.interval_s <= 1000.0:
            raise ValidityError(
                f"interval_s = {self.interval_s:g} (expected above {BUFFER_S} s, a shot's buffer, to 1000)"
            )
        if not 0.0 <= self.again <= 1000.0:
            raise ValidityError(f"again = {self.again:g} (expected 0 to 1000)")
        modulations = (MODULATION_HZ, *self.further_hz)
        for hz in self.further_hz:
            if not LOWEST_HZ <= hz <= HIGHEST_HZ or modulations.count(hz) > 1:
                raise ValidityError(
                    f"modulation frequency {hz:.10g} Hz (expected {LOWEST_HZ:g} to {HIGHEST_HZ:g}, each once, "
                    f"besides {MODULATION_HZ:g})"
                )


@dataclass(frozen=True)
class ScheduledShot:
    """One shot of the plan, s since the start."""

    seconds: float
    ranger: str
    target: str
    modulation_hz: float = MODULATION_HZ


def ground_targets(
    rule: Schedule,
    *,
    monuments: dict[str, TrueMonument],
    telescope: Structure,
    marks: list[TrueBenchmark],
    pose: TruePosture,
    streams: Streams,
) -> dict[str, list[str]]:
    """Targets of each ground ranger, repeats included.

    Seen from the design, so that planted errors do not change it.
    """
    lists: dict[str, list[str]] = {ranger: [] for ranger in GROUND_RANGERS}
    place = {r: m.fixed_point_mm / 1000.0 for r, m in monuments.items()}
    for unit_ in telescope.triplets:
        rng = streams(f"sight/{unit_.name}")
        ball, axis = telescope.design[f"{unit_.name}-B"], -pose.nominal_direction(unit(unit_.normal))
        cosine = {r: unit(p - ball) @ axis for r, p in place.items() if p[2] < ball[2]}
        facing = [r for r, c in cosine.items() if c > np.cos(rule.ball_angle_deg * DEGREE)]
        fewer = int(rng.uniform() < 0.3)
        for r in rng.permutation(facing)[: max(rule.ball_rangers - fewer, 3)]:
            lists[str(r)] += [f"{unit_.name}-B"] * rule.ground_repeats
    for i, target in enumerate(telescope.structural):
        if target.frame == "reflector":  # on the feed arm, seen from all around: every other ranger
            chosen = list(GROUND_RANGERS[i % 2 :: 2])
        else:  # near the elevation bearing: the five nearest
            at = telescope.design[target.name]
            chosen = sorted(GROUND_RANGERS, key=lambda r: float(np.linalg.norm(place[r] - at)))[:5]
        for r in chosen:
            lists[r] += [target.name] * rule.ground_repeats
    for mark in marks:
        lists[mark.ranger] += [mark.name] * rule.certified_repeats
        if mark.neighbour:
            lists[mark.neighbour] += [mark.name] * rule.neighbour_repeats
    return lists


def feed_arm_targets(
    ranger: str, rule: Schedule, telescope: Structure, *, faults: Faults, streams: Streams
) -> list[str]:
    """Targets of a feed-arm ranger.

    The other rangers and the triplets' prisms once, nearly all dish prisms.
    """
    rangers = [r for r in FEED_ARM_RANGERS if r != ranger]
    prisms = [t.name for unit_ in telescope.triplets for t in unit_.plate]
    share = rule.weak_share if ranger == faults.weak_ranger else 0.99
    drawn = streams(f"prisms/{ranger}").uniform(size=len(telescope.dish))
    dish = [t.name for t, u in zip(telescope.dish, drawn, strict=True) if u < share]
    more = streams(f"again/{ranger}").uniform(size=len(dish)) < rule.again % 1.0 if rule.again else np.zeros(len(dish))
    repeats = [name for name, extra in zip(dish, more, strict=True) for _ in range(int(rule.again) + int(extra))]
    return rangers + prisms + dish + repeats


def at_frequencies(targets: list[str], interval: int, further_hz: Sequence[float]) -> list[tuple[str, float]]:
    """Targets and modulation frequencies, block by block at one frequency after the other, between reference shots."""
    if not further_hz:
        return [(name, MODULATION_HZ) for name in with_references(targets, interval)]
    blocks = [targets[i : i + interval] for i in range(0, len(targets), interval)]
    return [
        (name, hz) for block in blocks for hz in (MODULATION_HZ, *further_hz) for name in (REFERENCE, *block, REFERENCE)
    ]


def with_references(targets: list[str], interval: int) -> list[str]:
    """Targets with a reference shot first, last, and at an interval."""
    blocks = [targets[i : i + interval] for i in range(0, len(targets), interval)]
    return [REFERENCE, *(name for block in blocks for name in (*block, REFERENCE))]


def plan_shots(rule: Schedule, shot_lists: dict[str, list[str]], streams: Streams) -> dict[str, list[ScheduledShot]]:
    """Shots of every ranger at its times.

    Raises ValidityError: more shots than fit a campaign's day.
    """
    plan = {}
    needs: list[tuple[float, int]] = []
    jitter = min(rule.jitter_s, 0.5 * (rule.interval_s - BUFFER_S))
    for ranger, targets in shot_lists.items():
        rng = streams(f"schedule/{ranger}")
        order = [str(t) for t in rng.permutation(targets)] if targets else []
        names = at_frequencies(order, rule.reference_every, rule.further_hz)
        on_ground = ranger in GROUND_RANGERS
        room = rule.span_s - rule.interval_s * len(names)
        start = rng.uniform(40.0, max(room, 60.0) if on_ground else 0.3 * rule.span_s)
        times = start + rule.interval_s * np.arange(len(names)) + rng.uniform(-jitter, jitter, len(names))
        needs.append((start, len(names)))
        plan[ranger] = [ScheduledShot(float(t), ranger, name, hz) for t, (name, hz) in zip(times, names, strict=True)]
    _refuse_long(rule, needs)
    return plan


def _refuse_long(rule: Schedule, needs: Sequence[tuple[float, int]]) -> None:
    """Raise ValidityError where shots end after a campaign's limit.

    needs   start, s, and number of shots of each ranger
    """
    longest = LONGEST_CAMPAIGN * SECONDS_PER_DAY
    fits = min(((longest - start) / count for start, count in needs), default=rule.interval_s)
    if rule.interval_s > fits:
        most = max(count for _, count in needs)
        raise ValidityError(
            f"interval_s = {rule.interval_s:g}: {most} shots of a ranger take {rule.interval_s * most / 3600.0:.1f} h, "
            f"a campaign holds {longest / 3600.0:g} h (expected at most {np.floor(100.0 * fits) / 100.0:g} s, or fewer "
            "prisms, or a smaller again)"
        )
