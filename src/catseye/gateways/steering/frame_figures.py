"""Figure of a telescope's frames with their axes at one posture."""

from typing import Any

import numpy as np

from catseye.constants import DEGREE
from catseye.gateways.steering.conversion_objects import words_of
from catseye.gateways.writers.drawing import BAD, FAINT, INK, SERIES, Figure, styled
from catseye.geometry.antenna.rigid_telescope import FRAMES
from catseye.reduction.steering.conversion import ConvertedPoints

AXIS = 11.0  # m, drawn length of an axis
AXIS_COLOURS = (SERIES[1], SERIES[2], SERIES[0])  # x, y, z
DISH = (4.0, 104.0)  # m from the vertex along y: section of the parent paraboloid that the dish is
NAMED = 12  # most points with names
TOGETHER = 0.5  # m: frames whose origins are nearer share a label


def frames_figure(conversion: ConvertedPoints) -> Figure:
    """Seven frames with their axes, dish and points: from the side, across the elevation axis, and from above."""
    telescope = conversion.telescope
    ground = {frame: telescope.ground_from(frame) for frame in FRAMES}
    along = ground["alidade"].rotation[:, 1]  # horizontal, towards which the telescope looks
    side, above = np.array([along, [0.0, 0.0, 1.0]]), np.eye(3)[:2]
    points = ground[conversion.transform.from_].points(conversion.before)
    y = np.linspace(*DISH, 60)
    dish = np.stack([np.zeros_like(y), y, y**2 / (4.0 * telescope.focal_length)], axis=-1)
    arm = np.array([ground["feed_arm"].translation, ground["prime_focus"].translation])
    with styled():
        figure = Figure(figsize=(10.4, 5.6), layout="constrained")
        panels = figure.subplots(1, 2)
        titles = ("From the side, across the elevation axis", "From above")
        for ax, view, title in zip(panels, (side, above), titles, strict=True):
            ax.plot(*(view @ ground["reflector"].points(dish).T), color=FAINT, lw=2.2, zorder=1)
            ax.plot(*(view @ arm.T), color=FAINT, lw=1.2, ls=":", zorder=1)
            for frame in FRAMES:
                _axes(ax, view, ground[frame].translation, ground[frame].rotation)
            _labels(ax, view, {frame: ground[frame].translation for frame in FRAMES})
            ax.plot(*(view @ points.T), "o", color=BAD, ms=4.5, zorder=6, ls="none")
            if len(points) <= NAMED:
                for name, place in zip(conversion.names, (view @ points.T).T, strict=True):
                    ax.annotate(name, place, xytext=(5, -10), textcoords="offset points", color=BAD, fontsize=7.5)
            ax.set_title(title)
            ax.set_aspect("equal", adjustable="datalim")
            ax.margins(0.12)
        panels[0].set_xlabel("horizontal, along the azimuth of the telescope (m)")
        panels[0].set_ylabel("z, ground (m)")
        panels[1].set_xlabel("x, ground: east (m)")
        panels[1].set_ylabel("y, ground: north (m)")
        for colour, axis in zip(AXIS_COLOURS, "xyz", strict=True):
            panels[1].plot([], [], color=colour, lw=1.6, label=f"{axis} axis, {AXIS:g} m")
        panels[1].plot([], [], color=FAINT, lw=2.2, label="dish in its plane of symmetry")
        panels[1].plot([], [], "o", color=BAD, ms=4.5, ls="none", label="points")
        figure.legend(loc="outside lower center", ncols=5)
        where = f"azimuth {telescope.azimuth / DEGREE:g}°, elevation {telescope.elevation / DEGREE:g}°"
        figure.suptitle(f"Frames at {where}" if conversion.posture_known else f"Frames, drawn at {where}", fontsize=10)
        return figure


def _axes(ax: Any, view: np.ndarray, origin: np.ndarray, rotation: np.ndarray) -> None:
    """Draw three axes from their origin; one towards the reader as a ring."""
    start = view @ origin
    for colour, axis in zip(AXIS_COLOURS, rotation.T, strict=True):
        tip = view @ (origin + AXIS * axis)
        if np.linalg.norm(tip - start) < 0.02 * AXIS:
            ax.plot(*start, "o", mfc="none", mec=colour, ms=8, mew=1.3, zorder=4)
            continue
        arrow: Any = {"arrowstyle": "-|>", "color": colour, "lw": 1.4, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 8}
        ax.annotate("", tip, xytext=start, arrowprops=arrow, zorder=4)
        ax.plot(*tip, alpha=0.0, marker=".")  # for the limits of the panel
    ax.plot(*start, ".", color=INK, ms=4, zorder=5)


def _labels(ax: Any, view: np.ndarray, origins: dict[str, np.ndarray]) -> None:
    """Name each frame at its origin; those that coincide in the view share a label."""
    places: list[tuple[np.ndarray, list[str]]] = []
    for frame, origin in origins.items():
        at = view @ origin
        near = [names for place, names in places if np.linalg.norm(place - at) < TOGETHER]
        if near:
            near[0].append(words_of(frame))
        else:
            places.append((at, [words_of(frame)]))
    for at, names in places:
        ax.annotate(", ".join(names), at, xytext=(-7, -12), textcoords="offset points", ha="right", fontsize=8)
