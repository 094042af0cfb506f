"""Rangers by name, on the ground and on the feed arm, and the rigid telescope of a site."""

from dataclasses import dataclass

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.errors import InputError
from catseye.geometry.antenna.rigid_telescope import RigidTelescope
from catseye.geometry.mirror.pointing import MirrorStation, counts_covariance
from catseye.records.site.folder import SiteFolder
from catseye.records.site.mirror import MirrorGeometry
from catseye.records.site.monument import MonumentGeometry
from catseye.records.site.target import FeedArmRanger
from catseye.reduction.site.stations import feed_arm_station, mirror_variances, station_covariance, station_of
from catseye.reduction.structure.moving_ranger import MovingRanger

U_POSITION = 0.010  # m, of each coordinate of a feed-arm scan point whose record has none: the reduction's setting


@dataclass(frozen=True, eq=False)
class MountedRanger:
    """Mirror with what it stands on, a monument or the feed arm.

    name       of the ranger
    mirror     its record
    monument   record of the monument; None on the feed arm
    arm        record of feedarm.toml; None on the ground
    site       that it belongs to; None for two records alone
    """

    name: str
    mirror: MirrorGeometry
    monument: MonumentGeometry | None = None
    arm: FeedArmRanger | None = None
    site: SiteFolder | None = None

    @property
    def names(self) -> dict[str, str | None]:
        """Names of monument, mirror, the mirror that the monument's record names; of a site also of the ranger."""
        monument, recorded = (None, None) if self.monument is None else (self.monument.monument, self.monument.zp)
        names = {"monument": monument, "mirror": self.mirror.zp, "mirror_of_monument": recorded}
        return names if self.site is None else {**names, "ranger": self.name}

    @property
    def moves(self) -> bool:
        """True for a ranger of the feed arm."""
        return self.arm is not None

    def station(self, telescope: RigidTelescope | None = None) -> MirrorStation:
        """Station of the mirror in the ground frame.

        telescope   at its posture, for a ranger of the feed arm

        Raises InputError for a feed-arm ranger without a posture, or without the orientation of its mount.
        """
        if self.monument is not None:
            return station_of(self.monument, self.mirror)
        assert self.arm is not None
        if telescope is None:
            raise InputError(f"ranger {self.name} moves with the telescope: its place is unknown (expected a posture)")
        return feed_arm_station(self.arm, self.mirror, telescope.ground_from("reflector"))

    def counts_covariance(self, station: MirrorStation, to: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
        """Covariance (..., 2, 2), counts^2, for points (..., 3), m, and the keys that the records lack.

        station   of `station`, or of several postures, whose batch shape broadcasts with the points'

        Lacking keys count as exact; on the feed arm the scan point has U_POSITION without one.
        """
        if self.monument is not None:
            covariance, lacking = station_covariance(self.monument, self.mirror)
            return counts_covariance(station, to, of_station=covariance), lacking
        assert self.arm is not None
        of_mirror, lacking = mirror_variances(self.mirror)
        spread = counts_covariance(station, to, of_station=np.diag([0.0] * 6 + of_mirror))
        u = U_POSITION if self.arm.u_position_mm is None else self.arm.u_position_mm * MILLIMETRE
        turn = self.arm.u_mount_rad
        moving = MovingRanger(station, np.diag(np.repeat([u**2, (turn or 0.0) ** 2], 3)))
        return spread + moving.counts_covariance(to), lacking if turn is not None else ("u_mount_rad", *lacking)


def ranger_of_records(monument: MonumentGeometry, mirror: MirrorGeometry) -> MountedRanger:
    """Ranger of a monument's record and a mirror's."""
    return MountedRanger(monument.monument, mirror, monument=monument)


def ranger_of_site(site: SiteFolder, name: str) -> MountedRanger:
    """Ranger of a site by its name.

    Raises InputError for an unknown name, and for a feed-arm ranger without the orientation of its mount.
    """
    if name not in site.rangers:
        raise InputError(
            f"ranger {name!r} is not of the site {site.site.campaign.name} (expected one of {', '.join(site.rangers)})"
        )
    mirror = site.mirror_of(name)
    if name in site.monuments:
        return MountedRanger(name, mirror, monument=site.monuments[name], site=site)
    arm = next(item for item in site.feedarm.ranger if item.name == name)
    return MountedRanger(name, mirror, arm=arm, site=site)


def telescope_of_site(site: SiteFolder, posture: tuple[float, float]) -> RigidTelescope:
    """Rigid telescope with a site's lengths, its subreflector at rest.

    posture   azimuth, elevation, rad
    """
    reflector = site.site.frames.reflector
    x, y, z = (v * MILLIMETRE for v in reflector.reflector_to_elevation_mm)
    return RigidTelescope(
        azimuth=posture[0],
        elevation=posture[1],
        elevation_axis_height=reflector.elevation_axis_height_mm * MILLIMETRE,
        reflector_to_elevation=(x, y, z),
        focal_length=site.site.paraboloid.focal_length_mm * MILLIMETRE,
    )


def posture_of_site(site: SiteFolder) -> tuple[float, float]:
    """Posture of a site's record, rad."""
    campaign = site.site.campaign
    return float(np.radians(campaign.azimuth_deg)), float(np.radians(campaign.elevation_deg))
