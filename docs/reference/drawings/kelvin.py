"""The Kelvin mount: which point is fixed, its axes, its three angles."""

import numpy as np
from ink import BLUE, GREEN, GREY, INK, RED, arc, arrow, dot, sheet, towards, unit
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

from catseye.geometry.mirror.mount import gamma

AZIMUTH = 122.2  # degrees, of the line from the fixed point to the v-block: that of ZY3
LARGE = np.radians(14.0)  # tilts as they are drawn


def axis_angles(alpha1: float) -> tuple[float, float]:
    """Directions of x and z of a level mount on a map, degrees from east, counter-clockwise."""
    x, _, z = gamma(alpha1, 0.0, 0.0)
    return float(np.degrees(np.arctan2(x[1], x[0]))), float(np.degrees(np.arctan2(z[1], z[0])))


def plan() -> Figure:
    """Mount from above."""
    figure, axes = sheet((-3.1, -3.0), (4.1, 2.9))
    x_angle, z_angle = axis_angles(np.pi - np.radians(AZIMUTH))
    x, z = unit(x_angle), unit(z_angle)
    groove, flat = 2.1 * z, 1.05 * z + 1.45 * x
    corners = [-0.7 * z - 0.6 * x, 2.8 * z - 0.6 * x, 2.8 * z + 2.0 * x, -0.7 * z + 2.0 * x]
    axes.add_patch(Polygon(corners, fc="#f2f2f2", ec=GREY))
    axes.add_patch(Polygon([groove - 0.5 * z - 0.13 * x, groove + 0.5 * z - 0.13 * x, groove + 0.5 * z + 0.13 * x,
                            groove - 0.5 * z + 0.13 * x], fc="white", ec=INK))  # fmt: skip
    axes.plot(*np.transpose([groove - 0.5 * z, groove + 0.5 * z]), color=INK, lw=0.8)
    axes.add_patch(Circle((0.0, 0.0), 0.3, fc="white", ec=INK))
    axes.add_patch(
        Polygon([flat + 0.3 * (a * x + b * z) for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))], fc="white", ec=INK)
    )
    for place in ((0.0, 0.0), groove, flat):
        axes.add_patch(Circle(place, 0.17, fc="#bcd3ea", ec=BLUE, zorder=3))
    axes.text(-1.65, 0.35, "fixed point\n(cone)", ha="center", va="center")
    axes.text(*(groove - 1.0 * x + 0.1 * z), "v-block", ha="center", va="center")
    axes.text(*(flat + 0.55 * z + 0.2 * x), "flat", ha="center", va="center")
    arrow(axes, (0, 0), 3.1 * z, r"$\hat{z}$", colour=GREEN, away=0.3)
    arrow(axes, (0, 0), 2.6 * x, r"$\hat{x}$", colour=GREEN, away=0.3)
    towards(axes, (0, 0), r"$\hat{y}$ up", viewer=True, shift=(-0.62, -0.32), colour=GREEN)
    arrow(axes, (0, 0), (0, 2.3), "north, y", colour=GREY, width=1.0, away=0.3)
    axes.plot([0, 0], [0, -2.5], color=GREY, lw=1.0, ls="--")
    axes.text(0, -2.75, "south", color=GREY, ha="center")
    arc(axes, (0, 0), 1.95, 90, z_angle, "azimuth", out=1.3, at=70)
    arc(axes, (0, 0), 1.3, -90, z_angle, r"$\alpha_1$", out=1.2)
    return figure


def tilts() -> Figure:
    """Both tilts of the mount, positive."""
    figure, axes = sheet((-0.4, -1.5), (7.0, 3.7))
    x = gamma(0.0, LARGE, 0.0)[0]
    z = gamma(0.0, 0.0, LARGE)[2]
    for base, along, horizontal, name, text in (
        (np.array([0.0, 2.2]), np.array([x[0], x[2]]), r"$\hat{x}$", r"$\alpha_2$", r"$\alpha_2 > 0$: $\hat{x}$ rises"),
        (
            np.array([0.0, 0.4]),
            np.array([-z[1], z[2]]),
            r"$\hat{z}$",
            r"$\alpha_3$",
            r"$\alpha_3 > 0$: $\hat{z}$ sinks",
        ),
    ):
        axes.plot([0.0, 3.6], [base[1], base[1]], color=GREY, lw=1.0, ls="--")
        arrow(axes, base, 3.4 * along, horizontal, colour=GREEN, away=0.3)
        angle = float(np.degrees(np.arctan2(along[1], along[0])))
        arc(axes, base, 2.3, 0.0, angle, name, out=1.16)
        dot(axes, base, colour=BLUE, size=7)
        axes.text(4.25, base[1] + (0.45 if along[1] > 0 else -0.45), text, ha="left", va="center", color=RED)
    axes.text(0.0, 3.35, "seen against the other axis; dashed: level", ha="left", va="center", color=GREY)
    axes.text(0.0, -1.2, "the fixed point stays where it is", ha="left", va="center", color=BLUE)
    return figure


DRAWINGS = {"kelvin-plan": plan, "kelvin-tilts": tilts}
