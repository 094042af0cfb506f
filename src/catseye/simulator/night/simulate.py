"""Simulate a night: the campaign as in its files, and the truth."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from catseye.constants import DEGREE
from catseye.errors import InputError, ValidityError
from catseye.records.site.retroreflector import HOLLOW
from catseye.records.site.structural_model import StructuralModel
from catseye.simulator.night.air import NIGHT, AirConditions, TrueAir
from catseye.simulator.night.batches import in_batches
from catseye.simulator.night.expansion import MovingPoints
from catseye.simulator.night.faults import Faults, Planted, Streams
from catseye.simulator.night.head import Return, at_frequency, returns_of_ranger, sampled_frames
from catseye.simulator.night.movements import ALIDADE, ARM, BODIES, DISH, TELESCOPE
from catseye.simulator.night.natural_air import NaturalAir
from catseye.simulator.night.nature import CALM, Nature
from catseye.simulator.night.night import Night
from catseye.simulator.night.posture import TruePosture, posture
from catseye.simulator.night.schedule import Schedule, ScheduledShot, feed_arm_targets, ground_targets, plan_shots
from catseye.simulator.night.stations import WeatherStations, station_points
from catseye.simulator.night.structure import (
    APERTURE_CENTRE,
    Structure,
    TrueTarget,
    height_above_vertex,
    structure,
    typed_mm,
    typing_error,
)
from catseye.simulator.night.truth import truth_of
from catseye.simulator.night.warm_lines import LineWarmth, air_of_rangers, soundings
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
from catseye.simulator.structure.bent_telescope import BentTelescope

START_MJD_UTC = 52889.125


@dataclass(frozen=True)
class SimulatedTelescope:
    """Posture of the telescope and its equipment.

    azimuth_deg     clockwise from north
    elevation_deg   5 to 90
    dish_prisms     0 to 9999
    triplets        0 to 99
    structure       model that bends it away from a rigid one; None: rigid, but for what the night draws

    Raises ValidityError beyond these.
    """

    azimuth_deg: float = 145.3
    elevation_deg: float = 30.0
    dish_prisms: int = 60
    triplets: int = 10
    structure: StructuralModel | None = None

    def __post_init__(self) -> None:
        if not 5.0 <= self.elevation_deg <= 90.0:
            raise ValidityError(f"elevation {self.elevation_deg} deg is outside 5-90 deg, where the telescope moves")
        if not (0 <= self.dish_prisms <= 9999 and 0 <= self.triplets <= 99):
            raise ValidityError(
                f"{self.dish_prisms} dish prisms and {self.triplets} triplets: expected 0-9999 and 0-99"
            )


@dataclass(frozen=True, eq=False)
class NightSite:
    """Objects on the site of a simulated night.

    `cubes` are the benchmarks as targets, `points` all, m, ground.
    """

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


def simulate_night(  # noqa: PLR0913 - what a night is made of, keyword-only
    seed: int,
    *,
    telescope: SimulatedTelescope | None = None,
    faults: Faults | None = None,
    conditions: AirConditions = NIGHT,
    schedule: Schedule | None = None,
    planted: Planted | None = None,
    warmth: LineWarmth | None = None,
    night: int = 0,
    nature: Nature | None = None,
    start_mjd_utc: float = START_MJD_UTC,
) -> Night:
    """Simulate a night like night-01 from one seed.

    warmth          of lines; none if None
    night           another night at the same site, with new noise, electronics, weather and air
    nature          waves, fronts, turbulence, thermometers that lag, a telescope that expands; none of these if None
    start_mjd_utc   with `nature`, sets the Sun's position, no more

    Raises InputError: something planted on an object the night does not have.
    """
    stands, warmth, nature = telescope or SimulatedTelescope(), warmth or LineWarmth(), nature or CALM
    faults, rule, planted = faults or Faults(), schedule or Schedule(), planted or Planted()
    streams = Streams(seed, night)
    site = _site(stands, faults, planted, streams, batch_heights=nature.batch_heights)
    stratification = planted.gain("stratification")
    air = TrueAir(conditions, stratification) if nature.calm else NaturalAir(conditions, stratification, nature)
    plan = _plan(site, rule, faults, streams)
    moving = _moving(site, air, nature, plan)
    air_of = air_of_rangers(site.heads, site.points, air, warmth)
    returns = {
        r: returns_of_ranger(
            site.heads[r],
            plan[r],
            points=moving,
            targets=site.targets,
            air=air_of[r],
            faults=faults,
            planted=planted,
            streams=streams,
        )
        for r in site.heads
    }
    ordered, frames = in_time(site.heads, returns, streams, planted=planted)
    until_s = ordered[-1].shot.seconds
    wind = float(np.hypot(*nature.wind_m_s))
    stations = WeatherStations(station_points(streams), nature.stations, wind, start_mjd_utc)
    weather, offsets = stations.readings(air, streams=streams, faults=faults, planted=planted, until_s=until_s)
    truth = truth_of(
        heads=site.heads,
        monuments=site.monuments,
        telescope=site.telescope,
        moving=moving,
        returns=ordered,
        stations=stations,
        thermometer_offsets_c=offsets,
        pose=site.pose,
        nature=nature,
    )
    return Night(
        name=f"simulated-{seed}",
        seed=seed,
        azimuth_deg=stands.azimuth_deg,
        elevation_deg=stands.elevation_deg,
        start_mjd_utc=start_mjd_utc,
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
        nature=nature,
        tuned={
            r: tuple(at_frequency(site.heads[r], hz, streams, planted=planted) for hz in rule.further_hz)
            for r in site.heads
        }
        if rule.further_hz
        else {},
    )


def _site(
    stands: SimulatedTelescope, faults: Faults, planted: Planted, streams: Streams, *, batch_heights: float
) -> NightSite:
    """Draw rangers, benchmarks and telescope.

    Raises InputError: an error planted on an unknown ranger.
    """
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
    if stands.structure is not None:
        telescope = bent(telescope, BentTelescope(stands.structure), stands.azimuth_deg, stands.elevation_deg)
    telescope = in_batches(telescope, batch_heights, streams, planted)
    cubes = benchmark_targets(marks, streams, planted)
    targets = telescope.targets | {t.name: t for t in cubes}
    points = {r: m.true_scan_point for r, m in monuments.items()} | {t.name: t.point for t in targets.values()}
    points = shifted(points, planted)
    for ranger in (*planted.d0_error_mm, *planted.modulation_ppm):
        if ranger not in heads:
            raise InputError(f"an error planted on {ranger!r}: expected a ranger, ZY101 to ZY118")
    return NightSite(
        heads=heads, monuments=monuments, marks=marks, pose=pose, telescope=telescope, cubes=cubes, points=points
    )


def bent(telescope: Structure, by: BentTelescope, azimuth_deg: float, elevation_deg: float) -> Structure:
    """Telescope with its targets moved and turned by a structural model.

    Raises ValidityError outside the model's elevations.
    """
    azimuth, elevation = np.array([azimuth_deg * DEGREE]), np.array([elevation_deg * DEGREE])

    def moved(target: TrueTarget, body: str) -> TrueTarget:
        shift = by.shift(body, azimuth, elevation, target.name)
        normal = None if target.normal is None else shift.turn[0] @ target.normal
        return replace(target, point=shift.points(target.point)[0], normal=normal)

    units = []
    for one in telescope.triplets:
        left, right, ball = (moved(target, "dish") for target in one.targets)
        units.append(replace(one, targets=(left, right, ball)))
    return replace(
        telescope,
        feed_arm={name: moved(target, "arm") for name, target in telescope.feed_arm.items()},
        dish=[moved(target, "dish") for target in telescope.dish],
        triplets=units,
        structural=[moved(t, "arm" if t.frame == "reflector" else "alidade") for t in telescope.structural],
    )


def _plan(site: NightSite, rule: Schedule, faults: Faults, streams: Streams) -> dict[str, list[ScheduledShot]]:
    """Planned shots of every ranger at its times."""
    telescope = site.telescope
    lists = ground_targets(
        rule, monuments=site.monuments, telescope=telescope, marks=site.marks, pose=site.pose, streams=streams
    ) | {r: feed_arm_targets(r, rule, telescope, faults=faults, streams=streams) for r in FEED_ARM_RANGERS}
    return plan_shots(rule, lists, streams)


def _moving(site: NightSite, air: TrueAir, nature: Nature, plan: Mapping[str, list[ScheduledShot]]) -> MovingPoints:
    """Points of the telescope as it expands and moves.

    The drawn positions hold half-way from the first shot to the last.

    Raises InputError: a movement of an unknown body.
    """
    law = nature.expansion
    seconds = [shot.seconds for shots in plan.values() for shot in shots]
    expansion = dict.fromkeys(site.telescope.targets, 0.0)
    on_dish = [t.name for t in (*site.telescope.dish, *(t for unit in site.telescope.triplets for t in unit.targets))]
    on_arm = [*FEED_ARM_RANGERS, *(t.name for t in site.telescope.structural if t.frame == "reflector")]
    if law is not None:
        expansion |= dict.fromkeys(on_dish, law.dish_share) | dict.fromkeys(on_arm, law.arm_share)
    centre, on_alidade = np.array([*APERTURE_CENTRE, height_above_vertex(APERTURE_CENTRE)]), frozenset(on_dish + on_arm)
    middle = 0.5 * (min(seconds) + max(seconds))
    bodies = {ARM: frozenset(on_arm), DISH: frozenset(on_dish), TELESCOPE: frozenset(site.telescope.targets)}
    bodies[ALIDADE] = bodies[TELESCOPE] - bodies[ARM] - bodies[DISH]
    for movement in nature.movements:
        if movement.body not in (*bodies, *site.points):
            raise InputError(f"a movement of {movement.body!r}: expected {', '.join(BODIES)} or a point's name")
    return MovingPoints(
        points=site.points,
        air=air,
        law=law,
        reference_s=middle,
        own=expansion,
        dish_middle=site.pose.dish(centre),
        carried=on_alidade,
        movements=nature.movements,
        bodies=bodies,
    )


def benchmark_targets(marks: list[TrueBenchmark], streams: Streams, planted: Planted) -> list[TrueTarget]:
    """Benchmarks as targets with approximate positions."""
    rng = streams("benchmark positions")
    typed = [typed_mm(b.true_point + typing_error(planted, rng)) for b in marks]
    return [TrueTarget(b.name, HOLLOW, "ground", t, b.true_point) for b, t in zip(marks, typed, strict=True)]


def shifted(points: dict[str, np.ndarray], planted: Planted) -> dict[str, np.ndarray]:
    """Points with the planted shifts."""
    for name in planted.shifts:
        if name not in points:
            raise InputError(f"a shift planted on {name!r}: unknown point")
    return points | {name: points[name] + np.asarray(by, dtype=float) for name, by in planted.shifts.items()}


def in_time(
    heads: dict[str, TrueHead], returns: dict[str, list[Return]], streams: Streams, *, planted: Planted
) -> tuple[list[Return], np.ndarray]:
    """All returns in the order of their triggers, with their frames."""
    all_returns = [r for ranger in heads for r in returns[ranger]]
    order = np.argsort([r.shot.seconds for r in all_returns], kind="stable")
    frames = np.concatenate([sampled_frames(heads[z], returns[z], streams, planted=planted) for z in heads])
    return [all_returns[i] for i in order], frames[order]
