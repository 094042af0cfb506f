"""Results as tables: CSV with a header, units in the names, one row a shot, a point or a prism."""

import csv
import io
from collections.abc import Iterable

import numpy as np

from catseye.constants import DEGREE, MILLIMETRE, PPM, SPEED_OF_LIGHT, TWO_PI
from catseye.reduction.epoch.epoch import Reduction
from catseye.signal.cycles.whole import unwrapped_length

RANGES = [
    "shot",
    "mjd_utc",
    "ranger",
    "target",
    "status",
    "reason",
    "amplitude_v",
    "phase_rad",
    "u_phase_rad",
    "electronics_rad",
    "difference_rad",
    "cycles",
    "margin_mm",
    "thin",
    "vacuum_length_m",
    "refractivity_ppm",
    "air_mm",
    "d0_mm",
    "zero_mm",
    "glass_mm",
    "incidence_deg",
    "obliquity_mm",
    "leakage_mm",
    "head_mm",
    "moved_mm",
    "range_m",
    "u_range_mm",
    "residual_mm",
    "standardised",
    "redundancy",
    "detectable_mm",
]
COORDINATES = [
    "point",
    "kind",
    "x_m",
    "y_m",
    "z_m",
    "u_x_mm",
    "u_y_mm",
    "u_z_mm",
    "cov_xy_mm2",
    "cov_xz_mm2",
    "cov_yz_mm2",
    "shots",
    "from_approximate_mm",
]
SURFACE = ["point", "x_dish_m", "y_dish_m", "z_dish_m", "deviation_mm", "u_deviation_mm", "shots"]

PLACES = {"_m": 7, "_mm": 4, "_rad": 7, "_v": 5, "_deg": 4, "_ppm": 5, "_mm2": 8, "_utc": 9}
OTHERS = 4  # decimals of numbers without a unit


def ranges_csv(reduction: Reduction) -> str:
    """Every shot in the campaign's order, with every correction to its range.

    vacuum_length + air + d0 + zero + glass + obliquity + leakage + head = range: the length that the phase stands
    for in vacuum, carried into air, then the constants. Cells stay empty where a shot got no phase or saw the internal
    cube.
    """
    campaign, phases, ranges = reduction.campaign, reduction.phases, reduction.coordinates.ranges
    half = 0.5 * SPEED_OF_LIGHT / campaign.site.ranging.modulation_hz
    vacuum = unwrapped_length(ranges.cycles, ranges.phase, half)
    air = vacuum * (1.0 / (1.0 + ranges.refractivity) - 1.0)
    row_of = {int(shot): row for row, shot in enumerate(ranges.shot)}
    shots = campaign.shots
    rows = []
    for k, number in enumerate(shots.shot):
        cells: dict[str, object] = {
            "shot": int(number),
            "mjd_utc": shots.mjd_utc[k],
            "ranger": shots.ranger[k],
            "target": shots.target[k],
            "status": reduction.status[k],
            "reason": reduction.rejected.get(int(number), ""),
            "amplitude_v": phases.amplitude[k],
            "phase_rad": phases.phase[k],
            "u_phase_rad": phases.u_phase[k],
            "d0_mm": campaign.mirror_of(shots.ranger[k]).d0_mm,
        }
        if k in row_of:
            row = row_of[k]
            cells |= {
                "electronics_rad": ranges.electronics[row] % TWO_PI,
                "difference_rad": ranges.phase[row],
                "cycles": int(ranges.cycles[row]),
                "margin_mm": ranges.margin[row] / MILLIMETRE,
                "thin": "thin" if ranges.thin[row] else "",
                "vacuum_length_m": vacuum[row],
                "refractivity_ppm": ranges.refractivity[row] / PPM,
                "air_mm": air[row] / MILLIMETRE,
                "zero_mm": ranges.zero[row] / MILLIMETRE,
                "glass_mm": ranges.glass[row] / MILLIMETRE,
                "incidence_deg": ranges.incidence[row] / DEGREE,
                "obliquity_mm": ranges.obliquity[row] / MILLIMETRE,
                "leakage_mm": ranges.leakage[row] / MILLIMETRE,
                "head_mm": ranges.head[row] / MILLIMETRE,
                "moved_mm": ranges.moved[row] / MILLIMETRE,
                "range_m": ranges.range_[row],
                "u_range_mm": ranges.u_range[row] / MILLIMETRE,
                "residual_mm": ranges.residual[row] / MILLIMETRE,
                "standardised": ranges.standardised[row],
                "redundancy": ranges.redundancy[row],
                "detectable_mm": ranges.detectable[row] / MILLIMETRE,
            }
        rows.append(cells)
    return _csv(RANGES, rows)


def coordinates_csv(reduction: Reduction) -> str:
    """Every point in the ground frame, with its standard uncertainties and covariances."""
    coordinates = reduction.coordinates
    rows = []
    for row, name in enumerate(coordinates.points):
        covariance = coordinates.joint.blocks[row] / MILLIMETRE**2
        u = np.sqrt(np.diag(covariance))
        moved = np.linalg.norm(coordinates.x[row] - coordinates.start[row])
        rows.append(
            {
                "point": name,
                "kind": kind_of(reduction, name),
                **dict(zip(("x_m", "y_m", "z_m"), coordinates.x[row], strict=True)),
                **dict(zip(("u_x_mm", "u_y_mm", "u_z_mm"), u, strict=True)),
                "cov_xy_mm2": covariance[0, 1],
                "cov_xz_mm2": covariance[0, 2],
                "cov_yz_mm2": covariance[1, 2],
                "shots": int(coordinates.shots[row]),
                "from_approximate_mm": moved / MILLIMETRE,
            }
        )
    return _csv(COORDINATES, rows)


def surface_csv(reduction: Reduction) -> str:
    """The dish prisms in the fitted paraboloid's frame; a deviation is along the normal, positive towards the focus."""
    surface, coordinates = reduction.surface, reduction.coordinates
    if surface is None:
        return _csv(SURFACE, [])
    rows = [
        {
            "point": name,
            **dict(zip(("x_dish_m", "y_dish_m", "z_dish_m"), surface.fit.local[i], strict=True)),
            "deviation_mm": surface.fit.deviation[i] / MILLIMETRE,
            "u_deviation_mm": surface.u_deviation[i] / MILLIMETRE,
            "shots": int(coordinates.shots[coordinates.index(name)]),
        }
        for i, name in enumerate(surface.names)
    ]
    return _csv(SURFACE, rows)


def kind_of(reduction: Reduction, name: str) -> str:
    """What a point is, in a word or two."""
    campaign, places = reduction.campaign, reduction.coordinates.places
    if name not in places:
        return "fixed point"
    if name in campaign.monuments:
        return "ground ranger"
    if places[name].kind == "ranger":
        return "feed-arm ranger"
    if name in {target for triplet in campaign.triplets.values() for target in triplet.targets}:
        return f"triplet {places[name].kind}"
    if name in {benchmark.target for benchmark in campaign.benchmarks}:
        return "benchmark"
    return "dish prism" if places[name].kind == "prism" else "structure"


def _csv(columns: list[str], rows: Iterable[dict[str, object]]) -> str:
    stream = io.StringIO(newline="")
    writer = csv.DictWriter(stream, columns, restval="", lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow({name: _cell(name, value) for name, value in row.items()})
    return stream.getvalue()


def _cell(name: str, value: object) -> object:
    """A number with the digits that its unit deserves; empty where it is none."""
    if not isinstance(value, float):
        return value
    if not np.isfinite(value):
        return ""
    places = PLACES.get(f"_{name.rpartition('_')[2]}", OTHERS) if "_" in name else OTHERS
    return f"{value:.{places}f}"
