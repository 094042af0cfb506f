"""Searches as JSON, text and tables."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from catseye.gateways.scans.tables import PAGE
from catseye.gateways.writers.columns import Column, Table
from catseye.gateways.writers.passage import Passage
from catseye.reduction.scans.search import SearchPlan
from catseye.reduction.scans.searches import Searches
from catseye.reduction.steering.spot_fit import Spot


def _plan(value: Callable[[SearchPlan], Any]) -> Callable[[Searches], list[Any]]:
    return lambda searches: [value(plan) for plan in searches.plans]


def _spot(value: Callable[[Spot], Any]) -> Callable[[Searches], list[Any]]:
    return lambda searches: [value(spot) for spot in searches.spots]


def _joined(value: Callable[[Spot], np.ndarray]) -> Callable[[Searches], np.ndarray]:
    return lambda searches: np.concatenate([value(spot) for spot in searches.spots])


SEARCHES = Table[Searches](
    "searches.csv",
    PAGE,
    (
        Column("target", "", "name", lambda s: list(s.targets.names)),
        Column("distance_m", "m", "from the scan point", lambda s: s.distance, ".4f"),
        Column("predicted_azimuth_counts", "", "by the records", lambda s: s.predicted[:, 0], ".3f"),
        Column("predicted_elevation_counts", "", "by the records", lambda s: s.predicted[:, 1], ".3f"),
        Column("places", "", "of the planned pattern", _plan(lambda plan: len(plan.pattern))),
        Column("beyond_stops", "", "places left out beyond the azimuth stops", _plan(lambda p: p.pattern.left_out)),
        Column("probability", "", "of finding the target in the pattern", _plan(lambda plan: plan.total), ".5f"),
        Column("mean_s", "s", "mean time until it is found", _plan(lambda plan: plan.mean_seconds), ".2f"),
        Column("longest_s", "s", "time of the whole pattern", _plan(lambda plan: plan.seconds[-1]), ".2f"),
        Column("looks", "", "of the simulated search, with the scan of the spot", _spot(lambda spot: len(spot.seen))),
        Column("azimuth_counts", "", "found; empty if not", _spot(lambda spot: spot.counts[0]), ".4f"),
        Column("u_azimuth_counts", "", "its standard uncertainty", _spot(lambda spot: spot.u_counts[0]), ".4f"),
        Column("elevation_counts", "", "found; empty if not", _spot(lambda spot: spot.counts[1]), ".4f"),
        Column("u_elevation_counts", "", "its standard uncertainty", _spot(lambda spot: spot.u_counts[1]), ".4f"),
        Column("peak_v", "V", "amplitude of the spot's centre", _spot(lambda spot: spot.amplitude), ".4f"),
        Column("success", "", "yes or no", _spot(lambda spot: "yes" if spot.found else "no")),
    ),
)
LOOKS = Table[Searches](
    "looks.csv",
    PAGE,
    (
        Column(
            "target",
            "",
            "name, in the order of the looks",
            lambda s: [n for n, spot in zip(s.targets.names, s.spots, strict=True) for _ in range(len(spot.seen))],
        ),
        Column("azimuth_counts", "", "of the look", _joined(lambda spot: spot.looked_at[:, 0]), ".0f"),
        Column("elevation_counts", "", "of the look", _joined(lambda spot: spot.looked_at[:, 1]), ".0f"),
        Column("amplitude_v", "V", "of the return", _joined(lambda spot: spot.seen), ".5f"),
    ),
)


def searches_object(searches: Searches) -> dict[str, Any]:
    """Object that `catseye scan search --json` prints, without the verdict."""
    rows = zip(searches.targets.names, searches.plans, searches.spots, strict=True)
    return {
        "pattern": searches.plans[0].name,
        "radius": searches.plans[0].radius,
        "targets": [
            {
                "target": name,
                "distance": searches.distance[k],
                "predicted_counts": searches.predicted[k],
                "places": len(plan.pattern),
                "probability": plan.total,
                "mean_time": plan.mean_seconds,
                "longest_time": plan.seconds[-1],
                "status": spot.status,
                "looks": len(spot.seen),
                "counts": spot.counts,
                "u_counts": spot.u_counts,
                "covariance": spot.covariance,
                "amplitude_volt": spot.amplitude,
            }
            for k, (name, plan, spot) in enumerate(rows)
        ],
    }


def search_passages(searches: Searches) -> list[Passage]:
    """The pattern, what to expect of it, and what was found."""
    plan = min(searches.plans, key=lambda each: each.total)
    hits = sum(spot.found for spot in searches.spots)
    moved = searches.predicted - np.array([spot.counts for spot in searches.spots])
    off = -np.nanmean(moved, axis=0) if hits else np.full(2, np.nan)
    passages = [
        Passage(
            "Pattern",
            f"{plan.name} within {1e3 * plan.radius:.3g} mrad, {len(plan.pattern)} places for the least likely target, "
            f"each covering {1e3 * plan.within:.3g} mrad about it",
        ),
        Passage(
            "Expected",
            f"found in {100 * plan.total:.2f} % of searches or more, after {plan.mean_seconds:.0f} s in the mean, "
            f"{plan.seconds[-1]:.0f} s at most",
        ),
        Passage("Simulated", f"{hits} of {len(searches.spots)} targets found"),
    ]
    if hits:
        text = f"found minus predicted {off[0]:+.2f}, {off[1]:+.2f} counts of azimuth, elevation in the mean"
        passages.append(Passage("Offset", text))
    return passages


def search_rows(searches: Searches) -> Iterator[str]:
    """Lines of the terminal: a row a target."""
    heads = f"{'target':<10}{'m':>8}{'P %':>8}{'mean s':>8}{'looks':>7}"
    yield f"{'':<14}{heads}{'azimuth':>12}{'u':>7}{'elevation':>12}{'u':>7}"
    for k, (plan, spot) in enumerate(zip(searches.plans, searches.spots, strict=True)):
        head = f"{'':<14}{searches.targets.names[k]:<10}{searches.distance[k]:8.2f}{100 * plan.total:8.2f}"
        head += f"{plan.mean_seconds:8.1f}{len(spot.seen):7d}"
        if spot.found:
            (na, ne), u = spot.counts, spot.u_counts
            yield f"{head}{na:12.3f}{u[0]:7.3f}{ne:12.3f}{u[1]:7.3f}"
        else:
            yield f"{head}  {spot.status}"
