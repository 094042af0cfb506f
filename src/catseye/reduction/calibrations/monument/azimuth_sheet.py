"""Sheet and table of directions on a Kelvin mount."""

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from catseye.records.files.readings import TEXT, SheetLayout
from catseye.records.files.record import Coordinate, Name, Record, Within, broken_rule
from catseye.reduction.calibrations.monument.frame_sheet import MonumentSheet, UAngle

KIND = "monument-azimuth"
Direction = Annotated[float, Within(-720, 720)]
ULength = Annotated[float, Within(0, 1e4)]  # mm


class Reference(Record):
    """Target with a known direction from the v-block.

    name               name of the target
    v_block_deg        direction of the v-block, clockwise from the target
    u_v_block_arcsec   of that direction

    The v-block lies v_block_deg clockwise of it.
    """

    name: Name
    v_block_deg: Direction
    u_v_block_arcsec: UAngle


class KnownPoint(Record):
    """Target with coordinates in the ground frame and their u.

    name               name of the target
    x_mm, y_mm, z_mm   coordinates
    """

    name: Name
    x_mm: Coordinate
    y_mm: Coordinate
    z_mm: Coordinate
    u_x_mm: ULength = 0.0
    u_y_mm: ULength = 0.0
    u_z_mm: ULength = 0.0


class CataloguedStar(Record):
    """Star, ICRS at J2000.0.

    name                   name of the star
    ra_deg                 right ascension
    dec_deg                declination
    motion_ra_mas          motion in right ascension times cos(declination), a year
    motion_dec_mas         motion in declination, a year
    parallax_mas           annual parallax
    radial_velocity_km_s   positive away from us

    Motion a year, that of right ascension times cos(declination).
    """

    name: Name
    ra_deg: Annotated[float, Within(0, 360)]
    dec_deg: Annotated[float, Within(-90, 90)]
    motion_ra_mas: Annotated[float, Within(-11_000, 11_000)] = 0.0
    motion_dec_mas: Annotated[float, Within(-11_000, 11_000)] = 0.0
    parallax_mas: Annotated[float, Within(0, 1000)] = 0.0
    radial_velocity_km_s: Annotated[float, Within(-1000, 1000)] = 0.0


class AzimuthSheet(MonumentSheet):
    """Sheet of directions on a Kelvin mount.

    covariance_mm2                  covariance of fixed point and points, x y z each, in order; replaces all u
    alpha2_rad, alpha3_rad          tilts of the mount, if known: they carry the instrument's offset
    instrument_dx_mm, instrument_dy_mm, instrument_dz_mm  from the fixed point to where the instrument's axes meet,
                                    mount axes
    u_instrument_mm                 of each coordinate of that offset
    plate_zero_deg, u_plate_zero_arcsec   what the circle reads towards the v-block, if that was calibrated
    u_transport_arcsec              change of the circle against the mount between the lab before and after
    u_direction_arcsec              of one pointing and reading, if known
    u_collimation_arcsec, u_trunnion_arcsec   of the instrument; both faces take them out
    lean_x_arcsec, lean_z_arcsec    lean of the vertical axis's top towards x^ and z^ in the field, by plate level
    u_lean_arcsec                   of each component of the lean
    ut1_utc_s, u_ut1_utc_s          UT1 - UTC; below 0.9 s in size, so that not knowing it is u = 0.52 s
    u_clock_s                       of the times, all together
    pole_x_arcsec, pole_y_arcsec    coordinates of the Earth's pole; below 0.6" in size
    u_pole_arcsec                   of each coordinate of the pole
    reference, point, star          tables [[reference]], [[point]], [[star]]; Polaris is known
    """

    u_x_mm: ULength = 0.0
    u_y_mm: ULength = 0.0
    u_z_mm: ULength = 0.0
    covariance_mm2: Annotated[tuple[Annotated[tuple[float, ...], Field(strict=False)], ...], Field(strict=False)] = ()
    alpha2_rad: Annotated[float, Within(-0.1, 0.1)] = 0.0
    alpha3_rad: Annotated[float, Within(-0.1, 0.1)] = 0.0
    instrument_dx_mm: Annotated[float, Within(-1000, 1000)]
    instrument_dy_mm: Annotated[float, Within(-1000, 3000)]
    instrument_dz_mm: Annotated[float, Within(-1000, 1000)]
    u_instrument_mm: ULength
    plate_zero_deg: Direction | None = None
    u_plate_zero_arcsec: UAngle | None = None
    u_transport_arcsec: UAngle | None = None
    u_direction_arcsec: Annotated[float, Within(0, 3600, above=True)] | None = None
    u_collimation_arcsec: UAngle
    u_trunnion_arcsec: UAngle
    lean_x_arcsec: Annotated[float, Within(-3600, 3600)] = 0.0
    lean_z_arcsec: Annotated[float, Within(-3600, 3600)] = 0.0
    u_lean_arcsec: UAngle
    ut1_utc_s: Annotated[float, Within(-0.9, 0.9)] = 0.0
    u_ut1_utc_s: Annotated[float, Within(0, 1)] = 0.52
    u_clock_s: Annotated[float, Within(0, 60)] = 0.0
    pole_x_arcsec: Annotated[float, Within(-1, 1)] = 0.0
    pole_y_arcsec: Annotated[float, Within(-1, 1)] = 0.0
    u_pole_arcsec: Annotated[float, Within(0, 1)] = 0.3
    reference: Annotated[tuple[Reference, ...], Field(strict=False)] = ()
    point: Annotated[tuple[KnownPoint, ...], Field(strict=False)] = ()
    star: Annotated[tuple[CataloguedStar, ...], Field(strict=False)] = ()

    @model_validator(mode="after")
    def _has_a_covariance_of_its_points(self) -> "AzimuthSheet":
        if self.plate_zero_deg is not None and self.u_plate_zero_arcsec is None:
            raise broken_rule("u_plate_zero_arcsec is missing (expected a value beside plate_zero_deg)")
        if not self.covariance_mm2:
            return self
        n = 3 * (1 + len(self.point))
        if len(self.covariance_mm2) != n or any(len(row) != n for row in self.covariance_mm2):
            raise broken_rule(f"covariance_mm2 is not {n} by {n} (expected x, y, z of the fixed point and each point)")
        matrix = np.array(self.covariance_mm2)
        if np.any(np.abs(matrix - matrix.T) > 1e-9 * np.abs(matrix).max()):
            raise broken_rule("covariance_mm2 is not symmetric")
        if np.linalg.eigvalsh(matrix).min() < -1e-9 * np.abs(matrix).max():
            raise broken_rule("covariance_mm2 is not positive: a combination of coordinates would have u² below 0")
        return self


LAYOUT = SheetLayout(
    KIND,
    AzimuthSheet,
    required={"target": TEXT, "direction_deg": Within(-360, 720)},
    optional={"face": TEXT, "place": TEXT, "set": TEXT, "zenith_deg": Within(1, 179)},
)
