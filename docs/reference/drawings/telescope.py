"""Frames of the telescope, drawn through the package's own transforms."""

import numpy as np
from ink import BLUE, GREEN, GREY, INK, RED, arc, arrow, distance, dot, sheet, towards, unit
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from catseye.geometry.antenna.frames import (
    ELEVATION_AXIS_HEIGHT,
    FEED_ARM_FOOT,
    FOCAL_LENGTH,
    alidade_from_elevation,
    ground_from_alidade,
    ground_from_reflector,
)

ELEVATION = 40.0  # degrees, as it is drawn
AZIMUTH = 50.0
NEAR, FAR = 4.0, 104.0  # m, edges of the aperture, y of the reflector frame


def side() -> Figure:
    """Telescope that looks north, from the east: y to the right, z up, x towards the viewer."""
    figure, axes = sheet((-78.0, -14.0), (100.0, 168.0), width=5.4)
    carried = ground_from_reflector(0.0, np.radians(ELEVATION))
    tipped = alidade_from_elevation(np.radians(ELEVATION), elevation_axis_height=ELEVATION_AXIS_HEIGHT)

    def place(x):
        return np.asarray(carried.points(x))[..., 1:]

    axis = np.array([0.0, ELEVATION_AXIS_HEIGHT])
    axes.plot([-76, 98], [0, 0], color=GREY, lw=1.2)
    axes.add_patch(Polygon([(-19, 0), (19, 0), axis], fc="#f2f2f2", ec=GREY))
    y = np.linspace(NEAR, FAR, 60)
    dish = np.stack([0.0 * y, y, y * y / (4.0 * FOCAL_LENGTH)], axis=-1)
    axes.plot(*place(dish).T, color=INK, lw=2.6)
    whole = np.linspace(-14.0, NEAR, 20)
    axes.plot(*place(np.stack([0.0 * whole, whole, whole**2 / 240.0], axis=-1)).T, color=GREY, lw=1.0, ls="--")
    focus, vertex, foot = place([0.0, 0.0, FOCAL_LENGTH]), place([0.0, 0.0, 0.0]), place(FEED_ARM_FOOT)
    sub = place([0.0, -3.0, FOCAL_LENGTH + 4.5])
    axes.plot(
        *np.transpose([place([0.0, NEAR, 0.1]), foot, place([0.0, -8.0, 56.0]), sub]), color=GREY, lw=4.0, alpha=0.45
    )

    dot(axes, (0, 0))
    arrow(axes, (0, 0), (40, 0), "y north", colour=GREEN, away=14)
    towards(axes, (0, 0), "x east", viewer=True, shift=(-17, -8), colour=GREEN)
    arrow(axes, (0, 0), (0, 30), "z", colour=GREEN, away=6)
    axes.text(0, -9, "ground, alidade", ha="left", va="center", color=GREEN, style="italic")
    for name, origin, length, shift in (("elevation", axis, 24.0, (20, -7)), ("reflector", vertex, 26.0, (-22, -6))):
        frame = tipped if name == "elevation" else carried
        for along, label in (((0, 1, 0), "y"), ((0, 0, 1), "z")):
            arrow(axes, origin, length * np.asarray(frame.directions(along))[1:], label, colour=RED, away=5.5)
        dot(axes, origin, colour=RED)
        axes.text(origin[0] + shift[0], origin[1] + shift[1], name, color=RED, style="italic", ha="center", va="center")
    axes.plot(*np.transpose([vertex, focus]), color=GREY, lw=0.9, ls=":")
    dot(axes, focus, "prime focus", colour=BLUE, shift=(25, -1))
    dot(axes, foot, "feed arm", colour=BLUE, shift=(-18, 4))
    dot(axes, sub, "subreflector", colour=BLUE, shift=(2, 10))
    distance(axes, (-62, 0), (-62, ELEVATION_AXIS_HEIGHT), "48.260 m", shift=(19.0, 0.0))
    axes.plot([-62, 0], [ELEVATION_AXIS_HEIGHT] * 2, color=BLUE, lw=0.5, ls=":")
    axes.plot([0, 60], [ELEVATION_AXIS_HEIGHT] * 2, color=GREY, lw=0.8, ls="--")
    arc(axes, axis, 36.0, 0.0, ELEVATION, "elevation", out=1.36)
    axes.text(*(0.5 * (vertex + focus) + [14, -10]), "f = 60 m", color=BLUE, ha="center", va="center")
    return figure


def azimuth() -> Figure:
    """Alidade from above: y of the alidade at the azimuth, clockwise from north."""
    figure, axes = sheet((-2.2, -2.1), (4.2, 2.9), width=4.2)
    carried = ground_from_alidade(np.radians(AZIMUTH))
    arrow(axes, (0, 0), (0, 2.2), "y north", colour=GREEN, away=0.3)
    arrow(axes, (0, 0), (2.2, 0), "x east", colour=GREEN, away=0.55)
    for along, label in (((1, 0, 0), "x alidade"), ((0, 1, 0), "y alidade")):
        direction = np.asarray(carried.directions(along))[:2]
        arrow(axes, (0, 0), 1.9 * direction, label, colour=RED, away=0.3 if label[0] == "x" else 0.55)
    arc(axes, (0, 0), 1.1, 90.0, 90.0 - AZIMUTH, "azimuth", colour=RED, out=1.25, at=66)
    towards(axes, (0, 0), "z up", viewer=True, shift=(-0.5, -0.25))
    axes.add_patch(Polygon([0.25 * unit(a) for a in range(0, 360, 15)], fc="none", ec=GREY))
    return figure


DRAWINGS = {"frames-side": side, "frames-azimuth": azimuth}
