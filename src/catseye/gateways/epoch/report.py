"""Report of a reduction, one self-contained HTML page."""

from collections import Counter
from datetime import datetime
from html import escape

import numpy as np

from catseye.aliases import Progress
from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.gateways.epoch.figures import crowded, figures
from catseye.gateways.epoch.objects import benchmark_object, matrix_file
from catseye.gateways.epoch.summary import feed_arm_rows, passages, pointing
from catseye.gateways.epoch.tables import kinds_of
from catseye.gateways.epoch.ways import dish_estimates_table
from catseye.gateways.writers.drawing import svg
from catseye.gateways.writers.objects import versions
from catseye.gateways.writers.page import card, folded, page, paragraph, picture, section, table
from catseye.gateways.writers.verdict import verdict_line
from catseye.reduction.air.group_index import benchmark_refractometers
from catseye.reduction.epoch.epoch import Reduction
from catseye.reduction.epoch.reason import ShotStatus
from catseye.reduction.epoch.surface import UNOBSERVED
from catseye.reduction.epoch.verdict import factor_spread

CONTENTS = {
    "summary": "Summary",
    "feed-arm": "Feed arm",
    "dish": "Dish",
    "network": "Network",
    "residuals": "Residuals",
    "rejected": "Rejected shots",
    "rangers": "Rangers",
    "air": "Air",
    "points": "Points",
    "provenance": "Provenance",
}


def report(reduction: Reduction, when: datetime, progress: Progress | None = None) -> str:
    """HTML report of a reduction; `progress` is called for each figure and the dish's pose."""
    drawn = pictures(reduction, progress)
    if progress is not None:
        progress("page: dish pose by each command", len(drawn), len(drawn) + 1)
    name = reduction.campaign.site.campaign.name
    links = "".join(f'<a href="#{key}">{escape(title)}</a>' for key, title in CONTENTS.items())
    header = (
        f"<header><h1>{escape(name)}: coordinates, pose and surface</h1>"
        f'<div class="faint">from {len(reduction.campaign.shots)} shots in '
        f"{escape(reduction.campaign.directory.resolve().name)}/, reduced by catseye "
        f"on {when:%Y-%m-%d %H:%M} UTC; lengths in the ground frame (x east, y north, z up), u = standard uncertainty, "
        f"1σ</div><nav>{links}</nav></header>"
    )
    body = [
        header,
        verdict_line(reduction.verdict),
        _summary(reduction),
        _feed_arm(reduction, drawn),
        _dish(reduction, drawn),
        _network(reduction, drawn),
        _residuals(reduction, drawn),
        _rejected(reduction),
        _rangers(reduction, drawn),
        _air(reduction, drawn),
        _points(reduction),
        _provenance(reduction, when),
    ]
    return page(f"catseye: {name}", "\n".join(body))


def pictures(reduction: Reduction, progress: Progress | None = None) -> dict[str, str]:
    """Figures of the page, as SVG text."""
    drawings = figures(reduction)
    texts: dict[str, str] = {}
    for count, (name, figure) in enumerate(drawings.items()):
        if progress is not None:
            progress(f"page: figure {name.replace('_', ' ')}", count, len(drawings) + 1)
        texts[name] = svg(figure)
    return texts


def _summary(reduction: Reduction) -> str:
    coordinates, surface = reduction.coordinates, reduction.surface
    count, rows = Counter(reduction.status), feed_arm_rows(reduction)
    spread = factor_spread(reduction.coordinates.degrees_of_freedom)
    cards = [
        card(
            "Ranges used",
            f"{count[ShotStatus.USED]}",
            f"{len(reduction.rejected)} of all shots rejected, each with its reason",
        ),
        card(
            "Variance factor",
            _number(coordinates.variance_factor, 2),
            f"expected 1 ± {_number(spread, 2)}, {coordinates.degrees_of_freedom:.0f} degrees of freedom",
        ),
        card("Refractivity", f"{_number(coordinates.refractivity_ppm, 2)} ppm", "group, mean over the used paths"),
    ]
    if rows:
        worst = max(float(np.max(u)) for _, _, u in rows)
        cards.insert(1, card("Feed arm uncertainty", f"{worst:.2f} mm", "largest u of a coordinate of its rangers"))
    if surface is not None:
        u = float(np.median(surface.u_deviation)) / MILLIMETRE
        cards.insert(
            2,
            card(
                "Surface", f"{surface.rms / MILLIMETRE:.3f} mm rms", f"{len(surface.names)} prisms, u {u:.3f} mm each"
            ),
        )
        tilt = float(np.linalg.norm(surface.fit.rotation)) / ARCSECOND
        moved = float(np.linalg.norm(surface.fit.translation)) / MILLIMETRE
        cards.insert(
            3, card("Dish off nominal", f"{moved:.1f} mm, {tilt:.1f}″", "shift of the vertex, tilt of the axis")
        )
    words = "".join(
        f"<dt>{escape(p.title)}</dt><dd>{escape(p.text)}</dd>" for p in passages(reduction) if p.title != "Notes"
    )
    notes = "".join(f"<li>{escape(note)}</li>" for note in reduction.notes)
    return section(
        "summary",
        CONTENTS["summary"],
        f'<div class="cards">{"".join(cards)}</div>',
        f"<dl>{words}</dl>",
        f'<h3>Notes</h3><ul class="notes">{notes}</ul>' if notes else "",
    )


def _feed_arm(reduction: Reduction, drawn: dict[str, str]) -> str:
    rows = feed_arm_rows(reduction)
    if not rows:
        return section("feed-arm", CONTENTS["feed-arm"], paragraph("No ranger on the feed arm was seen."))
    return section(
        "feed-arm",
        CONTENTS["feed-arm"],
        paragraph("Scan points of the rangers on the feed arm: the points where their two mirror axes meet."),
        table(
            ("ranger", "x (m)", "y (m)", "z (m)", "u x (mm)", "u y (mm)", "u z (mm)"),
            [(name, *(f"{v:.5f}" for v in x), *(f"{v:.3f}" for v in u)) for name, x, u in rows],
            "tnnnnnn",
        ),
        picture(
            drawn["feed_arm"],
            "Left: the feed arm from above, with the outlines of the 1σ ellipsoids, enlarged as stated above. "
            "Right: the standard uncertainties of the coordinates.",
        ),
    )


def _dish(reduction: Reduction, drawn: dict[str, str]) -> str:
    surface, aim = reduction.surface, pointing(reduction)
    if surface is None or aim is None:
        return section("dish", CONTENTS["dish"], paragraph(f"No pose and no surface: {reduction.no_surface}."))
    pose, u = surface.pose(), np.sqrt(np.diag(surface.fit.covariance))
    posture = reduction.campaign.site.campaign
    motion = [
        (f"shift along {axis}", f"{value / MILLIMETRE:+.3f} mm", f"{sigma / MILLIMETRE:.3f} mm")
        for axis, value, sigma in zip("xyz", pose["translation"], u[:3], strict=True)
    ] + [
        (f"rotation about {axis}", f"{value / ARCSECOND:+.2f}″", f"{sigma / ARCSECOND:.2f}″")
        for axis, value, sigma in zip("xyz", pose["rotation"], u[3:], strict=True)
    ]
    places = [
        ("pivot of the rotation: nominal vertex", *(f"{v:.5f}" for v in pose["pivot"])),
        ("vertex", *(f"{v:.5f}" for v in pose["vertex"])),
        ("focus", *(f"{v:.5f}" for v in pose["focus"])),
        ("axis (unit vector)", *(f"{v:.8f}" for v in pose["axis"])),
    ]
    return section(
        "dish",
        CONTENTS["dish"],
        paragraph(
            f"The paraboloid of {surface.focal_length:g} m focal length that fits {len(surface.names)} prisms best "
            f"(least squares of the normal residuals) points to azimuth {aim[0]:.4f}°, elevation {aim[1]:.4f}°; the "
            f"encoders read {posture.azimuth_deg:g}° and {posture.elevation_deg:g}°. Frame: ground."
        ),
        table(("against the nominal posture", "value", "u"), motion, "tnn"),
        table(("in the ground frame (m)", "x", "y", "z"), places, "tnnn"),
        paragraph(f"Not observed: {UNOBSERVED}.", "faint"),
        dish_estimates_table(reduction),
        picture(
            drawn["dish"],
            "Normal deviations of the prisms from that paraboloid in millimetres, "
            f"{surface.rms / MILLIMETRE:.3f} mm rms; "
            f"u {np.min(surface.u_deviation) / MILLIMETRE:.3f} to {np.max(surface.u_deviation) / MILLIMETRE:.3f} mm. "
            "Dashed: the aperture.",
        ),
    )


def _network(reduction: Reduction, drawn: dict[str, str]) -> str:
    points = "All points with the outline of its 1σ ellipsoid, enlarged as stated above the figure"
    if crowded(reduction):
        points = (
            "Prisms of the dish as dots, too many for ellipsoids; all other points with the outline of its 1σ "
            "ellipsoid, enlarged as stated above the figure"
        )
    return section(
        "network",
        CONTENTS["network"],
        picture(
            drawn["plan"],
            f"Plan. {points}; thin lines are used ranges. Hollow circles: points that the ranges do not determine in "
            "at least one direction.",
        ),
        picture(drawn["elevation"], "Elevation, seen across the telescope's azimuth."),
    )


def _residuals(reduction: Reduction, drawn: dict[str, str]) -> str:
    limit = reduction.settings.critical
    return section(
        "residuals",
        CONTENTS["residuals"],
        picture(
            drawn["residuals"],
            "Left: residuals of all ranges; rejected ones are drawn at the edge. Right: the test statistic w of the "
            "used ranges against the normal distribution that the claimed uncertainties predict; a shot with |w| "
            f"above {limit:g} is rejected.",
        ),
    )


def _rejected(reduction: Reduction) -> str:
    shots = reduction.campaign.shots
    rows = []
    for k, number in enumerate(shots.shot):
        reason = reduction.rejected.get(int(number))
        if reason is not None:
            rows.append((str(number), shots.ranger[k], shots.target[k], str(reason.status), reason.text))
    if not rows:
        return section("rejected", CONTENTS["rejected"], paragraph("None."))
    return section(
        "rejected",
        CONTENTS["rejected"],
        paragraph(f"{len(rows)} of {len(shots)} shots. They stay in ranges.csv with their reasons."),
        table(("shot", "ranger", "target", "reason", "observation"), rows, "ntttw"),
    )


def _rangers(reduction: Reduction, drawn: dict[str, str]) -> str:
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
                f"{zero * 1e6:+.1f}",
                f"{u * 1e6:.1f}",
                f"{mirror.u_d0_mm * 1e3:.1f}",
                str(len(used)),
                str(sum(int(campaign.shots.shot[k]) in reduction.rejected for k in shots)),
                _number(float(np.median(amplitude[used])) if used else float("nan"), 2),
            )
        )
    columns = (
        "ranger",
        "mirror",
        "stands on",
        "zero (µm)",
        "u (µm)",
        "u before (µm)",
        "used",
        "rejected",
        "return (V)",
    )
    return section(
        "rangers",
        CONTENTS["rangers"],
        paragraph("Each ranger's zero is estimated with the coordinates; its laboratory calibration is the prior."),
        picture(drawn["zeros"], "Corrections to the rangers' zeros against the laboratory's uncertainties."),
        table(columns, rows, "tttnnnnnn"),
    )


def _air(reduction: Reduction, drawn: dict[str, str]) -> str:
    *stations, (profile, (value, u)) = reduction.coordinates.air.items()
    rows = [(f"{name}: thermometer reads too high by", f"{v:+.3f} °C", f"{s:.3f} °C") for name, (v, s) in stations]
    label, unit = (
        ("gradient with height", "°C/m")
        if profile == "gradient"
        else ("midway between the stations warmer than interpolated by", "°C")
    )
    rows.append((label, f"{value:+.4f} {unit}", f"{u:.4f} {unit}"))
    rows += [
        (f"{line}: acoustic temperature too high by", f"{warm:+.3f} °C", f"{s:.3f} °C")
        for line, (warm, s) in reduction.coordinates.sound.items()
    ]
    benchmarks = [
        (
            one["benchmark"],
            one["ranger"],
            str(one["shots"]),
            f"{one['path_ppm']:.2f} ± {one['u_path_ppm']:.2f}",
            f"{one['weather_ppm']:.2f} ± {one['u_weather_ppm']:.2f}",
            f"{one['adjusted_ppm']:.2f}",
            f"{one['thermometers_too_warm_c']:+.2f} ± {one['u_thermometers_too_warm_c']:.2f}",
        )
        for one in map(benchmark_object, benchmark_refractometers(reduction))
        if one["shots"]
    ]
    columns = ("benchmark", "ranger", "shots", "path", "stations", "adjusted", "stations too warm (°C)")
    paths = paragraph(
        "Each benchmark path is a refractometer: n_g − 1 (ppm) from its phase, its certificate and the ranger's sheet, "
        "compared with the weather stations as read and as adjusted."
    )
    return section(
        "air",
        CONTENTS["air"],
        picture(drawn["refractivity"], "Group refractivity (n − 1) along every used path, coloured by its mean height.")
        if "refractivity" in drawn
        else "",
        picture(drawn["weather"], "Readings of the weather stations."),
        table((f"estimated with the coordinates (model {reduction.settings.air_model})", "value", "u"), rows, "tnn"),
        *([paths, table(columns, benchmarks, "ttnnnnn")] if benchmarks else []),
    )


def _points(reduction: Reduction) -> str:
    coordinates = reduction.coordinates
    u, kinds = coordinates.u / MILLIMETRE, kinds_of(reduction)
    rows = [
        (
            name,
            kinds[name],
            *(f"{v:.5f}" for v in coordinates.x[row]),
            *(f"{v:.3f}" for v in u[row]),
            str(coordinates.shots[row]),
        )
        for row, name in enumerate(coordinates.points)
    ]
    columns = ("point", "kind", "x (m)", "y (m)", "z (m)", "u x (mm)", "u y (mm)", "u z (mm)", "shots")
    return section(
        "points",
        CONTENTS["points"],
        paragraph(
            "A ranger's name is its scan point; its monument's fixed point ends in -F. Covariances are in "
            f"coordinates.csv, the full matrix in {matrix_file(coordinates.points)}. A large u means that the ranges "
            "do not determine that direction and it rests on the typed position."
        ),
        table(columns, rows, "ttnnnnnnn"),
    )


def _provenance(reduction: Reduction, when: datetime) -> str:
    campaign = reduction.campaign
    settings = [
        (key, f"{value:.6g}" if isinstance(value, float) else str(value))
        for key, value in vars(reduction.settings).items()
    ]
    return section(
        "provenance",
        CONTENTS["provenance"],
        paragraph(
            f"Reduced {when:%Y-%m-%d %H:%M:%S} UTC. Adjustment: {reduction.coordinates.status}. The same, for "
            "programs, is in provenance.json."
        ),
        "<h3>Programs</h3>",
        table(("part", "version"), list(versions().items()), "tt"),
        folded("Settings", table(("assumption", "value"), settings, "tt")),
        folded(
            f"Inputs: SHA-256 of {len(campaign.hashes)} files",
            table(("file", "SHA-256"), list(campaign.hashes.items()), "th"),
        ),
    )


def _number(value: float, places: int) -> str:
    return f"{value:.{places}f}" if np.isfinite(value) else "unknown"
