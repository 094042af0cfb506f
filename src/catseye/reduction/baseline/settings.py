"""Settings of a baseline's calibration."""

from dataclasses import dataclass

from catseye.atmosphere.sound.velocity import REFRACTION
from catseye.names import AIR_MODEL


@dataclass(frozen=True)
class BaselineSettings:
    """Assumptions of a baseline's reduction.

    air_model, wavelength_um, co2_ppm   of the group index; the carrier of both of Busselton's instruments
    reference_index       group index of the displayed lengths
    corrected             True: the displayed lengths contain the first velocity correction already
    refraction            coefficient k of the ray
    u_temperature_c, u_pressure_hpa, u_humidity_percent   common to all shots: the sensors, and the difference of one
                                                          end from the
                          path; changes from set to set are noise
    u_scale_ppm           of the instrument's scale without a known baseline: its frequency
    u_direction_arcsec, u_centring_mm   of one set's circle reading, and across the line
    unit_length           m, of the cyclic terms; None leaves them out
    orders                of the cyclic terms, 1 to 4
    specified_mm, specified_ppm   standard deviation a + b D by the maker
    level                 of each test
    reject                True: leave out single shots and sets that the tests reject
    reference_height      m; None: the first pillar's, or the known baseline's
    """

    air_model: str = AIR_MODEL
    wavelength_um: float = 0.658
    co2_ppm: float = 420.0
    reference_index: float = 1.000286338
    corrected: bool = False
    refraction: float = REFRACTION
    u_temperature_c: float = 0.5
    u_pressure_hpa: float = 0.3
    u_humidity_percent: float = 5.0
    u_scale_ppm: float = 1.0
    u_direction_arcsec: float = 0.6
    u_centring_mm: float = 0.2
    unit_length: float | None = None
    orders: int = 1
    specified_mm: float = 0.6
    specified_ppm: float = 1.0
    level: float = 0.05
    reject: bool = False
    reference_height: float | None = None
