"""Searches for several targets from one ranger: each planned, then made with what measures."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from catseye.aliases import Array
from catseye.errors import InputError
from catseye.geometry.mirror.pointing import counts
from catseye.geometry.sky.time_tag import TimeTag
from catseye.records.files.columns import columns_of
from catseye.records.files.reading import Folder
from catseye.records.files.refusal import shown
from catseye.records.site.mirror import MirrorGeometry
from catseye.records.site.monument import MonumentGeometry
from catseye.reduction.scans.search import ENOUGH, PatternName, SearchPlan, plan_search
from catseye.reduction.site.stations import station_of
from catseye.reduction.steering.finding import SearchResult, adjustment_readings, find
from catseye.reduction.steering.spot_fit import SearchHead, Spot
from catseye.verdict import Verdict

Measure = Callable[[Array, Array, float], float]  # V, at counts (2,), of a target predicted at (2,), m away
COLUMNS = ("target", "x_m", "y_m", "z_m")
READINGS_HEAD = "target,x_m,y_m,z_m,azimuth_counts,elevation_counts,"
FARTHEST = 2e4  # m
START_DAY = 52_889  # MJD of a simulated search
NOISE_VOLT, THRESHOLD_VOLT = 0.02, 0.5
SECOND = 1_000_000_000  # ns


@dataclass(frozen=True)
class TargetSearch:
    """Settings of every search.

    name     of the pattern of the plan; what is made is `steering.finding`, whose pattern is the spiral
    spot     m at the target, radius of the expected spot at 1/e^2
    u        rad, standard uncertainty of both angles
    radius   rad, of the searched area
    look     s, of one look
    """

    name: PatternName
    spot: float
    u: float
    radius: float
    look: float


@dataclass(frozen=True, eq=False)
class TargetPlaces:
    """Targets of a search: names, (t, 3) m in the ground frame, place of each row in the file."""

    names: tuple[str, ...]
    points: Array
    where: tuple[str, ...]
    file: str


@dataclass(frozen=True, eq=False)
class Searches:
    """Searches for t targets.

    targets     names and places
    predicted   (t, 2) counts
    distance    (t,) m
    plans       of each target
    spots       found or not, with every look
    started     (t,) s since the first search's start
    zeros       (2,) counts of the record
    """

    targets: TargetPlaces
    predicted: Array
    distance: Array
    plans: tuple[SearchPlan, ...]
    spots: tuple[Spot, ...]
    started: Array
    zeros: tuple[float, float] = field(default=(0.0, 0.0))

    @property
    def verdict(self) -> Verdict:
        """Good where every target was found and each was likely to be."""
        lost = [name for name, spot in zip(self.targets.names, self.spots, strict=True) if not spot.found]
        if len(lost) == len(self.spots):
            return Verdict("failed", f"none of {len(lost)} targets was found: {self.spots[0].status}")
        if lost:
            return Verdict("doubtful", f"{', '.join(lost)} of {len(self.spots)} targets not found")
        low = min(self.plans, key=lambda plan: plan.total)
        if low.total < ENOUGH:
            return Verdict(
                "doubtful", f"all targets were found, but only {100 * low.total:.1f} % of such searches find one"
            )
        return Verdict("good", f"all {len(self.spots)} targets were found")

    def readings(self) -> str:
        """Table of the found targets in the format of the calibration kind `search-results`.

        Raises ValidityError where none was found.
        """
        places = dict(zip(self.targets.names, self.targets.points, strict=True))
        results = [
            SearchResult(name, spot, TimeTag(np.array(START_DAY), np.array(round(start * SECOND))))
            for name, spot, start in zip(self.targets.names, self.spots, self.started.tolist(), strict=True)
        ]
        return adjustment_readings(results, places, self.zeros[1])


def read_targets(path: Path) -> TargetPlaces:
    """Targets of a table; InputError names file, line, value."""
    table = columns_of(Folder(path.parent).text(path.name), path.name, COLUMNS)
    names = tuple(table.cells["target"])
    for row, name in enumerate(names):
        if not name or names.index(name) < row:
            raise table.refuse(row, f"target = {shown(name)} (expected a name that no other row has)")
    points = np.column_stack([table.numbers(name) for name in COLUMNS[1:]])
    for k, name in enumerate(COLUMNS[1:]):
        table.check(name, np.abs(points[:, k]) <= FARTHEST, f"-{FARTHEST:g} to {FARTHEST:g} m")
    return TargetPlaces(names, points, table.where(), path.name)


def search_targets(
    targets: TargetPlaces,
    monument: MonumentGeometry,
    mirror: MirrorGeometry,
    *,
    measure: Measure,
    settings: TargetSearch,
) -> Searches:
    """Plan and make the search for each target, in order.

    targets            to be found
    monument, mirror   records of the ranger
    measure            amplitude, V, at counts
    settings           of every search

    Raises InputError for a target at the ranger or beyond its azimuth stops.
    """
    station = station_of(monument, mirror)
    limits = (float(mirror.az_low_limit), float(mirror.az_high_limit))
    zeros = (float(mirror.na0), float(mirror.ne0))
    distance = np.linalg.norm(targets.points - station.scan_point, axis=1)
    predicted = np.atleast_2d(counts(station, targets.points))
    plans, spots, started, clock = [], [], [], 0.0
    for k, at in enumerate(predicted):
        if not (np.isfinite(at).all() and distance[k] > 1.0 and limits[0] <= at[0] <= limits[1]):
            raise InputError(
                f"{targets.file}: {targets.where[k]}, target {targets.names[k]!r} cannot be pointed at, azimuth "
                f"{at[0]:.0f} counts, {distance[k]:.1f} m (expected {limits[0]:.0f} to {limits[1]:.0f}, above 1 m)"
            )
        angle = settings.spot / float(distance[k])
        plan = plan_search(
            at,
            zeros,
            name=settings.name,
            spot=angle,
            u=settings.u,
            radius=settings.radius,
            look=settings.look,
            limits=limits,
        )
        plans.append(plan)
        head = SearchHead(zeros, limits, angle, threshold_volt=THRESHOLD_VOLT, noise_volt=NOISE_VOLT)
        far = float(distance[k])
        spots.append(find(at, head, _looking(measure, at, far), search_radius=settings.radius))
        started.append(clock)
        clock += settings.look * len(spots[-1].seen)
    return Searches(
        targets=targets,
        predicted=predicted,
        distance=distance,
        plans=tuple(plans),
        spots=tuple(spots),
        started=np.array(started),
        zeros=zeros,
    )


def _looking(measure: Measure, at: Array, far: float) -> Callable[[Array], float]:
    """Function of counts alone that measures the target predicted at counts, so far away."""
    return lambda n: measure(n, at, far)
