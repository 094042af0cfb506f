"""Figures of retroreflectors as SVG text: return by angle, and aberration of a ball.

Source: [PARKER04] section 6.2.4; chapter 8 (reflected power by angle).
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from catseye.atmosphere.index.air import air
from catseye.constants import DEGREE
from catseye.errors import ValidityError
from catseye.gateways.writers.drawing import FAINT, SERIES, STYLE, Figure, Svg, mpl, svg
from catseye.names import NOTES_AIR_MODEL
from catseye.optics.glass import index_over_air
from catseye.optics.retroreflector import prism
from catseye.optics.retroreflector.cats_eye import BallCatsEye, focal_radius
from catseye.optics.retroreflector.kinds.ball import silvered
from catseye.optics.retroreflector.kinds.kind import DrawnSizes
from catseye.optics.retroreflector.kinds.prism import bare
from catseye.optics.retroreflector.kinds.registry import KINDS
from catseye.optics.retroreflector.solid_prism import SolidPrism

WIDTH, HEIGHT = 9.4, 4.6  # inches
POINTS = 361
FARTHEST_DEG = 90.0
RECEIVER, DISTANCES = 0.05, (18.0, 50.0, 120.0)  # m: the GBT's lens; its calibration range, and the telescope's


@dataclass(frozen=True)
class Dimensions:
    """Dimensions drawn; by default the GBT's targets, in the notes' air.

    height, aperture     m, of the prism; radius of its face and of the hollow cube's opening
    r1, r2               m, of the ball
    ball_aperture        m, radius of the ball's used aperture
    glass                a name in GLASSES
    vacuum_um            wavelength, um
    reflectance          of each mirror of the hollow cube and of the silvered ball
    """

    height: float = 0.0381
    aperture: float = 0.0254
    r1: float = 1.969 * 0.0254
    r2: float = 3.799 * 0.0254
    ball_aperture: float = 0.015
    glass: str = "BK7-old"
    vacuum_um: float = 0.780
    reflectance: float = 0.97

    def sizes(self) -> DrawnSizes:
        """Sizes in metres and indices over the notes' air."""
        about = air(20.0, 933.0, 50.0, wavelength_um=self.vacuum_um, model=NOTES_AIR_MODEL)
        n = index_over_air(self.vacuum_um, self.glass, air_phase=about.phase_index, air_group=about.group_index)
        return DrawnSizes(
            height=self.height,
            aperture=self.aperture,
            r1=self.r1,
            r2=self.r2,
            ball_aperture=self.ball_aperture,
            group=float(n.group),
            phase=float(n.phase),
            reflectance=self.reflectance,
        )


def return_plot(dimensions: Dimensions | None = None) -> tuple[Svg, dict[str, Any]]:
    """Return and range change by incidence for each kind, as SVG text and in numbers.

    dimensions   of the targets; the GBT's if None

    Source: the kinds of `optics.retroreflector.kinds`. Raises ValidityError for invalid
    sizes.
    """
    dimensions = dimensions or Dimensions()
    sizes = dimensions.sizes()
    solid, ball = bare(sizes), silvered(sizes)
    angles = np.linspace(0.0, FARTHEST_DEG, POINTS)
    incidence = angles * DEGREE
    kinds = sorted(KINDS.values(), key=lambda kind: kind.curves[0].colour)
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        figure = Figure(figsize=(WIDTH, HEIGHT), layout="constrained")
        share_axes, change_axes = figure.subplots(1, 2)
        half = {}
        for curve in (curve for kind in kinds for curve in kind.curves):  # their labels become keys of the summary
            share = curve.build(sizes).return_share(incidence, curve.azimuth)
            share_axes.plot(angles, share, curve.line, color=SERIES[curve.colour], lw=1.4, label=curve.label)
            half[curve.label.replace(" ", "_").replace(",", "")] = _falls_to_half(angles, share)
        share_axes.set(
            xlim=(0, FARTHEST_DEG), ylim=(0, 1), xlabel="incidence (°)", ylabel="share of the light on the face"
        )
        share_axes.set_title("Returned light")
        figure.legend(*share_axes.get_legend_handles_labels(), loc="outside lower left", ncols=3)
        drawn = incidence <= 45.0 * DEGREE
        _draw_change(change_axes, angles[drawn], incidence[drawn], solid, sizes)
        text = svg(figure)
    summary = {
        "half_of_normal_at_deg": half,
        "total_reflection_to_deg": solid.acceptance / DEGREE,
        "ball_whole_to_deg": ball.acceptance / DEGREE,
        "appendix_b_less_two_indices_at_30_deg": float(_appendix_b(sizes, solid, np.array(30.0 * DEGREE))),
    }
    return text, summary


def aberration_plot(dimensions: Dimensions | None = None, *, beam_radius: float = 0.010) -> tuple[Svg, dict[str, Any]]:
    """Range change, deviation and collected light of the ball, as SVG text and in numbers.

    dimensions    of the ball; the memo's if None
    beam_radius   1/e^2 radius of the beam at the ball, m, above 0

    Source: `optics.retroreflector.cats_eye`, exact rays. Raises ValidityError for invalid sizes.
    """
    if not 0.0 < beam_radius < np.inf:
        raise ValidityError(f"beam_radius = {beam_radius:g} m is not above 0 and finite")
    ball = silvered((dimensions or Dimensions()).sizes())
    focal = replace(ball, r2=float(focal_radius(ball.r1, ball.phase)))
    best = replace(ball, r2=ball.best_radius(beam_radius))
    curves = [("actual", ball, SERIES[0], "-"), ("best", best, SERIES[2], "--"), ("focal", focal, SERIES[1], "-")]
    heights = np.linspace(0.0, ball.aperture, POINTS)
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        figure = Figure(figsize=(WIDTH, HEIGHT), layout="constrained")
        path, bend, light = figure.subplots(1, 3)
        for name, one, colour, line in curves:
            label = f"R2 {one.r2 * 1e3:.2f} mm, {name}"
            path.plot(heights * 1e3, one.path_change(heights) * 1e6, line, color=colour, lw=1.4, label=label)
            bend.plot(heights * 1e3, one.deviation(heights) / DEGREE * 3600.0, line, color=colour, lw=1.4)
        weight = heights * np.exp(-2.0 * (heights / beam_radius) ** 2)
        for axes in (path, bend):
            axes.axhline(0.0, color=FAINT, lw=0.8)
            axes.set(xlabel="ray height (mm)", xlim=(0, ball.aperture * 1e3))
        low, high = path.get_ylim()
        level = low + 0.18 * (high - low) * weight / weight.max()
        path.fill_between(heights * 1e3, low, level, color=FAINT, alpha=0.25, lw=0, label="beam power")
        path.set(ylabel="to add to the range (µm)", ylim=(low, high))
        path.set_title("Path")
        bend.set_ylabel("convergence of the return (″)")
        bend.set_title("Deviation")
        figure.legend(*path.get_legend_handles_labels(), loc="outside lower center", ncols=4)
        collected = _draw_light(light, ball, beam_radius)
        text = svg(figure)
    summary = {
        "range_constant": ball.range_constant,
        "mean_path_change": ball.mean_path_change(beam_radius),
        "blur": ball.blur(beam_radius),
        "r2": ball.r2,
        "best_r2": best.r2,
        "focal_r2": focal.r2,
        "mean_path_change_at_best_r2": best.mean_path_change(beam_radius),
        "collected_share": collected,
    }
    return text, summary


def _falls_to_half(angles: Any, share: Any) -> float | None:
    """Angle where a share falls to half of its value at normal incidence; None if nowhere."""
    below = np.nonzero(share <= 0.5 * share[0])[0]
    if len(below) == 0:
        return None
    k = int(below[0])
    return float(np.interp(-0.5 * share[0], -share[k - 1 : k + 1], angles[k - 1 : k + 1]))


def _appendix_b(sizes: DrawnSizes, solid: SolidPrism, incidence: Any) -> Any:
    """Appendix B's change of range minus the rigorous one, m."""
    by_b = prism.obliquity_correction(sizes.height, solid.group, np.cos(incidence))
    return by_b - solid.range_change(incidence)


def _draw_change(ax: Any, angles: Any, incidence: Any, solid: SolidPrism, sizes: DrawnSizes) -> None:
    """Draw the prism's change of range, and appendix B's departure from it on a second axis."""
    change = solid.range_change(incidence) * 1e6
    ax.plot(angles, change, color=SERIES[1], lw=1.4, label="prism: two indices (left axis)")
    ax.axhline(0.0, color=SERIES[0], lw=1.4, label=_unchanged())
    ax.set(xlim=(0, 45), xlabel="incidence (°)", ylabel="to add to the range (µm)")
    ax.set_title("Change of range")
    second_axis = ax.twinx()
    second_axis.spines["right"].set_visible(True)
    second_axis.grid(visible=False)
    second_axis.plot(
        angles, _appendix_b(sizes, solid, incidence) * 1e6, ":", color=SERIES[3], lw=1.6,
        label="appendix B minus that (right axis)",
    )  # fmt: skip
    second_axis.set(ylabel="µm", ylim=(0.0, None))
    handles, labels = ax.get_legend_handles_labels()
    more, texts = second_axis.get_legend_handles_labels()
    ax.legend(handles + more, labels + texts, loc="center left")


def _unchanged() -> str:
    """Labels of the kinds whose range does not depend on the incidence, in the order of their colours."""
    kinds = sorted((kind for kind in KINDS.values() if not kind.is_oblique), key=lambda kind: kind.curves[0].colour)
    return ", ".join(kind.label for kind in kinds)


def _draw_light(ax: Any, ball: BallCatsEye, beam_radius: float) -> dict[str, float]:
    """Draw the share of the beam returned into the receiver by the mirror's radius; at R2, by distance."""
    focus = float(focal_radius(ball.r1, ball.phase))
    radii = np.linspace(min(0.96 * focus, 0.995 * ball.r2), max(1.01 * focus, 1.005 * ball.r2), 121)
    collected = {}
    for distance, colour in zip(DISTANCES, SERIES[2:], strict=False):
        at = {"beam_radius": beam_radius, "receiver": RECEIVER}
        shares = [replace(ball, r2=float(r2)).collected_share(distance, **at) for r2 in radii]
        ax.plot(radii * 1e3, shares, color=colour, lw=1.4, label=f"at {distance:g} m")
        collected[f"at_{distance:g}_m"] = ball.collected_share(distance, **at)
    ax.axvline(ball.r2 * 1e3, color=FAINT, lw=0.8, ls=":")
    ax.set(xlabel="R2 (mm)", ylabel=f"share within {RECEIVER * 1e3:g} mm, by rays", ylim=(0, 1.19))
    ax.set_title("Returned light")
    ax.legend(loc="upper center", ncols=3, handlelength=1.2, columnspacing=0.9)
    return collected
