"""Results as CSV: header, units in the names, one row per shot, point or prism."""

import math
from collections.abc import Sequence

import numpy as np

from catseye.constants import DEGREE, MILLIMETRE, PPM, SPEED_OF_LIGHT, TWO_PI
from catseye.gateways.writers.written import csv_text
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

Values = np.ndarray | Sequence[object]
PLACES = {"_m": 7, "_mm": 4, "_rad": 7, "_v": 5, "_deg": 4, "_ppm": 5, "_mm2": 8, "_utc": 9}
PLAIN_DECIMALS = 4  # decimals of numbers without a unit


def ranges_csv(reduction: Reduction) -> str:
    """Table of every shot in the campaign's order, with every correction to its range.

    vacuum_length + air + d0 + zero + glass + obliquity + leakage + head = range: the length that the phase
    represents in vacuum, converted to air, then the constants. Cells are empty for shots without a phase or on the
    internal cube.
    """
    campaign, phases, ranges = reduction.campaign, reduction.phases, reduction.coordinates.ranges
    half = 0.5 * SPEED_OF_LIGHT / campaign.site.ranging.modulation_hz
    vacuum = unwrapped_length(ranges.cycles, ranges.phase, half)
    air = vacuum * (1.0 / (1.0 + ranges.refractivity) - 1.0)
    shots, count = campaign.shots, len(campaign.shots.shot)
    d0 = {name: campaign.mirror_of(name).d0_mm for name in dict.fromkeys(shots.ranger)}
    fields: dict[str, Values] = {
        "shot": shots.shot,
        "mjd_utc": shots.mjd_utc,
        "ranger": shots.ranger,
        "target": shots.target,
        "status": reduction.status,
        "reason": [reduction.rejected.get(int(number), "") for number in shots.shot],
        "amplitude_v": phases.amplitude,
        "phase_rad": phases.phase,
        "u_phase_rad": phases.u_phase,
        "d0_mm": [d0[name] for name in shots.ranger],
    }
    adjusted: dict[str, Values] = {
        "electronics_rad": ranges.electronics % TWO_PI,
        "difference_rad": ranges.phase,
        "cycles": ranges.cycles.astype(int),
        "margin_mm": ranges.margin / MILLIMETRE,
        "thin": ["thin" if uncertain else "" for uncertain in ranges.thin],
        "vacuum_length_m": vacuum,
        "refractivity_ppm": ranges.refractivity / PPM,
        "air_mm": air / MILLIMETRE,
        "zero_mm": ranges.zero / MILLIMETRE,
        "glass_mm": ranges.glass / MILLIMETRE,
        "incidence_deg": ranges.incidence / DEGREE,
        "obliquity_mm": ranges.obliquity / MILLIMETRE,
        "leakage_mm": ranges.leakage / MILLIMETRE,
        "head_mm": ranges.head / MILLIMETRE,
        "moved_mm": ranges.moved / MILLIMETRE,
        "range_m": ranges.range_,
        "u_range_mm": ranges.u_range / MILLIMETRE,
        "residual_mm": ranges.residual / MILLIMETRE,
        "standardised": ranges.standardised,
        "redundancy": ranges.redundancy,
        "detectable_mm": ranges.detectable / MILLIMETRE,
    }
    columns = {name: _cells(name, values) for name, values in fields.items()}
    for name, values in adjusted.items():
        columns[name] = [""] * count
        for k, text in zip(ranges.shot.tolist(), _cells(name, values), strict=True):
            columns[name][k] = text
    return csv_text(RANGES, zip(*(columns[name] for name in RANGES), strict=True))


def coordinates_csv(reduction: Reduction) -> str:
    """Table of every point in the ground frame, with standard uncertainties and covariances."""
    coordinates = reduction.coordinates
    covariance = coordinates.joint.blocks / MILLIMETRE**2
    u = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    columns: dict[str, Values] = {
        "point": coordinates.points,
        "kind": list(kinds_of(reduction).values()),
        **dict(zip(("x_m", "y_m", "z_m"), coordinates.x.T, strict=True)),
        **dict(zip(("u_x_mm", "u_y_mm", "u_z_mm"), u.T, strict=True)),
        "cov_xy_mm2": covariance[:, 0, 1],
        "cov_xz_mm2": covariance[:, 0, 2],
        "cov_yz_mm2": covariance[:, 1, 2],
        "shots": coordinates.shots.astype(int),
        "from_approximate_mm": np.linalg.norm(coordinates.x - coordinates.start, axis=1) / MILLIMETRE,
    }
    return _csv(COORDINATES, columns)


def surface_csv(reduction: Reduction) -> str:
    """Dish prisms in the fitted paraboloid's frame.

    A deviation is along the normal, positive towards the focus.
    """
    surface, coordinates = reduction.surface, reduction.coordinates
    if surface is None:
        return _csv(SURFACE, {name: [] for name in SURFACE})
    columns: dict[str, Values] = {
        "point": surface.names,
        **dict(zip(("x_dish_m", "y_dish_m", "z_dish_m"), surface.fit.local.T, strict=True)),
        "deviation_mm": surface.fit.deviation / MILLIMETRE,
        "u_deviation_mm": surface.u_deviation / MILLIMETRE,
        "shots": coordinates.shots[coordinates.rows(surface.names)].astype(int),
    }
    return _csv(SURFACE, columns)


def kinds_of(reduction: Reduction) -> dict[str, str]:
    """Kind of each point, in a word or two, in the points' order."""
    campaign, places = reduction.campaign, reduction.coordinates.places
    at_triplets = {target for triplet in campaign.triplets.values() for target in triplet.targets}
    at_benchmarks = {benchmark.target for benchmark in campaign.benchmarks}

    def kind(name: str) -> str:
        if name not in places:
            return "fixed point"
        if name in campaign.monuments:
            return "ground ranger"
        retroreflector = places[name].kind
        if retroreflector is None:
            return "feed-arm ranger"
        if name in at_triplets:
            return f"triplet {retroreflector.name}"
        if name in at_benchmarks:
            return "benchmark"
        return "dish prism" if retroreflector.shapes_dish else "structure"

    return {name: kind(name) for name in reduction.coordinates.points}


def _csv(header: list[str], columns: dict[str, Values]) -> str:
    cells = [_cells(name, columns[name]) for name in header]
    return csv_text(header, zip(*cells, strict=True))


def _cells(name: str, values: Values) -> list[str]:
    """Numbers of a column with suitable digits; empty if not finite."""
    places = PLACES.get(f"_{name.rpartition('_')[2]}", PLAIN_DECIMALS) if "_" in name else PLAIN_DECIMALS
    plain = values.tolist() if isinstance(values, np.ndarray) else values
    return [
        (f"{value:.{places}f}" if math.isfinite(value) else "") if isinstance(value, float) else str(value)
        for value in plain
    ]
