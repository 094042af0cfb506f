"""Figures of panel setting: dish maps, corners, control chart, effect of turning."""

from typing import TYPE_CHECKING, Any

import numpy as np

from catseye.gateways.writers.drawing import BAD, FAINT, INK, SERIES, Figure, styled
from catseye.reduction.panels.crew import members, sessions
from catseye.reduction.panels.heights import surface_rms

if TYPE_CHECKING:
    from catseye.reduction.panels.heights import PanelHeights
    from catseye.reduction.panels.job import PanelWork

OUTSIDE = 1.03  # times the limits, so that edges are not cut


def panel_figures(work: "PanelWork") -> dict[str, Figure]:
    """Figures of the report, by name."""
    with styled():
        drawn = {
            "corners": _corners(work),
            "surface": _surface(work.latest),
            "lie": _lie(work),
            "control": _control(work),
        }
        if work.setting is not None:
            drawn["turning"] = _turning(work)
        return drawn


def _views(work: "PanelWork") -> list[tuple[str, "PanelHeights"]]:
    return [("as found", work.found)] + ([] if work.left is None else [("as left", work.left)])


def _quads(heights: "PanelHeights", shrink: float = 0.0) -> np.ndarray:
    """Quarter of each panel that belongs to each of its corners, (p, 4, 4, 2) m."""
    four = heights.layout.xy[heights.layout.quad]
    middle = four.mean(axis=1, keepdims=True)
    before, after = 0.5 * (four + np.roll(four, 1, axis=1)), 0.5 * (four + np.roll(four, -1, axis=1))
    quarter = np.stack([before, four, after, np.broadcast_to(middle, four.shape)], axis=2)
    return quarter + shrink * (quarter.mean(axis=2, keepdims=True) - quarter)


def _patches(ax: Any, outlines: np.ndarray, values: np.ndarray, limit: float) -> Any:
    from matplotlib.collections import PolyCollection

    finite = np.isfinite(values)
    if not finite.all():
        ax.add_collection(PolyCollection(list(outlines[~finite]), facecolor="#e9edf0", edgecolor="none"))
    patches = PolyCollection(
        list(outlines[finite]), array=values[finite], cmap="RdBu_r", edgecolor="face", linewidth=0.1
    )
    patches.set_clim(-limit, limit)
    patches.set_rasterized(True)  # thousands of pieces: rasterised a tenth of the size
    ax.add_collection(patches)
    low, high = outlines.reshape(-1, 2).min(axis=0), outlines.reshape(-1, 2).max(axis=0)
    pad = 0.02 * float(np.max(high - low))
    ax.set_xlim(low[0] - pad, high[0] + pad)
    ax.set_ylim(low[1] - pad, high[1] + pad)
    ax.set_aspect("equal")
    ax.grid(False)
    ax.set_xlabel("x (m)")
    ax.set_ylabel("y from the vertex (m)")
    return patches


def _limit(values: np.ndarray) -> float:
    sizes = np.abs(values[np.isfinite(values)])
    return max(float(np.quantile(sizes, 0.98)), 1e-3) if len(sizes) else 1.0


def _corners(work: "PanelWork") -> Figure:
    views = _views(work)
    wide = _shape(work.found)
    figure = Figure(figsize=(9.4, (9.0 if len(views) == 1 else 4.6) / max(wide, 0.7) + 0.7), layout="constrained")
    for ax, (name, heights) in zip(figure.subplots(1, len(views), squeeze=False)[0], views, strict=True):
        values = heights.relative * 1e6
        limit = _limit(values)
        quarters = _quads(heights).reshape(-1, 4, 2)
        patches = _patches(ax, quarters, values.ravel(), limit)
        ax.set_title(name)
        bar = figure.colorbar(patches, ax=ax, orientation="horizontal", shrink=0.8, extend="both", pad=0.02)
        bar.set_label("corner above the mean of its neighbours (µm)")
    return figure


def _shape(heights: "PanelHeights") -> float:
    """Width over height of the drawing."""
    size = np.ptp(heights.layout.xy, axis=0)
    return float(np.clip(size[0] / max(size[1], 1e-9), 0.5, 3.0))


def _surface(heights: "PanelHeights") -> Figure:
    wide = _shape(heights)
    figure = Figure(figsize=(9.4, 4.6 / max(wide, 0.7) + 0.7), layout="constrained")
    surface, quality = figure.subplots(1, 2)
    rms, departures = surface_rms(heights, heights.departure)
    values = departures.mean(axis=1) * 1e6
    outline = heights.layout.xy[heights.layout.quad]
    patches = _patches(surface, outline, values, _limit(values))
    surface.set_title(f"Panels' mean departure, {rms * 1e6:.0f} µm rms of corners")
    figure.colorbar(patches, ax=surface, orientation="horizontal", shrink=0.8, extend="both", pad=0.02).set_label(
        "departure from the best fit, towards the focus (µm)"
    )
    u = heights.u_fit[:, 0] * 1e6
    from matplotlib.collections import PolyCollection

    spread = PolyCollection(list(outline), array=u, cmap="viridis", edgecolor="face", linewidth=0.1, rasterized=True)
    spread.set_clim(0.0, float(np.quantile(u, 0.98)))
    quality.add_collection(spread)
    quality.set_xlim(surface.get_xlim())
    quality.set_ylim(surface.get_ylim())
    quality.set_aspect("equal")
    quality.grid(False)
    quality.set_xlabel("x (m)")
    quality.set_title("Standard uncertainty")
    figure.colorbar(spread, ax=quality, orientation="horizontal", shrink=0.8, extend="max", pad=0.02).set_label(
        "standard uncertainty of a panel's piston (µm)"
    )
    return figure


def _lie(work: "PanelWork") -> Figure:
    figure = Figure(figsize=(9.4, 3.2), layout="constrained")
    plot, right = figure.subplots(1, 2)
    goal = work.sheet.goal_um
    for (name, heights), colour in zip(_views(work), SERIES, strict=False):
        size = np.sort(np.abs(heights.relative[heights.known])) * 1e6
        if len(size):
            plot.step(np.maximum(size, 0.1), np.arange(1, len(size) + 1) / len(size), color=colour, label=name)
        right.hist(
            np.clip(heights.u_relative[heights.known] * 1e6, 0.0, 2.0 * goal), np.linspace(0.0, 2.0 * goal, 51),
            color=colour, histtype="step", lw=1.3, label=name,
        )  # fmt: skip
    plot.axvline(goal, color=BAD, lw=1.0, label=f"goal {goal:g} µm")
    plot.set_xscale("log")
    plot.set_ylim(0.0, OUTSIDE)
    plot.set_xlabel("distance from the mean of its neighbours (µm)")
    plot.set_ylabel("share of corners below")
    plot.set_title("Corners")
    plot.legend(loc="best")
    right.axvline(goal, color=BAD, lw=1.0)
    right.set_xlabel("standard uncertainty of the distance (µm)")
    right.set_ylabel("corners")
    right.set_title("Standard uncertainty")
    right.legend(loc="best")
    return figure


def _control(work: "PanelWork") -> Figure:
    views = _views(work)
    figure = Figure(figsize=(9.4, 2.9 * len(views) + 0.3), layout="constrained")
    panels = figure.subplots(len(views), 2, squeeze=False, gridspec_kw={"width_ratios": (2.4, 1.0)})
    for (days, people), (name, heights) in zip(panels, views, strict=True):
        for ax, readers, title in (
            (days, sessions(heights), f"Sessions {name}"),
            (people, members(heights), f"Members {name}"),
        ):
            at = np.arange(len(readers))
            value = np.array([r.variance_factor for r in readers])
            low, high = np.array([r.low for r in readers]), np.array([r.high for r in readers])
            ax.fill_between(
                np.repeat(at, 2) + np.tile([-0.5, 0.5], len(at)), np.repeat(low, 2), np.repeat(high, 2),
                color="#dfe9f3", lw=0, label="99.7 % of readings in control",
            )  # fmt: skip
            good = np.array([r.in_control for r in readers])
            ax.plot(at[good], value[good], "o", color=SERIES[0], ms=4)
            ax.plot(at[~good], value[~good], "o", color=BAD, ms=5)
            ax.axhline(1.0, color=FAINT, lw=0.8)
            step = max(1, len(at) // 14)
            many = len(at) > 6
            ax.set_xticks(at[::step], [r.name for r in readers][::step], rotation=60 if many else 0, fontsize=7.5)
            ax.set_title(title)
            ax.margins(x=0.01)
        days.set_ylabel("variance factor")
        days.legend(loc="best")
    return figure


def _turning(work: "PanelWork") -> Figure:
    setting = work.setting
    assert setting is not None
    figure = Figure(figsize=(9.4, 3.6), layout="constrained")
    change, right = figure.subplots(1, 2)
    demand, got = setting.wanted * 1e6, setting.got * 1e6
    change.plot(demand, got, ".", color=SERIES[0], ms=2.5, alpha=0.5, rasterized=True)
    ends = np.array([demand.min(), demand.max()])
    change.plot(ends, ends, color=FAINT, lw=1.0, label="requested")
    change.plot(ends, setting.gain * ends, color=SERIES[1], lw=1.0, label=f"achieved: {setting.gain:.3f}")
    change.set_xlabel("requested change (µm)")
    change.set_ylabel("achieved change (µm)")
    change.set_title("Effect of turning")
    change.legend(loc="best")
    remainder = got - setting.gain * demand
    limit = max(float(np.quantile(np.abs(remainder), 0.995)), 1.0)
    right.hist(np.clip(remainder, -limit, limit), 40, color=SERIES[0], alpha=0.8)
    right.axvline(0.0, color=INK, lw=0.8)
    right.set_xlabel("achieved minus expected (µm)")
    right.set_ylabel("corners")
    right.set_title(f"Scatter {setting.scatter * 1e6:.1f} µm rms")
    return figure
