"""Where the beam of a dish and a feed that have moved goes: an independent ray trace of the paraboloid.

Light from the feed falls on the paraboloid near its vertex and is reflected by the law of reflection; which way it goes
in the end is the beam. Nothing of it is taken from the reduction.
"""

import numpy as np
from scipy.spatial.transform import Rotation

F = 60.0  # m
FOCUS = np.array([0.0, 0.0, F])


def aperture(rings=20, spokes=50):
    """Points (n, 2) and weights (n,): a plane fitted to ways over a disc tilts by the mean of their
    slopes weighted with R^2 - r^2 (integrate x p by parts)."""
    nodes, weights = np.polynomial.legendre.leggauss(rings)
    r, angle = 25.0 * (nodes + 1.0), 2.0 * np.pi * (np.arange(spokes) + 0.3) / spokes
    xy = (r[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)).reshape(-1, 2)
    weight = np.repeat(weights * r * (2500.0 - r**2), spokes)
    return xy + np.array([0.0, 54.0]), weight / weight.sum()


XY, WEIGHT = aperture()


def beam(dish_turn, dish_shift, feed):
    """Weighted mean direction, a unit vector in the old reflector frame, of a feed's light by a dish that has moved."""
    back = Rotation.from_rotvec(dish_turn)
    seen = back.inv().apply(feed - dish_shift)  # the feed as the dish sees it
    points = np.column_stack([XY, np.sum(XY**2, axis=1) / (4.0 * F)])
    normals = np.column_stack([-XY, np.full(len(XY), 2.0 * F)])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    ways = points - seen
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    out = ways - 2.0 * np.sum(ways * normals, axis=1)[:, None] * normals
    mean = back.apply(WEIGHT @ out)
    return mean / np.linalg.norm(mean)
