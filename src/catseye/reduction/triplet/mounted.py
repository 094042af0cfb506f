"""Triplets and feed-arm rangers of a site in the reflector's frame, and ranges of a table sorted to their pairs."""

from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array
from catseye.constants import MILLIMETRE, SPEED_OF_LIGHT
from catseye.errors import InputError
from catseye.geometry.frames.frame import Transform
from catseye.records.files.refusal import refusal
from catseye.records.site.folder import SiteFolder
from catseye.records.site.prism_ranges import PrismRanges
from catseye.reduction.triplet.use import MountedTriplet

U_RANGE = 50e-6  # m, of a range for which the table states none
MISPLACED = 0.07  # m: five times sqrt 2 of a typed place's 10 mm, below the half wavelength of 100 mm


@dataclass(frozen=True, eq=False)
class SiteTriplets:
    """The n triplets and k feed-arm rangers of a site by its records, reflector frame; metres.

    units     mounted triplets
    targets   (n,) names of left prism, right prism and ball
    rangers   (k,) names
    scan      (k, 3) scan points
    aim       (3,) point A that the triplets face
    half      half a wavelength of the modulation in vacuum
    """

    units: tuple[MountedTriplet, ...]
    targets: tuple[tuple[str, str, str], ...]
    rangers: tuple[str, ...]
    scan: Array
    aim: Array
    half: float

    def predicted(self) -> Array:
        """Distances (n, k, 2), m, from the scan points to the left and right prism."""
        prisms = np.stack([unit.prisms for unit in self.units])
        return np.linalg.norm(self.scan[None, :, None] - prisms[:, None], axis=-1)


@dataclass(frozen=True, eq=False)
class SortedRanges:
    """Ranges of a table by pair, means of repetitions; metres, nan where there is none.

    to_prisms, u_to_prisms   (n, k, 2) with Pc, without dPc
    pairs                    (p, 2) rangers from and to which ranges go
    between, u_between       (p,) from ranger to ranger
    ignored                  rows to or from anything else
    """

    to_prisms: Array
    u_to_prisms: Array
    pairs: np.ndarray
    between: Array
    u_between: Array
    ignored: int


def site_triplets(site: SiteFolder, u_normal: float, unit: str | None = None) -> SiteTriplets:
    """Triplets and feed-arm rangers of a site.

    site       its records
    u_normal   rad, of a plate's normal, each direction
    unit       name of the single unit wanted; None: all

    Raises InputError for a site without triplets or feed-arm rangers, and for an unknown unit.
    """
    where = str(site.directory)
    if not site.triplets or not site.feedarm.ranger:
        raise refusal(where, "has no triplets or no rangers on a feed arm (expected both)")
    if unit is not None and unit not in site.triplets:
        raise InputError(f"{where}: unit {unit!r} is unknown (expected one of {', '.join(site.triplets)})")
    records = [record for name, record in site.triplets.items() if unit in (None, name)]
    for record in records:
        if record.frame != "reflector":
            raise refusal(where, f"{record.triplet} is in the frame {record.frame!r} (expected 'reflector')")
    frame = Transform("reflector", "reflector", np.eye(3), np.zeros(3))
    ratio = site.site.ranging.bk7_to_air_group_index_ratio
    return SiteTriplets(
        units=tuple(MountedTriplet.of(record, frame, ratio=ratio, u_normal=u_normal) for record in records),
        targets=tuple(record.targets for record in records),
        rangers=tuple(ranger.name for ranger in site.feedarm.ranger),
        scan=np.array([ranger.nominal_scan_point_mm for ranger in site.feedarm.ranger]) * MILLIMETRE,
        aim=np.array(site.feedarm.aim_point.nominal_mm) * MILLIMETRE,
        half=0.5 * SPEED_OF_LIGHT / site.site.ranging.modulation_hz,
    )


def sorted_ranges(site: SiteTriplets, table: PrismRanges) -> SortedRanges:
    """Ranges by pair: means of repetitions weighted by their claims.

    site    triplets and rangers
    table   ranges; without a claim 50 um count

    Raises InputError where no row is of the site's rangers, and for a range that its approximate places contradict.
    """
    ranger = {name: number for number, name in enumerate(site.rangers)}
    prism = {name: (i, side) for i, names in enumerate(site.targets) for side, name in enumerate(names[:2])}
    u = np.where(np.isnan(table.u), U_RANGE, table.u)
    shape = (len(site.units), len(site.rangers), 2)
    weight, total = np.zeros(shape), np.zeros(shape)
    among: dict[tuple[int, int], list[int]] = {}
    ignored = 0
    expected = site.predicted()
    for row, (source, target) in enumerate(zip(table.ranger, table.target, strict=True)):
        if source not in ranger or (target not in prism and target not in ranger):
            ignored += 1
            continue
        k = ranger[source]
        if target in prism:
            i, side = prism[target]
            place = float(expected[i, k, side])
            weight[i, k, side] += u[row] ** -2
            total[i, k, side] += table.distance[row] * u[row] ** -2
        else:
            place = float(np.linalg.norm(site.scan[k] - site.scan[ranger[target]]))
            among.setdefault((k, ranger[target]), []).append(row)
        if abs(table.distance[row] - place) > MISPLACED:
            raise refusal(
                table.file,
                f"line {table.lines[row]}, {source} to {target}, range_m = {table.distance[row]:.4f} is "
                f"{1e3 * (table.distance[row] - place):+.1f} mm from its records' places (expected within "
                f"{1e3 * MISPLACED:g} mm: a whole half wavelength is 100 mm)",
            )
    if not weight.any():
        raise refusal(table.file, "holds no range from a ranger of the feed arm to a prism of the site's triplets")
    with np.errstate(invalid="ignore", divide="ignore"):
        to_prisms, u_to_prisms = total / weight, np.where(weight > 0.0, weight, np.nan) ** -0.5
    sums = [np.sum(u[rows] ** -2) for rows in among.values()]
    means = [np.sum(table.distance[rows] * u[rows] ** -2) for rows in among.values()]
    return SortedRanges(
        to_prisms=to_prisms,
        u_to_prisms=u_to_prisms,
        pairs=np.array(list(among), dtype=np.intp).reshape(-1, 2),
        between=np.array(means) / np.array(sums) if sums else np.zeros(0),
        u_between=np.array(sums) ** -0.5 if sums else np.zeros(0),
        ignored=ignored,
    )
