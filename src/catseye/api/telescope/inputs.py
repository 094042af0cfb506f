"""Arguments that calls of the telescope share: postures, points, records, sites."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from catseye.api.reading import place_of
from catseye.errors import ArgumentError, InputError, ValidityError

if TYPE_CHECKING:
    from catseye.geometry.antenna.rigid_telescope import RigidTelescope
    from catseye.records.files.record import Record
    from catseye.records.site.folder import SiteFolder
    from catseye.reduction.steering.mounted import MountedRanger

R = TypeVar("R", bound="Record")


@dataclass
class InputFiles:
    """Records and points read from files; `paths` collects these."""

    paths: list[Path] = field(default_factory=list)

    def read(self, source: Any, kind: type[R]) -> R:
        """Record of a kind, or the one in a file."""
        from catseye.records.files.reading import read_record

        if isinstance(source, kind):
            return source
        self.paths.append(place_of(source))
        return read_record(self.paths[-1], kind)

    def site(self, source: "str | os.PathLike[str] | SiteFolder") -> "SiteFolder":
        """Site of a directory, of a campaign's, or one that `load` read."""
        from catseye.records.night.campaign import Campaign
        from catseye.records.site.folder import SiteFolder, read_site

        if isinstance(source, SiteFolder | Campaign):
            return source
        folder = read_site(place_of(source))
        self.paths.append(folder.directory)
        return folder

    def points(self, to: Any) -> np.ndarray:
        """Points (n, 3) m, of numbers or of a coord.dat."""
        if isinstance(to, str | os.PathLike):
            from catseye.records.laboratory.coordinate_list import read_coordinates

            self.paths.append(place_of(to))
            return read_coordinates(self.paths[-1])
        return points_of(to)

    def ranger(
        self,
        monument: Any,
        mirror: Any,
        site: "SiteFolder | None",
        name: str | None,
    ) -> "MountedRanger":
        """Ranger of a monument and a mirror, or of a site by its name.

        Raises ArgumentError for anything between the two, and InputError for a site without this ranger.
        """
        from catseye.records.site.mirror import MirrorGeometry
        from catseye.records.site.monument import MonumentGeometry
        from catseye.reduction.steering.mounted import ranger_of_records, ranger_of_site

        records = {"monument": monument, "mirror": mirror}
        if site is None and name is None:
            if monument is None or mirror is None:
                missing = "monument" if monument is None else "mirror"
                text = f"{missing} is missing (expected monument and mirror, or site and ranger)"
                raise ArgumentError(text, "monument", "mirror", "site", "ranger")
            return ranger_of_records(self.read(monument, MonumentGeometry), self.read(mirror, MirrorGeometry))
        for name_of_record, value in records.items():
            if value is not None:
                raise ArgumentError(
                    f"{name_of_record} does not go with site and ranger, whose records are the site's",
                    name_of_record,
                    "site",
                    "ranger",
                )
        if site is None or name is None:
            alone, needed = ("ranger", "site") if site is None else ("site", "ranger")
            raise ArgumentError(f"{alone} says nothing without {needed}", alone, needed)
        return ranger_of_site(site, name)


def points_of(values: Any) -> np.ndarray:
    """Points (n, 3), m, of numbers. Raises InputError for another shape."""
    try:
        where = np.atleast_2d(np.asarray(values, dtype=float))
    except (TypeError, ValueError):
        raise InputError("points are no table of numbers (expected (n, 3) or (3,), finite, m)") from None
    if where.ndim != 2 or where.shape[1] != 3 or not len(where) or not np.isfinite(where).all():
        raise InputError(f"points of shape {where.shape} (expected (n, 3) or (3,), finite, m)")
    return where


def refuse_alone(values: Mapping[str, Any], needed: str, value: Any) -> None:
    """Raise ArgumentError for what says nothing without another argument."""
    for name, item in values.items():
        if item is not None and value is None:
            raise ArgumentError(f"{name} says nothing without {needed}", name, needed)


def posture_of(posture_deg: Sequence[float] | None, name: str = "posture_deg") -> tuple[float, float] | None:
    """Posture (2,), rad. Raises ArgumentError beyond the telescope's."""
    if posture_deg is None:
        return None
    if len(posture_deg) != 2 or not (abs(posture_deg[0]) <= 540.0 and -5.0 <= posture_deg[1] <= 95.0):
        text = ", ".join(f"{v:g}" for v in posture_deg)
        raise ArgumentError(f"{name} = {text} (expected azimuth -540 to 540, elevation -5 to 95)", name)
    return float(np.radians(posture_deg[0])), float(np.radians(posture_deg[1]))


def mjd_of_argument(value: Any, name: str = "at_mjd") -> float | None:
    """MJD of a number or a text. Raises ArgumentError for another text."""
    from catseye.geometry.sky.time_tag import mjd_of

    if not isinstance(value, str):
        return None if value is None else float(value)
    try:
        return mjd_of(value)
    except ValidityError as problem:
        raise ArgumentError(f"{name} = {problem}", name) from problem


def telescope_of(site: "SiteFolder | None", posture: tuple[float, float]) -> "RigidTelescope":
    """Rigid telescope of a site, or with the notes' lengths, at a posture; its subreflector at rest."""
    from catseye.geometry.antenna.rigid_telescope import RigidTelescope
    from catseye.reduction.steering.mounted import telescope_of_site

    azimuth, elevation = posture
    if site is not None:
        return telescope_of_site(site, posture)
    return RigidTelescope(azimuth=azimuth, elevation=elevation)
