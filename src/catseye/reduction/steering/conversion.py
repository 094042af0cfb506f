"""Points of one frame of a telescope in another, with their covariance."""

from dataclasses import dataclass

import numpy as np

from catseye.geometry.antenna.rigid_telescope import BELOW_ELEVATION, RigidTelescope
from catseye.geometry.frames.frame import Transform
from catseye.verdict import Verdict

UNUSUAL = 1e3  # m from the new origin, ten times the largest dish: more likely typed in millimetres


@dataclass(frozen=True, eq=False)
class ConvertedPoints:
    """Points of one frame in another.

    names        n
    before       (n, 3) m, in the frame `transform.from_`
    after        (n, 3) m, in the frame `transform.to`
    covariance   (n, 3, 3) m^2, axes of `transform.to`: points and posture; None: not known
    transform    the rigid transform
    telescope    at its posture
    posture_known   False: the posture was not stated, and the answer does not depend on it
    """

    names: tuple[str, ...]
    before: np.ndarray
    after: np.ndarray
    covariance: np.ndarray | None
    transform: Transform
    telescope: RigidTelescope
    posture_known: bool

    @property
    def bends(self) -> bool:
        """True where gravity, temperature or track move one frame against the other."""
        return self.transform.to != self.transform.from_

    @property
    def verdict(self) -> Verdict:
        """Verdict by the points' distances from the new origin."""
        distance = np.linalg.norm(self.after, axis=1)
        far = np.flatnonzero(distance > UNUSUAL)
        if len(far):
            name, metres = self.names[far[0]], distance[far[0]]
            text = f"point {name} is {metres:.0f} m from the origin of the frame {self.transform.to}"
            return Verdict("doubtful", f"{text}; in millimetres it would be {1e-3 * metres:.3g} m")
        return Verdict("good", "exact for a rigid telescope" if self.bends else "both frames are the same")


def depends_on_posture(to: str, from_: str) -> bool:
    """True where the transform between two frames depends on azimuth or elevation.

    >>> depends_on_posture("ground", "alidade"), depends_on_posture("reflector", "prime_focus")
    (True, False)
    """
    return (to == "ground") != (from_ == "ground") or (to in BELOW_ELEVATION) != (from_ in BELOW_ELEVATION)


def converted(
    points: np.ndarray,
    telescope: RigidTelescope,
    *,
    to: str,
    from_: str,
    names: tuple[str, ...] = (),
    covariance: np.ndarray | None = None,
    u_posture: tuple[float, float] = (0.0, 0.0),
    posture_known: bool = True,
) -> ConvertedPoints:
    """Convert points (n, 3), m, from one frame of a telescope into another.

    telescope    at its posture
    to, from_    frames
    names        n; 1, 2, ... without
    covariance   (n, 3, 3) m^2, axes of `from_`; None: not known, and nor is the result's
    u_posture    rad, standard uncertainty of azimuth and elevation, independent
    posture_known   False: not stated

    Raises ValidityError for an unknown frame.

    Source: [PARKER04] eqs. 2.40 to 2.44; [JCGM102] eq. 3, exact in the points and first order in the posture.
    """
    transform = telescope.between(to, from_)
    spread = None
    if covariance is not None:
        slopes = telescope.posture_slopes(points, to=to, from_=from_)
        by_posture = (slopes * np.square(u_posture)) @ np.swapaxes(slopes, -1, -2)
        spread = transform.rotation @ covariance @ transform.rotation.T + by_posture
    return ConvertedPoints(
        names=names or tuple(str(k + 1) for k in range(len(points))),
        before=points,
        after=transform.points(points),
        covariance=spread,
        transform=transform,
        telescope=telescope,
        posture_known=posture_known,
    )
