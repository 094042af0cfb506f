"""Counts of one mirror for points, and obstacles to its beams."""

from dataclasses import dataclass, field

import numpy as np

from catseye.geometry.antenna.rigid_telescope import RigidTelescope
from catseye.records.site.keep_out import KeepOut
from catseye.records.site.solids import Solids
from catseye.reduction.site.stations import Pointings, pointings_of
from catseye.reduction.steering.mounted import MountedRanger
from catseye.reduction.steering.sighting import Sighting, place_of_ranger, seen_from, sightings
from catseye.reduction.steering.visibility import Visibility
from catseye.verdict import Verdict, worst

USUAL_KIND = "prism"  # of a retroreflector where only its axis or the solids are known


@dataclass(frozen=True, eq=False)
class BeamSurroundings:
    """Time, place and things that a beam may meet.

    mjd         UTC, of the Sun; None: the Sun is not checked
    longitude_deg, latitude_deg   of the site; None: those of the monument's record
    keep_out    boxes, and the cone kept from the Sun
    kind        of the retroreflectors at the points; None with facing and solids None: visibility is not judged
    facing      (3,) outward axis of the retroreflectors, ground; None: incidence is not judged
    solids      possible obstructions; None: none
    posture     azimuth, elevation, rad, of the telescope if it carries some of the solids
    """

    mjd: float | None = None
    longitude_deg: float | None = None
    latitude_deg: float | None = None
    keep_out: KeepOut = field(default_factory=KeepOut)
    kind: str | None = None
    facing: np.ndarray | None = None
    solids: Solids | None = None
    posture: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class AimedPoints:
    """Counts of one mirror for n points.

    pointings    counts, stops and uncertainties
    sightings    Sun and keep-out boxes, one a point; none where not checked
    visibility   of the points' retroreflectors; None where not checked
    """

    pointings: Pointings
    sightings: list[Sighting] = field(default_factory=list)
    visibility: Visibility | None = None

    def verdict_of(self, point: int) -> Verdict:
        """Verdict on one point: mirror position allowed and target visible."""
        pointings = self.pointings
        if not (pointings.allowed[point] or pointings.prime_allowed[point]):
            return Verdict("failed", "beyond the mirror's stops in both pointings")
        if self.sightings:
            answers = (self.sightings[point].sun, self.sightings[point].keep_out)
            refused = [answer for answer in answers if answer is not None and not answer.allowed]
            if refused:
                return Verdict("failed", refused[0].reason.rstrip("."))
        if self.visibility is not None and not self.visibility.seen[0, point]:
            return Verdict("failed", self.visibility.reason(0, point).rstrip("."))
        if unusual := pointings.unusual(point):
            return Verdict("doubtful", unusual)
        which = "direct" if pointings.allowed[point] else "prime"
        unknown = "; u of the counts is unknown: the records lack its inputs" if pointings.lacking else ""
        return Verdict("good", f"allowed in the {which} pointing{unknown}")

    @property
    def verdict(self) -> Verdict:
        """Worst verdict of all points, with its place if there are several."""
        verdicts = [self.verdict_of(k) for k in range(len(self.pointings.to))]
        verdict = worst(verdicts)
        if len(verdicts) < 2 or verdict.word == "good":
            return verdict
        place = ", ".join(f"{v:g}" for v in self.pointings.to[verdicts.index(verdict)])
        bad = sum(v.word == verdict.word for v in verdicts)
        return Verdict(verdict.word, f"{bad} of {len(verdicts)} points, first ({place}): {verdict.why}")


def aim_ranger(
    ranger: MountedRanger, to: np.ndarray, surroundings: BeamSurroundings, telescope: RigidTelescope | None = None
) -> AimedPoints:
    """Aim a ranger's mirror at points (n, 3), m, ground.

    surroundings   time, place and things that the beams may meet
    telescope      at its posture, for a ranger of the feed arm

    Raises InputError for a point that no setting reaches, a place of the site that is unknown, and for a solid on the
    telescope without its posture. Source: [PARKER04] sections 2 and 2.6.1.
    """
    station, scene, mirror = ranger.station(telescope), surroundings, ranger.mirror
    pointings = pointings_of(
        station, mirror, to, name=ranger.name, spread=lambda at: ranger.counts_covariance(station, at)
    )
    checked: list[Sighting] = []
    if scene.mjd is not None or scene.keep_out.box:
        place = None if scene.mjd is None else place_of_ranger(ranger, scene.longitude_deg, scene.latitude_deg)
        checked = sightings(
            station,
            mirror,
            pointings.counts,
            name=ranger.name,
            mjd=scene.mjd,
            place=place,
            keep_out=scene.keep_out,
        )
    visibility = None
    if scene.kind is not None or scene.facing is not None or scene.solids is not None:
        visibility = seen_from(
            station,
            ranger.name,
            to,
            kind=scene.kind or USUAL_KIND,
            facing=scene.facing,
            solids=scene.solids or Solids(),
            posture=scene.posture,
            reachable=pointings.allowed | pointings.prime_allowed,
        )
    return AimedPoints(pointings, checked, visibility)
