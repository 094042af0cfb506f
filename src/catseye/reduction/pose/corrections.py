"""Corrections to fit, from star offsets or from poses."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from catseye.errors import InputError
from catseye.records.laboratory.star_offsets import StarOffsets, read_star_offsets
from catseye.records.network.written_pose import WrittenPose, read_written_pose
from catseye.verdict import Verdict


@dataclass(frozen=True, eq=False)
class PointingObservations:
    """Corrections of n directions.

    source      "stars" or "metrology"
    name        of the file of stars, or of the first pose
    azimuth, elevation  (n,) rad
    correction  (n, 2) rad, azimuth times cos E and elevation: encoders minus sky
    covariance  (2n, 2n) rad^2 of metrology; None for stars
    where       n places for messages
    stars       of the file, if it is one
    hashes      SHA-256 by name
    sources     verdicts of poses, by their files
    """

    source: str
    name: str
    azimuth: np.ndarray
    elevation: np.ndarray
    correction: np.ndarray
    covariance: np.ndarray | None
    where: tuple[str, ...]
    stars: StarOffsets | None = None
    hashes: dict[str, str] = field(default_factory=dict)
    sources: dict[str, Verdict | None] = field(default_factory=dict)

    @classmethod
    def of_stars(cls, stars: StarOffsets) -> "PointingObservations":
        """Corrections of star offsets."""
        return cls(
            source="stars",
            name=stars.file,
            azimuth=stars.azimuth,
            elevation=stars.elevation,
            correction=stars.correction,
            covariance=None,
            where=tuple(f"{stars.file} line {k}" for k in stars.line),
            stars=stars,
            hashes={stars.file: stars.digest},
        )

    @classmethod
    def of_poses(cls, poses: Sequence[WrittenPose]) -> "PointingObservations":
        """Corrections of poses with a beam, the poses independent of each other.

        Raises InputError for a pose without beam or posture.
        """
        n = len(poses)
        angles, values, q = np.zeros((n, 2)), np.zeros((n, 2)), np.zeros((2 * n, 2 * n))
        for k, pose in enumerate(poses):
            if pose.posture is None or pose.correction is None or pose.correction_covariance is None:
                raise InputError(
                    f"{pose.file}: has no pointing or no posture (expected both: the pose of the dish with its beam)"
                )
            angles[k], values[k] = pose.posture, pose.correction[:2]
            q[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = pose.correction_covariance[:2, :2]
        return cls(
            source="metrology",
            name=poses[0].file,
            azimuth=angles[:, 0],
            elevation=angles[:, 1],
            correction=values,
            covariance=q,
            where=tuple(pose.file for pose in poses),
            hashes={pose.file: pose.digest for pose in poses},
            sources={pose.file: pose.verdict for pose in poses},
        )


def read_pointing_observations(files: Sequence[Path]) -> PointingObservations:
    """Corrections of one TPOINT file, or of several pose.json.

    Raises InputError for a mixture, and for a file that cannot be used.
    """
    poses = [f for f in files if f.suffix == ".json"]
    if not poses:
        if len(files) != 1:
            raise InputError(f"{files[1]}: a second file of stars (expected one TPOINT file, or poses as .json)")
        return PointingObservations.of_stars(read_star_offsets(files[0]))
    if len(poses) != len(files):
        foreign = next(f for f in files if f not in poses)
        raise InputError(f"{foreign}: is not .json like the poses (expected one TPOINT file, or poses only)")
    return PointingObservations.of_poses([read_written_pose(f) for f in files])
