"""The air of a campaign from its weather stations: smoothed in time, a line in height, with offsets to be estimated."""

from dataclasses import dataclass

import numpy as np

from catseye.atmosphere.air import group_refractivity
from catseye.atmosphere.path import mean_over_height, pressure_at
from catseye.constants import SECONDS_PER_DAY
from catseye.records.campaign import Campaign
from catseye.reduction.settings import Settings

SMOOTHING = 300.0  # s, Gaussian half-width in time: noise of a reading every 30 s falls to a sixth
DISTINCT_HEIGHTS = 5.0  # m, stations closer in height than this show no gradient


@dataclass(frozen=True, eq=False)
class PathAir:
    """Group refractivity averaged along m paths, and its derivatives by the q parameters of the air.

    refractivity   (m,) n_g - 1
    slopes         (m, q) per °C of a thermometer's offset (it reads too high), per °C of bend (warmer
                   half-way between the stations than on their line), or per °C/m of gradient
    """

    refractivity: np.ndarray
    slopes: np.ndarray


@dataclass(frozen=True, eq=False)
class AirField:
    """Temperature, pressure and humidity around the site as functions of time and height.

    names     what the q parameters are: one thermometer offset a station, then "bend" or "gradient"
    sigmas    (q,) their standard uncertainties beforehand
    """

    names: tuple[str, ...]
    sigmas: np.ndarray
    heights: np.ndarray
    seconds: tuple[np.ndarray, ...]
    readings: tuple[np.ndarray, ...]
    start_mjd: float
    wavelength_um: float
    model: str

    @classmethod
    def of(cls, campaign: Campaign, settings: Settings) -> "AirField":
        """The air of a campaign; heights in the ground frame."""
        weather, site = campaign.weather, campaign.site
        stations = site.weather_station
        where = np.array(weather.station)
        start = float(campaign.shots.mjd_utc[0])
        table = np.stack([weather.temperature_c, weather.pressure_hpa, weather.humidity_percent], axis=1)
        heights = np.array([s.elevation_m - site.site.elevation_of_z0_m for s in stations])
        flat = np.ptp(heights) < DISTINCT_HEIGHTS
        return cls(
            names=(*(s.name for s in stations), "gradient" if flat else "bend"),
            sigmas=np.array(
                [settings.u_thermometer_c] * len(stations)
                + [settings.u_gradient_c_per_m if flat else settings.u_profile_c]
            ),
            heights=heights,
            seconds=tuple((weather.mjd_utc[where == s.name] - start) * SECONDS_PER_DAY for s in stations),
            readings=tuple(table[where == s.name] for s in stations),
            start_mjd=start,
            wavelength_um=site.ranging.wavelength_um,
            model=settings.air_model,
        )

    def smoothed(self, mjd_utc: np.ndarray) -> np.ndarray:
        """Temperature °C, pressure hPa, humidity % of each station: (m, stations, 3), by local straight lines.

        Humidity stays within 0 to 100 %: a line through readings near an end, or rounding in fog, leads beyond.
        """
        t = (np.asarray(mjd_utc, dtype=float) - self.start_mjd) * SECONDS_PER_DAY
        state = np.stack(
            [_local_line(when, values, t) for when, values in zip(self.seconds, self.readings, strict=True)], axis=1
        )
        state[..., 2] = np.clip(state[..., 2], 0.0, 100.0)
        return state

    def along(self, mjd_utc: np.ndarray, a: np.ndarray, b: np.ndarray, parameters: np.ndarray) -> PathAir:
        """Mean group refractivity of straight paths, by Gauss-Legendre quadrature along them.

        mjd_utc      (m,) time of the shot
        a, b         (m, 3) ends in the ground frame, m
        parameters   (q,) values of `names`

        Source: README of the campaign layout: temperature linear between the stations and beyond, pressure falling
        by 0.11 hPa a metre ([PARKER04] section 1.4.2), relative humidity independent of height.
        """
        state = self.smoothed(mjd_utc)
        middle = self.heights.mean()
        temperatures = state[:, :, 0] - parameters[:-1]
        pressure, humidity = state[:, None, :, 1].mean(axis=2), state[:, None, :, 2].mean(axis=2)

        def profile(z: np.ndarray) -> np.ndarray:
            """Refractivity at heights (m, k), and its derivatives by each parameter: (1 + q, m, k)."""
            share, last = self._shares(z)
            temperature = np.einsum("mks,ms->mk", share, temperatures) + parameters[-1] * last
            index, above, below = (
                group_refractivity(
                    temperature + step,
                    pressure_at(pressure, middle, z),
                    humidity,
                    wavelength_um=self.wavelength_um,
                    model=self.model,
                )
                for step in (0.0, 0.5, -0.5)
            )
            per_c = above - below
            return np.concatenate([index[None], -per_c * np.moveaxis(share, -1, 0), (per_c * last)[None]])

        mean = mean_over_height(profile, a[:, 2], b[:, 2])
        return PathAir(mean[0], mean[1:].T)

    def steepest(self, offsets: np.ndarray) -> float:
        """Mean temperature gradient from lowest to highest station, °C/m, offsets removed; 0 at one height."""
        if self.names[-1] == "gradient":
            return 0.0
        mean = np.array([values[:, 0].mean() for values in self.readings]) - offsets
        low, high = int(np.argmin(self.heights)), int(np.argmax(self.heights))
        return float((mean[high] - mean[low]) / (self.heights[high] - self.heights[low]))

    def _shares(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How much each station counts at heights z (m, k): (m, k, stations); and the profile of the last parameter."""
        middle, span = self.heights.mean(), np.ptp(self.heights)
        count = len(self.heights)
        if self.names[-1] == "gradient":
            return np.full((*z.shape, count), 1.0 / count), z - middle
        design = np.stack([np.ones(count), self.heights - middle], axis=1)
        line = np.linalg.pinv(design)
        share = line[0] + (z - middle)[..., None] * line[1]
        low, high = self.heights.min(), self.heights.max()
        return share, 4.0 * (z - low) * (high - z) / span**2


def _local_line(when: np.ndarray, values: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Values (n, c) at times `when`, smoothed at times t (m,): weighted straight lines, a constant where one sample is.

    The half-width grows where samples are far, so that the nearest always counts. Before the first sample and after
    the last the value is the one there: no jump at the ends, and no trend carried on.
    """
    t = np.clip(t, when.min(), when.max())
    gap = np.min(np.abs(t[:, None] - when), axis=1)
    width = np.maximum(SMOOTHING, gap)
    distance = when - t[:, None]
    weight = np.exp(-0.5 * (distance / width[:, None]) ** 2)
    s0, s1, s2 = weight.sum(axis=1), (weight * distance).sum(axis=1), (weight * distance**2).sum(axis=1)
    spread = s2 * s0 - s1**2
    line = (weight * (s2[:, None] - s1[:, None] * distance)) / np.where(spread > 0.0, spread, 1.0)[:, None]
    lonely = spread <= 1e-9 * (s0 * width) ** 2
    smooth = np.where(lonely[:, None], weight / s0[:, None], line)
    return smooth @ values
