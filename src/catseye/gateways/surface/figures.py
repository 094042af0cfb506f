"""Figures of a surface: maps over the aperture, Zernike terms, terms by elevation."""

from typing import Any

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.gateways.writers.drawing import FAINT, INK, SERIES, Figure, styled
from catseye.optics.zernike import number
from catseye.reduction.surface.actuators import Actuators
from catseye.reduction.surface.change import Change
from catseye.reduction.surface.lookup import HYSTERESIS, Lookup
from catseye.reduction.surface.shape import Expansion, LitAperture, ShapeSettings, SurfaceShape

LEVELS = 21
MOST_NAMED = 60  # most prisms with names
PANELS = 6  # terms of an elevation figure


def surface_map(
    local: np.ndarray, value: np.ndarray, aperture: LitAperture, *, label: str, names: tuple[str, ...] = ()
) -> Figure:
    """Map of values at prisms, interpolated linearly in triangles.

    local      (k, 2 or 3) m, dish's frame
    value      (k,) m
    label      label of the scale, in mm
    names      names of the prisms, shown if few
    """
    with styled():
        figure = Figure(figsize=(9.0, 6.8), layout="constrained")
        ax = figure.add_subplot()
        x, y, value_mm = local[:, 0], local[:, 1], value / MILLIMETRE
        limit = max(float(np.max(np.abs(value_mm))), 1e-6)
        levels = np.linspace(-limit, limit, LEVELS)
        scale: Any = {"cmap": "RdBu_r", "vmin": -limit, "vmax": limit}
        ax.tricontourf(x, y, value_mm, levels, extend="both", alpha=0.75, **scale)
        size = 60.0 if len(x) <= MOST_NAMED else 7.0
        dots = ax.scatter(x, y, c=value_mm, s=size, edgecolors=FAINT, linewidths=0.4 if size > 10 else 0.0, **scale)
        if len(names) <= MOST_NAMED:
            for name, px, py in zip(names, x, y, strict=False):
                ax.annotate(name, (px, py), xytext=(0, -6), textcoords="offset points", ha="center", va="top",
                            fontsize=6, color=INK)  # fmt: skip
        _edge(ax, aperture)
        ax.set_xlabel("x in the dish's frame (m)")
        ax.set_ylabel("y in the dish's frame, from the vertex (m)")
        figure.colorbar(dots, ax=ax, label=label, shrink=0.85)
        return figure


def shape_map(shape: SurfaceShape) -> Figure:
    """Map of half-path errors of one epoch relative to its fitted paraboloid."""
    fit = shape.fit
    return surface_map(fit.local, fit.half_path, shape.aperture, label="half-path error (mm)", names=shape.prisms.names)


def change_map(change: Change) -> Figure:
    """Map of the half-path change between two epochs."""
    return surface_map(
        change.local, change.half_path, change.aperture, label="change of half path (mm)", names=change.names
    )


def actuator_map(actuators: Actuators, aperture: LitAperture) -> Figure:
    """Maps of actuator corrections and their standard uncertainty."""
    with styled():
        figure = Figure(figsize=(11.0, 5.2), layout="constrained")
        correction, u = actuators.correction / MILLIMETRE, actuators.u_correction / MILLIMETRE
        limit = max(float(np.max(np.abs(correction))), 1e-6)
        centred: Any = {"cmap": "RdBu_r", "vmin": -limit, "vmax": limit}
        rising: Any = {"cmap": "viridis", "vmin": 0.0, "vmax": float(u.max())}
        panels = ((correction, "correction (mm)", centred), (u, "standard uncertainty (mm)", rising))
        for k, (values, title, scale) in enumerate(panels):
            ax = figure.add_subplot(1, 2, k + 1)
            dots = ax.scatter(actuators.places[:, 0], actuators.places[:, 1], c=values, s=6, linewidths=0, **scale)
            _edge(ax, aperture)
            ax.set_title(title)
            ax.set_xlabel("x (m)")
            ax.set_ylabel("y (m)" if k == 0 else "")
            figure.colorbar(dots, ax=ax, shrink=0.8)
        return figure


def _edge(ax: Any, aperture: LitAperture) -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    (x, y), radius = aperture.centre, aperture.radius
    ax.plot(x + radius * np.cos(angle), y + radius * np.sin(angle), color=FAINT, lw=0.9, ls="--")
    ax.set_aspect("equal")
    ax.use_sticky_edges = False  # sticky edges of filled contours would cut prisms at the edge
    ax.margins(0.04)


def zernike_bars(expansion: Expansion, settings: ShapeSettings) -> Figure:
    """Bars of Zernike terms with standard uncertainties, without piston and tilts."""
    with styled():
        chosen = [k for k, term in enumerate(expansion.terms) if term.n >= 2] or list(range(len(expansion.terms)))
        figure = Figure(figsize=(9.4, 0.9 + 0.27 * len(chosen)), layout="constrained")
        ax = figure.add_subplot()
        rows = np.arange(len(chosen))
        value, u = expansion.value[chosen] / MILLIMETRE, np.sqrt(np.diag(expansion.covariance))[chosen] / MILLIMETRE
        ax.barh(rows, value, xerr=u, color=SERIES[0], ecolor=INK, error_kw={"lw": 1.0, "capsize": 2.5}, height=0.65)
        labels = [f"{number(expansion.terms[k], settings.numbering)}  {expansion.terms[k].name}" for k in chosen]
        ax.set_yticks(rows, labels)
        ax.invert_yaxis()
        ax.axvline(0.0, color=FAINT, lw=0.8)
        ax.set_xlabel("half-path error of the term, rms over the aperture (mm), bars: 1σ")
        return figure


def elevation_terms(lookup: Lookup) -> Figure:
    """Curves of the terms that change most, measured and modelled, up and down separately."""
    with styled():
        span = np.ptp(lookup.table[:, :, 1], axis=0)
        order = [k for k in np.argsort(span)[::-1] if lookup.models[k].term.n >= 2][:PANELS] or [0]
        rows = (len(order) + 1) // 2
        figure = Figure(figsize=(10.0, 2.7 * rows), layout="constrained")
        for place, k in enumerate(order):
            ax = figure.add_subplot(rows, 2, place + 1)
            _elevation_panel(ax, lookup, int(k))
            ax.set_title(lookup.models[k].term.name)
            if place >= len(order) - 2:
                ax.set_xlabel("elevation (°)")
            if place % 2 == 0:
                ax.set_ylabel("half-path (mm rms)")
            if place == 0:
                ax.legend()
        return figure


def _elevation_panel(ax: Any, lookup: Lookup, k: int) -> None:
    at, ways = lookup.elevation_deg, (lookup.rising > 0.0, lookup.rising < 0.0)
    directional = HYSTERESIS in lookup.columns
    for direction, (chosen, mark, name) in enumerate(zip(ways, "^v", ("going up", "going down"), strict=True)):
        color = SERIES[direction]
        if chosen.any():
            ax.errorbar(
                at[chosen], lookup.measured[chosen, k] / MILLIMETRE, lookup.u_measured[chosen, k] / MILLIMETRE,
                fmt=mark, ms=4.5, color=color, lw=0.9, capsize=2, label=name,
            )  # fmt: skip
        if directional:
            line = lookup.table[:, k, 2 * direction] / MILLIMETRE
            ax.plot(lookup.table_deg, line, color=color, lw=1.1)
    if not directional:
        ax.plot(lookup.table_deg, lookup.table[:, k, 1] / MILLIMETRE, color=FAINT, lw=1.1)
    band = lookup.u_table[:, k, 1] / MILLIMETRE
    mean = lookup.table[:, k, 1] / MILLIMETRE
    ax.fill_between(lookup.table_deg, mean - band, mean + band, color=FAINT, alpha=0.25, linewidth=0)
