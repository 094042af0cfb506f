"""Averages of residuals over many shots, as a test of the model.

An error unknown to the model appears there though each shot alone is in order. A family of patterns divides the shots
into bins (by time, height, ranger, elevation, incidence, length); an error common to a bin is tested as one more
parameter. A family with a significant bin is reported, and its bins become parameters of the spread that they show,
so that the claimed uncertainty covers it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from catseye.constants import DEGREE, MILLIMETRE, PPM, SECONDS_PER_DAY
from catseye.estimation.least_squares.adjustment import LeastSquaresSolution
from catseye.estimation.least_squares.influence import Influence
from catseye.estimation.observations.kinds import ObservationGroup
from catseye.records.night.campaign import ObservedSite
from catseye.reduction.site.places import RangedPoint

CRITICAL = 4.0  # of some sixty averages; one good night in three hundred shows one
BINS, TIME_BIN = 5, 1800.0  # bins of a family; s of one of time, of which there are 24 at most
FEWEST = 30  # shots that a bin needs


@dataclass(frozen=True)
class Family:
    """Rule that divides shots into bins.

    name    for people: "by height"
    unit    of an error common to a bin: "ppm" of the path or "mm"
    """

    name: str
    unit: str


TIME, HEIGHT = Family("by time", "ppm"), Family("by height", "ppm")
RANGER, ELEVATION = Family("by ranger", "mm"), Family("by elevation", "mm")
INCIDENCE, LENGTH = Family("by incidence", "mm"), Family("by length", "mm")
FAMILIES = (TIME, HEIGHT, RANGER, ELEVATION, INCIDENCE, LENGTH)


@dataclass(frozen=True, eq=False)
class Sorting:
    """Bins of one family.

    family   its rule
    labels   of the bins, for people
    of       function of a ranger and its shots: their bins
    """

    family: Family
    labels: tuple[str, ...]
    of: Callable[[str, np.ndarray], np.ndarray]

    def bins(self, ranger: str, shots: np.ndarray) -> np.ndarray:
        """Bin of each of a ranger's shots, -1 for none.

        Shots by their index in the campaign.
        """
        return self.of(ranger, shots)


def sortings(campaign: ObservedSite, places: dict[str, RangedPoint], shots: dict[str, np.ndarray]) -> list[Sorting]:
    """Bins of the families, by typed places.

    They do not change while an adjustment settles.

    shots   ranger: indices of its usable shots
    """
    all_shots = [(name, k) for name, ranger_shots in shots.items() for k in ranger_shots.tolist()]
    targets = campaign.shots.target
    a = np.array([places[name].start for name, _ in all_shots]).reshape(-1, 3)
    b = np.array([places[targets[k]].start for _, k in all_shots]).reshape(-1, 3)
    rows = np.array([k for _, k in all_shots], dtype=int)
    length = np.linalg.norm(b - a, axis=1)
    seconds = (campaign.shots.mjd_utc[rows] - campaign.shots.mjd_utc.min()) * SECONDS_PER_DAY
    normals = [places[targets[k]].normal for _, k in all_shots]
    toward = (a - b) / np.maximum(length, 1e-9)[:, None]
    incidence = np.array([np.nan if n is None else n @ t for n, t in zip(normals, toward, strict=True)])
    values = {
        HEIGHT: (0.5 * (a + b)[:, 2], 1.0, "m"),
        ELEVATION: (np.arcsin(-toward[:, 2]), DEGREE, "°"),
        INCIDENCE: (np.arccos(np.clip(incidence, -1.0, 1.0)), DEGREE, "°"),
        LENGTH: (length, 1.0, "m"),
    }
    count = int(np.clip(np.ptp(seconds) / TIME_BIN, 2, 24)) if len(seconds) else 0
    result = (
        [_by_value(TIME, rows, seconds, np.linspace(0.0, np.ptp(seconds), count + 1), (60.0, "min"))] if count else []
    )
    for family, (value, unit, unit_name) in values.items():
        finite = value[np.isfinite(value)]
        if len(finite) >= 2 * FEWEST:
            edges = np.unique(np.quantile(finite, np.linspace(0.0, 1.0, BINS + 1)))
            if len(edges) > 2:
                result.append(_by_value(family, rows, value, edges, (unit, unit_name)))
    names = tuple(shots)
    number = {name: i for i, name in enumerate(names)}
    return [*result, Sorting(RANGER, names, lambda ranger, ranger_shots: np.full(len(ranger_shots), number[ranger]))]


def _by_value(
    family: Family, rows: np.ndarray, values: np.ndarray, edges: np.ndarray, unit: tuple[float, str]
) -> Sorting:
    inside = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    bin_of = dict(zip(rows.tolist(), np.where(np.isfinite(values), inside, -1).tolist(), strict=True))
    labels = tuple(f"{a / unit[0]:.0f} to {b / unit[0]:.0f} {unit[1]}" for a, b in pairwise(edges))
    return Sorting(family, labels, lambda ranger, shots: np.array([bin_of[int(k)] for k in shots], dtype=int))


@dataclass(frozen=True)
class Average:
    """Error common to a bin's shots, beyond the model.

    label      of the bin
    estimate   unit of the family
    u          standard uncertainty of it
    shots      in the bin
    """

    label: str
    estimate: float
    u: float
    shots: int

    @property
    def w(self) -> float:
        """Estimate over its standard uncertainty."""
        return self.estimate / self.u


@dataclass(frozen=True)
class FamilyCheck:
    """Averages of one family.

    spread   of the bins' true errors beyond what noise explains, unit of the family; 0 where none stands out
    """

    family: Family
    averages: tuple[Average, ...]
    spread: float

    @property
    def worst(self) -> Average:
        """Most significant average."""
        return max(self.averages, key=lambda a: abs(a.w))

    @property
    def passed(self) -> bool:
        """True where no average is significant."""
        return abs(self.worst.w) <= CRITICAL

    def text(self) -> str:
        """Most significant average, in a sentence."""
        worst, unit = self.worst, self.family.unit
        return (
            f"ranges depart {self.family.name} more than the model explains: {worst.label} by "
            f"{worst.estimate:+.3g} {unit} (u {worst.u:.2g} {unit}, {worst.shots} shots, w {worst.w:.1f}); "
            f"{self.spread:.2g} {unit} are included in the uncertainties"
        )


def unit_of(family: Family, index: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Unit of a family's error in the optical lengths, (m,) m.

    index (m,) of the paths.
    """
    return PPM * distance if family.unit == "ppm" else MILLIMETRE * index


def self_checks(
    groups: Sequence[ObservationGroup],
    solution: LeastSquaresSolution,
    families: Sequence[Sorting],
    lines: Sequence[tuple[str, np.ndarray, np.ndarray, np.ndarray]],
) -> list[FamilyCheck]:
    """Averages of every family over the used shots.

    groups   as adjusted, the rangers' first
    lines    of each ranger's group: name, shots (m,), index (m,), distance (m,) m
    """
    influence = Influence(groups, solution)
    total = int(influence.first[-1])
    columns, owners = [], []
    for sorting in families:
        vectors = np.zeros((total, len(sorting.labels)))
        shots = np.zeros(len(sorting.labels), dtype=int)
        for (name, ranger_shots, index, distance), low, fit in zip(lines, influence.first, solution.fits, strict=False):
            bins = sorting.bins(name, ranger_shots)
            on = np.flatnonzero((bins >= 0) & fit.active)
            vectors[low + on, bins[on]] = unit_of(sorting.family, index, distance)[on]
            shots += np.bincount(bins[on], minlength=len(shots))
        enough = np.flatnonzero(shots >= FEWEST)
        columns.append(vectors[:, enough])
        owners.append((sorting, enough, shots))
    if not any(c.shape[1] for c in columns):
        return []
    estimate, u = influence.errors_of(np.concatenate(columns, axis=1))
    checks, at = [], 0
    for sorting, enough, shots in owners:
        mine = at + np.flatnonzero(np.isfinite(u[at : at + len(enough)]))
        if len(mine):
            checks.append(_judged(sorting, enough[mine - at], shots, estimate[mine], u[mine]))
        at += len(enough)
    return checks


def _judged(sorting: Sorting, bins: np.ndarray, shots: np.ndarray, estimate: np.ndarray, u: np.ndarray) -> FamilyCheck:
    averages = tuple(
        Average(sorting.labels[b], float(e), float(s), int(shots[b])) for b, e, s in zip(bins, estimate, u, strict=True)
    )
    check = FamilyCheck(sorting.family, averages, 0.0)
    if check.passed:
        return check
    weight = u**-2.0
    spread = np.sqrt(max(float(np.sum(weight * (estimate**2 - u**2)) / weight.sum()), 0.0))
    return FamilyCheck(sorting.family, averages, max(float(spread), abs(check.worst.estimate) / np.sqrt(len(averages))))
