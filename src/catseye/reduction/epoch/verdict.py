"""Verdict on a reduced campaign, and its thresholds."""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from catseye.estimation.least_squares.adjustment import CONVERGED
from catseye.records.night.campaign import Campaign
from catseye.records.site.validity import expired_of_site
from catseye.reduction.epoch.contradictions.contradiction import ClassScatter
from catseye.reduction.epoch.coordinates import AdjustedCoordinates
from catseye.reduction.epoch.motion.scatter import worst_class
from catseye.reduction.epoch.reason import ShotStatus
from catseye.verdict import Verdict

TOO_WIDE = 0.5  # variance factor: claims 1.4 times the scatter; complete nights of two generators have at least 0.77
CLASS_LIMIT = 3.5  # standard deviations of a class's variance factor: of four classes, one good night in a thousand
MOST_REJECTED = 0.1  # share of all shots in a usual night


def factor_spread(degrees_of_freedom: float) -> float:
    """Standard deviation of a variance factor, whose expectation is 1; NaN without degrees of freedom.

    >>> factor_spread(200.0)
    0.1
    """
    return float(np.sqrt(2.0 / degrees_of_freedom)) if degrees_of_freedom > 0.0 else float("nan")


def _worst_class(scatter: Sequence[ClassScatter]) -> ClassScatter | None:
    """Class of points whose shots scatter most beyond their claim; None where none does so by more than chance."""
    beyond = [(c.factor - 1.0) / factor_spread(c.degrees) for c in scatter]
    worst = int(np.argmax(beyond)) if beyond else -1
    return scatter[worst] if worst >= 0 and beyond[worst] > CLASS_LIMIT else None


def campaign_verdict(
    campaign: Campaign, coordinates: AdjustedCoordinates, status: Sequence[ShotStatus], rejected: int
) -> Verdict:
    """Verdict from scatter against the claim, rejected shots, and the exported campaign's verdict.

    status     of each shot
    rejected   number of rejected shots
    """
    own = _own_verdict(campaign, coordinates, status, rejected)
    return own.resting_on({"the exported campaign": campaign.verdict})


def _more(factor: float) -> float:
    """Scatter beyond the claim, per cent, of a variance factor."""
    return float(100.0 * (np.sqrt(factor) - 1.0))


def _own_verdict(
    campaign: Campaign, coordinates: AdjustedCoordinates, status: Sequence[ShotStatus], rejected: int
) -> Verdict:
    factor, degrees = coordinates.variance_factor, coordinates.degrees_of_freedom
    if coordinates.status != CONVERGED:
        return Verdict("failed", f"the adjustment did not converge: {coordinates.status}")
    if coordinates.frequencies.disagreement:
        return Verdict("doubtful", coordinates.frequencies.disagreement)
    if coordinates.contradictions and coordinates.doubts:
        return Verdict("doubtful", coordinates.doubts[0])
    if not (np.isfinite(factor) and degrees >= 1.0):
        return Verdict("doubtful", "nothing was measured twice, so the claimed uncertainties are unchecked")
    spread = factor_spread(degrees)
    worst = worst_class(coordinates.scatter)
    of_class = "" if worst is None else f"shots to or from the {worst.name} scatter {_more(worst.factor):.0f} % more"
    if factor > 1.0 + 2.0 * spread:
        says = f"the measurements scatter {_more(factor):.0f} % more than their uncertainties claim"
        return Verdict("doubtful", f"{says}; {of_class}" if of_class else says)
    if of_class:
        return Verdict("doubtful", f"{of_class} than their uncertainties claim")
    if factor < TOO_WIDE - 2.0 * spread:
        less = 100.0 * (1.0 - np.sqrt(factor))
        return Verdict(
            "doubtful",
            f"the measurements scatter {less:.0f} % less than their uncertainties claim: check the units",
        )
    if worst := _worst_class(coordinates.scatter):
        more = 100.0 * (np.sqrt(worst.factor) - 1.0)
        return Verdict(
            "doubtful", f"shots of the {worst.name} scatter {more:.0f} % more than their uncertainties claim"
        )
    shots = len(status)
    if rejected > MOST_REJECTED * shots:
        return Verdict("doubtful", f"{rejected} of {shots} shots were rejected, over {100.0 * MOST_REJECTED:.0f} %")
    if coordinates.doubts:
        return Verdict("doubtful", coordinates.doubts[0])
    if expired_records := expired_of_site(campaign):
        return Verdict("doubtful", "; ".join(expired_records))
    says = "as their uncertainties claim" if factor >= 1.0 - 2.0 * spread else "less than their uncertainties claim"
    undecided = Counter(status)[ShotStatus.UNDECIDED]
    either = f", {undecided} of them as one or the other is wrong" if undecided else ""
    return Verdict("good", f"the measurements scatter {says}, and {rejected} of {shots} shots were rejected{either}")
