"""Single retroreflectors and feed-arm rangers: targets.toml, feedarm.toml, benchmarks.csv."""

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from catseye.names import SingleRetroreflectorName
from catseye.records.files.record import Name, Position, Record, Uncertainty, UnitVector, Version, Within, broken_rule
from catseye.records.site.retroreflector import GlassForm, RetroreflectorKind, kind_named

FrameName = Literal["ground", "alidade", "reflector"]
PrismHeight = Annotated[float, Within(5, 500)]  # mm
PrismReference = Annotated[float, Within(2, 500)]  # mm
GlassConstant = Annotated[float, Within(-2000, -1)]  # mm; negative, since light is slower in glass
SQUARE = 2e-3  # cosine: directions are written with three digits or more
GLASS_KEYS = ("material", "height_mm", "u_height_mm", "hrp_mm", "pc_mm")  # of a kind behind a plane face
PositionUncertainty = Annotated[float, Within(0, 1000, above=True)]  # mm, each coordinate


class TargetRow(Record):
    """Single retroreflector; its kind says which keys it has.

    name                     name of the target, each once
    type                     kind of retroreflector
    frame                    frame of its position, with which it moves
    position_mm              approximate, in the named frame
    u_position_mm            of each coordinate; by default the reduction's setting, 10 mm
    normal                   outward axis, same frame, of a kind that has one: normal of a prism's entry face
    material                 material of a prism
    height_mm, u_height_mm   height of a prism, from the corner to the entry face
    hrp_mm                   depth from the entry face of a prism down to the reference point
    pc_mm                    prism constant, negative
    """

    name: Name
    type: SingleRetroreflectorName
    frame: FrameName
    position_mm: Position
    u_position_mm: PositionUncertainty | None = None
    material: Literal["BK7"] | None = None
    normal: UnitVector | None = None
    height_mm: PrismHeight | None = None
    u_height_mm: Uncertainty | None = None
    hrp_mm: PrismReference | None = None
    pc_mm: GlassConstant | None = None

    @property
    def kind(self) -> RetroreflectorKind:
        """Kind of retroreflector that its type names."""
        return kind_named(self.type)

    @property
    def shapes_dish(self) -> bool:
        """True for a target on the dish's surface, by kind and frame."""
        return self.kind.shapes_dish and self.frame == "reflector"

    @model_validator(mode="after")
    def _has_the_keys_of_its_type(self) -> "TargetRow":
        in_glass = self.kind.glass is GlassForm.SLAB
        needed = {"normal": self.kind.has_axis} | dict.fromkeys(GLASS_KEYS, in_glass)
        for key in ("material", "normal", *GLASS_KEYS[1:]):
            value = getattr(self, key)
            if needed[key] and value is None:
                raise broken_rule(f"{key} is missing (expected for type = {self.type!r})")
            if not needed[key] and value is not None:
                owner = "a prism" if key in GLASS_KEYS else "a kind with an axis"
                raise broken_rule(f"{key} = {value!r} belongs to {owner} (expected none for type = {self.type!r})")
        if self.height_mm is not None and self.hrp_mm is not None:
            refuse_deep_reference(self.hrp_mm, self.height_mm)
        return self


class Targets(Record):
    """Complete content of targets.toml.

    target   retroreflectors
    """

    format: Annotated[int | str, Version("targets")] = 1
    target: Annotated[tuple[TargetRow, ...], Field(strict=False)]


class FeedArmRanger(Record):
    """Ranger on the feed arm; its scan point is nominal, in the reflector frame.

    u_position_mm   of each coordinate of the scan point; by default the reduction's setting, 10 mm
    mount_z, mount_y  directions of the mount's z^ (fixed point to v-block) and y^ (up), reflector frame; both or none
    u_mount_rad     of the mount's turn about each axis; without it the u of encoder counts is unknown
    name            name of the ranger
    zp              name of its mirror
    nominal_scan_point_mm  nominal position of the scan point
    """

    name: Name
    zp: Name
    nominal_scan_point_mm: Position
    u_position_mm: PositionUncertainty | None = None
    mount_z: UnitVector | None = None
    mount_y: UnitVector | None = None
    u_mount_rad: Annotated[float, Within(0, 0.1)] | None = None

    @model_validator(mode="after")
    def _has_perpendicular_axes(self) -> "FeedArmRanger":
        for key, partner in (("mount_z", "mount_y"), ("mount_y", "mount_z")):
            if getattr(self, key) is None and getattr(self, partner) is not None:
                raise broken_rule(f"{partner} = {list(getattr(self, partner))} has no {key} (expected both or none)")
        if self.mount_z is not None and self.mount_y is not None:
            along = sum(z * y for z, y in zip(self.mount_z, self.mount_y, strict=True))
            if abs(along) > SQUARE:
                raise broken_rule(
                    f"mount_y = {list(self.mount_y)} is {math.degrees(math.acos(max(-1.0, min(1.0, along)))):.2f} deg "
                    f"from mount_z = {list(self.mount_z)} (expected 90, within {math.degrees(SQUARE):.1f})"
                )
        return self


class AimPoint(Record):
    """Point A, which the triplets face, in the reflector frame.

    nominal_mm   nominal position
    """

    nominal_mm: Position


class FeedArm(Record):
    """Complete content of feedarm.toml.

    ranger      rangers of the feed arm
    aim_point   point that the triplets face
    """

    format: Annotated[int | str, Version("feedarm")] = 1
    ranger: Annotated[tuple[FeedArmRanger, ...], Field(strict=False)]
    aim_point: AimPoint


class BenchmarkRow(Record):
    """Row of benchmarks.csv: certified distance from a ranger's scan point to a target.

    target                  name of the retroreflector
    ranger                  name of the ranger
    certified_distance_mm   distance by its certificate
    u_mm                    standard uncertainty of the distance
    """

    target: Name
    ranger: Name
    certified_distance_mm: Annotated[float, Within(500, 1e7)]
    u_mm: Uncertainty


def refuse_deep_reference(hrp_mm: float, height_mm: float) -> None:
    """Raise InputError for a reference point outside the glass."""
    if hrp_mm >= height_mm:
        raise broken_rule(f"hrp_mm = {hrp_mm} reaches past height_mm = {height_mm} (expected less)")
