"""monuments/ZYnnn.toml: surveyed fixed point and orientation of a ground ranger's Kelvin mount."""

import math
from typing import Annotated, Self

from pydantic import Field, model_validator

from catseye.constants import DEGREE, TWO_PI
from catseye.records.files.record import (
    Certificate,
    Coordinate,
    Elevation,
    Latitude,
    Name,
    Version,
    Within,
    broken_rule,
)

LEAST_RADIUS_MM, MOST_RADIUS_MM = 1e3, 1e7  # of a monument about the pintle
AZIMUTH_TOLERANCE = 1e-4  # rad: above the rounding of both values, below any error of sign or digit
HeldOrUncertain = Annotated[float, Within(0, 100)]  # mm; zero means held fixed
Turn = Annotated[float, Within(-TWO_PI, TWO_PI)]
Tilt = Annotated[float, Within(-0.1, 0.1)]
UncertainTilt = Annotated[float, Within(0, 0.1, above=True)]
Longitude = Annotated[float, Within(-180, 360)]  # degrees, east positive
Text = Annotated[str, Field(min_length=1)]


class MonumentGeometry(Certificate):
    """Monument data required for pointing; the survey's u and the geographic place may be missing.

    monument                 the ranger's name
    zp                       name of its mirror
    control_panel, ethernet_address, ip_address  identification of the ranger's cabinet
    x_mm, y_mm, z_mm         Kelvin fixed point, ground frame
    u_x_mm, u_y_mm, u_z_mm   of each coordinate; 0: held fixed
    azimuth_deg              survey azimuth, clockwise from north, of the line from fixed point to v-block
    alpha1_rad               pi - azimuth, about y^
    alpha2_rad               about z^, positive: x^ rises
    alpha3_rad               about x^, positive: z^ (the v-block) sinks
    latitude_deg             latitude of the monument, NAD83
    longitude_deg            longitude of the monument, NAD83, east positive
    elevation_m              above sea level
    wv_x_m, wv_y_m           West Virginia South state plane (NAD83): easting, northing
    wv_z_m                   elevation of the monument by the survey
    notes                    NOTES of the report
    """

    format: Annotated[int | str, Version("monument")] = 1
    monument: Name
    zp: Name | None = None
    control_panel: Text | None = None
    ethernet_address: Text | None = None
    ip_address: Text | None = None
    x_mm: Coordinate
    y_mm: Coordinate
    z_mm: Annotated[float, Within(-1e6, 1e6)]
    u_x_mm: HeldOrUncertain | None = None
    u_y_mm: HeldOrUncertain | None = None
    u_z_mm: HeldOrUncertain | None = None
    azimuth_deg: Annotated[float, Within(-360, 360)] | None = None
    alpha1_rad: Turn
    alpha2_rad: Tilt
    alpha3_rad: Tilt
    u_alpha1_rad: UncertainTilt | None = None
    u_alpha2_rad: UncertainTilt | None = None
    u_alpha3_rad: UncertainTilt | None = None
    latitude_deg: Latitude | None = None
    longitude_deg: Longitude | None = None
    elevation_m: Elevation | None = None
    wv_x_m: Annotated[float, Within(1e5, 2e6)] | None = None
    wv_y_m: Annotated[float, Within(-1e6, 1e6)] | None = None
    wv_z_m: Elevation | None = None
    notes: Text | None = None

    @model_validator(mode="after")
    def _stands_off_the_pintle(self) -> Self:
        radius = math.hypot(self.x_mm, self.y_mm)
        if not LEAST_RADIUS_MM <= radius <= MOST_RADIUS_MM:
            metres = " looks like metres" if LEAST_RADIUS_MM <= radius * 1e3 <= MOST_RADIUS_MM else ""
            limits = f"expected a distance from the pintle of {LEAST_RADIUS_MM:g} to {MOST_RADIUS_MM:g}"
            raise broken_rule(f"x_mm, y_mm = {self.x_mm}, {self.y_mm}{metres} ({limits})")
        return self

    @model_validator(mode="after")
    def _turns_as_surveyed(self) -> Self:
        if self.azimuth_deg is None:
            return self
        expected = math.pi - self.azimuth_deg * DEGREE
        if abs(math.remainder(self.alpha1_rad - expected, TWO_PI)) > AZIMUTH_TOLERANCE:
            nearest = math.remainder(expected, TWO_PI)
            raise broken_rule(
                f"alpha1_rad = {self.alpha1_rad} does not belong to azimuth_deg = {self.azimuth_deg} "
                f"(expected alpha1 = pi - azimuth = {nearest:.7f}, within {AZIMUTH_TOLERANCE:g} rad)"
            )
        return self


class MonumentRecord(MonumentGeometry):
    """Ground monument, complete for ranging; its keys are in `MonumentGeometry`."""

    zp: Name
    u_x_mm: HeldOrUncertain
    u_y_mm: HeldOrUncertain
    u_z_mm: HeldOrUncertain
    azimuth_deg: Annotated[float, Within(-360, 360)]
    latitude_deg: Latitude
    elevation_m: Elevation
