"""Sky of a ranger: the Sun's path and cone, boxes, a refused slew and its detour.

Left: map of the sky, north up, east to the right, the zenith in the middle. Right: the same in encoder counts, in
which the mirror moves. Zones are filled where the guard's clearance is zero, with the servo's margin as a thin line.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import DEGREE
from catseye.gateways.writers.drawing import BAD, FAINT, GRID, INK, SERIES, STYLE, Figure, Svg, mpl, svg
from catseye.geometry.clearance.keep_out import TOUCH
from catseye.geometry.mirror.encoder import COUNTS_PER_TURN
from catseye.geometry.mirror.pointing import ray
from catseye.geometry.mirror.slew import MirrorSlew, trapezoid
from catseye.geometry.sky.sun import altitude_azimuth
from catseye.geometry.sky.time_tag import utc_text
from catseye.reduction.site.earth_rotation import FramePlace, sun_at
from catseye.reduction.steering.guard import Guard
from catseye.reduction.steering.reroute import Route

EDGE = 100.0  # degrees from the zenith to the rim of the map
CELLS = 241  # per side of a panel
SUN, SUN_FILL, BOX_FILL = "#e09a12", "#fbe3ad", "#cdd6dd"
EXACT_BELOW = 0.1  # rad: only lines near the zones are drawn
STEPS = 200  # of a drawn move
PLATE = {"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.75}


def sky_figure(
    guard: Guard, mjd: float, *, slew: tuple[ArrayLike, ArrayLike] | None = None, route: Route | None = None
) -> Svg:
    """SVG text: sky of a ranger and its counts at a time.

    guard    of the ranger
    mjd      UTC
    slew     counts (2,) from and to of the requested slew, drawn to its first entry
    route    alternative found by `reduction.steering.reroute.route`
    """
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        return svg(_drawn(guard, mjd, slew, route))


def _drawn(guard: Guard, mjd: float, slew: tuple[ArrayLike, ArrayLike] | None, route: Route | None) -> Figure:
    figure = Figure(figsize=(12.4, 6.4), layout="constrained")
    sky, plane = figure.subplots(1, 2, width_ratios=[1.0, 1.02])
    _map(sky, guard, mjd)
    _counts(plane, guard, mjd)
    for at, ax in (("sky", sky), ("counts", plane)):
        for points, style in _ways(guard, mjd, slew, route):
            x = _on_map(ray(guard.station, points).direction) if at == "sky" else points
            ax.plot(x[..., 0], x[..., 1], clip_on=at == "counts", **style)
    title = f"{guard.name}, {utc_text(mjd).replace('T', ' ').replace('Z', ' UTC')}"
    sky.set_title(f"{title}: the sky", pad=14)
    plane.set_title("the same in encoder counts", pad=14)
    handles, labels = plane.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure


def _map(ax, guard: Guard, mjd: float) -> None:
    """Draw horizon, rings, the Sun's path over the day, and the zones."""
    side = np.linspace(-EDGE, EDGE, CELLS)
    x, y = np.meshgrid(side, side)
    radius = np.hypot(x, y)
    zenith, azimuth = radius * DEGREE, np.arctan2(x, y)
    direction = np.stack([np.sin(zenith) * np.sin(azimuth), np.sin(zenith) * np.cos(azimuth), np.cos(zenith)], axis=-1)
    _zones(ax, x, y, guard.around(mjd, direction, EXACT_BELOW), guard)
    turn = np.linspace(0.0, 2.0 * np.pi, 361)
    ax.fill(
        np.r_[90 * np.sin(turn), EDGE * np.sin(turn[::-1])],
        np.r_[90 * np.cos(turn), EDGE * np.cos(turn[::-1])],
        color="#e9e4da",
        alpha=0.55,
        lw=0,
        zorder=1.5,
    )
    for ring in (30.0, 60.0, 90.0):
        ax.plot(ring * np.sin(turn), ring * np.cos(turn), color=FAINT if ring == 90.0 else GRID, lw=0.8, zorder=1.6)
        ax.text(
            0.0, -ring, f"{90 - ring:.0f}°", fontsize=7, color=FAINT, ha="center", va="center", zorder=6, bbox=PLATE
        )
    for name, angle in (("N", 0.0), ("E", 90.0), ("S", 180.0), ("W", 270.0)):
        ax.text(95 * np.sin(angle * DEGREE), 95 * np.cos(angle * DEGREE), name, ha="center", va="center", weight="bold")
    ax.set(xlim=(-EDGE, EDGE), ylim=(-EDGE, EDGE), aspect="equal")
    ax.axis("off")
    if guard.place is not None:
        _sun_path(ax, guard.place, mjd)


def _sun_path(ax, place: FramePlace, mjd: float) -> None:
    """Draw the Sun from half a day before to half a day after, with hours (UTC)."""
    path = _on_map(sun_at(mjd + np.linspace(-0.5, 0.5, 289), place).direction)
    ax.plot(path[:, 0], path[:, 1], color=SUN, lw=1.0, alpha=0.8, zorder=3)
    hours = np.arange(np.ceil((mjd - 0.5) * 24.0), np.floor((mjd + 0.5) * 24.0) + 1)
    places = _on_map(sun_at(hours / 24.0, place).direction)
    for hour, spot in zip(hours, places, strict=True):
        if np.hypot(*spot) < 90.0:
            ax.plot(*spot, "o", ms=2.4, color=SUN, zorder=3)
            outward = spot / max(float(np.hypot(*spot)), 1.0) * 5.5
            ax.text(*(spot + outward), f"{hour % 24:.0f}", fontsize=6.5, color=SUN, ha="center", va="center", zorder=3)
    at = _on_map(sun_at(mjd, place).direction)
    if np.hypot(*at) < EDGE:
        ax.plot(*at, "o", ms=9, color=SUN, mec="white", mew=1.0, zorder=7)


def _counts(ax, guard: Guard, mjd: float) -> None:
    """Draw the zones between the stops, direct and prime pointings."""
    ne0 = float(guard.station.zeros[1])
    low, high = guard.azimuth_limits
    reach = 0.25 * COUNTS_PER_TURN
    grid = np.meshgrid(np.linspace(low, high, CELLS), np.linspace(ne0 - reach, ne0 + reach, CELLS))
    direction = ray(guard.station, np.stack(grid, axis=-1)).direction
    _zones(ax, *grid, guard.around(mjd, direction, EXACT_BELOW), guard, ne0)
    ax.axhline(ne0, color=FAINT, lw=0.8, ls=(0, (4, 3)), zorder=2)
    for text, level in (("direct", 0.97), ("prime", 0.03)):
        ax.text(0.99, level, text, transform=ax.transAxes, ha="right", va="center", fontsize=8, color=FAINT, bbox=PLATE)
    ax.set(xlim=(low, high), ylim=(ne0 - reach, ne0 + reach))
    ax.set_xlabel("azimuth (counts), from stop to stop")
    ax.set_ylabel("elevation (counts)")
    ax.xaxis.set_major_formatter("{x:,.0f}")
    ax.yaxis.set_major_formatter("{x:,.0f}")


def _zones(ax, x: NDArray, y: NDArray, clearance: NDArray, guard: Guard, named_above: float = -np.inf) -> None:
    """Draw each zone and the line where the margin begins; box names only above some y."""
    fills = [SUN_FILL, *[BOX_FILL] * len(guard.boxes)]
    edges = [SUN, *[SERIES[5]] * len(guard.boxes)]
    names = ["the Sun's cone", *[box.name for box in guard.boxes]]
    for i, (fill, edge) in enumerate(zip(fills, edges, strict=True)):
        gap = clearance[..., i]
        if not np.isfinite(gap).any() or gap.min() > 0.0:
            continue
        inside = 1e-9 + 0.2 * DEGREE * (i > 0)  # a box's clearance is never below zero: take half a pixel
        ax.contourf(x, y, gap, levels=[-np.pi, inside], colors=[fill], zorder=1)
        ax.contour(x, y, gap, levels=[inside], colors=[edge], linewidths=1.0, zorder=2)
        ax.contour(x, y, gap, levels=[guard.margin + TOUCH + inside], colors=[edge], linewidths=0.5, zorder=2)
        if i > 0:
            named = np.argwhere((gap <= inside) & (y >= named_above))
            if len(named):
                row, column = named[np.argmin(np.linalg.norm(named - named.mean(axis=0), axis=-1))]
                style = {"fontsize": 6.5, "color": INK, "ha": "center", "va": "center", "zorder": 5, "bbox": PLATE}
                ax.text(x[row, column], y[row, column], names[i], **style)


def _ways(
    guard: Guard, mjd: float, slew: tuple[ArrayLike, ArrayLike] | None, route: Route | None
) -> Iterator[tuple[NDArray[np.float64], dict]]:
    """Counts (n, 2) of the lines drawn over both panels, with their style."""
    if slew is not None:
        move = trapezoid(slew[0], slew[1], guard.pace)
        yield _along(move), {"color": BAD, "lw": 1.2, "ls": (0, (4, 2)), "zorder": 4, "label": "requested slew"}
        entered = guard.entries(mjd, move)
        if entered.status:
            entry = move.position(entered.time)[None]
            style = {"marker": "X", "ms": 8, "color": BAD, "mec": "white", "ls": "", "zorder": 8}
            yield entry, {**style, "label": "entry"}
    if route is not None and route.found:
        legs = trapezoid(route.waypoints[:-1], route.waypoints[1:], guard.pace)
        path = np.concatenate([_along(legs[i]) for i in range(len(route.waypoints) - 1)])
        label = f"verified path, {route.duration:.1f} s"
        yield path, {"color": SERIES[0], "lw": 1.8, "zorder": 5, "label": label}
        dots = {"marker": "o", "ms": 4.5, "color": SERIES[0], "mec": "white", "mew": 0.8, "ls": "", "zorder": 6}
        yield route.waypoints, {**dots, "label": "waypoints"}
    ends = route.waypoints[[0, -1]] if route is not None and route.found else slew
    if ends is not None:
        for at, marker, label in ((ends[0], "s", "from"), (ends[-1], "*", "to")):
            size = 7 if marker == "s" else 13
            spot = {"marker": marker, "ms": size, "color": SERIES[2], "mec": "white", "ls": "", "zorder": 9}
            yield np.asarray(at, dtype=float)[None], {**spot, "label": label}


def _along(move: MirrorSlew) -> NDArray[np.float64]:
    """Counts (n, 2) of one move."""
    return move.position(np.linspace(0.0, float(move.total), STEPS))


def _on_map(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Degrees (..., 2) east and north of the zenith on the map; NaN outside it."""
    altitude, azimuth = altitude_azimuth(direction)
    radius = 90.0 - altitude / DEGREE
    radius = np.where(radius <= EDGE, radius, np.nan)
    return np.stack([radius * np.sin(azimuth), radius * np.cos(azimuth)], axis=-1)
