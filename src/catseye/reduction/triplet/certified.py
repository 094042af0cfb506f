"""Results of a triplet unit as calibrated quantities, each with its budget."""

import math
from collections.abc import Mapping

from catseye.constants import MILLIMETRE
from catseye.reduction.calibrations.budget import UNSTATED, Contribution
from catseye.reduction.calibrations.calibration import Quantity
from catseye.reduction.triplet.result import TripletReduction


def triplet_quantities(reduction: TripletReduction) -> tuple[Quantity, ...]:
    """Both heights and their difference, mm; without a height by ranging that of the surface plate alone."""
    plate = _quantity(
        "l_mpbc_mm",
        reduction.l_mpbc,
        reduction.l_mpbc_budget,
        "the same height from the surface plate",
    )
    if not math.isfinite(reduction.h_corr):
        return (plate,)
    ranging = _quantity(
        "h_corr_mm",
        reduction.h_corr,
        reduction.budget,
        "height of the ball's centre above the prisms' mid-point, towards the prism side, by ranging",
    )
    difference = _quantity(
        "difference_mm", reduction.difference, reduction.difference_budget, "h_corr less l_mpbc, shared errors removed"
    )
    return ranging, plate, difference


def _quantity(key: str, value: float, parts: Mapping[str, float], meaning: str) -> Quantity:
    """Quantity of parts in m, which add in quadrature."""
    rows = tuple(
        Contribution(source, part / MILLIMETRE, "mm", "B", UNSTATED, math.inf, 1.0)
        for source, part in parts.items()
        if part > 0.0
    )
    u = math.sqrt(sum(row.part**2 for row in rows))
    return Quantity(key=key, value=value / MILLIMETRE, u=u, unit="mm", meaning=meaning, budget=rows)
