"""Effects of a triplet's dimensions and of the air on its ranges: appendix A's three cases, and D.5."""

import math
from dataclasses import dataclass

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.errors import ValidityError
from catseye.reduction.triplet.sensitivity import LargestEffects, triplet_sensitivities
from catseye.reduction.triplet.tolerances import (
    D_12,
    MEMO_SLOPES,
    TOLERANCE,
    RefractivitySlopes,
    across_effect,
    along_bound,
    along_effect,
    along_effect_memo,
    glass_effect,
    ratio_change,
    refractivity_change,
    refractivity_slopes,
    spacing_effect,
    spacing_effect_memo,
)
from catseye.verdict import Verdict

LIMIT = TOLERANCE  # m: the memo expects the calibration within it
REFERENCE_AIR = (20.0, 933.0, 50.0)  # deg C, hPa, %: of the memo's index ratio


@dataclass(frozen=True)
class TripletDimensions:
    """Departures of a unit and place of the scan point; metres.

    spacing         by which the prisms stand further apart than assumed
    along, across   ball from the prisms' mid-point, in the plate: towards the right prism, and up
    d_12            between the prisms
    distance        D_0, from the scan point to the line of the prisms
    aside, height   of the scan point from the mid-point, along the prisms and up
    prism_glass     height of a prism
    ball_glass      R_1 + R_2 of the ball
    """

    spacing: float = TOLERANCE
    along: float = TOLERANCE
    across: float = TOLERANCE
    d_12: float = D_12
    distance: float = 18.0
    aside: float = 0.5 * D_12
    height: float = 0.05
    prism_glass: float = 0.0384
    ball_glass: float = 0.1464972

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not math.isfinite(value):
                raise ValidityError(f"{name} = {value} m is not a number (expected metres)")
        if not 0.0 < self.d_12 < 2.0 * self.distance:
            raise ValidityError(
                f"d_12 = {self.d_12:g} m at a distance of {self.distance:g} m: no triangle (expected 0 to twice it)"
            )
        for name in ("spacing", "along", "across"):
            if abs(getattr(self, name)) > 0.5 * self.d_12:
                raise ValidityError(
                    f"{name} = {getattr(self, name) / MILLIMETRE:g} mm is beyond a prism "
                    f"(expected up to {500 * self.d_12:g} mm)"
                )
        for name in ("prism_glass", "ball_glass"):
            if not 0.0 < getattr(self, name) < 2.0:
                raise ValidityError(f"{name} = {getattr(self, name):g} m (expected above 0 and below 2 m)")

    @property
    def d_1(self) -> float:
        """Distance from the scan point to the left prism, m."""
        return math.hypot(self.distance, self.aside + 0.5 * self.d_12)

    @property
    def d_2(self) -> float:
        """Distance from the scan point to the right prism, m."""
        return math.hypot(self.distance, self.aside - 0.5 * self.d_12)

    @property
    def d_mp(self) -> float:
        """Distance from the scan point to the mid-point, m."""
        return math.hypot(self.distance, self.aside)


@dataclass(frozen=True)
class WeatherChange:
    """Weather of a use less that of the table of glass constants, and the table's own.

    temperature_c, pressure_hpa, humidity_percent             changes
    from_temperature_c, from_pressure_hpa, from_humidity_percent   before
    """

    temperature_c: float = 0.0
    pressure_hpa: float = 0.0
    humidity_percent: float = 0.0
    from_temperature_c: float = REFERENCE_AIR[0]
    from_pressure_hpa: float = REFERENCE_AIR[1]
    from_humidity_percent: float = REFERENCE_AIR[2]


@dataclass(frozen=True)
class RangeEffect:
    """Effect of one case on a range, m.

    case      in words
    equation  of the memo
    exact     by exact geometry, with sign
    memo      by the memo's formula, with sign; nan where it has none
    bound     largest size by the memo; nan where it has none
    """

    case: str
    equation: str
    exact: float
    memo: float
    bound: float


@dataclass(frozen=True, eq=False)
class TripletBounds:
    """Effects of dimensions and air; metres.

    dimensions    of the unit, and the scan point
    weather       change of the air
    cases         appendix A's three
    slopes        derivatives of the group refractivity at the weather before
    change        of the group refractivity by D.5, and `memo_change` with the slopes as D.4 prints them
    exact_change  by the formula itself
    ratio         change of the index ratio n
    prism, ball   error of a range with the tabulated P_c, too long above 0
    causes        every cause at its tolerance, at the calibration and in use
    """

    dimensions: TripletDimensions
    weather: WeatherChange
    cases: tuple[RangeEffect, ...]
    slopes: RefractivitySlopes
    change: float
    memo_change: float
    exact_change: float
    ratio: float
    prism: float
    ball: float
    causes: tuple[LargestEffects, ...]

    @property
    def total(self) -> float:
        """Sum of the sizes of the three cases, m."""
        return sum(abs(case.exact) for case in self.cases)

    @property
    def verdict(self) -> Verdict:
        """Verdict: the memo's limit against the sum of the three cases, and A.8 where it holds."""
        size = f"{1e6 * self.total:.4g} µm together"
        if self.total > LIMIT:
            return Verdict("doubtful", f"the three cases are {size}, beyond the memo's 150 µm")
        d = self.dimensions
        outside = [name for name in ("aside", "height") if abs(getattr(d, name)) > 0.5 * d.d_12 * (1.0 + 1e-12)]
        if outside:
            return Verdict(
                "doubtful",
                f"the scan point is {' and '.join(outside)} of the prisms by more than half their spacing: the memo's "
                f"bound does not hold there ({size})",
            )
        return Verdict("good", f"the three cases are {size}, within the memo's 150 µm")


def triplet_bounds(dimensions: TripletDimensions, weather: WeatherChange) -> TripletBounds:
    """Effects of a unit's departures and of another air.

    dimensions   departures and the place of the scan point
    weather      change of the air

    Source: [GOLDMAN00] appendix A, eqs. A.1 to A.8, its third case by the law of cosines; appendix D, D.1 and D.5.

    >>> [round(1e6 * case.bound, 4) for case in triplet_bounds(TripletDimensions(), WeatherChange()).cases[:2]]
    [1.3229, 2.6458]
    """
    from catseye.atmosphere.index.air import group_refractivity
    from catseye.names import NOTES_AIR_MODEL

    d, w = dimensions, weather
    before = (w.from_temperature_c, w.from_pressure_hpa, w.from_humidity_percent)
    changes = (w.temperature_c, w.pressure_hpa, w.humidity_percent)
    slopes = refractivity_slopes(*before)
    after = [start + change for start, change in zip(before, changes, strict=True)]
    exact = float(
        group_refractivity(*after, model=NOTES_AIR_MODEL) - group_refractivity(*before, model=NOTES_AIR_MODEL)
    )
    return TripletBounds(
        dimensions=d,
        weather=w,
        cases=_cases(d),
        slopes=slopes,
        change=float(refractivity_change(*changes, slopes=slopes)),
        memo_change=float(refractivity_change(*changes, slopes=MEMO_SLOPES)),
        exact_change=exact,
        ratio=float(ratio_change(exact)),
        prism=float(glass_effect(d.prism_glass, exact)),
        ball=float(glass_effect(d.ball_glass, exact)),
        causes=triplet_sensitivities(depth=d.distance, aside=d.aside, above=d.height),
    )


def _cases(d: TripletDimensions) -> tuple[RangeEffect, ...]:
    """Three cases of appendix A; the scan point of the third is at the height of the line plus `height`."""
    far = {"d_1": d.d_1, "d_2": d.d_2, "d_12": d.d_12}
    bound = float(along_bound(d.along, d.d_12, d.distance))
    return (
        RangeEffect(
            "prisms further apart",
            "A.2",
            float(spacing_effect(d.d_12, d.spacing, d.d_mp)),
            float(spacing_effect_memo(d.d_12, d.spacing, d.d_mp)),
            abs(float(spacing_effect_memo(d.d_12, d.spacing, d.distance))),
        ),
        RangeEffect(
            "ball along the prisms' line",
            "A.6, A.7, A.8",
            float(along_effect(d.along, **far)),
            float(along_effect_memo(d.along, **far)),
            bound,
        ),
        RangeEffect(
            "ball across it, in the plate",
            "third case",
            float(across_effect(d.across, height=d.height, d_mp=math.hypot(d.d_mp, d.height))),
            float("nan"),
            float(along_bound(d.across, d.d_12, d.distance)),
        ),
    )


def effect_curves(bounds: TripletBounds, count: int = 201) -> dict[str, np.ndarray]:
    """Effects along the prisms' line of a ball aside, against the scan point's place: aside, exact, bound; metres.

    bounds   a unit's
    count    of places, from twice the prisms' spacing to the left to as far to the right
    """
    d = bounds.dimensions
    aside = np.linspace(-1.2 * d.d_12, 1.2 * d.d_12, count)
    d_1, d_2 = (np.hypot(d.distance, aside + side * d.d_12) for side in (0.5, -0.5))
    distance = np.sqrt(d.distance**2 + aside**2)
    return {
        "aside": aside,
        "along": along_effect(d.along, d_1=d_1, d_2=d_2, d_12=d.d_12),
        "across": across_effect(d.across, height=aside, d_mp=distance),
        "spacing": spacing_effect(d.d_12, d.spacing, distance),
        "bound": np.full(count, float(along_bound(d.along, d.d_12, d.distance))),
    }
