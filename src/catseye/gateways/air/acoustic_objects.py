"""Acoustic paths as JSON, tables and text."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from catseye.constants import PPM
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.written import csv_text

if TYPE_CHECKING:
    from catseye.reduction.air.sound_path import AcousticPath, AcousticReduction

MARK = "mjd_utc,ranger,target,temperature_c,u_temperature_c"  # the header of path_temperatures.csv
TIMES = (
    "mjd_utc", "ranger", "target", "file", "time_ab_s", "time_ba_s", "u_time_ab_us", "u_time_ba_us", "snr_ab_db",
    "snr_ba_db", "temperature_c", "u_temperature_c", "wind_m_per_s", "u_wind_m_per_s", "group_refractivity_ppm",
    "u_group_refractivity_ppm", "status",
)  # fmt: skip


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


def path_temperatures_csv(paths: Sequence["AcousticPath"]) -> str:
    """Table that a campaign reads: one row per shot with a temperature, in time order."""
    rows = [
        (path.shots.mjd[k], path.sheet.ranger, path.sheet.target, path.temperatures.temperature_c[k],
         path.temperatures.u_temperature_c[k])
        for path in paths
        for k in np.flatnonzero(path.used)
    ]  # fmt: skip
    rows.sort(key=lambda row: row[0])
    return csv_text(MARK.split(","), [(f"{t:.8f}", a, b, f"{c:.4f}", f"{u:.4f}") for t, a, b, c, u in rows])


def shots_csv(paths: Sequence["AcousticPath"]) -> str:
    """Table of all shots, used or not."""
    rows = []
    for path in paths:
        shots, air = path.shots, path.temperatures
        back = np.full(len(shots.mjd), np.nan) if shots.time_ba is None else shots.time_ba
        with np.errstate(invalid="ignore", divide="ignore"):
            decibel = 10.0 * np.log10(shots.snr)
        for k in range(len(shots.mjd)):
            numbers = (
                (shots.time_ab[k], ".9f"), (back[k], ".9f"), (shots.u_time[0, k] * 1e6, ".3f"),
                (shots.u_time[1, k] * 1e6 if shots.time_ba is not None else np.nan, ".3f"), (decibel[0, k], ".1f"),
                (decibel[1, k], ".1f"), (air.temperature_c[k], ".4f"), (air.u_temperature_c[k], ".4f"),
                (air.wind[k], ".3f"), (air.u_wind[k], ".3f"), (air.group_refractivity[k] / PPM, ".4f"),
                (air.u_group_refractivity[k] / PPM, ".4f"),
            )  # fmt: skip
            cells = ("" if not np.isfinite(value) else format(float(value), form) for value, form in numbers)
            head = (f"{shots.mjd[k]:.8f}", path.sheet.ranger, path.sheet.target, shots.file[k])
            rows.append((*head, *cells, path.status(k)))
    return csv_text(TIMES, rows)


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
        ("Wind", f"{over.wind:+.2f} m/s from {sheet.ranger} to {sheet.target}"),
        ("Index", f"n_g - 1 = {over.refractivity / PPM:.3f} ppm, u {over.u_refractivity / PPM:.3f} ppm, "
                  f"at {sheet.wavelength_um:g} µm ({path.air_model}; sound by {path.model})"),
    ]  # fmt: skip
    for text in dict.fromkeys(path.status(int(k)) for k in np.flatnonzero(~path.used)):
        passages.append(("Not used", text))
    return passages
