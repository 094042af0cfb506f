"""Reduced night as JSON: SI units unless a key says otherwise, null for missing numbers."""

from collections.abc import Sequence
from dataclasses import asdict
from datetime import datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from catseye.constants import PPM
from catseye.gateways.epoch.record_tests import record_objects
from catseye.gateways.epoch.third_order import third_order_object
from catseye.gateways.writers.objects import versions
from catseye.gateways.writers.output import FORMAT
from catseye.records.files.covariance_file import KEY

if TYPE_CHECKING:
    from catseye.records.night.campaign import Campaign
    from catseye.reduction.air.group_index import BenchmarkSeries
    from catseye.reduction.epoch.epoch import Reduction
    from catseye.reduction.site.plausible.record import ImplausibleRecord

MOST_INSIDE = 500  # most points whose full covariance is written as text: some 40 MB
COVARIANCE = "covariance.fits"
CERTIFICATE = ("serial", "measured_on", "valid_until", "by", "report")


def reduction_object(reduction: "Reduction") -> dict[str, Any]:
    """Object that `catseye reduce --json` prints."""
    coordinates, surface = reduction.coordinates, reduction.surface
    points = {}
    for row, name in enumerate(coordinates.points):
        x, y, z = coordinates.x[row]
        covariance = coordinates.joint.blocks[row]
        points[name] = {
            "x": x,
            "y": y,
            "z": z,
            "covariance": covariance,
            "shots": coordinates.shots[row],
            "lines": coordinates.lines[row],
        }
    total, used, rejected = len(reduction.status), reduction.status.count("used"), len(reduction.rejected)
    return {
        "verdict": reduction.verdict.to_object(),
        "campaign": reduction.campaign.site.campaign.name,
        "frame": "ground",
        "status": coordinates.status,
        "notes": reduction.notes,
        "shots": {"total": total, "used": used, "reference": total - used - rejected, "rejected": rejected},
        "points": points,
        "variance_factor": coordinates.variance_factor,
        "degrees_of_freedom": coordinates.degrees_of_freedom,
        "rejected": reduction.rejected,
        "refractivity_ppm": coordinates.refractivity_ppm,
        "pose": surface.pose() if surface is not None else None,
        "surface": surface_object(reduction),
        "ranger_zeros": {name: {"zero": zero, "u_zero": u} for name, (zero, u) in coordinates.zeros.items()},
        "head_effects": {name: {"value": value, "u": u} for name, (value, u) in coordinates.heads.items()},
        "air": estimated_air(reduction),
        **record_objects(coordinates),
        "distorted": reduction.campaign.shots.shot[reduction.phases.distorted],
        "implausible": [_implausible_object(record) for record in reduction.implausible],
        **({} if reduction.third_order is None else {"structure": third_order_object(reduction.third_order)}),
    }


def _implausible_object(record: "ImplausibleRecord") -> dict[str, Any]:
    return {
        "text": record.text,
        "where": record.where,
        "quantity": record.quantity,
        "owners": list(record.owners),
    }


def estimated_air(reduction: "Reduction") -> dict[str, Any]:
    """Estimates of the air from ranges, benchmarks and sound; units in the keys."""
    from catseye.reduction.air.group_index import benchmark_refractometers

    *stations, profile = reduction.coordinates.air.items()
    (name, (value, u)) = profile
    key = "gradient_c_per_m" if name == "gradient" else "bend_c"
    return {
        "model": reduction.settings.air_model,
        "thermometers": {station: {"offset_c": offset, "u_offset_c": us} for station, (offset, us) in stations},
        key: value,
        f"u_{key}": u,
        "lines_by_sound": {
            line: {"too_warm_c": warm, "u_too_warm_c": us} for line, (warm, us) in reduction.coordinates.sound.items()
        },
        "benchmarks": [benchmark_object(series) for series in benchmark_refractometers(reduction)],
    }


def benchmark_object(series: "BenchmarkSeries") -> dict[str, Any]:
    """Air of a benchmark path and of the weather stations, means over its used shots."""
    used = series.used
    return {
        "benchmark": series.benchmark,
        "ranger": series.ranger,
        "shots": int(used.sum()),
        "path_ppm": mean_ppm(series.path[used]),
        "u_path_ppm": mean_ppm(series.u_path[used]),
        "weather_ppm": mean_ppm(series.weather[used]),
        "u_weather_ppm": mean_ppm(series.u_weather[used]),
        "adjusted_ppm": mean_ppm(series.adjusted[used]),
        "thermometers_too_warm_c": series.too_warm_c,
        "u_thermometers_too_warm_c": series.u_too_warm_c,
    }


def mean_ppm(refractivity: np.ndarray) -> float:
    """Mean of refractivities in ppm; nan if empty."""
    return float(refractivity.mean()) / PPM if len(refractivity) else float("nan")


def surface_object(reduction: "Reduction") -> dict[str, Any] | None:
    surface = reduction.surface
    if surface is None:
        return None
    return {
        "prisms": len(surface.names),
        "rms": surface.rms,
        "focal_length": surface.focal_length,
        "deviations": {
            name: {"deviation": deviation, "u_deviation": u}
            for name, deviation, u in zip(surface.names, surface.fit.deviation, surface.u_deviation, strict=True)
        },
    }


def matrix_file(points: Sequence[str]) -> str:
    """Name of the file with these points' full covariance."""
    return COVARIANCE if len(points) > MOST_INSIDE else "coordinates.json"


def coordinates_object(reduction: "Reduction") -> dict[str, Any]:
    """Object of `--json` with the full covariance, m², rows and columns in the stated order.

    Beyond MOST_INSIDE points the matrix is in a separate file, which is named; the points' own blocks stay.
    """
    coordinates = reduction.coordinates
    inside = matrix_file(coordinates.points) != COVARIANCE
    return {
        "format": FORMAT,
        **reduction_object(reduction),
        "covariance_order": [f"{name} {axis}" for name in coordinates.points for axis in "xyz"],
        "covariance": coordinates.covariance if inside else None,
        **({} if inside else {KEY: COVARIANCE}),
    }


def pose_object(reduction: "Reduction") -> dict[str, Any]:
    """Pose of the antenna and its fitted paraboloid; nulls and a reason if the dish was not seen."""
    surface, posture = reduction.surface, reduction.campaign.site.campaign
    nominal = {"azimuth_deg": posture.azimuth_deg, "elevation_deg": posture.elevation_deg}
    common = {"format": FORMAT, "campaign": posture.name, "nominal_posture": nominal}
    if surface is None:
        return {**common, "pose": None, "reason": reduction.no_surface, "paraboloid": None}
    return {
        **common,
        **surface.pose(),
        "paraboloid": {
            "fit": "least squares of the normal deviations, unweighted, focal length held",
            "focal_length": surface.focal_length,
            "prisms": len(surface.names),
            "rms": surface.rms,
            "ground_from_paraboloid_rotation": surface.fit.frame.rotation,
            "ground_from_paraboloid_translation": surface.fit.frame.translation,
        },
    }


def provenance_object(reduction: "Reduction", when: datetime) -> dict[str, Any]:
    """Inputs, programs, settings and time; `writers.written.write_files` adds the outputs."""
    campaign = reduction.campaign
    return {
        "format": FORMAT,
        "made_by": "catseye reduce",
        "when_utc": when.isoformat(timespec="seconds"),
        "campaign": {
            "name": campaign.site.campaign.name,
            "directory": campaign.directory.resolve().name,
            "start_mjd_utc": campaign.site.campaign.start_mjd_utc,
            "shots": len(campaign.shots),
        },
        "versions": versions(),
        "settings": asdict(reduction.settings),
        "inputs_sha256": campaign.hashes,
        "certificates": certificates(campaign),
    }


def certificates(campaign: "Campaign") -> dict[str, Any]:
    """Provenance of each calibration; null where the file has none."""
    records: dict[str, Any] = {"site.toml": campaign.site}
    records |= {f"mirrors/{name}.toml": mirror for name, mirror in campaign.mirrors.items()}
    records |= {f"monuments/{name}.toml": monument for name, monument in campaign.monuments.items()}
    records |= {f"triplets/{name}.toml": triplet for name, triplet in campaign.triplets.items()}
    return {file: {key: getattr(record, key) for key in CERTIFICATE} for file, record in records.items()}
