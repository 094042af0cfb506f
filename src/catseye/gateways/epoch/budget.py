"""Budget of points as text, table lines, JSON, figure and files."""

from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from catseye.gateways.epoch.explain import MICROMETRE, micrometres
from catseye.gateways.writers.columns import Column, Table
from catseye.gateways.writers.drawing import FAINT, SERIES, Figure, styled, svg
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.written import Files, origin, write_files
from catseye.reduction.budget.points import PointBudget

AXES = ("east", "north", "up")
SMALLEST = 0.01  # share of the variance of every axis below which an input is not listed
FORMAT = "catseye-budget-1"


def _of_axis(cells: Callable[[PointBudget], np.ndarray], axis: int) -> Callable[[PointBudget], np.ndarray]:
    """Column of an axis: the inputs of the first point, of the second, ..."""
    return lambda parts: cells(parts)[:, :, axis].T.ravel()


def _contributions(parts: PointBudget) -> np.ndarray:
    return parts.contribution / MICROMETRE


def _shares(parts: PointBudget) -> np.ndarray:
    return 100.0 * parts.share


BUDGET = Table[PointBudget](
    "budget.csv",
    "results.md",
    (
        Column("point", "", "name", lambda parts: np.repeat(parts.points, len(parts.budget.sources))),
        Column("input", "", "kind of input", lambda parts: np.tile(parts.budget.sources, len(parts.points))),
        *(
            column
            for axis, name in enumerate("xyz")
            for column in (
                Column(
                    f"contribution_{name}_um",
                    "um",
                    f"standard uncertainty of {name} that this input alone would leave",
                    _of_axis(_contributions, axis),
                    ".3f",
                ),
                Column(
                    f"share_{name}_percent",
                    "percent",
                    f"its share of the variance of {name}",
                    _of_axis(_shares, axis),
                    ".3f",
                ),
            )
        ),
    ),
)


def listed(parts: PointBudget, point: int) -> list[int]:
    """Inputs of a point in order of their largest share, without the smallest."""
    share = parts.share[:, point].max(axis=1)
    return [int(k) for k in np.argsort(-share, kind="stable") if share[k] >= SMALLEST]


def budget_passages(parts: PointBudget) -> list[Passage]:
    """Passage a point: its uncertainty and the largest input of each axis."""
    passages = []
    for n, name in enumerate(parts.points):
        phrases = []
        for axis, title in enumerate(AXES):
            k = int(np.argmax(parts.share[:, n, axis]))
            share = 100.0 * parts.share[k, n, axis]
            of = " of the variance" if axis == 0 else ""
            phrases.append(
                f"{title} u {micrometres(parts.u[n, axis])}, the largest part from {parts.budget.sources[k]} "
                f"({share:.0f} %{of})"
            )
        passages.append(Passage(name, "; ".join(phrases) + "."))
    return passages


def point_budget_lines(parts: PointBudget) -> list[str]:
    """Table a point for a terminal: each input's size and share by axis."""
    lines = []
    for n, name in enumerate(parts.points):
        lines += ["", f"{name:<40}" + "".join(f"{title + ', µm':>12}{'%':>5}" for title in AXES)]
        for k in listed(parts, n):
            cells = (
                f"{parts.contribution[k, n, axis] / MICROMETRE:12.1f}{100.0 * parts.share[k, n, axis]:5.0f}"
                for axis in range(3)
            )
            lines.append(f"{parts.budget.sources[k]:<40}" + "".join(cells))
        small = np.delete(np.arange(len(parts.budget.sources)), listed(parts, n))
        cells = (
            f"{np.linalg.norm(parts.contribution[small, n, axis]) / MICROMETRE:12.1f}"
            f"{100.0 * parts.share[small, n, axis].sum():5.0f}"
            for axis in range(3)
        )
        lines.append(f"{f'{len(small)} smaller inputs':<40}" + "".join(cells))
        lines.append(f"{'together':<40}" + "".join(f"{u / MICROMETRE:12.1f}{100:5d}" for u in parts.u[n]))
    return lines[1:]


def budget_object(parts: PointBudget) -> dict[str, Any]:
    """JSON object of `catseye budget --json`."""
    return {
        "verdict": {"word": parts.verdict.word, "why": parts.verdict.why},
        "sources": list(parts.budget.sources),
        "points": {
            name: {
                "x": parts.x[n, 0],
                "y": parts.x[n, 1],
                "z": parts.x[n, 2],
                "u": parts.u[n],
                "contribution": parts.contribution[:, n],
                "share": parts.share[:, n],
            }
            for n, name in enumerate(parts.points)
        },
    }


def budget_figure(parts: PointBudget) -> Figure:
    """Standard uncertainty by input and axis, a panel a point."""
    order = [listed(parts, n) for n in range(len(parts.points))]
    heights = [len(rows) + 1 for rows in order]
    with styled():
        figure = Figure(figsize=(9.4, 1.0 + 0.42 * sum(heights)), layout="constrained")
        panels = figure.subplots(len(parts.points), 1, squeeze=False, height_ratios=heights)[:, 0]
        for n, ax in enumerate(panels):
            _bars(ax, parts, n, order[n])
        panels[-1].set_xlabel("contribution to the standard uncertainty, µm (their squares add up)")
        panels[0].legend(loc="lower right")
    return figure


def _bars(ax: Any, parts: PointBudget, n: int, rows: list[int]) -> None:
    """Bars of one point: together first, then its inputs, three axes each."""
    sizes = np.vstack([parts.u[n], parts.contribution[rows, n]]) / MICROMETRE
    where = np.arange(len(sizes))
    for axis, title in enumerate(AXES):
        ax.barh(where + 0.27 * (axis - 1), sizes[:, axis], height=0.25, color=SERIES[axis], label=title)
    ax.set_yticks(where, ["together", *(parts.budget.sources[k] for k in rows)])
    ax.invert_yaxis()
    ax.axhline(0.5, color=FAINT, lw=0.8)
    ax.grid(axis="y", visible=False)
    ax.set_title(parts.points[n], loc="left")


def write_budget(
    parts: PointBudget, directory: Path, inputs: Mapping[str, str], *, settings: Mapping[str, Any]
) -> None:
    """Write budget.csv, budget.json, contributions.svg, and last the provenance.

    directory   existing, from `writers.output.atomic_directory`
    inputs      SHA-256 of each input file, by name
    settings    settings of the command
    """
    files: Files = {
        BUDGET.file: lambda: BUDGET.csv(parts),
        "budget.json": lambda: json_page({"format": FORMAT, **budget_object(parts)}),
        "contributions.svg": lambda: svg(budget_figure(parts)),
    }
    made_by = {"format": FORMAT, "made_by": "catseye budget", "settings": dict(settings)}
    write_files(files, directory, {**made_by, **origin(datetime.now(UTC), inputs)})
