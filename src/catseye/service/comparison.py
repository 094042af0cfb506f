"""Epochs held against the twin's truth: how far off, what was claimed, and whether the two fit.

The truth of a point in an epoch is the mean of its true places over the epoch's shots, each carried to the epoch's
instant in the frame that carries the point: what an epoch answers. Points that last and have three shots are compared.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catseye.constants import MILLIMETRE
from catseye.coordinator.journal.entries import AnsweredShot, EpochSolution
from catseye.estimation.shapes.motions import motions
from catseye.records.site.folder import SiteFolder
from catseye.reduction.site.bodies import bodies_of, lasting_names
from catseye.reduction.site.motion import GROUND, frames_of, ground_from
from catseye.simulator.twin.beam import TracedDish
from catseye.simulator.twin.site import Twin

Array = NDArray[np.float64]
FEWEST_SHOTS = 3
INSTANTS = 32  # of an epoch's shots at which the truth is looked at: vibrations are means over ten seconds
MOST_SHOTS = 50_000  # kept while nothing is solved
BAND = (0.005, 0.995)
FEWEST_POINTS = 3  # of a body


@dataclass(frozen=True, eq=False)
class EpochComparison:
    """One epoch beside the truth; lengths in mm.

    number, ticks   of the epoch
    points          compared
    worst, worst_mm name and length of the largest difference
    rms_mm          of the differences' coordinates
    mean_u_mm       claimed, of a coordinate
    chi2            per coordinate, of all differences with their joint covariance
    band            99 % of epochs lie within, if what is claimed is true
    offset, u_offset, true_offset   (3,) of the beam: azimuth times cos E and elevation, rad; focus, m; NaN: not known
    """

    number: int
    ticks: int
    points: int
    worst: str
    worst_mm: float
    rms_mm: float
    mean_u_mm: float
    chi2: float
    band: tuple[float, float]
    offset: Array
    u_offset: Array
    true_offset: Array

    @property
    def fits(self) -> bool:
        """Whether chi2 is within its band."""
        return self.band[0] <= self.chi2 <= self.band[1]


class TwinComparison:
    """Shots and solutions in the order of the journal; a comparison for each solution.

    reference_after   number of the epoch from which poses count
    """

    def __init__(self, site: SiteFolder, twin: Twin, *, reference_after: int):
        self._site, self._twin, self._reference_after = site, twin, reference_after
        self._frames, self._bodies = frames_of(site), bodies_of(site, frames_of(site))
        self._lasting = frozenset(lasting_names(site))
        self._dish = TracedDish.of(site.site.paraboloid)
        self._middles: dict[int, float] = {}  # s since the twin's start, by number
        self._reference: dict[str, Array] = {}  # true places in the reflector frame, at the reference epoch

    def shot(self, answered: AnsweredShot) -> None:
        """Compare one shot with the truth."""
        shot = answered.shot
        if len(self._middles) >= MOST_SHOTS:
            del self._middles[next(iter(self._middles))]
        self._middles[shot.number] = self._twin.seconds_of_ticks(shot.ticks) + 0.5 * shot.duration

    def epoch(self, solution: EpochSolution) -> EpochComparison | None:
        """The epoch beside the truth; None where nothing was solved, or too little of it can be compared."""
        answer = solution.answer
        middles, numbers = self._middles, [*answer.get("used", ()), *map(int, answer.get("rejected") or ())]
        last = max(numbers, default=0)  # shots that came while it was solved are of the next one
        self._middles = {number: at for number, at in middles.items() if number > last}
        times = np.array(sorted(middles[n] for n in answer.get("used", ()) if n in middles))
        if not len(times) or solution.covariance is None:
            return None
        times = times[np.unique(np.linspace(0, len(times) - 1, INSTANTS).round().astype(int))]
        shots = dict(zip(answer["names"], answer["shots"], strict=True))
        names = [n for n in answer["names"] if n in self._lasting and n in self._frames]
        own, carried = self._truth(names, times, answer)
        chosen = [k for k, n in enumerate(names) if shots[n] >= FEWEST_SHOTS]
        if not chosen:
            return None
        at = [answer["names"].index(names[k]) for k in chosen]
        off = np.array(answer["x"], dtype=float)[at] - carried[chosen]
        rows = np.concatenate([np.arange(3 * k, 3 * k + 3) for k in at])
        covariance = solution.covariance[np.ix_(rows, rows)]
        length = np.linalg.norm(off, axis=1)
        worst = int(np.argmax(length))
        offset, u_offset, true_offset = self._offsets(answer, dict(zip(names, own, strict=True)))
        return EpochComparison(
            answer["number"],
            int(answer["ticks"]),
            len(chosen),
            names[chosen[worst]],
            float(length[worst]) / MILLIMETRE,
            float(np.sqrt(np.mean(off**2))) / MILLIMETRE,
            float(np.mean(np.sqrt(np.diag(covariance)))) / MILLIMETRE,
            _chi2(off.ravel(), covariance) / off.size,
            _band(off.size),
            offset,
            u_offset,
            true_offset,
        )

    def _truth(self, names: list[str], times: Array, answer: Mapping[str, Any]) -> tuple[Array, Array]:
        """Mean true places (n, 3), in each point's own frame and carried to the epoch's instant, ground frame."""
        places = self._twin.points(names, times)
        posture = self._twin.posture(times)
        own = places.mean(axis=0)
        carried = own.copy()
        for frame in sorted({self._frames[n] for n in names} - {GROUND}):
            members = [k for k, n in enumerate(names) if self._frames[n] == frame]
            back = ground_from(self._site, frame, posture.azimuth, posture.elevation).inverse()
            here = np.stack([back.points(places[:, k]) for k in members], axis=1).mean(axis=0)
            then = ground_from(self._site, frame, answer["azimuth"], answer["elevation"]).single
            own[members], carried[members] = here, then.points(here)
        return own, carried

    def _offsets(self, answer: Mapping[str, Any], own: Mapping[str, Array]) -> tuple[Array, Array, Array]:
        """Of the beam since the reference epoch: found, its u, and by the true places."""
        unknown = np.full(3, np.nan)
        riding = {n: x for n, x in own.items() if self._bodies.get(n) in ("dish", "arm")}
        if answer["number"] <= self._reference_after:
            self._reference = riding if answer["number"] == self._reference_after else {}
        pose = answer.get("pose")
        if not pose or pose["missing"]:
            return unknown, unknown, unknown
        u = np.sqrt(np.diag(np.array(pose["covariance"], dtype=float)))
        return np.array(pose["offset"], dtype=float), u, self._true_offset(riding)

    def _true_offset(self, own: Mapping[str, Array]) -> Array:
        """By rays, with the rigid motions of dish and arm that fit the true places, all points alike."""
        moved = {}
        for body, pivot in (("dish", np.zeros(3)), ("arm", self._dish.focus)):
            names = [n for n in own if n in self._reference and self._bodies[n] == body]
            if len(names) < FEWEST_POINTS:
                return np.full(3, np.nan)
            rest = np.array([self._reference[n] for n in names])
            change = np.array([own[n] for n in names]) - rest
            moved[body] = np.linalg.lstsq(motions(rest, pivot, 1.0)[:, :6], change.ravel(), rcond=None)[0]
        return self._dish.offset(moved["dish"], moved["arm"])


def _chi2(off: Array, covariance: Array) -> float:
    """The quadratic form off' C^-1 off."""
    return float(off @ np.linalg.solve(covariance, off))


def _band(size: int) -> tuple[float, float]:
    """Per coordinate, of 99 % of epochs."""
    from scipy.stats import chi2

    low, high = chi2.ppf(BAND, size) / size
    return float(low), float(high)
