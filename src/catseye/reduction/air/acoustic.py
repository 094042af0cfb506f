"""Temperature of the air along a path from travel times of sound, and the index of light along the same path.

Two directions at once give the wind and take it out (`atmosphere.sound.path`); one needs a wind from elsewhere. What is
common to all measurements of a path is kept common: its length, the delay of loudspeaker and microphone, the station's
pressure and humidity, the crosswind, the bend of the ray, the formula itself. Only times are noise.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from catseye.atmosphere.index.air import AirState, air
from catseye.atmosphere.limit import ValidInterval, check_spreads
from catseye.atmosphere.sound.dispersion import dispersion
from catseye.atmosphere.sound.path import WIND, bent_ray_excess, pair, straight_line_speed
from catseye.atmosphere.sound.speed import MODELS, THERMOMETRY, model_named, sound, temperatures_c
from catseye.atmosphere.weather import humidity
from catseye.errors import ValidityError

USED = "used"
NO_TIME = "no travel time"
OUTSIDE = "speed of no air within the model's limits"
NO_WIND = f"wind above {WIND.upper:g} m/s: the two times do not belong together"

LENGTH = ValidInterval("length of the path", "m", 0.1, 10_000.0, "the notion of a path", places=1)
DELAY = ValidInterval("delay", "s", -1.0, 1.0, "the notion of a delay")
GRADIENT = ValidInterval("gradient of the speed", "1/s", -10.0, 10.0, "the notion of a smoothly bent ray")


@dataclass(frozen=True, eq=False)
class PathTemperatures:
    """Mean temperatures of the air along a path at k times, and the group refractivity they give; nan where not used.

    temperature_c          (k,) °C
    u_temperature_c        (k,) standard uncertainty, all sources
    covariance_c2          (k, k) K², with what is common to all
    wind                   (k,) m/s along the path, positive from A to B; the one given where one direction was measured
    u_wind                 (k,) m/s
    group_refractivity     (k,) n_g - 1 of the path
    u_group_refractivity   (k,) all sources, the formula of the index included
    covariance_group       (k, k) of the group refractivity
    status                 k texts: `used`, or why not
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
    time_ab: Any,
    time_ba: Any,
    u_time: Any,
    *,
    length: Any,
    u_length: float,
    delay: float = 0.0,
    u_delay: float = 0.0,
    pressure_hpa: Any,
    u_pressure_hpa: float,
    humidity_percent: Any,
    u_humidity_percent: float,
    u_crosswind: Any,
    crosswind: Any = 0.0,
    wind: Any = None,
    u_wind: Any = None,
    speed_gradient: float = 0.0,
    u_speed_gradient: float = 0.0,
    co2_ppm: float = 450.0,
    u_co2_ppm: float = 20.0,
    frequency_hz: float = 0.0,
    model: str = THERMOMETRY,
    wavelength_um: float = 0.780,
    air_model: str = "ciddor_hill1999",
) -> PathTemperatures:
    """Mean temperature along a path from the travel times of sound in one direction or, better, in both.

    time_ab              (k,) or one, s, from the signal's departure at A to its arrival at B, delay included
    time_ba              the same from B to A at the same instants; None where one direction was measured
    u_time               one, (k,) or (2, k), s: noise of each time, independent
    length, u_length     m, of the path; its uncertainty is common to all
    delay, u_delay       s, of the equipment, taken off each time; its uncertainty is common to all times
    pressure_hpa         one or (k,), of a station; u_pressure_hpa common to all
    humidity_percent     one or (k,), of a station; u_humidity_percent common to all
    crosswind            m/s expected across the path, one or (k,); u_crosswind its uncertainty: with no anemometer 0
                         and the rms wind of the site. A crosswind slows sound whatever its sign (`straight_line_speed`)
    wind, u_wind         m/s along the path, positive from A to B: needed with one direction, refused with two
    speed_gradient       1/s across the path, with u_speed_gradient: rays bend and arrive early (`bent_ray_excess`)
    co2_ppm, u_co2_ppm   carbon dioxide
    frequency_hz         of the sound: air's dispersion is taken off (`atmosphere.sound.dispersion`)
    model                a name in `atmosphere.sound.speed.MODELS`
    wavelength_um        of the light whose group refractivity is wanted
    air_model            a name in `atmosphere.index.air.MODELS`

    Relative humidity is held where temperature is sought, and where its uncertainty is carried on: a humidity read 1 %
    too high at 20 °C lowers the temperature by 0.022 °C and so raises the index by more than it lowers it directly.

    Source: [PARKER04] eqs. 4.6 and 4.7 with the erratum of `atmosphere.sound.parker2004`; [JCGM100] eq. 13.
    Raises ValidityError for weather, lengths and uncertainties outside their limits; a bad time is a status.

    >>> path = path_temperatures(
    ...     0.28735632, 0.29585799, 10e-6, length=100.0, u_length=1e-3, pressure_hpa=933.0, u_pressure_hpa=0.3,
    ...     humidity_percent=50.0, u_humidity_percent=3.0, u_crosswind=0.0)
    >>> [round(float(v), 2) for v in (path.temperature_c[0], path.u_temperature_c[0], path.wind[0])]
    [18.4, 0.08, 5.0]
    """
    forth = np.atleast_1d(np.asarray(time_ab, float)) - delay
    count = forth.shape[0]
    back = None if time_ba is None else np.broadcast_to(np.asarray(time_ba, float), (count,)) - delay
    u_time = np.broadcast_to(np.asarray(u_time, float), (2, count))
    _check(length, delay, crosswind, speed_gradient, wind, u_wind, back is None)
    model_named(model).check(pressure_hpa=pressure_hpa, humidity_percent=humidity_percent, co2_ppm=co2_ppm)
    length, p, h, across, u_across = (
        np.broadcast_to(np.asarray(v, float), (count,))
        for v in (length, pressure_hpa, humidity_percent, crosswind, u_crosswind)
    )
    check_spreads(
        u_time=u_time,
        u_length=u_length,
        u_delay=u_delay,
        u_pressure_hpa=u_pressure_hpa,
        u_humidity_percent=u_humidity_percent,
        u_crosswind=u_crosswind,
        u_speed_gradient=u_speed_gradient,
        u_co2_ppm=u_co2_ppm,
    )

    good = np.isfinite(forth) & (forth > 0.0) & np.isfinite(length)
    if back is not None:
        good &= np.isfinite(back) & (back > 0.0)
    speeds = _SpeedAlong.of(
        np.where(good, forth, np.nan), None if back is None else np.where(good, back, np.nan), length
    )
    if back is None:
        speeds = speeds.less_wind(np.broadcast_to(np.asarray(wind, float), (count,)), u_wind)

    bend_rms = np.hypot(speed_gradient, u_speed_gradient)
    early = bent_ray_excess(length, 343.0, bend_rms)
    spread = np.sqrt(4.0 * (speed_gradient * u_speed_gradient) ** 2 + 2.0 * u_speed_gradient**4)
    speed, u_speed_crosswind = straight_line_speed(speeds.speed * (1.0 - early), across, u_across)
    t = np.atleast_1d(temperatures_c(speed, p, h, None, model, co2_ppm, frequency_hz))
    calm = ~(np.abs(speeds.wind) > WIND.upper)
    status = np.where(~good, NO_TIME, np.where(~calm, NO_WIND, np.where(np.isfinite(t), USED, OUTSIDE)))
    t = np.where(calm, t, np.nan)
    good = np.isfinite(t)

    at = np.where(np.isfinite(t), t, 20.0)  # only so that slopes exist everywhere; nan again below
    slope = sound(at, p, h, model=model, co2_ppm=co2_ppm).sensitivity
    e = humidity.vapour_pressure_hpa(at, p, h, MODELS[model].vapour_formula)
    lag = dispersion(at, p, e, frequency_hz).of_a_pulse()[1]
    per_speed = np.where(np.isfinite(t), 1.0 / slope.temperature_c, np.nan)
    noise = per_speed * np.sqrt((speeds.per_forth * u_time[0]) ** 2 + (speeds.per_back * u_time[1]) ** 2)
    common = {
        "length": per_speed * speeds.along / length * u_length,
        "delay": -per_speed * (speeds.per_forth + speeds.per_back) * u_delay,
        "pressure": -per_speed * slope.pressure_hpa * u_pressure_hpa,
        "humidity": -per_speed * slope.humidity_percent * u_humidity_percent,
        "carbon dioxide": -per_speed * slope.co2_ppm * u_co2_ppm,
        "wind": per_speed * speeds.u_prior,
        "crosswind": per_speed * u_speed_crosswind,
        "bend": per_speed * speed * early * spread / np.where(bend_rms > 0.0, bend_rms**2, 1.0),
        "dispersion": per_speed * speed * lag,
        "formula": per_speed * MODELS[model].standard_uncertainty,
    }
    covariance = np.diag(noise**2) + sum(np.outer(part, part) for part in common.values())
    light = air(at, p, h, wavelength_um=wavelength_um, model=air_model, co2_ppm=co2_ppm)
    group = _group_covariance(light, good, noise, common, {"pressure": u_pressure_hpa, "humidity": u_humidity_percent})
    return PathTemperatures(
        temperature_c=t,
        u_temperature_c=np.sqrt(np.diag(covariance)),
        covariance_c2=covariance,
        wind=np.where(good, speeds.wind, np.nan),
        u_wind=np.where(good, speeds.u_wind(u_time, length, u_length, u_delay), np.nan),
        group_refractivity=np.where(good, light.group_refractivity, np.nan),
        u_group_refractivity=np.sqrt(np.diag(group)),
        covariance_group=group,
        status=tuple(str(text) for text in status),
        parts_c={"time": noise, **{name: np.abs(part) for name, part in common.items()}},
    )


def _group_covariance(
    light: AirState, good: np.ndarray, noise: np.ndarray, common: dict[str, np.ndarray], u_weather: dict[str, Any]
) -> np.ndarray:
    """Of the group refractivity: through the temperature, and what weather does at a given temperature as well."""
    slopes = light.sensitivity
    direct = {
        "pressure": slopes.pressure_hpa * u_weather["pressure"],
        "humidity": slopes.humidity_percent * u_weather["humidity"],
    }
    parts = [slopes.temperature_c * part + direct.get(name, 0.0) for name, part in common.items()]
    parts.append(np.where(good, light.standard_uncertainty, np.nan))
    return np.diag((slopes.temperature_c * noise) ** 2) + sum(np.outer(part, part) for part in parts)


@dataclass(frozen=True, eq=False)
class _SpeedAlong:
    """What the times say: speed along the path without the wind along it, its slopes by the times, and the wind.

    along      length over time, what the length scales, m/s
    u_prior    standard uncertainty of a wind that was given, m/s
    """

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
            return cls(speed, zero, speed, -speed / forth, zero, zero, both=False)
        both = pair(forth, back, length)
        return cls(
            both.speed_along,
            both.wind,
            both.speed_along,
            -0.5 * length / forth**2,
            -0.5 * length / back**2,
            zero,
        )

    def less_wind(self, wind: np.ndarray, u_wind: Any) -> "_SpeedAlong":
        u = np.broadcast_to(np.asarray(u_wind, float), wind.shape)
        return _SpeedAlong(self.speed - wind, wind, self.along, self.per_forth, self.per_back, u, both=False)

    def u_wind(self, u_time: np.ndarray, length: np.ndarray, u_length: float, u_delay: float) -> np.ndarray:
        if not self.both:
            return self.u_prior
        noise = (self.per_forth * u_time[0]) ** 2 + (self.per_back * u_time[1]) ** 2
        delay = (self.per_forth - self.per_back) * u_delay
        return np.sqrt(noise + delay**2 + (self.wind / length * u_length) ** 2)


def _check(length, delay, crosswind, speed_gradient, wind, u_wind, one_way) -> None:
    LENGTH.check(length)
    DELAY.check(delay)
    WIND.check(crosswind)
    GRADIENT.check(speed_gradient)
    if not one_way:
        if wind is not None or u_wind is not None:
            raise ValidityError(
                "wind and u_wind are for one direction; two directions measure the wind: leave them out"
            )
        return
    if wind is None or u_wind is None:
        raise ValidityError(
            "one direction does not tell wind from temperature: give wind and u_wind, m/s along the path"
        )
    WIND.check(wind)
    check_spreads(u_wind=u_wind)
