"""Rigid design of a body's points, and rigid part of their displacements."""

import numpy as np

from catseye.aliases import Array

FLAT = 1e-9  # of the points' extent: a smaller singular value is an undetermined motion


def rigid_design(arms: Array) -> Array:
    """Displacement (n, 3, 6) of points per unit shift and rotation: turn x arm = -[arm] x turn.

    arms   (n, 3) m
    """
    x, y, z = np.moveaxis(np.asarray(arms, dtype=float), -1, 0)
    design = np.zeros((*x.shape, 3, 6))
    design[..., [0, 1, 2], [0, 1, 2]] = 1.0
    design[..., 0, 4], design[..., 0, 5] = z, -y
    design[..., 1, 3], design[..., 1, 5] = -z, x
    design[..., 2, 3], design[..., 2, 4] = y, -x
    return design


def moved(six: Array, arms: Array) -> Array:
    """Displacement (P, n, 3), m, of points at arms (n, 3) m by small shifts and rotations (P, 6)."""
    return six[:, None, :3] + np.cross(six[:, None, 3:], arms)


def rigid_part(arms: Array) -> Array | None:
    """Matrix (6, n, 3) from displacements to their unweighted rigid part.

    None if undetermined.
    """
    r = rigid_design(arms)
    scale = np.repeat([1.0, float(np.sqrt(np.mean(np.sum((arms - arms.mean(axis=0)) ** 2, axis=1)))) or 1.0], 3)
    flat = r.reshape(-1, 6) / scale
    if np.linalg.matrix_rank(flat, tol=FLAT * np.sqrt(len(flat))) < 6:
        return None
    return (np.linalg.pinv(flat) / scale[:, None]).reshape(6, -1, 3)


def arms_of(design: Array) -> Array:
    """Arms (n, 3) m of a rigid design (n, 3, 6)."""
    return np.stack([design[:, 1, 5], design[:, 2, 3], design[:, 0, 4]], axis=1)
