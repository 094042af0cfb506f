"""site.toml: posture, frames, telescope constants, ranging constants, converter, weather stations."""

from typing import Annotated

from pydantic import Field, model_validator

from catseye.records.files.record import (
    Certificate,
    Elevation,
    Latitude,
    Length,
    Mjd,
    Name,
    Pair,
    Record,
    TelescopeAzimuth,
    TelescopeElevation,
    Vector,
    Version,
    Within,
    broken_rule,
)

MOST_SAMPLES = 65_536  # of one buffer
PositiveMillimetres = Annotated[float, Within(500, 1e6)]


class PostureRecord(Record):
    """[campaign]: time and position of the telescope.

    name            name of the campaign, or of the site
    start_mjd_utc   time of the start
    azimuth_deg     azimuth of the telescope, clockwise from north
    elevation_deg   elevation of the telescope
    """

    name: str = Field(min_length=1)
    start_mjd_utc: Mjd
    azimuth_deg: TelescopeAzimuth
    elevation_deg: TelescopeElevation


class Location(Record):
    """[site]: longitude east positive; elevation of the ground frame's z = 0 above sea level.

    latitude_deg        latitude of the pintle bearing, north positive
    longitude_deg       longitude of the pintle bearing, east positive
    elevation_of_z0_m   of the ground frame's z = 0 above sea level
    """

    latitude_deg: Latitude
    longitude_deg: Annotated[float, Within(-180, 360)]
    elevation_of_z0_m: Elevation


class GroundFrame(Record):
    """[frames.ground]: x east, y north, z up.

    description   text, for people
    """

    description: str


class ReflectorFrame(Record):
    """[frames.reflector]: z along the paraboloid's axis, and its nominal transformation to ground.

    description                 text, for people
    reflector_to_elevation_mm   vector from the vertex to the elevation axis, reflector frame
    elevation_axis_height_mm    of the elevation axis above z = 0
    """

    description: str
    reflector_to_elevation_mm: Annotated[Vector, Length(100, 1e6, or_zero=True)]
    elevation_axis_height_mm: PositiveMillimetres


class Frames(Record):
    """[frames]: the two frames of all positions.

    ground      ground frame
    reflector   reflector frame
    """

    ground: GroundFrame
    reflector: ReflectorFrame


class ParaboloidRecord(Record):
    """[paraboloid]: the design surface; its aperture in the reflector frame's x and y.

    focal_length_mm      focal length of the parent paraboloid
    aperture_centre_mm   x, y of the middle of the aperture
    aperture_radius_mm   radius of the aperture
    """

    focal_length_mm: PositiveMillimetres
    aperture_centre_mm: Annotated[Pair, Length(500, 1e6, or_zero=True)]
    aperture_radius_mm: Annotated[float, Within(250, 1e6)]


class Ranging(Record):
    """[ranging]: the modulation, and typical noise of electronics and air.

    modulation_hz                  frequency of the modulation
    if_hz                          intermediate frequency of the samples
    wavelength_um                  wavelength of the light in vacuum
    bk7_to_air_group_index_ratio   group index of BK 7 over that of air
    bk7_to_air_phase_index_ratio   refracts oblique light, if given; else the group index, as in appendix B of the
                                   triplet memo (0.4 um at 30 degrees)
    electronic_drift_mrad_per_sqrt_hour  random walk of the phase of the electronics
    path_index_fluctuation_ppm     departure of a path from smooth air
    """

    modulation_hz: Annotated[float, Within(1e6, 1e11)]
    if_hz: Annotated[float, Within(1, 1e8)]
    wavelength_um: Annotated[float, Within(0.2, 20)]
    bk7_to_air_group_index_ratio: Annotated[float, Within(1.3, 2.0)]
    bk7_to_air_phase_index_ratio: Annotated[float, Within(1.3, 2.0)] | None = None
    electronic_drift_mrad_per_sqrt_hour: Annotated[float, Within(0, 6283)]
    path_index_fluctuation_ppm: Annotated[float, Within(0, 300)]


class Adc(Record):
    """[adc]: the converter; code 32768 corresponds to full_scale_volt.

    bits                resolution of the converter
    full_scale_volt     voltage of code 32768
    samples_per_cycle   samples in a cycle of the intermediate frequency
    cycles              number of cycles in a buffer
    """

    bits: Annotated[int, Within(8, 16)]
    full_scale_volt: Annotated[float, Within(0.01, 1000)]
    samples_per_cycle: Annotated[int, Within(3, MOST_SAMPLES)]
    cycles: Annotated[int, Within(1, MOST_SAMPLES)]

    @model_validator(mode="after")
    def _fits_a_buffer(self) -> "Adc":
        if self.cycles * self.samples_per_cycle > MOST_SAMPLES:
            raise broken_rule(too_many_samples(self.cycles, self.samples_per_cycle, MOST_SAMPLES))
        return self


class WeatherStation(Record):
    """[[weather_station]]: elevation above sea level, place in ground frame.

    x_m, y_m   east and north of the pintle bearing; unknown if missing
    name       name of the station
    elevation_m  elevation of its sensors above sea level
    """

    name: Name
    elevation_m: Elevation
    x_m: float | None = None
    y_m: float | None = None


class InCommon(Record):
    """[in_common]: uncertainties common to records of one kind, as consider parameters.

    certificate_scale_ppm   scale error (1σ) of all benchmark certificates of one laboratory; 0: errors are independent
    survey_scale_ppm        scale error (1σ) of all monuments of one survey; likewise
    glass_index_ratio       common error (1σ) of bk7_to_air_group_index_ratio
    sheets_at_c             calibration temperature of heads and prisms; if given, the expansion of steel and glass to
                            the campaign's is uncertain in common; else it is covered by their own u
    """

    certificate_scale_ppm: Annotated[float, Within(0, 1000)] = 0.0
    survey_scale_ppm: Annotated[float, Within(0, 1000)] = 0.0
    glass_index_ratio: Annotated[float, Within(0, 0.1)] = 0.0
    sheets_at_c: Annotated[float, Within(-50, 60)] | None = None


class SiteRecord(Certificate):
    """Complete content of site.toml.

    campaign          time and posture
    site              geographic place
    frames            frames of all positions
    paraboloid        design surface of the dish
    ranging           modulation and typical noise
    in_common         uncertainties common to records of one kind
    adc               converter
    weather_station   weather stations
    """

    format: Annotated[int | str, Version("site")] = 1
    campaign: PostureRecord
    site: Location
    frames: Frames
    paraboloid: ParaboloidRecord
    ranging: Ranging
    in_common: InCommon = InCommon()
    adc: Adc
    weather_station: Annotated[tuple[WeatherStation, ...], Field(strict=False, min_length=1)]

    @model_validator(mode="after")
    def _has_unique_stations(self) -> "SiteRecord":
        names = [station.name for station in self.weather_station]
        for name in names:
            if names.count(name) > 1:
                raise broken_rule(f"weather_station {name!r} is given twice (expected unique stations)")
        return self


def too_many_samples(cycles: int, samples_per_cycle: int, most: int) -> str:
    product = cycles * samples_per_cycle
    return f"cycles * samples_per_cycle = {cycles} * {samples_per_cycle} = {product} (expected at most {most})"
