"""Coordinate measuring machine maps: best fit of a panel, and its shape.

Source: [PARKER04] chapter 11.
"""

from dataclasses import dataclass

import numpy as np

from catseye.errors import InputError
from catseye.estimation.quality.robustness import MAD_TO_SIGMA, huber
from catseye.records.panels.readings import PanelMap

ROUNDS = 50
SETTLED = 1e-9  # m: a nanometre
NEIGHBOURS = 8  # points of the map used for a place
FARTHEST = 0.5  # m from a place to the nearest point of the map


@dataclass(frozen=True, eq=False)
class FittedMap:
    """Panel map about its best fit.

    panel      name
    xy         (k, 2) m, panel's axes
    shape      (k,) m, deviation beside the best fit
    fit        (3,) piston (m) and slopes along x and y of the best fit: the panel's position on the machine
    u_fit      (3,) from the scatter of the shape, as if it were noise
    rms        m, of the shape
    outlying   (k,) bool, weight below a half
    """

    panel: str
    xy: np.ndarray
    shape: np.ndarray
    fit: np.ndarray
    u_fit: np.ndarray
    rms: float
    outlying: np.ndarray

    def at(self, xy: np.ndarray) -> np.ndarray:
        """Shape at places (m, 2) of the panel's axes, m.

        Plane through the nearest points, nearer ones with larger weight.

        Raises InputError for a place far from the map.
        """
        from scipy.spatial import cKDTree

        most = min(NEIGHBOURS, len(self.xy))
        distance, near = cKDTree(self.xy).query(xy, most)
        if distance[:, 0].max() > FARTHEST:
            raise InputError(
                f"{self.panel}.csv: no point within {FARTHEST:g} m of x, y = "
                f"{(1e3 * xy[int(np.argmax(distance[:, 0]))]).round().tolist()} mm (expected a map of the whole panel)"
            )
        size = distance[:, -1:, None]
        arm = (self.xy[near] - xy[:, None]) / size
        design = np.concatenate([np.ones((*near.shape, 1)), arm], axis=2)
        root = 1.0 / np.sqrt(distance[..., None] / size + 0.05)
        normal = np.swapaxes(design * root, 1, 2) @ (design * root)
        right = np.swapaxes(design * root, 1, 2) @ (self.shape[near][..., None] * root)
        return np.linalg.solve(normal + 1e-9 * np.eye(3), right)[:, 0, 0]


def fitted_map(panel_map: PanelMap) -> FittedMap:
    """Robust best fit of a map (piston and two tilts), and its shape.

    panel_map   a map; its tilt is the panel's position on the machine, no property of the panel

    Huber's weights with the scale from the median absolute residual.

    Source: [HUBER09] (reweighting).
    """
    k = len(panel_map.deviation)
    design = np.column_stack([np.ones(k), panel_map.xy])
    size = np.array([1.0, *np.maximum(np.abs(panel_map.xy).max(axis=0), 1e-3)])
    weight, fit = np.ones(k), np.zeros(3)
    for _ in range(ROUNDS):
        root = np.sqrt(weight)
        refitted = np.linalg.lstsq(design / size * root[:, None], panel_map.deviation * root, rcond=None)[0] / size
        residual = panel_map.deviation - design @ refitted
        moved = float(np.max(np.abs(design @ (refitted - fit))))
        fit = refitted
        scale = MAD_TO_SIGMA * float(np.median(np.abs(residual)))
        if moved < SETTLED or scale == 0.0:
            break
        weight = huber(residual / scale)
    residual = panel_map.deviation - design @ fit
    s = float(np.sqrt(np.sum(weight * residual**2) / max(k - 3, 1)))
    q = np.linalg.inv(design.T @ (design * weight[:, None]))
    return FittedMap(
        panel=panel_map.panel,
        xy=panel_map.xy,
        shape=residual,
        fit=fit,
        u_fit=s * np.sqrt(np.diag(q)),
        rms=float(np.sqrt(np.mean(residual**2))),
        outlying=weight < 0.5,
    )
