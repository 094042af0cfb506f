"""The told posture against where a part of the antenna points by its own ranges: two records of one thing."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from catseye.constants import DEGREE
from catseye.geometry.antenna.pointing_series import published

SURE = 5.0  # standard uncertainties of the pose beyond which it and the posture disagree


@dataclass(frozen=True, eq=False)
class PostureOffset:
    """Direction of a part's axis less the told posture's.

    what       the part
    offset     (2,) rad, azimuth times cos E and elevation
    u          (2,) rad
    postures   told ones that went in: 2 where two epochs are compared
    """

    what: str
    offset: np.ndarray
    u: np.ndarray
    postures: int = 1

    @property
    def doubt(self) -> str:
        """How posture and part disagree; "" where they do not."""
        limit = self.postures * largest_correction()
        beyond = (np.abs(self.offset) - limit) / self.u
        worst = int(np.argmax(beyond))
        if not beyond[worst] > SURE:
            return ""
        along = ("across the elevation axis", "in elevation")[worst]
        told = "the told posture and the design" if self.postures == 1 else "the told postures of the two epochs"
        return (
            f"{told} disagree with the {self.what} by {self.offset[worst] / DEGREE:+.3f} degrees {along} (u "
            f"{self.u[worst] / DEGREE:.4f}, expected up to {limit / DEGREE:.3f}); nothing here says which is wrong"
        )


def offset_of(what: str, rotation: np.ndarray, covariance: np.ndarray, posture: tuple[float, float]) -> PostureOffset:
    """How far a part turns away from the posture.

    what         the part
    rotation     (3,) rad, from its design, ground axes
    covariance   (3, 3) rad^2
    posture      azimuth, elevation, rad
    """
    lean = axis_lean(*posture)
    return PostureOffset(what, lean @ rotation, np.sqrt(np.einsum("ai,ij,aj->a", lean, covariance, lean)))


def axis_lean(azimuth: float, elevation: float) -> np.ndarray:
    """(2, 3): how a small turn w of the dish moves its axis a, as w x a along larger azimuth and elevation."""
    along = np.array([np.sin(azimuth) * np.cos(elevation), np.cos(azimuth) * np.cos(elevation), np.sin(elevation)])
    across = np.array([np.cos(azimuth), -np.sin(azimuth), 0.0])
    up = np.array([-np.sin(azimuth) * np.sin(elevation), -np.cos(azimuth) * np.sin(elevation), np.cos(elevation)])
    return np.stack([np.cross(along, across), np.cross(along, up)])  # e . (w x a) = w . (a x e)


@cache
def largest_correction() -> float:
    """Largest correction of the published pointing series above 5 degrees, rad: encoders and beam differ by it.

    Source: [GBTPM01].

    >>> round(largest_correction() / DEGREE, 3)
    0.082
    """
    a, e = np.meshgrid(np.arange(0.0, 360.0, 5.0) * DEGREE, np.arange(5.0, 90.5, 1.0) * DEGREE)
    return float(np.linalg.norm(published().correction(a, e), axis=-1).max())
