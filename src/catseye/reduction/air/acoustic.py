"""Air temperature along a path by sound, and the light's index there.

From travel times of sound.

Two directions at once give the wind and take it out (`atmosphere.sound.path`); one needs a wind from another source.
Errors common to all measurements of a path are modelled as common: its length, the delay of loudspeaker and microphone,
the station's pressure and humidity, the crosswind, the bend of the ray, the formula itself. Only the times are
independent.

Source: [PARKER04] chapter 4 (delay by correlation, both directions).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from catseye.atmosphere.index.air import AirState, air
from catseye.atmosphere.limit import ValidInterval, check_spreads
from catseye.atmosphere.sound.dispersion import dispersion
from catseye.atmosphere.sound.path import WIND, bent_ray_excess, pair, straight_line_speed
from catseye.atmosphere.sound.speed import MODELS, THERMOMETRY, Sound, model_named, sound, temperatures_c
from catseye.atmosphere.weather import humidity
from catseye.errors import ValidityError
from catseye.names import AIR_MODEL

USED = "used"
NO_TIME = "no travel time"
OUTSIDE = "speed of no air within the model's limits"
NO_WIND = f"wind above {WIND.upper:g} m/s: the two times do not belong together"

LENGTH = ValidInterval("length of the path", "m", 0.1, 10_000.0, "the notion of a path", places=1)
DELAY = ValidInterval("delay", "s", -1.0, 1.0, "the notion of a delay")
GRADIENT = ValidInterval("gradient of the speed", "1/s", -10.0, 10.0, "the notion of a smoothly bent ray")


@dataclass(frozen=True, eq=False)
class StationAir:
    """Air at a weather station; its errors are common to all times.

    pressure_hpa         one or (k,), with u_pressure_hpa
    humidity_percent     relative, one or (k,), with u_humidity_percent
    co2_ppm, u_co2_ppm   carbon dioxide
    """

    pressure_hpa: ArrayLike
    u_pressure_hpa: float
    humidity_percent: ArrayLike
    u_humidity_percent: float
    co2_ppm: float = 450.0
    u_co2_ppm: float = 20.0


@dataclass(frozen=True, eq=False)
class SoundLine:
    """Line between loudspeaker and microphone.

    And the propagation of sound on it; uncertainties common to all times.

    length, u_length     m, of the path, one or (k,)
    delay, u_delay       s, of the equipment, subtracted from each time
    speed_gradient       1/s across the path, with u_speed_gradient: rays bend and arrive early (`bent_ray_excess`)
    frequency_hz         of the sound: air's dispersion is subtracted (`atmosphere.sound.dispersion`)
    model                of its speed, a name in `atmosphere.sound.speed.MODELS`
    """

    length: ArrayLike
    u_length: float
    delay: float = 0.0
    u_delay: float = 0.0
    speed_gradient: float = 0.0
    u_speed_gradient: float = 0.0
    frequency_hz: float = 0.0
    model: str = THERMOMETRY


@dataclass(frozen=True, eq=False)
class PathWind:
    """Prior of the wind on a path, m/s, each one or (k,).

    crosswind      expected across the path, u_crosswind its uncertainty: with no anemometer 0 and the rms wind of the
                   site. A crosswind slows sound whatever its sign (`straight_line_speed`)
    wind, u_wind   along the path, positive from A to B: required with one direction, an error with two
    """

    u_crosswind: ArrayLike
    crosswind: ArrayLike = 0.0
    wind: ArrayLike | None = None
    u_wind: ArrayLike | None = None


@dataclass(frozen=True, eq=False)
class PathTemperatures:
    """Mean air temperatures along a path at k times, with refractivity.

    nan where not used.

    temperature_c          (k,) °C
    u_temperature_c        (k,) standard uncertainty, all sources
    covariance_c2          (k, k) K², common errors included
    wind                   (k,) m/s along the path, positive from A to B; the input where one direction was measured
    u_wind                 (k,) m/s
    group_refractivity     (k,) n_g - 1 of the path
    u_group_refractivity   (k,) all sources, the formula of the index included
    covariance_group       (k, k) of the group refractivity
    status                 k texts: `used`, or the reason of rejection
    parts_c                source of uncertainty -> (k,) °C, its part of u_temperature_c; all but `time` common
    """

    temperature_c: np.ndarray
    u_temperature_c: np.ndarray
    covariance_c2: np.ndarray
    wind: np.ndarray
    u_wind: np.ndarray
    group_refractivity: np.ndarray
    u_group_refractivity: np.ndarray
    covariance_group: np.ndarray
    status: tuple[str, ...]
    parts_c: dict[str, np.ndarray]


def path_temperatures(
    time_ab: ArrayLike,
    time_ba: ArrayLike | None,
    u_time: ArrayLike,
    *,
    line: SoundLine,
    station: StationAir,
    wind: PathWind,
    wavelength_um: float = 0.780,
    air_model: str = AIR_MODEL,
) -> PathTemperatures:
    """Mean temperature along a path from travel times of sound.

    In one direction or, better, in both.

    time_ab         (k,) or one, s, from the signal's departure at A to its arrival at B, delay included
    time_ba         the same from B to A at the same instants; None where one direction was measured
    u_time          one, (k,) or (2, k), s: noise of each time, independent
    line            length, delay, bend, and how sound runs
    station         pressure and humidity
    wind            across the path; along it where one direction was measured
    wavelength_um   of the light, for the group refractivity
    air_model       a name in `atmosphere.index.air.MODELS`

    Relative humidity is fixed in the solution for temperature, and its uncertainty is propagated: a humidity read 1 %
    too high at 20 °C lowers the temperature by 0.022 °C and so raises the index by more than it lowers it directly.

    Source: [PARKER04] eqs. 4.6 and 4.7 with the erratum of `atmosphere.sound.parker2004`; [JCGM100] eq. 13.
    Raises ValidityError for weather, lengths and uncertainties outside their limits; a bad time is a status.

    >>> line, wind = SoundLine(length=100.0, u_length=1e-3), PathWind(u_crosswind=0.0)
    >>> station = StationAir(933.0, 0.3, humidity_percent=50.0, u_humidity_percent=3.0)
    >>> path = path_temperatures(0.28735632, 0.29585799, 10e-6, line=line, station=station, wind=wind)
    >>> [round(float(v), 2) for v in (path.temperature_c[0], path.u_temperature_c[0], path.wind[0])]
    [18.4, 0.08, 5.0]
    """
    forth = np.atleast_1d(np.asarray(time_ab, float)) - line.delay
    count = forth.shape[0]
    back = None if time_ba is None else np.broadcast_to(np.asarray(time_ba, float), (count,)) - line.delay
    u_time = np.broadcast_to(np.asarray(u_time, float), (2, count))
    _check(line, station, wind, u_time, one_way=back is None)
    length, p, h = (
        np.broadcast_to(np.asarray(v, float), (count,))
        for v in (line.length, station.pressure_hpa, station.humidity_percent)
    )
    good = np.isfinite(forth) & (forth > 0.0) & np.isfinite(length)
    if back is not None:
        good &= np.isfinite(back) & (back > 0.0)
    forth, back = np.where(good, forth, np.nan), None if back is None else np.where(good, back, np.nan)
    along = _SpeedAlong.of(forth, back, length)
    if back is None:
        along = along.less_wind(wind)
    straight = _StraightSpeed.of(along, line, wind)
    t = np.atleast_1d(
        temperatures_c(
            straight.speed,
            p,
            h,
            vapour_pressure_hpa=None,
            model=line.model,
            co2_ppm=station.co2_ppm,
            frequency_hz=line.frequency_hz,
        )
    )
    calm = ~(np.abs(along.wind) > WIND.upper)
    status = np.where(~good, NO_TIME, np.where(~calm, NO_WIND, np.where(np.isfinite(t), USED, OUTSIDE)))
    t = np.where(calm, t, np.nan)
    good = np.isfinite(t)

    at = np.where(good, t, 20.0)  # for finite slopes everywhere; nan again below
    sound_state = sound(at, p, h, model=line.model, co2_ppm=station.co2_ppm)
    slope = sound_state.sensitivity
    e = humidity.vapour_pressure_hpa(at, p, h, MODELS[line.model].vapour_formula)
    lag = dispersion(at, p, e, frequency_hz=line.frequency_hz).of_a_pulse()[1]
    per_speed = np.where(good, 1.0 / slope.temperature_c, np.nan)
    noise = per_speed * np.sqrt((along.per_forth * u_time[0]) ** 2 + (along.per_back * u_time[1]) ** 2)
    common = _common_parts(straight, per_speed, sound_state, lag, line, station)
    covariance = np.diag(noise**2) + sum(np.outer(part, part) for part in common.values())
    light = air(at, p, h, wavelength_um=wavelength_um, model=air_model, co2_ppm=station.co2_ppm)
    group = _group_covariance(light, good, noise, common, station)
    return PathTemperatures(
        temperature_c=t,
        u_temperature_c=np.sqrt(np.diag(covariance)),
        covariance_c2=covariance,
        wind=np.where(good, along.wind, np.nan),
        u_wind=np.where(good, along.u_wind(u_time, line), np.nan),
        group_refractivity=np.where(good, light.group_refractivity, np.nan),
        u_group_refractivity=np.sqrt(np.diag(group)),
        covariance_group=group,
        status=tuple(str(text) for text in status),
        parts_c={"time": noise, **{name: np.abs(part) for name, part in common.items()}},
    )


def _common_parts(
    straight: "_StraightSpeed",
    per_speed: np.ndarray,
    sound_state: Sound,
    lag: np.ndarray,
    line: SoundLine,
    station: StationAir,
) -> dict[str, np.ndarray]:
    """Effect of each common standard uncertainty on the temperatures, °C (k,).

    By its cause.

    per_speed   °C per m/s, at each temperature
    sound_state       the speed's slopes by weather, and its uncertainty
    lag         standard uncertainty of the dispersion, relative to the speed
    """
    slope, formula = sound_state.sensitivity, sound_state.standard_uncertainty
    along, bend_rms = straight.along, straight.bend_rms
    bend_square = np.where(bend_rms > 0.0, bend_rms**2, 1.0)
    return {
        "length": per_speed * along.along / along.length * line.u_length,
        "delay": -per_speed * (along.per_forth + along.per_back) * line.u_delay,
        "pressure": -per_speed * slope.pressure_hpa * station.u_pressure_hpa,
        "humidity": -per_speed * slope.humidity_percent * station.u_humidity_percent,
        "carbon dioxide": -per_speed * slope.co2_ppm * station.u_co2_ppm,
        "wind": per_speed * along.u_prior,
        "crosswind": per_speed * straight.u_crosswind,
        "bend": per_speed * straight.speed * straight.early * straight.spread / bend_square,
        "dispersion": per_speed * straight.speed * lag,
        "formula": per_speed * formula,
    }


def _group_covariance(
    light: AirState, good: np.ndarray, noise: np.ndarray, common: dict[str, np.ndarray], station: StationAir
) -> np.ndarray:
    """Covariance of the group refractivity.

    Through the temperature, and directly by weather at fixed temperature.
    """
    slopes = light.sensitivity
    direct = {
        "pressure": slopes.pressure_hpa * station.u_pressure_hpa,
        "humidity": slopes.humidity_percent * station.u_humidity_percent,
    }
    parts = [slopes.temperature_c * part + direct.get(name, 0.0) for name, part in common.items()]
    parts.append(np.where(good, light.standard_uncertainty, np.nan))
    return np.diag((slopes.temperature_c * noise) ** 2) + sum(np.outer(part, part) for part in parts)


@dataclass(frozen=True, eq=False)
class _SpeedAlong:
    """Speed along the path, its slopes by the times, and the wind.

    The wind along the path is subtracted.

    length      (k,) m
    speed       (k,) m/s, of sound, the wind along it subtracted
    wind        (k,) m/s, measured or from the input
    along       (k,) length over time, slope by the relative length, m/s
    per_forth   (k,) of the speed by the time from A to B, m/s²; per_back from B to A
    u_prior     (k,) standard uncertainty of an input wind, m/s
    both        True if both directions were measured
    """

    length: np.ndarray
    speed: np.ndarray
    wind: np.ndarray
    along: np.ndarray
    per_forth: np.ndarray
    per_back: np.ndarray
    u_prior: np.ndarray
    both: bool = True

    @classmethod
    def of(cls, forth: np.ndarray, back: np.ndarray | None, length: np.ndarray) -> "_SpeedAlong":
        zero = np.zeros_like(forth)
        if back is None:
            speed = length / forth
            return cls(
                length=length,
                speed=speed,
                wind=zero,
                along=speed,
                per_forth=-speed / forth,
                per_back=zero,
                u_prior=zero,
                both=False,
            )
        both = pair(forth, back, length)
        return cls(
            length=length,
            speed=both.speed_along,
            wind=both.wind,
            along=both.speed_along,
            per_forth=-0.5 * length / forth**2,
            per_back=-0.5 * length / back**2,
            u_prior=zero,
        )

    def less_wind(self, given: PathWind) -> "_SpeedAlong":
        """Speed with an input wind instead of a measured one."""
        wind, u = (np.broadcast_to(np.asarray(v, float), self.speed.shape) for v in (given.wind, given.u_wind))
        return replace(self, speed=self.speed - wind, wind=wind, u_prior=u)

    def u_wind(self, u_time: np.ndarray, line: SoundLine) -> np.ndarray:
        """Standard uncertainty of the wind, (k,) m/s."""
        if not self.both:
            return self.u_prior
        noise = (self.per_forth * u_time[0]) ** 2 + (self.per_back * u_time[1]) ** 2
        delay = (self.per_forth - self.per_back) * line.u_delay
        return np.sqrt(noise + delay**2 + (self.wind / self.length * line.u_length) ** 2)


@dataclass(frozen=True, eq=False)
class _StraightSpeed:
    """Speed in still air on the straight line.

    The speed along the path corrected for bend and crosswind.

    along         by the times
    speed         (k,) m/s
    u_crosswind   (k,) m/s, uncertainty of the crosswind's part
    bend_rms      1/s, rms gradient of the speed
    early         (k,) relative early arrival of the bent ray
    spread        1/s², standard uncertainty of the gradient's square
    """

    along: _SpeedAlong
    speed: np.ndarray
    u_crosswind: np.ndarray
    bend_rms: float
    early: np.ndarray
    spread: float

    @classmethod
    def of(cls, along: _SpeedAlong, line: SoundLine, wind: PathWind) -> "_StraightSpeed":
        gradient, u_gradient = line.speed_gradient, line.u_speed_gradient
        bend_rms = np.hypot(gradient, u_gradient)
        early = bent_ray_excess(along.length, 343.0, bend_rms)
        spread = np.sqrt(4.0 * (gradient * u_gradient) ** 2 + 2.0 * u_gradient**4)
        shape = along.length.shape
        across, u_across = (np.broadcast_to(np.asarray(v, float), shape) for v in (wind.crosswind, wind.u_crosswind))
        speed, u_crosswind = straight_line_speed(along.speed * (1.0 - early), across, u_across)
        return cls(along=along, speed=speed, u_crosswind=u_crosswind, bend_rms=bend_rms, early=early, spread=spread)


def _check(line: SoundLine, station: StationAir, wind: PathWind, u_time: np.ndarray, *, one_way: bool) -> None:
    """Raise ValidityError for limits, and for a missing or superfluous wind."""
    LENGTH.check(line.length)
    DELAY.check(line.delay)
    WIND.check(wind.crosswind)
    GRADIENT.check(line.speed_gradient)
    _check_wind_along(wind, one_way)
    model_named(line.model).check(
        pressure_hpa=station.pressure_hpa, humidity_percent=station.humidity_percent, co2_ppm=station.co2_ppm
    )
    check_spreads(
        u_time=u_time,
        u_length=line.u_length,
        u_delay=line.u_delay,
        u_pressure_hpa=station.u_pressure_hpa,
        u_humidity_percent=station.u_humidity_percent,
        u_crosswind=wind.u_crosswind,
        u_speed_gradient=line.u_speed_gradient,
        u_co2_ppm=station.u_co2_ppm,
    )


def _check_wind_along(given: PathWind, one_way: bool) -> None:
    if not one_way:
        if given.wind is not None or given.u_wind is not None:
            raise ValidityError("wind and u_wind are for one direction; two directions measure the wind: omit them")
        return
    if given.wind is None or given.u_wind is None:
        raise ValidityError(
            "one direction does not separate wind from temperature: give wind and u_wind, m/s along the path"
        )
    WIND.check(given.wind)
    check_spreads(u_wind=given.u_wind)
