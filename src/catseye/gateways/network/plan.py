"""Planned network as JSON, CSV and report: predicted quality, weak points, next observations."""

from collections.abc import Callable, Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.estimation.network.monte_carlo import MonteCarloScatter
from catseye.estimation.network.plan import MOST_RANGES, Candidate
from catseye.gateways.network.objects import network_object
from catseye.gateways.network.report import MOST_OBSERVATIONS, provenance_section
from catseye.gateways.network.report_charts import network_view, redundancy_chart
from catseye.gateways.network.summary import direction_words
from catseye.gateways.network.tables import candidates_csv, coordinates_csv
from catseye.gateways.writers.objects import json_page, plain
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.report import Block, Card, Heading, ReportSection, ResultReport, TableBlock, Text
from catseye.gateways.writers.report_page import report_page
from catseye.gateways.writers.report_parts import ReportTable, number, text, uncertainty
from catseye.gateways.writers.written import Files, origin, write_files
from catseye.names import counted
from catseye.reduction.network.plan import PlannedNetwork
from catseye.reduction.network.words import quantity

FORMAT = "catseye-plan-1"
SMALLEST_P = 1e-4  # that is printed as a number


def plan_object(planned: PlannedNetwork) -> dict[str, Any]:
    """Object that `catseye plan --json` prints: the keys of an adjustment, predicted, and the plan's."""
    plan, predicted = planned.plan, planned.predicted
    base = network_object(predicted)
    for row, worth in zip(base["observations"], plain(planned.worth.tolist()), strict=True):
        for key in ("observed", "residual", "standardised", "estimated_error", "test", "p"):
            row[key] = None  # not measured yet
        row["worth"] = worth
    names, axes = predicted.names, predicted.network.axes
    extra = {
        "format": FORMAT,
        "verdict": planned.verdict.to_object(),
        "status": "planned",
        "suspects": [],
        "variance_factor": None,
        "mean_u": plan.mean_u,
        "interest": [name for name, chosen in zip(names, plan.interest, strict=True) if chosen],
        "weakest": [
            {
                "point": names[i],
                "u": plan.weakest[i],
                "direction": (plan.direction[i] @ axes).tolist(),
                "detectable": planned.detectable[i],
            }
            for i in planned.weakest
        ],
        "weakest_motion": {
            "u": planned.weakest_motion[0],
            "share": dict(zip(names, planned.weakest_motion[1].tolist(), strict=True)),
        },
        "candidates": [_candidate(c, scheduled=False) for c in plan.candidates],
        "best_next": _candidate(plan.candidates[0], scheduled=False) if plan.candidates else None,
        "schedule": [_candidate(c, scheduled=True) for c in planned.picked],
        "monte_carlo": _scatter(planned.scatter),
    }
    for key in ("chi_square", "critical", "iterations"):
        base.pop(key, None)
    return {**base, **plain(extra)}


def _candidate(c: Candidate, *, scheduled: bool) -> dict[str, Any]:
    row = {"kind": "slope_distance", "from": c.from_, "to": c.to, "u": c.u, "mean_u": c.mean_u, "gain": c.gain}
    return {**row, "at_s": c.at_s} if scheduled else row


def _scatter(scatter: MonteCarloScatter | None) -> dict[str, Any] | None:
    if scatter is None:
        return None
    free = scatter.predicted > 0.0  # neither fixed nor absent
    return {
        "runs": scatter.runs,
        "asked": scatter.asked,
        "ratio": scatter.ratio,
        "rms": float(np.sqrt(np.mean(scatter.rms[free] ** 2))),
        "predicted": float(np.sqrt(np.mean(scatter.predicted[free] ** 2))),
        "blunders_found": scatter.found,
        "good_lost": scatter.false,
        "covariance": {**asdict(scatter.covariance), "agrees": scatter.covariance.agrees},
    }


def plan_passages(planned: PlannedNetwork) -> list[Passage]:
    """Passages on quality, weak points, next observations, and Monte Carlo."""
    plan, predicted = planned.plan, planned.predicted
    u = quantity(plan.mean_u, "m")
    passages = [
        Passage(
            "The plan",
            f"{len(predicted.table)} observations of {len(predicted.names)} points would give the coordinates of "
            f"{counted(int(plan.interest.sum()), 'point')} with a standard uncertainty of {u}, root mean square; "
            f"datum: {predicted.solution.datum}.",
        )
    ]
    weak = [
        f"{predicted.names[i]} {quantity(plan.weakest[i], 'm')} {direction_words(predicted, int(i))}"
        for i in planned.weakest[:3]
    ]
    if weak:
        passages.append(Passage("Weakest", "; ".join(weak) + f". {_motion(planned)}"))
    passages += _movements(planned)
    table, worth = predicted.table, planned.worth
    needed = np.flatnonzero(np.isinf(worth))
    unchecked = int(np.sum(~table.checked))
    text = f"{len(needed)} observations are indispensable: without one of them a point is undetermined"
    text += f", first {predicted.label(int(needed[0]))}." if len(needed) else "." if unchecked else " (none)."
    text = text if len(needed) else "No single observation is indispensable."
    if unchecked:
        text += f" {unchecked} are not checked by others: an error there would not show."
    else:
        detectable = table.mdb[np.isfinite(table.mdb) & (table.unit == "m")]
        if len(detectable):
            text += (
                f" An error of {quantity(float(np.median(detectable)), 'm')} in a length would usually be found, "
                f"in the worst one {quantity(float(detectable.max()), 'm')} ({predicted.detectability.words})."
            )
    passages.append(Passage("The checks", text))
    if plan.candidates:
        best = plan.candidates[0]
        passages.append(
            Passage(
                "Best next",
                f"a range {best.from_} - {best.to} (u {quantity(best.u, 'm')}) would lower it to "
                f"{quantity(best.mean_u, 'm')}, by {quantity(best.gain, 'm')}; then "
                + ", ".join(f"{c.from_} - {c.to}" for c in plan.candidates[1:4])
                + ".",
            )
        )
    if planned.picked:
        last = planned.picked[-1]
        order = ", ".join(f"{c.from_} - {c.to}" for c in planned.picked[:6])
        more = f" and {len(planned.picked) - 6} more" if len(planned.picked) > 6 else ""
        cap = f"; the search ends at {MOST_RANGES} ranges" if len(planned.picked) == MOST_RANGES else ""
        passages.append(
            Passage(
                "In the given time",
                f"{counted(len(planned.picked), 'range')}, {order}{more}, would bring it to "
                f"{quantity(last.mean_u, 'm')}{cap}.",
            )
        )
    if planned.scatter is not None:
        passages.append(Passage("Monte Carlo", scatter_words(planned.scatter)))
    return passages


def _motion(planned: PlannedNetwork) -> str:
    """Weakest direction of the whole network, in words."""
    u, share = planned.weakest_motion
    order = np.argsort(-share, kind="stable")[:3]
    names = ", ".join(planned.predicted.names[i] for i in order)
    return f"Of all coordinates together the weakest direction has u {quantity(u, 'm')}; {names} move most in it."


def _movements(planned: PlannedNetwork) -> list[Passage]:
    """Passage on the movements that a second epoch would show."""
    sizes = planned.detectable[planned.plan.interest & np.isfinite(planned.detectable)]
    if not len(sizes):
        return []
    usual, most = quantity(float(np.median(sizes)), "m"), quantity(float(sizes.max()), "m")
    text = (
        f"a second epoch like this would show a movement of {usual} of a median point, of the worst of {most}, in the "
        "weakest direction (level 5 %, power 80 %)."
    )
    return [Passage("Movements", text)]


def scatter_words(s: MonteCarloScatter) -> str:
    """Result of the Monte Carlo, in sentences."""
    text = (
        f"{s.asked} runs, {s.runs} of them with an answer: departures are {s.ratio:.2f} of the claimed "
        "standard uncertainties, root mean square"
    )
    text += "." if s.ratio < 1.2 else ": the errors added to the claimed noise show."
    if np.isfinite(s.found):
        text += f" {100 * s.found:.1f} % of the gross errors were left out, and {100 * s.false:.2f} % of the good ones."
    test, claim = s.covariance, "the predicted one" if s.normal else "the one that each run claims"
    text += (
        f" As matrices, over {test.combinations} independent combinations of the coordinates: their covariance "
        f"{'agrees with' if test.agrees else 'contradicts'} {claim} (p {_probability(test.p)} for its shape "
        f"and p {_probability(test.p_size)} for its size); along the worst combination they are {test.largest:.2f} of "
        f"the claim, where chance alone gives up to {test.by_chance:.2f}."
    )
    return text


def _probability(p: float) -> str:
    return f"= {p:.2g}" if p >= SMALLEST_P else f"< {SMALLEST_P}"


def plan_report(planned: PlannedNetwork, when: datetime, inputs: Mapping[str, str]) -> ResultReport:
    """Report of a planned network."""
    predicted, plan = planned.predicted, planned.plan
    name = predicted.network.source or "network"
    settings = {"candidates listed": str(len(plan.candidates))}
    following: list[Block] = (
        [_ranges("candidates", plan.candidates)] if plan.candidates else [Text("No ranges to add.")]
    )
    if planned.picked:
        schedule = _ranges("schedule", planned.picked, scheduled=True)
        following += [Heading("Schedule in the given time"), schedule]
    words = "" if planned.scatter is None else scatter_words(planned.scatter)
    return ResultReport(
        title=f"{name}: plan of a network",
        subtitle=(
            f"{len(predicted.table)} observations of {len(predicted.names)} points, predicted by catseye on "
            f"{when:%Y-%m-%d %H:%M} UTC; nothing here was measured. u = standard uncertainty, 1σ"
        ),
        verdict=planned.verdict,
        cards=_cards(planned),
        passages=plan_passages(planned),
        sections=[
            ReportSection("network", "Network", [network_view(predicted, predicted=True), redundancy_chart(predicted)]),
            ReportSection("weakest", "Weakest points", [TableBlock("weakest", _weakest(planned))]),
            ReportSection(
                "next",
                "Next observations",
                [
                    Text(
                        "Each additional range alone, the best first, with the resulting mean standard uncertainty. "
                        "Visibility is unknown here: a pair may be obstructed."
                    ),
                    *following,
                ],
            ),
            ReportSection(
                "observations",
                "Worth of each observation",
                [
                    Text("Worth: increase of the mean standard uncertainty without the observation."),
                    TableBlock("worth", _worth(planned)),
                ],
            ),
            ReportSection(
                "monte-carlo", "Monte Carlo", [Text(words[:1].upper() + words[1:] if words else "Not requested.")]
            ),
            provenance_section(when, inputs, settings),
        ],
        label=f"catseye plan: {name}",
    )


def _cards(planned: PlannedNetwork) -> list[Card]:
    predicted, plan = planned.predicted, planned.plan
    return [
        Card("Coordinate uncertainty", quantity(plan.mean_u, "m"), "root mean square over the points of interest"),
        Card(
            "Weakest point",
            predicted.names[planned.weakest[0]] if len(planned.weakest) else "none",
            f"{quantity(float(plan.weakest.max(initial=0.0)), 'm')} along its longest axis",
        ),
        Card("Indispensable", str(int(np.isinf(planned.worth).sum())), "losing one leaves a point undetermined"),
        Card("Unchecked", str(int(np.sum(~predicted.table.checked))), "observations whose error would not show"),
    ]


def _weakest(planned: PlannedNetwork) -> ReportTable:
    predicted, rows = planned.predicted, planned.weakest
    return ReportTable(
        (
            text("point", "point", [predicted.names[i] for i in rows]),
            uncertainty("u", "longest axis", planned.plan.weakest[rows] / MILLIMETRE, "mm", 4),
            text("towards", "towards", [direction_words(predicted, int(i)) for i in rows]),
            number("detectable", "detectable movement", planned.detectable[rows] / MILLIMETRE, "mm", 3),
        ),
        "point",
    )


def _worth(planned: PlannedNetwork) -> ReportTable:
    """Table of the observations' worth, the largest first."""
    table = planned.predicted.table
    order = np.argsort(-planned.worth, kind="stable")[:MOST_OBSERVATIONS]
    needed = np.isinf(planned.worth[order])
    detectable = [
        quantity(table.mdb[k], str(table.unit[k])) if np.isfinite(table.mdb[k]) else "never" for k in order.tolist()
    ]
    return ReportTable(
        (
            text("observation", "observation", [planned.predicted.label(int(k)) for k in order]),
            number("worth", "worth", np.where(needed, np.nan, planned.worth[order] * 1e6), "µm", 4),
            text("remark", "remark", np.where(needed, "indispensable", "")),
            number("redundancy", "redundancy", table.redundancy[order], digits=3),
            text("detectable", "detectable", detectable),
        ),
        "observation",
    )


def _ranges(key: str, rows: tuple[Candidate, ...], *, scheduled: bool = False) -> TableBlock:
    heads = (
        text("from", "from"),
        text("to", "to"),
        uncertainty("u", "u", unit="mm", digits=4),
        uncertainty("mean_u", "resulting mean u", unit="mm", digits=5),
        number("gain", "gain", unit="µm", digits=4),
        number("at", "done at", unit="s"),
    )
    lines = [(c.from_, c.to, c.u / MILLIMETRE, c.mean_u / MILLIMETRE, c.gain * 1e6, c.at_s) for c in rows]
    table = ReportTable.of_rows(lines, *heads)
    return TableBlock(key, table if scheduled else ReportTable(table.columns[:-1]))


def write_plan(
    planned: PlannedNetwork,
    directory: Path,
    inputs: Mapping[str, str],
    *,
    progress: Callable[[str, int, int], None] | None = None,
) -> None:
    """Write report, tables and JSON of a plan, and last the provenance with their hashes."""
    when = datetime.now(UTC)
    files: Files = {
        "report.html": lambda: report_page(plan_report(planned, when, inputs)),
        "points.csv": lambda: "".join(coordinates_csv(planned.predicted)),
        "candidates.csv": lambda: "".join(candidates_csv(planned.plan.candidates, planned.picked)),
        "plan.json": lambda: json_page(plan_object(planned)),
    }
    provenance = {"format": FORMAT, "made_by": "catseye plan"}
    write_files(files, directory, {**provenance, **origin(when, inputs)}, progress=progress)
