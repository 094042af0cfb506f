"""Figures of triplets in use: the memo's figures 10 and 11 with a site's numbers, and a local net."""

from typing import Any

import numpy as np

from catseye.gateways.writers.drawing import BAD, FAINT, INK, SERIES, Figure, styled
from catseye.reduction.triplet.bounds import TripletBounds, effect_curves
from catseye.reduction.triplet.local_net import LocalNet
from catseye.reduction.triplet.reduced_ranges import ReducedTriplets

UM, MM = 1e6, 1e3


def reduced_figure(result: ReducedTriplets) -> Figure:
    """Figure 10 for one unit, and what its steps change in every pair."""
    with styled():
        figure = Figure(figsize=(9.6, 4.4), layout="constrained")
        scene, steps = figure.subplots(1, 2, width_ratios=(1.0, 1.15))
        _draw_unit(scene, result)
        _draw_steps(steps, result)
        return figure


def _draw_unit(ax: Any, result: ReducedTriplets) -> None:
    """One unit and the rangers in the plane of its prisms' line and its normal; the unit's own size is exaggerated."""
    unit, site = result.site.units[0], result.site
    plane = np.stack([unit.axis, unit.normal])
    scan = (site.scan - unit.prisms.mean(axis=0)) @ plane.T
    aim = plane @ (site.aim - unit.prisms.mean(axis=0))
    wide = 0.22 * float(np.abs(scan[:, 1]).max())
    prisms = np.array([[-wide, 0.0], [wide, 0.0]])
    ball = np.array([0.0, 0.4 * wide * (1.0 if unit.h_corr >= 0.0 else -1.0)])
    for number, (point, name) in enumerate(zip(scan, site.rangers, strict=True)):
        if not number:
            for end, label in ((prisms[0], "D₁"), (prisms[1], "D₂"), ((0.0, 0.0), "D_MP"), (ball, "D_BC")):
                dashes = "--" if label == "D_MP" else "-"
                ax.plot(
                    *zip(end, point, strict=True), dashes, color=SERIES[0] if label != "D_BC" else SERIES[1], lw=1.1
                )
            ax.annotate(f"S, {name}", point, (-7, 4), textcoords="offset points", ha="right", fontsize=8)
        ax.plot(*point, "s", color=INK if not number else FAINT, ms=4)
    ax.plot(*prisms.T, "-", color=FAINT, lw=2.0)
    ax.plot(*prisms.T, "^", color=SERIES[0], ms=8)
    ax.plot(0.0, 0.0, "+", color=INK, ms=9)
    ax.plot(*ball, "o", color=SERIES[1], ms=9)
    ax.annotate("", (0.0, 0.35 * aim[1]), (0.0, 0.0), arrowprops={"arrowstyle": "->", "color": SERIES[2], "lw": 1.4})
    ax.text(0.04 * wide, 0.36 * aim[1], "ê_TR", color=SERIES[2], fontsize=8.5)
    ax.plot(*aim, "x", color=BAD, ms=7)
    ax.annotate("A", aim, (-4, -13), textcoords="offset points", color=BAD, fontsize=8.5)
    for at, label, aside in ((prisms[0], f"{unit.name}-L, T₁", "right"), (prisms[1], "T₂", "left")):
        ax.annotate(label, at, (-8 if aside == "right" else 8, -4), textcoords="offset points", ha=aside, fontsize=8)
    ax.annotate("MP", (0.0, 0.0), (-8, 5), textcoords="offset points", ha="right", fontsize=8)
    ax.annotate(f"BC, H_corr {unit.h_corr * MM:+.3f} mm", ball, (9, -4), textcoords="offset points", fontsize=8)
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.12)
    ax.set_xlabel("along the prisms' line (m)")
    ax.set_ylabel("along the plate's normal (m)")
    ax.set_title(f"{unit.name} and the feed arm\nspacing and H_corr exaggerated")


def _draw_steps(ax: Any, result: ReducedTriplets) -> None:
    """Sizes of the corrections of all pairs against distance."""
    balls = result.balls
    far = balls.d_bc.ravel()
    offset = np.abs(balls.d_mp - balls.d_bc).ravel() * UM
    glass = np.abs(balls.obliquity).max(axis=-1).ravel() * UM
    series = np.abs(result.series - balls.d_mp).ravel() * UM
    drawn = (
        (offset, "o", "D_MP to D_BC: (e · n) H_corr"),
        (glass, "^", "dPc, oblique incidence"),
        (series, "D", "error of figure 10's series"),
    )
    for k, (values, mark, name) in enumerate(drawn):
        ax.plot(far, np.maximum(values, 1e-3), mark, color=SERIES[k], ms=4, label=name)
    if result.table is not None:
        ax.plot(far, result.u_d_bc.ravel() * UM, "_", color=INK, ms=7, label="u of D_BC")
    ax.set_yscale("log")
    ax.set_ylim(top=(ax.get_ylim()[1]) * 8.0)
    ax.set_xlabel("distance to the ball (m)")
    ax.set_ylabel("size (µm)")
    ax.set_title("Steps from prisms to ball\nevery triplet and ranger")
    ax.legend(loc="upper left", ncols=2, fontsize=7.5, handletextpad=0.3, columnspacing=1.0)


def bounds_figure(result: TripletBounds) -> Figure:
    """Figure 11 with the unit's numbers, and the three effects against the scan point's place."""
    with styled():
        figure = Figure(figsize=(9.6, 4.4), layout="constrained")
        scene, curves = figure.subplots(1, 2, width_ratios=(1.0, 1.3))
        _draw_triangle(scene, result)
        _draw_curves(curves, result)
        return figure


def _draw_triangle(ax: Any, result: TripletBounds) -> None:
    d = result.dimensions
    scale = 0.9 / max(d.d_12 / 2.0, abs(d.aside))
    t_1, t_2 = np.array([-0.5 * d.d_12 * scale, 0.0]), np.array([0.5 * d.d_12 * scale, 0.0])
    s, ball = np.array([d.aside * scale, 2.2]), np.array([0.5 * np.sign(d.along) * abs(t_2[0]), 0.0])
    for end, colour in ((t_1, SERIES[0]), (t_2, SERIES[0]), (ball, SERIES[1])):
        ax.plot(*zip(s, end, strict=True), color=colour, lw=1.1)
    ax.plot(*zip(s, (0.0, 0.0), strict=True), "--", color=SERIES[0], lw=1.1)
    ax.plot(*zip(t_1, t_2, strict=True), color=FAINT, lw=2.0)
    ax.plot(*zip(t_1, t_2, strict=True), "^", color=SERIES[0], ms=8)
    ax.plot(0.0, 0.0, "+", color=INK, ms=10)
    ax.plot(*ball, "o", color=SERIES[1], ms=8)
    ax.plot(*s, "s", color=INK, ms=5)
    ax.text(s[0], s[1] + 0.08, f"S, D₀ {d.distance:g} m", ha="center", fontsize=8.5)
    ax.text(t_1[0], -0.16, "T₁", ha="center", fontsize=8.5)
    ax.text(t_2[0], -0.16, "T₂", ha="center", fontsize=8.5)
    ax.text(0.0, -0.16, "MP", ha="center", fontsize=8.5)
    ax.text(ball[0], -0.16, f"BC, x {d.along * MM:g} mm", ha="center", color=SERIES[1], fontsize=8.5)
    ax.annotate("", (t_1[0], -0.34), (t_2[0], -0.34), arrowprops={"arrowstyle": "<->", "color": FAINT})
    ax.text(0.0, -0.5, f"D₁₂ {d.d_12 * MM:g} mm", ha="center", color=FAINT, fontsize=8.5)
    ax.set_xlim(-1.4, 1.4)
    ax.set_ylim(-0.65, 2.5)
    ax.set_axis_off()
    ax.set_title("Lateral shift of the ball's centre\nnot to scale")


def _draw_curves(ax: Any, result: TripletBounds) -> None:
    d, curves = result.dimensions, effect_curves(result)
    aside = curves["aside"] * MM
    bound = curves["bound"][0] * UM
    ax.axvspan(-500.0 * d.d_12, 500.0 * d.d_12, color="#f2f6f3", lw=0)
    ax.axhspan(-bound, bound, color="#e6eef6", lw=0, alpha=0.8)
    ax.axhline(bound, color=SERIES[0], lw=0.8, ls=":")
    ax.axhline(-bound, color=SERIES[0], lw=0.8, ls=":")
    for k, (name, label) in enumerate(
        (("along", "ball along the line"), ("across", "ball across, against height"), ("spacing", "spacing"))
    ):
        ax.plot(aside, curves[name] * UM, "--" if name == "across" else "-", color=SERIES[k], label=label)
    at = ((d.aside, result.cases[1].exact), (d.height, result.cases[2].exact), (d.aside, result.cases[0].exact))
    for k, (place, effect) in enumerate(at):
        ax.plot(place * MM, effect * UM, "o", color=SERIES[k], ms=5)
    top = 1.75 * max(bound, float(np.abs(curves["spacing"]).max()) * UM, 1e-3)
    ax.set_ylim(-top, top)
    ax.text(0.0, bound, f"A.8: {bound:.4g} µm", color=SERIES[0], fontsize=8, va="bottom", ha="center")
    ax.set_xlabel("scan point from the mid-point, along the line or up (mm)")
    ax.set_ylabel("effect on the range (µm)")
    ax.set_title("Effects of the three cases\nshaded: scan point between the prisms")
    ax.legend(loc="lower left", fontsize=8)


def net_figure(net: LocalNet) -> Figure:
    """Plan of a local net with its ranges, and the tests of the ranges."""
    with styled():
        figure = Figure(figsize=(9.6, 4.6), layout="constrained")
        plan, tests = figure.subplots(1, 2, width_ratios=(1.15, 1.0))
        _draw_plan(plan, net)
        _draw_tests(tests, net)
        return figure


def _draw_plan(ax: Any, net: LocalNet) -> None:
    row = {name: k for k, name in enumerate(net.points)}
    suspects = set(net.suspects)
    for k, observation in enumerate(net.observations):
        ends = net.x[[row[observation.ranger], row[observation.target]], :2]
        odd = k in suspects
        ax.plot(*ends.T, color=BAD if odd else FAINT, lw=1.4 if odd else 0.35, zorder=3 if odd else 1)
    rangers = len(net.site.rangers)
    balls = net.x[rangers + 2 :: 3]
    ax.plot(*net.x[:rangers, :2].T, "s", color=SERIES[1], ms=5, label="ranger of the feed arm", zorder=4)
    u = np.linalg.norm(net.u[rangers + 2 :: 3], axis=1) * UM
    ax.plot(*balls[:, :2].T, "o", color=SERIES[0], ms=6, label="triplet; u of its ball (µm)", zorder=4)
    centre = balls[:, :2].mean(axis=0)
    ax.plot(*(centre + 1.25 * (balls[:, :2] - centre)).T, alpha=0.0)  # room for the names
    for unit, place, size in zip(net.site.units, balls[:, :2], u, strict=True):
        out = place - centre
        out = 17.0 * out / (np.linalg.norm(out) or 1.0)
        ax.annotate(
            f"{unit.name}\n{size:.0f}",
            place,
            out,
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=7.5,
            bbox={"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none", "alpha": 0.75},
            zorder=5,
        )
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.16)
    ax.set_xlabel("x of the reflector's frame (m)")
    ax.set_ylabel("y (m)")
    ax.set_title("Local net, observation along the reflector's axis")
    ax.legend(loc="lower left", fontsize=7.5, frameon=True, framealpha=0.9, edgecolor="none")


def _draw_tests(ax: Any, net: LocalNet) -> None:
    w = np.array([observation.w for observation in net.observations])
    far = np.array([observation.distance for observation in net.observations])
    odd = np.isin(np.arange(len(w)), net.suspects)
    limit = net.critical
    for edge in (-limit, limit):
        ax.axhline(edge, color=BAD, lw=0.9, ls="--")
    ax.plot(far[~odd], w[~odd], "o", color=SERIES[0], ms=3.5)
    ax.plot(far[odd], w[odd], "o", color=BAD, ms=5)
    ax.text(far.max(), limit, f"limit {limit:.2f}", color=BAD, fontsize=8, ha="right", va="bottom")
    top = max(1.35 * limit, 1.1 * float(np.nanmax(np.abs(w))))
    ax.set_ylim(-top, top)
    ax.set_xlabel("range (m)")
    ax.set_ylabel("standardised residual w")
    ax.set_title("Tests of the ranges")
