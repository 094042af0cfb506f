"""`aim_triplets`: the rotations of triplet mounts; `bound_triplets`: effects of dimensions and air."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.api.reading import place_of
from catseye.api.result import Result, quantities
from catseye.api.triplet.ranges import triplets_of
from catseye.api.units import In, with_units
from catseye.constants import MILLIMETRE
from catseye.errors import ArgumentError

if TYPE_CHECKING:
    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.records.site.folder import SiteFolder
    from catseye.reduction.triplet.aiming import AimedMounts
    from catseye.reduction.triplet.bounds import TripletBounds


@dataclass(frozen=True, eq=False, repr=False)
class TripletAimResult(Result):
    """Aim of n triplet mounts at a point of the feed arm; reflector frame.

    names         of the units
    swing, tip    (n,) rad, rotations of the mount from the record's normal: about the outer axis, then the trunnions
    normal, axis  (n, 3) of the aimed units, as a record states them
    misaim        (n, 2) rad, of the point from the aimed normal at the ball, towards the right prism and up
    incidence     (n, k) rad, of the rangers on the aimed plates
    mounts        everything else
    read          directory that was read
    """

    names: tuple[str, ...]
    swing: np.ndarray
    tip: np.ndarray
    normal: np.ndarray
    axis: np.ndarray
    misaim: np.ndarray
    incidence: np.ndarray
    mounts: "AimedMounts"
    read: tuple[Path, ...] = ()

    def passages(self) -> "Sequence[Passage]":
        """The point, distances, records, scope and incidences."""
        from catseye.gateways.triplet.in_use import aim_words
        from catseye.gateways.writers.passage import Passage

        return [Passage(title, text) for title, text in aim_words(self.mounts)]

    def lines(self) -> Iterator[str]:
        """Lines of the mounts that the command prints."""
        from catseye.gateways.triplet.in_use import aim_lines

        return aim_lines(self.mounts)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye triplets aim --json`."""
        from catseye.gateways.triplet.in_use import aim_object

        return aim_object(self.mounts)

    def tables(self) -> "dict[str, QTable]":
        """`mounts`: a row a unit; `incidences`: a row a unit and ranger."""
        rangers = self.mounts.site.rangers
        columns = {
            "triplet": (self.names, ""),
            "swing": (self.swing, "rad"),
            "tip": (self.tip, "rad"),
            "distance": (self.mounts.distance, "m"),
            **{f"normal_{axis}": (self.normal[:, k], "") for k, axis in enumerate("xyz")},
            **{f"axis_{axis}": (self.axis[:, k], "") for k, axis in enumerate("xyz")},
            "misaim_right": (self.misaim[:, 0], "rad"),
            "misaim_up": (self.misaim[:, 1], "rad"),
        }
        incidences = {
            "triplet": ([name for name in self.names for _ in rangers], ""),
            "ranger": (list(rangers) * len(self.names), ""),
            "incidence": (self.incidence.ravel(), "rad"),
        }
        return {"mounts": quantities(columns), "incidences": quantities(incidences)}

    def sources(self) -> tuple[Path, ...]:
        """The site, which `save` leaves alone."""
        return self.read


@with_units
def aim_triplets(
    site: "str | os.PathLike[str] | SiteFolder",
    *,
    unit: str | None = None,
    at_mm: Annotated[Any, In("mm")] = None,
    outer: Annotated[Any, In("")] = None,
    scope_mm: Annotated[Any, In("mm")] = None,
    pivot_mm: Annotated[Any, In("mm")] = None,
) -> TripletAimResult:
    """Two rotations of each triplet mount that aim its rifle scope at a point of the feed arm.

    site       directory of a site or a campaign, or what `load` gave: triplets, feed arm, aim point
    unit       name of the single triplet wanted; None: all
    at_mm      (3,) the point, reflector frame, mm; None: the aim point of feedarm.toml
    outer      (3,) direction of the mounts' outer axis, reflector frame; None: each unit's y
    scope_mm   (2,) where the scope's line of sight crosses the unit's x and y, from the pivot, mm; None: 0, 0
    pivot_mm   (3,) where the mount's axes meet, from the ball in the unit's axes, mm; None: 0, 0, 0

    Raises InputError for a site without triplets, ValidityError for axes and points that no rotation reaches.

    >>> aimed = aim_triplets("night-01", unit="TR01", scope_mm=(0.0, 100.0))
    >>> round(float(np.degrees(aimed.misaim[0, 1])), 4)
    0.0614
    """
    from catseye.reduction.triplet.aiming import aimed_mounts

    point, axis, scope, pivot = (
        _vector(name, value, count)
        for name, value, count in (("at_mm", at_mm, 3), ("outer", outer, 3), ("scope_mm", scope_mm, 2),
                                   ("pivot_mm", pivot_mm, 3))
    )  # fmt: skip
    mounts = aimed_mounts(
        triplets_of(site, 0.3, unit),
        None if point is None else point * MILLIMETRE,
        outer=axis,
        scope=np.zeros(2) if scope is None else scope * MILLIMETRE,
        pivot=np.zeros(3) if pivot is None else pivot * MILLIMETRE,
    )
    return TripletAimResult(
        verdict=mounts.verdict,
        names=tuple(mounted.name for mounted in mounts.site.units),
        swing=mounts.swing,
        tip=mounts.tip,
        normal=mounts.normal,
        axis=mounts.axis,
        misaim=mounts.misaim,
        incidence=mounts.incidence,
        mounts=mounts,
        read=(place_of(site),) if isinstance(site, str | os.PathLike) else (),
    )


def _vector(name: str, value: Any, count: int) -> np.ndarray | None:
    """Finite numbers of an argument, or None. Raises ArgumentError for others."""
    if value is None:
        return None
    numbers = np.asarray(value, dtype=float)
    if numbers.shape != (count,) or not np.isfinite(numbers).all():
        raise ArgumentError(f"{name} = {value} (expected {count} numbers)", name)
    return numbers


@dataclass(frozen=True, eq=False, repr=False)
class TripletBoundsResult(Result):
    """Effects of a triplet's dimensions and of another air on ranges; metres.

    spacing, along, across   effects of the memo's three cases, exact, with sign
    bounds        (3,) the memo's bounds of their sizes
    refractivity_change   of the air by D.5, with the right slopes
    prism, ball   errors of a range with the tabulated glass constant in that air; too long above 0
    effects       everything else: the memo's own formulas, every cause at its tolerance
    """

    spacing: float
    along: float
    across: float
    bounds: np.ndarray
    refractivity_change: float
    prism: float
    ball: float
    effects: "TripletBounds"

    def passages(self) -> "Sequence[Passage]":
        """Unit, scan point, air and glass."""
        from catseye.gateways.triplet.in_use import bounds_words
        from catseye.gateways.writers.passage import Passage

        return [Passage(title, text) for title, text in bounds_words(self.effects)]

    def lines(self) -> Iterator[str]:
        """Lines of the cases and the causes that the command prints."""
        from catseye.gateways.triplet.in_use import bounds_lines

        return bounds_lines(self.effects)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye triplets bound --json`."""
        from catseye.gateways.triplet.in_use import bounds_object

        return bounds_object(self.effects)

    def tables(self) -> "dict[str, QTable]":
        """`cases`: appendix A's three; `causes`: every cause at its tolerance."""
        cases, causes = self.effects.cases, self.effects.causes
        words = {"case": "", "equation": "", "exact": "m", "memo": "m", "bound": "m"}
        sizes = {"cause": "", "size": "", "memo": "m", "calibration": "m", "use": "m", "tie": "m"}
        return {
            "cases": quantities({key: ([getattr(row, key) for row in cases], u) for key, u in words.items()}),
            "causes": quantities({key: ([getattr(row, key) for row in causes], u) for key, u in sizes.items()}),
        }

    def figures(self) -> "dict[str, Figure]":
        """Figure 11 of the memo with these numbers, and the effects by place of the scan point."""
        from catseye.gateways.triplet.in_use_figures import bounds_figure

        return {"bounds": bounds_figure(self.effects)}


@with_units
def bound_triplets(
    *,
    spacing_mm: Annotated[Any, In("mm", one=True)] = 0.15,
    along_mm: Annotated[Any, In("mm", one=True)] = 0.15,
    across_mm: Annotated[Any, In("mm", one=True)] = 0.15,
    d12_mm: Annotated[Any, In("mm", one=True)] = 635.0,
    distance_m: Annotated[Any, In("m", one=True)] = 18.0,
    aside_mm: Annotated[Any, In("mm", one=True)] = None,
    height_mm: Annotated[Any, In("mm", one=True)] = 50.0,
    prism_mm: Annotated[Any, In("mm", one=True)] = 38.4,
    ball_mm: Annotated[Any, In("mm", one=True)] = 146.4972,
    warmer_c: Annotated[Any, In("deg_C", difference=True, one=True)] = 0.0,
    higher_hpa: Annotated[Any, In("hPa", one=True)] = 0.0,
    moister_percent: Annotated[Any, In("percent", one=True)] = 0.0,
    temperature_c: Annotated[Any, In("deg_C", one=True)] = 20.0,
    pressure_hpa: Annotated[Any, In("hPa", one=True)] = 933.0,
    humidity_percent: Annotated[Any, In("percent", one=True)] = 50.0,
) -> TripletBoundsResult:
    """Effects of a triplet's dimensions and of another air on its ranges: the memo's appendices A and D.

    spacing_mm        by which the prisms stand further apart than assumed, mm
    along_mm, across_mm   ball's centre from the prisms' mid-point, in the plate: towards the right prism, and up, mm
    d12_mm            between the prisms, mm
    distance_m        from the scan point to the prisms' line, m
    aside_mm          of the scan point from the mid-point, along the line, mm; None: before the right prism
    height_mm         of the scan point over the line, mm
    prism_mm, ball_mm   glass, one way: a prism's height, and R_1 + R_2 of the ball, mm
    warmer_c, higher_hpa, moister_percent   change of the air: °C, hPa, %
    temperature_c, pressure_hpa, humidity_percent   of the air before it: °C, hPa, %

    Raises ValidityError for dimensions that make no triangle, and air outside its formula.

    >>> [round(1e6 * float(bound), 4) for bound in bound_triplets().bounds]
    [1.3229, 2.6458, 2.6458]
    """
    from catseye.reduction.triplet.bounds import TripletDimensions, WeatherChange, triplet_bounds

    effects = triplet_bounds(
        TripletDimensions(
            spacing=spacing_mm * MILLIMETRE,
            along=along_mm * MILLIMETRE,
            across=across_mm * MILLIMETRE,
            d_12=d12_mm * MILLIMETRE,
            distance=distance_m,
            aside=0.5 * d12_mm * MILLIMETRE if aside_mm is None else aside_mm * MILLIMETRE,
            height=height_mm * MILLIMETRE,
            prism_glass=prism_mm * MILLIMETRE,
            ball_glass=ball_mm * MILLIMETRE,
        ),
        WeatherChange(
            temperature_c=warmer_c,
            pressure_hpa=higher_hpa,
            humidity_percent=moister_percent,
            from_temperature_c=temperature_c,
            from_pressure_hpa=pressure_hpa,
            from_humidity_percent=humidity_percent,
        ),
    )
    spacing, along, across = (case.exact for case in effects.cases)
    return TripletBoundsResult(
        verdict=effects.verdict,
        spacing=spacing,
        along=along,
        across=across,
        bounds=np.array([case.bound for case in effects.cases]),
        refractivity_change=effects.change,
        prism=effects.prism,
        ball=effects.ball,
        effects=effects,
    )
