"""Position of a subreflector and the lengths of its actuators, each from the other, or from a measured pose."""

from dataclasses import dataclass

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.errors import EstimationError, InputError
from catseye.geometry.antenna.actuators import actuator_lengths, position_at_lengths
from catseye.geometry.antenna.frames import reflector_from_prime_focus
from catseye.geometry.antenna.subreflector import position_of
from catseye.geometry.frames.frame import Transform
from catseye.geometry.frames.rotation import from_vector
from catseye.records.site.subreflector import SubreflectorMount
from catseye.verdict import Verdict

SINGULAR = 1e-6  # least singular value over the largest, angles times a metre
STEP = 1e-6  # m and rad, of derivatives of a measured pose
COMMANDED, LENGTHS, POSE = "commanded", "lengths", "pose"


@dataclass(frozen=True, eq=False)
class SubreflectorState:
    """Six degrees of freedom of a subreflector and the lengths of its actuators.

    mount         its record
    source        "commanded": the position was stated; "lengths": the lengths; "pose": it was measured
    six           (6,) shift of the pivot, m, and angles about x, then y, then z, rad; prime-focus axes, from rest
    covariance    (6, 6) of it
    lengths       (6,) m
    lengths_covariance   (6, 6) m^2
    rest          (6,) m, lengths at rest
    slopes        (6, 6) derivatives of the lengths by six
    """

    mount: SubreflectorMount
    source: str
    six: np.ndarray
    covariance: np.ndarray
    lengths: np.ndarray
    lengths_covariance: np.ndarray
    rest: np.ndarray
    slopes: np.ndarray

    @property
    def names(self) -> tuple[str, ...]:
        """Names (6,) of the six actuators, in the order of the record."""
        return tuple(actuator.name for actuator in self.mount.actuator)

    @property
    def limits(self) -> np.ndarray:
        """Least and most length (6, 2), m, of each actuator."""
        return np.array([(actuator.least_mm, actuator.most_mm) for actuator in self.mount.actuator]) * MILLIMETRE

    @property
    def beyond(self) -> np.ndarray:
        """True (6,) for an actuator whose length is beyond its limits."""
        return np.asarray((self.lengths < self.limits[:, 0]) | (self.lengths > self.limits[:, 1]))

    @property
    def verdict(self) -> Verdict:
        """Verdict by the limits of the actuators."""
        if not self.beyond.any():
            return Verdict("good", "every actuator is within its limits")
        k = int(np.flatnonzero(self.beyond)[0])
        low, high = self.limits[k] / MILLIMETRE
        text = f"actuator {self.names[k]} is {self.lengths[k] / MILLIMETRE:.3f} mm long, beyond {low:g} to {high:g} mm"
        return Verdict("failed" if self.source == COMMANDED else "doubtful", text)


def state_of_position(mount: SubreflectorMount, shift: np.ndarray, angles: np.ndarray) -> SubreflectorState:
    """State at a wanted position: shift (3,) m, angles (3,) rad.

    The covariance is that of the position which the actuators attain by the uncertainty of their lengths.

    Raises EstimationError where the six lengths do not determine the position.

    Source: `geometry.antenna.actuators`; [JCGM102] eq. 3, first order.
    """
    slopes = actuator_lengths(shift, angles, **mount.joints)[1]
    spread = np.diag([(actuator.u_length_mm * MILLIMETRE) ** 2 for actuator in mount.actuator])
    inverse = _inverse(slopes)
    return _state(mount, COMMANDED, np.concatenate([shift, angles]), inverse @ spread @ inverse.T, spread)


def state_of_lengths(mount: SubreflectorMount, lengths: np.ndarray) -> SubreflectorState:
    """State at the lengths (6,) m of the actuators, with covariance by their uncertainty.

    Raises EstimationError where no position near rest has these lengths, or where they do not determine it.

    Source: `geometry.antenna.actuators`; [JCGM102] eq. 3, first order.
    """
    at = position_at_lengths(lengths, **mount.joints)
    if not np.isfinite(at.shift).all():
        text = ", ".join(f"{v / MILLIMETRE:g}" for v in lengths)
        raise EstimationError(f"no position reached from rest has the lengths {text} mm: check them, and the joints")
    state = state_of_position(mount, at.shift, at.angles)
    return _state(mount, LENGTHS, state.six, state.covariance, state.lengths_covariance)


def state_of_pose(
    mount: SubreflectorMount,
    *,
    frame: str,
    pivot: np.ndarray,
    translation: np.ndarray,
    rotation: np.ndarray,
    covariance: np.ndarray,
) -> SubreflectorState:
    """State at a measured pose of the subreflector, second = pivot + translation + rotation (first - pivot).

    frame         of the pose: "reflector"
    pivot         (3,) m, of the pose
    translation   (3,) m
    rotation      (3,) rad, rotation vector
    covariance    (6, 6) of translation and rotation

    Raises InputError for another frame, EstimationError where the six lengths do not determine the position.

    Source: `geometry.antenna.subreflector`, `geometry.antenna.actuators`; [JCGM102] eq. 3 by central differences.
    """
    if frame != "reflector":
        raise InputError(
            f"frame {frame!r} of the pose is not the reflector's (expected that of catseye pose EPOCH --site SITE "
            "--group subreflector --frame reflector)"
        )
    focus = reflector_from_prime_focus(focal_length=mount.focal_length_mm * MILLIMETRE).translation

    def six_of(pose: np.ndarray) -> np.ndarray:
        turn, about = from_vector(pose[3:]), np.asarray(pivot) - focus
        moved = Transform("prime_focus", "subreflector", turn, about + pose[:3] - turn @ about)
        return np.concatenate(position_of(moved, pivot=mount.joints["pivot"]))

    pose = np.concatenate([translation, rotation])
    by_pose = np.column_stack([six_of(pose + step) - six_of(pose - step) for step in STEP * np.eye(6)]) / (2.0 * STEP)
    six, spread = six_of(pose), by_pose @ covariance @ by_pose.T
    _, slopes = actuator_lengths(six[:3], six[3:], **mount.joints)
    _inverse(slopes)
    return _state(mount, POSE, six, spread, slopes @ spread @ slopes.T)


def _state(
    mount: SubreflectorMount, source: str, six: np.ndarray, covariance: np.ndarray, of_lengths: np.ndarray
) -> SubreflectorState:
    lengths, slopes = actuator_lengths(six[:3], six[3:], **mount.joints)
    rest, _ = actuator_lengths(np.zeros(3), np.zeros(3), **mount.joints)
    return SubreflectorState(
        mount=mount,
        source=source,
        six=six,
        covariance=covariance,
        lengths=lengths,
        lengths_covariance=of_lengths,
        rest=rest,
        slopes=slopes,
    )


def _inverse(slopes: np.ndarray) -> np.ndarray:
    """Derivatives (6, 6) of the position by the lengths; EstimationError where these do not determine it."""
    sizes = np.linalg.svd(slopes, compute_uv=False)
    if sizes[-1] < SINGULAR * sizes[0]:
        raise EstimationError(
            f"the six lengths do not determine the position: singular values {sizes[-1]:.2g} to {sizes[0]:.2g} of "
            "their derivatives (expected joints that are not all parallel or through one line)"
        )
    return np.asarray(np.linalg.inv(slopes))
