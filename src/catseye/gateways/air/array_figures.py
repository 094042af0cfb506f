"""Figure of an acoustic array's air: map of temperature with paths, wind and chosen lines, and its u; files."""

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from catseye.aliases import Progress
from catseye.gateways.air.array_objects import ACOUSTIC_FIELD, ACOUSTIC_TIMES, full_array_object
from catseye.gateways.writers.drawing import FAINT, INK, Figure, styled, svg
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.written import Files, origin, write_files

if TYPE_CHECKING:
    from catseye.reduction.air.array_air import ArrayAir

FORMAT = "catseye-acoustic-field-1"
MOST_NAMED = 30  # stations


def write_array(air: "ArrayAir", directory: Path, progress: Progress | None = None) -> None:
    """Write tables, figure, JSON, and the provenance with their hashes.

    directory   existing, from `writers.output.atomic_directory`
    progress    called for each file
    """
    files: Files = {
        "acoustic_field.csv": lambda: ACOUSTIC_FIELD.csv(air),
        "acoustic_times.csv": lambda: ACOUSTIC_TIMES.csv(air),
        "map.svg": lambda: svg(array_map(air)),
        "acoustic_field.json": lambda: json_page({"format": FORMAT, **full_array_object(air)}),
    }
    settings = {"model": air.model, "air_model": air.air_model}
    provenance = {"format": FORMAT, "made_by": "catseye acoustic-field", "settings": settings}
    write_files(files, directory, {**provenance, **origin(datetime.now(UTC), air.array.hashes)}, progress=progress)


def array_map(air: "ArrayAir") -> Figure:
    """Map of temperature with wind, and of its standard uncertainty, with stations, paths and chosen lines."""
    z = air.grid[0, 2]
    panels = (
        (air.map.temperature_c, f"temperature at {z:.1f} m (°C)", "viridis"),
        (air.map.u_temperature_c, "its standard uncertainty (°C)", "viridis_r"),
    )
    with styled():
        figure = Figure(figsize=(9.4, 4.6), layout="constrained")
        axes = figure.subplots(1, 2, sharex=True, sharey=True)
        for ax, (values, label, colours) in zip(axes, panels, strict=True):
            _panel(air, ax, values, label, colours)
        if air.windy:
            inner = np.zeros(air.shape, bool)
            inner[1:-1:3, 1:-1:3] = True
            at = np.flatnonzero(inner.ravel())
            axes[0].quiver(
                air.grid[at, 0], air.grid[at, 1], air.map.wind[at, 0], air.map.wind[at, 1], color="white", width=0.004
            )
            speed = np.hypot(air.map.wind[:, 0], air.map.wind[:, 1])
            axes[0].set_title(f"arrows: wind, {speed.min():.1f} to {speed.max():.1f} m/s")
        axes[0].set_ylabel("y (m)")
    return figure


def _panel(air: "ArrayAir", ax: Any, values: np.ndarray, label: str, colours: str) -> None:
    across, up = (air.grid[:, k].reshape(air.shape) for k in (0, 1))
    image = ax.pcolormesh(across, up, values.reshape(air.shape), shading="gouraud", cmap=colours, rasterized=True)
    ax.figure.colorbar(image, ax=ax, label=label, location="bottom", shrink=0.9)
    places, array = air.array.places, air.array
    ways = {tuple(sorted(pair)) for pair in zip(array.source.tolist(), array.receiver.tolist(), strict=True)}
    for a, b in sorted(ways):
        ax.plot(places[[a, b], 0], places[[a, b], 1], color=FAINT, lw=0.5, alpha=0.6)
    ax.plot(places[:, 0], places[:, 1], "o", color="white", mec=INK, ms=5, ls="none")
    if len(array.names) <= MOST_NAMED:
        for name, place in zip(array.names, places, strict=True):
            box = {"boxstyle": "round,pad=0.1", "fc": "white", "ec": "none", "alpha": 0.7}
            ax.annotate(
                name, place[:2], xytext=(5, 5), textcoords="offset points", fontsize=7.5, color=INK, bbox=box,
                annotation_clip=False,
            )  # fmt: skip
    for k, line in enumerate(array.sheet.lines):
        ends = np.array([line.start, line.end])
        ax.plot(ends[:, 0], ends[:, 1], color="#c0392b", lw=1.8)
        assert air.lines is not None
        text = f"{line.name}\n{air.lines.temperature_c[k]:.2f} ± {air.lines.u_temperature_c[k]:.2f} °C"
        at = ends[0] + 0.25 * (ends[1] - ends[0])
        box = {"boxstyle": "round,pad=0.2", "fc": "white", "ec": "#c0392b", "alpha": 0.85, "lw": 0.6}
        ax.annotate(text, at[:2], ha="center", va="center", fontsize=7.5, color=INK, bbox=box)
    ax.set(aspect="equal", xlabel="x (m)")
    ax.use_sticky_edges = False
    ax.margins(0.06)
    ax.autoscale_view()
