"""Report of an adjusted network, one self-contained HTML page."""

from collections.abc import Mapping, Sequence
from datetime import datetime
from html import escape

import numpy as np

from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.gateways.network.figures import CaptionedFigure, network_figures
from catseye.gateways.network.summary import factor_words, passages, treatment_passages
from catseye.gateways.writers.objects import versions
from catseye.gateways.writers.page import card, folded, page, paragraph, picture, section, table
from catseye.gateways.writers.verdict import verdict_line
from catseye.reduction.network.adjusted import AdjustedNetwork
from catseye.reduction.network.words import quantity

CONTENTS = {
    "summary": "Summary",
    "network": "Network",
    "observations": "Observations",
    "reliability": "Reliability",
    "points": "Points",
    "datum": "Datum and parameters",
    "provenance": "Provenance",
}
WORST = 100  # observations listed
MOST_LISTED = 500  # largest number of points listed completely
WEAKEST = 200  # points listed otherwise
UNCHECKED = 100  # unchecked observations named


def network_report(
    adjusted: AdjustedNetwork,
    when: datetime,
    inputs: Mapping[str, str],
    *,
    prefix: str = "",
) -> str:
    """HTML report.

    adjusted   network
    when       UTC
    inputs     SHA-256 of each input file, by name
    prefix     prefix of the tables' file names
    """
    drawn = network_figures(adjusted)
    name = adjusted.network.source or "network"
    links = "".join(f'<a href="#{key}">{escape(title)}</a>' for key, title in CONTENTS.items())
    axes = ", ".join(adjusted.network.axis_names)
    header = (
        f"<header><h1>{escape(name)}: network adjustment</h1>"
        f'<div class="faint">{len(adjusted.table)} observations of {len(adjusted.names)} points, adjusted by catseye '
        f"on {when:%Y-%m-%d %H:%M} UTC; coordinates in the file's own axes ({escape(axes)}), u = standard uncertainty, "
        f"1σ{', variance factor applied' if adjusted.scaled else ', as claimed before'}</div>"
        f"<nav>{links}</nav></header>"
    )
    body = [
        header,
        verdict_line(adjusted.verdict),
        _summary(adjusted),
        _network(drawn),
        _observations(adjusted, drawn, f"{prefix}observations.csv"),
        _reliability(adjusted, drawn),
        _points(adjusted, f"{prefix}coordinates.csv"),
        _datum(adjusted),
        provenance_section(
            when, inputs, {"level of the tests": f"{adjusted.level:g}", "variance factor applied": str(adjusted.scaled)}
        ),
    ]
    return page(f"catseye: {name}", "\n".join(body))


def _summary(adjusted: AdjustedNetwork) -> str:
    axis = adjusted.ellipsoid.semi_axes[:, 0]
    positive = axis[np.isfinite(axis) & (axis > 0.0)]
    cards = network_cards(adjusted)
    if len(positive):
        usual, worst = quantity(float(np.median(positive)), "m"), quantity(float(positive.max()), "m")
        cards.insert(1, card("Point uncertainty", usual, f"longest axis of the median ellipsoid; worst {worst}"))
    listed = [*passages(adjusted), *treatment_passages(adjusted)]
    words = "".join(f"<dt>{escape(p.title)}</dt><dd>{escape(p.text)}</dd>" for p in listed)
    text = adjusted.network.description.strip()
    return section(
        "summary",
        CONTENTS["summary"],
        f'<div class="cards">{"".join(cards)}</div>',
        f"<dl>{words}</dl>",
        folded("Description in the file", *(paragraph(part) for part in text.split("\n\n"))) if text else "",
    )


def network_cards(adjusted: AdjustedNetwork) -> list[str]:
    """Cards with the main numbers.

    adjusted   network
    """
    overall, active = adjusted.global_test, adjusted.table.active
    unchecked = int(np.sum(active & ~adjusted.table.checked)) if adjusted.answered else 0
    interval = f"expected {overall.lower:.3f} to {overall.upper:.3f}" if np.isfinite(overall.p) else "not tested"
    degrees = adjusted.solution.degrees_of_freedom
    suspects = str(len(adjusted.suspects)) if adjusted.answered else "unknown"
    return [
        card(
            "Variance factor",
            factor_words(overall.factor) if np.isfinite(overall.p) else "unknown",
            f"{interval}, {degrees:.0f} degrees of freedom" if np.isfinite(degrees) else interval,
        ),
        card("Suspect observations", suspects, f"of {int(active.sum())}, level {adjusted.level:g} for all"),
        card(
            "Unchecked observations",
            str(unchecked) if adjusted.answered else "unknown",
            "an error there would not show",
        ),
    ]


def _network(drawn: dict[str, CaptionedFigure]) -> str:
    return section("network", CONTENTS["network"], *view_pictures(drawn))


def view_pictures(drawn: dict[str, CaptionedFigure]) -> list[str]:
    """Plan and elevation as pictures; a sentence if there is nothing to show.

    drawn   figures by name, see `network_figures`
    """
    missing = {"plan": "No plan: no point has x and y.", "elevation": "No elevation: no point has x, y and z."}
    return [
        picture(drawn[k].svg, drawn[k].caption) if k in drawn else paragraph(text, "faint")
        for k, text in missing.items()
    ]


def _observations(adjusted: AdjustedNetwork, drawn: dict[str, CaptionedFigure], file: str) -> str:
    rows = adjusted.table.worst_first[:WORST]
    total = len(adjusted.table)
    note = (
        f"The {len(rows)} worst of {total}; all are in {file}." if len(rows) < total else f"All {total}, worst first."
    )
    return section(
        "observations",
        CONTENTS["observations"],
        picture(drawn["residuals"].svg, drawn["residuals"].caption) if "residuals" in drawn else "",
        paragraph(
            f"{note} The residual is observed minus adjusted; the test statistic is the residual in units of its own "
            "uncertainty; the estimated error explains it best if nothing else is wrong."
        ),
        observation_rows(adjusted, rows),
    )


def observation_rows(adjusted: AdjustedNetwork, rows: Sequence[int] | np.ndarray) -> str:
    """Table of observations; lengths in mm, angles in arc seconds.

    adjusted   network
    rows       rows of its table
    """
    t, suspect = adjusted.table, set(adjusted.suspects.tolist())
    fine = {"m": (MILLIMETRE, "mm"), "rad": (ARCSECOND, "″")}
    lines = []
    for i in rows:
        scale, unit = fine.get(str(t.unit[i]), (1.0, ""))
        what = "suspect" if i in suspect else "left out" if not t.active[i] else ""
        what = "unchecked" if adjusted.answered and t.active[i] and not t.checked[i] else what
        lines.append(
            (
                adjusted.label(int(i)),
                *(_number(float(v[i]) / scale, form) for v, form in ((t.residual, "+.4g"), (t.u, ".4g"))),
                unit,
                _number(float(adjusted.statistic[i]), "+.2f"),
                _number(float(adjusted.p[i]), ".2g"),
                _number(float(t.redundancy[i]), ".3f"),
                *(_number(float(v[i]) / scale, form) for v, form in ((t.estimated_error, "+.4g"), (t.mdb, ".4g"))),
                what,
            )
        )
    columns = (
        "observation", "residual", "u", "unit", f"{adjusted.test} statistic", "p of all", "redundancy",
        "estimated error", "detectable error", "",
    )  # fmt: skip
    return table(columns, lines, "tnntnnnnnt")


def _reliability(adjusted: AdjustedNetwork, drawn: dict[str, CaptionedFigure]) -> str:
    if not adjusted.answered:
        return section("reliability", CONTENTS["reliability"], paragraph("Unknown without a solution."))
    rows = np.flatnonzero(adjusted.table.active & ~adjusted.table.checked)
    parts = [picture(drawn["redundancy"].svg, drawn["redundancy"].caption)] if "redundancy" in drawn else []
    if not len(rows):
        parts.append(paragraph("All observations are checked by others."))
    else:
        more = f", the first {UNCHECKED} here" if len(rows) > UNCHECKED else ""
        parts.append(
            paragraph(
                f"{len(rows)} observations are not checked by others; an error in one of them would not show{more}."
            )
        )
        parts.append(observation_rows(adjusted, rows[:UNCHECKED]))
    return section("reliability", CONTENTS["reliability"], *parts)


def _points(adjusted: AdjustedNetwork, file: str) -> str:
    count = len(adjusted.names)
    rows, note = np.arange(count), ""
    if count > MOST_LISTED:
        rows = np.argsort(-np.nan_to_num(adjusted.ellipsoid.semi_axes[:, 0], nan=np.inf), kind="stable")[:WEAKEST]
        note = f"The {WEAKEST} weakest of {count}; all are in {file}. "
    names = adjusted.network.axis_names
    points = adjusted.network.points
    roles = np.where(points.datum.any(axis=1), "datum", "")
    roles = np.where(points.fixed.any(axis=1), np.where(points.free.any(axis=1), "partly held", "held"), roles)
    u, axis = adjusted.u / MILLIMETRE, adjusted.ellipsoid.semi_axes / MILLIMETRE
    lines = [
        (
            adjusted.names[i],
            "station" if adjusted.stations[i] else "target",
            str(roles[i]),
            *(_number(float(v), ".7f") for v in adjusted.x[i]),
            *(_number(float(v), ".4f") for v in u[i]),
            " / ".join(_number(float(v), ".4g") for v in axis[i]),
            str(adjusted.observation_counts[i]),
        )
        for i in rows.tolist()
    ]
    columns = (
        "point", "kind", "role", *(f"{n} (m)" for n in names), *(f"u {n} (mm)" for n in names), "semi-axes (mm)",
        "seen",
    )  # fmt: skip
    return section(
        "points",
        CONTENTS["points"],
        paragraph(
            f"{note}Semi-axes are those of the standard ellipsoid (1σ), “seen” is the number of observations. "
            f"Covariances are in {file}."
        ),
        table(columns, lines, "tttnnnnnnnn"),
        _relative(adjusted),
    )


def _relative(adjusted: AdjustedNetwork) -> str:
    """Section on the requested pairs of points."""
    if not adjusted.relative:
        return ""
    rows = [
        (
            f"{r.first} - {r.second}",
            _number(r.distance, ".7f"),
            _number(r.u_distance / MILLIMETRE, ".4f"),
            " / ".join(_number(float(v) / MILLIMETRE, ".4g") for v in r.ellipsoid.semi_axes),
        )
        for r in adjusted.relative
    ]
    return "<h3>Relative positions</h3>" + table(
        ("pair", "distance (m)", "u (mm)", "semi-axes of the relative ellipsoid (mm)"), rows, "tnnn"
    )


def _datum(adjusted: AdjustedNetwork) -> str:
    solution, parameters = adjusted.solution, adjusted.network.parameters
    parts = [
        paragraph(f"Datum: {solution.datum}. {solution.iterations} iterations. Status: {solution.status}."),
    ]
    rows = [
        (p.name, *parameter_cells(float(v), float(u), p.unit), _prior(p.start, p.sigma, p.unit))
        for p, v, u in zip(parameters, solution.parameters, adjusted.u_parameters, strict=True)
    ]
    if rows:
        axes = "" if np.array_equal(adjusted.network.axes, np.eye(3)) else " Their axes are x east, y north, z up."
        parts.append(paragraph(f"{len(rows)} additional parameters.{axes}"))
        parts.append(table(("parameter", "value", "u", "prior"), rows, "tnnt"))
    return section("datum", CONTENTS["datum"], *parts)


def parameter_cells(value: float, u: float, unit: str) -> tuple[str, str]:
    """Parameter and its uncertainty as text: degrees and arc seconds, mm, or ppm.

    value, u   in the unit
    unit       "m", "rad" or "1"

    >>> parameter_cells(1e-3, 1e-5, "m"), parameter_cells(2e-6, 1e-7, "1")
    (('+1.0000 mm', '0.0100 mm'), ('+2.0000 ppm', '0.1000 ppm'))
    """
    if unit == "rad":
        return f"{np.degrees(value):.6f}°", f"{u / ARCSECOND:.3f}″"
    scale, name = (MILLIMETRE, "mm") if unit == "m" else (1e-6, "ppm")
    return f"{value / scale:+.4f} {name}", f"{u / scale:.4f} {name}"


def _prior(start: float, sigma: float, unit: str) -> str:
    if np.isinf(sigma):
        return "free"
    value, u = parameter_cells(start, sigma, unit)
    return f"{value}, u {u}" if sigma > 0.0 else f"held at {value}"


def provenance_section(when: datetime, inputs: Mapping[str, str], settings: Mapping[str, str]) -> str:
    """Input files, programs and settings.

    when       UTC
    inputs     SHA-256 by name
    settings   values by name
    """
    return section(
        "provenance",
        CONTENTS["provenance"],
        paragraph(f"Adjusted {when:%Y-%m-%d %H:%M:%S} UTC. The same is in provenance.json, for programs."),
        table(("input", "SHA-256"), list(inputs.items()), "th"),
        table(("setting", "value"), list(settings.items()), "tt"),
        table(("part", "version"), list(versions().items()), "tt"),
    )


def _number(value: float, form: str) -> str:
    return format(value, form) if np.isfinite(value) else "–"
