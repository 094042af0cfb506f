"""Figure and files of the air between two points."""

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catseye.aliases import Progress
from catseye.constants import PPM
from catseye.gateways.air.ray_objects import path_object
from catseye.gateways.air.tables import air_profile_csv
from catseye.gateways.writers.drawing import FAINT, SERIES, Figure, styled, svg
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.written import Files, origin, write_files

if TYPE_CHECKING:
    from catseye.reduction.air.ray_path import AirPath

FORMAT = "catseye-path-1"
BAND = "#dfe9f3"


def write_path(path: "AirPath", directory: Path, progress: Progress | None = None) -> None:
    """Write table, figure, JSON, and the provenance with their hashes.

    directory   existing, from `writers.output.atomic_directory`
    progress    called for each file
    """
    files: Files = {
        "air_profile.csv": lambda: air_profile_csv(path),
        "path.svg": lambda: svg(path_figure(path)),
        "path.json": lambda: json_page({"format": FORMAT, **path_object(path)}),
    }
    provenance = {"format": FORMAT, "made_by": "catseye path", "settings": {"model": path.site.model}}
    made = origin(datetime.now(UTC), dict(path.hashes))
    write_files(files, directory, {**provenance, **made}, progress=progress)


def path_figure(path: "AirPath") -> Figure:
    """Temperature, group refractivity and gradient over height, and the ray above its chord."""
    levels = path.levels
    with styled():
        figure = Figure(figsize=(9.4, 7.0), layout="constrained")
        top, bottom = np.ravel(np.asarray(figure.subfigures(2, 1, height_ratios=(2.0, 1.0)), dtype=object))
        axes = top.subplots(1, 3, sharey=True)
        panels = (
            ("temperature (°C)", levels.temperature_c, levels.u_temperature_c),
            ("n$_g$ − 1 (ppm)", levels.group_refractivity / PPM, levels.u_group_refractivity / PPM),
            ("gradient of n (ppm/m)", levels.index_gradient / PPM, None),
        )
        low, high = sorted((float(path.start[2]), float(path.end[2])))
        for ax, (label, values, u) in zip(axes, panels, strict=True):
            if u is not None:
                ax.fill_betweenx(levels.z, values - u, values + u, color=BAND, lw=0, label="standard uncertainty")
            ax.plot(values, levels.z, color=SERIES[0], lw=1.3)
            ax.axhspan(low, max(high, low + 1e-3), color=SERIES[1], alpha=0.12, lw=0, label="heights of the path")
            ax.set_xlabel(label)
        readings = path.site.profile.temperature.readings
        nearest = np.abs(readings.seconds - (path.mjd_utc - path.site.start_mjd) * 86400.0)
        for number, name in enumerate(path.site.stations):
            local = np.flatnonzero(readings.station == number)
            if not len(local):
                continue
            row = local[int(np.argmin(nearest[local]))]
            axes[0].plot(readings.value[row], readings.z[row], "o", color=SERIES[2], ms=5)
            axes[0].annotate(name, (readings.value[row], readings.z[row]), xytext=(6, 4), textcoords="offset points")
        axes[0].set_ylabel("height (m)")
        axes[0].legend(loc="upper left")
        ax = bottom.subplots(1, 1)
        x: np.ndarray = np.linspace(0.0, path.length, 101)
        leaving, arriving = path.angles
        # a cubic with the ray's own directions at both ends
        share = x / path.length
        above = path.length * (leaving * share * (1.0 - share) ** 2 - arriving * share**2 * (1.0 - share))
        arc = 4.0 * path.arc_sag * share * (1.0 - share)
        ax.plot(x, above * 1e3, color=SERIES[0], lw=1.4, label="traced ray")
        ax.plot(x, arc * 1e3, color=SERIES[1], lw=1.0, ls="--", label="arc by the gradient at the middle")
        ax.axhline(0.0, color=FAINT, lw=0.8)
        ax.set_xlabel("distance along the chord (m)")
        ax.set_ylabel("above the chord (mm)")
        ax.legend(loc="best")
    return figure
