"""Report of the deformation between two epochs, one self-contained HTML page."""

from collections.abc import Mapping
from datetime import datetime
from html import escape
from typing import Any

import numpy as np
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure

from catseye.constants import DEGREE, MILLIMETRE
from catseye.estimation.deformation.deformation import Deformation
from catseye.estimation.quality.ellipsoid import PLAN, confidence_scale, elevation_view, ellipse
from catseye.gateways.network.comparison import comparison_passages
from catseye.gateways.network.figures import (
    CaptionedFigure,
    file_ticks,
    point_names,
    scale_bar,
    thousands,
    view_frame,
    views,
)
from catseye.gateways.network.report import network_cards, provenance_section
from catseye.gateways.writers.drawing import BAD, FAINT, INK, SERIES, nice, styled
from catseye.gateways.writers.page import card, page, paragraph, picture, section, table
from catseye.gateways.writers.verdict import verdict_line
from catseye.reduction.network.adjusted import AdjustedNetwork
from catseye.reduction.network.comparison import UNTESTED, ComparedEpochs
from catseye.reduction.network.words import quantity

CONTENTS = {"summary": "Summary", "displacements": "Displacements", "epochs": "Epochs", "provenance": "Provenance"}
CONFIDENCE = 0.95
STILL = "#1f5a99"
DOUBT = SERIES[4]
SHARE = 0.12  # approximate size of the longest displacement or ellipse, share of the network's extent


def comparison_report(compared: ComparedEpochs, when: datetime, inputs: Mapping[str, str]) -> str:
    """HTML report.

    compared   two epochs
    when       UTC
    inputs     SHA-256 of each input file, by name
    """
    first, second = (epoch.network.source or word for epoch, word in ((compared.first, "A"), (compared.second, "B")))
    links = "".join(f'<a href="#{key}">{escape(title)}</a>' for key, title in CONTENTS.items())
    header = (
        f"<header><h1>{escape(second)} against {escape(first)}: deformation</h1>"
        f'<div class="faint">{len(compared.deformation.names)} common points, compared by catseye on '
        f"{when:%Y-%m-%d %H:%M} UTC; displacements are the second epoch minus the first, in the axes of "
        f"{escape(first)}, u = standard uncertainty, 1σ</div><nav>{links}</nav></header>"
    )
    d = compared.deformation
    settings = {"level of the tests": f"{d.level:g}", "power": f"{d.power:g}", "datums may differ by": d.datum}
    body = [
        header,
        verdict_line(compared.verdict),
        _summary(compared),
        _displacements(compared),
        _epochs(compared),
    ]
    return page(f"catseye: {second} against {first}", "\n".join([*body, provenance_section(when, inputs, settings)]))


def _summary(compared: ComparedEpochs) -> str:
    d = compared.deformation
    moved = [i for i, word in enumerate(compared.verdicts) if word == "moved"]
    cards = [card("Moved", f"{len(moved)} of {len(d.names)}", ", ".join(d.names[i] for i in moved[:6]) or "no point")]
    if moved:
        far = max(moved, key=lambda i: compared.length[i])
        cards.append(card("Farthest", quantity(float(compared.length[far]), "m"), d.names[far]))
    if np.isfinite(d.before.p):
        cards.append(card("All points congruent", f"p = {d.before.p:.2g}", _chance(d.before.p, d.level)))
    if np.isfinite(d.after.p):
        cards.append(card("Stable points congruent", f"p = {d.after.p:.2g}", _chance(d.after.p, d.level)))
    factor = compared.variance_factor
    factor_origin = (
        "taken as known"
        if np.isinf(factor.degrees_of_freedom)
        else f"{factor.degrees_of_freedom:.0f} degrees of freedom"
    )
    cards.append(card("Variance factor", f"{factor.value:.3f}", f"of both epochs, {factor_origin}"))
    detectable = d.detectable[np.isfinite(d.detectable)]
    text = f"{d.status[0].upper()}{d.status[1:]}."
    if len(detectable):
        text += (
            f" The test of all points detects a displacement of a median point above "
            f"{quantity(float(np.median(detectable)), 'm')}, in the least observable direction, with probability "
            f"{d.power:g}."
        )
    words = "".join(
        f"<dt>{escape(p.title)}</dt><dd>{escape(p.text)}</dd>"
        for p in comparison_passages(compared)
        if p.title == "Assumed"
    )
    return section(
        "summary",
        CONTENTS["summary"],
        paragraph(text),
        f'<div class="cards">{"".join(cards)}</div>',
        f"<dl>{words}</dl>" if words else "",
    )


def _chance(p: float, level: float) -> str:
    return "significant" if p < level else "not significant"


def _displacements(compared: ComparedEpochs) -> str:
    d, names = compared.deformation, compared.first.network.axis_names
    drawn = comparison_figures(compared)
    order = np.argsort(np.nan_to_num(d.p, nan=2.0), kind="stable").tolist()
    mm = [compared.displacement / MILLIMETRE, compared.u / MILLIMETRE]
    rows = [
        (
            d.names[i],
            compared.verdicts[i],
            *(_cell(v, "+.3f") for v in mm[0][i]),
            _cell(compared.length[i] / MILLIMETRE, ".3f"),
            " / ".join(_cell(v, ".3f") for v in mm[1][i]),
            " / ".join(_cell(v, "+.3f") for v in compared.difference[0][i] / MILLIMETRE),
            _cell(d.statistic[i], ".2f"),
            _cell(d.p[i], ".2g"),
            _cell(d.p_adjusted[i], ".2g"),
            _cell(d.detectable[i] / MILLIMETRE, ".3f"),
        )
        for i in order
    ]
    columns = ("point", "", *(f"d{n} (mm)" for n in names), "length (mm)", "u (mm)", "plain difference (mm)")
    return section(
        "displacements",
        CONTENTS["displacements"],
        *(picture(figure.svg, figure.caption) for figure in drawn.values()),
        paragraph(
            "Most significant first. p is the probability of such a displacement or a larger one for a point that did "
            "not move; p of all is corrected for the number of points; the last column is the smallest displacement "
            "that the test of all points detects. Displacements are the best estimate if the stable points did not "
            "move; the plain difference is that of the coordinates."
        ),
        table((*columns, "statistic", "p", "p of all", "detectable (mm)"), rows, "ttnnnnnnnnnn"),
    )


def _cell(value: float, form: str) -> str:
    return format(float(value), form) if np.isfinite(value) else "–"


def _epochs(compared: ComparedEpochs) -> str:
    parts = []
    for title, epoch in (("First epoch", compared.first), ("Second epoch", compared.second)):
        judged = epoch.verdict
        parts += [
            f"<h3>{title}: {escape(epoch.network.source)}</h3>",
            paragraph(judged.text, "" if judged.word == "good" else "bad"),
            paragraph(f"Datum: {epoch.solution.datum}."),
            f'<div class="cards">{"".join(network_cards(epoch))}</div>',
        ]
    return section("epochs", CONTENTS["epochs"], *parts)


def comparison_figures(compared: ComparedEpochs) -> dict[str, CaptionedFigure]:
    """Plan and elevation with displacements and confidence ellipses, if any point can be shown.

    compared   two epochs
    """
    with styled():
        drawn = {name: _view(compared, bearing) for name, bearing in views(compared.first).items()}
        return {name: CaptionedFigure(figure, caption) for name, (figure, caption) in drawn.items()}


def _view(compared: ComparedEpochs, bearing: float | None) -> tuple[Figure, str]:
    d, first = compared.deformation, compared.first
    axes = PLAN if bearing is None else elevation_view(bearing)
    existing = first.network.points.existing
    visible = existing[:, :2] if bearing is None else existing
    placed = np.asarray(visible.all(axis=1))
    flat = np.where(placed[:, None], np.nan_to_num(first.solution.x) @ axes.T, np.nan)
    view_rows = compared.rows[np.isfinite(flat[compared.rows]).all(axis=1)]
    if not len(view_rows):
        view_rows = np.flatnonzero(np.isfinite(flat).all(axis=1))
    if bearing is not None:
        flat[:, 0] -= flat[view_rows, 0].min()
    low, high = flat[view_rows].min(axis=0), flat[view_rows].max(axis=0)
    size = max(float(np.max(high - low)), 1e-3)
    shift, spread = _in_view(d, axes)
    factor = confidence_scale(CONFIDENCE, 2, compared.variance_factor.degrees_of_freedom)
    outlines = ellipse(spread)
    longest = np.fmax(np.hypot(*shift.T), factor * outlines.major)
    longest = longest[np.isfinite(longest) & (longest > 0.0)]
    scale = nice(SHARE * size / float(np.max(longest))) if len(longest) else np.nan
    figure, ax = view_frame(0.5 * (low + high), high - low + (0.16 + 2.0 * SHARE) * size)
    scale_bar(ax, nice(0.2 * size), scale, what="displacements and ellipses")
    common = np.zeros(len(flat), dtype=bool)
    common[compared.rows] = True
    if not common.all():
        ax.scatter(*flat[~common].T, s=10, c=FAINT, marker="o", lw=0, zorder=2, label="not compared", alpha=0.6)
    if np.isfinite(scale):
        _arrows(ax, compared, (flat[compared.rows], scale * shift), (outlines, scale * factor))
    point_names(ax, first, np.where(common[:, None], flat, np.nan))
    _labels(ax, first, bearing)
    figure.legend(*ax.get_legend_handles_labels(), loc="lower center", ncols=6)
    view = "Plan." if bearing is None else f"Elevation, seen towards azimuth {bearing / DEGREE:.0f}°."
    if not np.isfinite(scale):
        return figure, f"{view} No displacement is known in this view."
    return figure, (
        f"{view} Arrows: displacements; outlines: their {100 * CONFIDENCE:g} % confidence ellipses about no "
        f"displacement; both enlarged {thousands(scale)} times. A point is judged by all of its coordinates together."
    )


def _in_view(d: Deformation, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Displacements (n, 2) and covariances (n, 2, 2) in a view; nan where a component is unknown."""
    in_plane = axes.any(axis=0)
    finite = np.isfinite(d.displacement[:, in_plane]).all(axis=1)
    shift = np.where(finite[:, None], np.nan_to_num(d.displacement) @ axes.T, np.nan)
    return shift, np.where(finite[:, None, None], axes @ np.nan_to_num(d.covariance) @ axes.T, np.nan)


def _arrows(ax: Any, compared: ComparedEpochs, drawn: tuple[np.ndarray, np.ndarray], shape: tuple[Any, float]) -> None:
    """Draw displacements and ellipses by verdict."""
    (base, shift), (shapes, scale) = drawn, shape
    verdicts = np.array(compared.verdicts)
    for word, colour in (("stable", STILL), ("undecided", DOUBT), ("moved", BAD)):
        chosen = (verdicts == word) & np.isfinite(shift).all(axis=1)
        if not chosen.any():
            continue
        ax.add_collection(
            EllipseCollection(
                2 * scale * shapes.major[chosen], 2 * scale * shapes.minor[chosen],
                90.0 - shapes.bearing[chosen] / DEGREE,
                units="xy", offsets=base[chosen], offset_transform=ax.transData, facecolors=f"{colour}18",
                edgecolors=colour, linewidths=0.7, zorder=2,
            )
        )  # fmt: skip
        ax.quiver(
            *base[chosen].T, *shift[chosen].T, angles="xy", scale_units="xy", scale=1.0, color=colour, width=0.0022,
            headwidth=4.0, headlength=5.0, headaxislength=4.5, minlength=0.1, zorder=4,
        )  # fmt: skip
        ax.scatter(*base[chosen].T, s=5, c=colour, lw=0, zorder=3, label=word)
    for word, marker in (("held", "s"), (UNTESTED, "o")):
        chosen = verdicts == word
        if chosen.any():
            ax.scatter(
                *base[chosen].T, s=20, facecolors="white", edgecolors=INK, marker=marker, lw=0.9, zorder=3, label=word
            )


def _labels(ax: Any, adjusted: AdjustedNetwork, bearing: float | None) -> None:
    if bearing is None:
        file_ticks(ax.xaxis, adjusted, 0, word="east", opposite="west")
        file_ticks(ax.yaxis, adjusted, 1, word="north", opposite="south")
    else:
        ax.set_xlabel(f"horizontal distance towards azimuth {(bearing / DEGREE + 90.0) % 360.0:.0f}° (m)")
        file_ticks(ax.yaxis, adjusted, 2, word="up", opposite="down")
