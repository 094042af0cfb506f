"""Weather conditions of a living site, and switches for its effects."""

from dataclasses import dataclass, replace

from catseye.errors import InputError
from catseye.simulator.night.expansion import STEEL_PER_K
from catseye.simulator.night.faults import EFFECTS, Planted

SEA_LEVEL_K, LAPSE_K_PER_M, POLYTROPIC = 288.15, 0.0065, 5.25588  # K, K/m, g M / R L: [ICAO93]
LIVING_EFFECTS = (
    "air_waves",  # of temperature, common to the site
    "bearing_tilt",  # of the azimuth bearing and track
    "dew",  # amplitude lost on wet retroreflectors
    "diurnal",  # temperature and layers through the day
    "eddies",  # of temperature, which the wind carries across the site
    "encoder",  # errors of the telescope's encoders
    "expansion",  # of the whole telescope with the temperature of its steel
    "fronts",  # steps of temperature that pass
    "gravity",  # bending with elevation
    "horizontal_gradient",  # of temperature
    "pressure_waves",
    "radiation_error",  # of thermometers in the Sun
    "settling",  # monuments sink and lean
    "thermal",  # bending with the temperature of the steel
    "thermometer_lag",
    "vibration",  # of the feed arm
    "weather_wander",  # of temperature, pressure and dew point
    "wind",  # on the feed arm
)


@dataclass(frozen=True)
class LivingPlanted(Planted):
    """Planted changes, with the living site's effects too.

    `signs` and `ignore` take both lists.

    >>> LivingPlanted(ignore=["vibration", "drift"]).gain("vibration")
    0.0
    """

    def __post_init__(self) -> None:
        effects = (*EFFECTS, *LIVING_EFFECTS)
        for effect in (*self.signs, *self.ignore):
            if effect not in effects:
                raise InputError(f"unknown effect {effect!r}: expected one of {', '.join(sorted(effects))}")


STILL = LivingPlanted(ignore=(*EFFECTS, *LIVING_EFFECTS))  # nothing but geometry, air without layers, glass


@dataclass(frozen=True)
class LivingConditions:
    """Air at z = 0 over the pintle at the start, and its changes.

    Magnitudes are chosen; nights are quiet.

    elevation_m             above the sea, for `pressure_hpa`; a site elsewhere has the standard air's pressure
    diurnal_c               half of the day's swing; warmest at 15 h local mean time
    gradient_c_per_m        at night and at noon; above the surface layer
    surface_layer_c         temperature gained on leaving the ground, at night and at noon
    surface_layer_m         its depth
    horizontal_c_per_100m   one sigma of each of the two components, drawn once
    wander_c                one sigma, correlated over 20 minutes
    pressure_walk_hpa       in an hour, one sigma of a random walk
    dew_point_wander_c      one sigma, correlated over 3 hours
    thermometer_offset_c    one sigma, each station
    turbulence              factor on the site's path_index_fluctuation_ppm
    wind_m_s                mean; moves the feed arm with its square
    sky_cooling_c           cooling of a retroreflector below the air under a clear night sky in still air

    Sources of those below and of the periods: `simulator.night.nature`, where a night's largest are twice these.

    wave_c                  largest amplitude of each of three waves of 5 to 90 min
    front_c                 largest step of a front; one comes every two hours
    eddy_c                  one sigma of turbulence that the wind carries
    eddy_outer_m            its outer scale
    pressure_wave_hpa       largest amplitude of each of two waves of 5 to 60 min
    thermometer_lag         s, largest time constant of a station's thermometer
    radiation_c             largest error of a thermometer under a Sun in the zenith in still air
    expansion_per_k         of the whole telescope about the pintle bearing: structural steel's
    dish_expansion          largest share of it by which the dish expands more or less, about its middle
    """

    temperature_c: float = 11.3
    diurnal_c: float = 5.0
    gradient_c_per_m: tuple[float, float] = (0.008, -0.0098)
    surface_layer_c: tuple[float, float] = (0.4, -0.8)
    surface_layer_m: float = 10.0
    horizontal_c_per_100m: float = 0.05
    wander_c: float = 0.15
    pressure_hpa: float = 930.6
    elevation_m: float = 806.42  # z = 0 of the Green Bank site
    pressure_walk_hpa: float = 0.2
    humidity_percent: float = 70.5
    dew_point_wander_c: float = 0.3
    thermometer_offset_c: float = 0.3
    turbulence: float = 1.0
    wind_m_s: float = 4.0
    sky_cooling_c: float = 3.0
    wave_c: float = 0.2
    front_c: float = 0.75
    eddy_c: float = 0.075
    eddy_outer_m: float = 80.0
    pressure_wave_hpa: float = 0.25
    thermometer_lag: float = 60.0
    radiation_c: float = 0.25
    expansion_per_k: float = STEEL_PER_K
    dish_expansion: float = 0.2

    def at(self, elevation_m: float) -> "LivingConditions":
        """Weather at another elevation above the sea, m.

        Pressure as in the standard atmosphere.

        Source: [ICAO93], the layer with a lapse of 6.5 K/km: p / p0 = (T / T0)^(g M / R L).

        >>> round(LIVING_NIGHT.at(319.0).pressure_hpa, 1)
        986.7
        """
        if elevation_m == self.elevation_m:
            return self
        ratio = (SEA_LEVEL_K - LAPSE_K_PER_M * elevation_m) / (SEA_LEVEL_K - LAPSE_K_PER_M * self.elevation_m)
        return replace(self, pressure_hpa=self.pressure_hpa * ratio**POLYTROPIC, elevation_m=elevation_m)


LIVING_NIGHT = LivingConditions()
WINDY_DAY = replace(LIVING_NIGHT, temperature_c=22.0, humidity_percent=50.0, wind_m_s=9.0, turbulence=2.0)
DEWY_NIGHT = replace(LIVING_NIGHT, humidity_percent=90.0, wind_m_s=1.0)
