"""Surface plate results of a triplet: points against the bare plate, and paint.

Distances of its points from the bare plate, and the possible thickness of paint.

The paint lies between the top plate and the synthetic plane, so the bare surface is at L_post - t_paint.
"""

from dataclasses import dataclass

from catseye.records.laboratory.triplet_measurement import TripletMeasurement

THINNEST, THICKEST = 0.05e-3, 0.15e-3  # m, the memo's estimate of the paint
TOLERANCE = 0.15e-3  # m, of a point's place as made


@dataclass(frozen=True)
class PlatePoints:
    """Heights of the points, and the paint's thickness; metres.

    height             of T_1, T_2 and BC above the granite plate
    departure          of each above the bare top plate, (least, most): for the memo's thinnest and thickest paint
    paint              (least, most) thickness for which all three lie within 0.15 mm of the bare top plate, not below
                       0; None where no thickness does
    paint_from_design  thickness for which the mean of the three lies in the bare top plate, as designed
    sampled            painted surface above the synthetic plane, (least, mean, most); None if not sampled.
                       It shows the paint's variation: the fixture rests on the paint, too
    """

    height: tuple[float, float, float]
    departure: tuple[tuple[float, float], ...]
    paint: tuple[float, float] | None
    paint_from_design: float
    sampled: tuple[float, float, float] | None


def plate_points(measurement: TripletMeasurement) -> PlatePoints:
    """Height of the three points above granite and above the bare plate.

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
    low = max(0.0, *(post - value - TOLERANCE for value in height))
    high = min(post - value + TOLERANCE for value in height)
    tops = [value * 1e-3 - post for value in plate.top_surface_mm]
    return PlatePoints(
        height=height,
        departure=tuple((value - post + THINNEST, value - post + THICKEST) for value in height),
        paint=(low, high) if low <= high else None,
        paint_from_design=post - sum(height) / 3.0,
        sampled=(min(tops), sum(tops) / len(tops), max(tops)) if tops else None,
    )
