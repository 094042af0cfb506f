"""Comparison of the commanded posture with a part's measured direction.

Two records of one quantity.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from catseye.constants import DEGREE
from catseye.geometry.antenna.pointing_series import published

SURE = 5.0  # standard uncertainties of the pose that a real disagreement exceeds


@dataclass(frozen=True, eq=False)
class PostureOffset:
    """Direction of a part's axis minus the commanded posture's.

    what       the part
    offset     (2,) rad, azimuth times cos E and elevation
    u          (2,) rad
    postures   number of commanded ones used: 2 where two epochs are compared
    """

    what: str
    offset: np.ndarray
    u: np.ndarray
    postures: int = 1

    @property
    def doubt(self) -> str:
        """Disagreement of posture and part, as a text; "" for none."""
        limit = self.postures * largest_correction()
        excess = (np.abs(self.offset) - limit) / self.u
        worst = int(np.argmax(excess))
        if not excess[worst] > SURE:
            return ""
        along = ("across the elevation axis", "in elevation")[worst]
        source = (
            "the commanded posture and the design" if self.postures == 1 else "the commanded postures of the two epochs"
        )
        return (
            f"{source} disagree with the {self.what} by {self.offset[worst] / DEGREE:+.3f} degrees {along} (u "
            f"{self.u[worst] / DEGREE:.4f}, expected up to {limit / DEGREE:.3f}); undecided which is wrong"
        )


def offset_of(what: str, rotation: np.ndarray, covariance: np.ndarray, posture: tuple[float, float]) -> PostureOffset:
    """Rotation of a part's axis away from the posture.

    what         the part
    rotation     (3,) rad, from its design, ground axes
    covariance   (3, 3) rad^2
    posture      azimuth, elevation, rad
    """
    lean = axis_lean(*posture)
    return PostureOffset(what, lean @ rotation, np.sqrt(np.einsum("ai,ij,aj->a", lean, covariance, lean)))


def axis_lean(azimuth: float, elevation: float) -> np.ndarray:
    """Matrix (2, 3) from a small turn w of the dish to its axis' motion.

    w x a along larger azimuth and elevation.
    """
    along = np.array([np.sin(azimuth) * np.cos(elevation), np.cos(azimuth) * np.cos(elevation), np.sin(elevation)])
    across = np.array([np.cos(azimuth), -np.sin(azimuth), 0.0])
    up = np.array([-np.sin(azimuth) * np.sin(elevation), -np.cos(azimuth) * np.sin(elevation), np.cos(elevation)])
    return np.stack([np.cross(along, across), np.cross(along, up)])  # e . (w x a) = w . (a x e)


@cache
def largest_correction() -> float:
    """Largest correction of the published pointing series, rad.

    Above 5 degrees of elevation; encoders and beam differ by it.

    Source: [GBTPM01].

    >>> round(largest_correction() / DEGREE, 3)
    0.082
    """
    a, e = np.meshgrid(np.arange(0.0, 360.0, 5.0) * DEGREE, np.arange(5.0, 90.5, 1.0) * DEGREE)
    return float(np.linalg.norm(published().correction(a, e), axis=-1).max())
