"""Mean index of air along straight paths at any times, with full covariance.

Three `profile.Profile`s: temperature; relative humidity, whose standard uncertainty in the index is a few per cent of
temperature's; pressure, reduced to one height by weight, since air at rest leaves a barometer no other profile.

    covariance = sum over the three of  slope_a slope_b cov(mean_a, mean_b)  +  local air along the paths

The slopes are the index's own derivatives at every node, relative humidity held: a thermometer that reads too high
raises the vapour pressure too, as in the hygrometer itself. Neglected: the effect of a wrong temperature
through the weight of the air, (z - z_barometer)/8600 m of its own effect, 1 % at 100 m; and the second order,
u²(T) (n - 1)/T², 3e-10 at 0.3 °C. The formula's own standard uncertainty is common to all and given separately.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from catseye.atmosphere.index.air import air
from catseye.atmosphere.path.mean import hydrostatic_pressure_hpa, nodes_along
from catseye.atmosphere.path.profile import HUMIDITY, PRESSURE, TEMPERATURE, Profile, ProfilePrior, ProfileReadings
from catseye.atmosphere.weather.humidity import vapour_pressure_hpa
from catseye.errors import EstimationError
from catseye.names import AIR_MODEL

NODES = 8  # of a mean along a path: 1e-13 for these profiles from 1 to 150 m
LOCAL_NODES = 12  # equal shares of a path, for local air; uncertainty up to 4 % too large at 100 m
LOCAL_ROWS = 64  # paths at a time


@dataclass(frozen=True, eq=False)
class WeatherReadings:
    """Readings of weather stations; nan where a sensor gave nothing.

    seconds            (n,) s, from any start
    z                  (n,) m, height of the station
    station            (n,) int, which station, from 0
    temperature_c      (n,) °C
    pressure_hpa       (n,) hPa at the station
    humidity_percent   (n,) % over liquid water
    count              (n,) int, readings averaged in each
    """

    seconds: np.ndarray
    z: np.ndarray
    station: np.ndarray
    temperature_c: np.ndarray
    pressure_hpa: np.ndarray
    humidity_percent: np.ndarray
    count: np.ndarray

    def of(self, name: str) -> ProfileReadings:
        """Readings of one quantity, without nan."""
        value = np.asarray(getattr(self, name), float)
        valid = ~np.isnan(value)
        if not valid.any():
            raise EstimationError(f"{name} was not read by any station; the index of air needs it")
        columns = (self.seconds, self.z, self.station, value, self.count)
        return ProfileReadings(*(np.asarray(column)[valid] for column in columns))

    def averaged(self, block: float) -> "WeatherReadings":
        """Means over blocks of time, by station; see `ProfileReadings.averaged`.

        block   s, length of a block, above zero

        Raises EstimationError where a sensor gave nothing: its rows would have other weights than the rest.
        """
        names = ("temperature_c", "pressure_hpa", "humidity_percent")
        quantities = [
            ProfileReadings(self.seconds, self.z, self.station, getattr(self, name), self.count) for name in names
        ]
        if any(np.isnan(quantity.value).any() for quantity in quantities):
            raise EstimationError("a sensor gave nothing in some readings; give only whole rows to be averaged")
        means = [quantity.averaged(block) for quantity in quantities]
        first = means[0]
        values = [quantity.value for quantity in means]
        return WeatherReadings(
            seconds=first.seconds,
            z=first.z,
            station=first.station,
            temperature_c=values[0],
            pressure_hpa=values[1],
            humidity_percent=values[2],
            count=first.count,
        )


class PathIndex(NamedTuple):
    """Mean group refractivity along m paths.

    refractivity    (m,) n_g - 1
    covariance      (m, m) of it, from readings, offsets, profile, time and local air
    temperature_c   (m,) mean temperature along the path, °C
    covariance_c2   (m, m) of that
    u_formula       standard uncertainty of the formula, common to all paths
    """

    refractivity: np.ndarray
    covariance: np.ndarray
    temperature_c: np.ndarray
    covariance_c2: np.ndarray
    u_formula: float


@dataclass(frozen=True, eq=False)
class AirProfile:
    """Temperature, pressure and humidity of a site's air.

    `AirProfile.of` makes one.

    temperature, humidity   in °C and %
    pressure                in hPa at `z_pressure`, the mean height of the barometers
    """

    temperature: Profile
    humidity: Profile
    pressure: Profile
    z_pressure: float

    @classmethod
    def of(
        cls,
        readings: WeatherReadings,
        *,
        ground: float,
        temperature: ProfilePrior = TEMPERATURE,
        pressure: ProfilePrior = PRESSURE,
        humidity: ProfilePrior = HUMIDITY,
    ) -> "AirProfile":
        """Air profile from readings.

        readings                          of at least one station; every quantity at least once
        ground                            m, height of the ground, below every station and path
        temperature, pressure, humidity   priors; those of `profile` suit an open site

        Source: see `profile`; barometers are reduced by [CIDDOR96] appendix A's gas in hydrostatic balance, with
        the temperature half-way. Raises as `Profile.of` does.
        """
        warmth = Profile.of(readings.of("temperature_c"), temperature, ground=ground)
        damp = Profile.of(readings.of("humidity_percent"), humidity, ground=ground)
        read = readings.of("pressure_hpa")
        middle = float(np.mean(read.z))
        reduced = _weighed(warmth, damp, read.seconds, read.value, read.z, middle)
        even = ProfileReadings(read.seconds, read.z, read.station, reduced, read.count)
        return cls(warmth, damp, Profile.of(even, pressure, ground=ground), middle)

    def state(self, seconds, z) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Temperature °C, pressure hPa, humidity % at times (m,), heights (m, k).

        Returns (m, k) each.

        Relative humidity is held within 0 to 100 %: an extrapolated profile can exceed it.
        """
        z = np.asarray(z, float)
        warmth = self.temperature.at(seconds, z)
        damp = np.clip(self.humidity.at(seconds, z), 0.0, 100.0)
        base = self.pressure.at(seconds, np.full(z.shape, self.z_pressure))
        return warmth, _weighed(self.temperature, self.humidity, seconds, base, self.z_pressure, z), damp

    def along(self, seconds, a, b, *, wavelength_um=0.780, model=AIR_MODEL, co2_ppm=450.0) -> PathIndex:
        """Mean group refractivity of straight paths at given times, with covariance.

        seconds         (m,) s, as the readings'
        a, b            (m, 3) ends, m, z up
        wavelength_um   vacuum wavelength, um
        model           a name in `air.MODELS`
        co2_ppm         carbon dioxide, ppm

        Source: derived at the top of this file; [JCGM102] eq. 3 (propagation with a Jacobian). Raises ValidityError
        for paths below the ground and for air outside the model.
        """
        t = np.asarray(seconds, float)
        a, b = np.asarray(a, float).reshape(-1, 3), np.asarray(b, float).reshape(-1, 3)
        z, share = nodes_along(a[:, 2], b[:, 2], NODES)
        warmth, pressure, damp = self.state(t, z)
        light = {"wavelength_um": wavelength_um, "model": model, "co2_ppm": co2_ppm}
        index = air(warmth, pressure, damp, **light)
        slopes = index.sensitivity
        pairs = (
            (self.temperature, np.ones(z.shape)),
            (self.temperature, slopes.temperature_c),
            (self.pressure, slopes.pressure_hpa),
            (self.humidity, slopes.humidity_percent),
        )
        lengths = {profile.prior.local_length for profile, _ in pairs if profile.prior.local > 0.0}
        shared = {length: shared_air(a, b, length) for length in lengths}
        parts = []
        for profile, slope in pairs:
            part = profile.covariance(t, np.einsum("mk,mkj,k->mj", slope, profile.basis(z), share))
            if profile.prior.local > 0.0:
                size = slope @ share
                part += np.outer(size, size) * profile.prior.local_covariance(t) * shared[profile.prior.local_length]
            parts.append(part)
        warm, covariance = parts[0], parts[1] + parts[2] + parts[3]
        return PathIndex(index.group_refractivity @ share, covariance, warmth @ share, warm, index.standard_uncertainty)


def shared_air(a, b, length) -> np.ndarray:
    """Covariance of unit local air between m straight paths, (m, m).

    Correlation of its means along the paths times their sizes.

    a, b     (m, 3) ends, m
    length   m, correlation length of local air

    Source: mean of exp(-distance/length) over all pairs of points of two paths; along one straight path of length d
    that is 2 (l/d)² (d/l - 1 + exp(-d/l)).

    >>> shared_air(np.zeros((1, 3)), np.array([[0.0, 0.0, 100.0]]), 20.0).round(2)
    array([[0.33]])
    """
    ends, of = np.unique(np.concatenate([a, b], axis=1), axis=0, return_inverse=True)
    of = of.ravel()
    share = (np.arange(LOCAL_NODES) + 0.5)[:, None] / LOCAL_NODES
    points = ends[:, None, :3] + share * (ends[:, None, 3:] - ends[:, None, :3])
    flat = points.reshape(-1, 3)
    together = np.empty((len(ends), len(ends)))
    for k in range(0, len(ends), LOCAL_ROWS):
        some = points[k : k + LOCAL_ROWS].reshape(-1, 3)
        apart = np.sqrt(sum((some[:, None, i] - flat[:, i]) ** 2 for i in range(3)))
        pairs = np.exp(-apart / length).reshape(-1, LOCAL_NODES, len(ends), LOCAL_NODES)
        together[k : k + LOCAL_ROWS] = pairs.mean(axis=(1, 3))
    return together[np.ix_(of, of)]


def _weighed(warmth: Profile, damp: Profile, seconds, pressure_hpa, z_from, z_to):
    """Pressure at another height by the air's weight, temperature half-way."""
    half = np.broadcast_to(0.5 * (np.asarray(z_from) + np.asarray(z_to)), np.shape(pressure_hpa))
    temperature = warmth.at(seconds, half)
    e = vapour_pressure_hpa(temperature, pressure_hpa, np.clip(damp.at(seconds, half), 0.0, 100.0))
    return hydrostatic_pressure_hpa(pressure_hpa, temperature, z_from, z_to=z_to, vapour_pressure_hpa=e)
