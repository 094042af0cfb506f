"""Air between two points as text and JSON."""

from typing import TYPE_CHECKING, Any

import numpy as np

from catseye.constants import ARCSECOND, PPM
from catseye.gateways.writers.passage import Passage

if TYPE_CHECKING:
    from catseye.reduction.air.ray_path import AirPath


def path_object(path: "AirPath") -> dict[str, Any]:
    """Object that `catseye path --json` prints."""
    leaving, arriving = path.angles
    levels, mean, ray = path.levels, path.mean, path.ray
    return {
        "verdict": path.verdict.to_object(),
        "start": path.start,
        "end": path.end,
        "mjd_utc": path.mjd_utc if path.mjd_utc else None,
        "model": path.site.model,
        "wavelength_um": path.site.wavelength_um,
        "stations": list(path.site.stations),
        "length": path.length,
        "elevation": path.elevation,
        "group_refractivity": mean.refractivity[0],
        "u_group_refractivity": path.u_refractivity,
        "formula_uncertainty": mean.u_formula,
        "temperature_c": mean.temperature_c[0],
        "u_temperature_c": np.sqrt(mean.covariance_c2[0, 0]),
        "ray": {
            "status": str(ray.status[0]),
            "leaving": leaving,
            "arriving": arriving,
            "u_angle": 0.5 * path.u_curvature * path.length,
            "sag": path.ray_sag,
            "length_excess": ray.length_excess[0],
            "optical_excess": ray.optical_excess[0],
            "delay_difference_s": path.delay_difference_s,
        },
        "arc": {
            "index_gradient": path.gradient,
            "u_index_gradient": path.u_gradient,
            "curvature": path.arc_curvature,
            "angle": path.arc_angle,
            "sag": path.arc_sag,
            "excess_bound": path.bound,
        },
        "profile": {
            "z": levels.z,
            "temperature_c": levels.temperature_c,
            "u_temperature_c": levels.u_temperature_c,
            "pressure_hpa": levels.pressure_hpa,
            "humidity_percent": levels.humidity_percent,
            "group_refractivity": levels.group_refractivity,
            "u_group_refractivity": levels.u_group_refractivity,
            "index_gradient": levels.index_gradient,
        },
        "notes": list(path.site.notes),
    }


def path_passages(path: "AirPath") -> list[Passage]:
    """Mean index, bending, delay, and the profile at the ends as text."""
    leaving, arriving = (angle / ARCSECOND for angle in path.angles)
    u = 0.5 * path.u_curvature * path.length / ARCSECOND
    mean = path.mean
    rows = {
        "path": f"{path.length:.3f} m at an elevation of {np.degrees(path.elevation):.2f}°"
        + (f", MJD {path.mjd_utc:.5f} UTC" if path.mjd_utc else ""),
        "mean index": f"n_g - 1 = {mean.refractivity[0] / PPM:.3f} ± {path.u_refractivity / PPM:.2g} ppm, "
        f"{path.u_refractivity * path.length / 1e-6:.2g} µm of the path",
        "temperature": f"{mean.temperature_c[0]:.2f} ± {np.sqrt(mean.covariance_c2[0, 0]):.2g} °C in the mean",
        "ray": f"leaves {_beside(leaving)}, arrives {_beside(arriving)}, ± {u:.2g} arcsec; "
        f"{path.ray_sag * 1e3:+.3f} mm above the middle of the chord",
        "delay": f"{float(path.ray.optical_excess[0]) / 1e-6:+.3g} µm ({path.delay_difference_s / 1e-15:+.2g} fs) "
        f"against the chord; no air of this steepness makes more than {path.bound / 1e-6:.2g} µm",
        "arc": f"of {path.gradient / PPM:+.4f} ± {path.u_gradient / PPM:.2g} ppm/m at the middle: "
        f"{path.arc_angle / ARCSECOND:+.2f} arcsec, {path.arc_sag * 1e3:+.3f} mm",
        "formula": f"{path.site.model}, {path.site.wavelength_um:g} µm; stations {', '.join(path.site.stations)}",
    }
    for k, text in enumerate(path.site.notes, start=1):
        rows["note" if k == 1 else f"note {k}"] = text
    return [Passage(title, text) for title, text in rows.items()]


def _beside(arcsec: float) -> str:
    return f"{abs(arcsec):.2f} arcsec {'above' if arcsec >= 0.0 else 'below'} the chord's direction"
