"""Report of an adjusted network."""

from collections.abc import Mapping, Sequence
from datetime import datetime

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.gateways.network.report_charts import network_view, redundancy_chart, residual_charts
from catseye.gateways.network.summary import factor_words, passages, treatment_passages
from catseye.gateways.writers.report import (
    Block,
    Card,
    Heading,
    ReportSection,
    ResultReport,
    TableBlock,
    Text,
    origin_section,
)
from catseye.gateways.writers.report_parts import ReportTable, number, pairs, text, uncertainty
from catseye.reduction.network.adjusted import CONFIDENCE, AdjustedNetwork
from catseye.reduction.network.words import quantity

MOST_OBSERVATIONS = 10_000  # listed
MOST_POINTS = 5_000  # listed


def network_report(
    adjusted: AdjustedNetwork,
    when: datetime,
    inputs: Mapping[str, str],
    *,
    prefix: str = "",
) -> ResultReport:
    """Report of an adjusted network.

    adjusted   network
    when       UTC
    inputs     SHA-256 of each input file, by name
    prefix     prefix of the tables' file names
    """
    name = adjusted.network.source or "network"
    axes = ", ".join(adjusted.network.axis_names)
    settings = {
        "level of the tests": f"{adjusted.level:g}",
        "test of the detectable errors": adjusted.detectability.words,
        "variance factor applied": str(adjusted.scaled),
    }
    return ResultReport(
        title=f"{name}: network adjustment",
        subtitle=(
            f"{len(adjusted.table)} observations of {len(adjusted.names)} points, adjusted by catseye on "
            f"{when:%Y-%m-%d %H:%M} UTC; coordinates in the file's own axes ({axes}), u = standard uncertainty, 1σ"
            f"{', variance factor applied' if adjusted.scaled else ', as claimed before'}"
        ),
        verdict=adjusted.verdict,
        cards=_cards(adjusted),
        passages=[*passages(adjusted), *treatment_passages(adjusted)],
        sections=[
            _description(adjusted),
            ReportSection("network", "Network", [network_view(adjusted)]),
            _observations(adjusted, f"{prefix}observations.csv"),
            _reliability(adjusted),
            _points(adjusted, f"{prefix}coordinates.csv"),
            _datum(adjusted),
            provenance_section(when, inputs, settings),
        ],
        label=f"catseye: {name}",
    )


def _cards(adjusted: AdjustedNetwork) -> list[Card]:
    axis = adjusted.ellipsoid.semi_axes[:, 0]
    positive = axis[np.isfinite(axis) & (axis > 0.0)]
    cards = network_cards(adjusted)
    if len(positive):
        usual, worst = quantity(float(np.median(positive)), "m"), quantity(float(positive.max()), "m")
        cards.insert(1, Card("Point uncertainty", usual, f"longest axis of the median ellipsoid; worst {worst}"))
    return cards


def _description(adjusted: AdjustedNetwork) -> ReportSection | None:
    """Description in the file; None without one."""
    words = adjusted.network.description.strip()
    if not words:
        return None
    return ReportSection("description", "Description in the file", [Text(part) for part in words.split("\n\n")])


def network_cards(adjusted: AdjustedNetwork) -> list[Card]:
    """Cards with the main numbers.

    adjusted   network
    """
    overall, active = adjusted.global_test, adjusted.table.active
    unchecked = int(np.sum(active & ~adjusted.table.checked)) if adjusted.answered else 0
    interval = f"expected {overall.lower:.3f} to {overall.upper:.3f}" if np.isfinite(overall.p) else "not tested"
    degrees = adjusted.solution.degrees_of_freedom
    suspects = str(len(adjusted.suspects)) if adjusted.answered else "unknown"
    return [
        Card(
            "Variance factor",
            factor_words(overall.factor) if np.isfinite(overall.p) else "unknown",
            f"{interval}, {degrees:.0f} degrees of freedom" if np.isfinite(degrees) else interval,
        ),
        Card("Suspect observations", suspects, f"of {int(active.sum())}, level {adjusted.level:g} for all"),
        Card(
            "Unchecked observations",
            str(unchecked) if adjusted.answered else "unknown",
            "an error there would not show",
        ),
    ]


def _observations(adjusted: AdjustedNetwork, file: str) -> ReportSection:
    rows = adjusted.table.worst_first[:MOST_OBSERVATIONS]
    total = len(adjusted.table)
    note = (
        f"The {len(rows)} worst of {total}; all are in {file}." if len(rows) < total else f"All {total}, worst first."
    )
    lead = (
        f"{note} The residual is observed minus adjusted; the test statistic is the residual in units of its own "
        "uncertainty; the estimated error explains it best if nothing else is wrong."
    )
    table = observation_table(adjusted, rows)
    blocks: list[Block] = [*residual_charts(adjusted), Text(lead), TableBlock("observations", table)]
    return ReportSection("observations", "Observations", blocks)


def observation_table(adjusted: AdjustedNetwork, rows: Sequence[int] | np.ndarray) -> ReportTable:
    """Table of observations; lengths in mm, angles in arc seconds.

    adjusted   network
    rows       rows of its table
    """
    t, suspect = adjusted.table, np.zeros(len(adjusted.table), dtype=bool)
    suspect[adjusted.suspects] = True
    rows = np.asarray(rows, dtype=int)
    fine = {"m": (MILLIMETRE, "mm"), "rad": (ARCSECOND, "″")}
    scale, unit = zip(*(fine.get(str(u), (1.0, "")) for u in t.unit[rows]), strict=True) if len(rows) else ((), ())
    remark = np.where(suspect[rows], "suspect", np.where(t.active[rows], "", "left out"))
    if adjusted.answered:
        remark = np.where(t.active[rows] & ~t.checked[rows], "unchecked", remark)
    sizes = np.array(scale, dtype=float)
    return ReportTable(
        (
            text("observation", "observation", [adjusted.label(int(k)) for k in rows]),
            number("residual", "residual", t.residual[rows] / sizes, u="u"),
            uncertainty("u", "u", t.u[rows] / sizes),
            text("unit", "unit", unit),
            number("statistic", f"{adjusted.test} statistic", adjusted.statistic[rows], digits=2),
            number("p", "p of all", adjusted.p[rows]),
            number("redundancy", "redundancy", t.redundancy[rows], digits=3),
            number("estimated_error", "estimated error", t.estimated_error[rows] / sizes),
            number("detectable", "detectable error", t.mdb[rows] / sizes),
            text("remark", "remark", remark),
        ),
        "observation",
    )


def _reliability(adjusted: AdjustedNetwork) -> ReportSection:
    if not adjusted.answered:
        return ReportSection("reliability", "Reliability", [Text("Unknown without a solution.")])
    rows = np.flatnonzero(adjusted.table.active & ~adjusted.table.checked)
    blocks: list[Block | None] = [redundancy_chart(adjusted)]
    if not len(rows):
        blocks.append(Text("All observations are checked by others."))
    else:
        more = f", the first {MOST_OBSERVATIONS} here" if len(rows) > MOST_OBSERVATIONS else ""
        lead = f"{len(rows)} observations are not checked by others; an error in one of them would not show{more}."
        table = observation_table(adjusted, rows[:MOST_OBSERVATIONS])
        blocks += [Text(lead), TableBlock("unchecked", table)]
    return ReportSection("reliability", "Reliability", blocks)


def _points(adjusted: AdjustedNetwork, file: str) -> ReportSection:
    count = len(adjusted.names)
    rows, note = np.arange(count), ""
    if count > MOST_POINTS:
        weakest = np.argsort(-np.nan_to_num(adjusted.ellipsoid.semi_axes[:, 0], nan=np.inf), kind="stable")
        rows = weakest[:MOST_POINTS]
        note = f"The {MOST_POINTS} weakest of {count}; all are in {file}. "
    names, points = adjusted.network.axis_names, adjusted.network.points
    roles = np.where(points.datum.any(axis=1), "datum", "")
    roles = np.where(points.fixed.any(axis=1), np.where(points.free.any(axis=1), "partly held", "held"), roles)
    u, axis = adjusted.u[rows] / MILLIMETRE, adjusted.ellipsoid.semi_axes[rows] / MILLIMETRE
    table = ReportTable(
        (
            text("point", "point", [adjusted.names[i] for i in rows]),
            text("kind", "kind", np.where(adjusted.stations[rows], "station", "target")),
            text("role", "role", roles[rows]),
            *(number(f"{'xyz'[k]}", name, adjusted.x[rows, k], "m", 5) for k, name in enumerate(names)),
            *(uncertainty(f"u_{'xyz'[k]}", f"u {name}", u[:, k], "mm", 4) for k, name in enumerate(names)),
            *(
                uncertainty(f"semi_axis_{k + 1}", f"{word} semi-axis", axis[:, k], "mm")
                for k, word in enumerate(("longest", "middle", "shortest"))
            ),
            uncertainty("ellipse_major", "longer semi-axis in plan", adjusted.ellipse.major[rows] / MILLIMETRE, "mm"),
            uncertainty("ellipse_minor", "shorter semi-axis in plan", adjusted.ellipse.minor[rows] / MILLIMETRE, "mm"),
            number("ellipse_bearing", "bearing", adjusted.ellipse.bearing[rows] / DEGREE, "°", 1),
            number("observations", "seen", adjusted.observation_counts[rows], digits=0),
        ),
        "point",
    )
    lead = (
        f"{note}Semi-axes are those of the standard ellipsoid, which contains the point with a probability of "
        f"{_coverage(adjusted, 3)}; in plan of the standard ellipse, {_coverage(adjusted, 2)}, whose longer axis has "
        "the bearing, clockwise from north. “Seen” is the number of observations. "
        f"Covariances are in {file}."
    )
    return ReportSection("points", "Points", [Text(lead), TableBlock("points", table), *_relative(adjusted)])


def _coverage(adjusted: AdjustedNetwork, dimensions: int) -> str:
    """Probability of a standard region, and its enlargement for a usual one, in words."""
    share, factor = adjusted.coverage(dimensions)
    if not np.isfinite(share):
        return "unknown size"
    return f"{100.0 * share:.1f} % ({100.0 * CONFIDENCE:g} % with {factor:.2f} times the axes)"


def _relative(adjusted: AdjustedNetwork) -> list[Block]:
    """Requested pairs of points."""
    if not adjusted.relative:
        return []
    rows = [
        (
            f"{r.first} - {r.second}",
            r.distance,
            r.u_distance / MILLIMETRE,
            *(float(v) / MILLIMETRE for v in r.ellipsoid.semi_axes),
        )
        for r in adjusted.relative
    ]
    table = ReportTable.of_rows(
        rows,
        text("pair", "pair"),
        number("distance", "distance", unit="m", digits=5),
        uncertainty("u", "u", unit="mm", digits=4),
        *(
            uncertainty(f"semi_axis_{k + 1}", f"{word} semi-axis of the relative ellipsoid", unit="mm")
            for k, word in enumerate(("longest", "middle", "shortest"))
        ),
    )
    return [Heading("Relative positions"), TableBlock("relative", table)]


def _datum(adjusted: AdjustedNetwork) -> ReportSection:
    solution, parameters = adjusted.solution, adjusted.network.parameters
    lead = f"Datum: {solution.datum}. {solution.iterations} iterations. Status: {solution.status}."
    blocks: list[Block] = [Text(lead)]
    rows = [
        (p.name, *_scaled(float(v), float(u), p.unit), _prior(p.start, p.sigma, p.unit))
        for p, v, u in zip(parameters, solution.parameters, adjusted.u_parameters, strict=True)
    ]
    if rows:
        axes = "" if np.array_equal(adjusted.network.axes, np.eye(3)) else " Their axes are x east, y north, z up."
        blocks.append(Text(f"{len(rows)} additional parameters.{axes}"))
        heads = (
            text("parameter", "parameter"),
            number("value", "value"),
            text("unit", "unit"),
            uncertainty("u", "u"),
            text("unit_of_u", "unit of u"),
            text("prior", "prior"),
        )
        blocks.append(TableBlock("parameters", ReportTable.of_rows(rows, *heads)))
    return ReportSection("datum", "Datum and parameters", blocks)


def _scaled(value: float, u: float, unit: str) -> tuple[float, str, float, str]:
    """Parameter and its uncertainty, each with its unit: degrees and arc seconds, mm, or ppm."""
    if unit == "rad":
        return float(np.degrees(value)), "°", u / ARCSECOND, "″"
    scale, name = (MILLIMETRE, "mm") if unit == "m" else (1e-6, "ppm")
    return value / scale, name, u / scale, name


def parameter_cells(value: float, u: float, unit: str) -> tuple[str, str]:
    """Parameter and its uncertainty as text: degrees and arc seconds, mm, or ppm.

    value, u   in the unit
    unit       "m", "rad" or "1"

    >>> parameter_cells(1e-3, 1e-5, "m"), parameter_cells(2e-6, 1e-7, "1")
    (('+1.0000 mm', '0.0100 mm'), ('+2.0000 ppm', '0.1000 ppm'))
    """
    number_, name, u_, u_name = _scaled(value, u, unit)
    if unit == "rad":
        return f"{number_:.6f}{name}", f"{u_:.3f}{u_name}"
    return f"{number_:+.4f} {name}", f"{u_:.4f} {u_name}"


def _prior(start: float, sigma: float, unit: str) -> str:
    if np.isinf(sigma):
        return "free"
    value, u = parameter_cells(start, sigma, unit)
    return f"{value}, u {u}" if sigma > 0.0 else f"held at {value}"


def provenance_section(when: datetime, inputs: Mapping[str, str], settings: Mapping[str, str]) -> ReportSection:
    """Input files, programs and settings.

    when       UTC
    inputs     SHA-256 by name
    settings   values by name
    """
    lead = Text("The same is in provenance.json, for programs.")
    return origin_section(when, inputs, None, lead, TableBlock("settings", pairs(settings, "setting", "value")))
