"""`point`: a mirror's encoder counts for points."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.api.result import Result, digest_of, quantities
from catseye.api.telescope.inputs import InputFiles, mjd_of_argument, posture_of, refuse_alone, telescope_of
from catseye.api.units import In, with_units
from catseye.errors import ArgumentError

if TYPE_CHECKING:
    from astropy.table import QTable

    from catseye.gateways.writers.passage import Passage
    from catseye.records.site.folder import SiteFolder
    from catseye.records.site.keep_out import KeepOut
    from catseye.records.site.mirror import MirrorGeometry
    from catseye.records.site.monument import MonumentGeometry
    from catseye.records.site.solids import Solids
    from catseye.reduction.site.stations import Pointings
    from catseye.reduction.steering.aiming import AimedPoints
    from catseye.reduction.steering.sighting import Sighting
    from catseye.reduction.steering.visibility import Visibility


@dataclass(frozen=True, eq=False, repr=False)
class PointingResult(Result):
    """Counts of one mirror for n points: CAL.EQ.

    to             (n, 3) m, ground
    range_         (n,) m, from the scan point
    counts         (n, 2) azimuth and elevation, direct pointing; real numbers, not rounded
    u              (n, 2) counts; nan where a record does not have what it needs
    prime          (n, 2) counts of the prime pointing
    autocollimation, back_retro   (n,) counts of elevation
    allowed, prime_allowed        (n,) bool: within the mirror's stops
    aimed          everything else
    names          monument, mirror, and the mirror that the monument's record names; of a site also its ranger
    read           files that were read
    frame          of the points
    in_frame       (n, 3) m, in that frame
    posture        azimuth, elevation, rad, of the telescope; None where nothing depends on it
    """

    to: np.ndarray
    range_: np.ndarray
    counts: np.ndarray
    u: np.ndarray
    prime: np.ndarray
    autocollimation: np.ndarray
    back_retro: np.ndarray
    allowed: np.ndarray
    prime_allowed: np.ndarray
    aimed: "AimedPoints"
    names: dict[str, str | None] = field(default_factory=dict)
    read: tuple[Path, ...] = ()
    frame: str = "ground"
    in_frame: np.ndarray | None = None
    posture: tuple[float, float] | None = None

    @property
    def pointings(self) -> "Pointings":
        """Counts, stops and uncertainties, and the rays they follow from."""
        return self.aimed.pointings

    @property
    def sightings(self) -> "list[Sighting]":
        """Sun and keep-out boxes, one a point, where they were asked for."""
        return self.aimed.sightings

    @property
    def visibility(self) -> "Visibility | None":
        """Visibility of each point's reflector, where that was asked for."""
        return self.aimed.visibility

    def passages(self) -> "Sequence[Passage]":
        """Number of points within reach, and remarks."""
        from catseye.gateways.steering.pointing_objects import pointing_remarks
        from catseye.gateways.writers.passage import Passage

        reached = int(np.sum(self.allowed | self.prime_allowed))
        text = f"{self._mounted} reaches {reached} of {len(self.to)} points."
        remarks = pointing_remarks(self.aimed)
        if self.posture is not None:
            azimuth, elevation = (float(np.degrees(v)) for v in self.posture)
            where = f"azimuth {azimuth:.10g}, elevation {elevation:.10g} deg"
            remarks = [
                f"points of the frame {self.frame.replace('_', ' ')}, telescope at {where}, rigid; x, y, z and "
                "counts are of the ground frame and this posture",
                *remarks,
            ]
        recorded, used = self.names.get("mirror_of_monument"), self.names.get("mirror")
        if recorded is not None and recorded != used:
            of = self.names.get("monument")
            remarks = [f"{used} is not the mirror that the record of {of} names, {recorded}", *remarks]
        return [Passage("Counts", text), *(Passage("Note", remark) for remark in remarks)]

    def to_object(self) -> Any:
        """JSON object of `catseye point --json`: a list, one object a point."""
        from catseye.gateways.steering.pointing_objects import pointing_objects

        items = [{**item, **self.names} for item in pointing_objects(self.aimed)]
        if self.posture is None or self.in_frame is None:
            return items
        posture = dict(zip(("azimuth", "elevation"), self.posture, strict=True))
        more = {"frame": self.frame, "posture": posture}
        return [{**item, **more, "in_frame": at.tolist()} for item, at in zip(items, self.in_frame, strict=True)]

    @property
    def _mounted(self) -> str:
        """Mirror and what it stands on."""
        return f"{self.names['mirror']} on {self.names['monument'] or self.names['ranger']}"

    def lines(self) -> list[str]:
        """Lines of the table of counts that the command prints."""
        from catseye.gateways.steering.pointing_objects import pointing_table

        return pointing_table(self.pointings).splitlines()

    def save_counts(self, path: "str | os.PathLike[str]") -> None:
        """Write CAL.EQ's output.dat.

        path   new, or an earlier file of catseye

        Raises InputError for another's file, and where nothing can be written.
        """
        from catseye.gateways.steering.pointing_objects import write_output_dat

        write_output_dat(self.pointings, self._mounted, Path(path))

    def tables(self) -> "dict[str, QTable]":
        """`counts`: a row a point."""
        columns = {
            **{axis: (self.to[:, k], "m") for k, axis in enumerate("xyz")},
            "range": (self.range_, "m"),
            "azimuth_counts": (self.counts[:, 0], ""),
            "elevation_counts": (self.counts[:, 1], ""),
            "u_azimuth_counts": (self.u[:, 0], ""),
            "u_elevation_counts": (self.u[:, 1], ""),
            "allowed": (self.allowed, ""),
            "prime_azimuth_counts": (self.prime[:, 0], ""),
            "prime_elevation_counts": (self.prime[:, 1], ""),
            "prime_allowed": (self.prime_allowed, ""),
        }
        return {"counts": quantities(columns)}

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each record read."""
        return {path.name: digest_of(path) for path in self.read if path.is_file()}

    def sources(self) -> tuple[Path, ...]:
        """Records that `save` leaves alone: those read."""
        return self.read


@with_units
def point(
    monument: "str | os.PathLike[str] | MonumentGeometry | None" = None,
    mirror: "str | os.PathLike[str] | MirrorGeometry | None" = None,
    to: Annotated[Any, In("m", text=True)] = None,
    *,
    site: "str | os.PathLike[str] | SiteFolder | None" = None,
    ranger: str | None = None,
    frame: str = "ground",
    at_mjd: Annotated[Any, In("mjd", one=True, text=True)] = None,
    latitude_deg: Annotated[Any, In("deg", one=True)] = None,
    longitude_deg: Annotated[Any, In("deg", one=True)] = None,
    sun_cone_deg: Annotated[Any, In("deg", one=True)] = None,
    keep_out: "str | os.PathLike[str] | KeepOut | None" = None,
    reflector: str | None = None,
    facing: Annotated[Any, In("", many=True)] = None,
    solids: "str | os.PathLike[str] | Solids | None" = None,
    posture_deg: Annotated[Any, In("deg", many=True)] = None,
) -> PointingResult:
    """Encoder counts of a mirror for points: CAL.EQ.

    Both pointings, with stops, Sun, keep-out boxes and visibility.

    monument, mirror   records, or their files
    to                 (n, 3) or (3,) m, in the frame; or a coord.dat of lines x y z in mm
    site, ranger       instead of the records: a site, and the name of its ranger, on the ground or the feed arm
    frame              of the points: "ground", "alidade", "elevation", "reflector", "feed_arm", "prime_focus" or
                       "subreflector", of a rigid telescope at the posture
    at_mjd             UTC, MJD or a text such as 2003-09-07T15:12:09Z: is the Sun in the way?
    latitude_deg, longitude_deg   of the site, east positive; the monument's record without; with at_mjd
    sun_cone_deg       half angle kept from the Sun, 0.5 to 60; of keep_out, or 5, without; with at_mjd
    keep_out           boxes that no beam may enter, or their file
    reflector          "prism", "hollow" or "ball" at the points: is it visible?
    facing             (3,) outward axis of the reflectors, ground axes
    solids             obstacles, or their file
    posture_deg        azimuth and elevation of the telescope, for points, rangers and solids that it carries; the
                       site's own without

    Raises ArgumentError for arguments that do not fit together, InputError for records that cannot be used.
    Source: [PARKER04] section 2; eqs. 2.40 to 2.44 for frames, section 2.6.1 for the feed arm.

    >>> counts = point("night-01/monuments/ZY103.toml", "night-01/mirrors/ZP103.toml", [0.0, 0.0, 50.0]).counts
    >>> counts.shape
    (1, 2)
    >>> on_arm = point(site="gbt", ranger="ZY115", frame="reflector", to=[0, 54, 12.2], posture_deg=(145.3, 30))
    >>> on_arm.range_.round(2).tolist()
    [74.89]
    """
    from catseye.geometry.antenna.rigid_telescope import FRAMES
    from catseye.records.site.keep_out import KeepOut
    from catseye.records.site.solids import Solids
    from catseye.reduction.steering.aiming import BeamSurroundings, aim_ranger
    from catseye.reduction.steering.mounted import posture_of_site

    mjd, cone, posture = mjd_of_argument(at_mjd), _sun_cone(sun_cone_deg), posture_of(posture_deg)
    axis = _facing(facing)
    by_sun = {"sun_cone_deg": sun_cone_deg, "latitude_deg": latitude_deg, "longitude_deg": longitude_deg}
    refuse_alone(by_sun, "at_mjd", at_mjd)
    if frame not in FRAMES:
        raise ArgumentError(f"frame = {frame!r} is unknown (expected one of {', '.join(FRAMES)})", "frame")
    if to is None:
        raise ArgumentError("to is missing (expected points, or their file)", "to")
    records = InputFiles()
    stands = None if site is None else records.site(site)
    mounted = records.ranger(monument, mirror, stands, ranger)
    moving = frame != "ground" or mounted.moves
    if not moving and posture_deg is not None and solids is None:
        text = "posture_deg says nothing without solids, a frame that moves, or a ranger on the feed arm"
        raise ArgumentError(text, "posture_deg", "solids")
    if posture is None and stands is not None:
        posture = posture_of_site(stands)
    if posture is None and moving:
        raise ArgumentError(
            f"posture_deg is missing: it moves the frame {frame} (expected azimuth and elevation)", "posture_deg"
        )
    telescope = telescope_of(stands, posture) if moving and posture is not None else None
    points = records.points(to)
    where = points if telescope is None else telescope.ground_from(frame).points(points)
    zones = KeepOut() if keep_out is None else records.read(keep_out, KeepOut)
    if cone is not None:
        zones = zones.model_copy(update={"sun": zones.sun.model_copy(update={"half_angle_deg": cone})})
    surroundings = BeamSurroundings(
        mjd=mjd,
        longitude_deg=longitude_deg,
        latitude_deg=latitude_deg,
        keep_out=zones,
        kind=reflector,
        facing=axis,
        solids=None if solids is None else records.read(solids, Solids),
        posture=posture,
    )
    aimed = aim_ranger(mounted, where, surroundings, telescope)
    pointings = aimed.pointings
    return PointingResult(
        verdict=aimed.verdict,
        to=pointings.to,
        range_=pointings.aim.range,
        counts=pointings.counts,
        u=pointings.u,
        prime=pointings.prime,
        autocollimation=pointings.autocollimation,
        back_retro=pointings.back_retro,
        allowed=pointings.allowed,
        prime_allowed=pointings.prime_allowed,
        aimed=aimed,
        names=mounted.names,
        read=tuple(records.paths),
        frame=frame,
        in_frame=points,
        posture=posture if moving else None,
    )


def _sun_cone(sun_cone_deg: float | None) -> float | None:
    """Half angle of the Sun's cone, deg. Raises ArgumentError outside 0.5 to 60."""
    if sun_cone_deg is not None and not 0.5 <= sun_cone_deg <= 60.0:
        raise ArgumentError(f"sun_cone_deg = {sun_cone_deg:g} is not 0.5 to 60 degrees", "sun_cone_deg")
    return sun_cone_deg


def _facing(facing: Sequence[float] | None) -> np.ndarray | None:
    """Outward axis (3,). Raises ArgumentError for a zero vector."""
    axis = None if facing is None else np.asarray(facing, dtype=float)
    if axis is not None and (axis.shape != (3,) or not np.isfinite(axis).all() or not axis.any()):
        raise ArgumentError(f"facing = {axis.tolist()} points nowhere (expected three numbers, not all zero)", "facing")
    return axis
