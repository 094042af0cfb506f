"""JSON objects of what a site measures: shots, epochs, events, postures, weather.

The same from the coordinator's port and from a journal. SI units, MJD; None for what nobody knows.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from catseye.coordinator.condition import verdict_of
from catseye.coordinator.journal.entries import EpochSolution
from catseye.records.night.live import TICKS_PER_DAY

Object = dict[str, Any]
SHOT = ("number", "mjd", "ranger", "target", "status", "range", "u_range", "misfit")
EVENT = ("mjd", "severity", "who", "kind", "text")
POSTURE = ("mjd", "azimuth", "elevation", "azimuth_rate", "elevation_rate")
WEATHER = ("mjd", "station", "temperature_c", "pressure_hpa", "humidity_percent")
EPOCH = (
    *("number", "mjd", "points", "shots", "rejected", "variance_factor", "degrees_of_freedom", "refractivity_ppm"),
    *("azimuth", "elevation", "verdict"),
)
COVARIANCE = ("xx", "xy", "xz", "yy", "yz", "zz")


def number(value: Any) -> float | None:
    """Finite number, None for any other value."""
    return value if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value) else None


def numbers(values: Iterable[Any]) -> list[float | None]:
    """Finite numbers, None in place of others."""
    return [number(value) for value in values]


def words(value: Any) -> str:
    """Text of a cell, also of a damaged one."""
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def mjd_of(ticks: Any) -> float | None:
    """MJD of ticks; None if unknown."""
    return ticks / TICKS_PER_DAY if number(ticks) is not None else None


def keyed(keys: Sequence[str], values: Iterable[Any]) -> Object:
    """Object of keys and values."""
    return dict(zip(keys, values, strict=True))


def columns(keys: Sequence[str], rows: Iterable[Sequence[Any]]) -> dict[str, list[Any]]:
    """Columns of rows, by key."""
    table = list(rows)
    return {key: [row[k] for row in table] for k, key in enumerate(keys)}


def rows_to_columns(keys: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """Columns of objects, by key."""
    table = list(rows)
    return {key: [row[key] for row in table] for key in keys}


def epoch_summary(solution: EpochSolution) -> Object:
    """Summary of a solved epoch."""
    answer = solution.answer
    verdict = verdict_of(solution)
    return {
        "number": answer.get("number"),
        "mjd": mjd_of(answer.get("ticks") or solution.ticks),
        "points": len(answer.get("names") or ()),
        "shots": len(answer.get("used") or ()),
        "rejected": len(answer.get("rejected") or ()),
        **{key: number(answer.get(key)) for key in EPOCH[5:10]},
        "verdict": verdict.word,
        "verdict_text": verdict.why,
    }
