"""`reduce_triplets`: ranges to prisms become ranges to balls, and back; `adjust_triplets`: the local net."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.api.reading import place_of
from catseye.api.result import Result, digest_of, quantities
from catseye.api.units import In, with_units
from catseye.constants import DEGREE, MILLIMETRE
from catseye.errors import ArgumentError

if TYPE_CHECKING:
    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.records.site.folder import SiteFolder
    from catseye.reduction.triplet.local_net import LocalNet
    from catseye.reduction.triplet.mounted import SiteTriplets
    from catseye.reduction.triplet.reduced_ranges import ReducedTriplets


def site_of(site: "str | os.PathLike[str] | SiteFolder") -> "SiteFolder":
    """Records of a site: read from its directory or as `load` gave them."""
    from catseye.records.site.folder import SiteFolder, read_site

    return site if isinstance(site, SiteFolder) else read_site(place_of(site))


def triplets_of(
    site: "str | os.PathLike[str] | SiteFolder", u_normal_deg: float, unit: str | None = None
) -> "SiteTriplets":
    """Triplets and feed-arm rangers of a site.

    Raises ArgumentError for an uncertainty that is none.
    """
    from catseye.reduction.triplet.mounted import site_triplets

    if not 0.0 < u_normal_deg <= 10.0:
        raise ArgumentError(f"u_normal_deg = {u_normal_deg:g} (expected above 0, up to 10)", "u_normal_deg")
    return site_triplets(site_of(site), u_normal_deg * DEGREE, unit)


def require_zero(u_zero_mm: float) -> float:
    """Standard uncertainty of a ranger's zero, m. Raises ArgumentError unless it is above 0."""
    if not 0.0 < u_zero_mm <= 100.0:
        raise ArgumentError(f"u_zero_mm = {u_zero_mm:g} (expected above 0, up to 100)", "u_zero_mm")
    return u_zero_mm * MILLIMETRE


@dataclass(frozen=True, eq=False, repr=False)
class TripletRangesResult(Result):
    """Ranges from k rangers of the feed arm to the balls of n triplets.

    names, rangers   of the n units and the k rangers
    incidence     (n, k, 2) rad, on the left and the right prism
    obliquity     (n, k, 2) m, correction dPc for it
    ranges        (n, k, 2) m, to the prisms, with Pc and without dPc; nan where there is none
    d_mp, d_bc    (n, k) m, from scan point to mid-point and ball
    u_d_bc        (n, k) m
    covariance    (n k, n k) m², of d_bc, unit by unit
    reduction     everything else: places, the memo's own steps
    read          files that were read
    """

    names: tuple[str, ...]
    rangers: tuple[str, ...]
    incidence: np.ndarray
    obliquity: np.ndarray
    ranges: np.ndarray
    d_mp: np.ndarray
    d_bc: np.ndarray
    u_d_bc: np.ndarray
    covariance: np.ndarray
    reduction: "ReducedTriplets"
    read: tuple[Path, ...] = ()

    def passages(self) -> "Sequence[Passage]":
        """Pairs, incidences, the memo's own steps, uncertainties and places."""
        from catseye.gateways.triplet.in_use import reduced_words
        from catseye.gateways.writers.passage import Passage

        return [Passage(title, text) for title, text in reduced_words(self.reduction)]

    def lines(self) -> Iterator[str]:
        """Lines of the pairs that the command prints."""
        from catseye.gateways.triplet.in_use import reduced_lines

        return reduced_lines(self.reduction)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye triplets reduce --json`."""
        from catseye.gateways.triplet.in_use import reduced_object

        return reduced_object(self.reduction)

    def tables(self) -> "dict[str, QTable]":
        """`ranges`: a row a unit and ranger; `points`: prisms, mid-point and ball of each unit."""
        from catseye.gateways.triplet.in_use import reduced_rows

        rows = list(reduced_rows(self.reduction))
        units = {"triplet": "", "ranger": "", "incidence_left": "rad", "incidence_right": "rad"}
        columns = {key: ([row[key] for row in rows], units.get(key, "m")) for key in rows[0]}
        parts = ("left_prism", "right_prism", "mid_point", "ball")
        places = [np.vstack([u.prisms, u.prisms.mean(axis=0), u.ball]) for u in self.reduction.site.units]
        points = {
            "triplet": ([name for name in self.names for _ in parts], ""),
            "point": ([part for _ in self.names for part in parts], ""),
            **{axis: (np.concatenate(places)[:, k], "m") for k, axis in enumerate("xyz")},
        }
        return {"ranges": quantities(columns), "points": quantities(points)}

    def figures(self) -> "dict[str, Figure]":
        """Figure 10 of the memo, and what its steps change."""
        from catseye.gateways.triplet.in_use_figures import reduced_figure

        return {"ranges": reduced_figure(self.reduction)}

    def inputs(self) -> dict[str, str]:
        """SHA-256 of the table that was read."""
        return {path.name: digest_of(path) for path in self.read if path.is_file()}

    def sources(self) -> tuple[Path, ...]:
        """The site and the table, which `save` leaves alone."""
        return self.read


@with_units
def reduce_triplets(
    site: "str | os.PathLike[str] | SiteFolder",
    ranges: "str | os.PathLike[str] | None" = None,
    *,
    unit: str | None = None,
    u_normal_deg: Annotated[Any, In("deg", one=True)] = 0.3,
    u_zero_mm: Annotated[Any, In("mm", one=True)] = 0.03,
) -> TripletRangesResult:
    """Ranges to prisms become ranges to mid-points and balls, and back.

    site           directory of a site or a campaign, or what `load` gave: triplets, feed arm
    ranges         table of measured ranges, or ranges.csv of a reduced night (docs/formats/triplet-ranges.md);
                   None: those that follow from the records' places
    unit           name of the single triplet wanted; None: all
    u_normal_deg   of each plate's normal, each direction, degrees
    u_zero_mm      of each ranger's zero, common to its ranges, mm

    Raises InputError for a site without triplets and ranges that are none of its own.

    >>> found = reduce_triplets("night-01", "triplets/prism-ranges.csv")
    >>> found.d_bc.shape, found.verdict.word
    ((10, 6), 'good')
    """
    from catseye.records.site.prism_ranges import read_prism_ranges
    from catseye.reduction.triplet.reduced_ranges import reduced_triplets

    zero = require_zero(u_zero_mm)
    place = None if ranges is None else place_of(ranges)
    table = None if place is None else read_prism_ranges(place)
    reduction = reduced_triplets(triplets_of(site, u_normal_deg, unit), table, u_zero=zero)
    balls = reduction.balls
    return TripletRangesResult(
        verdict=reduction.verdict,
        names=tuple(mounted.name for mounted in reduction.site.units),
        rangers=reduction.site.rangers,
        incidence=balls.incidence,
        obliquity=balls.obliquity,
        ranges=reduction.to_prisms,
        d_mp=balls.d_mp,
        d_bc=balls.d_bc,
        u_d_bc=reduction.u_d_bc,
        covariance=balls.covariance,
        reduction=reduction,
        read=_read(site, place),
    )


def _read(site: object, table: Path | None) -> tuple[Path, ...]:
    """Places that a call read."""
    directory = () if not isinstance(site, str | os.PathLike) else (place_of(site),)
    return directory if table is None else (*directory, table)


@dataclass(frozen=True, eq=False, repr=False)
class TripletNetResult(Result):
    """Local net of k rangers of the feed arm and n triplets, adjusted by itself: p points.

    points        (p,) names: rangers, then left prism, right prism and ball of each unit
    x             (p, 3) m, reflector frame, held by typed places
    covariance    (3p, 3p) m², free of shifts and turns of the whole
    names, rangers   of the n units and the k rangers
    zeros, u_zeros   (k,) m, of the rangers
    d_bc, u_d_bc  (n, k) m, from scan points to balls
    covariance_d_bc   (n k, n k) m², unit by unit
    net           everything else: residuals, tests
    read          files that were read
    """

    points: tuple[str, ...]
    x: np.ndarray
    covariance: np.ndarray
    names: tuple[str, ...]
    rangers: tuple[str, ...]
    zeros: np.ndarray
    u_zeros: np.ndarray
    d_bc: np.ndarray
    u_d_bc: np.ndarray
    covariance_d_bc: np.ndarray
    net: "LocalNet"
    read: tuple[Path, ...] = ()

    def passages(self) -> "Sequence[Passage]":
        """Ranges, fit, uncertainties, zeros, suspects."""
        from catseye.gateways.triplet.in_use import net_words
        from catseye.gateways.writers.passage import Passage

        return [Passage(title, text) for title, text in net_words(self.net)]

    def lines(self) -> Iterator[str]:
        """Lines of rangers and balls that the command prints."""
        from catseye.gateways.triplet.in_use import net_lines

        return net_lines(self.net)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye triplets adjust --json`."""
        from catseye.gateways.triplet.in_use import net_object

        return net_object(self.net)

    def tables(self) -> "dict[str, QTable]":
        """`points`: a row a point; `distances`: scan point to ball; `ranges`: observations with their tests."""
        ranged, u = self.net.observations, self.net.u
        points = {
            "point": (self.points, ""),
            **{axis: (self.x[:, k], "m") for k, axis in enumerate("xyz")},
            **{f"u_{axis}": (u[:, k], "m") for k, axis in enumerate("xyz")},
        }
        distances = {
            "triplet": ([name for name in self.names for _ in self.rangers], ""),
            "ranger": (list(self.rangers) * len(self.names), ""),
            "d_bc": (self.d_bc.ravel(), "m"),
            "u_d_bc": (self.u_d_bc.ravel(), "m"),
        }
        keys = {"ranger": "", "target": "", "distance": "m", "u": "m", "residual": "m", "w": "", "redundancy": ""}
        ranges = {key: ([getattr(row, key) for row in ranged], unit) for key, unit in keys.items()}
        return {"points": quantities(points), "distances": quantities(distances), "ranges": quantities(ranges)}

    def figures(self) -> "dict[str, Figure]":
        """Plan of the net, and tests of its ranges."""
        from catseye.gateways.triplet.in_use_figures import net_figure

        return {"net": net_figure(self.net)}

    def inputs(self) -> dict[str, str]:
        """SHA-256 of the table that was read."""
        return {path.name: digest_of(path) for path in self.read if path.is_file()}

    def sources(self) -> tuple[Path, ...]:
        """The site and the table, which `save` leaves alone."""
        return self.read


@with_units
def adjust_triplets(
    site: "str | os.PathLike[str] | SiteFolder",
    ranges: "str | os.PathLike[str]",
    *,
    u_normal_deg: Annotated[Any, In("deg", one=True)] = 0.3,
    u_zero_mm: Annotated[Any, In("mm", one=True)] = 0.03,
) -> TripletNetResult:
    """Local net of feed arm and triplets, adjusted by itself, each ball computed with its covariance.

    site           directory of a site or a campaign, or what `load` gave: triplets, feed arm
    ranges         table of measured ranges, or ranges.csv of a reduced night (docs/formats/triplet-ranges.md)
    u_normal_deg   of each plate's normal, each direction, degrees
    u_zero_mm      of each ranger's zero, common to its ranges, mm

    Raises InputError for ranges that are none of the site's, EstimationError where they do not determine the net.

    >>> net = adjust_triplets("night-01", "triplets/prism-ranges.csv")
    >>> len(net.points), net.verdict.word
    (36, 'good')
    """
    from catseye.records.site.prism_ranges import read_prism_ranges
    from catseye.reduction.triplet.local_net import adjusted_net

    zero = require_zero(u_zero_mm)
    place = place_of(ranges)
    net = adjusted_net(triplets_of(site, u_normal_deg), read_prism_ranges(place), u_zero=zero)
    return TripletNetResult(
        verdict=net.verdict,
        points=net.points,
        x=net.x,
        covariance=net.covariance,
        names=tuple(unit.name for unit in net.site.units),
        rangers=net.site.rangers,
        zeros=net.zeros,
        u_zeros=net.u_zeros,
        d_bc=net.d_bc,
        u_d_bc=net.u_d_bc,
        covariance_d_bc=net.covariance_d_bc,
        net=net,
        read=_read(site, place),
    )
