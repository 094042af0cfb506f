"""triplets/TRnn.toml: data sheet of a triplet, two prisms and a ball on opposite sides of a plate."""

from typing import Annotated

from pydantic import model_validator

from catseye.records.files.record import (
    Certificate,
    Name,
    Position,
    Record,
    Uncertainty,
    UnitVector,
    Version,
    Within,
    broken_rule,
)
from catseye.records.site.retroreflector import BALL, PRISM, RetroreflectorKind
from catseye.records.site.target import (
    FrameName,
    GlassConstant,
    PositionUncertainty,
    PrismHeight,
    PrismReference,
    refuse_deep_reference,
)

MOST_COSINE = 0.1  # between normal and axis, which is in the plate: 6 degrees exceeds data sheet rounding
Small = Annotated[float, Within(-20, 20)]  # mm


class TripletPrism(Record):
    """[left_prism] or [right_prism].

    target      name of the prism as a target
    serial      serial number
    height_mm   height of the prism, from the corner to the entry face
    hrp_mm      depth from the entry face down to the reference point
    pc_mm       prism constant, negative
    """

    target: Name
    serial: int | str
    height_mm: PrismHeight
    u_height_mm: Uncertainty
    hrp_mm: PrismReference
    pc_mm: GlassConstant

    @property
    def kind(self) -> RetroreflectorKind:
        """Kind of the retroreflector: a prism."""
        return PRISM

    @model_validator(mode="after")
    def _refers_to_a_point_in_the_glass(self) -> "TripletPrism":
        refuse_deep_reference(self.hrp_mm, self.height_mm)
        return self


class TripletBall(Record):
    """[ball]: the cat's-eye of two spheres.

    target    name of the ball as a target
    r1_mm     radius of the small sphere
    r2_mm     radius of the large sphere
    u_r_mm    of each radius
    pc_b_mm   range constant of the ball, negative
    """

    target: Name
    r1_mm: Annotated[float, Within(5, 1000)]
    r2_mm: Annotated[float, Within(5, 1000)]
    u_r_mm: Uncertainty
    pc_b_mm: GlassConstant

    @property
    def kind(self) -> RetroreflectorKind:
        """Kind of the retroreflector: a ball."""
        return BALL

    @model_validator(mode="after")
    def _focuses_on_its_large_sphere(self) -> "TripletBall":
        if self.r2_mm < self.r1_mm:
            raise broken_rule(f"r2_mm = {self.r2_mm} is smaller than r1_mm = {self.r1_mm} (expected the large sphere)")
        return self


class TripletRecord(Certificate):
    """Triplet unit.

    nominal_position_mm     approximate centre of the ball, in the named frame
    u_position_mm           of each coordinate; by default the reduction's setting, 10 mm
    normal                  normal of the top plate, towards the prism side
    axis                    unit vector from the left to the right prism
    d12_mm                  distance between the prisms' reference points, with u_d12_mm
    h_corr_mm               ball centre above the prisms' midpoint along normal, with u_h_corr_mm
    l_mpbc_mm               the same from the surface plate, with u_l_mpbc_mm
    u_lateral_mm            ball centre against the midpoint, each direction in the plate
    triplet                 name of the unit
    frame                   frame of its position, with which it moves
    left_prism, right_prism  prisms
    ball                    cat's-eye
    """

    format: Annotated[int | str, Version("triplet")] = 1
    triplet: Name
    frame: FrameName
    nominal_position_mm: Position
    u_position_mm: PositionUncertainty | None = None
    normal: UnitVector
    axis: UnitVector
    d12_mm: Annotated[float, Within(50, 10_000)]
    u_d12_mm: Uncertainty
    h_corr_mm: Small
    u_h_corr_mm: Uncertainty
    l_mpbc_mm: Small
    u_l_mpbc_mm: Uncertainty
    u_lateral_mm: Uncertainty
    left_prism: TripletPrism
    right_prism: TripletPrism
    ball: TripletBall

    @property
    def targets(self) -> tuple[str, str, str]:
        """Names of left prism, right prism and ball."""
        return self.left_prism.target, self.right_prism.target, self.ball.target

    @model_validator(mode="after")
    def _has_its_axis_in_the_plate(self) -> "TripletRecord":
        cosine = sum(n * a for n, a in zip(self.normal, self.axis, strict=True))
        if abs(cosine) > MOST_COSINE:
            raise broken_rule(
                f"normal = {list(self.normal)} and axis = {list(self.axis)} have the cosine {cosine:.3f} "
                f"(expected perpendicular, within {MOST_COSINE:g})"
            )
        return self
