"""Groups of every observation kind over random points and parameters."""

import numpy as np
from scipy.spatial.transform import Rotation

from catseye.estimation.observations import kinds

POINTS, OTHERS = 6, 12
N = 3 * POINTS + OTHERS
P = 3 * np.arange(POINTS)


def of_kinds(made, *names):
    """Groups of some kinds, by their class names."""
    found = {type(group).__name__: group for group in made}
    return tuple(found[name] for name in names)


def groups(seed):
    """One group of every kind over six random points and twelve other parameters, and the parameters."""
    rng = np.random.default_rng(seed)
    other = 3 * POINTS + rng.permutation(OTHERS)
    pose = np.concatenate([other[:3], other[3:6]])
    turns = Rotation.random(3, random_state=rng).as_matrix()
    shift = rng.normal(size=(4, 3))
    at, to, third = P[[0, 1, 2, 3]], P[[1, 2, 3, 0]], P[[4, 5, 4, 5]]
    ones, zeros = np.ones(4), np.zeros(4)
    scaled = {
        "scale": 1.0 + 0.1 * rng.normal(size=4),
        "offset": rng.normal(size=4),
        "nuisance": other[[[0, 1], [1, 1], [-1, 2], [0, 2]]],
        "coefficient": rng.normal(size=(4, 2)),
        "scaling": other[[[3], [4], [3], [4]]],
        "scaling_coefficient": rng.normal(size=(4, 1)),
        "shift": shift,
    }
    scaled["nuisance"][2, 0] = -1
    missing = np.array([other[6], -1, other[7], other[6]])
    three = np.zeros(12), np.ones(12)
    made = (
        kinds.Distances("a", zeros, ones, at, to, **scaled),
        kinds.HorizontalDistances("a", zeros, ones, at, to, **scaled),
        kinds.DistanceDifferences("a", zeros, ones, at, to, third, at, **scaled, shift_2=-shift),
        kinds.FixedDistances("a", zeros, ones, at, to, shift),
        kinds.Directions("a", rng.uniform(-9, 9, 4), ones, at, to, other[[6, 6, 7, 7]], shift),
        kinds.Azimuths("a", rng.uniform(-9, 9, 4), ones, at, to, shift),
        kinds.HorizontalAngles("a", rng.uniform(-9, 9, 4), ones, at, to, third, shift, -shift),
        kinds.ZenithAngles("a", ones, ones, at, to, shift, 0.13, missing, True, 50.0),
        kinds.Inclinations("a", zeros, ones, at, to, shift, missing),
        kinds.ObservedTilts("a", zeros, ones, rng.normal(size=(4, 3)), other[:3], turns[0], missing),
        kinds.HeightDifferences("a", zeros, ones, at, to, shift),
        kinds.LevelPlanes("a", zeros, ones, at, missing, 0.5),
        kinds.ObservedCoordinates("a", zeros, ones, at, np.array([0, 2, 1, 1])),
        kinds.Vectors("a", three[0], np.tile(np.eye(3), (4, 1, 1)), at, to, shift),
        kinds.PointsOnPlane("a", zeros, ones, at, rng.normal(size=3), rng.normal(size=3), other[:3]),
        kinds.PointsOnLine("a", np.zeros(8), np.eye(8), at, rng.normal(size=3), rng.normal(size=3), other[4:8]),
        kinds.PointsOnSphere("a", zeros, ones, at, P[[5, 5, 5, 4]], 2.0, missing),
        kinds.RigidBodies("a", np.zeros(9), np.eye(9), P[:3], pose, turns[0]),
        kinds.RigidTriplets(
            "a",
            np.zeros(10),
            np.tile(np.eye(5), (2, 1, 1)),
            P[[0, 3]],
            P[[2, 4]],
            P[[1, 5]],
            np.array([[other[0], other[1]], [other[2], -1]]),
            rng.normal(size=(2, 3)),
            np.array([[other[8], -1, other[9], -1, other[10]], [-1, other[8], -1, other[11], -1]]),
        ),
        kinds.FramePoints("a", np.zeros(9), np.ones(9), P[:3], np.tile(pose, (3, 1)), turns, np.array([9, -1, 12])),
        kinds.Linear("a", zeros, ones, other[:5], rng.normal(size=(4, 5))),
    )
    joint = kinds.Joint.of("a", of_kinds(made, "Distances", "Directions", "Linear"), np.eye(12))
    x = rng.normal(size=N)  # turns of about a radian, tilts of the order of one
    ring = 2.0 * np.pi * rng.permutation(POINTS) / POINTS + rng.uniform()  # so that no two are above each other
    x[: 3 * POINTS] += (20.0 * np.stack([np.sin(ring), np.cos(ring), rng.normal(size=POINTS)], axis=1)).ravel()
    return (*made, joint), x
