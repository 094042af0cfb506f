"""Triplet unit measured in the laboratory: heights, and phases before and after the flip.

Format: docs/formats/triplet.md; quantities: [GOLDMAN00] sections 2.2 and 2.3.
"""

import math
from dataclasses import dataclass
from datetime import date
from typing import Annotated, Any

from pydantic import Field, GetCoreSchemaHandler, GetJsonSchemaHandler, model_validator
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from catseye.constants import TWO_PI
from catseye.names import AirModelName
from catseye.optics.retroreflector import cats_eye, prism
from catseye.records.files.record import (
    Certificate,
    Name,
    Record,
    Uncertainty,
    Version,
    Within,
    broken_rule,
    out_of_range,
)

INCH_MM = 25.4
KIND = "triplet-measurement"
CONSTANT_MM = 0.05  # data sheet against its height and index: a third of the 0.15 mm decided by the calibration
REACH_MM = 20.0  # largest distance of a fiducial from the synthetic plane, and change of d_toppl + spacer in one set-up

A_TURN = 7.0  # rad: a phase slightly over a turn is not in degrees
PRINTED = {"percent": "%", "mm": "mm", "c": "°C", "hpa": "hPa", "rad": "rad"}
# factor, shift and name of other units a value may have been given in
MISTAKEN = {
    "mm": ((INCH_MM, 0.0, "inches"), (1e3, 0.0, "metres"), (304.8, 0.0, "feet"), (1e-3, 0.0, "micrometres")),
    "c": ((1.0, -273.15, "kelvin"), (5.0 / 9.0, -160.0 / 9.0, "degrees Fahrenheit")),
    "hpa": ((0.01, 0.0, "pascals"), (10.0, 0.0, "kilopascals"), (33.8639, 0.0, "inches of mercury")),
    "percent": ((100.0, 0.0, "a share of one"),),
    "rad": ((math.pi / 180.0, 0.0, "degrees"),),
}


@dataclass(frozen=True)
class ReadingRange:
    """Range of a reading in its unit, and other units to suspect for a value outside it.

    unit        mm, c, hpa, percent or rad
    low, high   both included; a phase stays below `high`
    zero        True if 0 is also allowed, below `low`
    """

    unit: str
    low: float
    high: float
    zero: bool = False

    def check(self, value: float) -> float:
        inside = self.low <= value < self.high if self.unit == "rad" else self.low <= value <= self.high
        if inside or (self.zero and value == 0.0):
            return value
        unit = PRINTED[self.unit]
        expected = (
            "0 to below 2 pi rad"
            if self.unit == "rad"
            else f"{'0 or ' if self.zero else ''}{self.low:g} to {self.high:g} {unit}"
        )
        for factor, shift, name in MISTAKEN[self.unit]:
            converted = value * factor + shift
            if self.unit == "rad" and value < A_TURN:
                continue
            if self.low <= converted <= self.high:
                text = "expected {expected}; it looks like {name}, which would be {meant} {unit}"
                words = {"expected": expected, "name": name, "meant": f"{converted:.6g}", "unit": unit}
                raise PydanticCustomError("reading", text, words)
        if self.unit == "rad":
            raise PydanticCustomError("reading", "expected {expected}", {"expected": expected})
        raise out_of_range("range", Within(0.0 if self.zero else self.low, self.high), size=value, before="")

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_after_validator_function(self.check, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        high = "exclusiveMaximum" if self.unit == "rad" else "maximum"
        return {**handler(schema), "minimum": 0.0 if self.zero else self.low, high: self.high}


Phase = Annotated[float, ReadingRange("rad", 0.0, TWO_PI)]
Temperature = Annotated[float, ReadingRange("c", -20.0, 50.0)]
Pressure = Annotated[float, ReadingRange("hpa", 500.0, 1100.0)]
Humidity = Annotated[float, ReadingRange("percent", 1.0, 100.0, zero=True)]  # 0.47 is a share of one
Height = Annotated[float, ReadingRange("mm", 15.0, 500.0)]
Radius = Annotated[float, ReadingRange("mm", 10.0, 1000.0)]


class SurfacePlate(Record):
    """[surface_plate]: heights above the granite plate, prisms up, ball down.

    l1_mm, l2_mm      pole points of the left and the right prism
    l_bt_mm           vertex of the ball
    l_post_mm         half-length of the fixture: the synthetic reference plane; u_l_post_mm against gauge blocks
    u_height_mm       of each of l1_mm, l2_mm and l_bt_mm
    top_surface_mm    painted top plate, sampled at several places; optional
    """

    l1_mm: Height
    l2_mm: Height
    l_bt_mm: Height
    l_post_mm: Annotated[float, ReadingRange("mm", 20.0, 500.0)]
    u_height_mm: Uncertainty
    u_l_post_mm: Annotated[float, Within(0, 10)] = 0.002
    top_surface_mm: Annotated[tuple[Height, ...], Field(strict=False)] = ()


class MeasuredPrism(Record):
    """[left_prism] or [right_prism]: from the data sheet of the unit.

    serial      serial number
    height_mm   height of the prism, corner to pole point
    hrp_mm      fiducial point from the pole point
    pc_mm       prism constant, negative
    """

    serial: Annotated[int, Field(ge=1)]
    height_mm: Annotated[float, ReadingRange("mm", 10.0, 500.0)]
    u_height_mm: Annotated[float, Within(0, 10)] = 0.002
    hrp_mm: Annotated[float, ReadingRange("mm", 5.0, 500.0)]
    pc_mm: Annotated[float, Within(-2000, -1)]


class MeasuredBall(Record):
    """[ball]: from the data sheet of the unit; u_r_mm of each radius.

    r1_mm     radius of the small sphere
    r2_mm     radius of the large sphere
    u_r_mm    of each radius
    pc_b_mm   range constant of the ball, negative
    """

    r1_mm: Radius
    r2_mm: Radius
    u_r_mm: Annotated[float, Within(0, 10)] = 0.003
    pc_b_mm: Annotated[float, Within(-5000, -10)]


class Placement(Record):
    """[[placement]]: position of the unit on the range, prisms towards the ranger, then flipped.

    spacer_mm                  thickness in front of the rear stops
    d_toppl_mm                 scan point to back stops along their normal, minus l_post_mm and the spacer
    h_s_mm                     scan point (where the beam lands) above the line of the prisms
    phi_1_rad, phi_2_rad       phases of the left and of the right prism
    phi_zrg_rad                phase of the reference prism
    phi_cal_rad                phase of the zero distance
    temperature_c              temperature of the air
    pressure_hpa               pressure of the air
    humidity_percent           humidity of the air
    phi_bcfp_rad               phase of the ball after the flip
    phi_zrg_flipped_rad, phi_cal_flipped_rad  phases at the flip; without, the reading before it counts
    temperature_flipped_c      temperature of the air at the flip, likewise
    pressure_flipped_hpa       pressure of the air at the flip, likewise
    humidity_flipped_percent   relative humidity of the air at the flip, likewise
    u_phase_rad                of each phase reading
    """

    spacer_mm: Annotated[float, Within(0, 2000)]
    d_toppl_mm: Annotated[float, ReadingRange("mm", 3000.0, 200_000.0)]
    h_s_mm: Annotated[float, Within(-1000, 1000)]
    phi_1_rad: Phase
    phi_2_rad: Phase
    phi_zrg_rad: Phase
    phi_cal_rad: Phase
    temperature_c: Temperature
    pressure_hpa: Pressure
    humidity_percent: Humidity
    phi_bcfp_rad: Phase
    phi_zrg_flipped_rad: Phase | None = None
    phi_cal_flipped_rad: Phase | None = None
    temperature_flipped_c: Temperature | None = None
    pressure_flipped_hpa: Pressure | None = None
    humidity_flipped_percent: Humidity | None = None
    u_phase_rad: Annotated[float, Within(0, 1, above=True)]

    def flipped(self, quantity: str, unit: str) -> float:
        """Reading at the flip; the earlier one if none was taken."""
        reading: float | None = getattr(self, f"{quantity}_flipped_{unit}")
        before: float = getattr(self, f"{quantity}_{unit}")
        return before if reading is None else reading


class TripletMeasurement(Certificate):
    """Complete file.

    triplet                        name of the unit
    measured_on                    day of the measurement
    by                             person who measured
    bk7_to_air_group_index_ratio   n, for which the glass constants are valid
    bk7_group_index                group index of the glass; with it, the delay in glass follows each placement's air
    modulation_hz                  frequency of the modulation
    wavelength_um                  wavelength of the light in vacuum
    air_model                      formula for the index of air
    d12_mm, u_d12_mm               distance between the fiducial points of the prisms
    u_lateral_mm                   ball centre from the midpoint of the prisms, each direction in the plate
    u_temperature_c, u_pressure_hpa, u_humidity_percent  change of a reading between prisms and flip, without the
                                   offset of the sensor
    u_d_toppl_mm                   of the coarse distance d_toppl_mm
    u_spacer_mm                    of the thickness of a spacer
    surface_plate                  heights above the granite plate
    left_prism, right_prism        data of the prisms
    ball                           data of the ball
    placement                      positions of the unit on the range
    """

    format: Annotated[int | str, Version(KIND)] = 1
    triplet: Name
    measured_on: date
    by: str
    bk7_to_air_group_index_ratio: Annotated[float, Within(1.3, 2.5)]
    u_bk7_to_air_group_index_ratio: Annotated[float, Within(0, 0.1)] = 1e-5
    bk7_group_index: Annotated[float, Within(1.3, 2.5)] | None = None
    modulation_hz: Annotated[float, Within(1e8, 1e10)]
    wavelength_um: Annotated[float, Within(0.36, 1.7)]
    air_model: AirModelName
    d12_mm: Annotated[float, ReadingRange("mm", 100.0, 5000.0)]
    u_d12_mm: Uncertainty
    u_lateral_mm: Annotated[float, Within(0, 10)] = 0.05
    u_temperature_c: Annotated[float, Within(0, 10)] = 0.05
    u_pressure_hpa: Annotated[float, Within(0, 50)] = 0.1
    u_humidity_percent: Annotated[float, Within(0, 50)] = 1.0
    u_d_toppl_mm: Annotated[float, Within(0, 1000)] = 2.0
    u_spacer_mm: Annotated[float, Within(0, 10)] = 0.002
    surface_plate: SurfacePlate
    left_prism: MeasuredPrism
    right_prism: MeasuredPrism
    ball: MeasuredBall
    placement: Annotated[tuple[Placement, ...], Field(strict=False, min_length=1)]

    @property
    def prisms(self) -> tuple[MeasuredPrism, MeasuredPrism]:
        return self.left_prism, self.right_prism

    @model_validator(mode="after")
    def _has_correct_prism_sides(self) -> "TripletMeasurement":
        left_serial, right_serial = self.left_prism.serial, self.right_prism.serial
        swapped = "; left and right look swapped" if left_serial % 2 == 0 and right_serial % 2 == 1 else ""
        if left_serial % 2 == 0:
            raise broken_rule(f"left_prism.serial = {left_serial} is even (expected odd, the left prism's{swapped})")
        if right_serial % 2 == 1:
            raise broken_rule(f"right_prism.serial = {right_serial} is odd (expected even, the right prism's)")
        return self

    @model_validator(mode="after")
    def _has_constants_of_its_glass(self) -> "TripletMeasurement":
        n = self.bk7_to_air_group_index_ratio
        constants = []
        for table, unit in zip(("left_prism", "right_prism"), self.prisms, strict=True):
            constants.append((f"{table}.hrp_mm", unit.hrp_mm, float(prism.reference_depth(unit.height_mm, n))))
            constants.append((f"{table}.pc_mm", unit.pc_mm, float(prism.range_constant(unit.height_mm, n))))
        ball = float(cats_eye.range_constant(self.ball.r1_mm, self.ball.r2_mm, n))
        constants.append(("ball.pc_b_mm", self.ball.pc_b_mm, ball))
        if self.ball.r2_mm < self.ball.r1_mm:
            raise broken_rule(
                f"ball.r2_mm = {self.ball.r2_mm} is smaller than r1_mm = {self.ball.r1_mm} (expected the large one)"
            )
        for key, value, expected in constants:
            if abs(value - expected) > CONSTANT_MM:
                raise broken_rule(
                    f"{key} = {value} does not match the sizes and the index ratio {n} "
                    f"(expected {expected:.6f}, within {CONSTANT_MM:g} mm)"
                )
        return self

    @model_validator(mode="after")
    def _has_its_fiducial_points_near_the_synthetic_plane(self) -> "TripletMeasurement":
        plate = self.surface_plate
        heights = {
            "l1_mm": (plate.l1_mm, -self.left_prism.hrp_mm, "hrp_mm of the left prism below"),
            "l2_mm": (plate.l2_mm, -self.right_prism.hrp_mm, "hrp_mm of the right prism below"),
            "l_bt_mm": (plate.l_bt_mm, self.ball.r1_mm, "r1_mm above"),
        }
        for key, (value, shift, how) in heights.items():
            if abs(value + shift - plate.l_post_mm) > REACH_MM:
                raise broken_rule(
                    f"surface_plate.{key} = {value} puts the point {how} it {value + shift - plate.l_post_mm:+.3f} mm "
                    f"from l_post_mm = {plate.l_post_mm} (expected within {REACH_MM:g} mm)"
                )
        return self

    @model_validator(mode="after")
    def _has_its_spacers_in_millimetres(self) -> "TripletMeasurement":
        first = self.placement[0]
        for number, place in enumerate(self.placement[1:], start=1):
            off = place.d_toppl_mm + place.spacer_mm - first.d_toppl_mm - first.spacer_mm
            if abs(off) > REACH_MM and abs(off + place.spacer_mm * (INCH_MM - 1.0)) < 1.0:
                raise broken_rule(
                    f"placement[{number}].spacer_mm = {place.spacer_mm} with d_toppl_mm = {place.d_toppl_mm} puts the "
                    f"stops {off:+.1f} mm from where the first placement has them (expected mm; the spacer looks like "
                    "inches)"
                )
        return self
