"""Acoustic paths as JSON, tables and text."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from catseye.atmosphere.weather.humidity import humidity_doubts
from catseye.constants import PPM
from catseye.gateways.writers.verdict import Verdict
from catseye.gateways.writers.written import csv_text
from catseye.records.site.validity import expired

if TYPE_CHECKING:
    from catseye.reduction.air.acoustic_recording import AcousticPath

MARK = "mjd_utc,ranger,target,temperature_c,u_temperature_c"  # the header of path_temperatures.csv
TIMES = (
    "mjd_utc", "ranger", "target", "file", "time_ab_s", "time_ba_s", "u_time_ab_us", "u_time_ba_us", "snr_ab_db",
    "snr_ba_db", "temperature_c", "u_temperature_c", "wind_m_per_s", "u_wind_m_per_s", "group_refractivity_ppm",
    "u_group_refractivity_ppm", "status",
)  # fmt: skip

MOST_USED = 0.8  # least share of a path's shots for a good verdict


class Mean(NamedTuple):
    """Mean temperature (°C), wind (m/s) and refractivity of a path, with uncertainties."""

    used: int
    temperature_c: float
    u_temperature_c: float
    wind: float
    refractivity: float
    u_refractivity: float


def mean(path: "AcousticPath") -> Mean:
    """Means over the used shots, with the full covariance: common errors do not average out."""
    used, air = path.used, path.temperatures
    count = int(used.sum())
    if count == 0:
        return Mean(0, *(np.nan,) * 5)
    block = np.ix_(used, used)
    return Mean(
        count,
        float(air.temperature_c[used].mean()),
        float(np.sqrt(air.covariance_c2[block].sum())) / count,
        float(air.wind[used].mean()),
        float(air.group_refractivity[used].mean()),
        float(np.sqrt(air.covariance_group[block].sum())) / count,
    )


def acoustic_verdict(paths: Sequence["AcousticPath"]) -> Verdict:
    """Verdict on acoustic paths: temperatures, share of used shots, validity of the sheets."""
    doubts: list[str] = []
    for path in paths:
        doubts += expired({f"{path.sheet.ranger} to {path.sheet.target}": path.sheet}, float(path.shots.mjd[-1]))
        doubts += humidity_doubts(path.shots.weather[2])
    return _own_verdict(paths).hearing(doubts)


def _own_verdict(paths: Sequence["AcousticPath"]) -> Verdict:
    unusable = [path for path in paths if not path.used.any()]
    if unusable and len(unusable) == len(paths):
        return Verdict("failed", "no usable shot of any path")
    if unusable:
        return Verdict("doubtful", f"no usable shot of {unusable[0].sheet.ranger} to {unusable[0].sheet.target}")
    thin = [path for path in paths if path.used.mean() < MOST_USED]
    if thin:
        share = 100.0 * float(thin[0].used.mean())
        return Verdict("doubtful", f"only {share:.0f} % of the shots of {thin[0].sheet.ranger} could be used")
    return Verdict("good", f"{sum(int(path.used.sum()) for path in paths)} shots used of {len(paths)} paths")


def acoustic_object(paths: Sequence["AcousticPath"]) -> dict[str, Any]:
    """Object that `catseye acoustic --json` prints."""
    return {"verdict": acoustic_verdict(paths).to_object(), "paths": [_path(path) for path in paths]}


def full_object(paths: Sequence["AcousticPath"]) -> dict[str, Any]:
    """The same with covariances, as in acoustic.json."""
    items = []
    for path in paths:
        covariances = {
            "covariance_c2": path.temperatures.covariance_c2,
            "covariance_group": path.temperatures.covariance_group,
        }
        items.append({**_path(path), **covariances})
    return {"format": "catseye-acoustic-1", "verdict": acoustic_verdict(paths).to_object(), "paths": items}


def _path(path: "AcousticPath") -> dict[str, Any]:
    sheet, air, over = path.sheet, path.temperatures, mean(path)
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


def words(path: "AcousticPath") -> list[tuple[str, str]]:
    """Title and text of each passage on a path."""
    sheet, over = path.sheet, mean(path)
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
