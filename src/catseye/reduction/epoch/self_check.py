"""Averages of residuals over many shots: what the model does not know shows where each shot alone is in order.

A family of patterns cuts the shots into bins (by time, height, ranger, elevation, incidence, length); an error common
to a bin is tested as one more parameter. A family in which one stands out is told, and its bins become parameters of
the spread that they show, so that what is claimed covers it.
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
    """A way to cut shots into bins.

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

    family   which
    labels   of the bins, for people
    of       from a ranger and its shots to their bins
    """

    family: Family
    labels: tuple[str, ...]
    of: Callable[[str, np.ndarray], np.ndarray]

    def bins(self, ranger: str, shots: np.ndarray) -> np.ndarray:
        """Bin of each of a ranger's shots, by their index in the campaign; -1 for none."""
        return self.of(ranger, shots)


def sortings(campaign: ObservedSite, places: dict[str, RangedPoint], shots: dict[str, np.ndarray]) -> list[Sorting]:
    """The families' bins, by typed places: they do not change while an adjustment settles.

    shots   ranger: indices of its usable shots
    """
    every = [(name, k) for name, own in shots.items() for k in own.tolist()]
    targets = campaign.shots.target
    a = np.array([places[name].start for name, _ in every]).reshape(-1, 3)
    b = np.array([places[targets[k]].start for _, k in every]).reshape(-1, 3)
    rows = np.array([k for _, k in every], dtype=int)
    length = np.linalg.norm(b - a, axis=1)
    seconds = (campaign.shots.mjd_utc[rows] - campaign.shots.mjd_utc.min()) * SECONDS_PER_DAY
    normals = [places[targets[k]].normal for _, k in every]
    toward = (a - b) / np.maximum(length, 1e-9)[:, None]
    incidence = np.array([np.nan if n is None else n @ t for n, t in zip(normals, toward, strict=True)])
    values = {
        HEIGHT: (0.5 * (a + b)[:, 2], 1.0, "m"),
        ELEVATION: (np.arcsin(-toward[:, 2]), DEGREE, "°"),
        INCIDENCE: (np.arccos(np.clip(incidence, -1.0, 1.0)), DEGREE, "°"),
        LENGTH: (length, 1.0, "m"),
    }
    count = int(np.clip(np.ptp(seconds) / TIME_BIN, 2, 24)) if len(seconds) else 0
    found = (
        [_by_value(TIME, rows, seconds, np.linspace(0.0, np.ptp(seconds), count + 1), (60.0, "min"))] if count else []
    )
    for family, (value, unit, said) in values.items():
        known = value[np.isfinite(value)]
        if len(known) >= 2 * FEWEST:
            edges = np.unique(np.quantile(known, np.linspace(0.0, 1.0, BINS + 1)))
            if len(edges) > 2:
                found.append(_by_value(family, rows, value, edges, (unit, said)))
    names = tuple(shots)
    number = {name: i for i, name in enumerate(names)}
    return [*found, Sorting(RANGER, names, lambda ranger, own: np.full(len(own), number[ranger]))]


def _by_value(
    family: Family, rows: np.ndarray, values: np.ndarray, edges: np.ndarray, unit: tuple[float, str]
) -> Sorting:
    inside = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    bin_of = dict(zip(rows.tolist(), np.where(np.isfinite(values), inside, -1).tolist(), strict=True))
    labels = tuple(f"{a / unit[0]:.0f} to {b / unit[0]:.0f} {unit[1]}" for a, b in pairwise(edges))
    return Sorting(family, labels, lambda ranger, own: np.array([bin_of[int(k)] for k in own], dtype=int))


@dataclass(frozen=True)
class Average:
    """An error that a bin's shots have in common, beyond the model.

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
    """A family's averages.

    spread   of the bins' true errors beyond what noise explains, unit of the family; 0 where none stands out
    """

    family: Family
    averages: tuple[Average, ...]
    spread: float

    @property
    def worst(self) -> Average:
        """The average that stands out most."""
        return max(self.averages, key=lambda a: abs(a.w))

    @property
    def passed(self) -> bool:
        """True where no average stands out."""
        return abs(self.worst.w) <= CRITICAL

    def text(self) -> str:
        """What stands out, in a sentence."""
        worst, unit = self.worst, self.family.unit
        return (
            f"ranges depart {self.family.name} beyond what the model explains: {worst.label} by "
            f"{worst.estimate:+.3g} {unit} (u {worst.u:.2g} {unit}, {worst.shots} shots, w {worst.w:.1f}); "
            f"{self.spread:.2g} {unit} are allowed for"
        )


def unit_of(family: Family, index: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """(m,) m, what a unit of a family's error is in the optical lengths; index (m,) of the paths."""
    return PPM * distance if family.unit == "ppm" else MILLIMETRE * index


def self_checks(
    groups: Sequence[ObservationGroup],
    solution: LeastSquaresSolution,
    found: Sequence[Sorting],
    lines: Sequence[tuple[str, np.ndarray, np.ndarray, np.ndarray]],
) -> list[FamilyCheck]:
    """Every family's averages over the used shots.

    groups   as adjusted, the rangers' first
    lines    of each ranger's group: name, shots (m,), index (m,), distance (m,) m
    """
    influence = Influence(groups, solution)
    total = int(influence.first[-1])
    columns, owners = [], []
    for sorting in found:
        vectors = np.zeros((total, len(sorting.labels)))
        shots = np.zeros(len(sorting.labels), dtype=int)
        for (name, own, index, distance), low, fit in zip(lines, influence.first, solution.fits, strict=False):
            bins = sorting.bins(name, own)
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
