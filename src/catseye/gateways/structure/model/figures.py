"""Figures of a structural model: displacement with elevation and from the side; fitted coefficients, residuals."""

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.gateways.writers.drawing import FAINT, INK, SERIES, STYLE, Figure, mpl
from catseye.geometry.antenna.deformation import TelescopePosture
from catseye.reduction.structure.displacement import ModelDisplacements, displacements
from catseye.reduction.structure.model_fit import ModelFindings

AXES = ("x", "y", "z")
BAND = 2.0  # standard uncertainties shown
ARROW = 0.12  # of the telescope's size: length of the longest displacement drawn


def elevation_figure(displaced: ModelDisplacements) -> Figure:
    """Displacement with elevation of the point of each frame that moves most, axes of the frame, with u."""
    length = np.linalg.norm(displaced.ground, axis=2).max(axis=0)
    frames = list(dict.fromkeys(point.frame for point in displaced.points))
    most = [max((i for i, p in enumerate(displaced.points) if p.frame == f), key=lambda i: length[i]) for f in frames]
    low, high = (angle * DEGREE for angle in displaced.antenna.record.elevation_deg)
    grid = np.linspace(low, high, 61)
    azimuth, warm = (
        float(np.asarray(displaced.posture.azimuth)[0]),
        float(np.asarray(displaced.posture.temperature_c)[0]),
    )
    over = displacements(displaced.antenna, [displaced.points[i] for i in most], TelescopePosture(azimuth, grid, warm))
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.2, 3.6), layout="constrained")
        panels = figure.subplots(1, 3, sharex=True)
        for c, panel in enumerate(panels):
            for n, i in enumerate(most):
                value = over.body[:, n, c] / MILLIMETRE
                u = BAND * np.sqrt(over.body_covariance[:, n, c, c]) / MILLIMETRE
                color = SERIES[n % len(SERIES)]
                panel.fill_between(grid / DEGREE, value - u, value + u, color=color, alpha=0.18, linewidth=0)
                label = f"{displaced.points[i].name} ({displaced.points[i].frame})"
                panel.plot(grid / DEGREE, value, color=color, label=label)
            for e in np.asarray(displaced.posture.elevation, dtype=float):
                panel.axvline(e / DEGREE, color=FAINT, linewidth=0.7, linestyle=":")
            panel.set_title(f"displacement along {AXES[c]}, mm")
            panel.set_xlabel("elevation (°)")
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(most))
        return figure


def side_figure(displaced: ModelDisplacements) -> Figure:
    """Points of the first posture from the side, with their displacements as enlarged arrows."""
    azimuth = float(np.asarray(displaced.posture.azimuth)[0])
    forward = np.array([np.sin(azimuth), np.cos(azimuth), 0.0])  # horizontal, where the telescope looks
    flat = np.stack([displaced.rigid[0] @ forward, displaced.rigid[0, :, 2]], axis=1)
    moved = np.stack([displaced.ground[0] @ forward, displaced.ground[0, :, 2]], axis=1)
    size, longest = float(np.max(np.ptp(flat, axis=0))) or 1.0, float(np.max(np.hypot(*moved.T))) or 1e-6
    scale = ARROW * size / longest
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(6.4, 5.6), layout="constrained")
        panel = figure.subplots()
        for n, frame in enumerate(dict.fromkeys(point.frame for point in displaced.points)):
            at = np.array([i for i, point in enumerate(displaced.points) if point.frame == frame])
            color = SERIES[n % len(SERIES)]
            panel.plot(*flat[at].T, "o", color=color, markersize=3.5, label=frame)
            panel.quiver(
                *flat[at].T, *(scale * moved[at]).T, color=color, angles="xy", scale_units="xy", scale=1, width=0.004
            )
        ends = np.concatenate([flat, flat + scale * moved])
        margin = 0.05 * size
        panel.set_xlim(ends[:, 0].min() - margin, ends[:, 0].max() + margin)
        panel.set_ylim(ends[:, 1].min() - margin, ends[:, 1].max() + margin)
        panel.set_aspect("equal")
        e = float(np.asarray(displaced.posture.elevation)[0]) / DEGREE
        panel.set_title(f"From the side at elevation {e:.0f}°; the longest arrow is {longest / MILLIMETRE:.1f} mm")
        panel.set_xlabel("forward along the ground (m)", color=INK)
        panel.set_ylabel("up (m)")
        figure.legend(*panel.get_legend_handles_labels(), loc="outside lower center", ncols=4)
        return figure


def coefficient_figure(findings: ModelFindings) -> Figure:
    """Change of each free coefficient by the fit, with u: shifts on the left, turns on the right."""
    rows = findings.coefficients
    parts = [[row for row in rows if row.turns == turns] for turns in (False, True)]
    most = max(len(part) for part in parts)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.2, 1.2 + 0.19 * most), layout="constrained")
        for panel, part, unit, name in zip(
            figure.subplots(1, 2), parts, (MILLIMETRE, ARCSECOND), ("mm", "″"), strict=True
        ):
            owners = list(dict.fromkeys(row.owner for row in rows))
            for k, row in enumerate(part):
                color = SERIES[owners.index(row.owner) % len(SERIES)]
                change, u = (row.after - row.before) / unit, BAND * row.u / unit
                panel.errorbar(change, k, xerr=u, fmt="o", color=color, markersize=3.0, linewidth=1.2)
            panel.axvline(0.0, color=FAINT, linewidth=0.8)
            panel.set_yticks(range(len(part)), [f"{r.owner} {r.component[-1]} {r.function}" for r in part], fontsize=7)
            panel.set_ylim(len(part) - 0.4, -0.6)
            panel.set_xlabel(f"fitted minus model ({name}), bars {BAND:g} u")
            panel.set_title("Shifts" if unit == MILLIMETRE else "Turns")
        return figure


def epoch_figure(findings: ModelFindings) -> Figure:
    """Residuals of the targets with elevation, ground axes, by the group that they belong to."""
    owner = {name: group.group for group in findings.antenna.groups.values() for name in group.names}
    elevation = [float(np.ravel(epoch.posture.elevation)[0]) / DEGREE for epoch in findings.epochs]
    at = np.array([e for e, epoch in zip(elevation, findings.epochs, strict=True) for _ in epoch.names])
    groups = np.array([owner[name] for epoch in findings.epochs for name in epoch.names])
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.2, 3.4), layout="constrained")
        panels = figure.subplots(1, 3, sharey=True)
        for c, panel in enumerate(panels):
            for n, group in enumerate(dict.fromkeys(groups.tolist())):
                rows = groups == group
                color = SERIES[n % len(SERIES)]
                panel.plot(
                    at[rows], findings.residuals[rows, c] / MILLIMETRE, "o", color=color, markersize=2.6, label=group
                )
            panel.axhline(0.0, color=FAINT, linewidth=0.8)
            panel.set_title(f"residual {AXES[c]}, mm")
            panel.set_xlabel("elevation (°)")
        count = len(dict.fromkeys(groups.tolist()))
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=count)
        return figure
