"""solids.toml: simple solids that obstruct paths between rangers and retroreflectors."""

import re
from abc import abstractmethod
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from catseye.constants import DEGREE, MILLIMETRE
from catseye.geometry.clearance import solids
from catseye.records.files.reading import read_record
from catseye.records.files.record import Certificate, Pair, Record, Vector, Version, Within, broken_rule

WORDS = re.compile(r"[A-Za-z0-9][A-Za-z0-9 _.-]{0,59}")


def _plain_words(value: str) -> str:
    """Name as printed in reasons: only letters, digits, spaces and _ . -"""
    if WORDS.fullmatch(value):
        return value
    raise PydanticCustomError("name", "expected up to 60 letters, digits, spaces, _ . -")


Words = Annotated[str, AfterValidator(_plain_words)]
SolidFrame = Literal["ground", "alidade", "elevation", "reflector"]
FARTHEST_MM = 1e7
Size = Annotated[float, Within(20, 1e6)]  # mm: from a lattice rod to larger than any telescope
Radius = Annotated[float, Within(10, 5e5)]  # mm
RadiusOrPoint = Annotated[float, Within(0, 5e5)]  # mm
Thickness = Annotated[float, Within(0, 1e4)]  # mm


class SolidRecord(Record):
    """Keys of all kinds: a name and a frame.

    name    name of the solid
    frame   frame of its coordinates, with which it moves
    """

    name: Words
    frame: SolidFrame

    @abstractmethod
    def solid(self) -> solids.Solid:
        """Solid in metres, in its frame."""


class BoxRecord(SolidRecord):
    """[[box]]: a box.

    centre_mm   middle of the box
    size_mm     full lengths along its x, y and z
    turn_deg    rotation of its x axis about the z of the frame, right-handed
    """

    centre_mm: Vector
    size_mm: Annotated[tuple[Size, Size, Size], Field(strict=False)]
    turn_deg: Annotated[float, Within(-360, 360)] = 0.0

    def solid(self) -> solids.SolidBox:
        return solids.SolidBox(_metres(self.centre_mm), _metres(self.size_mm), self.turn_deg * DEGREE)


class SphereRecord(SolidRecord):
    """[[sphere]]: a sphere.

    centre_mm   centre
    radius_mm   radius
    """

    centre_mm: Vector
    radius_mm: Radius

    def solid(self) -> solids.SolidSphere:
        return solids.SolidSphere(_metres(self.centre_mm), self.radius_mm * MILLIMETRE)


class CylinderRecord(SolidRecord):
    """[[cylinder]]: a cylinder.

    from_mm, to_mm   centres of its flat ends
    radius_mm        radius
    """

    from_mm: Vector
    to_mm: Vector
    radius_mm: Radius

    @model_validator(mode="after")
    def _has_a_length(self) -> "CylinderRecord":
        _refuse_no_length(self.name, self.from_mm, self.to_mm)
        return self

    def solid(self) -> solids.SolidCone:
        radius = self.radius_mm * MILLIMETRE
        return solids.SolidCone(_metres(self.from_mm), _metres(self.to_mm), radius, radius)


class ConeRecord(SolidRecord):
    """[[cone]]: a cone, cut or whole.

    from_mm, to_mm                 centres of its flat ends
    from_radius_mm, to_radius_mm   radii of these ends; one of them may be 0, a point
    """

    from_mm: Vector
    to_mm: Vector
    from_radius_mm: RadiusOrPoint
    to_radius_mm: RadiusOrPoint

    @model_validator(mode="after")
    def _has_a_length_and_a_width(self) -> "ConeRecord":
        _refuse_no_length(self.name, self.from_mm, self.to_mm)
        if max(self.from_radius_mm, self.to_radius_mm) < 10.0:
            wider = max(self.from_radius_mm, self.to_radius_mm)
            raise broken_rule(f"{self.name}: its larger radius is {wider:g} mm (expected 10 to 500000)")
        return self

    def solid(self) -> solids.SolidCone:
        radii = (self.from_radius_mm * MILLIMETRE, self.to_radius_mm * MILLIMETRE)
        return solids.SolidCone(_metres(self.from_mm), _metres(self.to_mm), *radii)


class DishRecord(SolidRecord):
    """[[dish]]: piece of the paraboloid z = (x^2 + y^2)/4f about the frame's z axis, vertex at its origin.

    focal_length_mm      focal length of the paraboloid
    aperture_centre_mm   x, y of the middle of its aperture
    aperture_radius_mm   radius of the aperture
    below_mm, above_mm   thickness along z, below and above the surface
    """

    focal_length_mm: Annotated[float, Within(500, 1e6)]
    aperture_centre_mm: Pair
    aperture_radius_mm: Annotated[float, Within(250, 1e6)]
    below_mm: Thickness = 0.0
    above_mm: Thickness = 0.0

    def solid(self) -> solids.Dish:
        return solids.Dish(
            self.focal_length_mm * MILLIMETRE,
            (self.aperture_centre_mm[0] * MILLIMETRE, self.aperture_centre_mm[1] * MILLIMETRE),
            self.aperture_radius_mm * MILLIMETRE,
            below=self.below_mm * MILLIMETRE,
            above=self.above_mm * MILLIMETRE,
        )


class Solids(Certificate):
    """Complete solids.toml: any number of each kind, with unique names.

    box        boxes
    sphere     spheres
    cylinder   cylinders
    cone       cones
    dish       pieces of a paraboloid

    >>> Solids(format="catseye-solids-1").all
    ()
    """

    format: Annotated[int | str, Version("solids")] = 1
    box: Annotated[tuple[BoxRecord, ...], Field(strict=False)] = ()
    sphere: Annotated[tuple[SphereRecord, ...], Field(strict=False)] = ()
    cylinder: Annotated[tuple[CylinderRecord, ...], Field(strict=False)] = ()
    cone: Annotated[tuple[ConeRecord, ...], Field(strict=False)] = ()
    dish: Annotated[tuple[DishRecord, ...], Field(strict=False)] = ()

    @property
    def all(self) -> tuple[SolidRecord, ...]:
        """All solids, kind by kind."""
        return (*self.box, *self.sphere, *self.cylinder, *self.cone, *self.dish)

    @model_validator(mode="after")
    def _has_unique_names(self) -> "Solids":
        names = [solid.name for solid in self.all]
        for name in names:
            if names.count(name) > 1:
                raise broken_rule(f"solid {name!r} is given twice (expected unique names)")
        return self

    @model_validator(mode="after")
    def _stands_within_reach(self) -> "Solids":
        for solid in self.all:
            for key in ("centre_mm", "from_mm", "to_mm"):
                for value in getattr(solid, key, ()):
                    if abs(value) > FARTHEST_MM:
                        raise broken_rule(f"{solid.name}: {key} holds {value:g} (expected within {FARTHEST_MM:g} mm)")
        return self


def read_solids(path: Path | str) -> Solids:
    """Solids of a file; InputError in one line if invalid."""
    return read_record(path, Solids)


def _metres(values: tuple[float, float, float]) -> tuple[float, float, float]:
    return values[0] * MILLIMETRE, values[1] * MILLIMETRE, values[2] * MILLIMETRE


def _refuse_no_length(name: str, start: tuple[float, ...], end: tuple[float, ...]) -> None:
    if max(abs(a - b) for a, b in zip(start, end, strict=True)) < 10.0:
        raise broken_rule(f"{name}: from_mm = {list(start)} and to_mm = {list(end)} are the same (expected two ends)")
