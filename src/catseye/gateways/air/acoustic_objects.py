"""Acoustic paths as JSON, tables and text."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from catseye.atmosphere.weather.humidity import humidity_doubts
from catseye.constants import PPM
from catseye.gateways.writers.verdict import Verdict
from catseye.records.site.validity import expired

if TYPE_CHECKING:
    from catseye.reduction.air.acoustic_recording import AcousticPath

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
