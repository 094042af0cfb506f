"""Beam of the prime focus as a structural model bends dish and feed arm: offset in azimuth and elevation, focus.

The same first order as `reduction.pose.pointing_offsets`, whose poses are measured; here they are the model's. A small
turn w of the dish moves the beam by w x z; a feed moved against the dish tilts its wavefront.
"""

from dataclasses import dataclass

import numpy as np

from catseye.errors import InputError
from catseye.geometry.antenna.beam_deviation import ApertureNodes, prime_focus_tilt
from catseye.geometry.antenna.deformation import TelescopePosture
from catseye.geometry.frames.rotation import skew, to_vector
from catseye.reduction.structure.antenna import Antenna

FEED = ("prime_focus", "feed_arm")  # frames that may carry the feed, the first of the model's counts


@dataclass(frozen=True, eq=False)
class BeamOffset:
    """Beam by a model in p postures, against the rigid telescope.

    offset       (p, 3): azimuth times cos E and elevation of the beam, rad; feed farther from the dish along it, m
    covariance   (p, 3, 3)
    turn         (p, 3) rad, of the dish, reflector axes
    feed         (p, 3) m, of the feed against the dish, reflector axes
    """

    offset: np.ndarray
    covariance: np.ndarray
    turn: np.ndarray
    feed: np.ndarray

    @property
    def correction(self) -> np.ndarray:
        """Correction (p, 2) rad that the encoders need: the offset's opposite."""
        return -self.offset[:, :2]


def model_beam(antenna: Antenna, of: ApertureNodes, posture: TelescopePosture) -> BeamOffset:
    """Beam by a structural model, for a feed at the prime focus.

    antenna   the model, with a frame prime_focus or feed_arm
    of        paraboloid and aperture, reflector frame
    posture   (p,) of the telescope

    Raises InputError for a model without a frame for the feed, ValidityError outside its range.

    Source: [RUZE65] for the beam deviation, [PARKER04] section 2.6 for the order of the frames.
    """
    frame = next((name for name in FEED if name in antenna.parents), None)
    if frame is None:
        raise InputError(f"the structural model has no frame {' or '.join(FEED)}, which carries the feed")
    a, e, t = np.broadcast_arrays(*np.atleast_1d(posture.azimuth, posture.elevation, posture.temperature_c))
    tilt = prime_focus_tilt(of)
    by_feed = np.vstack([tilt[0], -tilt[1], [0.0, 0.0, 1.0]])
    by_turn = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    offset, covariance = np.zeros((len(a), 3)), np.zeros((len(a), 3, 3))
    turns, feeds = np.zeros((len(a), 3)), np.zeros((len(a), 3))
    for k in range(len(a)):
        at = TelescopePosture(a[k], e[k], t[k])
        rigid = antenna.ground_from("reflector", at, deformed=False)
        dish = rigid.inverse() @ antenna.ground_from("reflector", at)
        focus_in_arm = antenna.ground_from(frame, at, deformed=False).inverse().points(rigid.points(of.focus))
        observed = dish.inverse() @ rigid.inverse() @ antenna.ground_from(frame, at)
        turns[k] = to_vector(dish.rotation)
        feeds[k] = observed.points(focus_in_arm) - of.focus
        offset[k] = by_turn @ turns[k] + by_feed @ feeds[k]
        inward = rigid.rotation.T
        by_focus = antenna.derivatives(frame, focus_in_arm, at)
        by_vertex = antenna.derivatives("reflector", np.zeros(3), at)
        by_dish = antenna.turns("reflector", at)
        for name, slope in by_focus.items():
            if name not in antenna.motions:
                continue
            turned = inward @ by_dish[name] if name in by_dish else np.zeros((3, 6))
            vertex = inward @ by_vertex[name] if name in by_vertex else np.zeros((3, 6))
            relative = inward @ slope - vertex + skew(of.focus) @ turned  # d - v - w x F
            jacobian = by_turn @ turned + by_feed @ relative
            covariance[k] += jacobian @ antenna.motions[name].six_covariance(at) @ jacobian.T
    return BeamOffset(offset, covariance, turns, feeds)
