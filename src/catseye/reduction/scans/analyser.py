"""Light of a retroreflector that passes an analyser, by incidence and rotation.

The field of the light stands at `polarization` from the plane of incidence and the analyser at `analyser` from the
field, both counterclockwise as the ranger sees them. The stage tilts and turns the retroreflector; the light and the
analyser stay.
"""

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from catseye.aliases import Array
from catseye.constants import DEGREE
from catseye.optics.polarization import linear
from catseye.optics.retroreflector.corner_polarization import returned_power
from catseye.optics.retroreflector.interface import Retroreflector, Sectors

if TYPE_CHECKING:
    from scipy.interpolate import RectBivariateSpline

SECTOR = 120.0 * DEGREE  # after which a cube corner repeats itself
TURNS = 40  # of a sector
STEP = DEGREE  # of incidence
MARGIN = 4  # turns repeated at both ends, for a periodic spline
LEAST_CLEAR = 1e-3  # of the face: below it nothing is seen


class PolarizedShare:
    """Returned light of known polarization, over that of unpolarized light, by angle.

    retro          retroreflector
    polarization   rad, of the field from the plane of incidence
    largest        rad, largest incidence of use

    The sectors' powers add: [PARKER04] section 6.2.5. Their ratio to unpolarized light is a spline over a degree of
    incidence and three of azimuth: good to 0.001, to 0.02 within half a degree of the end of total reflection.
    """

    def __init__(self, retro: Retroreflector, polarization: float, largest: float) -> None:
        self.retro, self.polarization = retro, polarization
        self.azimuths = np.arange(TURNS) * (SECTOR / TURNS)
        steps = np.arange(0.0, largest + STEP, STEP)
        clear = np.nan_to_num(retro.clear_area(steps)) / float(retro.clear_area(0.0))
        self.incidences = steps[: max(4, int(np.sum(clear > LEAST_CLEAR)))]
        self._splines: dict[float, RectBivariateSpline] = {}

    def __call__(self, incidence: Array, azimuth: Array, analyser: Array) -> Array:
        """Ratio (m,).

        incidence, azimuth   (m,) rad, incidence 0 or more
        analyser             (m,) rad, nan for all of the light
        """
        share = np.ones(len(incidence))
        key = np.nan_to_num(analyser, nan=-np.inf)
        for angle in np.unique(key):
            use = key == angle
            at = np.minimum(incidence[use], self.incidences[-1]), np.mod(azimuth[use], SECTOR)
            share[use] = np.maximum(self._spline(float(angle)).ev(*at), 0.0)
        return share

    @cached_property
    def _grid(self) -> tuple[Sectors, Array, Array]:
        """Sectors by incidence and azimuth, field's azimuth there, and power of unpolarized light."""
        i, a = np.meshgrid(self.incidences, self.azimuths, indexing="ij")
        sectors = self.retro.sectors(i, a)
        half = [returned_power(sectors.jones, linear(turn), shares=sectors.shares) for turn in (0.0, 0.5 * np.pi)]
        return sectors, plane_azimuth(i, a) + self.polarization, 0.5 * (half[0] + half[1])

    def _spline(self, angle: float) -> "RectBivariateSpline":
        """Ratio for one analyser; -inf stands for none."""
        from scipy.interpolate import RectBivariateSpline

        if angle not in self._splines:
            sectors, field, unpolarized = self._grid
            state = None if angle == -np.inf else linear(field + angle)
            power = returned_power(sectors.jones, linear(field), analyser=state, shares=sectors.shares)
            around = np.arange(-MARGIN, TURNS + MARGIN)
            wide = np.take(power / unpolarized, around, axis=1, mode="wrap")
            self._splines[angle] = RectBivariateSpline(self.incidences, around * (SECTOR / TURNS), wide)
        return self._splines[angle]


def plane_azimuth(incidence: Array, azimuth: Array) -> Array:
    """Azimuth (...), rad, of the plane of incidence in the axes (u, v) of the sectors' matrices.

    incidence, azimuth   (...) rad, of the direction to the ranger

    Source: geometry: the derivative of the direction by the incidence, in `corner_polarization`'s axes.

    >>> float(plane_azimuth(np.array(0.0), np.array(0.5)))
    0.5
    """
    sine, cosine = np.sin(incidence), np.cos(incidence)
    toward = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine], axis=-1)
    along = np.stack([cosine * np.cos(azimuth), cosine * np.sin(azimuth), -sine], axis=-1)
    u = np.array([1.0, 0.0, 0.0]) - toward[..., :1] * toward
    u = u / np.linalg.norm(u, axis=-1, keepdims=True)
    return np.asarray(np.arctan2(np.sum(along * np.cross(toward, u), axis=-1), np.sum(along * u, axis=-1)))
