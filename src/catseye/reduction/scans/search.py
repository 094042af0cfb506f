"""Search for a retroreflector before it is made: pattern, probability of finding, time.

The target lies about the predicted pointing with a normal distribution. A look finds it within `reach` of its place,
the angle at which half of the spot's peak is left, as `steering.finding` covers. A spiral begins where the target is
likeliest, a raster at a corner of its square.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from catseye.aliases import Array
from catseye.errors import ValidityError
from catseye.geometry.mirror.search_pattern import LEAST_REACH, Pattern, count_size, raster, spiral
from catseye.optics.spot import reach

PatternName = Literal["spiral", "raster"]
RINGS, SPOKES = 200, 180  # equally probable places of the target
ENOUGH = 0.95  # probability of finding, below which a search is doubtful


@dataclass(frozen=True, eq=False)
class SearchPlan:
    """Search for one target.

    name          "spiral" or "raster"
    pattern       places in order
    radius        rad, of the searched area; half the side of a raster's square
    within        rad, covered about a place
    u             (2,) rad on the sky: standard uncertainties of the target's place along azimuth and elevation
    look          s, of one look
    probability   (n,) of having found it after each look
    """

    name: PatternName
    pattern: Pattern
    radius: float
    within: float
    u: Array
    look: float
    probability: Array

    @property
    def seconds(self) -> Array:
        """Time (n,) after each look, s."""
        return self.look * np.arange(1.0, len(self.pattern) + 1.0)

    @property
    def total(self) -> float:
        """Probability of finding the target in the whole pattern."""
        return float(self.probability[-1])

    @cached_property
    def mean_seconds(self) -> float:
        """Mean time until it is found, of the searches that find it, s."""
        item = np.diff(self.probability, prepend=0.0)
        return float(item @ self.seconds / self.total) if self.total > 0.0 else float("nan")


def plan_search(
    predicted: Array,
    zeros: tuple[float, float],
    *,
    name: PatternName,
    spot: float,
    u: float,
    radius: float,
    look: float,
    limits: tuple[float, float],
) -> SearchPlan:
    """Pattern of a search, and the probability of having found the target after each look.

    predicted   (2,) counts
    zeros       (2,) counts (na0, ne0)
    name        "spiral" or "raster"
    spot        rad, radius of the expected spot at 1/e^2
    u           rad, standard uncertainty of Theta and of Phi'; on the sky that of Theta is sin Phi times it
    radius      rad, of the searched area, 0 or more
    look        s, of one look
    limits      azimuth stops, counts

    Raises ValidityError for a spot that whole counts miss, an invalid u or look, and where every place is beyond the
    stops.

    Source: geometry; the distribution by 36 000 equally probable places. A full disc of radius R and one u find
    1 - exp(-R^2 / 2 u^2), and a little more for what the last turn covers.
    """
    for what, value in (("u", u), ("look", look), ("spot", spot)):
        if not 0.0 < value < np.inf:
            raise ValidityError(f"{what} = {value:g} of a search is not above 0 and finite")
    within = float(reach(spot, 0.5))
    if within < LEAST_REACH:
        raise ValidityError(
            f"a spot of {1e6 * spot:.0f} urad falls to half within {1e6 * within:.0f} urad, less than whole counts "
            f"cover, {1e6 * LEAST_REACH:.0f} urad (expected a wider beam or a nearer target)"
        )
    if name == "spiral":
        pattern = spiral(predicted, zeros, radius, reach=within, limits=limits)
    else:
        pattern = raster(predicted, zeros, (radius, radius), reach=within, limits=limits)
    if not len(pattern):
        raise ValidityError("every place of the search lies beyond the azimuth stops")
    sine = float(count_size(predicted, zeros)[0] / count_size(predicted, (zeros[0], predicted[1] - 12_500.0))[0])
    on_sky = u * np.array([sine, 1.0])
    return SearchPlan(
        name=name,
        pattern=pattern,
        radius=radius,
        within=within,
        u=on_sky,
        look=look,
        probability=_found_after(pattern.offsets, on_sky, within),
    )


def _found_after(offsets: Array, u: Array, within: float) -> Array:
    """Probability (n,) that one of the first places is within reach of the target."""
    from scipy.spatial import cKDTree

    ring = np.sqrt(-2.0 * np.log1p(-(np.arange(RINGS) + 0.5) / RINGS))
    turn = 2.0 * np.pi * (np.arange(SPOKES) + 0.5) / SPOKES
    places = np.stack([np.outer(ring, np.cos(turn)), np.outer(ring, np.sin(turn))], axis=-1).reshape(-1, 2) * u
    near = cKDTree(offsets).query_ball_point(places, within)
    first = np.array([min(item) for item in near if item], dtype=int)
    return np.cumsum(np.bincount(first, minlength=len(offsets))) / len(places)
