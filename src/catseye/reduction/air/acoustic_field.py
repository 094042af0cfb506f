"""Temperature and wind field from travel times of sound.

Between loudspeakers and microphones at known places; also the index along a laser's path there.

Each travel time is the mean of the temperature along its path plus the wind's effect, over the derivative of the
speed by the temperature (`estimation.shapes.tomography`). Places, delay, pressure, humidity and the formula's own
departure are parameters with priors that all paths share. Neglected: variances along a path, 0.003 °C for 1
K rms and 0.007 °C for 1 m/s rms (`atmosphere.sound.path`), and bent rays.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from catseye.atmosphere.index.air import air
from catseye.atmosphere.limit import ValidInterval, check_spreads
from catseye.atmosphere.sound.dispersion import dispersion
from catseye.atmosphere.sound.speed import THERMOMETRY, model_named, sound, temperatures_c
from catseye.errors import EstimationError, ValidityError
from catseye.estimation.shapes.tomography import FieldPrior, LineMeans, Lines, Tomogram, tomogram
from catseye.names import AIR_MODEL
from catseye.reduction.air.acoustic import LENGTH, NO_TIME, OUTSIDE, USED, StationAir

PASSES = 6  # the wind is subtracted from the speed exactly, again with each better wind
CLOSE_ENOUGH_C = 1e-6
NO_SOUND_TIME = "no travel time of {} is that of sound in air; check the delay and the places"
WINDIEST = 60.0  # m/s, largest joint effect of unexpected wind and temperature
LINE = ValidInterval("length of the line", "m", 0.0, 10_000.0, "the notion of a path", places=1)
COMMON = ("delay", "pressure", "humidity", "carbon dioxide", "dispersion", "formula")  # after places of stations
UNLIKELY = 1e-3  # chance of so large a chi-square, below which the priors do not fit


@dataclass(frozen=True, eq=False)
class LineAir:
    """Air along t straight lines.

    temperature_c          (t,) mean, °C
    covariance_c2          (t, t)
    wind                   (t, 3) mean, m/s; nan without a prior of the wind
    u_wind                 (t, 3)
    group_refractivity     (t,) n_g - 1
    u_group_refractivity   (t,) all sources, the formula of the index included
    resolution             (t,) 0: the sound adds nothing to the prior; 1: the prior is negligible
    """

    temperature_c: np.ndarray
    covariance_c2: np.ndarray
    wind: np.ndarray
    u_wind: np.ndarray
    group_refractivity: np.ndarray
    u_group_refractivity: np.ndarray
    resolution: np.ndarray

    @property
    def u_temperature_c(self) -> np.ndarray:
        """Standard uncertainty of each temperature, (t,) °C."""
        return np.sqrt(np.diag(self.covariance_c2))


@dataclass(frozen=True, eq=False)
class SoundField:
    """Temperature and wind between an array's stations, from its times.

    tomogram   the estimate, its observations those used
    status     a text for each input time: `used`, or the reason of rejection
    used       indices of the times used; `suspects` point into these input times
    weather    pressure hPa, relative humidity % and carbon dioxide ppm assumed
    """

    tomogram: Tomogram
    status: tuple[str, ...]
    used: np.ndarray
    weather: tuple[float, float, float]

    @property
    def fit(self) -> str:
        """Consistency of times and priors: "fits", or a text with the remedy."""
        from scipy.special import chdtrc

        chi_square, count = self.tomogram.chi_square, len(self.used)
        if chdtrc(count, chi_square) >= UNLIKELY:
            return "fits"
        return (
            f"chi-square {chi_square:.0f} of {count} times: field and wind vary more than their priors, and the "
            "uncertainties are too small; give larger scales, or leave out the suspects"
        )

    @property
    def suspects(self) -> np.ndarray:
        """Indices of the input times that contradict the others."""
        return self.used[self.tomogram.suspects]

    def along(
        self, start: ArrayLike, end: ArrayLike, *, wavelength_um: float = 0.780, air_model: str = AIR_MODEL
    ) -> LineAir:
        """Temperature, wind and group refractivity along straight lines.

        Such as those of lasers.

        start, end      (t, 3) or (3,), m
        wavelength_um   of the light
        air_model       a name in `atmosphere.index.air.MODELS`

        Pressure and humidity are one for all lines, those of the station, corrected by the sound.
        """
        lines = Lines(np.atleast_2d(np.asarray(start, float)), np.atleast_2d(np.asarray(end, float)))
        LINE.check(np.linalg.norm(lines.end - lines.start, axis=1))
        means = self.tomogram.scalar_along(lines)
        at = len(means.parameters) - len(COMMON) + np.array([COMMON.index("pressure"), COMMON.index("humidity")])
        p, h, co2_ppm = self.weather
        light = air(means.value, p, h, wavelength_um=wavelength_um, model=air_model, co2_ppm=co2_ppm)
        slopes = light.sensitivity
        direct = np.stack([slopes.pressure_hpa, slopes.humidity_percent], axis=1)  # (t, 2)
        block = self.tomogram.parameter_covariance()[np.ix_(at, at)]
        variance = (
            slopes.temperature_c**2 * np.diag(means.covariance)
            + 2.0 * slopes.temperature_c * np.sum(direct * means.cross[:, at], axis=1)
            + np.einsum("ti,ij,tj->t", direct, block, direct)
            + light.standard_uncertainty**2
        )
        wind, u_wind = self._wind(lines)
        return LineAir(
            temperature_c=means.value,
            covariance_c2=means.covariance,
            wind=wind,
            u_wind=u_wind,
            group_refractivity=light.group_refractivity + direct @ means.parameters[at],
            u_group_refractivity=np.sqrt(variance),
            resolution=means.resolution,
        )

    def _wind(self, lines: Lines) -> tuple[np.ndarray, np.ndarray]:
        count = len(lines.start)
        if self.tomogram.vector is None:
            undefined = np.full((count, 3), np.nan)
            return undefined, undefined
        means = [self.tomogram.vector_along(lines, np.tile(axis, (count, 1))) for axis in np.eye(3)]
        return np.stack([m.value for m in means], axis=1), np.stack([m.u for m in means], axis=1)


@dataclass(frozen=True, eq=False)
class FieldTimes:
    """Travel times between the stations of an array, m of them.

    source, receiver   (m,) sending and receiving station
    time               (m,) s, delay included; nan without one
    u_time             one or (m,), s: noise of each
    delay, u_delay     s, of the equipment, common to all
    """

    source: ArrayLike
    receiver: ArrayLike
    time: ArrayLike
    u_time: ArrayLike
    delay: float = 0.0
    u_delay: float = 0.0


def sound_field(
    stations: ArrayLike,
    times: FieldTimes,
    *,
    u_position: float,
    weather: StationAir,
    temperature: FieldPrior,
    wind: FieldPrior | None,
    frequency_hz: float = 0.0,
    model: str = THERMOMETRY,
) -> SoundField:
    """Temperature and wind field from travel times of sound.

    Between loudspeakers and microphones.

    stations       (n, 3) m, places of loudspeakers and microphones
    times          between them
    u_position     m, of each coordinate of each station: shared by all its paths
    weather        pressure and humidity of the air, one number each: common to all
    temperature    prior of the field, °C
    wind           prior of each component of the wind, m/s, expected 0; None for still air
    frequency_hz   of the sound: air's dispersion is subtracted, a share of it is uncertain
    model          a name in `atmosphere.sound.speed.MODELS`

    Source: exact geometry of `atmosphere.sound.path`, [TARANTOLA05] for the estimate; linearised about each path's own
    temperature and wind, iterated to convergence. Raises ValidityError for weather and shapes, EstimationError
    where no time remains, or where temperature and wind do not settle.
    """
    places, time = np.asarray(stations, float), np.asarray(times.time, float)
    source, receiver, u_time = _ends(places, times, time)
    formula = float(
        np.max(
            sound(
                temperature.mean, weather.pressure_hpa, weather.humidity_percent, model=model, co2_ppm=weather.co2_ppm
            ).standard_uncertainty
        )
    )
    sigmas = _sigmas(places.size, u_time, times.u_delay, u_position, weather, formula)
    ray = places[receiver] - places[source]
    LENGTH.check(np.linalg.norm(ray, axis=1))
    if temperature.u_mean <= 0.0 and not temperature.scales:
        raise ValidityError("the temperature's prior leaves nothing to estimate; give u_mean or scales")
    good = np.isfinite(time) & (time > times.delay)
    status = np.where(good, USED, NO_TIME).astype(object)
    paths = _Paths(places, source, receiver, time - times.delay, u_time)
    pressure_hpa, humidity_percent = (float(np.asarray(v)) for v in (weather.pressure_hpa, weather.humidity_percent))
    values = (pressure_hpa, humidity_percent, weather.co2_ppm, frequency_hz)
    at, blown = np.full(len(time), temperature.mean), np.zeros((len(time), 3))
    before = np.full(len(time), np.inf)
    limit = model_named(model).limits["temperature_c"]
    for turn in range(PASSES):
        if not np.any(good):
            raise EstimationError(NO_SOUND_TIME.format(len(time)))
        usable = paths.only(np.flatnonzero(good))
        observed, along, design, outside = usable.linearised(at[good], blown[good], values, model, first=turn == 0)
        if np.any(outside):
            removed = np.flatnonzero(good)[outside]
            status[removed], good[removed] = OUTSIDE, False
            usable = paths.only(np.flatnonzero(good))
            observed, along, design = observed[~outside], along[~outside], design[~outside]
        if not np.any(good):
            raise EstimationError(NO_SOUND_TIME.format(len(time)))
        noise = np.diag((usable.per_second(along) * usable.u_time) ** 2)
        along = np.zeros_like(along) if wind is None else along
        estimate = tomogram(
            LineMeans(
                lines=usable.lines, observed=observed, covariance=noise, along=along, design=design, sigmas=sigmas
            ),
            temperature,
            wind,
        )
        at[good] = estimate.scalar_along(usable.lines).value
        if wind is not None:
            axes = [np.tile(axis, (len(observed), 1)) for axis in np.eye(3)]
            blown[good] = np.stack([estimate.vector_along(usable.lines, axis).value for axis in axes], axis=1)
        out_of_limits = good & ~((at >= limit.lower) & (at <= limit.upper))
        status[out_of_limits], good[out_of_limits] = OUTSIDE, False
        if not np.any(out_of_limits) and np.max(np.abs(at[good] - before[good])) < CLOSE_ENOUGH_C:
            break
        before = at.copy()
    else:
        raise EstimationError(f"temperature and wind do not settle in {PASSES} passes; remove the most deviating times")
    return SoundField(estimate, tuple(str(s) for s in status), np.flatnonzero(good), values[:3])


def _sigmas(
    coordinates: int, u_time: np.ndarray, u_delay: float, u_position: float, weather: StationAir, formula: float
) -> np.ndarray:
    """Standard uncertainties of the paths' common parameters.

    Coordinates of the stations, then `COMMON`.
    """
    check_spreads(
        u_time=u_time,
        u_position=u_position,
        u_delay=u_delay,
        u_pressure_hpa=weather.u_pressure_hpa,
        u_humidity_percent=weather.u_humidity_percent,
        u_co2_ppm=weather.u_co2_ppm,
    )
    of_weather = [weather.u_pressure_hpa, weather.u_humidity_percent, weather.u_co2_ppm]
    return np.concatenate([np.full(coordinates, u_position), [u_delay, *of_weather, 1.0, formula]])


def _ends(stations: np.ndarray, times: FieldTimes, time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Source, receiver and noise of each time, (m,) each.

    ValidityError for other shapes and unknown stations.
    """
    if stations.ndim != 2 or stations.shape[1] != 3:
        raise ValidityError(f"stations have the shape {stations.shape} (expected (n, 3), m)")
    ends = []
    for name, columns in (("source", times.source), ("receiver", times.receiver)):
        index = np.asarray(columns)
        if time.ndim != 1 or index.shape != time.shape:
            raise ValidityError(f"{name} has the shape {index.shape}, time {time.shape} (expected (m,) both)")
        if index.dtype.kind not in "iu" or np.any((index < 0) | (index >= len(stations))):
            raise ValidityError(f"{name} is not a list of station numbers from 0 to {len(stations) - 1}")
        ends.append(index.astype(int))
    u_time = np.asarray(times.u_time, float)
    if u_time.shape not in ((), time.shape):
        raise ValidityError(f"u_time has the shape {u_time.shape} (expected one, or {time.shape})")
    source, receiver = ends
    return source, receiver, np.broadcast_to(u_time, time.shape)


@dataclass(frozen=True, eq=False)
class _Paths:
    """Paths between stations, with the sound's times on them."""

    stations: np.ndarray
    source: np.ndarray
    receiver: np.ndarray
    time: np.ndarray
    u_time: np.ndarray

    def only(self, rows: np.ndarray) -> "_Paths":
        return _Paths(self.stations, self.source[rows], self.receiver[rows], self.time[rows], self.u_time[rows])

    @property
    def lines(self) -> Lines:
        return Lines(self.stations[self.source], self.stations[self.receiver])

    @property
    def speed(self) -> np.ndarray:
        return np.linalg.norm(self.lines.end - self.lines.start, axis=1) / self.time

    def per_second(self, along: np.ndarray) -> np.ndarray:
        """Temperature per second of travel time, °C."""
        return along * self.speed / self.time

    def linearised(self, at: np.ndarray, blown: np.ndarray, values: tuple, model: str, *, first: bool) -> tuple:
        """Each time as a mean temperature, (m,) °C, with slopes.

        °C per m/s of wind along it, °C per parameter; and which are of no air.

        In the first pass about the prior's temperature, since an unknown wind may look like no air.
        """
        p, h, co2_ppm, frequency_hz = values
        lines = self.lines
        along = np.sum(blown * lines.directions, axis=1)
        across = np.sum(blown**2, axis=1) - along**2
        speed = np.hypot(self.speed - along, np.sqrt(np.maximum(across, 0.0)))
        state = sound(at, p, h, model=model, co2_ppm=co2_ppm)
        per_speed = 1.0 / state.sensitivity.temperature_c
        if first:
            temperature = at + (speed - state.speed) * per_speed
            outside = np.abs(speed - state.speed) > WINDIEST
        else:
            temperature = np.atleast_1d(
                temperatures_c(
                    speed, p, h, vapour_pressure_hpa=None, model=model, co2_ppm=co2_ppm, frequency_hz=frequency_hz
                )
            )
            outside = np.isnan(temperature)
            at = np.where(outside, at, temperature)
            state = sound(at, p, h, model=model, co2_ppm=co2_ppm)
            per_speed = 1.0 / state.sensitivity.temperature_c
        late = dispersion(at, p, state.vapour_pressure_hpa, frequency_hz=frequency_hz).of_a_pulse()[
            1
        ]  # its u, relative
        by_along = per_speed * (self.speed - along) / speed
        by_length = (by_along / self.time)[:, None] * lines.directions
        rows = np.arange(len(self.time))
        places = np.zeros((len(rows), *self.stations.shape))
        places[rows, self.source] += by_length
        places[rows, self.receiver] -= by_length
        common = np.stack(
            [
                -by_along * self.speed / self.time,
                per_speed * state.sensitivity.pressure_hpa,
                per_speed * state.sensitivity.humidity_percent,
                per_speed * state.sensitivity.co2_ppm,
                -per_speed * speed * late,
                per_speed,
            ],
            axis=1,
        )
        design = np.concatenate([places.reshape(len(rows), self.stations.size), common], axis=1)
        return temperature + by_along * along, by_along, design, outside
