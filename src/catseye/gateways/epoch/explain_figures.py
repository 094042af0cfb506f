"""Figures of a shot's explanation: contributions of the budget, and the histogram of its Monte Carlo."""

import numpy as np

from catseye.gateways.epoch.explain import MICROMETRE, SMALLEST_SHARE, metres, micrometres
from catseye.gateways.writers.drawing import BAD, FAINT, INK, SERIES, Figure, mpl, styled
from catseye.reduction.budget.explanation import Explanation

WIDE = 4.5  # standard uncertainties on either side in the histogram
GROUPS = (
    ("the samples", SERIES[0], ("noise", "amplitude", "steps")),
    ("the electronics", SERIES[1], ("reference", "references", "walk")),
    (
        "the head",
        SERIES[3],
        ("leakage", "d0", "axes", "coupling", "cyclic", "second", "feedback", "image", "frequency"),
    ),
    (
        "the air",
        SERIES[2],
        ("thermometer", "profile", "sound", "pressure", "humidity", "formula", "unread", "fluctuation"),
    ),
    ("the glass", SERIES[4], ("height", "ratio", "r1", "r2", "incidence", "across")),
)


def figures(explanation: Explanation) -> dict[str, Figure]:
    """Contributions of the budget and, after a Monte Carlo, its histogram."""
    with styled():
        drawn = {"contributions": _contributions(explanation)}
        if explanation.scattered is not None:
            drawn["histogram"] = _histogram(explanation)
        return drawn


def _colour(key: str) -> str:
    first = key.partition(" ")[0]
    return next(colour for _, colour, keys in GROUPS if first in keys)


def _contributions(explanation: Explanation) -> Figure:
    budget = explanation.budget
    assert budget is not None
    order = [k for k in np.argsort(-np.abs(budget.share), kind="stable") if abs(budget.share[k]) >= SMALLEST_SHARE]
    size = np.abs(budget.contribution[order]) / MICROMETRE
    figure = Figure(figsize=(9.4, 1.2 + 0.27 * (len(order) + 1)), layout="constrained")
    ax = figure.add_subplot()
    where = np.arange(len(order)) + 1
    ax.barh(0, budget.u / MICROMETRE, color=INK, height=0.62)
    ax.barh(where, size, color=[_colour(explanation.items[k].key) for k in order], height=0.62)
    ax.text(budget.u / MICROMETRE, 0, f"  u {micrometres(budget.u)}", va="center", color=INK, fontweight="bold")
    for y, k, length in zip(where, order, size, strict=True):
        share = 100.0 * budget.share[k]
        ax.text(
            float(length),
            float(y),
            f"  {share:.0f} %" if abs(share) >= 1.0 else f"  {share:.2f} %",
            va="center",
            color=FAINT,
        )
    ax.set_yticks([0, *where], ["together", *(explanation.items[k].given.name for k in order)])
    ax.invert_yaxis()
    ax.set_xlim(0.0, 1.16 * max(budget.u / MICROMETRE, float(size.max(initial=0.0))))
    ax.grid(axis="y", visible=False)
    ax.set_xlabel("contribution to the standard uncertainty, µm (right: share of variance)")
    used = {_colour(explanation.items[k].key) for k in order}
    handles = [mpl.patches.Patch(color=colour, label=name) for name, colour, _ in GROUPS if colour in used]
    ax.legend(handles=handles, loc="lower right")
    return figure


def _histogram(explanation: Explanation) -> Figure:
    budget, scattered = explanation.budget, explanation.scattered
    assert budget is not None
    assert scattered is not None
    figure = Figure(figsize=(9.4, 3.4), layout="constrained")
    ax = figure.add_subplot()
    off = (scattered.values - budget.value) / MICROMETRE
    u = budget.u / MICROMETRE
    edges = np.linspace(-WIDE * u, WIDE * u, 91)
    counts, _ = np.histogram(off, edges)
    density = counts / len(off) / np.diff(edges)
    ax.stairs(density, edges, fill=True, color=SERIES[0] + "40", label=f"{len(off)} draws")
    x = np.linspace(-WIDE * u, WIDE * u, 400)
    ax.plot(x, np.exp(-0.5 * (x / u) ** 2) / (u * np.sqrt(2.0 * np.pi)), color=INK, lw=1.2, label="budget, normal")
    for k, end in enumerate((scattered.low, scattered.high)):
        label = f"{100.0 * scattered.probability:g} % of the draws" if not k else None
        ax.axvline((end - budget.value) / MICROMETRE, color=SERIES[1], lw=1.1, ls="--", label=label)
    if explanation.adjusted is not None:
        d = (explanation.adjusted.distance - budget.value) / MICROMETRE
        if abs(d) < WIDE * u:
            wide = explanation.adjusted.u_distance / MICROMETRE
            ax.axvspan(d - wide, d + wide, color=SERIES[2] + "22", lw=0)
            ax.axvline(d, color=SERIES[2], lw=1.4, label="adjusted distance, ± u")
        else:
            ax.plot([], [], color=BAD, label=f"adjusted distance {micrometres(d * MICROMETRE)} off, outside the figure")
    ax.set_xlim(-WIDE * u, WIDE * u)
    ax.set_ylim(0.0, None)
    ax.set_yticks([])
    ax.grid(axis="y", visible=False)
    ax.set_xlabel(f"range less {metres(budget.value)}, µm")
    ax.legend(loc="upper right", frameon=True, facecolor="white", edgecolor="none", framealpha=0.9)
    return figure
