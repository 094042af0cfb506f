"""Budget of points as text, table lines, JSON and figure."""

from typing import Any

import numpy as np

from catseye.gateways.epoch.explain import MICROMETRE, micrometres
from catseye.gateways.writers.drawing import FAINT, SERIES, Figure, styled
from catseye.gateways.writers.passage import Passage
from catseye.reduction.budget.points import PointBudget

AXES = ("east", "north", "up")
SMALLEST = 0.01  # share of the variance of every axis below which an input is not listed


def listed(found: PointBudget, point: int) -> list[int]:
    """Inputs of a point in order of their largest share, without the smallest."""
    share = found.share[:, point].max(axis=1)
    return [int(k) for k in np.argsort(-share, kind="stable") if share[k] >= SMALLEST]


def budget_passages(found: PointBudget) -> list[Passage]:
    """Passage a point: its uncertainty and the largest input of each axis."""
    passages = []
    for n, name in enumerate(found.points):
        parts = []
        for axis, title in enumerate(AXES):
            k = int(np.argmax(found.share[:, n, axis]))
            share = 100.0 * found.share[k, n, axis]
            parts.append(
                f"{title} u {micrometres(found.u[n, axis])}, most of it by {found.budget.sources[k]} ({share:.0f} %)"
            )
        passages.append(Passage(name, "; ".join(parts) + "."))
    return passages


def point_budget_lines(found: PointBudget) -> list[str]:
    """Table a point for a terminal: each input's size and share by axis."""
    lines = []
    for n, name in enumerate(found.points):
        lines += ["", f"{name:<40}" + "".join(f"{title + ', µm':>12}{'%':>5}" for title in AXES)]
        for k in listed(found, n):
            cells = (
                f"{found.contribution[k, n, axis] / MICROMETRE:12.1f}{100.0 * found.share[k, n, axis]:5.0f}"
                for axis in range(3)
            )
            lines.append(f"{found.budget.sources[k]:<40}" + "".join(cells))
        small = np.delete(np.arange(len(found.budget.sources)), listed(found, n))
        cells = (
            f"{np.linalg.norm(found.contribution[small, n, axis]) / MICROMETRE:12.1f}"
            f"{100.0 * found.share[small, n, axis].sum():5.0f}"
            for axis in range(3)
        )
        lines.append(f"{f'{len(small)} smaller inputs':<40}" + "".join(cells))
        lines.append(f"{'together':<40}" + "".join(f"{u / MICROMETRE:12.1f}{100:5d}" for u in found.u[n]))
    return lines[1:]


def budget_object(found: PointBudget) -> dict[str, Any]:
    """JSON object of `catseye budget --json`."""
    return {
        "verdict": {"word": found.verdict.word, "why": found.verdict.why},
        "sources": list(found.budget.sources),
        "points": {
            name: {
                "x": found.x[n, 0],
                "y": found.x[n, 1],
                "z": found.x[n, 2],
                "u": found.u[n],
                "contribution": found.contribution[:, n],
                "share": found.share[:, n],
            }
            for n, name in enumerate(found.points)
        },
    }


def budget_figure(found: PointBudget) -> Figure:
    """Standard uncertainty by input and axis, a panel a point."""
    order = [listed(found, n) for n in range(len(found.points))]
    heights = [len(rows) + 1 for rows in order]
    with styled():
        figure = Figure(figsize=(9.4, 1.0 + 0.42 * sum(heights)), layout="constrained")
        panels = figure.subplots(len(found.points), 1, squeeze=False, height_ratios=heights)[:, 0]
        for n, ax in enumerate(panels):
            _bars(ax, found, n, order[n])
        panels[-1].set_xlabel("contribution to the standard uncertainty, µm (their squares add up)")
        panels[0].legend(loc="lower right")
    return figure


def _bars(ax: Any, found: PointBudget, n: int, rows: list[int]) -> None:
    """Bars of one point: together first, then its inputs, three axes each."""
    sizes = np.vstack([found.u[n], found.contribution[rows, n]]) / MICROMETRE
    where = np.arange(len(sizes))
    for axis, title in enumerate(AXES):
        ax.barh(where + 0.27 * (axis - 1), sizes[:, axis], height=0.25, color=SERIES[axis], label=title)
    ax.set_yticks(where, ["together", *(found.budget.sources[k] for k in rows)])
    ax.invert_yaxis()
    ax.axhline(0.5, color=FAINT, lw=0.8)
    ax.grid(axis="y", visible=False)
    ax.set_title(found.points[n], loc="left")
