"""Figures of a reduction, drawn without a display."""

from collections.abc import Sequence

import numpy as np
from matplotlib.collections import EllipseCollection, LineCollection

from catseye.constants import DEGREE, MILLIMETRE, PPM, SECONDS_PER_DAY
from catseye.gateways.detection.night_harmonics import harmonics_figure
from catseye.gateways.epoch.record_figure import records_figure
from catseye.gateways.epoch.tables import kinds_of
from catseye.gateways.epoch.third_order_figure import third_order_figure
from catseye.gateways.writers.drawing import BAD, FAINT, GRID, INK, SERIES, Figure, nice, styled
from catseye.reduction.epoch.epoch import Reduction

COLOURS = {
    "ground ranger": "#1f5a99",
    "feed-arm ranger": "#d9641e",
    "dish prism": "#6f8fa8",
    "triplet ball": "#1e8e74",
    "triplet prism": "#7cc0ae",
    "structure": "#8a5fa8",
    "benchmark": "#b08a1e",
}
MARKERS = {"ground ranger": "^", "feed-arm ranger": "s", "structure": "D", "benchmark": "o"}
CROWD = 300  # points or prisms from which only colour is shown: no name, number or ellipsoid
PIXELS = 2000  # marks or lines from which they are rasterised, to limit the page's size
LOOSE = 1.0 * MILLIMETRE  # u above which a coordinate is not determined by the ranges: no ellipsoid


def figures(reduction: Reduction) -> dict[str, Figure]:
    """Figures of the report, by name."""
    with styled():
        drawn = {
            "plan": _plan(reduction),
            "elevation": _elevation(reduction),
            "structure": third_order_figure(reduction, COLOURS),
            "feed_arm": _feed_arm(reduction),
            "records": records_figure(reduction),
            "residuals": _residuals(reduction),
            "harmonics": harmonics_figure(reduction),
            "zeros": _zeros(reduction),
            "refractivity": _refractivity(reduction),
            "weather": _weather(reduction),
        }
        if reduction.surface is not None:
            drawn["dish"] = _dish(reduction)
        return {name: figure for name, figure in drawn.items() if figure is not None}


def _view(reduction: Reduction, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 2) and covariances (n, 2, 2) projected along a direction; `axes` (2, 3) span the page."""
    coordinates = reduction.coordinates
    return coordinates.x @ axes.T, axes @ coordinates.joint.blocks @ axes.T


def _draw_network(ax, reduction: Reduction, axes: np.ndarray, rows: Sequence[int], share: float) -> None:
    """Draw points by kind with ellipsoids, scaled so that the median one has `share` of the view."""
    kinds = list(kinds_of(reduction).values())
    where, covariance = _view(reduction, axes)
    values, vectors = np.linalg.eigh(covariance)
    sigma = np.sqrt(np.maximum(values, 0.0))
    sure = np.array([r for r in rows if sigma[r, 1] < LOOSE], dtype=int)
    loose = np.array([r for r in rows if sigma[r, 1] >= LOOSE], dtype=int)
    extent = float(np.max(np.ptp(where[list(rows)], axis=0)))
    for kind, colour in COLOURS.items():
        of_kind = [r for r in sure if kinds[r] == kind]
        if of_kind:
            marker = MARKERS.get(kind, "o")
            size = 22 if kind in MARKERS else 9 if len(of_kind) <= CROWD else 4
            pixels = len(of_kind) > PIXELS
            ax.scatter(
                *where[of_kind].T, s=size, c=colour, marker=marker, lw=0, zorder=3, label=kind, rasterized=pixels
            )
    if len(loose):
        ax.scatter(
            *where[loose].T, s=22, facecolors="white", edgecolors=COLOURS["benchmark"], lw=1.2, zorder=3,
            label=f"u above {LOOSE / MILLIMETRE:g} mm: no ellipsoid",
        )  # fmt: skip
    ax.set_aspect("equal")
    if len(rows) > CROWD:  # crowded: prisms as dots
        sure = np.array([r for r in sure if kinds[r] != "dish prism"], dtype=int)
    if not len(sure):
        return
    usual = float(np.median(sigma[sure, 1]))
    scale = nice(share * extent / usual) if usual > 0.0 else 1.0
    angle = np.degrees(np.arctan2(vectors[sure, 1, 1], vectors[sure, 0, 1]))
    outline = EllipseCollection(
        2 * scale * sigma[sure, 1], 2 * scale * sigma[sure, 0], angle, units="xy", offsets=where[sure],
        offset_transform=ax.transData, facecolors=[COLOURS.get(kinds[r], INK) + "30" for r in sure],
        edgecolors=[COLOURS.get(kinds[r], INK) for r in sure], linewidths=0.7, zorder=2,
    )  # fmt: skip
    ax.add_collection(outline)
    reference = nice(usual)
    ax.set_title(
        f"ellipsoids (1σ) enlarged {scale:,.0f} times: {reference / MILLIMETRE:g} mm is drawn as "
        f"{reference * scale:.3g} m".replace(",", "\u2009"),
        fontsize=8.5,
        fontweight="normal",
        color=FAINT,
    )


def _beams(ax, reduction: Reduction, axes: np.ndarray) -> None:
    ranges, coordinates = reduction.coordinates.ranges, reduction.coordinates
    index = {name: row for row, name in enumerate(coordinates.points)}
    pairs = {(r, t) for r, t, used in zip(ranges.ranger, ranges.target, ranges.used, strict=True) if used}
    flat = coordinates.x @ axes.T
    ground = reduction.campaign.monuments
    for mine in (sorted(p for p in pairs if p[0] in ground), sorted(p for p in pairs if p[0] not in ground)):
        lines, many = [flat[[index[r], index[t]]] for r, t in mine], len(mine) > PIXELS
        alpha = 0.18 * (PIXELS / len(mine) if many else 1.0)
        ax.add_collection(LineCollection(lines, colors=FAINT, linewidths=0.35, alpha=alpha, zorder=1, rasterized=many))
    ax.plot([], [], color=FAINT, lw=0.8, label="used ranges")


def _rows(reduction: Reduction) -> list[int]:
    """Rows to draw: all but the fixed points, which coincide with their scan points."""
    return [row for row, kind in enumerate(kinds_of(reduction).values()) if kind != "fixed point"]


def _plan(reduction: Reduction) -> Figure:
    figure = Figure(figsize=(9.4, 8.6), layout="constrained")
    ax = figure.add_subplot()
    axes = np.eye(3)[:2]
    rows = _rows(reduction)
    _beams(ax, reduction, axes)
    _draw_network(ax, reduction, axes, rows, 0.014)
    flat = reduction.coordinates.x[:, :2]
    centre = flat[rows].mean(axis=0)
    for row, (name, kind) in enumerate(kinds_of(reduction).items()):
        if kind in ("ground ranger", "benchmark"):
            out = flat[row] - centre
            out = out / max(float(np.hypot(*out)), 1e-9) * (1.0 if kind == "ground ranger" else -1.0)
            ax.annotate(
                name, flat[row], xytext=22 * out, textcoords="offset points", ha="center", va="center",
                fontsize=8, color=COLOURS[kind],
            )  # fmt: skip
    ax.margins(0.1)
    ax.set_xlabel("x, east (m)")
    ax.set_ylabel("y, north (m)")
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=5)
    return figure


def _elevation(reduction: Reduction) -> Figure:
    figure = Figure(figsize=(9.4, 5.6), layout="constrained")
    ax = figure.add_subplot()
    azimuth = reduction.campaign.site.campaign.azimuth_deg
    along = np.array([np.sin(azimuth * DEGREE), np.cos(azimuth * DEGREE), 0.0])
    axes = np.stack([along, [0.0, 0.0, 1.0]])
    _beams(ax, reduction, axes)
    _draw_network(ax, reduction, axes, _rows(reduction), 0.014)
    ax.margins(0.05)
    ax.set_xlabel(f"horizontal distance from the pintle towards azimuth {azimuth:g}° (m)")
    ax.set_ylabel("z, up (m)")
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=5)
    return figure


def _feed_arm(reduction: Reduction) -> Figure | None:
    names = reduction.coordinates.points
    rows = [row for row, kind in enumerate(kinds_of(reduction).values()) if kind == "feed-arm ranger"]
    if not rows:
        return None
    figure = Figure(figsize=(9.4, 4.9), layout="constrained")
    plan, bars = figure.subplots(1, 2, width_ratios=(1.15, 1.0))
    _draw_network(plan, reduction, np.eye(3)[:2], rows, 0.06)
    plan.set_xlabel("x, east (m)")
    plan.set_ylabel("y, north (m)")
    plan.margins(0.22)
    for row in rows:
        plan.annotate(
            names[row], reduction.coordinates.x[row, :2], xytext=(0, 17), textcoords="offset points", ha="center",
            va="bottom", fontsize=8, color=COLOURS["feed-arm ranger"],
        )  # fmt: skip
    u = reduction.coordinates.u[rows] / MILLIMETRE
    at = np.arange(len(rows))
    for i, label in enumerate(("x, east", "y, north", "z, up")):
        bars.barh(at + 0.25 * (i - 1), u[:, i], 0.22, color=SERIES[i], label=label)
    bars.set_yticks(at, [names[row] for row in rows])
    bars.invert_yaxis()
    bars.grid(visible=False, axis="y")
    bars.set_xlabel("standard uncertainty (mm)")
    figure.legend(*bars.get_legend_handles_labels(), loc="outside lower right", ncols=3)
    return figure


def _minutes(reduction: Reduction, mjd: np.ndarray) -> np.ndarray:
    return (mjd - reduction.campaign.shots.mjd_utc[0]) * SECONDS_PER_DAY / 60.0


def _residuals(reduction: Reduction) -> Figure:
    ranges, shots = reduction.coordinates.ranges, reduction.campaign.shots
    figure = Figure(figsize=(9.4, 3.9), layout="constrained")
    plot, right = figure.subplots(1, 2, width_ratios=(2.2, 1.0))
    minutes = _minutes(reduction, shots.mjd_utc[ranges.shot])
    residual = ranges.residual / MILLIMETRE
    ground = np.array([name in reduction.campaign.monuments for name in ranges.ranger])
    for mine, kind in ((ground, "ground ranger"), (~ground, "feed-arm ranger")):
        mine = mine & ranges.used
        many = bool(mine.sum() > PIXELS)
        plot.scatter(
            minutes[mine], residual[mine], s=2 if many else 8, c=COLOURS[kind], lw=0, alpha=0.4 if many else 0.75,
            label=f"{kind}s", rasterized=many,
        )  # fmt: skip
    span = 1.35 * float(np.max(np.abs(residual[ranges.used]), initial=1e-3))
    out = ~ranges.used
    for up, marker in ((True, "^"), (False, "v")):
        mine = out & ((residual > 0) == up)
        label = f"rejected (to {np.max(np.abs(residual[out]), initial=0.0):.1f} mm, beyond the edge)" if up else None
        edge = np.clip(residual[mine], -0.94 * span, 0.94 * span)
        plot.scatter(minutes[mine], edge, s=26, c=BAD, marker=marker, lw=0, label=label if np.any(out) else None)
    plot.set_ylim(-span, span)
    plot.set_title("Residuals of the ranges")
    plot.set_xlabel("minutes after the first shot")
    plot.set_ylabel("observed minus adjusted (mm)")
    figure.legend(*plot.get_legend_handles_labels(), loc="outside lower left", ncols=3)

    w = ranges.standardised[ranges.used]
    edges = np.arange(-4.0, 4.01, 0.4)
    right.hist(np.clip(w, -3.99, 3.99), edges, color=COLOURS["dish prism"], alpha=0.8, label="used shots")
    t = np.linspace(-4, 4, 161)
    right.plot(t, len(w) * 0.4 * np.exp(-0.5 * t**2) / np.sqrt(2 * np.pi), color=INK, lw=1.2, label="as claimed")
    right.set_title("Standardised residuals")
    right.set_xlabel("w, in units of its uncertainty")
    right.set_ylabel("shots")
    right.legend(loc="upper left", handlelength=1.2)
    right.set_ylim(top=right.get_ylim()[1] * 1.25)
    return figure


def _dish(reduction: Reduction) -> Figure:
    surface = reduction.surface
    assert surface is not None
    paraboloid = reduction.campaign.site.paraboloid
    figure = Figure(figsize=(9.4, 6.6), layout="constrained")
    ax = figure.add_subplot()
    deviation = surface.fit.deviation / MILLIMETRE
    limit = float(np.max(np.abs(deviation)))
    crowd = len(deviation) > CROWD
    dots = ax.scatter(
        surface.fit.local[:, 0], surface.fit.local[:, 1], s=700 * 60 / len(deviation) if crowd else 260, c=deviation,
        cmap="RdBu_r", vmin=-limit, vmax=limit, edgecolors=FAINT, linewidths=0.0 if crowd else 0.6, zorder=3,
    )  # fmt: skip
    named = () if crowd else zip(surface.names, surface.fit.local, deviation, strict=True)
    for name, (x, y, _), value in named:
        ax.annotate(
            f"{name}\n{value:+.2f}", (x, y), xytext=(0, -11), textcoords="offset points", ha="center", va="top",
            fontsize=6.5, color=INK, zorder=4, linespacing=1.05,
        )  # fmt: skip
    angle = np.linspace(0, 2 * np.pi, 181)
    centre, radius = np.array(paraboloid.aperture_centre_mm) * MILLIMETRE, paraboloid.aperture_radius_mm * MILLIMETRE
    ax.plot(centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle), color=FAINT, lw=0.9, ls="--")
    ax.set_aspect("equal")
    ax.set_xlabel("x in the dish's frame (m)")
    ax.set_ylabel("y in the dish's frame, from the vertex (m)")
    figure.colorbar(dots, ax=ax, label="normal deviation, positive towards the focus (mm)", shrink=0.8)
    return figure


def _zeros(reduction: Reduction) -> Figure:
    zeros = reduction.coordinates.zeros
    names = sorted(zeros)
    figure = Figure(figsize=(9.4, 3.3), layout="constrained")
    ax = figure.add_subplot()
    value, u = (np.array([zeros[name][part] for name in names]) * 1e6 for part in (0, 1))
    prior = np.array([reduction.campaign.mirror_of(name).u_d0_mm for name in names]) * 1e3
    at = np.arange(len(names))
    kinds = kinds_of(reduction)
    colour = [COLOURS[kinds[name]] for name in names]
    ax.bar(at, 2 * prior, 0.62, bottom=-prior, color=GRID, label="laboratory's uncertainty (1σ)")
    ax.axhline(0.0, color=FAINT, lw=0.8)
    ax.errorbar(at, value, u, fmt="none", ecolor=FAINT, elinewidth=1.0, capsize=3, label="estimate and its 1σ")
    ax.scatter(at, value, s=30, c=colour, zorder=3, lw=0)
    ax.set_xticks(at, names, rotation=45 if len(names) > 9 else 0, ha="right" if len(names) > 9 else "center")
    ax.grid(visible=False, axis="x")
    ax.set_ylabel("correction to the range (µm)")
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower left", ncols=2)
    return figure


def _refractivity(reduction: Reduction) -> Figure | None:
    ranges, shots = reduction.coordinates.ranges, reduction.campaign.shots
    if not np.any(ranges.used):
        return None
    figure = Figure(figsize=(9.4, 3.4), layout="constrained")
    ax = figure.add_subplot()
    used = ranges.used
    index = {name: row for row, name in enumerate(reduction.coordinates.points)}
    z = reduction.coordinates.x[:, 2]
    ends = zip(ranges.ranger, ranges.target, used, strict=True)
    height = np.array([0.5 * (z[index[r]] + z[index[t]]) if on else np.nan for r, t, on in ends])
    minutes = _minutes(reduction, shots.mjd_utc[ranges.shot])
    dots = ax.scatter(
        minutes[used], ranges.refractivity[used] / PPM, s=9, c=height[used], cmap="viridis", lw=0, alpha=0.9,
        rasterized=bool(used.sum() > PIXELS),
    )  # fmt: skip
    ax.axhline(reduction.coordinates.refractivity_ppm, color=INK, lw=0.9, ls="--")
    ax.annotate(
        f"mean {reduction.coordinates.refractivity_ppm:.2f} ppm", (1.0, reduction.coordinates.refractivity_ppm),
        xycoords=("axes fraction", "data"), xytext=(0, 3), textcoords="offset points", ha="right", fontsize=8.5,
    )  # fmt: skip
    ax.set_xlabel("minutes after the first shot")
    ax.set_ylabel("group refractivity (ppm)")
    figure.colorbar(dots, ax=ax, label="mean height of the path (m)")
    return figure


def _weather(reduction: Reduction) -> Figure:
    weather, site = reduction.campaign.weather, reduction.campaign.site
    figure = Figure(figsize=(9.4, 5.4), layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    minutes, station = _minutes(reduction, weather.mjd_utc), np.array(weather.station)
    columns = (
        (weather.temperature_c, "temperature (°C)"),
        (weather.pressure_hpa, "pressure (hPa)"),
        (weather.humidity_percent, "humidity (%)"),
    )
    for ax, (values, label) in zip(panels, columns, strict=True):
        for i, device in enumerate(site.weather_station):
            readings = station == device.name
            ax.plot(
                minutes[readings], values[readings], "-" if readings.sum() > PIXELS / 4 else ".-", ms=2.5, lw=0.7,
                color=SERIES[i % len(SERIES)], label=f"{device.name}, {device.elevation_m:.0f} m above sea level",
            )  # fmt: skip
        ax.set_ylabel(label)
        ax.ticklabel_format(useOffset=False)
    panels[-1].set_xlabel("minutes after the first shot")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower left", ncols=3)
    return figure
