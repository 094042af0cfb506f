"""What the surface plate says of a triplet: how far its points are from the bare plate, and how thick the paint may be.

The paint lies between the top plate and the synthetic plane, so the bare surface is at L_post - t_paint.
"""

from dataclasses import dataclass

from catseye.records.laboratory.triplet_measurement import TripletMeasurement

THINNEST, THICKEST = 0.05e-3, 0.15e-3  # m, the memo's estimate of the paint
TOLERANCE = 0.15e-3  # m, of a point's place as made


@dataclass(frozen=True)
class PlatePoints:
    """Heights of the points, and what they say of the paint; metres.

    height             of T_1, T_2 and BC above the granite plate
    departure          of each above the bare top plate, (least, most): for the memo's thinnest and thickest paint
    paint              (least, most) thickness for which all three lie within 0.15 mm of the bare top plate, not below
                       0; None where no thickness does
    paint_from_design  thickness for which the mean of the three lies in the bare top plate, as designed
    sampled            painted surface above the synthetic plane, (least, mean, most); None where it was not sampled.
                       It tells how the paint varies: the fixture rests on the paint, too
    """

    height: tuple[float, float, float]
    departure: tuple[tuple[float, float], ...]
    paint: tuple[float, float] | None
    paint_from_design: float
    sampled: tuple[float, float, float] | None


def plate_points(measurement: TripletMeasurement) -> PlatePoints:
    """The three points above granite and above the bare plate.

    measurement   a measured unit

    Source: [GOLDMAN00] section 3.1 with figure 4.
    """
    plate = measurement.surface_plate
    post = plate.l_post_mm * 1e-3
    height = (
        (plate.l1_mm - measurement.left_prism.hrp_mm) * 1e-3,
        (plate.l2_mm - measurement.right_prism.hrp_mm) * 1e-3,
        (plate.l_bt_mm + measurement.ball.r1_mm) * 1e-3,
    )
    low = max(0.0, *(post - each - TOLERANCE for each in height))
    high = min(post - each + TOLERANCE for each in height)
    tops = [each * 1e-3 - post for each in plate.top_surface_mm]
    return PlatePoints(
        height=height,
        departure=tuple((each - post + THINNEST, each - post + THICKEST) for each in height),
        paint=(low, high) if low <= high else None,
        paint_from_design=post - sum(height) / 3.0,
        sampled=(min(tops), sum(tops) / len(tops), max(tops)) if tops else None,
    )
