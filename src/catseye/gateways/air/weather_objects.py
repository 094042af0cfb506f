"""A logger's weather as text, JSON, and weather.csv of a campaign."""

from typing import TYPE_CHECKING, Any

import numpy as np

from catseye.constants import PPM
from catseye.gateways.air.objects import spread
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.written import csv_text
from catseye.reduction.air.stated import contributions
from catseye.reduction.air.weather_series import usual_step_s

if TYPE_CHECKING:
    from catseye.reduction.air.weather_series import WeatherSeries

MARK = "mjd_utc,station,temperature_c,pressure_mb,humidity_pct"  # header of a campaign's weather.csv
MOST_LINES = 6  # of a reason that are named in text
MOST_GAPS = 4


def weather_csv(series: "WeatherSeries") -> str:
    """weather.csv of a campaign: usable rows in order of time, humidities at most 100 %."""
    state = series.index.state
    rows = zip(
        (f"{mjd:.8f}" for mjd in series.mjd_utc.tolist()),
        series.station,
        (f"{value:.3f}" for value in np.asarray(state.temperature_c).tolist()),
        (f"{value:.3f}" for value in series.pressure_hpa.tolist()),
        (f"{value:.3f}" for value in np.minimum(state.humidity_percent, 100.0).tolist()),
        strict=True,
    )
    return csv_text(MARK.split(","), rows)


def weather_object(series: "WeatherSeries") -> dict[str, Any]:
    """Object that `catseye weather --json` prints."""
    state, table = series.index.state, series.table
    return {
        "verdict": series.verdict.to_object(),
        "file": table.file,
        "model": state.model,
        "wavelength_um": series.index.wavelength_um,
        "pressure_at": table.sheet.pressure_at,
        "elevation": table.sheet.elevation_m,
        "rows": len(series.status),
        "mjd_utc": series.mjd_utc,
        "station": list(series.station),
        "line": table.lines[series.rows],
        "temperature_c": state.temperature_c,
        "pressure_hpa": series.pressure_hpa,
        "humidity_percent": state.humidity_percent,
        "vapour_pressure_hpa": state.vapour_pressure_hpa,
        "group_refractivity": state.group_refractivity,
        "u_group_refractivity": np.broadcast_to(series.index.u, series.rows.shape),
        "uncertainty_of": list(series.index.stated),
        "left_out": [{"line": line, "reason": text} for text, lines in series.left_out.items() for line in lines],
        "gaps": [gap._asdict() for gap in series.gaps],
        "doubts": list(series.doubts),
    }


def weather_passages(series: "WeatherSeries") -> list[Passage]:
    """Times, weather, index, left-out rows, gaps and doubts as text."""
    state, mjd = series.index.state, series.mjd_utc
    ppm = np.asarray(state.group_refractivity) / PPM
    u = np.asarray(series.index.u) / PPM
    rows = {
        "rows": f"{len(series.rows)} of {len(series.status)} used, every {spread(_steps(series), '.4g')} s",
        "time": f"MJD {mjd.min():.5f} to {mjd.max():.5f} UTC",
        "temperature": f"{spread(state.temperature_c, '.2f')} °C",
        "pressure": f"{spread(series.pressure_hpa, '.2f')} hPa at the station{_reduced(series)}",
        "humidity": f"{spread(state.humidity_percent, '.1f')} %, {spread(state.vapour_pressure_hpa, '.2f')} hPa",
        "index": f"n_g - 1 is {spread(ppm, '.3f')} ppm, u {spread(u, '.2g')} ppm "
        f"({contributions(series.index.stated)})",
        "formula": f"{state.model}, {spread(series.index.wavelength_um, 'g')} µm",
    }
    for k, (text, lines) in enumerate(_by_kind(series).items(), start=1):
        rows["left out" if k == 1 else f"left out {k}"] = f"{text}: {_lines(lines)}"
    if series.gaps:
        rows["gaps"] = _gaps(series)
    if np.any(series.table.saturated):
        rows["fog"] = f"{int(series.table.saturated.sum())} humidities above 100 % are taken as 100 %"
    for k, text in enumerate(series.doubts, start=1):
        rows["doubt" if k == 1 else f"doubt {k}"] = text
    return [Passage(title, text) for title, text in rows.items()]


def _steps(series: "WeatherSeries") -> list[float]:
    names = np.array(series.station)
    return [usual_step_s(series.mjd_utc[names == name]) for name in dict.fromkeys(series.station)]


def _reduced(series: "WeatherSeries") -> str:
    sheet = series.table.sheet
    if sheet.pressure_at == "station":
        return ""
    as_read = series.table.readings["pressure_hpa"][series.rows]
    return f", {spread(as_read, '.2f')} hPa as reduced to sea level ({sheet.pressure_at}) from {sheet.elevation_m:g} m"


def _by_kind(series: "WeatherSeries") -> dict[str, list[str]]:
    """Lines by kind of reason; of a repeated time with the line that it repeats."""
    kinds: dict[str, list[str]] = {}
    for text, lines in series.left_out.items():
        kind, _, second = text.partition(" of line ")
        number, _, more = second.partition(" ")
        for line in lines:
            kinds.setdefault(f"{kind} {more}".strip(), []).append(f"{line} ({number})" if second else str(line))
    return kinds


def _lines(lines: list[str]) -> str:
    more = f" and {len(lines) - MOST_LINES} more" if len(lines) > MOST_LINES else ""
    return f"line{'s' if len(lines) > 1 else ''} {', '.join(lines[:MOST_LINES])}{more}"


def _gaps(series: "WeatherSeries") -> str:
    longest = sorted(series.gaps, key=lambda gap: -gap.minutes)[:MOST_GAPS]
    words = [f"{gap.minutes:.4g} min between lines {gap.first_line} and {gap.last_line}" for gap in longest]
    more = f" and {len(series.gaps) - MOST_GAPS} shorter" if len(series.gaps) > MOST_GAPS else ""
    return f"{'; '.join(words)}{more}"
