"""Parts of the drawings: axes, arcs, dimensions, points."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc

INK, RED, BLUE, GREEN, GREY = "#222222", "#b3261e", "#1f5a99", "#2e7d32", "#888888"
SETTINGS = {
    "font.size": 10,
    "mathtext.fontset": "dejavusans",
    "svg.hashsalt": "catseye",
    "svg.fonttype": "path",
    "figure.facecolor": "white",
}


def sheet(low: tuple[float, float], high: tuple[float, float], width: float = 4.6) -> tuple[Figure, Axes]:
    """Empty figure with equal scales between two corners; `width` in inches."""
    height = width * (high[1] - low[1]) / (high[0] - low[0])
    figure = plt.figure(figsize=(width, height))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.axis("off")
    return figure, axes


def arrow(
    axes: Axes, start, along, text: str = "", *, colour: str = INK, width: float = 1.6, away: float = 0.0
) -> None:
    """Arrow from a point along a vector, its text beyond the head."""
    start, along = np.asarray(start, float), np.asarray(along, float)
    end = start + along
    style = {"arrowstyle": "-|>", "color": colour, "lw": width, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 12}
    axes.annotate("", end, start, arrowprops=style)
    if text:
        size = float(np.hypot(*along))
        place = end + along / size * (away or 0.09 * span(axes))
        axes.text(*place, text, color=colour, ha="center", va="center")


def span(axes: Axes) -> float:
    """Width of a drawing in its own unit."""
    low, high = axes.get_xlim()
    return high - low


def dot(axes: Axes, place, text: str = "", *, colour: str = INK, shift=(0.0, 0.0), size: float = 5.0) -> None:
    """Point with its name at a shift."""
    axes.plot(*place, "o", color=colour, ms=size, zorder=5)
    if text:
        axes.text(place[0] + shift[0], place[1] + shift[1], text, color=colour, ha="center", va="center")


def arc(  # noqa: PLR0913 - a drawing says where its text is
    axes: Axes,
    centre,
    radius: float,
    first: float,
    last: float,
    text: str,
    *,
    colour: str = RED,
    out: float = 1.22,
    at: float | None = None,
) -> None:
    """Arc with an arrow from one angle to another, degrees, counter-clockwise positive; its text at another angle."""
    low, high = sorted((first, last))
    axes.add_patch(Arc(centre, 2 * radius, 2 * radius, theta1=low, theta2=high, color=colour, lw=1.4))
    end, step = np.radians(last), np.radians(2.0 if last > first else -2.0)
    tip = np.add(centre, radius * np.array([np.cos(end), np.sin(end)]))
    tail = np.add(centre, radius * np.array([np.cos(end - step), np.sin(end - step)]))
    style = {"arrowstyle": "-|>", "color": colour, "lw": 1.4, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 11}
    axes.annotate("", tip, tail, arrowprops=style)
    middle = np.radians(0.5 * (first + last) if at is None else at)
    place = np.add(centre, out * radius * np.array([np.cos(middle), np.sin(middle)]))
    axes.text(*place, text, color=colour, ha="center", va="center")


def distance(axes: Axes, start, end, text: str, *, shift=(0.0, 0.0), colour: str = BLUE) -> None:
    """Dimension between two points, its text beside the middle."""
    style = {"arrowstyle": "<|-|>", "color": colour, "lw": 1.1, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 9}
    axes.annotate("", end, start, arrowprops=style)
    middle = 0.5 * (np.asarray(start, float) + np.asarray(end, float)) + shift
    axes.text(*middle, text, color=colour, ha="center", va="center")


def towards(axes: Axes, place, text: str, *, viewer: bool, shift=(0.0, 0.0), colour: str = INK) -> None:
    """Axis perpendicular to the paper: a dot in a circle towards the viewer, a cross away."""
    axes.plot(*place, "o", mfc="white", mec=colour, ms=10, zorder=6)
    axes.plot(*place, "." if viewer else "x", color=colour, ms=5, zorder=7)
    axes.text(place[0] + shift[0], place[1] + shift[1], text, color=colour, ha="center", va="center")


def unit(degrees: float) -> np.ndarray:
    """Unit vector at an angle from the horizontal, counter-clockwise."""
    return np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
