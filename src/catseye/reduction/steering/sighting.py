"""Visibility of a beam and its retroreflector.

The Sun, boxes that must stay dark, solids; and the retroreflector's incidence.
"""

from dataclasses import dataclass, replace

import numpy as np

from catseye.constants import DEGREE
from catseye.errors import InputError
from catseye.geometry.mirror.imperfect import imperfect_ray
from catseye.geometry.mirror.pointing import MirrorStation, ray
from catseye.geometry.mirror.slew import Pace
from catseye.geometry.sky.sun import altitude_azimuth
from catseye.optics.retroreflector.kinds.registry import kind_named
from catseye.records.site.keep_out import KeepOut
from catseye.records.site.mirror import MirrorGeometry
from catseye.records.site.monument import MonumentGeometry
from catseye.records.site.site import Location
from catseye.records.site.solids import Solids
from catseye.reduction.site.earth_rotation import FramePlace, standard_pressure_hpa, sun_at
from catseye.reduction.site.stations import imperfections_of
from catseye.reduction.steering.guard import GuardAnswer, guard_of
from catseye.reduction.steering.mounted import MountedRanger
from catseye.reduction.steering.visibility import Retroreflectors, Visibility, frames_at, visibility

ANY_PACE = Pace((1.0, 1.0), (1.0, 1.0))  # the axes' speeds do not matter for a pointing


@dataclass(frozen=True)
class Sighting:
    """One beam at one time; None for omitted checks.

    mjd                UTC
    sun, keep_out      verdicts on the Sun's cone, and on the boxes
    separation         rad, of the beam from the middle of the Sun
    altitude, azimuth  rad, of the Sun; the azimuth clockwise from north
    earth_rotation     source of UT1 - UTC
    """

    mjd: float = np.nan
    sun: GuardAnswer | None = None
    keep_out: GuardAnswer | None = None
    separation: float | None = None
    altitude: float | None = None
    azimuth: float | None = None
    earth_rotation: str = ""


def place_of_monument(
    monument: MonumentGeometry, longitude_deg: float | None, latitude_deg: float | None
) -> FramePlace:
    """Place of the site on Earth, by options or the monument's record.

    With standard air, for the Sun's refraction.

    Raises InputError where neither has it, and for an invalid place.
    """
    return _place(monument.monument, monument, None, longitude_deg, latitude_deg)


def place_of_ranger(ranger: MountedRanger, longitude_deg: float | None, latitude_deg: float | None) -> FramePlace:
    """Place of a ranger's site on Earth: by options, its monument's record, or its site's.

    With standard air, for the Sun's refraction.

    Raises InputError where none has it, and for an invalid place.
    """
    located = None if ranger.site is None else ranger.site.site.site
    return _place(ranger.name, ranger.monument, located, longitude_deg, latitude_deg)


def _place(
    name: str,
    monument: MonumentGeometry | None,
    located: Location | None,
    longitude_deg: float | None,
    latitude_deg: float | None,
) -> FramePlace:
    """Place of a ranger: each angle from the first that has it."""
    sources = (monument, located)
    options = {"latitude_deg": latitude_deg, "longitude_deg": longitude_deg}
    angles = {key: _first(value, *(getattr(each, key, None) for each in sources)) for key, value in options.items()}
    for key, limits in (("latitude_deg", (-90.0, 90.0)), ("longitude_deg", (-180.0, 360.0))):
        value = angles[key]
        if value is not None and not limits[0] <= value <= limits[1]:
            raise InputError(f"{key} = {value:g} is outside {limits[0]:g} to {limits[1]:g} (degrees)")
        if value is None:
            raise InputError(
                f"the direction of the Sun or a star needs {key}, which the record of {name} lacks (expected there, or "
                "as an argument)"
            )
    height = _first(getattr(monument, "elevation_m", None), getattr(located, "elevation_of_z0_m", None)) or 0.0
    latitude, longitude = float(angles["latitude_deg"] or 0.0) * DEGREE, float(angles["longitude_deg"] or 0.0) * DEGREE
    return FramePlace(latitude, longitude, height, standard_pressure_hpa(height))


def _first(*values: float | None) -> float | None:
    """First value that is known."""
    return next((value for value in values if value is not None), None)


def sightings(
    station: MirrorStation,
    mirror: MirrorGeometry,
    counts: np.ndarray,
    *,
    name: str,
    mjd: float | None,
    place: FramePlace | None,
    keep_out: KeepOut,
) -> list[Sighting]:
    """Sun and keep-out boxes for beams at counts (n, 2).

    The azimuth stops are not checked here.

    mirror  its tilts and encoder errors widen every zone
    name    of the ranger, for the answers
    mjd     UTC; None: the Sun is not checked, `place` unused
    """
    guard = guard_of(name, station, mirror, keep_out=keep_out, place=place, pace=ANY_PACE)
    free = replace(guard, azimuth_limits=(-np.inf, np.inf))
    under_sun = None if mjd is None else replace(free, boxes=())
    boxed = replace(free, place=None) if keep_out.box else None
    imperfections = imperfections_of(mirror)
    sun = None if mjd is None or place is None else sun_at(mjd, place)
    sighted = []
    for n in counts:
        sighting = Sighting(keep_out=None if boxed is None else boxed.pointing(mjd or 0.0, n))
        if sun is not None and under_sun is not None and mjd is not None:
            altitude, azimuth = altitude_azimuth(sun.direction)
            beam = ray(station, n) if imperfections is None else imperfect_ray(station, imperfections, n)
            across = np.linalg.norm(np.cross(beam.direction, sun.direction))
            sighting = replace(
                sighting,
                mjd=mjd,
                sun=under_sun.pointing(mjd, n),
                separation=float(np.arctan2(across, beam.direction @ sun.direction)),
                altitude=float(altitude),
                azimuth=float(azimuth),
                earth_rotation=str(sun.status),
            )
        sighted.append(sighting)
    return sighted


def seen_from(
    station: MirrorStation,
    name: str,
    to: np.ndarray,
    *,
    kind: str,
    facing: np.ndarray | None,
    solids: Solids,
    posture: tuple[float, float] | None,
    reachable: np.ndarray | None = None,
) -> Visibility:
    """Visibility of retroreflectors at points (n, 3), m, for one ranger.

    Points in the ground frame.

    kind      name of the retroreflectors' kind
    facing    (3,) of all of them, ground: outward normal; None: incidence is not judged
    solids    possible obstructions
    posture   azimuth, elevation, rad, of the telescope if it carries some of them
    reachable (n,) bool: within the azimuth stops in one of the pointings

    Raises InputError for an unknown kind, and for a solid on the telescope without a posture.
    """
    aboard = next((solid for solid in solids.all if solid.frame != "ground"), None)
    if posture is None and aboard is not None:
        raise InputError(
            f"solid {aboard.name!r} stands in the frame {aboard.frame}: its position is unknown (expected posture_deg)"
        )
    axis = np.full(3, np.nan) if facing is None else facing
    return visibility(
        {name: station.scan_point},
        Retroreflectors(("",) * len(to), (kind_named(kind),) * len(to), to, np.broadcast_to(axis, to.shape)),
        solids,
        frames=frames_at(*(posture or (0.0, 0.0))),
        reachable=None if reachable is None else reachable[None],
    )
