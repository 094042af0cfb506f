"""Air of an acoustic array as tables, text and JSON."""

from typing import TYPE_CHECKING, Any

import numpy as np

from catseye.constants import PPM
from catseye.gateways.writers.columns import Column, Table
from catseye.gateways.writers.passage import Passage

if TYPE_CHECKING:
    from catseye.reduction.air.acoustic_field import LineAir
    from catseye.reduction.air.array_air import ArrayAir

PAGE = "acoustic.md"
AXES = "xyz"


def _place(axis: int) -> "Column[ArrayAir]":
    return Column(f"{AXES[axis]}_m", "m", f"{AXES[axis]} of the point", lambda a: a.grid[:, axis], ".3f")


def _wind(axis: int, *, u: bool) -> "Column[ArrayAir]":
    """Column of a component of the wind, absent where none is estimated."""
    doc = f"its standard uncertainty along {AXES[axis]}" if u else f"wind along {AXES[axis]}; absent without both ways"
    return Column(
        f"{'u_' if u else ''}wind_{AXES[axis]}_m_per_s",
        "m / s",
        doc,
        lambda a: (a.map.u_wind if u else a.map.wind)[:, axis] if a.windy else None,
        ".3f",
    )


ACOUSTIC_FIELD = Table["ArrayAir"](
    "acoustic_field.csv",
    PAGE,
    (
        *(_place(axis) for axis in range(3)),
        Column("temperature_c", "deg_C", "air temperature at the point", lambda a: a.map.temperature_c, ".4f"),
        Column("u_temperature_c", "deg_C", "its standard uncertainty", lambda a: a.map.u_temperature_c, ".4f"),
        *(_wind(axis, u=False) for axis in range(2)),
        *(_wind(axis, u=True) for axis in range(2)),
        Column(
            "resolution",
            "",
            "share of the prior variance that the sound takes away: 0 nothing, 1 all",
            lambda a: a.map.resolution,
            ".4f",
        ),
    ),
)

ACOUSTIC_TIMES = Table["ArrayAir"](
    "acoustic_times.csv",
    PAGE,
    (
        Column("source", "", "station that sends", lambda a: [a.array.names[k] for k in a.array.source]),
        Column("receiver", "", "station that hears", lambda a: [a.array.names[k] for k in a.array.receiver]),
        Column("time_s", "s", "travel time as read, delay included", lambda a: a.array.time, ".7f"),
        Column(
            "residual_c",
            "deg_C",
            "temperature by this time, wind included, less that predicted by all others",
            lambda a: a.residual_c,
            ".4f",
        ),
        Column("standardised", "", "residual over its standard deviation", lambda a: a.standardised, ".3f"),
        Column("status", "", "`used`, `used, contradicts the others`, or why it is not", lambda a: a.status),
    ),
)


def array_object(air: "ArrayAir") -> dict[str, Any]:
    """Object that `catseye acoustic-field --json` prints."""
    tomogram = air.field.tomogram
    wind = {"wind": air.map.wind, "u_wind": air.map.u_wind} if air.windy else {}
    return {
        "verdict": air.verdict.to_object(),
        "model": air.model,
        "air_model": air.air_model,
        "stations": list(air.array.names),
        "times": len(air.array.time),
        "used": len(air.field.used),
        "both_ways": air.array.both_ways,
        "chi_square": tomogram.chi_square,
        "degrees_of_freedom": tomogram.degrees_of_freedom,
        "lines": [] if air.lines is None else [_line(air, air.lines, k) for k in range(len(air.array.sheet.lines))],
        "lines_covariance_c2": None if air.lines is None else air.lines.covariance_c2,
        "map": {
            "points": air.grid,
            "rows": air.shape[0],
            "columns": air.shape[1],
            "temperature_c": air.map.temperature_c,
            "u_temperature_c": air.map.u_temperature_c,
            **wind,
            "resolution": air.map.resolution,
        },
        "residuals": [
            {
                "source": air.array.names[air.array.source[k]],
                "receiver": air.array.names[air.array.receiver[k]],
                "residual_c": air.residual_c[k],
                "standardised": air.standardised[k],
                "status": text,
            }
            for k, text in enumerate(air.status)
        ],
    }


def full_array_object(air: "ArrayAir") -> dict[str, Any]:
    """The same with the covariance of the map, °C², as in acoustic_field.json."""
    found = array_object(air)
    found["map"]["covariance_c2"] = np.round(air.map.covariance_c2, 8)
    return found


def _line(air: "ArrayAir", lines: "LineAir", k: int) -> dict[str, Any]:
    chosen = air.array.sheet.lines[k]
    return {
        "name": chosen.name,
        "start": list(chosen.start),
        "end": list(chosen.end),
        "temperature_c": lines.temperature_c[k],
        "u_temperature_c": lines.u_temperature_c[k],
        "wind": lines.wind[k] if air.windy else None,
        "u_wind": lines.u_wind[k] if air.windy else None,
        "group_refractivity": lines.group_refractivity[k],
        "u_group_refractivity": lines.u_group_refractivity[k],
        "resolution": lines.resolution[k],
    }


def array_passages(air: "ArrayAir") -> list[Passage]:
    """Times, lines, map, wind and residuals as text."""
    array, field = air.array, air.field
    rows = {
        "array": f"{len(array.names)} stations, {len(field.used)} of {len(array.time)} times used, "
        f"{array.both_ways} pairs in both directions",
        "fit": f"chi-square {field.tomogram.chi_square:.1f} of {len(field.used)} times",
    }
    if air.lines is not None:
        for k, chosen in enumerate(array.sheet.lines):
            line = air.lines
            rows[f"line {chosen.name}"] = (
                f"{line.temperature_c[k]:.3f} ± {line.u_temperature_c[k]:.2g} °C in the mean, n_g - 1 = "
                f"{line.group_refractivity[k] / PPM:.3f} ± {line.u_group_refractivity[k] / PPM:.2g} ppm"
            )
    low, high = air.map.temperature_c.min(), air.map.temperature_c.max()
    u = air.map.u_temperature_c
    rows["map"] = (
        f"at {air.grid[0, 2]:.1f} m: {low:.2f} to {high:.2f} °C, u {u.min():.2g} to {u.max():.2g} °C, "
        f"{len(air.grid)} points"
    )
    if air.windy:
        mean = air.map.wind.mean(axis=0)
        rows["wind"] = f"x {mean[0]:+.2f}, y {mean[1]:+.2f} m/s in the mean of the map"
    elif field.tomogram.vector is None:
        rows["wind"] = "still air, as the sheet says"
    unused = [k for k, text in enumerate(air.status) if not text.startswith("used")]
    for n, k in enumerate([*field.suspects.tolist(), *unused][:6], start=1):
        way = f"{array.names[array.source[k]]} to {array.names[array.receiver[k]]}"
        beside = f", {air.standardised[k]:+.1f} standard deviations" if np.isfinite(air.standardised[k]) else ""
        rows[f"time {n}"] = f"{way}: {air.status[k]}{beside}"
    return [Passage(title, text) for title, text in rows.items()]
