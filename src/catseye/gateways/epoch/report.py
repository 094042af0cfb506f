"""Report of a reduction."""

from collections import Counter
from datetime import datetime

import numpy as np

from catseye.aliases import Progress
from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.gateways.detection.night_harmonics import harmonics_chart, shots_with_harmonics
from catseye.gateways.epoch.objects import matrix_file
from catseye.gateways.epoch.record_section import checks_section, records_section, scatter_blocks
from catseye.gateways.epoch.record_tests import listed_tests, worst_of_all
from catseye.gateways.epoch.report_air import air_section
from catseye.gateways.epoch.report_charts import (
    dish_chart,
    network_scene,
    residual_charts,
    zeros_chart,
)
from catseye.gateways.epoch.summary import feed_arm_rows, passages, pointing
from catseye.gateways.epoch.tables import PointRows, PrismRows, kinds_of
from catseye.gateways.epoch.third_order import third_order_sections
from catseye.gateways.epoch.ways import dish_estimates
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.report import (
    Block,
    Card,
    ChartBlock,
    ReportSection,
    ResultReport,
    SceneBlock,
    TableBlock,
    Text,
    origin_section,
)
from catseye.gateways.writers.report_parts import ReportTable, number, pairs, text, uncertainty
from catseye.reduction.epoch.epoch import Reduction
from catseye.reduction.epoch.reason import ShotStatus
from catseye.reduction.epoch.surface import UNOBSERVED
from catseye.reduction.epoch.verdict import factor_spread
from catseye.signal.detection.harmonics import DISTORTED


def reduction_report(reduction: Reduction, when: datetime, progress: Progress | None = None) -> ResultReport:
    """Report of a reduction; `progress` is called for the dish's pose."""
    if progress is not None:
        progress("page: dish pose by each command", 0, 1)
    name = reduction.campaign.site.campaign.name
    return ResultReport(
        title=f"{name}: coordinates, pose and surface",
        subtitle=(
            f"from {len(reduction.campaign.shots)} shots in {reduction.campaign.directory.resolve().name}/, reduced by "
            f"catseye on {when:%Y-%m-%d %H:%M} UTC; lengths in the ground frame (x east, y north, z up), u = standard "
            "uncertainty, 1σ"
        ),
        verdict=reduction.verdict,
        cards=_cards(reduction),
        passages=[p for p in passages(reduction) if p.title != "Notes"] + [Passage("Note", n) for n in reduction.notes],
        sections=[
            _feed_arm(reduction),
            _dish(reduction),
            *third_order_sections(reduction),
            _network(reduction),
            records_section(reduction),
            _residuals(reduction),
            _rejected(reduction),
            _rangers(reduction),
            air_section(reduction),
            checks_section(reduction),
            _points(reduction),
            _shots(reduction),
            _provenance(reduction, when),
        ],
        label=f"catseye: {name}",
    )


def _cards(reduction: Reduction) -> list[Card]:
    coordinates, surface = reduction.coordinates, reduction.surface
    count, rows = Counter(reduction.status), feed_arm_rows(reduction)
    spread = factor_spread(reduction.coordinates.degrees_of_freedom)
    rejected = f"{len(reduction.rejected)} of all shots rejected, each with its reason"
    cards = [Card("Ranges used", f"{count[ShotStatus.USED]}", rejected)]
    if rows:
        worst = max(float(np.max(u)) for _, _, u in rows)
        cards.append(Card("Feed arm uncertainty", f"{worst:.2f} mm", "largest u of a coordinate of its rangers"))
    if surface is not None:
        u = float(np.median(surface.u_deviation)) / MILLIMETRE
        tilt = float(np.linalg.norm(surface.fit.rotation)) / ARCSECOND
        moved = float(np.linalg.norm(surface.fit.translation)) / MILLIMETRE
        prisms = f"{surface.count_text}, u {u:.3f} mm each"
        cards += [
            Card("Surface", f"{surface.rms / MILLIMETRE:.3f} mm rms", prisms),
            Card("Dish off nominal", f"{moved:.1f} mm, {tilt:.1f}″", "shift of the vertex, tilt of the axis"),
        ]
    expected = f"expected 1 ± {_number(spread, 2)}, {coordinates.degrees_of_freedom:.0f} degrees of freedom"
    mean = "group, mean over the used paths"
    return [
        *cards,
        *_record_cards(reduction),
        Card("Variance factor", _number(coordinates.variance_factor, 2), expected),
        Card("Refractivity", f"{_number(coordinates.refractivity_ppm, 2)} ppm", mean),
    ]


def _record_cards(reduction: Reduction) -> list[Card]:
    """Contradicted records and unchecked points."""
    coordinates, cards = reduction.coordinates, []
    worst = worst_of_all(listed_tests(coordinates))
    if worst is not None:
        count = len(coordinates.contradictions)
        remark = f"between records and ranges; the largest |w| of a record is {abs(worst.w):.1f}"
        cards.append(Card("Contradictions", f"{count}" if count else "none", remark))
    if coordinates.unchecked:
        cards.append(
            Card(
                "Unchecked points",
                f"{len(coordinates.unchecked)}",
                "an error of one line or survey could move them unseen",
            )
        )
    return cards


def _feed_arm(reduction: Reduction) -> ReportSection:
    rows = feed_arm_rows(reduction)
    if not rows:
        return ReportSection("feed-arm", "Feed arm", [Text("No ranger on the feed arm was seen.")])
    columns = (text("point", "ranger"), *_xyz(), *_u_xyz())
    table = ReportTable.of_rows([(name, *x, *u) for name, x, u in rows], *columns, name="point")
    text_ = "Scan points of the rangers on the feed arm: the points where their two mirror axes meet."
    return ReportSection("feed-arm", "Feed arm", [Text(text_), TableBlock("feed-arm", table)])


def _xyz() -> list:
    return [number(axis, axis, unit="m", digits=5) for axis in "xyz"]


def _u_xyz() -> list:
    return [uncertainty(f"u_{axis}", f"u {axis}", unit="mm", digits=3) for axis in "xyz"]


def _dish(reduction: Reduction) -> ReportSection:
    surface, aim = reduction.surface, pointing(reduction)
    if surface is None or aim is None:
        return ReportSection("dish", "Dish", [Text(f"No pose and no surface: {reduction.no_surface}.")])
    posture = reduction.campaign.site.campaign
    return ReportSection(
        "dish",
        "Dish",
        [
            Text(
                f"The paraboloid of {surface.focal_length:g} m focal length that fits {surface.count_text} best "
                f"(least squares of the normal residuals) points to azimuth {aim[0]:.4f}°, elevation {aim[1]:.4f}°; "
                f"the encoders read {posture.azimuth_deg:g}° and {posture.elevation_deg:g}°. Frame: ground."
            ),
            *_pose(reduction),
            Text(f"Not observed: {UNOBSERVED}.", faint=True),
            ChartBlock(
                "dish",
                dish_chart(reduction, surface),
                f"Normal deviations of the prisms from that paraboloid, {surface.rms / MILLIMETRE:.3f} mm rms; "
                f"u {np.min(surface.u_deviation) / MILLIMETRE:.3f} to "
                f"{np.max(surface.u_deviation) / MILLIMETRE:.3f} mm. Line: the aperture.",
            ),
            *dish_estimates(reduction),
            TableBlock("surface", _prisms(PrismRows(reduction, surface)), folded="Prisms and their deviations"),
        ],
    )


def _pose(reduction: Reduction) -> list[Block]:
    """Tables of the dish's motion and places."""
    surface = reduction.surface
    assert surface is not None
    pose, u = surface.pose(), np.sqrt(np.diag(surface.fit.covariance))
    motion = [
        *(
            (f"shift along {a} (mm)", pose["translation"][k] / MILLIMETRE, u[k] / MILLIMETRE)
            for k, a in enumerate("xyz")
        ),
        *(
            (f"rotation about {a} (″)", pose["rotation"][k] / ARCSECOND, u[3 + k] / ARCSECOND)
            for k, a in enumerate("xyz")
        ),
    ]
    places = [
        ("pivot of the rotation: nominal vertex", *pose["pivot"]),
        ("vertex", *pose["vertex"]),
        ("focus", *pose["focus"]),
        ("axis (unit vector)", *pose["axis"]),
    ]
    moved = ReportTable.of_rows(
        motion,
        text("component", "against the nominal posture"),
        number("value", "value", digits=3, u="u"),
        uncertainty("u", "u", digits=3),
    )
    placed = ReportTable.of_rows(
        places, text("place", "in the ground frame"), *(number(a, a, unit="m", digits=6) for a in "xyz")
    )
    return [TableBlock("pose", moved), TableBlock("places", placed)]


def _prisms(prisms: PrismRows) -> ReportTable:
    fit = prisms.surface.fit
    return ReportTable(
        (
            text("point", "prism", prisms.surface.names),
            *(number(f"{a}_dish", f"{a} in the dish's frame", fit.local[:, k], "m", 5) for k, a in enumerate("xyz")),
            number("deviation", "deviation", fit.deviation / MILLIMETRE, "mm", 3, u="u_deviation"),
            uncertainty("u_deviation", "u", prisms.surface.u_deviation / MILLIMETRE, "mm", 3),
            number("shots", "shots", prisms.shots, digits=0),
        ),
        "point",
    )


def _network(reduction: Reduction) -> ReportSection:
    caption = (
        "All points with their 95 % ellipsoids; lines are used ranges, coloured by the standardised residual w. A "
        "point that the ranges do not determine in some direction has a large ellipsoid, which is capped and marked."
    )
    return ReportSection("network", "Network", [SceneBlock("network", network_scene(reduction), caption)])


def _residuals(reduction: Reduction) -> ReportSection:
    limit = reduction.settings.critical
    lead = (
        "The residual is observed minus adjusted; w is the residual over its own standard deviation. A shot with |w| "
        f"above {limit:g} is rejected."
    )
    charts = [ChartBlock(key, chart, caption) for key, (chart, caption) in residual_charts(reduction).items()]
    return ReportSection("residuals", "Residuals", [Text(lead), *scatter_blocks(reduction), *charts])


def _rejected(reduction: Reduction) -> ReportSection:
    shots = reduction.campaign.shots
    rows = []
    for k, shot in enumerate(shots.shot):
        reason = reduction.rejected.get(int(shot))
        if reason is not None:
            rows.append((int(shot), shots.ranger[k], shots.target[k], str(reason.status), reason.text))
    if not rows:
        return ReportSection("rejected", "Rejected shots", [Text("None.")])
    table = ReportTable.of_rows(
        rows,
        number("shot", "shot", digits=0),
        text("ranger", "ranger"),
        text("target", "target"),
        text("reason", "reason"),
        text("observation", "observation", kind="long"),
        name="shot",
    )
    lead = f"{len(rows)} of {len(shots)} shots. They stay in ranges.csv with their reasons."
    return ReportSection("rejected", "Rejected shots", [Text(lead), TableBlock("rejected", table)])


def _rangers(reduction: Reduction) -> ReportSection:
    campaign, coordinates = reduction.campaign, reduction.coordinates
    amplitude, kinds = reduction.phases.amplitude, kinds_of(reduction)
    rows = []
    for name, (zero, u) in sorted(coordinates.zeros.items()):
        shots = [k for k, ranger in enumerate(campaign.shots.ranger) if ranger == name]
        used = [k for k in shots if reduction.status[k] == "used"]
        mirror = campaign.mirror_of(name)
        rows.append(
            (
                name,
                mirror.zp,
                kinds[name].removesuffix(" ranger").replace("-", " "),
                zero * 1e6,
                u * 1e6,
                mirror.u_d0_mm * 1e3,
                len(used),
                sum(int(campaign.shots.shot[k]) in reduction.rejected for k in shots),
                float(np.median(amplitude[used])) if used else None,
            )
        )
    table = ReportTable.of_rows(
        rows,
        text("point", "ranger"),
        text("mirror", "mirror"),
        text("stands_on", "stands on"),
        number("zero", "zero", unit="µm", digits=1, u="u_zero"),
        uncertainty("u_zero", "u", unit="µm", digits=1),
        uncertainty("u_prior", "u before", unit="µm", digits=1),
        number("used", "used", digits=0),
        number("rejected", "rejected", digits=0),
        number("amplitude", "return", unit="V", digits=2),
        name="point",
    )
    return ReportSection(
        "rangers",
        "Rangers",
        [
            Text("Each ranger's zero is estimated with the coordinates; its laboratory calibration is the prior."),
            ChartBlock("zeros", zeros_chart(reduction), "Corrections to the rangers' zeros, with their u."),
            TableBlock("rangers", table),
            *_harmonics(reduction),
        ],
    )


def _harmonics(reduction: Reduction) -> list[Block]:
    chart = harmonics_chart(reduction)
    count = int(np.sum(reduction.phases.distorted))
    caption = (
        f"Distortion of each shot's samples; {count or 'no'} {'shot' if count == 1 else 'shots'} beyond the limit of "
        f"{100 * DISTORTED:g} % by four standard uncertainties. These harmonics turn no phase of synchronous detection."
    )
    if chart is None:
        return []
    if len(chart.names) < len(shots_with_harmonics(reduction)):
        caption += f" The {len(chart.names)} largest are drawn; ranges.csv has those of every shot."
    return [ChartBlock("harmonics", chart, caption)]


def _points(reduction: Reduction) -> ReportSection:
    coordinates, rows = reduction.coordinates, PointRows(reduction)
    table = ReportTable(
        (
            text("point", "point", coordinates.points),
            text("kind", "kind", list(kinds_of(reduction).values())),
            *(number(axis, axis, coordinates.x[:, k], "m", 5) for k, axis in enumerate("xyz")),
            *(uncertainty(f"u_{axis}", f"u {axis}", rows.u[:, k], "mm", 3) for k, axis in enumerate("xyz")),
            number("shots", "shots", coordinates.shots, digits=0),
            number("lines", "lines", coordinates.lines, digits=0),
            text("status", "status", rows.status),
        ),
        "point",
    )
    lead = (
        "A ranger's name is its scan point; its monument's fixed point ends in -F. Covariances are in coordinates.csv, "
        f"the full matrix in {matrix_file(coordinates.points)}. A large u means that the ranges do not determine that "
        "direction and it rests on the typed position."
    )
    return ReportSection("points", "Points", [Text(lead), TableBlock("points", table)])


def _shots(reduction: Reduction) -> ReportSection:
    """Every shot on a target that has a phase."""
    ranges, shots = reduction.coordinates.ranges, reduction.campaign.shots
    status = [str(reduction.status[k]) for k in ranges.shot.tolist()]
    table = ReportTable(
        (
            number("shot", "shot", shots.shot[ranges.shot], digits=0),
            text("ranger", "ranger", ranges.ranger),
            text("target", "target", ranges.target),
            text("status", "status", status),
            number("range", "range", ranges.range_, "m", 5),
            uncertainty("u_range", "u range", ranges.u_range / MILLIMETRE, "mm", 3),
            number("residual", "residual", ranges.residual / MILLIMETRE, "mm", 3),
            number("w", "w", ranges.standardised, digits=2),
            number("redundancy", "redundancy", ranges.redundancy, digits=2),
        ),
        "shot",
    )
    lead = "Shots with a phase, by ranger. Every correction to each range is in ranges.csv."
    return ReportSection("shots", "Ranges", [Text(lead), TableBlock("shots", table, folded="Ranges")])


def _provenance(reduction: Reduction, when: datetime) -> ReportSection:
    campaign = reduction.campaign
    settings = {
        key: f"{value:.6g}" if isinstance(value, float) else str(value)
        for key, value in vars(reduction.settings).items()
    }
    lead = f"Adjustment: {reduction.coordinates.status}. The same, for programs, is in provenance.json."
    return origin_section(
        when,
        campaign.hashes,
        None,
        Text(lead),
        TableBlock("settings", pairs(settings, "assumption", "value"), folded="Settings"),
    )


def _number(value: float, places: int) -> str:
    return f"{value:.{places}f}" if np.isfinite(value) else "unknown"
