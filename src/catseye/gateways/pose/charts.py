"""Scene and charts of the reports on poses, pointing series and track profiles."""

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE, TWO_PI
from catseye.gateways.writers.report import Block, ChartBlock, SceneBlock
from catseye.gateways.writers.report_parts import Axis, Chart, Coloured, ReportTable, Scene, categories, number, text
from catseye.reduction.pose.findings import PoseFindings
from catseye.reduction.pose.pointing_fit import PointingFit
from catseye.reduction.pose.pointing_offsets import PointingOffset
from catseye.reduction.pose.track_profile import TrackProfile

SHARE = 0.12  # length of the largest residual as drawn, share of the group's size
TITLES = ("azimuth times cos E", "elevation")
RIGHT = 0.5 * np.pi
SMALLEST = 1e-9  # m, of a residual that is drawn
GRID = 121  # points of a curve


def pose_blocks(result: PoseFindings) -> list[Block]:
    """Scene of the residuals, and residuals by point along each axis."""
    pose, places = result.pose.pose, result.pose.places
    residual = pose.motion.residual
    largest = float(np.linalg.norm(residual, axis=1).max(initial=0.0))
    size = max(float(np.ptp(places, axis=0).max(initial=0.0)), 1e-3)
    stretch = SHARE * size / largest if largest > SMALLEST else 0.0
    scene = Scene(
        frame=f"{pose.frame}: x, y, z",
        names=[*pose.names, "pivot"],
        x=np.vstack([places, pose.pivot]),
        groups=("point", "pivot"),
        group=[0] * len(pose.names) + [1],
        info=[f"residual {' / '.join(f'{v / MILLIMETRE:+.3f}' for v in r)} mm" for r in residual] + [""],
        lines={
            f"residual of {name}": np.stack([place, place + stretch * r])
            for name, place, r in zip(pose.names, places, residual, strict=True)
            if stretch
        },
    )
    names = np.repeat(pose.names, 3).tolist()
    chart = Chart(
        "scatter",
        categories("point", names),
        Axis("residual", "mm", residual.ravel() / MILLIMETRE, digits=5),
        names=names,
        group=np.tile(np.arange(3), len(pose.names)),
        groups=tuple("xyz"),
        limits=(0.0,),
    )
    enlarged = f", drawn {stretch:.2g} times as long" if stretch else ""
    moved = "Residuals of the points: second position minus first position moved by the pose"
    return [
        SceneBlock("residuals", scene, f"{moved}{enlarged}."),
        ChartBlock("residuals", chart, "The same along each axis of the frame."),
    ]


def residual_table(result: PoseFindings) -> ReportTable:
    """Place, residual and w of each point."""
    pose, places = result.pose.pose, result.pose.places
    residual = pose.motion.residual / MILLIMETRE
    return ReportTable(
        (
            text("point", "point", pose.names),
            *(number(axis, axis, places[:, k], "m", 5) for k, axis in enumerate("xyz")),
            *(number(f"residual_{axis}", f"residual {axis}", residual[:, k], "mm", 3) for k, axis in enumerate("xyz")),
            number("w", "w", pose.w, digits=2),
        ),
        "point",
    )


def terms_charts(beam: PointingOffset) -> list[ChartBlock]:
    """Each term's part of azimuth times cos E and of elevation, and the sum with its u."""
    names = (*beam.terms, "together")
    blocks = []
    for axis, title in enumerate(TITLES):
        values = np.array([*(part[axis] for part in beam.terms.values()), beam.offset[axis]]) / ARCSECOND
        u = np.full(len(names), np.nan)
        u[-1] = np.sqrt(max(beam.covariance[axis, axis], 0.0)) / ARCSECOND
        x = Axis("term", "", np.arange(len(names)), names, digits=0)
        chart = Chart("bars", x, Axis("offset of the beam", "″", values, digits=4), u=u, names=names)
        caption = f"Terms of the pointing offset, {title}; a correction is its opposite."
        blocks.append(ChartBlock(f"terms-{title.split()[0]}", chart, caption))
    return blocks


def fit_charts(fit: PointingFit) -> list[ChartBlock]:
    """Residuals of a pointing fit by azimuth and elevation, and on the sky."""
    residual = fit.residual / ARCSECOND
    azimuth = Axis("azimuth", "°", np.mod(fit.azimuth, TWO_PI) / DEGREE, digits=3)
    elevation = Axis("elevation", "°", fit.elevation / DEGREE, digits=3)
    group, groups = np.where(fit.used, 0, 1), ("used", "excluded")
    zenith = (RIGHT - fit.elevation) / DEGREE
    east = Axis("towards the east", "° from the zenith", zenith * np.sin(fit.azimuth), digits=3)
    north = Axis("towards the north", "° from the zenith", zenith * np.cos(fit.azimuth), digits=3)
    turn = np.linspace(0.0, TWO_PI, GRID)
    rings = [ring * np.column_stack([np.cos(turn), np.sin(turn)]) for ring in (30.0, 60.0, 90.0)]
    blocks = []
    for axis, title in enumerate(TITLES):
        y, key = Axis(f"residual, {title}", "″", residual[:, axis], digits=4), title.split()[0]
        sky = Coloured(f"residual, {title}", "″", residual[:, axis], 4)
        for word, x in (("azimuth", azimuth), ("elevation", elevation)):
            chart = Chart("scatter", x, y, group=group, groups=groups, limits=(0.0,))
            blocks.append(ChartBlock(f"{key}-by-{word}", chart, f"Residuals, {title}, by {word}."))
        drawn = Chart("map", east, north, value=sky, outline=rings)
        caption = f"The same on the sky, the zenith in the middle; rings at 60°, 30° and 0° elevation: {title}."
        blocks.append(ChartBlock(f"{key}-sky", drawn, caption))
    return blocks


def correlation_table(fit: PointingFit) -> ReportTable:
    """Correlations of the terms."""
    terms = fit.series.terms
    columns = (number(f"r_{k + 1}", term, fit.correlation[:, k], digits=2) for k, term in enumerate(terms))
    return ReportTable((text("term", "term", terms), *columns))


def track_charts(profile: TrackProfile, caption: str) -> list[ChartBlock]:
    """Tilt by azimuth with its u, and residuals of poses and inclinometer."""
    azimuth = np.linspace(0.0, TWO_PI, GRID)
    tilt, spread = profile.series.at(azimuth)
    u = np.sqrt(np.maximum(np.diagonal(spread, axis1=1, axis2=2), 0.0)) / ARCSECOND
    turn = Axis("azimuth", "°", np.tile(azimuth / DEGREE, 2), digits=2)
    chart = Chart(
        "line",
        turn,
        Axis("tilt of the alidade", "″", tilt[:, :2].T.ravel() / ARCSECOND, digits=4),
        u=u[:, :2].T.ravel(),
        group=np.repeat((0, 1), GRID),
        groups=("about east", "about north"),
        limits=[float(v) / ARCSECOND for v in profile.series.values[:2]],
    )
    count = len(profile.azimuth)
    pose = np.where(np.arange(count) < profile.poses, 1, 0)
    x = Axis("azimuth", "°", np.mod(profile.azimuth, TWO_PI) / DEGREE, digits=3)
    return [ChartBlock("tilt", chart, caption)] + [
        ChartBlock(
            f"residual-{name}",
            Chart(
                "scatter",
                x,
                Axis(f"residual about {name} of the alidade", "″", profile.residual[:, axis] / ARCSECOND, digits=4),
                group=pose,
                groups=("inclinometer", "poses"),
                limits=(0.0,),
            ),
            f"Residuals of poses and inclinometer about {name}.",
        )
        for axis, name in enumerate("xy")
    ]
