"""Budget of points of a night: each coordinate's uncertainty by kind of input."""

from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches

import numpy as np

from catseye.aliases import Progress
from catseye.errors import InputError
from catseye.records.files.refusal import shown
from catseye.records.night.campaign import Campaign
from catseye.reduction.budget.network import NetworkBudget, network_budget, point_functions
from catseye.reduction.epoch.coordinates import coordinates_of, settled_network
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.epoch.settling import SettledNetwork
from catseye.verdict import Verdict

NAMED = 3  # points that a refusal lists


@dataclass(frozen=True, eq=False)
class PointBudget:
    """Budget of n points.

    points    names
    x         (n, 3) m
    budget    of 3n coordinates, east, north, up of each point in turn
    verdict   of the night's reduction
    """

    points: tuple[str, ...]
    x: np.ndarray
    budget: NetworkBudget
    verdict: Verdict

    @property
    def u(self) -> np.ndarray:
        """Standard uncertainties (n, 3), m."""
        return self.budget.u.reshape(-1, 3)

    @property
    def contribution(self) -> np.ndarray:
        """Standard uncertainties (s, n, 3) that each of s inputs alone would leave, m."""
        return np.sqrt(np.maximum(self.budget.variance, 0.0)).reshape(-1, *self.x.shape)

    @property
    def share(self) -> np.ndarray:
        """Shares (s, n, 3) of the variance."""
        return self.budget.share.reshape(-1, *self.x.shape)


def budget_of_points(
    campaign: Campaign,
    points: Sequence[str],
    settings: ReductionSettings | None = None,
    progress: Progress | None = None,
) -> PointBudget:
    """Reduce a campaign and divide the variance of some points' coordinates among its inputs.

    Raises InputError for a name that is no point of the night, or a campaign that cannot be adjusted.
    """
    settled: list[SettledNetwork] = []

    def adjusted(campaign, phases, electronics, *, settings, progress):
        network, resolved = settled_network(campaign, phases, electronics, settings=settings, progress=progress)
        settled.append(network)
        return coordinates_of(network, resolved=resolved)

    reduction = reduce_epoch(campaign, settings, progress, adjusted=adjusted)
    coordinates = reduction.coordinates
    for name in points:
        if name not in coordinates.points:
            alike = get_close_matches(name, coordinates.points, NAMED) or coordinates.points[:NAMED]
            raise InputError(
                f"point {shown(name)} is not among the {len(coordinates.points)} points of {campaign.directory.name} "
                f"(expected one such as {', '.join(alike)})"
            )
    names = tuple(dict.fromkeys(points))
    functions = point_functions(settled[0].network, names, np.eye(3 * len(names)))
    return PointBudget(
        points=names,
        x=np.array([coordinates.x[coordinates.index(name)] for name in names]),
        budget=network_budget(settled[0], functions),
        verdict=reduction.verdict,
    )
