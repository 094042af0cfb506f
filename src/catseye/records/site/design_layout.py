"""Layout of a structure to be designed: rangers and targets by rule; docs/formats/design.md."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from catseye.aliases import Array
from catseye.constants import DEGREE
from catseye.names import SingleRetroreflectorName
from catseye.records.files.reading import read_record
from catseye.records.files.record import Certificate, Name, Record, Version, Within, broken_rule
from catseye.records.site.retroreflector import kind_named

GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))  # rad, between neighbours of a sunflower's seeds
MOST_POINTS = 20_000
Metres = Annotated[float, Within(0, 1e4)]
Count = Annotated[int, Within(1, MOST_POINTS)]
Place = Annotated[tuple[float, float, float], Field(strict=False)]


class PointSet(Record):
    """Points by rule about a centre.

    name             each point's begins so; a number of three digits or more follows
    shape            "ring": k-th of n at the angle first_deg + 360 k / n from x towards y; "disc": k-th of n at the
                     radius radius_m sqrt((k + 1/2) / n), k golden angles after first_deg, as a sunflower's seeds
    centre_m         x, y, z
    focal_length_m   z rises by r^2 / 4 f above the centre's: a paraboloid; without, all are level
    count            number of points
    radius_m         radius of the ring or disc
    first_deg        angle of the first point, from x towards y
    """

    name: Name
    shape: Literal["ring", "disc"]
    count: Count
    radius_m: Annotated[float, Within(0.1, 1e4)]
    centre_m: Place = (0.0, 0.0, 0.0)
    first_deg: Annotated[float, Within(-360, 360)] = 0.0
    focal_length_m: Annotated[float, Within(0.1, 1e5)] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the points of the set."""
        digits = max(3, len(str(self.count)))
        return tuple(f"{self.name}{k + 1:0{digits}d}" for k in range(self.count))

    @property
    def places(self) -> Array:
        """Places (count, 3) m of the points."""
        k = np.arange(self.count)
        ring = self.shape == "ring"
        radius = self.radius_m * (np.ones(self.count) if ring else np.sqrt((k + 0.5) / self.count))
        angle = self.first_deg * DEGREE + (2.0 * np.pi / self.count * k if ring else GOLDEN_ANGLE * k)
        height = np.zeros(self.count) if self.focal_length_m is None else radius**2 / (4.0 * self.focal_length_m)
        return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1) + np.array(self.centre_m)


class RangerSet(PointSet):
    """[[rangers]]: rangers on monuments.

    u_mm        of each coordinate of a monument
    u_zero_mm   of each ranger's zero
    """

    u_mm: Annotated[float, Within(0, 100, above=True)]
    u_zero_mm: Annotated[float, Within(0, 10)]


class TargetSet(PointSet):
    """[[targets]]: retroreflectors on the structure, of a kind without an axis.

    u_mm   of each coordinate before it is measured
    type   kind of the retroreflectors
    """

    type: SingleRetroreflectorName = "hollow"
    u_mm: Annotated[float, Within(0, 1000, above=True)] = 10.0

    @model_validator(mode="after")
    def _has_no_axis(self) -> "TargetSet":
        if kind_named(self.type).has_axis:
            raise broken_rule(f"{self.name}: type = {self.type!r} has an axis (expected a kind without one)")
        return self


class DesignRanges(Record):
    """[ranges]: a range's u, u_mm and u_ppm squared and added; the air's common scale; distances that are used.

    u_mm        constant part of the standard uncertainty of a range
    u_ppm       proportional part; both parts are added as squares
    u_air_ppm   scale of the air, common to all ranges
    near_m      least distance that is used
    far_m       largest distance that is used
    """

    u_mm: Annotated[float, Within(0, 100, above=True)]
    u_ppm: Annotated[float, Within(0, 100)]
    u_air_ppm: Annotated[float, Within(0, 300)] = 0.0
    near_m: Metres = 2.0
    far_m: Annotated[float, Within(1, 1e5)] = 500.0

    @model_validator(mode="after")
    def _reaches_farther_than_near(self) -> "DesignRanges":
        if self.near_m >= self.far_m:
            raise broken_rule(f"near_m = {self.near_m:g} is not below far_m = {self.far_m:g} (expected near < far)")
        return self


class DesignLayout(Certificate):
    """Complete file of a structure to be designed.

    name          name of the structure
    description   title of the report
    ranges        uncertainty and reach of ranges
    rangers       sets of rangers
    targets       sets of retroreflectors
    """

    format: Annotated[int | str, Version("design")] = 1
    name: Name
    description: str = ""
    ranges: DesignRanges
    rangers: Annotated[tuple[RangerSet, ...], Field(strict=False, min_length=1)]
    targets: Annotated[tuple[TargetSet, ...], Field(strict=False, min_length=1)]

    @model_validator(mode="after")
    def _has_unique_names(self) -> "DesignLayout":
        names = [name for each in (*self.rangers, *self.targets) for name in each.names]
        if len(names) > MOST_POINTS:
            raise broken_rule(f"{len(names)} points (expected at most {MOST_POINTS})")
        twice = next(
            (name for name, other in zip(sorted(names), sorted(names)[1:], strict=False) if name == other), None
        )
        if twice is not None:
            raise broken_rule(f"point {twice!r} is there twice (expected sets with names of their own)")
        return self


def read_design_layout(path: Path | str) -> DesignLayout:
    """Layout of a file; InputError in one line if invalid."""
    return read_record(path, DesignLayout)
