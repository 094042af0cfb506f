"""Seven frames of a rigid telescope at one posture, joined into one tree.

ground <- alidade <- elevation <- reflector <- prime_focus <- subreflector
                                            <- feed_arm
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError
from catseye.geometry.antenna.frames import (
    ELEVATION_AXIS_HEIGHT,
    FEED_ARM_FOOT,
    FOCAL_LENGTH,
    REFLECTOR_TO_ELEVATION,
    alidade_from_elevation,
    elevation_from_reflector,
    ground_from_alidade,
    reflector_from_feed_arm,
    reflector_from_prime_focus,
)
from catseye.geometry.antenna.subreflector import prime_focus_from_subreflector
from catseye.geometry.frames.frame import Transform

PARENTS: Final[dict[str, str | None]] = {  # frame -> frame in which it stands
    "ground": None,
    "alidade": "ground",
    "elevation": "alidade",
    "reflector": "elevation",
    "feed_arm": "reflector",
    "prime_focus": "reflector",
    "subreflector": "prime_focus",
}
FRAMES: Final = tuple(PARENTS)
BELOW_ELEVATION: Final = ("ground", "alidade")  # frames that the elevation drive does not turn


@dataclass(frozen=True)
class RigidTelescope:
    """Telescope without bending, on a perfect track, at one posture.

    azimuth                   rad, clockwise from north
    elevation                 rad
    elevation_axis_height     m, of the elevation axis above the alidade's origin
    reflector_to_elevation    (3,) m, the vertex of the parent paraboloid in the elevation frame
    focal_length              m, of the parent paraboloid
    feed_arm_foot             (3,) m, origin of the feed arm's frame, reflector frame
    subreflector_shift        (3,) m, of the subreflector's pivot, prime-focus axes
    subreflector_turn         (3,) rad, about x, then y, then z of the prime-focus frame
    subreflector_pivot        (3,) m, of these turns, prime-focus frame

    >>> RigidTelescope(np.pi / 2, np.pi / 4).between("ground", "prime_focus").points([0.0, 0.0, 0.0]).round(6).tolist()
    [7.184829, 0.0, 132.999039]
    """

    azimuth: float
    elevation: float
    elevation_axis_height: float = ELEVATION_AXIS_HEIGHT
    reflector_to_elevation: tuple[float, float, float] = REFLECTOR_TO_ELEVATION
    focal_length: float = FOCAL_LENGTH
    feed_arm_foot: tuple[float, float, float] = FEED_ARM_FOOT
    subreflector_shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    subreflector_turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    subreflector_pivot: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def in_parent(self, frame: str) -> Transform:
        """Transform of a frame's points into the frame in which it stands.

        Raises ValidityError for an unknown frame, and for the ground, which stands in none.

        Source: [PARKER04] eqs. 2.40 to 2.43; our choices of `geometry.antenna.frames` beyond them.
        """
        joints: dict[str, Callable[[], Transform]] = {
            "alidade": lambda: ground_from_alidade(self.azimuth),
            "elevation": lambda: alidade_from_elevation(
                self.elevation, elevation_axis_height=self.elevation_axis_height
            ),
            "reflector": lambda: elevation_from_reflector(reflector_to_elevation=self.reflector_to_elevation),
            "feed_arm": lambda: reflector_from_feed_arm(foot=self.feed_arm_foot),
            "prime_focus": lambda: reflector_from_prime_focus(focal_length=self.focal_length),
            "subreflector": lambda: (
                prime_focus_from_subreflector(
                    self.subreflector_shift, self.subreflector_turn, pivot=self.subreflector_pivot
                ).single
            ),
        }
        if frame not in joints:
            raise ValidityError(f"frame {frame!r} stands in no other (expected one of {', '.join(joints)})")
        return joints[frame]()

    def ground_from(self, frame: str) -> Transform:
        """Transform of a frame's points into the ground frame.

        Raises ValidityError for an unknown frame.

        Source: [PARKER04] eq. 2.44 for the reflector; the product of `in_parent` for each.
        """
        if frame not in PARENTS:
            raise ValidityError(f"frame {frame!r} is unknown (expected one of {', '.join(FRAMES)})")
        parent = PARENTS[frame]
        if parent is None:
            return Transform("ground", "ground", np.eye(3), np.zeros(3))
        return self.ground_from(parent) @ self.in_parent(frame)

    def between(self, to: str, from_: str) -> Transform:
        """Transform of points of one frame into another.

        Source: `ground_from` of one, and the inverse of the other's.
        """
        return self.ground_from(to).inverse() @ self.ground_from(from_)

    def posture_slopes(self, points: ArrayLike, *, to: str, from_: str) -> NDArray[np.float64]:
        """Derivatives (..., 3, 2), m/rad, of `between` by azimuth and elevation.

        Zero for an axis that turns both frames alike.

        points   (..., 3), m, in the frame `from_`

        Source: [PARKER04] eqs. 2.40 and 2.41 differentiated: azimuth turns about the ground's -z, elevation about the
        alidade's +x through the elevation axis. Exact.

        >>> still = RigidTelescope(0.0, np.pi / 2)
        >>> still.posture_slopes([0.0, 0.0, 60.0], to="ground", from_="reflector").round(6).tolist()
        [[-54.839108, 0.0], [0.0, -64.99999], [0.0, -54.839108]]
        """
        into = self.ground_from(to)
        at = self.ground_from(from_).points(points)
        by_azimuth = (float(from_ != "ground") - float(to != "ground")) * np.cross([0.0, 0.0, -1.0], at)
        across = self.ground_from("alidade").rotation[:, 0]
        arm = at - np.array([0.0, 0.0, self.elevation_axis_height])
        turned = float(from_ not in BELOW_ELEVATION) - float(to not in BELOW_ELEVATION)
        slopes = np.stack([by_azimuth, turned * np.cross(across, arm)], axis=-1)
        return np.asarray(into.rotation.T @ slopes)
