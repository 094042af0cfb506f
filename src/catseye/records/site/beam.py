"""Beam from laser to reflector to detector, by elements; layout in docs/formats/beam.md."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from catseye.records.files.record import Certificate, Record, Version, Within, broken_rule

Millimetres = Annotated[float, Within(0, 1e6)]
Size = Annotated[float, Within(1e-4, 1e6)]  # mm
Curved = Annotated[float, Within(-1e7, 1e7)]  # mm; positive if the centre is behind the surface
Share = Annotated[float, Within(0, 1, above=True)]
Leak = Annotated[float, Within(0, 1)]
Quality = Annotated[float, Within(1, 100)]
Incidence = Annotated[float, Within(0, 89)]  # degrees
Axis = Literal["x", "y"]
Kind = Literal["space", "lens", "thick_lens", "mirror", "plate", "aperture", "splitter", "isolator"]

# keys of each kind: required and optional
KEYS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "space": (("length_mm",), ()),
    "lens": (("focal_length_mm",), ("acts",)),
    "thick_lens": (("thickness_mm", "glass"), ("r1_mm", "r2_mm")),
    "mirror": ((), ("radius_mm", "incidence_deg", "plane", "coating")),
    "plate": (("thickness_mm", "glass"), ("incidence_deg", "plane")),
    "aperture": (("aperture_radius_mm",), ()),
    "splitter": (("transmission",), ()),
    "isolator": ((), ("turn_deg", "temperature_c", "leak")),
}
COMMON = {"kind", "name", "aperture_radius_mm", "transmission"}


class Laser(Record):
    """[laser]: x and y planes; waist as radius at 1/e^2, or from the full angle at half maximum.

    power_mw                             mean power
    waist_x_um, waist_y_um               radius at 1/e^2
    divergence_x_deg, divergence_y_deg   full angle at half maximum, as in data sheets of diodes; instead of the
                                         waist
    astigmatism_um                       depth of the waist of x in the laser beyond that of y, which is at 0
    quality_x, quality_y                 beam quality M^2
    polarization                         axis of the field; after an isolator it is rotated by 45 degrees
    back_reflection                      share of the emitted power that returns to the isolator, from all sources
    regulation_rad                       phase per relative change of the power; see `signal.systematics.feedback`
    """

    power_mw: Annotated[float, Within(1e-6, 1e5)]
    waist_x_um: Annotated[float, Within(0.05, 1e5)] | None = None
    waist_y_um: Annotated[float, Within(0.05, 1e5)] | None = None
    divergence_x_deg: Annotated[float, Within(1e-4, 60)] | None = None
    divergence_y_deg: Annotated[float, Within(1e-4, 60)] | None = None
    astigmatism_um: Annotated[float, Within(-1000, 1000)] = 0.0
    quality_x: Quality = 1.0
    quality_y: Quality = 1.0
    polarization: Axis = "x"
    back_reflection: Leak | None = None
    regulation_rad: Annotated[float, Within(-10, 10)] | None = None

    @model_validator(mode="after")
    def _has_one_size_in_each_plane(self) -> "Laser":
        for axis in ("x", "y"):
            present = [key for key in (f"waist_{axis}_um", f"divergence_{axis}_deg") if getattr(self, key) is not None]
            if len(present) != 1:
                raise broken_rule(
                    f"laser has {' and '.join(present) or 'neither'} (expected waist_{axis}_um or "
                    f"divergence_{axis}_deg, one of them)"
                )
        return self


class BeamElement(Record):
    """[[outward]], [[inward]]: optical element, in the order of the light.

    kind                 kind of the element
    name                 label in tables and figures
    aperture_radius_mm   aperture of any element: light outside is lost
    transmission         power transmission of any element, without the coating of a mirror
    length_mm            length of a space, in air
    focal_length_mm      focal length of a thin lens
    acts                 axis of a thin lens: "x" or "y" for a cylindrical one
    r1_mm, r2_mm         radii of a thick lens, positive if the centre is behind; flat by default
    thickness_mm         thickness of a thick lens or a plate
    glass                glass of a thick lens or a plate, by its name in `catseye glass`
    radius_mm            radius of a mirror, positive if concave; flat by default
    incidence_deg        angle of incidence on a mirror or a plate
    plane                axis in the plane of incidence
    coating              coating of a mirror, by its name in `catseye plot coating`
    turn_deg             rotation by the rotator of an isolator at 20 °C
    temperature_c        temperature of an isolator's rotator, a garnet; by default 20
    leak                 leakage of each polarizer of an isolator
    """

    kind: Kind
    name: str = ""
    aperture_radius_mm: Size | None = None
    transmission: Share = 1.0
    length_mm: Millimetres | None = None
    focal_length_mm: Curved | None = None
    acts: Literal["both", "x", "y"] | None = None
    r1_mm: Curved | None = None
    r2_mm: Curved | None = None
    thickness_mm: Millimetres | None = None
    glass: str | None = None
    radius_mm: Curved | None = None
    incidence_deg: Incidence | None = None
    plane: Axis | None = None
    coating: str | None = None
    turn_deg: Annotated[float, Within(0, 90)] | None = None
    temperature_c: Annotated[float, Within(-40, 80)] | None = None
    leak: Leak | None = None

    @model_validator(mode="after")
    def _has_the_keys_of_its_kind(self) -> "BeamElement":
        needed, welcome = KEYS[self.kind]
        present = {key for key in self.model_fields_set if getattr(self, key) is not None}
        for key in needed:
            if key not in present:
                raise broken_rule(f"{key} is missing (expected for kind = '{self.kind}')")
        for key in sorted(present - COMMON - set(needed) - set(welcome)):
            raise broken_rule(f"{key} = {getattr(self, key)!r} does not belong to kind = '{self.kind}'")
        for key in ("focal_length_mm", "r1_mm", "r2_mm", "radius_mm"):
            if getattr(self, key) == 0.0:
                raise broken_rule(f"{key} = 0 (expected another length; a flat surface has no such key)")
        return self


class ReflectorRecord(Record):
    """[reflector]: a retroreflector, centred in the beam.

    radius_mm     radius of the clear aperture
    reflectance   total reflectance of all its surfaces
    name          label in tables and figures
    """

    name: str = ""
    radius_mm: Size
    reflectance: Share = 1.0


class Detector(Record):
    """[detector]: a round photodiode after the last inward element.

    radius_mm              radius of the active disc
    offset_um              offset of the image from the centre of the disc
    u_offset_um            standard uncertainty of each coordinate of that offset
    spot_um                radius of the image at 1/e^2; by default from the beam
    sheet_resistance_ohm   resistance per square; with capacitance_pf it gives the delay across the disc
    capacitance_pf         capacitance of the disc
    """

    radius_mm: Size
    offset_um: Annotated[float, Within(0, 1e5)] = 0.0
    u_offset_um: Annotated[float, Within(0, 1e5)] = 0.0
    spot_um: Annotated[float, Within(0.1, 1e5)] | None = None
    sheet_resistance_ohm: Annotated[float, Within(1e-3, 1e6)] | None = None
    capacitance_pf: Annotated[float, Within(1e-3, 1e5)] | None = None

    @model_validator(mode="after")
    def _has_resistance_with_capacitance(self) -> "Detector":
        if (self.sheet_resistance_ohm is None) != (self.capacitance_pf is None):
            raise broken_rule("sheet_resistance_ohm and capacitance_pf go together (expected both or none)")
        return self

    @model_validator(mode="after")
    def _has_its_image_on_it(self) -> "Detector":
        if self.offset_um > self.radius_mm * 1e3:
            raise broken_rule(
                f"offset_um = {self.offset_um:g} is outside the disc (expected up to {self.radius_mm * 1e3:g}, by its "
                "radius_mm)"
            )
        return self


class BeamTrain(Certificate):
    """Complete file.

    wavelength_um    wavelength of the light in air
    modulation_hz    frequency of the amplitude modulation
    distance_m       distance from the last outward element to the reflector and from it to the first inward one
    distances_m      distances in the table of returned power; by default a doubling series around distance_m
    name             title of the train
    laser            source
    outward          elements from the laser to the reflector, in order
    reflector        retroreflector
    inward           elements from the reflector to the detector, in order
    detector         photodiode
    """

    format: Annotated[int | str, Version("beam")]
    name: str
    wavelength_um: Annotated[float, Within(0.3, 2.0)] = 0.780
    modulation_hz: Annotated[float, Within(1e6, 1e11)] = 1500e6
    distance_m: Annotated[float, Within(0.01, 1e6)]
    distances_m: Annotated[tuple[Annotated[float, Within(0.01, 1e6)], ...], Field(strict=False, max_length=200)] = ()
    laser: Laser
    outward: Annotated[tuple[BeamElement, ...], Field(strict=False)]
    reflector: ReflectorRecord
    inward: Annotated[tuple[BeamElement, ...], Field(strict=False)]
    detector: Detector
