"""Figures of a design study: places, points, numbers, maps, search."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

from catseye.aliases import Array
from catseye.constants import DEGREE, MILLIMETRE
from catseye.gateways.design.tables import map_name
from catseye.gateways.design.words import quantity_of
from catseye.gateways.writers.drawing import BAD, FAINT, GRID, INK, SERIES, styled
from catseye.records.site.solids import Solids
from catseye.reduction.design.maps import DesignMap
from catseye.reduction.design.scene import GROUND, DesignScene
from catseye.reduction.design.study import DesignStudy

WIDTH = 9.4  # inches
MOST_NAMED = 40  # points with names
LEVELS = 8  # contours of a map
CAPTIONS = {
    "places": "Seen from above, ground frame: rangers before (open) and after (full), targets, regions and obstacles.",
    "points": "Longest axis of each point of interest before and after; bars are the scatter's where it was simulated.",
    "numbers": "Uncertainty against number, each with its best places found.",
    "search": "Uncertainty during the search; a dashed line begins a stage.",
}


def design_figures(study: DesignStudy) -> dict[str, Figure]:
    """Figures by name, where there is something to show."""
    with styled():
        drawn = {"places": _places(study), "points": _points(study)}
        if study.numbers:
            drawn["numbers"] = _numbers(study)
        for item in study.maps:
            if np.isfinite(item.u).any():
                drawn[map_name(item)] = _map(study, item)
        if study.path.values:
            drawn["search"] = _search(study)
    return drawn


def caption_of(study: DesignStudy, name: str) -> str:
    """Caption of a figure of that name."""
    if name in CAPTIONS:
        return CAPTIONS[name]
    return f"Predicted {quantity_of(study.aim)} against the place of {name.removeprefix('map-').replace('-', ' ')}."


def _stands(scene: DesignScene, posture: int) -> tuple[Array, Array]:
    """Rangers on the ground, and targets, seen from above (k, 2)."""
    x = scene.on_ground(posture)[:, :2]
    ground = np.array([scene.points[i].frame == GROUND and scene.points[i].role == "ranger" for i in range(len(x))])
    return x[ground], x


def _places(study: DesignStudy) -> Figure:
    before, after = study.before.scene, study.after.scene
    posture = study.after.posture
    figure = Figure(figsize=(WIDTH, 8.2), layout="constrained")
    ax = figure.add_subplot()
    ax.set_aspect("equal", adjustable="datalim")
    old, new = before.on_ground(posture), after.on_ground(posture)
    target = [i for i, p in enumerate(after.points) if p.role == "target"]
    interest = [after.row[name] for name in study.aim.interest]
    size = 14.0 if len(new) <= 150 else 5.0
    ax.scatter(
        new[target, 0], new[target, 1], s=0.7 * size, c=FAINT, marker="x", linewidths=0.7, label="targets", zorder=2
    )
    if len(interest) <= MOST_NAMED:
        ax.scatter(
            new[interest, 0],
            new[interest, 1],
            s=2 * size,
            facecolors="none",
            edgecolors=BAD,
            label="of interest",
            zorder=3,
        )
    _regions(ax, study, old)
    _obstacles(ax, study.constraints.solids)
    for label, rows, points in (("before", before.rangers, old), ("after", after.rangers, new)):
        full = label == "after"
        ax.scatter(
            points[rows, 0],
            points[rows, 1],
            s=2.4 * size,
            facecolors=SERIES[0] if full else "none",
            edgecolors=SERIES[0] if full else SERIES[1],
            linewidths=0.9,
            label=f"rangers {label}",
            zorder=4 + full,
        )
    for name, k in after.row.items():
        if (
            name in before.row
            and np.linalg.norm(new[k] - old[before.row[name]]) > 0.05
            and after.points[k].role == "ranger"
        ):
            start, end = old[before.row[name], :2], new[k, :2]
            ax.annotate(
                "", tuple(end), tuple(start), arrowprops={"arrowstyle": "->", "color": SERIES[1], "lw": 0.9}, zorder=4
            )
    if len(after.rangers) <= MOST_NAMED:
        for k in after.rangers:
            if after.points[k].frame == GROUND:
                ax.annotate(
                    after.points[k].name, tuple(new[k, :2]), (5, 5), textcoords="offset points", fontsize=7.5, color=INK
                )
    ax.set(xlabel="x, east (m)", ylabel="y, north (m)", title=f"{after.name}: places, {after.labels[posture]}")
    figure.legend(*ax.get_legend_handles_labels(), loc="outside right upper")
    return figure


def _regions(ax: Any, study: DesignStudy, places: Array) -> None:
    """Draw where rangers on the ground may stand."""
    scene = study.before.scene
    for variation in study.varied:
        for radius in variation.between or ():
            ax.add_patch(Circle((0.0, 0.0), radius, fill=False, ec=GRID, lw=1.2, zorder=1))
        for i in scene.rangers:
            point = scene.points[i]
            if variation.within is not None and point.frame == GROUND and variation.selects(point.name, "ranger", True):
                at = (float(places[i, 0]), float(places[i, 1]))
                ax.add_patch(Circle(at, variation.within, fill=False, ec=GRID, lw=1.0, zorder=1))


def _obstacles(ax: Any, solids: Solids) -> None:
    """Draw boxes, cylinders and spheres that stand on the ground."""
    style: dict[str, Any] = {"fc": "#e9c9cb", "ec": BAD, "lw": 0.8, "alpha": 0.7, "zorder": 1.5}
    for box in solids.box:
        if box.frame == GROUND:
            half = 0.5 * MILLIMETRE * np.array(box.size_mm[:2])
            turn, centre = box.turn_deg * DEGREE, MILLIMETRE * np.array(box.centre_mm[:2])
            corners = half * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
            rotation = np.array([(np.cos(turn), np.sin(turn)), (-np.sin(turn), np.cos(turn))])
            ax.add_patch(Polygon(corners @ rotation + centre, **style))
    for at, radius, frame in (
        *((item.from_mm, item.radius_mm, item.frame) for item in solids.cylinder),
        *((item.centre_mm, item.radius_mm, item.frame) for item in solids.sphere),
    ):
        if frame == GROUND:
            ax.add_patch(Circle((at[0] * MILLIMETRE, at[1] * MILLIMETRE), radius * MILLIMETRE, **style))


def _points(study: DesignStudy) -> Figure:
    names = list(study.aim.interest)
    first, last = study.before.longest[0] / MILLIMETRE, study.after.longest[0] / MILLIMETRE
    figure = Figure(figsize=(WIDTH, 4.2), layout="constrained")
    ax = figure.add_subplot()
    if len(names) > MOST_NAMED:
        order = np.arange(len(names))
        ax.plot(order, np.sort(first)[::-1], color=SERIES[1], label="before")
        ax.plot(order, np.sort(last)[::-1], color=SERIES[0], label="after")
        ax.set_xlabel("points of interest, each curve from the worst")
    else:
        at = np.arange(len(names))
        ax.bar(at - 0.2, first, 0.38, color=SERIES[1], label="before")
        ax.bar(at + 0.2, last, 0.38, color=SERIES[0], label="after")
        ax.set_xticks(at, names, rotation=45 if len(names) > 8 else 0, ha="right" if len(names) > 8 else "center")
        if study.scatter is not None and study.aim.name == "worst":
            for state, check, shift in zip((study.before, study.after), study.scatter, (-0.2, 0.2), strict=True):
                k = names.index(state.worst[0]) + shift
                ax.errorbar(k, check.u / MILLIMETRE, check.u_u / MILLIMETRE, fmt="o", ms=3.5, color=INK, capsize=3)
            ax.plot([], [], "o", ms=3.5, color=INK, label="scatter of the worst, ± u")
    ax.set_ylim(0.0, 1.18 * max(float(first.max()), float(last.max())))
    ax.set(ylabel="longest axis (mm)", title=f"{study.after.scene.name}: points of interest")
    ax.legend(ncols=3, loc="upper right")
    return figure


def _numbers(study: DesignStudy) -> Figure:
    figure = Figure(figsize=(WIDTH, 4.0), layout="constrained")
    ax = figure.add_subplot()
    number, u = [n.number for n in study.numbers], [n.u / MILLIMETRE for n in study.numbers]
    ax.plot(number, u, "o-", color=SERIES[0], label="with the best places found")
    ax.axhline(study.before.u / MILLIMETRE, color=SERIES[1], ls="--", lw=1.0, label="before")
    if study.settings.limit is not None:
        ax.axhline(study.settings.limit / MILLIMETRE, color=BAD, ls=":", lw=1.2, label="limit")
    ax.set_xticks(number)
    ax.set(
        xlabel="number of rangers or targets",
        ylabel="u (mm)",
        title=f"{study.after.scene.name}: {quantity_of(study.aim)} against number",
    )
    ax.legend()
    return figure


def _map(study: DesignStudy, drawn: DesignMap) -> Figure:
    figure = Figure(figsize=(WIDTH, 7.6), layout="constrained")
    ax = figure.add_subplot(aspect="equal")
    shown = np.ma.masked_invalid(drawn.u / MILLIMETRE)
    image = ax.pcolormesh(drawn.x, drawn.y, shown, shading="nearest", cmap="viridis_r", rasterized=True)
    span = float(np.ptp(shown.compressed()))
    if span > 0.0:
        digits = int(np.ceil(1.0 - np.log10(span / LEVELS)))
        lines: Any = ax.contour(drawn.x, drawn.y, shown, levels=LEVELS, colors="white", linewidths=0.7)
        ax.clabel(lines, fontsize=7.0, fmt=f"%.{max(digits, 0)}f")
    figure.colorbar(image, ax=ax, label=f"{quantity_of(study.aim)}, mm", shrink=0.85)
    scene = study.after.scene
    ground = np.array([scene.places[i, :2] for i in scene.rangers if scene.points[i].frame == GROUND])
    ax.scatter(
        ground[:, 0],
        ground[:, 1],
        s=26 if len(ground) <= MOST_NAMED else 8,
        c="white",
        edgecolors=INK,
        linewidths=0.8,
        zorder=3,
    )
    if drawn.place is not None:
        ax.scatter(*drawn.place, s=60, marker="D", c=BAD, edgecolors="white", zorder=4)
    ax.set_xlim(drawn.x[0], drawn.x[-1])
    ax.set_ylim(drawn.y[0], drawn.y[-1])
    ax.grid(False)
    whose = drawn.ranger or "one more ranger"
    ax.set(xlabel="x, east (m)", ylabel="y, north (m)", title=f"{scene.name}: u against the place of {whose}")
    return figure


def _search(study: DesignStudy) -> Figure:
    figure = Figure(figsize=(WIDTH, 3.8), layout="constrained")
    ax = figure.add_subplot()
    ax.plot(np.array(study.path.values) / MILLIMETRE, ".-", ms=4, color=SERIES[0])
    for at, _ in study.path.starts[1:]:
        ax.axvline(at, color=FAINT, ls="--", lw=0.7)
    ax.set(
        xlabel="accepted step", ylabel="u (mm)", title=f"{study.after.scene.name}: {quantity_of(study.aim)}, searched"
    )
    return figure
