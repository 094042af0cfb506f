"""Scene and charts of a reduction's report."""

import numpy as np

from catseye.constants import DEGREE, MILLIMETRE, PPM, SECONDS_PER_DAY, TWO_PI
from catseye.gateways.epoch.tables import kinds_of
from catseye.gateways.writers.report_parts import Axis, Beams, Chart, Coloured, Scene, categories
from catseye.reduction.epoch.epoch import Reduction
from catseye.reduction.epoch.range_shots import RangeShots
from catseye.reduction.epoch.surface import DishFit

BEYOND = 1.35  # times the largest residual of a used shot: limit of the rejected shots in a chart
RIM = 73  # points of the aperture's outline
GROUPS = ("ground rangers", "feed-arm rangers", "rejected")  # of residuals
AFTER = "time after the first shot"


def network_scene(reduction: Reduction) -> Scene:
    """All points but fixed points, which coincide with their scan points; used ranges; the dish's rim."""
    coordinates, kinds = reduction.coordinates, list(kinds_of(reduction).values())
    rows = [row for row, kind in enumerate(kinds) if kind != "fixed point"]
    groups = sorted({kinds[row] for row in rows})
    index = {coordinates.points[row]: place for place, row in enumerate(rows)}
    ranges, shots = coordinates.ranges, reduction.campaign.shots
    used = [k for k in np.flatnonzero(ranges.used).tolist() if {ranges.ranger[k], ranges.target[k]} <= index.keys()]
    u = coordinates.u / MILLIMETRE
    return Scene(
        frame="ground: x east, y north, z up",
        names=[coordinates.points[row] for row in rows],
        x=coordinates.x[rows],
        groups=groups,
        group=[groups.index(kinds[row]) for row in rows],
        covariance=coordinates.joint.blocks[rows],
        info=[
            f"{kinds[row]}, {coordinates.shots[row]:.0f} shots, u {' / '.join(f'{v:.3f}' for v in u[row])} mm"
            for row in rows
        ],
        beams=Beams(
            start=[index[ranges.ranger[k]] for k in used],
            end=[index[ranges.target[k]] for k in used],
            value=ranges.standardised[used],
            names=shots.shot[ranges.shot[used]].tolist(),
        ),
        lines={} if reduction.surface is None else _rim(reduction, reduction.surface),
    )


def _rim(reduction: Reduction, surface: DishFit) -> dict[str, np.ndarray]:
    """Rim of the aperture and axis from vertex to focus, in the ground frame."""
    circle = _aperture(reduction)
    height = np.sum(circle**2, axis=1) / (4.0 * surface.focal_length)
    axis = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, surface.focal_length]])
    place = surface.fit.frame.points
    return {"rim of the dish": place(np.column_stack([circle, height])), "axis, vertex to focus": place(axis)}


def _aperture(reduction: Reduction) -> np.ndarray:
    """Outline of the aperture in the dish's frame, (RIM, 2) m."""
    paraboloid = reduction.campaign.site.paraboloid
    angle = np.linspace(0.0, TWO_PI, RIM)
    centre = np.array(paraboloid.aperture_centre_mm)[:2] * MILLIMETRE
    return centre + paraboloid.aperture_radius_mm * MILLIMETRE * np.column_stack([np.cos(angle), np.sin(angle)])


def dish_chart(reduction: Reduction, surface: DishFit) -> Chart:
    """Map of the prisms' deviations over the aperture."""
    local = surface.fit.local
    return Chart(
        "map",
        Axis("x in the dish's frame", "m", local[:, 0], digits=4),
        Axis("y in the dish's frame, from the vertex", "m", local[:, 1], digits=4),
        value=Coloured("deviation, positive towards the focus", "mm", surface.fit.deviation / MILLIMETRE, 5),
        names=surface.names,
        outline=[_aperture(reduction)],
    )


def residual_charts(reduction: Reduction) -> dict[str, tuple[Chart, str]]:
    """Residuals by time, ranger, target and elevation; histogram and normal plot of w; each with its caption."""
    ranges, shots, limit = reduction.coordinates.ranges, reduction.campaign.shots, reduction.settings.critical
    if not ranges.used.any():
        return {}
    used = np.flatnonzero(ranges.used)
    number, w = shots.shot[ranges.shot], ranges.standardised
    ranger, target = _used_ends(ranges)
    standardised = Axis("w", "", w[used], digits=3)
    names, limits = number[used].tolist(), (-limit, limit)

    def by(x: Axis) -> Chart:
        return Chart("scatter", x, standardised, names=names, limits=limits)

    elevation = Axis("elevation of the path", "°", _elevation(reduction) / DEGREE, digits=2)
    return {
        "residuals-by-time": _in_time(reduction),
        "w-by-ranger": (by(categories("ranger", ranger)), "Standardised residuals of the used ranges by ranger."),
        "w-by-target": (by(categories("target", target)), "The same by target."),
        "w-by-elevation": (by(elevation), "The same by the path's elevation at the ranger."),
        "w-histogram": (
            Chart("histogram", standardised, limits=limits),
            "Histogram of w: a normal distribution of width 1 where the claimed uncertainties hold.",
        ),
        "w-normal": (
            Chart("normal", standardised, names=names),
            "w against the quantiles of that normal distribution.",
        ),
    }


def _in_time(reduction: Reduction) -> tuple[Chart, str]:
    """Residuals over time, by kind of ranger."""
    ranges, shots = reduction.coordinates.ranges, reduction.campaign.shots
    residual = ranges.residual / MILLIMETRE
    largest = BEYOND * float(np.max(np.abs(residual[ranges.used])))
    near = ranges.used | (np.abs(residual) <= largest)
    rows = np.flatnonzero(near)
    ground = np.array([ranges.ranger[k] in reduction.campaign.monuments for k in rows])
    group = np.where(~ranges.used[rows], 2, np.where(ground, 0, 1))
    beyond = int(np.sum(~near))
    more = f" {beyond} rejected ones beyond ±{largest:.2g} mm are not drawn." if beyond else ""
    chart = Chart(
        "scatter",
        Axis(AFTER, "min", _minutes(reduction, shots.mjd_utc[ranges.shot[rows]]), digits=2),
        Axis("observed minus adjusted", "mm", residual[rows], digits=4),
        names=shots.shot[ranges.shot[rows]].tolist(),
        group=group,
        groups=GROUPS[: int(group.max()) + 1],
    )
    return chart, f"Residuals of the ranges in the order of time.{more}"


def _elevation(reduction: Reduction) -> np.ndarray:
    """Elevation of each used range's path at its ranger, rad."""
    coordinates = reduction.coordinates
    ranger, target = (coordinates.x[coordinates.rows(names)] for names in _used_ends(coordinates.ranges))
    path = target - ranger
    return np.arctan2(path[:, 2], np.hypot(path[:, 0], path[:, 1]))


def _used_ends(ranges: RangeShots) -> tuple[list[str], list[str]]:
    """Rangers and targets of the used ranges."""
    used = np.flatnonzero(ranges.used)
    return [ranges.ranger[k] for k in used], [ranges.target[k] for k in used]


def _minutes(reduction: Reduction, mjd: np.ndarray) -> np.ndarray:
    return (mjd - reduction.campaign.shots.mjd_utc[0]) * SECONDS_PER_DAY / 60.0


def zeros_chart(reduction: Reduction) -> Chart:
    """Corrections to the rangers' zeros."""
    zeros = reduction.coordinates.zeros
    names = sorted(zeros)
    value, u = (np.array([zeros[name][part] for name in names]) * 1e6 for part in (0, 1))
    return Chart(
        "scatter", categories("ranger", names), Axis("correction to the range", "µm", value, digits=2), u=u, names=names
    )


def refractivity_chart(reduction: Reduction) -> Chart | None:
    """Refractivity of the used paths over time; None without any."""
    coordinates, ranges = reduction.coordinates, reduction.coordinates.ranges
    used = np.flatnonzero(ranges.used)
    if not len(used):
        return None
    height = np.mean([coordinates.x[coordinates.rows(names), 2] for names in _used_ends(ranges)], axis=0)
    height = height - float(np.median(height))
    shots = reduction.campaign.shots
    return Chart(
        "scatter",
        Axis(AFTER, "min", _minutes(reduction, shots.mjd_utc[ranges.shot[used]]), digits=2),
        Axis("group refractivity", "ppm", ranges.refractivity[used] / PPM, digits=3),
        value=Coloured("mean height of the path, from their median", "m", height, 1),
        names=shots.shot[ranges.shot[used]].tolist(),
        limits=(coordinates.refractivity_ppm,),
    )


def weather_charts(reduction: Reduction) -> dict[str, Chart]:
    """Temperature, pressure and humidity of the stations over time."""
    weather, site = reduction.campaign.weather, reduction.campaign.site
    order = {device.name: k for k, device in enumerate(site.weather_station)}
    rows = np.lexsort((weather.mjd_utc, np.array([order[name] for name in weather.station])))
    minutes = Axis(AFTER, "min", _minutes(reduction, weather.mjd_utc[rows]), digits=2)
    columns = (
        ("temperature", "°C", weather.temperature_c),
        ("pressure", "hPa", weather.pressure_hpa),
        ("humidity", "%", weather.humidity_percent),
    )
    return {
        name: Chart(
            "line",
            minutes,
            Axis(name, unit, values[rows], digits=3),
            group=[order[weather.station[k]] for k in rows],
            groups=[f"{device.name}, {device.elevation_m:.0f} m above sea level" for device in site.weather_station],
        )
        for name, unit, values in columns
    }
