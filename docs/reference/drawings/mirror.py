"""Axes of a ranger's mirror: angles, scan point, offsets, counts."""

import numpy as np
from ink import BLUE, GREEN, GREY, INK, RED, arc, arrow, distance, dot, sheet, towards, unit
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle

from catseye.geometry.mirror.mount import lambda_

PHI, THETA = 70.0, 50.0  # degrees, as they are drawn
LARGE = np.radians(12.0)


def elevation() -> Figure:
    """Plane of the beam at Theta = 0: z to the right, x up, y towards the viewer."""
    figure, axes = sheet((-2.7, -2.2), (4.4, 3.3))
    axes.add_patch(Rectangle((3.0, -0.45), 1.25, 0.9, fc="#f2f2f2", ec=GREY))
    axes.text(3.62, 0.0, "laser,\ndetector", ha="center", va="center")
    along = unit(0.5 * PHI + 90.0)
    axes.plot(*np.transpose([-1.1 * along, 1.1 * along]), color=INK, lw=3.0)
    axes.plot(
        *np.transpose([-1.1 * along - 0.09 * unit(0.5 * PHI), 1.1 * along - 0.09 * unit(0.5 * PHI)]), color=GREY, lw=2.0
    )
    axes.plot([0.0, 3.0], [0.0, 0.0], color=RED, lw=1.8)
    arrow(axes, (0, 0), 2.7 * unit(PHI), "beam", colour=RED, away=0.3)
    arrow(axes, (0, 0), 1.9 * unit(0.5 * PHI), "normal", colour=GREY, width=1.0, away=0.45)
    axes.plot([-2.2, 0.0], [0.0, 0.0], color=GREEN, lw=0.9, ls="-.")
    arrow(axes, (0, 0), (2.6, 0), "", colour=GREEN)
    axes.text(2.55, -0.33, r"$\tilde{z}$", color=GREEN)
    arrow(axes, (0, 0), (0, 2.5), r"$\tilde{x}$", colour=GREEN, away=0.3)
    towards(axes, (0, 0), "", viewer=True, colour=GREEN)
    axes.text(-0.2, -0.42, r"S, $\tilde{y}$", color=GREEN, ha="right")
    arc(axes, (0, 0), 1.35, 0.0, PHI, r"$\Phi$", out=1.18, at=52)
    arc(axes, (0, 0), 0.75, 0.0, 0.5 * PHI, r"$\Phi/2$", colour=BLUE, out=1.5)
    cube = 2.2 * unit(-128.0)
    axes.plot(*np.transpose([(0, 0), cube]), color=BLUE, lw=1.0, ls=":")
    axes.add_patch(Polygon([cube + 0.2 * unit(a) for a in (45, 135, 225, 315)], fc="white", ec=BLUE))
    axes.text(*np.add(cube, [1.0, 0.1]), "cube ZRG", color=BLUE, ha="center", va="center")
    axes.text(*(0.55 * cube + [-0.35, 0.12]), r"$D_0$", color=BLUE, ha="center", va="center")
    axes.text(-2.6, 0.2, "azimuth axis", color=GREEN, ha="left", va="center")
    return figure


def azimuth() -> Figure:
    """Against the azimuth axis, from the laser: x to the right, y up, z towards the viewer."""
    figure, axes = sheet((-3.2, -2.9), (3.5, 2.9))
    axes.add_patch(Circle((0, 0), 1.9, fc="none", ec=GREY))
    arrow(axes, (0, 0), (2.4, 0), r"$\tilde{x}$", colour=GREEN, away=0.3)
    arrow(axes, (0, 0), (0, 2.4), r"$\tilde{y}$", colour=GREEN, away=0.3)
    towards(axes, (0, 0), r"$\tilde{z}$", viewer=True, shift=(-0.35, -0.3), colour=GREEN)
    arrow(axes, (0, 0), 1.9 * unit(THETA), "", colour=RED)
    axes.text(*(2.15 * unit(THETA) + [0.35, 0.0]), "beam", color=RED, ha="center", va="center")
    arc(axes, (0, 0), 1.0, 0.0, THETA, r"$\Theta$", out=1.3)
    for angle, text, shift in (
        (0.0, r"$N_{a0}$", (0.05, -0.3)),
        (90.0, r"$N_{a0}+25\,000$", (-1.0, 0.22)),
        (180.0, r"$N_{a0}+50\,000$", (-0.2, 0.28)),
    ):
        dot(axes, 1.9 * unit(angle), text, colour=BLUE, shift=shift, size=4)
    axes.plot(*np.transpose([1.65 * unit(-90), 2.15 * unit(-90)]), color=INK, lw=3.0)
    axes.text(0.0, -2.45, r"stops near $\Theta = -\pi/2$", ha="center", va="center")
    return figure


def offsets() -> Figure:
    """Mount from the side: z to the right, y up, x away from the viewer."""
    figure, axes = sheet((-1.7, -1.1), (4.9, 3.9))
    axes.add_patch(Rectangle((-0.8, -0.55), 4.6, 0.22, fc="#f2f2f2", ec=GREY))
    for place in ((0.0, -0.14), (3.0, -0.14)):
        axes.add_patch(Circle(place, 0.19, fc="#bcd3ea", ec=BLUE))
    axes.text(3.0, -0.82, "v-block", ha="center")
    axes.text(0.0, -0.82, "fixed point", ha="center")
    scan = np.array([0.9, 2.4])
    dot(axes, (0, -0.14), colour=BLUE)
    arrow(axes, (0, -0.14), (2.35, 0), r"$\hat{z}$", colour=GREEN, away=0.22)
    arrow(axes, (0, -0.14), (0, 3.4), r"$\hat{y}$", colour=GREEN, away=0.25)
    towards(axes, (0, -0.14), r"$\hat{x}$", viewer=False, shift=(-0.4, 0.15), colour=GREEN)
    down = lambda_(LARGE, 0.0)[2]  # z of the mirror's axes in the mount's
    arrow(axes, scan, 2.6 * np.array([down[2], down[1]]), r"$\tilde{z}$", colour=RED, away=0.25)
    axes.text(2.1, 1.75, "azimuth axis", color=RED, ha="center", rotation=-12)
    axes.plot([scan[0], scan[0] + 2.7], [scan[1], scan[1]], color=GREY, lw=0.9, ls="--")
    arc(axes, scan, 2.0, 0.0, -np.degrees(LARGE), r"$\beta_1$", out=1.16)
    dot(axes, scan, "S, scan point", colour=RED, shift=(0.2, 0.3))
    distance(axes, (scan[0], 1.1), (0.0, 1.1), r"$\Delta z$", shift=(0.0, 0.2))
    axes.plot([scan[0]] * 2, [1.0, scan[1]], color=BLUE, lw=0.5, ls=":")
    distance(axes, (-0.75, -0.14), (-0.75, scan[1]), r"$\Delta y$", shift=(-0.35, 0.0))
    axes.plot([-0.85, scan[0]], [scan[1]] * 2, color=BLUE, lw=0.5, ls=":")
    return figure


def errors() -> Figure:
    """Offsets of the axes and the face in the plane of the beam, drawn large."""
    figure, axes = sheet((-1.9, -1.7), (4.4, 3.1))
    e, s, half = 0.75, 0.5, 35.0
    axes.plot([-1.6, 4.0], [0, 0], color=GREEN, lw=1.0, ls="-.")
    axes.text(4.05, -0.3, "azimuth axis", color=GREEN, ha="right")
    shaft = np.array([0.0, e])
    dot(axes, shaft, colour=BLUE)
    axes.text(-1.75, e, "elevation\naxis", color=BLUE, ha="left", va="center")
    face = shaft + s * unit(half)
    along = unit(half + 90.0)
    axes.plot(*np.transpose([face - 1.6 * along, face + 1.2 * along]), color=INK, lw=3.0)
    arrow(axes, shaft, 1.5 * unit(half), "", colour=GREY, width=1.0)
    axes.text(0.62, 1.95, "normal", color=GREY, ha="center")
    distance(axes, (0, 0), shaft, "e", shift=(-0.2, 0.0))
    axes.text(*(shaft + 0.5 * s * unit(half) + [0.03, -0.2]), "s", color=BLUE, ha="center", va="center")
    dot(axes, (0, 0), "S", shift=(-0.05, -0.3))
    hit = (face @ unit(half)) / unit(half)[0]
    axes.plot([4.0, hit], [0, 0], color=RED, lw=1.8)
    arrow(axes, (hit, 0), 2.7 * unit(2 * half), "beam", colour=RED, away=0.3)
    arrow(axes, (0, 0), (0, 2.6), r"$\mathbf{h}$", colour=GREEN, away=0.25)
    return figure


DRAWINGS = {"mirror-phi": elevation, "mirror-theta": azimuth, "mirror-offsets": offsets, "mirror-errors": errors}
