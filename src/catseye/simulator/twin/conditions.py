"""What the weather of a living site is like, and which effects of its physics can be left out or turned round."""

from dataclasses import dataclass, replace

from catseye.errors import InputError
from catseye.simulator.night.faults import EFFECTS, Planted

LIVING_EFFECTS = (
    "bearing_tilt",  # of the azimuth bearing and track
    "dew",  # amplitude lost where retroreflectors are wet
    "diurnal",  # temperature and layers through the day
    "encoder",  # what the telescope's encoders tell wrongly
    "gravity",  # bending with elevation
    "horizontal_gradient",  # of temperature
    "settling",  # monuments sink and lean
    "thermal",  # bending with the temperature of the steel
    "vibration",  # of the feed arm
    "weather_wander",  # of temperature, pressure and dew point
    "wind",  # on the feed arm
)


@dataclass(frozen=True)
class LivingPlanted(Planted):
    """`Planted`, which knows the living site's effects too: `signs` and `ignore` take both lists.

    >>> LivingPlanted(ignore=["vibration", "drift"]).gain("vibration")
    0.0
    """

    def __post_init__(self) -> None:
        known = (*EFFECTS, *LIVING_EFFECTS)
        for effect in (*self.signs, *self.ignore):
            if effect not in known:
                raise InputError(f"unknown effect {effect!r}: expected one of {', '.join(sorted(known))}")


STILL = LivingPlanted(ignore=(*EFFECTS, *LIVING_EFFECTS))  # nothing but geometry, air without layers, glass


@dataclass(frozen=True)
class LivingConditions:
    """The air at z = 0 over the pintle at the start, and how it lives. Magnitudes are chosen; nights are quiet.

    diurnal_c               half of the day's swing; warmest at 15 h local mean time
    gradient_c_per_m        at night and at noon; above the surface layer
    surface_layer_c         temperature gained on leaving the ground, at night and at noon
    surface_layer_m         its depth
    horizontal_c_per_100m   one sigma of each of the two components, drawn once
    wander_c                one sigma, correlated over 20 minutes
    pressure_walk_hpa       that passes in an hour, one sigma of a random walk
    dew_point_wander_c      one sigma, correlated over 3 hours
    thermometer_offset_c    one sigma, each station
    turbulence              factor on the site's path_index_fluctuation_ppm
    wind_m_s                mean; moves the feed arm with its square
    sky_cooling_c           how far below the air a retroreflector cools under a clear night sky in still air
    """

    temperature_c: float = 11.3
    diurnal_c: float = 5.0
    gradient_c_per_m: tuple[float, float] = (0.008, -0.0098)
    surface_layer_c: tuple[float, float] = (0.4, -0.8)
    surface_layer_m: float = 10.0
    horizontal_c_per_100m: float = 0.05
    wander_c: float = 0.15
    pressure_hpa: float = 930.6
    pressure_walk_hpa: float = 0.2
    humidity_percent: float = 70.5
    dew_point_wander_c: float = 0.3
    thermometer_offset_c: float = 0.3
    turbulence: float = 1.0
    wind_m_s: float = 4.0
    sky_cooling_c: float = 3.0


LIVING_NIGHT = LivingConditions()
WINDY_DAY = replace(LIVING_NIGHT, temperature_c=22.0, humidity_percent=50.0, wind_m_s=9.0, turbulence=2.0)
DEWY_NIGHT = replace(LIVING_NIGHT, humidity_percent=90.0, wind_m_s=1.0)
