"""A whole synthetic night: the campaign as the files would tell it, and the truth that they do not."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from catseye.constants import PPM, TWO_PI
from catseye.errors import InputError, ValidityError
from catseye.simulator.night.air import NIGHT, AirConditions, TrueAir, group_refractivity_ppm, weather_readings
from catseye.simulator.night.faults import Faults, Planted, Streams
from catseye.simulator.night.head import Return, returns_of_ranger, sampled_frames
from catseye.simulator.night.night import Night, Sounding
from catseye.simulator.night.posture import TruePosture, posture
from catseye.simulator.night.schedule import Schedule, feed_arm_targets, ground_targets, plan_shots
from catseye.simulator.night.structure import Structure, TrueTarget, structure, typed_mm, typing_error
from catseye.simulator.night.truth import truth_of
from catseye.simulator.night.world import (
    FEED_ARM_RANGERS,
    GROUND_RANGERS,
    TrueBenchmark,
    TrueHead,
    TrueMonument,
    benchmarks,
    head,
    monument,
)

START_MJD_UTC = 52889.125
SOUNDING_INTERVAL_S = 120.0


@dataclass(frozen=True)
class WarmLine(TrueAir):
    """Air that is warmer by a plume on the way to some points than smooth air at these heights.

    plumes   (point (3,) m, °C that the mean of the straight line is warmer: twice that half-way, none at the ends)
    """

    plumes: tuple[tuple[np.ndarray, float], ...] = ()

    def path_index(self, start, end, seconds):
        """As of `TrueAir`; towards a plume's point by the midpoint rule over 500 parts."""
        index = super().path_index(start, end, seconds)
        for point, warmer in self.plumes:
            share = (np.arange(500) + 0.5) / 500
            plume = warmer * (1.0 - np.cos(TWO_PI * share))
            for i in np.flatnonzero(np.all(np.asarray(end) == point, axis=-1)):
                z = start[2] + (end[i, 2] - start[2]) * share
                t = self.temperature_c(z, seconds[i]) + plume
                weather = self.pressure_hpa(z, seconds[i]), self.humidity_percent(seconds[i])
                # the plume warms, it does not wet: the same vapour is a lower relative humidity
                drier = saturation_hpa(self.temperature_c(z, seconds[i])) / saturation_hpa(t)
                index[i] = 1.0 + PPM * group_refractivity_ppm(t, weather[0], weather[1] * drier).mean()
        return index


def saturation_hpa(temperature_c):
    """Magnus' form, good to 0.5 %: only ratios are taken of it."""
    return 6.112 * np.exp(17.62 * temperature_c / (243.12 + temperature_c))


@dataclass(frozen=True)
class SimulatedTelescope:
    """How the telescope stands and what is on it.

    azimuth_deg     clockwise from north
    elevation_deg   5 to 90
    dish_prisms     0 to 9999
    triplets        0 to 99

    Raises ValidityError beyond these.
    """

    azimuth_deg: float = 145.3
    elevation_deg: float = 30.0
    dish_prisms: int = 60
    triplets: int = 10

    def __post_init__(self) -> None:
        if not 5.0 <= self.elevation_deg <= 90.0:
            raise ValidityError(f"elevation {self.elevation_deg} deg is outside 5-90 deg, where the telescope moves")
        if not (0 <= self.dish_prisms <= 9999 and 0 <= self.triplets <= 99):
            raise ValidityError(
                f"{self.dish_prisms} dish prisms and {self.triplets} triplets: expected 0-9999 and 0-99"
            )


@dataclass(frozen=True)
class LineWarmth:
    """Lines in warmer air than smooth, and whether sound measures them.

    warmer_c    (ranger, target) -> °C by which the mean of that line is warmer
    u_sound_c   °C: these lines are sounded, each with an offset of its own drawn from it, and noise of a fifth;
                None: no sound
    """

    warmer_c: Mapping[tuple[str, str], float] = field(default_factory=dict)
    u_sound_c: float | None = None


@dataclass(frozen=True, eq=False)
class NightSite:
    """What stands on the site of a simulated night; `cubes` are the benchmarks as targets, `points` all, m, ground."""

    heads: dict[str, TrueHead]
    monuments: dict[str, TrueMonument]
    marks: list[TrueBenchmark]
    pose: TruePosture
    telescope: Structure
    cubes: list[TrueTarget]
    points: dict[str, np.ndarray]

    @property
    def targets(self) -> dict[str, TrueTarget]:
        """All single targets and triplet parts by name."""
        return self.telescope.targets | {t.name: t for t in self.cubes}


def simulate_night(
    seed: int,
    *,
    telescope: SimulatedTelescope | None = None,
    faults: Faults | None = None,
    conditions: AirConditions = NIGHT,
    schedule: Schedule | None = None,
    planted: Planted | None = None,
    warmth: LineWarmth | None = None,
    night: int = 0,
) -> Night:
    """A night in the manner of night-01, from one seed.

    warmth   of lines; none if None
    night    another one at the same site: noise, electronics, weather and air are drawn anew

    Raises InputError: something planted on what the night does not have.
    """
    stands, warmth = telescope or SimulatedTelescope(), warmth or LineWarmth()
    faults, rule, planted = faults or Faults(), schedule or Schedule(), planted or Planted()
    streams = Streams(seed, night)
    site = _site(stands, faults, planted, streams)
    air = TrueAir(conditions, planted.gain("stratification"))
    returns = _returns(site, rule, _air_of_rangers(site, air, warmth), faults, planted, streams)
    ordered, frames = in_time(site.heads, returns, streams, planted=planted)
    until_s = ordered[-1].shot.seconds
    weather, offsets = weather_readings(air, streams=streams, faults=faults, planted=planted, until_s=until_s)
    truth = truth_of(
        heads=site.heads,
        monuments=site.monuments,
        telescope=site.telescope,
        points=site.points,
        returns=ordered,
        air=air,
        thermometer_offsets_c=offsets,
        pose=site.pose,
    )
    return Night(
        name=f"simulated-{seed}",
        seed=seed,
        azimuth_deg=stands.azimuth_deg,
        elevation_deg=stands.elevation_deg,
        start_mjd_utc=START_MJD_UTC,
        conditions=conditions,
        monuments=site.monuments,
        heads=site.heads,
        telescope=site.telescope,
        benchmarks=site.marks,
        single_targets=[*site.telescope.dish, *site.telescope.structural, *site.cubes],
        weather=weather,
        shots=[r.shot for r in ordered],
        frames=frames,
        truth=truth,
        sounded=soundings(air, warmth, site.points, streams=streams, until_s=until_s),
    )


def _site(stands: SimulatedTelescope, faults: Faults, planted: Planted, streams: Streams) -> NightSite:
    """Rangers, benchmarks and telescope, drawn. Raises InputError: an error planted on a stranger."""
    heads = {r: head(r, streams, planted) for r in (*GROUND_RANGERS, *FEED_ARM_RANGERS)}
    monuments = {r: monument(r, heads[r], streams, planted=planted) for r in GROUND_RANGERS}
    marks = benchmarks(monuments, streams, planted)
    pose = posture(stands.azimuth_deg, stands.elevation_deg, streams, planted=planted)
    telescope = structure(
        pose,
        dish_count=stands.dish_prisms,
        triplet_count=stands.triplets,
        streams=streams,
        faults=faults,
        planted=planted,
    )
    cubes = benchmark_targets(marks, streams, planted)
    targets = telescope.targets | {t.name: t for t in cubes}
    points = {r: m.true_scan_point for r, m in monuments.items()} | {t.name: t.point for t in targets.values()}
    points = shifted(points, planted)
    for ranger in planted.d0_error_mm:
        if ranger not in heads:
            raise InputError(f"a D0 error planted on {ranger!r}: expected a ranger, ZY101 to ZY118")
    return NightSite(heads, monuments, marks, pose, telescope, cubes, points)


def _air_of_rangers(site: NightSite, air: TrueAir, warmth: LineWarmth) -> dict[str, TrueAir]:
    """The air as each ranger looks through it. Raises InputError: a warm line with a strange end."""
    for ranger, target in warmth.warmer_c:
        if ranger not in site.heads or target not in site.points:
            raise InputError(f"a warm line {ranger} - {target}: the night has no such ends")
    plumes = {r: tuple((site.points[t], w) for (a, t), w in warmth.warmer_c.items() if a == r) for r in site.heads}
    return {r: WarmLine(air.conditions, air.stratification, p) if p else air for r, p in plumes.items()}


def _returns(
    site: NightSite,
    rule: Schedule,
    air_of: Mapping[str, TrueAir],
    faults: Faults,
    planted: Planted,
    streams: Streams,
) -> dict[str, list[Return]]:
    """What comes back to each ranger from the shots that the schedule plans."""
    telescope = site.telescope
    lists = ground_targets(
        rule, monuments=site.monuments, telescope=telescope, marks=site.marks, pose=site.pose, streams=streams
    ) | {r: feed_arm_targets(r, rule, telescope, faults=faults, streams=streams) for r in FEED_ARM_RANGERS}
    plan = plan_shots(rule, lists, streams)
    targets = site.targets
    return {
        r: returns_of_ranger(
            site.heads[r],
            plan[r],
            points=site.points,
            targets=targets,
            air=air_of[r],
            faults=faults,
            planted=planted,
            streams=streams,
        )
        for r in site.heads
    }


def soundings(
    air: TrueAir, warmth: LineWarmth, points: Mapping[str, np.ndarray], *, streams: Streams, until_s: float
) -> tuple[Sounding, ...]:
    """What sound measures of the warm lines: their true mean, an offset a line, and noise."""
    u_sound_c = warmth.u_sound_c
    if u_sound_c is None:
        return ()
    rows = []
    for (ranger, target), warmer in warmth.warmer_c.items():
        rng = streams(f"sound/{ranger}/{target}")
        offset = u_sound_c * rng.normal()
        z = np.linspace(points[ranger][2], points[target][2], 2001)
        for seconds in np.arange(0.0, until_s + SOUNDING_INTERVAL_S, SOUNDING_INTERVAL_S):
            mean = float(np.mean(air.temperature_c(z, seconds))) + warmer
            read = mean + offset + 0.2 * u_sound_c * rng.normal()
            rows.append(Sounding(float(seconds), ranger, target, read, u_sound_c))
    return tuple(sorted(rows, key=lambda row: row.seconds))


def benchmark_targets(marks: list[TrueBenchmark], streams: Streams, planted: Planted) -> list[TrueTarget]:
    """The benchmarks as targets with approximate positions."""
    rng = streams("benchmark positions")
    typed = [typed_mm(b.true_point + typing_error(planted, rng)) for b in marks]
    return [TrueTarget(b.name, "hollow", "ground", t, b.true_point) for b, t in zip(marks, typed, strict=True)]


def shifted(points: dict[str, np.ndarray], planted: Planted) -> dict[str, np.ndarray]:
    """The points with the planted shifts."""
    for name in planted.shifts:
        if name not in points:
            raise InputError(f"a shift planted on {name!r}: the night has no such point")
    return points | {name: points[name] + np.asarray(by, dtype=float) for name, by in planted.shifts.items()}


def in_time(
    heads: dict[str, TrueHead], returns: dict[str, list[Return]], streams: Streams, *, planted: Planted
) -> tuple[list[Return], np.ndarray]:
    """All returns in the order of their triggers, with their frames."""
    every = [r for ranger in heads for r in returns[ranger]]
    order = np.argsort([r.shot.seconds for r in every], kind="stable")
    frames = np.concatenate([sampled_frames(heads[z], returns[z], streams, planted=planted) for z in heads])
    return [every[i] for i in order], frames[order]
