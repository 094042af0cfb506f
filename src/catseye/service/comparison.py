"""Compare epochs with the twin's truth: errors, claims, consistency.

The truth of a point in an epoch is the mean of its true positions over the epoch's shots, each predicted for the
epoch's instant in the point's body frame, like an epoch's answer. Tracked points with three shots are compared.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.constants import MILLIMETRE
from catseye.coordinator.journal.entries import AnsweredShot, EpochSolution
from catseye.estimation.shapes.motions import motions
from catseye.geometry.frames.frame import Transforms
from catseye.records.site.folder import SiteFolder
from catseye.reduction.site.bodies import bodies_of, tracked_names
from catseye.reduction.site.motion import GROUND, bent_ground_from, frames_of
from catseye.reduction.structure.site_bending import bending_of
from catseye.simulator.twin.beam import TracedDish
from catseye.simulator.twin.site import Twin

FEWEST_SHOTS = 3
INSTANTS = 32  # of an epoch's shots at which the truth is sampled: vibrations average over ten seconds
MOST_SHOTS = 50_000  # remembered while nothing is solved
BAND = (0.005, 0.995)
FEWEST_POINTS = 3  # of a body


@dataclass(frozen=True, eq=False)
class EpochComparison:
    """One epoch beside the truth; lengths in mm.

    number, ticks   of the epoch
    points          number compared
    worst, worst_mm name and length of the largest difference
    rms_mm          of the differences' coordinates
    mean_u_mm       claimed, of a coordinate
    chi2            per coordinate, of all differences with their joint covariance
    band            99 % of epochs lie within, if the claims are right
    offset, u_offset, true_offset   (3,) of the beam: azimuth times cos E and elevation, rad; focus, m; NaN if unknown
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
        """True if chi2 is within its band."""
        return self.band[0] <= self.chi2 <= self.band[1]


class TwinComparison:
    """Compare shots and solutions in the journal's order.

    reference_after   number of the reference epoch of poses
    """

    def __init__(self, site: SiteFolder, twin: Twin, *, reference_after: int):
        self._site, self._twin, self._reference_after = site, twin, reference_after
        self._frames, self._bodies = frames_of(site), bodies_of(site, frames_of(site))
        self._bending = bending_of(site)
        self._lasting = frozenset(tracked_names(site))
        self._dish = TracedDish.of(site.site.paraboloid)
        self._middles: dict[int, float] = {}  # s since the twin's start, by number
        self._reference: dict[str, Array] = {}  # true positions in the reflector frame, at the reference epoch

    def shot(self, answered: AnsweredShot) -> None:
        """Store the time of one shot."""
        shot = answered.shot
        if len(self._middles) >= MOST_SHOTS:
            del self._middles[next(iter(self._middles))]
        self._middles[shot.number] = self._twin.seconds_of_ticks(shot.ticks) + 0.5 * shot.duration

    def epoch(self, solution: EpochSolution) -> EpochComparison | None:
        """The epoch beside the truth; None if too little can be compared."""
        answer = solution.answer
        middles, numbers = self._middles, [*answer.get("used", ()), *map(int, answer.get("rejected") or ())]
        last = max(numbers, default=0)  # shots received during the solution belong to the next epoch
        self._middles = {number: at for number, at in middles.items() if number > last}
        times = np.array(sorted(middles[n] for n in answer.get("used", ()) if n in middles))
        if not len(times) or solution.covariance is None:
            return None
        times = times[np.unique(np.linspace(0, len(times) - 1, INSTANTS).round().astype(int))]
        shots = dict(zip(answer["names"], answer["shots"], strict=True))
        names = [n for n in answer["names"] if n in self._lasting and n in self._frames]
        body_places, ground_places = self._truth(names, times, answer)
        chosen = [k for k, n in enumerate(names) if shots[n] >= FEWEST_SHOTS]
        if not chosen:
            return None
        at = [answer["names"].index(names[k]) for k in chosen]
        off = np.array(answer["x"], dtype=float)[at] - ground_places[chosen]
        rows = np.concatenate([np.arange(3 * k, 3 * k + 3) for k in at])
        covariance = solution.covariance[np.ix_(rows, rows)]
        length = np.linalg.norm(off, axis=1)
        worst = int(np.argmax(length))
        offset, u_offset, true_offset = self._offsets(answer, dict(zip(names, body_places, strict=True)))
        return EpochComparison(
            number=answer["number"],
            ticks=int(answer["ticks"]),
            points=len(chosen),
            worst=names[chosen[worst]],
            worst_mm=float(length[worst]) / MILLIMETRE,
            rms_mm=float(np.sqrt(np.mean(off**2))) / MILLIMETRE,
            mean_u_mm=float(np.mean(np.sqrt(np.diag(covariance)))) / MILLIMETRE,
            chi2=_chi2(off.ravel(), covariance) / off.size,
            band=_band(off.size),
            offset=offset,
            u_offset=u_offset,
            true_offset=true_offset,
        )

    def _truth(self, names: list[str], times: Array, answer: Mapping[str, Any]) -> tuple[Array, Array]:
        """Mean true positions (n, 3) in body frames, and in the ground frame.

        The latter predicted for the epoch's instant.
        """
        places = self._twin.points(names, times)
        posture = self._twin.posture(times)
        body_places = places.mean(axis=0)
        ground_places = body_places.copy()
        moving = {n: self._body(n) for n in names if self._frames[n] != GROUND}
        for body in sorted({*moving.values()}):
            members = [k for k, n in enumerate(names) if moving.get(n) == body]
            frame = self._frames[names[members[0]]]
            back = self._ground_from(frame, body, posture.azimuth, posture.elevation).inverse()
            means = np.stack([back.points(places[:, k]) for k in members], axis=1).mean(axis=0)
            at_epoch = self._ground_from(frame, body, answer["azimuth"], answer["elevation"]).single
            body_places[members], ground_places[members] = means, at_epoch.points(means)
        return body_places, ground_places

    def _body(self, name: str) -> str:
        """Name shared by points that move as one."""
        return self._frames[name] if self._bending is None else self._bending.body(name)

    def _ground_from(self, frame: str, body: str, azimuth: ArrayLike, elevation: ArrayLike) -> Transforms:
        return bent_ground_from(self._site, frame, body, azimuth, elevation, self._bending)

    def _offsets(self, answer: Mapping[str, Any], body_places: Mapping[str, Array]) -> tuple[Array, Array, Array]:
        """Beam offset since the reference epoch: estimate, u, truth."""
        unknown = np.full(3, np.nan)
        points = {n: x for n, x in body_places.items() if self._bodies.get(n) in ("dish", "arm")}
        if answer["number"] <= self._reference_after:
            self._reference = points if answer["number"] == self._reference_after else {}
        pose = answer.get("pose")
        if not pose or pose["missing"]:
            return unknown, unknown, unknown
        u = np.sqrt(np.diag(np.array(pose["covariance"], dtype=float)))
        return np.array(pose["offset"], dtype=float), u, self._true_offset(points)

    def _true_offset(self, body_places: Mapping[str, Array]) -> Array:
        """True beam offset by ray tracing, from rigid motions of true positions."""
        moved = {}
        for body, pivot in (("dish", np.zeros(3)), ("arm", self._dish.focus)):
            names = [n for n in body_places if n in self._reference and self._bodies[n] == body]
            if len(names) < FEWEST_POINTS:
                return np.full(3, np.nan)
            reference = np.array([self._reference[n] for n in names])
            change = np.array([body_places[n] for n in names]) - reference
            moved[body] = np.linalg.lstsq(motions(reference, pivot, 1.0)[:, :6], change.ravel(), rcond=None)[0]
        return self._dish.offset(moved["dish"], moved["arm"])


def _chi2(off: Array, covariance: Array) -> float:
    """The quadratic form off' C^-1 off."""
    return float(off @ np.linalg.solve(covariance, off))


def _band(size: int) -> tuple[float, float]:
    """Band per coordinate that holds 99 % of epochs."""
    from scipy.special import gammaincinv  # scipy.stats takes a third of a second to load, in the loop

    low, high = 2.0 * gammaincinv(0.5 * size, BAND) / size
    return float(low), float(high)
