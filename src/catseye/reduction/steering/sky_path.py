"""Path of a telescope that follows a star across the sky."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.constants import DEGREE, SECONDS_PER_DAY
from catseye.errors import InputError
from catseye.geometry.sky.star import Star, star_place
from catseye.geometry.sky.sun import altitude_azimuth, refracted
from catseye.reduction.site.earth_rotation import FramePlace, rotation_at

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

STEP = 2.0  # s between computed places: the spline is off by 1e-10 rad one degree from the zenith
MARGIN = 2  # places beyond the end, where the spline is as good as inside
LOWEST = 5.0 * DEGREE  # elevation; the telescope's limit, site facts
ZENITH = 89.5 * DEGREE  # above it the azimuth runs away


@dataclass(frozen=True, eq=False)
class SkyAxis:
    """One axis of a telescope along computed angles.

    times       (n,) s, at equal steps from 0
    angles      (n,) rad, continuous
    duration    s, of the track: the last times may lie beyond
    """

    times: Array
    angles: Array
    duration: float

    @cached_property
    def _spline(self) -> "CubicSpline":
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.times, self.angles)

    @property
    def peak(self) -> float:
        """Largest rate of the axis, rad/s."""
        return float(np.abs(self._spline(self.times, 1)).max())

    @property
    def acceleration(self) -> float:
        """Largest acceleration, rad/s^2."""
        return float(np.abs(self._spline(self.times, 2)).max())

    def at(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Angle (...), rad, rate and acceleration at times (...), s."""
        since = np.clip(np.asarray(t, dtype=float), self.times[0], self.times[-1])
        angle, rate, bend = (np.asarray(self._spline(since, order)) for order in range(3))
        return angle, rate, bend


def star_axes(star: Star, begin_mjd: float, duration: float, place: FramePlace) -> tuple[SkyAxis, SkyAxis]:
    """Azimuth and elevation of a telescope that follows a star.

    begin_mjd   UTC at time 0
    duration    s, above 0
    place       on Earth, with the pressure of the air that refracts

    Raises InputError where the star is below 5 degrees or within half a degree of the zenith.

    Source: [SOFA23] by `star_place`, refraction [MEEUS98] by `refracted`; splines of third order between.
    """
    times = np.asarray(STEP * np.arange(int(np.ceil(duration / STEP)) + 1 + MARGIN), dtype=np.float64)
    mjd = begin_mjd + times / SECONDS_PER_DAY
    azimuth, zenith = star_place(
        star,
        mjd,
        place.latitude,
        longitude=place.longitude,
        height=place.height,
        ut1_utc=rotation_at(mjd).ut1_minus_utc,
    )
    level = np.sin(zenith)
    direction = np.stack([level * np.sin(azimuth), level * np.cos(azimuth), np.cos(zenith)], axis=-1)
    altitude, azimuth = altitude_azimuth(refracted(direction, place.pressure_hpa or 0.0, place.temperature_c))
    for k in np.flatnonzero((altitude < LOWEST) | (altitude > ZENITH))[:1]:
        raise InputError(
            f"{star.name} is at elevation {altitude[k] / DEGREE:.2f} deg {times[k]:.0f} s after the start (expected "
            f"{LOWEST / DEGREE:g} to {ZENITH / DEGREE:g})"
        )
    return SkyAxis(times, np.asarray(np.unwrap(azimuth), dtype=np.float64), duration), SkyAxis(
        times, np.asarray(altitude), duration
    )
