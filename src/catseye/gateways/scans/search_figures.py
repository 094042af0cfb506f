"""Figures of searches: probability by time, and the path of each search."""

import numpy as np

from catseye.gateways.steering.tracking_figures import search_figure
from catseye.gateways.writers.drawing import FAINT, SERIES, Figure, styled
from catseye.reduction.scans.searches import Searches

MOST_PATHS = 6  # figures of single searches
NAMES = 6  # targets in a legend


def search_figures(searches: Searches) -> dict[str, Figure]:
    """`probability`, and the path of each of the first searches under its target's name."""
    paths = list(zip(searches.targets.names, searches.spots, strict=True))[:MOST_PATHS]
    return {
        "probability": probability_figure(searches),
        **{name: search_figure(spot, searches.zeros) for name, spot in paths},
    }


def probability_figure(searches: Searches) -> Figure:
    """Probability of having found each target by the time of the search, and the time of the simulated hits."""
    with styled():
        figure = Figure(figsize=(7.4, 3.6), layout="constrained")
        ax = figure.subplots()
        for k, (name, plan, spot) in enumerate(
            zip(searches.targets.names, searches.plans, searches.spots, strict=True)
        ):
            label = name if k < NAMES else None
            colour = SERIES[k % len(SERIES)]
            ax.plot(plan.seconds, 100.0 * plan.probability, color=colour, lw=1.3, label=label)
            hit = np.flatnonzero(spot.seen > 0.5 * spot.amplitude) if spot.found else np.zeros(0, dtype=int)
            if len(hit) and hit[0] < len(plan.seconds):
                ax.plot(plan.seconds[hit[0]], 100.0 * plan.probability[hit[0]], "o", ms=5, color=colour)
        plan = searches.plans[0]
        ax.axhline(100.0 * plan.total, color=FAINT, lw=0.8, ls="--")
        ax.set(xlabel="time of the search (s)", ylabel="found by then (%)", ylim=(0.0, 104.0))
        ax.set_xlim(left=0.0)
        ax.set_title(f"{plan.name} within {1e3 * plan.radius:.3g} mrad; dots: first light of the simulated search")
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        return figure
