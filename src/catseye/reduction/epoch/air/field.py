"""Air of a campaign as a field of the refractive index.

Made of the stations' records, a line in height, a process in time, and offsets to be estimated. Where sound
measured the mean temperature of a line (path_temperatures.csv), it replaces the thermometers in the index of the
line's shots near in time; pressure and vapour stay the stations'.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from catseye.atmosphere.index.air import MODELS, group_refractivity
from catseye.atmosphere.path.mean import nodes_along, pressure_at
from catseye.atmosphere.weather.humidity import vapour_pressure_hpa
from catseye.constants import SECONDS_PER_DAY
from catseye.errors import InputError, ValidityError
from catseye.estimation.series.trend import Trend
from catseye.records.night.campaign import ObservedSite
from catseye.reduction.epoch.air.process import LEVEL_HEIGHT, U_LAG, U_RADIATION, USUAL, AirKnots
from catseye.reduction.epoch.air.sounded import SoundedLine, sounded_lines
from catseye.reduction.epoch.air.stations import StationRecord, states_at, sunshine, temperature_equivalents
from catseye.reduction.epoch.parameter import BEND, GRADIENT, Parameter, ParameterKind
from catseye.reduction.epoch.settings import ReductionSettings

DISTINCT_HEIGHTS = 5.0  # m, stations closer in height than this show no gradient
CACHED_STATES = 64  # sets of times with cached states: one per ranger, and more
MUCH_C = 2.0  # °C, smallest reported offset of a thermometer
RARE_C = 42.0  # °C: air of desert afternoons; above it a unit is asked for where the weather is impossible
ALIKE_C = 12.0  # °C between the stations of a site
LEAST_HPA = 600.0
NODES = 5  # of the quadrature along a path: 1e-12 for straight profiles over 200 m
FAIR_SHARE = 0.3  # of a station's temperature in a path's, of two stations, from which the path determines it
HALF = 0.5  # °C, half the step of the numerical slopes


@dataclass(frozen=True, eq=False)
class PathAir:
    """Group refractivity averaged along m paths, with derivatives.

    refractivity     (m,) n_g - 1
    slopes           (m, q) by those of `AirField.names`: per °C of a thermometer's offset (positive: high), per °C
                     of bend (warmer half-way between the stations than on their line), per °C/m of gradient, or per °C
                     that the sound of a line reads too warm
    columns          (m, w) further parameters that each path depends on, counted in `AirField.parameters`, and
    column_slopes    (m, w) derivatives by them: per s of a thermometer's lag, per °C or °C/m of the process' knots
    """

    refractivity: np.ndarray
    slopes: np.ndarray
    columns: np.ndarray
    column_slopes: np.ndarray


@dataclass(frozen=True, eq=False)
class AirField:
    """Temperature, pressure and humidity by time and place.

    names     of the q constant parameters: one thermometer offset a station, "bend" or "gradient", then sounded lines
    sigmas    (q,) their prior standard uncertainties
    heights   (stations,) m, ground frame
    places    (stations, 2) m, east and north; zero where site.toml gives no place
    placed    (stations,) bool, True where it does
    records   of the stations
    knots     of the process in time
    sun       (2, n) s and the sine of the Sun's altitude then, 0 below the horizon; (2, 0) at night
    lines     where sound measured the temperature
    sounded   (m,) index into `lines` of each path given to `along`, -1 where none; None for no path at all
    """

    names: tuple[str, ...]
    sigmas: np.ndarray
    heights: np.ndarray
    places: np.ndarray
    placed: np.ndarray
    records: tuple[StationRecord, ...]
    knots: AirKnots
    sun: np.ndarray
    start_mjd: float
    wavelength_um: float
    model: str
    lines: tuple[SoundedLine, ...] = ()
    sounded: np.ndarray | None = None
    _states: dict[bytes, np.ndarray] = field(default_factory=dict)  # times: result of `states`

    @classmethod
    def of(cls, campaign: ObservedSite, settings: ReductionSettings) -> "AirField":
        """Air of a campaign; heights in the ground frame."""
        weather, site = campaign.weather, campaign.site
        stations = site.weather_station
        where = np.array(weather.station)
        start = float(campaign.shots.mjd_utc[0])
        table = np.stack([weather.temperature_c, weather.pressure_hpa, weather.humidity_percent], axis=1)
        heights = np.array([s.elevation_m - site.site.elevation_of_z0_m for s in stations])
        flat = bool(np.ptp(heights) < DISTINCT_HEIGHTS)
        lines = sounded_lines(campaign.path_temperatures)
        seconds = (weather.mjd_utc - start) * SECONDS_PER_DAY
        records = tuple(StationRecord.of(seconds[where == s.name], table[where == s.name]) for s in stations)
        shots = (campaign.shots.mjd_utc - start) * SECONDS_PER_DAY
        return cls(
            names=(*(s.name for s in stations), "gradient" if flat else "bend", *(line.name for line in lines)),
            sigmas=np.array(
                [settings.u_thermometer_c] * len(stations)
                + [settings.u_gradient_c_per_m if flat else settings.u_profile_c]
                + [line.sigma for line in lines]
            ),
            heights=heights,
            places=np.array([[s.x_m or 0.0, s.y_m or 0.0] for s in stations]),
            placed=np.array([s.x_m is not None and s.y_m is not None for s in stations]),
            records=records,
            knots=AirKnots.of(
                (float(shots.min()), float(shots.max())),
                len(shots),
                [r.temperature_c for r in records],
                _equivalents(
                    records, [s.name for s in stations], float(shots.mean()), site.ranging.wavelength_um, settings
                ),
                zeta=None if flat else _zeta(heights, heights),
            ),
            sun=sunshine(site.site, campaign.shots.mjd_utc, start),
            start_mjd=start,
            wavelength_um=site.ranging.wavelength_um,
            model=settings.air_model,
            lines=lines,
        )

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All parameters as values.

        Those of `names` in their order, lags of thermometers, by day what the Sun adds to them, knots of the
        process.
        """
        return (
            *(Parameter(ParameterKind.THERMOMETER, station) for station in self.stations),
            GRADIENT if self.profile == "gradient" else BEND,
            *(Parameter(ParameterKind.SOUND, *sorted(line.ends)) for line in self.lines),
            *(Parameter(kind, station) for kind in self.errors for station in self.stations),
            *(Parameter(ParameterKind.AIR, *label) for label in self.knots.labels),
        )

    @property
    def errors(self) -> tuple[ParameterKind, ...]:
        """Kinds of error of each thermometer beside its offset."""
        return (ParameterKind.LAG, ParameterKind.RADIATION) if self.sun.shape[1] else (ParameterKind.LAG,)

    @property
    def first_knot(self) -> int:
        """Index of the process's first parameter."""
        return len(self.names) + len(self.errors) * len(self.heights)

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
        """Line whose sound gives the temperature of the first path.

        The first path of `on_lines`; None where thermometers do.
        """
        if self.sounded is None or self.sounded[0] < 0:
            return None
        return self.lines[self.sounded[0]]

    def on_lines(self, mjd_utc: np.ndarray, ends: Sequence[frozenset[str]]) -> "AirField":
        """Air for m paths identified by their two ends.

        On such paths sound can replace thermometers.

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
        """Weather of each station by its records' states.

        Temperature °C, pressure hPa, humidity %: (m, stations, 3).
        """
        times = np.asarray(mjd_utc, dtype=float)
        key = times.tobytes()  # the same in every pass
        if key not in self._states:
            if len(self._states) >= CACHED_STATES:
                self._states.clear()
            self._states[key] = states_at(self.records, self.seconds(times))
        return self._states[key]

    def seconds(self, mjd_utc: np.ndarray) -> np.ndarray:
        """Times in seconds since the first shot."""
        return (np.asarray(mjd_utc, dtype=float) - self.start_mjd) * SECONDS_PER_DAY

    def along(self, mjd_utc: np.ndarray, a: np.ndarray, b: np.ndarray, parameters: np.ndarray) -> PathAir:
        """Mean group refractivity of straight paths, by Gauss-Legendre quadrature.

        mjd_utc      (m,) time of the shot
        a, b         (m, 3) ends in the ground frame, m
        parameters   (p,) values of `parameters`, or of the first of them: the others are zero

        On a path of `sounded` lines the sound's temperature applies everywhere along it: the mean of the index differs
        from the index of the mean by 4e-9 where the temperature scatters by 1 °C along the path.

        Source: README of the campaign layout: temperature linear between the stations and beyond, pressure falling
        by 0.11 hPa a metre ([PARKER04] section 1.4.2), relative humidity independent of height; the process of
        `air.process` on top.
        """
        values = np.zeros(self.count)
        values[: len(parameters)] = parameters
        m, q, s, first = len(mjd_utc), len(self.names), len(self.heights), self.first_knot
        columns, share = self.knots.columns(self.seconds(mjd_utc))
        process_columns = np.broadcast_to(np.arange(q, first), (m, first - q))
        columns = np.concatenate([process_columns, columns + first], axis=1)
        path = PathAir(np.zeros(m), np.zeros((m, q)), columns, np.zeros(columns.shape))
        state = _Weather.of(self, np.asarray(mjd_utc, dtype=float), values, share)
        all_rows = np.arange(m)
        try:
            self._into(path, all_rows, state, self._by_thermometers, a, b)
        except ValidityError as problem:
            raise InputError(self._impossible(np.asarray(mjd_utc, dtype=float), values[: s + 1])) from problem
        for i, line in enumerate(self.lines if self.sounded is not None else ()):
            rows = np.flatnonzero(self.sounded == i)
            if len(rows):
                warm, process_columns = line.at(mjd_utc[rows])
                warm = warm - process_columns * values[s + 1 + i]
                by_sound = self._into(path, rows, state.of_rows(rows), partial(self._by_sound, warm), a[rows], b[rows])
                path.slopes[rows, s + 1 + i] = -process_columns * by_sound
        return path

    def refractivity_of(self, *weather: np.ndarray, wavelength_um: float | None = None) -> np.ndarray:
        """Group refractivity by the campaign's formula and wavelength.

        Temperature °C, pressure hPa, humidity %.
        """
        light = self.wavelength_um if wavelength_um is None else wavelength_um
        return np.asarray(group_refractivity(*weather, wavelength_um=light, model=self.model))

    @property
    def count(self) -> int:
        """Number p of all parameters."""
        return self.first_knot + self.knots.count

    def u_unread(self, path: PathAir) -> np.ndarray:
        """Standard uncertainty (m,) of paths' refractivity by all errors in time.

        The strengths of these errors are those of experience.
        """
        errors = self.first_knot - len(self.names)
        u = np.repeat([U_LAG, U_RADIATION][: len(self.errors)], len(self.heights))
        variance = np.sum((path.column_slopes[:, :errors] * u) ** 2, axis=1)
        between, across = self.knots.covariances(USUAL)
        columns, slopes = path.columns[:, errors:] - self.first_knot, path.column_slopes[:, errors:]
        pairs = columns[:, :4, None], columns[:, None, :4]
        variance += np.einsum("mi,mij,mj->m", slopes[:, :4], between[pairs], slopes[:, :4])
        for k in (4, 6):  # east, north
            at = columns[:, k : k + 2] - columns[:, k : k + 1] + self.knots.first_across(columns[:, k], k == 6)[:, None]
            variance += np.einsum(
                "mi,mij,mj->m", slopes[:, k : k + 2], across[at[:, :, None], at[:, None]], slopes[:, k : k + 2]
            )
        return np.asarray(np.sqrt(variance))

    def _into(
        self,
        path: PathAir,
        rows: np.ndarray,
        state: "_Weather",
        index: Callable[["_Weather", "_Nodes"], tuple[np.ndarray, ...]],
        a: np.ndarray,
        b: np.ndarray,
    ) -> np.ndarray:
        """Fill some rows of a path's refractivity and slopes.

        Returns the mean slope by sound's temperature, or None.
        """
        nodes = _Nodes.of(self, a, b)
        refractivity, per_c, *by_sound = index(state, nodes)
        s, weight = len(self.heights), nodes.weight
        path.refractivity[rows] = refractivity @ weight
        weighed = per_c * weight
        by_station = np.einsum("mk,mks->ms", weighed, nodes.share)
        path.slopes[rows] = 0.0
        path.slopes[np.ix_(rows, np.arange(s))] = -by_station
        path.slopes[rows, s] = np.sum(weighed * nodes.profile, axis=1)
        path.column_slopes[np.ix_(rows, np.arange(s))] = by_station * state.rate
        path.column_slopes[np.ix_(rows, np.arange(s, s * len(self.errors)))] = np.tile(
            -by_station * state.sun[:, None], len(self.errors) - 1
        )
        at_stations = by_station @ self.places
        parts = [
            weighed.sum(axis=1),
            np.sum(weighed * nodes.zeta, axis=1),
            np.sum(weighed * nodes.east, axis=1) - at_stations[:, 0],
            np.sum(weighed * nodes.north, axis=1) - at_stations[:, 1],
        ]
        by_part = np.stack(parts, axis=1)
        shares = np.stack([by_part * (1.0 - state.share), by_part * state.share], axis=2)
        path.column_slopes[np.ix_(rows, s * len(self.errors) + np.arange(8))] = shares.reshape(len(rows), 8)
        return by_sound[0] @ weight if by_sound else np.zeros(0)

    def _impossible(self, mjd_utc: np.ndarray, parameters: np.ndarray) -> str:
        """Station readings farthest from valid air, as an error text."""
        state, offsets = self.smoothed(mjd_utc), np.asarray(parameters[:-1])
        apart = np.ptp(state[..., 0] - offsets, axis=1) + 100.0 * np.any(state[..., 1] < LEAST_HPA, axis=1)
        k = int(np.argmax(apart))
        readings = "; ".join(
            f"{name} {t:.1f} °C{_hot(t)}, {p:.1f} hPa, {h:.0f} %"
            + (f", by the ranges {offset:+.1f} °C too warm{_unit_of(t, offset)}" if abs(offset) > MUCH_C else "")
            for name, (t, p, h), offset in zip(self.stations, state[k], offsets, strict=True)
        )
        temperature, pressure = state[k, :, 0], state[k, :, 1]
        ordinary = np.ptp(temperature) < ALIKE_C and temperature.max() < RARE_C and pressure.min() > LEAST_HPA
        begin = f"at {mjd_utc[k]:.5f} the stations read {readings}: "
        if ordinary and np.all(np.abs(offsets) < MUCH_C):
            return (
                f"weather.csv: {begin}ordinary air, but the ranges ask for air along a path beyond the limits of the "
                "index formula (another record is wrong by many times its u, or many shots are: check surveys, typed "
                "positions, mirrors)"
            )
        misled = [o for t, o in zip(temperature, offsets, strict=True) if abs(o) > MUCH_C and not _unit_of(t, o)]
        where = "weather.csv or another record" if misled else "weather.csv"
        others = ", and typed positions, frequency and zeros, with which the ranges fit no air" if misled else ""
        return (
            f"{where}: {begin}along the paths these exceed the limits of the index formula (check these "
            f"readings{others}, or leave a station out of site.toml and weather.csv)"
        )

    def _by_thermometers(self, state: "_Weather", nodes: "_Nodes") -> tuple[np.ndarray, ...]:
        """Refractivity at nodes (m, k), and its derivative by temperature."""
        temperature, pressure, humidity = state.at(nodes)
        index, above, below = (
            group_refractivity(
                temperature + step, pressure, humidity, wavelength_um=self.wavelength_um, model=self.model
            )
            for step in (0.0, HALF, -HALF)
        )
        return index, above - below

    def _by_sound(self, warm: np.ndarray, state: "_Weather", nodes: "_Nodes") -> tuple[np.ndarray, ...]:
        """Refractivity at nodes by the sound's temperature.

        `warm` (m,) °C applies all along the path; also returns both derivatives, by temperature and by `warm`.

        The vapour pressure stays that of the stations' thermometers and hygrometers: warming adds no vapour. In fog
        a line that is colder by sound would be a little more than saturated; the formulas are smooth there.
        """
        chosen = MODELS[self.model]
        chosen.check(temperature_c=warm)
        temperature, pressure, humidity = state.at(nodes)
        vapour, above, below = (
            vapour_pressure_hpa(temperature + step, pressure, humidity, chosen.vapour_formula)
            for step in (0.0, HALF, -HALF)
        )
        at = (np.broadcast_to(warm[:, None], temperature.shape), pressure, vapour)
        partials = chosen.partials(*at, wavelength_um=self.wavelength_um, co2_ppm=chosen.co2_ppm)
        index = chosen.refractivity(*at, wavelength_um=self.wavelength_um, co2_ppm=chosen.co2_ppm)
        return index, partials.vapour_pressure_hpa * (above - below), partials.temperature_c

    def steepest(self, values: np.ndarray) -> float:
        """Mean temperature gradient from lowest to highest station, °C/m.

        0 where all stations have one height.

        values   of the thermometers' offsets, or of all `parameters`: then the site's estimated gradient is subtracted
        """
        if self.profile == "gradient":
            return 0.0
        mean = np.array([r.temperature_c.level.mean() for r in self.records]) - values[: len(self.heights)]
        if len(values) == self.count:
            mean = mean - self.places @ self.across(values)
        low, high = int(np.argmin(self.heights)), int(np.argmax(self.heights))
        return float((mean[high] - mean[low]) / (self.heights[high] - self.heights[low]))

    def seen_from(self, heights: np.ndarray) -> np.ndarray:
        """True per station that contributes fairly to paths at these heights.

        (stations,) bool; heights (k,) m.
        """
        if not len(heights):
            return np.zeros(len(self.heights), dtype=bool)
        return np.asarray(
            np.max(self._shares(heights[None])[0][0], axis=0) > FAIR_SHARE * min(1.0, 2.0 / len(self.heights))
        )

    def across(self, values: np.ndarray) -> np.ndarray:
        """Mean gradient towards east and north, (2,) °C/m.

        values (p,) of `parameters`.
        """
        knots = values[self.first_knot :][-2 * len(self.knots.across) :]
        return np.asarray(knots.reshape(2, -1).mean(axis=1))

    def _shares(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Weight of each station at heights z (m, k).

        (m, k, stations); and the profile of the last parameter.
        """
        middle, span = self.heights.mean(), np.ptp(self.heights)
        count = len(self.heights)
        if self.profile == "gradient":
            return np.full((*z.shape, count), 1.0 / count), z - middle
        design = np.stack([np.ones(count), self.heights - middle], axis=1)
        line = np.linalg.pinv(design)
        share = line[0] + (z - middle)[..., None] * line[1]
        low, high = self.heights.min(), self.heights.max()
        return share, 4.0 * (z - low) * (high - z) / span**2


@dataclass(frozen=True, eq=False)
class _Nodes:
    """Quadrature nodes (m, k) along m paths, with their weights.

    The weights of stations and process at each node.
    """

    z: np.ndarray
    east: np.ndarray
    north: np.ndarray
    zeta: np.ndarray
    share: np.ndarray
    profile: np.ndarray
    weight: np.ndarray

    @staticmethod
    def of(field: AirField, a: np.ndarray, b: np.ndarray) -> "_Nodes":
        east, north, z = (nodes_along(a[:, i], b[:, i], NODES)[0] for i in range(3))
        share, profile = field._shares(z)
        heights = field.heights
        zeta = (z - heights.mean()) / LEVEL_HEIGHT if field.profile == "gradient" else _zeta(z, heights)
        return _Nodes(
            z=z, east=east, north=north, zeta=zeta, share=share, profile=profile, weight=nodes_along(0.0, 1.0, NODES)[1]
        )


def _equivalents(
    records: Sequence[StationRecord],
    stations: Sequence[str],
    seconds: float,
    wavelength_um: float,
    settings: ReductionSettings,
) -> list[tuple[Trend, float]]:
    """Temperature equivalents of pressure and humidity; InputError for readings that no index formula covers."""
    try:
        return temperature_equivalents(records, seconds, wavelength_um=wavelength_um, model=settings.air_model)
    except ValidityError as problem:
        readings = "; ".join(
            f"{name} {t:.1f} °C{_hot(t)}, {p:.1f} hPa, {h:.0f} %"
            for name, (t, p, h) in zip(stations, states_at(records, np.array([seconds]))[0], strict=True)
        )
        raise InputError(
            f"weather.csv: in the middle of the shots the stations read {readings}: {problem} (check these readings, "
            "or leave a station out of site.toml and weather.csv)"
        ) from problem


def _hot(reading_c: float) -> str:
    """Reading that few sites ever have, as degrees Fahrenheit.

    >>> _hot(50.0), _hot(30.0)
    (' (10.0 °C if these are degrees Fahrenheit)', '')
    """
    return f" ({(reading_c - 32.0) / 1.8:.1f} °C if these are degrees Fahrenheit)" if reading_c > RARE_C else ""


def _unit_of(reading_c: float, offset_c: float) -> str:
    """Unit of a reading that is too warm by about as much as degrees Fahrenheit are.

    The ranges know so large an offset to a fifth, as the adjustment stops where the index formula ends.

    >>> _unit_of(13.8, 23.8), _unit_of(44.0, 32.5), _unit_of(13.8, 10.0)
    (': looks like degrees Fahrenheit', ': looks like degrees Fahrenheit', '')
    """
    excess = reading_c - (reading_c - 32.0) / 1.8
    return ": looks like degrees Fahrenheit" if abs(offset_c - excess) < max(MUCH_C, 0.2 * excess) else ""


@dataclass(frozen=True, eq=False)
class _Weather:
    """Stations' weather at m times, offsets and process applied.

    temperature         (m, stations) °C, of the stations' air reduced to the middle of the site
    rate                (m, stations) °C/s
    pressure, humidity  (m,) hPa at the stations' mean height, %
    process             (m, 4) of `PARTS`
    sun                 (m,) sine of its altitude
    profile             value of the profile's parameter
    share               (m, 4) position of each time between its knot and the next, 0 to 1
    middle              m, mean height of the stations
    """

    temperature: np.ndarray
    rate: np.ndarray
    pressure: np.ndarray
    humidity: np.ndarray
    process: np.ndarray
    sun: np.ndarray
    profile: float
    share: np.ndarray
    middle: float

    @staticmethod
    def of(field: AirField, mjd_utc: np.ndarray, values: np.ndarray, share: np.ndarray) -> "_Weather":
        state, seconds = field.smoothed(mjd_utc), field.seconds(mjd_utc)
        q, s = len(field.names), len(field.heights)
        sun = np.interp(seconds, *field.sun) if field.sun.shape[1] else np.zeros(len(seconds))
        errors = values[q : field.first_knot].reshape(-1, s)
        rate = np.stack([r.temperature_c.rate_at(seconds) for r in field.records], axis=1)
        knots = values[field.first_knot :][field.knots.columns(seconds)[0]].reshape(len(seconds), 4, 2)
        process = knots[:, :, 0] * (1.0 - share) + knots[:, :, 1] * share
        temperature = state[:, :, 0] - values[:s] + errors[0] * rate - process[:, 2:] @ field.places.T
        if len(errors) > 1:
            temperature = temperature - errors[1] * sun[:, None]
        return _Weather(
            temperature=temperature,
            rate=rate,
            pressure=state[:, :, 1].mean(axis=1),
            humidity=state[:, :, 2].mean(axis=1),
            process=process,
            sun=sun,
            profile=float(values[s]),
            share=share,
            middle=float(field.heights.mean()),
        )

    def of_rows(self, rows: np.ndarray) -> "_Weather":
        """Weather at some of the times."""
        selected = {
            n: getattr(self, n)[rows]
            for n in ("temperature", "rate", "pressure", "humidity", "process", "sun", "share")
        }
        return replace(self, **selected)

    def at(self, nodes: _Nodes) -> tuple[np.ndarray, ...]:
        """Temperature °C, pressure hPa, humidity % at nodes (m, k)."""
        level, slope, east, north = self.process.T[:, :, None]
        temperature = np.einsum("mks,ms->mk", nodes.share, self.temperature) + self.profile * nodes.profile
        temperature = temperature + level + slope * nodes.zeta + east * nodes.east + north * nodes.north
        pressure = pressure_at(self.pressure[:, None], self.middle, nodes.z)
        return temperature, pressure, np.broadcast_to(self.humidity[:, None], nodes.z.shape)


def _zeta(z: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """Height scaled to 1 at the highest station, -1 at the lowest."""
    return np.asarray((z - 0.5 * (heights.min() + heights.max())) / (0.5 * np.ptp(heights)))
