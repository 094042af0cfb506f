"""The air of a campaign from its weather stations: smoothed in time, a line in height, with offsets to be estimated.

Where sound measured the mean temperature of a line (path_temperatures.csv), that takes the thermometers' place in the
index of the line's shots near in time; pressure and vapour stay the stations'.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from catseye.atmosphere.index.air import MODELS, group_refractivity
from catseye.atmosphere.path.mean import mean_over_height, pressure_at
from catseye.atmosphere.weather.humidity import vapour_pressure_hpa
from catseye.constants import SECONDS_PER_DAY
from catseye.errors import InputError, ValidityError
from catseye.records.night.campaign import ObservedSite
from catseye.records.night.path_temperature import PathTemperatureTable
from catseye.reduction.epoch.parameter import BEND, GRADIENT, Parameter, ParameterKind
from catseye.reduction.epoch.settings import ReductionSettings

Profile = Callable[[np.ndarray], np.ndarray]

SOUND_NEAR = 600.0  # s from a shot to its line's nearest sounding, beyond which the thermometers count again
SMOOTHING = 300.0  # s, Gaussian half-width in time: noise of a reading every 30 s falls to a sixth
DISTINCT_HEIGHTS = 5.0  # m, stations closer in height than this show no gradient
MOST_KEPT = 64  # sets of times whose smoothed readings are kept: one a ranger, and more
MUCH_C = 2.0  # °C, an offset of a thermometer worth telling
LEAST_HPA = 600.0


@dataclass(frozen=True, eq=False)
class PathAir:
    """Group refractivity averaged along m paths, and its derivatives by the q parameters of the air.

    refractivity   (m,) n_g - 1
    slopes         (m, q) per °C of a thermometer's offset (it reads too high), per °C of bend (warmer
                   half-way between the stations than on their line), per °C/m of gradient, or per °C that the sound
                   of a line reads too warm
    """

    refractivity: np.ndarray
    slopes: np.ndarray


@dataclass(frozen=True, eq=False)
class SoundedLine:
    """A line whose mean temperature was measured by sound, (k,) rows in order of time.

    ends            the two names; a line is the same from either end
    temperature_c   mean along the line
    u               °C, of each row; what makes it is taken as common to all rows of the line
    """

    ends: frozenset[str]
    mjd_utc: np.ndarray
    temperature_c: np.ndarray
    u: np.ndarray

    @property
    def name(self) -> str:
        return " - ".join(sorted(self.ends))

    @property
    def sigma(self) -> float:
        """°C, of the line's parameter; a row with another u feels it in proportion."""
        return float(np.sqrt(np.mean(self.u**2)))

    def near(self, mjd_utc: np.ndarray) -> np.ndarray:
        """(m,) bool: a row lies near enough in time."""
        return np.min(np.abs(mjd_utc[:, None] - self.mjd_utc), axis=1) * SECONDS_PER_DAY <= SOUND_NEAR

    def at(self, mjd_utc: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(m,) °C and share of the line's parameter, linear between rows, constant before the first and after the last.

        Two rows far apart are joined by a line: only shots `near` one of them ask.
        """
        temperature = np.interp(mjd_utc, self.mjd_utc, self.temperature_c)
        return temperature, np.interp(mjd_utc, self.mjd_utc, self.u) / self.sigma

    def note(self, mjd_utc: np.ndarray, warm: tuple[float, float], w: float, critical: float) -> str:
        """What the line did, in a sentence.

        mjd_utc    (m,) times of all its shots
        warm       °C that it is found to read too warm, and u
        w          test statistic of that against its prior; beyond `critical` the ranges contradict it
        """
        near = self.near(mjd_utc)
        if not near.any():
            return f"{self.name}: no shot within {SOUND_NEAR / 60.0:.0f} min of its path temperatures: they do nothing"
        late = f", {(~near).sum()} more too far in time" if not near.all() else ""
        doubt = (
            f"; the ranges contradict it (w {w:.1f}) and do without: see its length, delay" if abs(w) > critical else ""
        )
        return (
            f"{self.name}: air {self.at(mjd_utc[near])[0].mean():.2f} °C by sound for {near.sum()} shots{late}; it is "
            f"found to read {warm[0]:+.2f} °C too warm (u {warm[1]:.2f} °C){doubt}"
        )


def sounded_lines(table: PathTemperatureTable | None) -> tuple[SoundedLine, ...]:
    """The lines of path_temperatures.csv, sorted by name; none without the file."""
    if table is None:
        return ()
    pairs = [frozenset(pair) for pair in zip(table.ranger, table.target, strict=True)]
    made = []
    for ends in dict.fromkeys(pairs):
        rows = np.array([k for k, pair in enumerate(pairs) if pair == ends])
        rows = rows[np.argsort(table.mjd_utc[rows])]
        made.append(SoundedLine(ends, table.mjd_utc[rows], table.temperature_c[rows], table.u_temperature_c[rows]))
    return tuple(sorted(made, key=lambda line: line.name))


@dataclass(frozen=True, eq=False)
class AirField:
    """Temperature, pressure and humidity around the site as functions of time and height.

    names     what the q parameters are: one thermometer offset a station, "bend" or "gradient", then the sounded lines
    sigmas    (q,) their standard uncertainties beforehand
    lines     where sound measured the temperature
    sounded   (m,) index into `lines` of each path that `along` is asked for, -1 where none; None for no path at all
    """

    names: tuple[str, ...]
    sigmas: np.ndarray
    heights: np.ndarray
    seconds: tuple[np.ndarray, ...]
    readings: tuple[np.ndarray, ...]
    start_mjd: float
    wavelength_um: float
    model: str
    lines: tuple[SoundedLine, ...] = ()
    sounded: np.ndarray | None = None
    _smooth: dict[bytes, np.ndarray] = field(default_factory=dict)  # times: what `smoothed` gave

    @classmethod
    def of(cls, campaign: ObservedSite, settings: ReductionSettings) -> "AirField":
        """The air of a campaign; heights in the ground frame."""
        weather, site = campaign.weather, campaign.site
        stations = site.weather_station
        where = np.array(weather.station)
        start = float(campaign.shots.mjd_utc[0])
        table = np.stack([weather.temperature_c, weather.pressure_hpa, weather.humidity_percent], axis=1)
        heights = np.array([s.elevation_m - site.site.elevation_of_z0_m for s in stations])
        flat = np.ptp(heights) < DISTINCT_HEIGHTS
        lines = sounded_lines(campaign.path_temperatures)
        return cls(
            names=(*(s.name for s in stations), "gradient" if flat else "bend", *(line.name for line in lines)),
            sigmas=np.array(
                [settings.u_thermometer_c] * len(stations)
                + [settings.u_gradient_c_per_m if flat else settings.u_profile_c]
                + [line.sigma for line in lines]
            ),
            heights=heights,
            seconds=tuple((weather.mjd_utc[where == s.name] - start) * SECONDS_PER_DAY for s in stations),
            readings=tuple(table[where == s.name] for s in stations),
            start_mjd=start,
            wavelength_um=site.ranging.wavelength_um,
            model=settings.air_model,
            lines=lines,
        )

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The q parameters as values, in the order of `names`."""
        return (
            *(Parameter(ParameterKind.THERMOMETER, station) for station in self.stations),
            GRADIENT if self.profile == "gradient" else BEND,
            *(Parameter(ParameterKind.SOUND, *sorted(line.ends)) for line in self.lines),
        )

    @property
    def stations(self) -> tuple[str, ...]:
        """Names of the thermometers' offsets."""
        return self.names[: len(self.heights)]

    @property
    def profile(self) -> str:
        """Name of the profile's parameter: "bend" or "gradient"."""
        return self.names[len(self.heights)]

    @property
    def line_of_first(self) -> SoundedLine | None:
        """The line whose sound gives the temperature of the first path of `on_lines`; None where thermometers do."""
        if self.sounded is None or self.sounded[0] < 0:
            return None
        return self.lines[self.sounded[0]]

    def on_lines(self, mjd_utc: np.ndarray, ends: Sequence[frozenset[str]]) -> "AirField":
        """The same air for m paths in this order, each known by its two ends, so that sound can replace thermometers.

        mjd_utc   (m,) time of the shot
        ends      (m) names of ranger and target
        """
        if not self.lines:
            return self
        sounded = np.full(len(mjd_utc), -1)
        for i, line in enumerate(self.lines):
            mine = np.array([pair == line.ends for pair in ends], dtype=bool)
            sounded[mine & line.near(mjd_utc)] = i
        return replace(self, sounded=sounded)

    def smoothed(self, mjd_utc: np.ndarray) -> np.ndarray:
        """Temperature °C, pressure hPa, humidity % of each station: (m, stations, 3), by local straight lines.

        Humidity stays within 0 to 100 %: a line through readings near an end, or rounding in fog, leads beyond.
        """
        times = np.asarray(mjd_utc, dtype=float)
        asked = times.tobytes()  # pass after pass
        if asked not in self._smooth:
            t = (times - self.start_mjd) * SECONDS_PER_DAY
            state = np.stack(
                [_local_line(when, values, t) for when, values in zip(self.seconds, self.readings, strict=True)], axis=1
            )
            state[..., 2] = np.clip(state[..., 2], 0.0, 100.0)
            if len(self._smooth) >= MOST_KEPT:
                self._smooth.clear()
            self._smooth[asked] = state
        return self._smooth[asked]

    def along(self, mjd_utc: np.ndarray, a: np.ndarray, b: np.ndarray, parameters: np.ndarray) -> PathAir:
        """Mean group refractivity of straight paths, by Gauss-Legendre quadrature along them.

        mjd_utc      (m,) time of the shot
        a, b         (m, 3) ends in the ground frame, m
        parameters   (q,) values of `names`

        On a path of `sounded` lines the temperature is the sound's, everywhere along it: the mean of the index differs
        from the index of the mean by 4e-9 where the temperature scatters by 1 °C along the path.

        Source: README of the campaign layout: temperature linear between the stations and beyond, pressure falling
        by 0.11 hPa a metre ([PARKER04] section 1.4.2), relative humidity independent of height.
        """
        count = len(self.heights) + 1
        values = np.zeros((1 + len(self.names), len(mjd_utc)))
        profile = self._by_thermometers(np.asarray(mjd_utc, dtype=float), parameters[:count])
        try:
            values[: 1 + count] = mean_over_height(profile, a[:, 2], b[:, 2])
        except ValidityError as problem:
            raise InputError(self._impossible(np.asarray(mjd_utc, dtype=float), parameters[:count])) from problem
        for i, line in enumerate(self.lines if self.sounded is not None else ()):
            rows = np.flatnonzero(self.sounded == i)
            if len(rows):
                warm, share = line.at(mjd_utc[rows])
                profile = self._by_sound(mjd_utc[rows], parameters[:count], warm - share * parameters[count + i])
                means = mean_over_height(profile, a[rows, 2], b[rows, 2])
                values[: 1 + count, rows] = means[:-1]
                values[1 + count + i, rows] = -share * means[-1]
        return PathAir(values[0], values[1:].T)

    def _impossible(self, mjd_utc: np.ndarray, parameters: np.ndarray) -> str:
        """What the stations read at the shot's time where they are farthest from any air."""
        state, offsets = self.smoothed(mjd_utc), np.asarray(parameters[:-1])
        apart = np.ptp(state[..., 0] - offsets, axis=1) + 100.0 * np.any(state[..., 1] < LEAST_HPA, axis=1)
        k = int(np.argmax(apart))
        each = "; ".join(
            f"{name} {t:.1f} °C, {p:.1f} hPa, {h:.0f} %"
            + (f", which the ranges make {offset:+.1f} °C too warm" if abs(offset) > MUCH_C else "")
            for name, (t, p, h), offset in zip(self.stations, state[k], offsets, strict=True)
        )
        return (
            f"weather.csv: at {mjd_utc[k]:.5f} the stations read {each}: along the paths that makes air for which no "
            "index is known (see to these readings, or leave a station out of site.toml and weather.csv)"
        )

    def _by_thermometers(self, mjd_utc: np.ndarray, parameters: np.ndarray) -> Profile:
        """Refractivity at heights (m, k), and its derivatives by the stations and the profile: (2 + stations, m, k)."""
        weather = self._weather(mjd_utc, parameters)

        def profile(z: np.ndarray) -> np.ndarray:
            share, last, temperature, pressure, humidity = weather(z)
            index, above, below = (
                group_refractivity(
                    temperature + step, pressure, humidity, wavelength_um=self.wavelength_um, model=self.model
                )
                for step in (0.0, 0.5, -0.5)
            )
            per_c = above - below
            return np.concatenate([index[None], -per_c * np.moveaxis(share, -1, 0), (per_c * last)[None]])

        return profile

    def _by_sound(self, mjd_utc: np.ndarray, parameters: np.ndarray, warm: np.ndarray) -> Profile:
        """The same at the temperature `warm` (m,) °C all along the path, and then its derivative by that temperature.

        The vapour pressure stays what the stations' thermometers and hygrometers say: warming air does not wet it. In
        fog a line that sound finds colder would be a little more than saturated; the formulas are smooth there.
        """
        weather = self._weather(mjd_utc, parameters)
        chosen = MODELS[self.model]
        chosen.check(temperature_c=warm)

        def profile(z: np.ndarray) -> np.ndarray:
            share, last, temperature, pressure, humidity = weather(z)
            vapour, above, below = (
                vapour_pressure_hpa(temperature + step, pressure, humidity, chosen.vapour_formula)
                for step in (0.0, 0.5, -0.5)
            )
            state = (np.broadcast_to(warm[:, None], z.shape), pressure, vapour)
            partials = chosen.partials(*state, wavelength_um=self.wavelength_um, co2_ppm=chosen.co2_ppm)
            per_c = partials.vapour_pressure_hpa * (above - below)
            index = chosen.refractivity(*state, wavelength_um=self.wavelength_um, co2_ppm=chosen.co2_ppm)
            by_stations = -per_c * np.moveaxis(share, -1, 0)
            return np.concatenate([index[None], by_stations, (per_c * last)[None], partials.temperature_c[None]])

        return profile

    def _weather(self, mjd_utc: np.ndarray, parameters: np.ndarray) -> Callable[[np.ndarray], tuple[np.ndarray, ...]]:
        """Function of heights z (m, k): shares of the stations, profile, temperature °C, pressure hPa, humidity %."""
        state = self.smoothed(mjd_utc)
        middle = self.heights.mean()
        temperatures = state[:, :, 0] - parameters[:-1]
        pressure, humidity = state[:, None, :, 1].mean(axis=2), state[:, None, :, 2].mean(axis=2)

        def weather(z: np.ndarray) -> tuple[np.ndarray, ...]:
            share, last = self._shares(z)
            temperature = np.einsum("mks,ms->mk", share, temperatures) + parameters[-1] * last
            return share, last, temperature, pressure_at(pressure, middle, z), np.broadcast_to(humidity, z.shape)

        return weather

    def steepest(self, offsets: np.ndarray) -> float:
        """Mean temperature gradient from lowest to highest station, °C/m, offsets removed; 0 at one height."""
        if self.profile == "gradient":
            return 0.0
        mean = np.array([values[:, 0].mean() for values in self.readings]) - offsets
        low, high = int(np.argmin(self.heights)), int(np.argmax(self.heights))
        return float((mean[high] - mean[low]) / (self.heights[high] - self.heights[low]))

    def _shares(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How much each station counts at heights z (m, k): (m, k, stations); and the profile of the last parameter."""
        middle, span = self.heights.mean(), np.ptp(self.heights)
        count = len(self.heights)
        if self.profile == "gradient":
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
