"""Charts of the report of panel setting."""

from typing import TYPE_CHECKING

import numpy as np

from catseye.gateways.writers.report import ChartBlock
from catseye.gateways.writers.report_parts import Axis, Chart, Coloured, categories
from catseye.reduction.panels.crew import members, sessions
from catseye.reduction.panels.heights import surface_rms

if TYPE_CHECKING:
    from catseye.reduction.panels.heights import PanelHeights
    from catseye.reduction.panels.job import PanelWork

INWARDS = 0.4  # of the way to the panel's middle, so that the corners of neighbours do not hide each other


def _stages(work: "PanelWork") -> list[tuple[str, "PanelHeights"]]:
    return [("as found", work.found)] + ([] if work.left is None else [("as left", work.left)])


def _plane(xy: np.ndarray) -> tuple[Axis, Axis]:
    return Axis("x", "m", xy[:, 0], digits=3), Axis("y from the vertex", "m", xy[:, 1], digits=3)


def corner_charts(work: "PanelWork") -> list[ChartBlock]:
    """Corners on the dish, their distances from the neighbours' mean, and the uncertainties, stage by stage."""
    blocks, goal = [], work.sheet.goal_um
    for name, heights in _stages(work):
        layout, known = heights.layout, np.isfinite(heights.relative)
        four = layout.xy[layout.quad]
        place = four + INWARDS * (four.mean(axis=1, keepdims=True) - four)
        value = heights.relative[known] * 1e6
        x, y = _plane(place[known])
        corners = np.array(layout.corners)[layout.quad][known]
        key = name.replace(" ", "-")
        size = Axis("distance from the mean of its neighbours", "µm", np.abs(value), digits=2)
        u = Axis("standard uncertainty of the distance", "µm", heights.u_relative[known] * 1e6, digits=2)
        above = Coloured("corner above the mean of its neighbours", "µm", value, 2)
        blocks += [
            ChartBlock(
                f"corners-{key}",
                Chart("map", x, y, value=above, names=corners.tolist()),
                f"Corners of the panels {name}: the height of a corner above the mean of those that meet there, which "
                "screws adjust. Marks lie inwards of the corner, each in its panel.",
            ),
            ChartBlock(
                f"distances-{key}", Chart("histogram", size, limits=(goal,)), f"Corners {name}; dashed: the goal."
            ),
            ChartBlock(
                f"uncertainties-{key}",
                Chart("histogram", u, limits=(goal,)),
                f"Standard uncertainties of the corners {name}; dashed: the goal.",
            ),
        ]
    return blocks


def surface_charts(heights: "PanelHeights") -> list[ChartBlock]:
    """Each panel's departure from the best fit, and the uncertainty of its piston."""
    rms, departures = surface_rms(heights, heights.departure)
    mean = departures.mean(axis=1)
    known = np.isfinite(mean)
    middle = heights.layout.xy[heights.layout.quad].mean(axis=1)
    panels = np.array(heights.layout.panels)
    x, y = _plane(middle[known])
    departure = Coloured("departure from the best fit, towards the focus", "µm", mean[known] * 1e6, 2)
    u_piston = heights.u_fit[:, 0] * 1e6
    usual = float(np.median(u_piston))
    u = Coloured("standard uncertainty of a panel's piston, from the median", "µm", u_piston - usual, 3)
    x_all, y_all = _plane(middle)
    return [
        ChartBlock(
            "surface",
            Chart("map", x, y, value=departure, names=panels[known].tolist()),
            "Each panel's mean departure from design and map, after the best shift and tilt of the complete dish, "
            f"which actuators adjust: {rms * 1e6:.0f} µm rms of corners.",
        ),
        ChartBlock(
            "surface-u",
            Chart("map", x_all, y_all, value=u, names=panels.tolist()),
            f"Standard uncertainty of its piston, {usual:.2f} µm in the median.",
        ),
    ]


def turning_charts(work: "PanelWork") -> list[ChartBlock]:
    """Achieved against requested change, and the scatter; none for a single table."""
    setting = work.setting
    if setting is None:
        return []
    demand, got = setting.wanted * 1e6, setting.got * 1e6
    remainder = got - setting.gain * demand
    x = Axis("requested change", "µm", demand, digits=2)
    return [
        ChartBlock(
            "turning",
            Chart("scatter", x, Axis("achieved change", "µm", got, digits=2)),
            "Effect of turning: change of relative heights between the two tables against the requested change; "
            f"achieved {setting.gain:.3f} of it.",
        ),
        ChartBlock(
            "turning-scatter",
            Chart("histogram", Axis("achieved minus expected", "µm", remainder, digits=2), limits=(0.0,)),
            f"Scatter of the corners about that, {setting.scatter * 1e6:.1f} µm rms.",
        ),
    ]


def control_charts(work: "PanelWork") -> list[ChartBlock]:
    """Scatter of the readings against the sheet's claim, by session and by member."""
    blocks = []
    for name, heights in _stages(work):
        for kind, readers in (("session", sessions(heights)), ("member", members(heights))):
            names = [r.name for r in readers]
            value = np.array([r.variance_factor for r in readers])
            known = np.isfinite(value)
            chosen = [n for n, k in zip(names, known, strict=True) if k]
            good = [0 if r.in_control else 1 for r, k in zip(readers, known, strict=True) if k]
            chart = Chart(
                "scatter",
                categories(kind, chosen),
                Axis("variance factor", "", value[known], digits=4),
                names=chosen,
                group=good,
                groups=("in control", "out of control"),
                limits=(1.0,),
            )
            text = f"Control chart, {kind}s {name}: scatter of the readings against the sheet's claim."
            blocks.append(ChartBlock(f"control-{kind}s-{name.replace(' ', '-')}", chart, text))
    return blocks
