"""Acoustic paths as JSON, tables and text."""

from typing import TYPE_CHECKING, Any

import numpy as np

from catseye.constants import PPM
from catseye.gateways.writers.passage import Passage

if TYPE_CHECKING:
    from catseye.reduction.air.sound_path import AcousticPath, AcousticReduction


def acoustic_object(reduction: "AcousticReduction") -> dict[str, Any]:
    """Object that `catseye acoustic --json` prints."""
    return {"verdict": reduction.verdict.to_object(), "paths": [_path(path) for path in reduction.paths]}


def full_object(reduction: "AcousticReduction") -> dict[str, Any]:
    """The same with covariances, as in acoustic.json."""
    items = []
    for path in reduction.paths:
        covariances = {
            "covariance_c2": path.temperatures.covariance_c2,
            "covariance_group": path.temperatures.covariance_group,
        }
        items.append({**_path(path), **covariances})
    return {"format": "catseye-acoustic-1", "verdict": reduction.verdict.to_object(), "paths": items}


def _path(path: "AcousticPath") -> dict[str, Any]:
    sheet, air, over = path.sheet, path.temperatures, path.mean
    return {
        "ranger": sheet.ranger,
        "target": sheet.target,
        "length": sheet.length_m,
        "model": path.model,
        "air_model": path.air_model,
        "weather_of": path.weather_of,
        "u_pressure_hpa": path.u_weather[0],
        "u_humidity_percent": path.u_weather[1],
        "used": over.used,
        "temperature_c": over.temperature_c,
        "u_temperature_c": over.u_temperature_c,
        "wind": over.wind,
        "group_refractivity": over.refractivity,
        "u_group_refractivity": over.u_refractivity,
        "measurements": [_shot(path, k) for k in range(len(path.shots.mjd))],
        "parts_c": {name: _first(part[path.used]) for name, part in air.parts_c.items()},
    }


def _first(values: np.ndarray) -> float:
    return float(values[0]) if len(values) else np.nan


def _shot(path: "AcousticPath", k: int) -> dict[str, Any]:
    shots, air = path.shots, path.temperatures
    return {
        "mjd_utc": shots.mjd[k],
        "file": shots.file[k],
        "time_ab": shots.time_ab[k],
        "time_ba": None if shots.time_ba is None else shots.time_ba[k],
        "u_time_ab": shots.u_time[0, k],
        "u_time_ba": None if shots.time_ba is None else shots.u_time[1, k],
        "temperature_c": air.temperature_c[k],
        "u_temperature_c": air.u_temperature_c[k],
        "wind": air.wind[k],
        "u_wind": air.u_wind[k],
        "group_refractivity": air.group_refractivity[k],
        "u_group_refractivity": air.u_group_refractivity[k],
        "status": path.status(k),
    }


def passages(reduction: "AcousticReduction") -> list[Passage]:
    """Passages on all paths, in order."""
    return [Passage(title, text) for path in reduction.paths for title, text in words(path)]


def words(path: "AcousticPath") -> list[tuple[str, str]]:
    """Title and text of each passage on a path."""
    sheet, over = path.sheet, path.mean
    total = len(path.shots.mjd)
    ends = f"{sheet.ranger} to {sheet.target}, {sheet.length_m:.3f} m"
    if over.used == 0:
        return [("Path", ends), ("No shot", f"of {total} was used. The first: {path.status(0)}")]
    ways = "both directions" if path.shots.time_ba is not None else "one direction, with the wind given"
    scatter = path.temperatures.temperature_c[path.used].std(ddof=1) if over.used > 1 else np.nan
    spread = f"; they scatter by {scatter:.3f} °C" if over.used > 1 else ""
    parts = sorted(((_first(part[path.used]), name) for name, part in path.temperatures.parts_c.items()), reverse=True)
    largest = ", ".join(f"{name} {size:.3f}" for size, name in parts[:4])
    passages = [
        ("Path", f"{ends}; {over.used} of {total} shots used, {ways}"),
        ("Temperature", f"{over.temperature_c:.3f} °C, u {over.u_temperature_c:.3f} °C (mean of the shots{spread})"),
        ("Contributions", f"{largest} °C in one shot; all but time are common to all shots"),
        ("Weather", f"of {path.weather_of}; u {path.u_weather[0]:.3g} hPa, {path.u_weather[1]:.3g} %"),
        ("Wind", f"{over.wind:+.2f} m/s from {sheet.ranger} to {sheet.target}"),
        ("Index", f"n_g - 1 = {over.refractivity / PPM:.3f} ppm, u {over.u_refractivity / PPM:.3f} ppm, "
                  f"at {sheet.wavelength_um:g} µm ({path.air_model}; sound by {path.model})"),
    ]  # fmt: skip
    for text in dict.fromkeys(path.status(int(k)) for k in np.flatnonzero(~path.used)):
        passages.append(("Not used", text))
    return passages
