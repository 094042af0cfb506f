"""Figure of the tests of records."""

import numpy as np

from catseye.gateways.epoch.record_tests import by_group, listed_tests, name_of
from catseye.gateways.writers.drawing import BAD, FAINT, GRID, INK, SERIES, Figure
from catseye.reduction.epoch.epoch import Reduction

LINEAR = 4.0  # |w| up to which the axis is linear, logarithmic from there
NAMED = 3  # records of a group that are named, of those beyond the limit
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)  # its multiples spread evenly between 0 and 1
ROOM = 0.3  # share of the axis's end up to which a name has room outside of its mark
HEIGHT = 0.42  # inches a group


def records_figure(reduction: Reduction) -> Figure | None:
    """w of every number of every record, a row of marks for each group; None where nothing is tested."""
    coordinates, limit = reduction.coordinates, reduction.settings.critical
    groups = by_group(test for test in listed_tests(coordinates) if np.isfinite(test.w))
    if not groups:
        return None
    blamed = {e.record for c in coordinates.contradictions for e in c.explanations}
    edge = max(1.15 * max(abs(tests[0].w) for tests in groups.values()), LINEAR + 0.6)
    figure = Figure(figsize=(9.4, 1.3 + HEIGHT * len(groups)), layout="constrained")
    ax = figure.add_subplot()
    ax.axvspan(-limit, limit, color=GRID, lw=0, label=f"|w| below {limit:g}")
    ax.axvline(0.0, color=FAINT, lw=0.8)
    for row, tests in enumerate(groups.values()):
        w = np.array([test.w for test in tests])
        y = row + 0.6 * ((np.arange(len(w)) + 0.5) * GOLDEN % 1.0 - 0.5)
        wrong = np.array([test.record in blamed for test in tests])
        many = len(w) > 300
        ax.scatter(w[~wrong], y[~wrong], s=4 if many else 12, c=SERIES[0], lw=0, alpha=0.7, rasterized=many)
        ax.scatter(w[wrong], y[wrong], s=30, c=BAD, marker="D", lw=0, zorder=3)
        for k, test in enumerate(tests[:NAMED]):
            if abs(test.w) > limit:
                side = np.sign(test.w) * (1.0 if abs(test.w) < ROOM * edge else -1.0)
                ax.annotate(
                    name_of(test), (w[k], y[k]), xytext=(7 * side, 0), textcoords="offset points", fontsize=7.5,
                    color=INK, va="center", ha="right" if side < 0.0 else "left",
                )  # fmt: skip
    ax.scatter([], [], s=12, c=SERIES[0], lw=0, label="number of a record")
    if blamed:
        ax.scatter([], [], s=30, c=BAD, marker="D", lw=0, label="of a record that could explain a contradiction")
    _scale(ax, edge)
    ax.set_yticks(range(len(groups)), [f"{group} ({len(tests)})" for group, tests in groups.items()])
    ax.set_ylim(len(groups) - 0.4, -0.6)
    ax.grid(visible=False, axis="y")
    ax.set_xlabel("w: error of the record over its standard uncertainty")
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower left", ncols=3)
    return figure


def _scale(ax, limit: float) -> None:
    """Axis of w, logarithmic beyond LINEAR where w is that large."""
    if limit <= 2.0 * LINEAR:
        ax.set_xlim(-limit, limit)
        return
    ax.set_xscale("symlog", linthresh=LINEAR, linscale=1.2)
    ax.set_xlim(-limit, limit)
    outer = [t for t in (10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0, 10000.0) if t < limit]
    ticks = [*(-t for t in reversed(outer)), -4.0, -2.0, 0.0, 2.0, 4.0, *outer]
    ax.set_xticks(ticks, [f"{t:g}".replace("-", "−") for t in ticks])
    ax.minorticks_off()
