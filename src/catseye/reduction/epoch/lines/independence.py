"""Independent lines at each point, and points that an error of one line or survey could move unseen.

All shots of one ranger on one target are one line: an obstacle, a stray reflection or a wrong number of half
wavelengths is common to its repeats, which therefore do not check each other. The other lines do, and the records (a
benchmark's certificate, a triplet's sheet).
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from catseye.estimation.least_squares.adjustment import NONCENTRALITY
from catseye.estimation.least_squares.covariance import Covariance
from catseye.estimation.least_squares.robust import UNCHECKED
from catseye.records.night.campaign import REFERENCE
from catseye.reduction.epoch.lines.line_tests import LineTests
from catseye.reduction.epoch.prior_names import APPROXIMATE
from catseye.reduction.epoch.unknowns import CampaignNetwork

HARDLY_CHECKED = 0.1  # redundancy of a survey, below which its errors hardly show [FOERSTNER16]
LARGEST_SHIFT = NONCENTRALITY * (1.0 / UNCHECKED - 1.0) ** 0.5  # of a point, in its u: an error that nothing tests
LARGEST_BY_SURVEY = NONCENTRALITY * (1.0 / HARDLY_CHECKED - 1.0) ** 0.5  # the same of a survey's error


@dataclass(frozen=True, eq=False)
class Independence:
    """Lines at each point and what they check.

    lines        point: lines with a used shot, to it or from it
    shift        point: its largest shift by an error of one line that is found four times in five, over its u
    by_survey    the same by an error of one monument's survey
    unmeasured   ranged targets and rangers of which nothing but the typed position is known, sorted
    doubtful     points that may be wrong by whole half wavelengths, and rangers most of whose shots do not fit
    """

    lines: Mapping[str, int]
    shift: Mapping[str, float]
    by_survey: Mapping[str, float]
    unmeasured: tuple[str, ...]
    doubtful: frozenset[str]

    def unchecked(self, names: Sequence[str]) -> tuple[str, ...]:
        """Points among `names` that are doubtful, or that an error of one line or survey could move unseen."""
        return tuple(n for n in names if self.by_lines(n) or self.by_survey.get(n, 0.0) > LARGEST_BY_SURVEY)

    def by_lines(self, name: str) -> bool:
        """True for a point that is doubtful, or that an error of one line could move unseen."""
        return name in self.doubtful or self.shift.get(name, 0.0) > LARGEST_SHIFT


def independence_of(
    network: CampaignNetwork,
    tests: Sequence[LineTests],
    *,
    claimed: Covariance,
    by_survey: Mapping[str, float],
    doubtful: frozenset[str] = frozenset(),
) -> Independence:
    """Lines at each point of an adjusted network.

    tests     one of each ranger
    claimed   covariance of the parameters, with all errors that their uncertainties include
    by_survey, doubtful   as `Independence` has them

    Source: [BAARDA68], external reliability: sqrt(dx' C^-1 dx) of a point for the smallest error that is found.
    """
    lines = Counter(
        name for ranger, mine in zip(network.rangers, tests, strict=True) for t in mine.targets for name in (ranger, t)
    )
    names = list(network.places)
    first = np.array([network.layout.points[name] for name in names])
    weight = dict(zip(names, np.linalg.pinv(claimed.blocks(first), hermitian=True), strict=True))
    shift: dict[str, float] = {}
    for ranger, mine in zip(network.rangers, tests, strict=True):
        for target, by_one_u in zip(mine.targets, mine.moved, strict=True):
            for name, dx in zip((ranger, target), NONCENTRALITY * by_one_u, strict=True):
                shift[name] = max(shift.get(name, 0.0), float(np.sqrt(max(dx @ weight[name] @ dx, 0.0))))
    return Independence(lines, shift, by_survey, _unmeasured(network, lines), doubtful)


def _unmeasured(network: CampaignNetwork, lines: Mapping[str, int]) -> tuple[str, ...]:
    """Points without a used line of which nothing but the typed position is known.

    Also those whose shots have no phase or no whole cycles, which are not in the network.
    """
    typed = {c for g in network.priors if g.name == APPROXIMATE for c in np.ravel(g.columns).tolist()}
    layout, campaign = network.layout, network.campaign
    in_sheet = {n for t in campaign.triplets.values() if any(lines.get(m) for m in t.targets) for n in t.targets}
    ranged = {*campaign.shots.target, *campaign.shots.ranger} - {REFERENCE}
    return tuple(
        sorted(
            n
            for n in ranged
            if not lines.get(n) and n not in in_sheet and (n not in layout.points or layout.points[n] in typed)
        )
    )
