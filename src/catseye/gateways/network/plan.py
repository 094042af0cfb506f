"""Planned network as JSON, CSV and report: predicted quality, weak points, next observations."""

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.estimation.network.monte_carlo import MonteCarloScatter
from catseye.estimation.network.plan import Candidate, Plan
from catseye.gateways.network.findings import Findings
from catseye.gateways.network.objects import network_object
from catseye.gateways.network.summary import direction_words, quantity
from catseye.gateways.network.tables import candidates_csv, coordinates_csv
from catseye.gateways.writers.objects import json_page, plain
from catseye.gateways.writers.page import card, page, paragraph, section, table
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.verdict import Verdict, verdict_line
from catseye.gateways.writers.written import Files, origin, write_files

FORMAT = "catseye-plan-1"
LARGEST_RATIO = 1.2  # largest acceptable departure over claim in the Monte Carlo
LISTED = 10  # weakest points and most important observations in text and report
CONTENTS = {
    "summary": "Summary",
    "network": "Network",
    "weakest": "Weakest points",
    "next": "Next observations",
    "observations": "Worth of each observation",
    "paper": "Monte Carlo",
    "provenance": "Provenance",
}


@dataclass(frozen=True, eq=False)
class PlanFindings:
    """Findings on a plan.

    findings   findings on its predicted solution
    plan       plan of the network, with the worth of its observations and the candidates
    picked     schedule of additional ranges, empty without a time budget
    scatter    Monte Carlo scatter, if requested
    """

    findings: Findings
    plan: Plan
    picked: tuple[Candidate, ...]
    scatter: MonteCarloScatter | None

    @property
    def weakest(self) -> np.ndarray:
        """Rows of the points, (k,), weakest first, without held ones."""
        order = np.argsort(-self.plan.weakest, kind="stable")
        return order[self.plan.weakest[order] > 0.0]

    @property
    def worth(self) -> np.ndarray:
        """Worth of every observation in table order, (m,) m."""
        offset = np.cumsum([0, *(len(w) for w in self.plan.worth)])
        return np.concatenate([np.zeros(0), *self.plan.worth])[
            offset[self.findings.table.group] + self.findings.table.row
        ]


def plan_verdict(plan_findings: PlanFindings) -> Verdict:
    """Verdict on the plan: every point determined and every observation checked."""
    findings = plan_findings.findings
    if not findings.answered:
        return Verdict("failed", findings.solution.status)
    alone = int(np.isinf(plan_findings.worth).sum())
    if alone:
        return Verdict("doubtful", f"{alone} observations are indispensable: losing one leaves a point undetermined")
    unchecked = int(np.sum(~findings.table.checked))
    if unchecked:
        return Verdict("doubtful", f"an error in {unchecked} of {len(findings.table)} observations would not show")
    if plan_findings.scatter is not None and plan_findings.scatter.ratio > LARGEST_RATIO:
        ratio = plan_findings.scatter.ratio
        return Verdict("doubtful", f"in the Monte Carlo the departures are {ratio:.2f} times the claimed uncertainties")
    return Verdict("good", "every point would be determined and every observation checked by others")


def plan_object(plan_findings: PlanFindings) -> dict[str, Any]:
    """Object that `catseye plan --json` prints: the keys of an adjustment, predicted, and the plan's."""
    plan, findings = plan_findings.plan, plan_findings.findings
    base = network_object(findings)
    for row, worth in zip(base["observations"], plain(plan_findings.worth.tolist()), strict=True):
        for key in ("observed", "residual", "standardised", "estimated_error", "test", "p"):
            row[key] = None  # not measured yet
        row["worth"] = worth
    names, axes = findings.names, findings.network.axes
    extra = {
        "format": FORMAT,
        "verdict": plan_verdict(plan_findings).to_object(),
        "status": "planned",
        "suspects": [],
        "variance_factor": None,
        "mean_u": plan.mean_u,
        "interest": [name for name, chosen in zip(names, plan.interest, strict=True) if chosen],
        "weakest": [
            {"point": names[i], "u": plan.weakest[i], "direction": (plan.direction[i] @ axes).tolist()}
            for i in plan_findings.weakest
        ],
        "candidates": [_candidate(c, scheduled=False) for c in plan.candidates],
        "best_next": _candidate(plan.candidates[0], scheduled=False) if plan.candidates else None,
        "schedule": [_candidate(c, scheduled=True) for c in plan_findings.picked],
        "monte_carlo": _scatter(plan_findings.scatter),
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
    }


def plan_json(plan_findings: PlanFindings) -> Iterator[str]:
    """Plan as JSON text on one line."""
    yield json.dumps(plan_object(plan_findings), allow_nan=False)


def plan_passages(plan_findings: PlanFindings) -> list[Passage]:
    """Passages on quality, weak points, next observations, and Monte Carlo."""
    plan, findings = plan_findings.plan, plan_findings.findings
    u = quantity(plan.mean_u, "m")
    passages = [
        Passage(
            "The plan",
            f"{len(findings.table)} observations of {len(findings.names)} points would give the coordinates of "
            f"{int(plan.interest.sum())} points with a standard uncertainty of {u}, root mean square; "
            f"datum: {findings.solution.datum}.",
        )
    ]
    weak = [
        f"{findings.names[i]} {quantity(plan.weakest[i], 'm')} {direction_words(findings, int(i))}"
        for i in plan_findings.weakest[:3]
    ]
    if weak:
        passages.append(Passage("Weakest", "; ".join(weak) + "."))
    table, worth = findings.table, plan_findings.worth
    needed = np.flatnonzero(np.isinf(worth))
    unchecked = int(np.sum(~table.checked))
    text = f"{len(needed)} observations are indispensable: without one of them a point is undetermined"
    text += f", first {findings.label(int(needed[0]))}." if len(needed) else "." if unchecked else " (none)."
    text = text if len(needed) else "No single observation is indispensable."
    if unchecked:
        text += f" {unchecked} are not checked by others: an error there would not show."
    else:
        detectable = table.mdb[np.isfinite(table.mdb) & (table.unit == "m")]
        if len(detectable):
            text += (
                f" An error of {quantity(float(np.median(detectable)), 'm')} in a length would usually be found, "
                f"in the worst one {quantity(float(detectable.max()), 'm')} (power 80 %, level 0.1 %)."
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
    if plan_findings.picked:
        last = plan_findings.picked[-1]
        order = ", ".join(f"{c.from_} - {c.to}" for c in plan_findings.picked[:6])
        more = f" and {len(plan_findings.picked) - 6} more" if len(plan_findings.picked) > 6 else ""
        passages.append(
            Passage(
                "In the given time",
                f"{len(plan_findings.picked)} ranges, {order}{more}, would bring it to {quantity(last.mean_u, 'm')}.",
            )
        )
    if plan_findings.scatter is not None:
        passages.append(Passage("Monte Carlo", scatter_words(plan_findings.scatter)))
    return passages


def scatter_words(s: MonteCarloScatter) -> str:
    """Result of the Monte Carlo, in sentences."""
    text = (
        f"{s.asked} runs, {s.runs} of them with an answer: departures are {s.ratio:.2f} of the claimed "
        "standard uncertainties, root mean square"
    )
    text += "." if s.ratio < 1.2 else ": the errors added to the claimed noise show."
    if np.isfinite(s.found):
        text += f" {100 * s.found:.1f} % of the gross errors were left out, and {100 * s.false:.2f} % of the good ones."
    return text


def plan_report(plan_findings: PlanFindings, when: datetime, inputs: Mapping[str, str]) -> str:
    """HTML report of a planned network."""
    from catseye.gateways.network.figures import network_figures
    from catseye.gateways.network.report import provenance_section, view_pictures

    findings, plan = plan_findings.findings, plan_findings.plan
    drawn = network_figures(findings)
    name = findings.network.source or "network"
    links = "".join(f'<a href="#{key}">{escape(title)}</a>' for key, title in CONTENTS.items())
    header = (
        f"<header><h1>{escape(name)}: plan of a network</h1>"
        f'<div class="faint">{len(findings.table)} observations of {len(findings.names)} points, predicted by catseye '
        f"on {when:%Y-%m-%d %H:%M} UTC; nothing here was measured. u = standard uncertainty, 1σ</div>"
        f"<nav>{links}</nav></header>"
    )
    words = "".join(f"<dt>{escape(p.title)}</dt><dd>{escape(p.text)}</dd>" for p in plan_passages(plan_findings))
    following = _ranges(plan.candidates) if plan.candidates else paragraph("No ranges to add.")
    scheduled = (
        "<h3>Schedule in the given time</h3>" + _ranges(plan_findings.picked, scheduled=True)
        if plan_findings.picked
        else ""
    )
    scatter = (
        paragraph(scatter_words(plan_findings.scatter)[0].upper() + scatter_words(plan_findings.scatter)[1:])
        if plan_findings.scatter
        else ""
    )
    body = [
        header,
        verdict_line(plan_verdict(plan_findings)),
        section(
            "summary",
            CONTENTS["summary"],
            f'<div class="cards">{"".join(_cards(plan_findings))}</div>',
            f"<dl>{words}</dl>",
        ),
        section("network", CONTENTS["network"], *view_pictures(drawn)),
        section("weakest", CONTENTS["weakest"], _weakest(plan_findings)),
        section(
            "next",
            CONTENTS["next"],
            paragraph(
                "Each additional range alone, the best first, with the resulting mean standard uncertainty. "
                "Visibility is unknown here: a pair may be obstructed."
            ),
            following,
            scheduled,
        ),
        section(
            "observations",
            CONTENTS["observations"],
            paragraph("Worth: increase of the mean standard uncertainty without the observation."),
            _worth(plan_findings),
        ),
        section("paper", CONTENTS["paper"], scatter or paragraph("Not requested (--runs).", "faint")),
        provenance_section(when, inputs, {"candidates listed": str(len(plan.candidates))}),
    ]
    return page(f"catseye plan: {name}", "\n".join(body))


def _cards(plan_findings: PlanFindings) -> list[str]:
    findings, plan = plan_findings.findings, plan_findings.plan
    return [
        card("Coordinate uncertainty", quantity(plan.mean_u, "m"), "root mean square over the points of interest"),
        card(
            "Weakest point",
            findings.names[plan_findings.weakest[0]] if len(plan_findings.weakest) else "none",
            f"{quantity(float(plan.weakest.max(initial=0.0)), 'm')} along its longest axis",
        ),
        card("Indispensable", str(int(np.isinf(plan_findings.worth).sum())), "losing one leaves a point undetermined"),
        card("Unchecked", str(int(np.sum(~findings.table.checked))), "observations whose error would not show"),
    ]


def _weakest(plan_findings: PlanFindings) -> str:
    findings, plan = plan_findings.findings, plan_findings.plan
    return table(
        ("point", "longest axis (mm)", "towards"),
        [
            (findings.names[i], f"{plan.weakest[i] / MILLIMETRE:.4f}", direction_words(findings, int(i)))
            for i in plan_findings.weakest[: 5 * LISTED]
        ],
        "tnt",
    )


def _worth(plan_findings: PlanFindings) -> str:
    """Table of the observations' worth, the largest first."""
    findings = plan_findings.findings
    order = np.argsort(-plan_findings.worth, kind="stable")[: 5 * LISTED]
    return table(
        ("observation", "worth (µm)", "redundancy", "detectable"),
        [
            (
                findings.label(int(k)),
                "∞" if np.isinf(plan_findings.worth[k]) else f"{plan_findings.worth[k] * 1e6:.4f}",
                f"{findings.table.redundancy[k]:.3f}",
                quantity(findings.table.mdb[k], str(findings.table.unit[k]))
                if np.isfinite(findings.table.mdb[k])
                else "never",
            )
            for k in order
        ],
        "tnnn",
    )


def _ranges(rows: tuple[Candidate, ...], *, scheduled: bool = False) -> str:
    columns = ("from", "to", "u (mm)", "resulting mean u (mm)", "gain (µm)", *(("done at (s)",) if scheduled else ()))
    lines = [
        (
            c.from_,
            c.to,
            f"{c.u / MILLIMETRE:.4f}",
            f"{c.mean_u / MILLIMETRE:.5f}",
            f"{c.gain * 1e6:.4f}",
            *((f"{c.at_s:g}",) if scheduled else ()),
        )
        for c in rows
    ]
    return table(columns, lines, "ttnnn" + ("n" if scheduled else ""))


def write_plan(
    plan_findings: PlanFindings,
    directory: Path,
    inputs: Mapping[str, str],
    *,
    progress: Callable[[str, int, int], None] | None = None,
) -> None:
    """Write report, tables and JSON of a plan, and last the provenance with their hashes."""
    when = datetime.now(UTC)
    files: Files = {
        "report.html": lambda: plan_report(plan_findings, when, inputs),
        "points.csv": lambda: "".join(coordinates_csv(plan_findings.findings)),
        "candidates.csv": lambda: "".join(candidates_csv(plan_findings.plan.candidates, plan_findings.picked)),
        "plan.json": lambda: json_page(plan_object(plan_findings)),
    }
    provenance = {"format": FORMAT, "made_by": "catseye plan"}
    write_files(files, directory, {**provenance, **origin(when, inputs)}, progress=progress)
