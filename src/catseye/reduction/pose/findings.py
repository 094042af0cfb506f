"""Poses with their beam and verdict: the recipe behind `catseye pose`."""

from dataclasses import dataclass

import numpy as np

from catseye.errors import InputError
from catseye.estimation.shapes.pose import RIGID
from catseye.estimation.shapes.rigid_body import CONVERGED
from catseye.records.network.solved_points import SolvedPoints
from catseye.records.site.folder import SiteFolder
from catseye.reduction.pose.pointing_offsets import PointingOffset, cross_covariance, pointing_offset
from catseye.reduction.pose.pose import GroupPose, at_posture, pose_of_group
from catseye.reduction.pose.track_profile import pose_with_tilt
from catseye.verdict import Verdict

CARRIED = {"prime": "feed-arm", "gregorian": "subreflector"}  # optics -> group that moves the beam beside the dish


@dataclass(frozen=True, eq=False)
class PoseFindings:
    """Pose of a group, and the beam on request."""

    pose: GroupPose
    beam: PointingOffset | None = None

    @property
    def rigid(self) -> bool:
        """True unless its test rejects the group as one body."""
        pose = self.pose.pose
        return not (pose.motion.degrees_of_freedom and pose.p < RIGID)

    @property
    def sound(self) -> bool:
        """True for a converged fit of a rigid group."""
        return self.pose.pose.motion.converged and self.rigid

    @property
    def status(self) -> str:
        """Status "converged", or the evidence against the pose."""
        pose = self.pose.pose
        suspicion = self.pose.suspicion and f"; {self.pose.suspicion}"
        if not pose.motion.converged:
            return f"{pose.motion.status}{suspicion}"
        if not self.rigid:
            what = "the pose, and the beam that follows from it," if self.beam is not None else "the pose"
            return (
                f"the group does not move as one (p {pose.p:.2g}): {what} is a mean of its points' motions; "
                f"see residuals{suspicion}"
            )
        return CONVERGED

    @property
    def verdict(self) -> Verdict:
        """Verdict on the pose.

        Rigidity of the group, its place against the posture, and the verdicts of both epochs.
        """
        epochs = [epoch for epoch in (self.pose.epoch, self.pose.earlier) if epoch is not None]
        return self._own_verdict().resting_on({epoch.campaign or epoch.file: epoch.verdict for epoch in epochs})

    def _own_verdict(self) -> Verdict:
        pose = self.pose.pose
        if not self.sound:
            return Verdict("doubtful", self.status)
        if not pose.motion.degrees_of_freedom:
            return Verdict("doubtful", "as many coordinates as unknowns: nothing checks that the group moved as one")
        if self.pose.suspicion:
            return Verdict("doubtful", self.pose.suspicion)
        if self.pose.posture is not None and self.pose.posture.doubt:
            return Verdict("doubtful", self.pose.posture.doubt)
        removed = f", {len(pose.left_out)} left out" if pose.left_out else ""
        return Verdict("good", f"{len(pose.names)} points move as one{removed} (p {pose.p:.2g})")


@dataclass(frozen=True, eq=False)
class PoseSettings:
    """Part, axes and weights of a pose; each as `pose_of_group`."""

    group: str | None = None
    points: tuple[str, ...] | None = None
    frame: str = "ground"
    pivot: np.ndarray | None = None
    robust: str | None = None

    def pose(self, later: SolvedPoints, earlier: SolvedPoints | None, site: SiteFolder) -> GroupPose:
        """Pose between two epochs, at the later one's posture."""
        return pose_of_group(
            later,
            earlier,
            site,
            group=self.group,
            points=self.points,
            frame=self.frame,
            pivot=self.pivot,
            robust=self.robust,
        )


def find_pose(
    later: SolvedPoints,
    earlier: SolvedPoints | None,
    site: SiteFolder,
    *,
    settings: PoseSettings,
    optics: str | None = None,
    tilt: tuple[float, float, float] | None = None,
) -> PoseFindings:
    """Find the pose of a group.

    Joined with an inclinometer, or with its beam.

    later, earlier   epochs; None: against the site's design
    site       records, in any posture
    settings   part, axes and weights
    optics     "prime" or "gregorian": the beam, too; of the dish in the reflector frame
    tilt       x, y and their u, rad, of an inclinometer on the alidade; of the alidade in its frame

    Raises InputError where a posture or points are missing, EstimationError as `pose_of_group`.
    """
    if later.posture is None:
        raise InputError(f"{later.file}: its posture is unknown (expected pose.json beside it, or posture_deg)")
    azimuth, elevation = later.posture
    there = at_posture(site, azimuth, elevation)
    pose = settings.pose(later, earlier, there)
    if tilt is not None:
        return PoseFindings(pose_with_tilt(pose, np.array(tilt[:2]), tilt[2]))
    if optics is None:
        return PoseFindings(pose)
    carried = pose_of_group(later, earlier, there, group=CARRIED[optics], frame="reflector", robust=settings.robust)
    cross = cross_covariance(carried, pose, there, earlier=earlier)
    return PoseFindings(pose, pointing_offset(pose.pose, carried.pose, there, cross=cross, optics=optics))
