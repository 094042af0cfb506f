"""Figure of a logger's weather: readings and index over time, gaps, rows that are left out; its files."""

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catseye.aliases import Progress
from catseye.constants import PPM
from catseye.gateways.air.tables import weather_index_csv
from catseye.gateways.air.weather_objects import weather_object
from catseye.gateways.writers.drawing import BAD, GRID, SERIES, Figure, styled, svg
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.written import Files, origin, write_files

if TYPE_CHECKING:
    from catseye.reduction.air.weather_series import WeatherSeries


FORMAT = "catseye-weather-series-1"


def write_weather(series: "WeatherSeries", directory: Path, progress: Progress | None = None) -> None:
    """Write table, figure, JSON, and the provenance with their hashes.

    directory   existing, from `writers.output.atomic_directory`
    progress    called for each file
    """
    files: Files = {
        "weather_index.csv": lambda: weather_index_csv(series),
        "weather.svg": lambda: svg(weather_figure(series)),
        "weather.json": lambda: json_page({"format": FORMAT, **weather_object(series)}),
    }
    provenance = {"format": FORMAT, "made_by": "catseye weather", "settings": {"model": series.index.state.model}}
    made = origin(datetime.now(UTC), dict(series.table.hashes))
    write_files(files, directory, {**provenance, **made}, progress=progress)


def weather_figure(series: "WeatherSeries") -> Figure:
    """Temperature, pressure, humidity and group refractivity over time, a line a station."""
    state, table = series.index.state, series.table
    u = np.broadcast_to(series.index.u, series.rows.shape) / PPM
    panels = {
        "temperature (°C)": np.asarray(state.temperature_c),
        "pressure (hPa)": series.pressure_hpa,
        "humidity (%)": np.asarray(state.humidity_percent),
        "n$_g$ − 1 (ppm)": np.asarray(state.group_refractivity) / PPM,
    }
    start = float(np.floor(series.mjd_utc.min()))
    names = np.array(series.station)
    hours = (series.mjd_utc - start) * 24.0
    step = {gap.first_line for gap in series.gaps}
    with styled():
        figure = Figure(figsize=(9.4, 8.2), layout="constrained")
        axes = figure.subplots(len(panels), 1, sharex=True)
        for ax, (label, values) in zip(axes, panels.items(), strict=True):
            for gap in series.gaps:
                first = (gap.mjd_utc - start) * 24.0
                ax.axvspan(first, first + gap.minutes / 60.0, color=GRID, lw=0)
            for name, colour in zip(dict.fromkeys(series.station), SERIES * len(names), strict=False):
                local = np.flatnonzero(names == name)
                # a line does not cross a gap
                cuts = [k + 1 for k, row in enumerate(local[:-1]) if int(table.lines[series.rows[row]]) in step]
                for part in np.split(local, cuts):
                    if label.startswith("n"):
                        ax.fill_between(
                            hours[part], values[part] - u[part], values[part] + u[part], color=colour, alpha=0.25, lw=0
                        )
                    first_part = part[0] == local[0] if len(part) else False
                    ax.plot(hours[part], values[part], color=colour, lw=1.0, label=name if first_part else None)
            ax.set_ylabel(label)
            ax.margins(x=0.01)
        lost = np.array([k for k, text in enumerate(series.status) if text != "used"], dtype=int)
        if len(lost):
            at = (table.mjd_utc[lost] - start) * 24.0
            axes[0].plot(
                at, np.full(len(at), 0.03), "|", color=BAD, ms=9, transform=axes[0].get_xaxis_transform(),
                label="rows left out", clip_on=False,
            )  # fmt: skip
        axes[0].legend(loc="best")
        axes[-1].set_xlabel(f"hours from MJD {start:.0f} UTC; grey: no readings")
    return figure
