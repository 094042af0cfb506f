"""Mercury barometer readings to station pressure; gravity; pressure at other elevations.

A barometer's reading is a length of mercury on a brass scale. 760 mm Hg is one atmosphere only at 0 °C and 9.80665
m/s²: elsewhere the mercury is lighter and the scale longer ([PARKER04] eq. 1.8), and the mercury's weight is the local
gravity's (1.12). The notes print p_r in 1.12 where 1.18 multiplies the temperature-corrected p_t: applied as printed
the temperature would be ignored, 3 hPa at 20 °C. Their example 1.22 gives 929.37 mb: 697.094 mm Hg is 929.383 mb
(929.382 with all digits of gravity); they multiply the truncated 697.09 and truncate again.

Gravity by formula is that of the sea-level ellipsoid lifted through free air. It excludes the rock between (a
Bouguer plate: 1.12e-6 m/s² a metre) and below: real gravity departs by some 3e-4 m/s², 0.03 hPa at
933 hPa and 8e-9 in the index. A measured station avoids this: `GRAVITY_STATIONS`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from catseye.atmosphere.limit import ValidInterval
from catseye.constants import DRY_AIR_KG_PER_MOL, GAS_CONSTANT, STANDARD_GRAVITY, WATER_OVER_AIR, ZERO_CELSIUS_K
from catseye.errors import ValidityError

HPA_PER_MMHG = 1.333_223_874_15  # 13595.1 kg/m³ times standard gravity; [PARKER04] eq. 1.20 rounds to 1.333224
BRASS_PER_C, MERCURY_PER_C = 1.84e-5, 1.818e-4  # [PARKER04] eq. 1.8: scale in length, mercury in volume
U_MERCURY_EXPANSION = 1e-5  # of the pressure, 0 to 40 °C: nonlinearity of mercury's expansion
GAL = 1e-2  # m/s²
FOOT = 0.3048  # m
FREE_AIR = -3.086e-6  # 1/s²: change of gravity with height through free air
BOUGUER_PLATE = 1.119e-6  # 1/s²: effect of a plate of rock of 2670 kg/m³
U_NORMAL_GRAVITY = 3e-4  # m/s², of a formula: the usual size of free-air anomalies on land, our estimate

# [SMITHSON51] (eq. 1.9 of [PARKER04]): cm/s² at 45°, cos 2 phi, cos² 2 phi
SEA_LEVEL_GAL, SEA_LEVEL_COS, SEA_LEVEL_COS2 = 980.616, -0.0026373, 0.0000059
# [SMITHSON51] table 167 (eq. 1.10): cm/s² by metre to the first, second and third power; beside cos 2 phi
LIFT = ((-3.085462e-4, -2.27e-7), (7.254e-11, 1.0e-13), (-1.517e-17, -6e-20))
# [MORITZ80]: GRS80's equatorial gravity, Somigliana's k, first eccentricity squared, semi-axis, flattening, m
GRS80_EQUATOR, GRS80_K, GRS80_E2 = 9.780_326_771_5, 0.001_931_851_353, 0.006_694_380_022_90
GRS80_A, GRS80_F, GRS80_M = 6_378_137.0, 1.0 / 298.257_222_101, 0.003_449_786_003_08

READING = ValidInterval("barometer reading", "mm Hg", 300.0, 850.0, "[PARKER04] eq. 1.8")
MERCURY = ValidInterval("mercury temperature", "°C", -30.0, 60.0, "[PARKER04] eq. 1.8")
GRAVITY = ValidInterval("gravity", "m/s²", 9.7, 9.9, "the earth's surface", places=1)
LATITUDE = ValidInterval("latitude", "rad", -np.pi / 2, np.pi / 2, "the earth", places=4)
ELEVATION = ValidInterval("elevation", "m", -500.0, 9000.0, "[SMITHSON51] table 167")
PRESSURE = ValidInterval("pressure", "hPa", 100.0, 1400.0, "the hydrostatic balance of the lower air")
RISE = ValidInterval("difference of elevation", "m", -12000.0, 12000.0, "the hydrostatic balance of the lower air")
TEMPERATURE = ValidInterval("temperature", "°C", -100.0, 60.0, "the hydrostatic balance of the lower air")


def temperature_corrected_mmhg(reading_mmhg, mercury_c):
    """Barometer reading reduced to 0 °C, mm Hg.

    reading_mmhg   as read, index and capillarity corrections of its certificate added, 300 to 850 mm Hg
    mercury_c      temperature of mercury and scale, -30 to 60 °C

    Raises ValidityError outside these limits.
    Source: [PARKER04] eq. 1.8 ([SMITHSON51]). Good to 1e-5 of itself from 0 to 40 °C.

    >>> round(float(temperature_corrected_mmhg(700.0, 20.0)), 3)
    697.721
    """
    READING.check(reading_mmhg)
    MERCURY.check(mercury_c)
    t = np.asarray(mercury_c, float)
    return np.asarray(reading_mmhg, float) * (1.0 + BRASS_PER_C * t) / (1.0 + MERCURY_PER_C * t)


def station_pressure_hpa(reading_mmhg, mercury_c, gravity):
    """Pressure at the barometer's elevation, hPa.

    reading_mmhg   as read, 300 to 850 mm Hg
    mercury_c      temperature of mercury and scale, -30 to 60 °C
    gravity        local, 9.7 to 9.9 m/s²: of `normal_gravity`, or of a measured station

    Raises ValidityError outside these limits; 979.784 (gal) is refused as m/s².
    Source: [PARKER04] eqs. 1.8, 1.12 (with p_t for its p_r), 1.20.

    >>> round(float(station_pressure_hpa(700.0, 20.0, 9.79784)), 3)
    929.382
    """
    GRAVITY.check(gravity)
    at_zero = temperature_corrected_mmhg(reading_mmhg, mercury_c)
    return at_zero * np.asarray(gravity, float) / STANDARD_GRAVITY * HPA_PER_MMHG


def station_pressure_uncertainty_hpa(
    reading_mmhg, mercury_c, gravity, *, u_reading_mmhg, u_mercury_c, u_gravity=U_NORMAL_GRAVITY
):
    """Standard uncertainty of `station_pressure_hpa` from uncorrelated inputs, hPa.

    Inputs are 1 sigma each.

    u_reading_mmhg   of the reading with its certificate's corrections, mm Hg
    u_mercury_c      of the mercury's temperature, °C: 0.12 hPa/°C at 700 mm Hg, usually the largest part
    u_gravity        m/s²; the default is that of a formula

    The linear expansion of mercury adds 1e-5 of the pressure.
    Source: [JCGM100] eq. 10 with the derivatives of [PARKER04] eqs. 1.8, 1.12.

    >>> u = station_pressure_uncertainty_hpa(700.0, 20.0, 9.79784, u_reading_mmhg=0.05, u_mercury_c=0.5)
    >>> round(float(u), 3)
    0.105
    """
    p = station_pressure_hpa(reading_mmhg, mercury_c, gravity)
    t = np.asarray(mercury_c, float)
    per_c = BRASS_PER_C / (1.0 + BRASS_PER_C * t) - MERCURY_PER_C / (1.0 + MERCURY_PER_C * t)
    relative = (
        np.asarray(u_reading_mmhg, float) / np.asarray(reading_mmhg, float),
        per_c * np.asarray(u_mercury_c, float),
        np.asarray(u_gravity, float) / np.asarray(gravity, float),
        U_MERCURY_EXPANSION,
    )
    return p * np.sqrt(sum(np.square(part) for part in relative))


def sea_level_gravity(latitude):
    """Gravity at sea level by the Smithsonian formula, m/s².

    latitude   rad, -pi/2 to pi/2

    Source: [SMITHSON51] ([PARKER04] eq. 1.9). Within 1.1e-4 m/s² of [MORITZ80]'s everywhere, 2.4e-5 at 38°.

    >>> round(float(sea_level_gravity(np.radians(38.45))), 7)
    9.8003014
    """
    LATITUDE.check(latitude)
    c = np.cos(2.0 * np.asarray(latitude, float))
    return SEA_LEVEL_GAL * GAL * (1.0 + SEA_LEVEL_COS * c + SEA_LEVEL_COS2 * c**2)


def elevation_correction(latitude, elevation):
    """Change of gravity from sea level to an elevation in free air, m/s².

    Below zero above the sea.

    latitude    rad, -pi/2 to pi/2
    elevation   above sea level, -500 to 9000 m

    Source: [SMITHSON51] table 167 ([PARKER04] eq. 1.10).

    >>> round(float(elevation_correction(np.radians(38.45), 797.3)), 8)
    -0.00245999
    """
    LATITUDE.check(latitude)
    ELEVATION.check(elevation)
    c, z = np.cos(2.0 * np.asarray(latitude, float)), np.asarray(elevation, float)
    return GAL * sum((plain + by_cos * c) * z**power for power, (plain, by_cos) in enumerate(LIFT, start=1))


def normal_gravity(latitude, elevation, *, formula="smithsonian"):
    """Normal gravity at a latitude and elevation, m/s².

    latitude    rad, -pi/2 to pi/2; a minute of arc is 1.5e-5 m/s² at 38°
    elevation   above sea level, -500 to 9000 m
    formula     `smithsonian`, the notes', or `grs80`, today's

    Raises ValidityError outside these limits. The two lie within 1.1e-4 m/s² (0.01 hPa) of each other up to 5 km; the
    true gravity departs by more, `U_NORMAL_GRAVITY`, because neither includes the rock.
    Source: [PARKER04] eqs. 1.9, 1.10, 1.13; [MORITZ80] Somigliana's closed formula with the lift of second order.

    >>> round(float(normal_gravity(np.radians(38.45), 797.3)), 5)
    9.79784
    >>> round(float(normal_gravity(np.radians(38.45), 797.3, formula="grs80")), 5)
    9.79787
    """
    if formula not in GRAVITY_FORMULAS:
        raise ValidityError(f"gravity formula {formula!r} is unknown; choose one of {', '.join(GRAVITY_FORMULAS)}")
    LATITUDE.check(latitude)
    ELEVATION.check(elevation)
    return GRAVITY_FORMULAS[formula](np.asarray(latitude, float), np.asarray(elevation, float))


def _smithsonian(latitude, elevation):
    return sea_level_gravity(latitude) + elevation_correction(latitude, elevation)


def _grs80(latitude, elevation):
    s2 = np.sin(latitude) ** 2
    surface = GRS80_EQUATOR * (1.0 + GRS80_K * s2) / np.sqrt(1.0 - GRS80_E2 * s2)
    lift = elevation / GRS80_A
    return surface * (1.0 - 2.0 * (1.0 + GRS80_F + GRS80_M - 2.0 * GRS80_F * s2) * lift + 3.0 * lift**2)


GRAVITY_FORMULAS: dict[str, Callable[..., Any]] = {"smithsonian": _smithsonian, "grs80": _grs80}


@dataclass(frozen=True)
class GravityStation:
    """Brass marker with absolutely measured gravity.

    name            as published
    gravity_gal     1 gal is 0.01 m/s²
    elevation_ft    above sea level, printed to a foot
    u_gal           standard uncertainty where one is published
    where           description of the place
    """

    name: str
    gravity_gal: float
    elevation_ft: float
    u_gal: float | None
    where: str

    @property
    def gravity(self) -> float:
        """Gravity at the marker, m/s²."""
        return self.gravity_gal * GAL

    @property
    def elevation(self) -> float:
        """Height above sea level, m."""
        return self.elevation_ft * FOOT

    def gravity_at(self, elevation, *, gradient=FREE_AIR):
        """Gravity near this station at another elevation, m/s².

        elevation   m, within 50 m of the station's
        gradient    1/s²: FREE_AIR up a building or tower, FREE_AIR + BOUGUER_PLATE up a hillside

        >>> round(float(GRAVITY_STATIONS["Green Bank AA"].gravity_at(797.3)), 6)
        9.797962
        """
        ValidInterval("elevation", "m", self.elevation - 50.0, self.elevation + 50.0, f"{self.name}'s gradient").check(
            elevation
        )
        return self.gravity + gradient * (np.asarray(elevation, float) - self.elevation)

    def anomaly(self, latitude, *, formula="smithsonian"):
        """Measured gravity less a formula's at this elevation, m/s².

        The latitude, rad, is not published with the station.
        """
        return self.gravity - normal_gravity(latitude, self.elevation, formula=formula)


# [PARKER04] section 1.4.2, published by the National Geodetic Survey, measured in 1988. At the notes' latitude of
# 38° 27' they lie above the Smithsonian formula by 12.1, 13.0 and 15.3e-5 m/s² and above GRS80 by 9.7, 10.6 and
# 12.9e-5 (by 1.5e-5 more at the site's 38° 26'): today's formula is nearer. From marker to marker gravity falls by
# 1.6e-6 m/s² a metre, for the ground rises with them: nearer to FREE_AIR + BOUGUER_PLATE than to FREE_AIR.
GRAVITY_STATIONS = {
    station.name: station
    for station in (
        GravityStation("Green Bank AA", 979.795_654, 2622.0, 5e-6, "basement of the interferometer building"),
        GravityStation("Green Bank B", 979.794_688, 2642.0, None, "base of the antenna next to that building"),
        GravityStation("Green Bank AB", 979.792_146, 2693.0, None, "40 foot telescope's control room"),
    )
}


def gravity_station(name: str) -> GravityStation:
    """Gravity station by its name, with or without the place.

    name   of `GRAVITY_STATIONS`, or its last word, in any case

    Raises ValidityError for an unknown name, with those that there are.

    >>> gravity_station("aa").gravity
    9.79795654
    """
    wanted = name.strip().casefold()
    for full, station in GRAVITY_STATIONS.items():
        if wanted in (full.casefold(), full.split()[-1].casefold()):
            return station
    short = ", ".join(full.split()[-1] for full in GRAVITY_STATIONS)
    raise ValidityError(f"gravity station {name!r} is unknown; choose one of {short}, or give the gravity")


class CarriedPressure(NamedTuple):
    """Pressure at another elevation and its derivatives by the inputs.

    pressure_hpa          hPa
    per_pressure_hpa      by the pressure at the barometer, the vapour pressure held
    per_temperature_c     by the temperature at the barometer, hPa/°C
    per_lapse             by the fall of temperature with height, hPa/(°C/m)
    per_vapour            by the vapour pressure at the barometer
    per_gravity           by gravity, hPa/(m/s²)
    per_rise              by the difference of elevation, hPa/m
    u_formula_hpa         standard uncertainty of the formula: real air is 0.04 % denser than ideal
    """

    pressure_hpa: Any
    per_pressure_hpa: Any
    per_temperature_c: Any
    per_lapse: Any
    per_vapour: Any
    per_gravity: Any
    per_rise: Any
    u_formula_hpa: Any

    def standard_uncertainty_hpa(
        self, u_pressure_hpa, *, u_temperature_c=0.0, u_lapse=0.0, u_vapour=0.0, u_gravity=U_NORMAL_GRAVITY, u_rise=0.0
    ):
        """Standard uncertainty of the carried pressure from uncorrelated inputs, hPa.

        Inputs are 1 sigma each.

        Source: [JCGM100] eq. 10.

        >>> top = carried_pressure(933.0, 20.0, 803.8, z_to=951.8)
        >>> round(float(top.standard_uncertainty_hpa(0.1, u_temperature_c=1.0)), 3)
        0.112
        """
        u = (u_pressure_hpa, u_temperature_c, u_lapse, u_vapour, u_gravity, u_rise)
        parts = (slope * np.asarray(spread, float) for slope, spread in zip(self[1:7], u, strict=True))
        return np.sqrt(self.u_formula_hpa**2 + sum(np.square(part) for part in parts))


def carried_pressure(
    pressure_hpa,
    temperature_c,
    z_from,
    *,
    z_to,
    lapse_c_per_m=0.0065,
    vapour_pressure_hpa=0.0,
    gravity=STANDARD_GRAVITY,
) -> CarriedPressure:
    """Pressure at another elevation, with linear temperature and constant vapour share.

    pressure_hpa          at the barometer, 100 to 1400 hPa
    temperature_c         of the air at the barometer, -100 to 60 °C
    z_from                elevation of the barometer, m
    z_to                  target elevation, m, within 12 km
    lapse_c_per_m         fall of temperature with height: 0.0065 for standard air, 0 isothermal, below
                          zero an inversion
    vapour_pressure_hpa   at the barometer, 0 hPa to the total pressure (moist air is lighter)
    gravity               mean between, m/s²

    `atmosphere.path.mean.pressure_at` is the notes' 0.11 hPa/m, `hydrostatic_pressure_hpa` there this without lapse.
    Raises ValidityError outside these limits, and where the air would fall to absolute zero on the way.
    Source: [ICAO93] eqs. of the layers with lapse, with [CIDDOR96]'s molar masses; ideal gas. Good to 0.005 hPa over
    150 m with exact inputs, 4e-4 of the fall.

    >>> round(float(carried_pressure(1013.25, 15.0, 0.0, z_to=1000.0).pressure_hpa), 2)
    898.75
    """
    PRESSURE.check(pressure_hpa)
    TEMPERATURE.check(temperature_c)
    GRAVITY.check(gravity)
    p, kelvin = np.asarray(pressure_hpa, float), np.asarray(temperature_c, float) + ZERO_CELSIUS_K
    vapour, lapse = np.asarray(vapour_pressure_hpa, float), np.asarray(lapse_c_per_m, float)
    rise = np.asarray(z_to, float) - np.asarray(z_from, float)
    RISE.check(rise)
    ValidInterval("vapour's share of the pressure", "%", 0.0, 100.0, "a mixture of gases").check(100.0 * vapour / p)
    x = -lapse * rise / kelvin  # relative change of the absolute temperature
    ValidInterval(
        quantity="absolute temperature at the top over that below",
        unit="(ratio)",
        lower=0.5,
        upper=2.0,
        source="the model of one linear layer",
        places=1,
    ).check(1.0 + x)
    share, light = vapour / p, 1.0 - WATER_OVER_AIR
    weight = gravity * DRY_AIR_KG_PER_MOL / GAS_CONSTANT  # K/m, of dry air
    column, per_x = _log_ratio(x)
    depth = rise / kelvin * column  # the integral of dz/T, m/K
    fall = weight * (1.0 - light * share)
    answer = p * np.exp(-fall * depth)
    by_share = answer * weight * light * depth  # per unit of the vapour's share
    return CarriedPressure(
        answer,
        answer / p - by_share * share / p,
        answer * fall * rise / kelvin**2 * (column + x * per_x),
        answer * fall * (rise / kelvin) ** 2 * per_x,
        by_share / p,
        -answer * fall * depth / gravity,
        -answer * fall / (kelvin - lapse * rise),
        4e-4 * np.abs(answer - p),
    )


def _log_ratio(x):
    """ln(1 + x)/x and its derivative, by series where x is small: 1 - x/2 + x²/3 - ..."""
    small = np.abs(x) < 1e-3
    safe = np.where(small, 1.0, x)
    value = np.where(small, 1.0 + x * (-1 / 2 + x * (1 / 3 + x * (-1 / 4 + x / 5))), np.log1p(safe) / safe)
    slope = np.where(
        small,
        -1 / 2 + x * (2 / 3 + x * (-3 / 4 + x * (4 / 5 - x * 5 / 6))),
        (1.0 / (1.0 + safe) - np.log1p(safe) / safe) / safe,
    )
    return value, slope
