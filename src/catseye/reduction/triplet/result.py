"""Result of a triplet's laboratory sheet.

H_corr and L_MPBC with uncertainty, and the acceptance of the unit.
"""

import math
from dataclasses import dataclass

from catseye.aliases import Array
from catseye.records.laboratory.triplet_measurement import TripletMeasurement
from catseye.reduction.triplet.geometry import TripletCycles, TripletLengths, TripletReadings
from catseye.reduction.triplet.memo import MemoNumbers
from catseye.reduction.triplet.plate import PlatePoints
from catseye.verdict import Verdict

TOLERANCE = 0.15e-3  # m, the memo's limit of |H_corr - L_MPBC|
LIKELY = 0.95  # least probability of conformity of an undoubted acceptance


@dataclass(frozen=True, eq=False)
class TripletReduction:
    """Calibration of one unit; metres, radians.

    Arrays over its k placements.

    measurement                    the sheet
    readings, cycles, lengths      with every symbol of the memo; `memo` its own numbers for comparison
    plate                          heights of the points and the paint
    h, u                           (k,) H_corr of each placement and its standard uncertainty
    covariance                     (k, k) m^2, of h
    weights                        (k,) of each in h_corr; 0 where it is rejected
    h_corr, u_h_corr               the best, ball centre above the prisms' mid-point towards the prism side
    l_mpbc, u_l_mpbc               the same from the surface plate
    difference, u_difference       h_corr - l_mpbc, shared errors removed
    accepted                       True if |difference| is at most 0.15 mm
    conformity_probability         of the true difference
    residuals, statistics          (k,) h - h_corr, m, and standardised (w)
    chi_square, degrees_of_freedom, p   of all placements agreeing; p NaN with one
    suspects                       placements, counted from 0, contradicted by the others; named, not dropped
    h_corr_without_suspects        NaN without suspects, or without others
    budget                         group of inputs -> its share in u_h_corr, m; l_mpbc_budget, difference_budget alike
    steps, u_steps                 (k,) place of the stops by ranging less the first placement's: 0 if spacers fit
    air_in_glass                   m, to be added to h_corr if the index ratio of the sheet belongs to 20 °C, 933 hPa,
                                   50 %; 0 where the sheet gives the index of the glass
    agreeing_ratio, u_agreeing_ratio   index ratio for which ranging and plate would agree
    status                         (k,) in words
    notes                          for the reader, a line each
    """

    measurement: TripletMeasurement
    readings: TripletReadings
    cycles: TripletCycles
    lengths: TripletLengths
    memo: MemoNumbers
    plate: PlatePoints
    h: Array
    u: Array
    covariance: Array
    weights: Array
    h_corr: float
    u_h_corr: float
    l_mpbc: float
    u_l_mpbc: float
    difference: float
    u_difference: float
    accepted: bool
    conformity_probability: float
    residuals: Array
    statistics: Array
    chi_square: float
    degrees_of_freedom: int
    p: float
    suspects: tuple[int, ...]
    h_corr_without_suspects: float
    budget: dict[str, float]
    l_mpbc_budget: dict[str, float]
    difference_budget: dict[str, float]
    steps: Array
    u_steps: Array
    air_in_glass: float
    agreeing_ratio: float
    u_agreeing_ratio: float
    status: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def verdict(self) -> Verdict:
        """Verdict by the memo's limit and the probability of conformity."""
        if not math.isfinite(self.difference):
            return Verdict("failed", "no placement gave a height to compare with the surface plate's")
        limit = f"{1e3 * abs(self.difference):.3f} mm against a limit of {1e3 * TOLERANCE:.2f}"
        chance = self.conformity_probability
        if not self.accepted:
            return Verdict("failed", f"not accepted: the two heights differ by {limit}")
        if math.isfinite(chance) and chance < LIKELY:
            return Verdict("doubtful", f"accepted, but its probability of conformity is {chance:.2f} ({limit})")
        if self.suspects:
            return Verdict("doubtful", f"accepted, with suspect placements ({limit})")
        return Verdict("good", f"accepted: the two heights differ by {limit}")


def conformity_probability(difference: float, u: float, tolerance: float = TOLERANCE) -> float:
    """Probability that a measured quantity lies within ± a tolerance.

    difference   m, measured
    u            m, its standard uncertainty, above 0 (at 0: 1 or 0)
    tolerance    m

    Source: [JCGM106] clause 7, two-sided tolerance interval, normal law without other knowledge.

    >>> round(conformity_probability(0.13e-3, 0.02e-3), 4)
    0.8413
    """
    if not (math.isfinite(difference) and math.isfinite(u)):
        return math.nan
    if u <= 0.0:
        return float(abs(difference) <= tolerance)
    high, low = (tolerance - difference) / u, (-tolerance - difference) / u
    return 0.5 * (math.erfc(-high / math.sqrt(2.0)) - math.erfc(-low / math.sqrt(2.0)))
