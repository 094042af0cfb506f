"""keep-out.toml: boxes closed to beams, and the Sun's cone."""

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from catseye.constants import DEGREE, MILLIMETRE
from catseye.geometry.clearance.keep_out import BoxZone
from catseye.records.files.record import Certificate, Name, Record, Vector, Version, Within, broken_rule

SMALLEST_MM, LARGEST_MM = 50.0, 1e6  # of a box in mm; excludes values in metres
FARTHEST_MM = 1e7
Margin = Annotated[float, Within(0, 2000)]  # counts


class KeepOutBox(Record):
    """[[box]]: an upright solid in the ground frame, by two corners or by centre and size.

    low_mm, high_mm      corners with the least and the greatest x, y, z, before the rotation
    centre_mm, size_mm   alternative to the corners
    turn_deg             rotation about its vertical middle axis, from x towards y
    why                  protected object, repeated in refusals
    name                 name of the box
    """

    name: Name
    why: str = Field(min_length=3)
    low_mm: Vector | None = None
    high_mm: Vector | None = None
    centre_mm: Vector | None = None
    size_mm: Vector | None = None
    turn_deg: Annotated[float, Within(-360, 360)] = 0.0

    @model_validator(mode="after")
    def _has_one_definition(self) -> "KeepOutBox":
        corners = (self.low_mm is not None) + (self.high_mm is not None)
        middle = (self.centre_mm is not None) + (self.size_mm is not None)
        if (corners, middle) not in ((2, 0), (0, 2)):
            present = [k for k in ("low_mm", "high_mm", "centre_mm", "size_mm") if getattr(self, k) is not None]
            raise broken_rule(
                f"{self.name} is defined by {', '.join(present) or 'nothing'} "
                "(expected low_mm and high_mm, or centre_mm and size_mm)"
            )
        return self

    @model_validator(mode="after")
    def _is_a_solid_in_millimetres(self) -> "KeepOutBox":
        centre, size = self._centre_and_size_mm()
        for axis, (c, s) in zip("xyz", zip(centre, size, strict=True), strict=True):
            if s <= 0.0 and self.low_mm is not None:
                low, high = c - 0.5 * s, c + 0.5 * s
                raise broken_rule(
                    f"{self.name}: low_mm = {low:g} is not below high_mm = {high:g} along {axis} (expected low < high)"
                )
            if not SMALLEST_MM <= s <= LARGEST_MM:
                metres = " looks like metres" if SMALLEST_MM <= 1e3 * s <= LARGEST_MM else ""
                limits = f"expected {SMALLEST_MM:g} to {LARGEST_MM:g}"
                raise broken_rule(f"{self.name}: its size along {axis}, {s:g} mm{metres} ({limits})")
            if abs(c) > FARTHEST_MM:
                raise broken_rule(f"{self.name}: its middle is at {axis} = {c:g} mm (expected within {FARTHEST_MM:g})")
        return self

    def box(self, length: float = np.inf) -> BoxZone:
        """Box in metres and radians, for a beam of a length, m."""
        centre, size = (np.array(v) * MILLIMETRE for v in self._centre_and_size_mm())
        return BoxZone(
            centre=centre,
            size=size,
            turn=self.turn_deg * DEGREE,
            length=length,
            name=self.name,
            why=" ".join(self.why.split()),
        )

    def _centre_and_size_mm(self) -> tuple[list[float], list[float]]:
        if self.centre_mm is not None and self.size_mm is not None:
            return list(self.centre_mm), list(self.size_mm)
        pairs = list(zip(self.low_mm or (), self.high_mm or (), strict=True))
        return [0.5 * (low + high) for low, high in pairs], [high - low for low, high in pairs]


class SunCone(Record):
    """[sun]: the half angle of its cone, and the altitude below which it is set.

    half_angle_deg   half angle of the cone about the Sun that no beam may enter
    horizon_deg      altitude below which the Sun has set
    """

    half_angle_deg: Annotated[float, Within(0.5, 60)] = 5.0
    horizon_deg: Annotated[float, Within(-90, 0)] = -2.0


class KeepOut(Certificate):
    """Complete file.

    beam_length_m   boxes further from a scan point are ignored; by default the beam is infinite
    margin_counts   deviation of azimuth and elevation axis from their profile, including a later start of one
    sun             cone about the Sun
    box             boxes that no beam may enter
    """

    format: Annotated[int | str, Version("keep-out")] = 1
    sun: SunCone = SunCone()
    beam_length_m: Annotated[float, Within(1, 1e5)] | None = None
    margin_counts: Annotated[tuple[Margin, Margin], Field(strict=False)] = (20.0, 20.0)
    box: Annotated[tuple[KeepOutBox, ...], Field(strict=False)] = ()

    @model_validator(mode="after")
    def _has_unique_names(self) -> "KeepOut":
        names = [box.name for box in self.box]
        for name in names:
            if names.count(name) > 1:
                raise broken_rule(f"box {name!r} is given twice (expected unique names)")
        return self

    def boxes(self) -> tuple[BoxZone, ...]:
        """Boxes for beams of this length."""
        return tuple(box.box(np.inf if self.beam_length_m is None else self.beam_length_m) for box in self.box)
