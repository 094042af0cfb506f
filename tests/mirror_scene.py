"""Rays traced at a rigid mirror that is turned on its two shafts: what tests hold the mirror's formulas against.

The mirror is a body with a face, carried by an elevation shaft, carried by an azimuth shaft; rays are reflected at
planes. Offsets are (axis, face, beam x, beam y) in metres; nothing of catseye is used.
"""

import numpy as np
from scipy.optimize import root
from scipy.spatial.transform import Rotation

START = 0.4  # m, plane across the incoming beam where ways begin and end


def mirror(mount_azimuth, shaft, axis, face):
    """A point of the face and its normal, the elevation shaft turned by `shaft` from where the face looks along z."""
    turned = Rotation.from_euler("z", mount_azimuth)
    on_shaft = Rotation.from_euler("y", shaft)  # +z towards +x
    normal = turned.apply(on_shaft.apply([0.0, 0.0, 1.0]))
    return turned.apply([axis, 0.0, 0.0]) + face * normal, normal


def reflected(point, direction, on_plane, normal):
    """Where a ray meets a plane, its direction afterwards, and the way to there."""
    way = (on_plane - point) @ normal / (direction @ normal)
    return point + way * direction, direction - 2.0 * (direction @ normal) * normal, way


def sent(mount_azimuth, shaft, offsets, aside=(0.0, 0.0)):
    """The beam's middle (or a ray aside of it) after the mirror: point, direction, way from the start plane."""
    axis, face, beam_x, beam_y = offsets
    point = np.array([beam_x + aside[0], beam_y + aside[1], START])
    return reflected(point, np.array([0.0, 0.0, -1.0]), *mirror(mount_azimuth, shaft, axis, face))


def steered(target, offsets, prime):
    """Mount azimuth and shaft at which the beam's middle meets the target, searched for by a general solver."""
    r = np.linalg.norm(target)
    theta, phi = np.arctan2(target[1], target[0]), np.arccos(target[2] / r)
    start = (theta + np.pi, -phi / 2) if prime else (theta, phi / 2)
    aside = np.linalg.svd(target[None] / r)[2][1:]

    def miss(angles):
        point, direction, _ = sent(*angles, offsets)
        return aside @ (point + direction * ((target - point) @ direction) - target) / r

    found = root(miss, start, tol=1e-15)
    assert np.abs(miss(found.x)).max() < 1e-13
    return found.x


def traced_change(target, offsets, prime):
    """Way to the target along the beam's middle, less that without offsets."""
    angles = steered(target, offsets, prime)
    point, direction, way = sent(*angles, offsets)
    return way + (target - point) @ direction - START - np.linalg.norm(target), angles
