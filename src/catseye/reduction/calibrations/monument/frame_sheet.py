"""Sheet of the ground frame and the plumb line.

The origin's place, and the lean of a level's zenith.
"""

from typing import Annotated

from catseye.constants import ARCSECOND, DEGREE
from catseye.geometry.frames.local_frame import PINTLE_LATITUDE, PINTLE_LONGITUDE, LocalFrame
from catseye.records.files.readings import Sheet
from catseye.records.files.record import Coordinate, Elevation, Latitude, Within

Deflection = Annotated[float, Within(-200, 200)]
UAngle = Annotated[float, Within(0, 3600)]  # arcseconds
Longitude = Annotated[float, Within(-180, 180)]


class FrameSheet(Sheet):
    """Sheet of a calibration in the ground frame.

    origin_latitude_deg     latitude of the pintle bearing, NAD83
    origin_longitude_deg    longitude of the pintle bearing, NAD83, east positive
    origin_elevation_m      NAVD88, of z = 0 below or above the pintle
    geoid_height_m          height of the geoid above the ellipsoid there
    xi_arcsec, eta_arcsec   deflection of the vertical: a level's zenith lies xi north and eta east of the
                            ellipsoid's normal
    u_deflection_arcsec     of each of xi_arcsec and eta_arcsec
    z_is_plumb              the frame's z is the plumb line at the origin, not the normal
    """

    origin_latitude_deg: Latitude = PINTLE_LATITUDE / DEGREE
    origin_longitude_deg: Longitude = PINTLE_LONGITUDE / DEGREE
    origin_elevation_m: Elevation = 806.42
    geoid_height_m: Annotated[float, Within(-120, 100)] = -31.0
    xi_arcsec: Deflection = 0.0
    eta_arcsec: Deflection = 0.0
    u_deflection_arcsec: Annotated[float, Within(0, 60)]
    z_is_plumb: bool = False


class MonumentSheet(FrameSheet):
    """Sheet of a monument's calibration, with its fixed point's place.

    In the ground frame.

    x_mm, y_mm, z_mm         coordinates of the fixed point
    u_x_mm, u_y_mm, u_z_mm   of each coordinate
    """

    x_mm: Coordinate
    y_mm: Coordinate
    z_mm: Coordinate


def frame_of(sheet: FrameSheet, *, xi: float = 0.0, eta: float = 0.0) -> LocalFrame:
    """Ground frame of a sheet.

    sheet    what it says of origin, geoid and plumb line
    xi, eta  rad, added to the deflection that it states

    The frame's axes stay where the stated deflection puts them only where z is the ellipsoid's normal; where z is the
    plumb line they follow it, as they are meant to.
    """
    return LocalFrame(
        sheet.origin_latitude_deg * DEGREE,
        sheet.origin_longitude_deg * DEGREE,
        sheet.origin_elevation_m + sheet.geoid_height_m,
        xi=sheet.xi_arcsec * ARCSECOND + xi,
        eta=sheet.eta_arcsec * ARCSECOND + eta,
        geoid_height=sheet.geoid_height_m,
        plumb=sheet.z_is_plumb,
    )
