"""Panels of a paraboloid: corner axes, surface rise, panel under a place.

Reflector frame: origin at the vertex, z towards the focus. A panel is known by its four corners in x and y, in order
round it; a deviation is along the normal, above zero towards the focus. At a corner x runs outwards along the surface,
away from the paraboloid's axis, z along the normal to the focus and y = z × x.
"""

from dataclasses import dataclass

import numpy as np

STEPS = 8  # of Newton's method; quadrilaterals near a parallelogram need three
EDGE = 1e-6  # tolerance outside a panel, as a share of the panel
CANDIDATES = 16  # panels whose middles are nearest; those that meet at a corner are among them
SIGNS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])  # of the bilinear shape functions


@dataclass(frozen=True, eq=False)
class Axes:
    """Points of the paraboloid with their axes, reflector frame.

    origin    (..., 3) m
    x, y, z   (..., 3) outwards along the surface, round the axis, along the normal
    """

    origin: np.ndarray
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray

    def places(self, x: np.ndarray, y: np.ndarray, focal_length: float) -> tuple[np.ndarray, np.ndarray]:
        """Points (..., 3) m of the paraboloid over a tangent plane, and heights, m.

        They lie on the normal through a place of the tangent plane.

        x, y           (...) m, in the tangent plane
        focal_length   m

        With Q the place and n the normal, Q + w n on z = (x² + y²)/4f is a quadratic in w; its small root, exactly.

        >>> at = axes(np.array([0.0, 54.0]), 60.0)
        >>> _, rise = at.places(np.array(0.075), np.array(0.0), 60.0)
        >>> round(float(rise) * 1e6, 2)  # 0.075² / 2R, R = 120 m (1 + 0.45²)^1.5
        17.77
        """
        q = self.origin + x[..., None] * self.x + y[..., None] * self.y
        flat, across = q[..., :2], self.z[..., :2]
        a = np.sum(across**2, axis=-1) / (4.0 * focal_length)
        b = np.sum(flat * across, axis=-1) / (2.0 * focal_length) - self.z[..., 2]
        c = np.sum(flat**2, axis=-1) / (4.0 * focal_length) - q[..., 2]
        rise = 2.0 * c / (-b + np.sqrt(b * b - 4.0 * a * c))
        return q + rise[..., None] * self.z, rise


def axes(xy: np.ndarray, focal_length: float) -> Axes:
    """Axes at points of the paraboloid.

    xy             (..., 2) m, reflector frame; not the vertex, where outwards is undefined
    focal_length   m
    """
    xy = np.asarray(xy, dtype=float)
    radius = np.sqrt(np.sum(xy**2, axis=-1))
    slope = radius / (2.0 * focal_length)
    length = np.sqrt(1.0 + slope**2)
    out = xy / radius[..., None]
    zero = np.zeros_like(radius)
    return Axes(
        origin=np.concatenate([xy, (radius**2 / (4.0 * focal_length))[..., None]], axis=-1),
        x=np.concatenate([out, slope[..., None]], axis=-1) / length[..., None],
        y=np.stack([-out[..., 1], out[..., 0], zero], axis=-1),
        z=np.concatenate([-out * slope[..., None], np.ones_like(slope)[..., None]], axis=-1) / length[..., None],
    )


def cosine_of_slope(normal: np.ndarray, elevation: float) -> np.ndarray:
    """Cosine (...) of the angle between normal and plumb line.

    normal      (..., 3) reflector frame
    elevation   of the paraboloid's axis, rad: the zenith is (0, -cos E, sin E) in the reflector frame
    """
    return -normal[..., 1] * np.cos(elevation) + normal[..., 2] * np.sin(elevation)


def shares(xy: np.ndarray, quad: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shares (..., 4) of a quadrilateral's corners at a place; True (...) inside.

    xy     (..., 2)
    quad   (..., 4, 2) corners in order round it

    Bilinear: shares sum to one and give back any linear function exactly; Newton's method from the middle.

    >>> square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    >>> shares(np.array([0.25, 0.5]), square)[0].tolist()
    [0.375, 0.125, 0.125, 0.375]
    """
    local = np.zeros(xy.shape)
    for _ in range(STEPS):
        weight, along, across = _bilinear(local)
        misfit = xy - np.einsum("...k,...kc->...c", weight, quad)
        p, q = np.einsum("...k,...kc->...c", along, quad), np.einsum("...k,...kc->...c", across, quad)
        area = p[..., 0] * q[..., 1] - p[..., 1] * q[..., 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            du = (misfit[..., 0] * q[..., 1] - misfit[..., 1] * q[..., 0]) / area
            dv = (p[..., 0] * misfit[..., 1] - p[..., 1] * misfit[..., 0]) / area
        local = local + np.clip(np.nan_to_num(np.stack([du, dv], axis=-1)), -2.0, 2.0)  # distant places stay outside
    missed = np.max(np.abs(xy - np.einsum("...k,...kc->...c", _bilinear(local)[0], quad)), axis=-1)
    inside = (np.max(np.abs(local), axis=-1) <= 1.0 + EDGE) & (missed < 1e-9 * (1.0 + np.max(np.abs(xy), axis=-1)))
    return _bilinear(local)[0], inside


def _bilinear(local: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Shape functions (..., 4) at places in [-1, 1]² and their derivatives."""
    u, v = local[..., :1], local[..., 1:]
    return (
        0.25 * (1.0 + SIGNS[:, 0] * u) * (1.0 + SIGNS[:, 1] * v),
        0.25 * SIGNS[:, 0] * (1.0 + SIGNS[:, 1] * v),
        0.25 * SIGNS[:, 1] * (1.0 + SIGNS[:, 0] * u),
    )


def panels_under(xy: np.ndarray, quads: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Panel under each place (m,), -1 if none, and corner shares (m, 4).

    xy      (m, 2) m
    quads   (p, 4, 2) m
    """
    from scipy.spatial import cKDTree

    most = min(CANDIDATES, len(quads))
    near = cKDTree(quads.mean(axis=1)).query(xy, most)[1].reshape(len(xy), most)
    weight, inside = shares(np.repeat(xy[:, None], most, axis=1), quads[near])
    first = np.argmax(inside, axis=1)
    rows = np.arange(len(xy))
    panel = np.where(inside[rows, first], near[rows, first], -1)
    return panel, np.where(panel[:, None] < 0, 0.0, weight[rows, first])


def warps(xy: np.ndarray) -> np.ndarray:
    """Warp weights (..., 4) of four corners: heights ~ h @ warp.

    No rigid motion makes that part; absolute values sum to 1.

    xy   (..., 4, 2) m, corners in the panel's plane

    The null vector of the plane through four points: of a square (1, -1, 1, -1)/4.

    >>> warps(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])).round(6).tolist()
    [0.25, -0.25, 0.25, -0.25]
    """
    plane = np.concatenate([np.ones((*xy.shape[:-1], 1)), xy - xy.mean(axis=-2, keepdims=True)], axis=-1)
    null = np.linalg.svd(np.swapaxes(plane, -1, -2))[2][..., 3, :]
    return null * (np.sign(null[..., :1]) / np.sum(np.abs(null), axis=-1, keepdims=True))
