"""Poses of rigid bodies and frames of a network, from placed points."""

from collections.abc import Iterator

import numpy as np

from catseye.estimation.network.approximate.sightings import parts_of
from catseye.estimation.network.model import ObservationNetwork
from catseye.estimation.observations.kind import value
from catseye.estimation.observations.kinds import FramePoints, RigidBodies
from catseye.estimation.shapes.rigid_body import closed_form
from catseye.geometry.frames.rotation import to_vector


def bodies_of(
    network: ObservationNetwork, values: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """Points (k,), body coordinates (k, 3), pose columns (6,) and R0 of each body or frame."""
    state = np.concatenate([np.zeros(3 * len(network.points.names)), values])
    for group, _ in parts_of(network):
        if not isinstance(group, RigidBodies | FramePoints):
            continue
        k = len(group.point)
        local = np.asarray(group.observed).reshape(k, 3)
        if isinstance(group, FramePoints):
            frame_columns = np.where(group.frame_point[:, None] < 0, -1, group.frame_point[:, None] + np.arange(3))
            local = local + value(state, frame_columns)
        pose, start = np.broadcast_to(group.pose, (k, 6)), np.broadcast_to(group.start, (k, 3, 3))
        for columns in np.unique(pose, axis=0):
            at = np.flatnonzero((pose == columns).all(axis=1))
            yield group.point[at] // 3, local[at], columns, start[at[0]]


def poses(network: ObservationNetwork, xyz: np.ndarray, values: np.ndarray) -> Iterator[tuple[int, float]]:
    """Column and start of each unknown pose, from at least three placed points, not collinear."""
    for point, local, columns, start in bodies_of(network, values):
        motion = rigid_motion(local, xyz[point])
        if motion is not None and np.all(columns >= 0):
            turn, shift = motion
            yield from zip(columns.tolist(), [*shift, *to_vector(turn @ start.T)], strict=True)


def rigid_motion(local: np.ndarray, ground: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """R and T with ground = T + R local, from rows known in both.

    None if fewer than three or collinear.
    """
    common = np.isfinite(ground).all(axis=1) & np.isfinite(local).all(axis=1)
    if common.sum() < 3 or np.linalg.matrix_rank(local[common] - local[common].mean(axis=0), tol=1e-3) < 2:
        return None
    turn = closed_form(local[common], ground[common])[0]
    return turn, ground[common].mean(axis=0) - turn @ local[common].mean(axis=0)
