"""Report of an explained shot: budget, Monte Carlo, inputs and sources."""

from datetime import datetime

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.gateways.epoch.explain import (
    MICROMETRE,
    SMALLEST_SHARE,
    distribution,
    explanation_passages,
    metres,
    micrometres,
    when,
)
from catseye.gateways.writers.report import (
    Block,
    Card,
    ChartBlock,
    ReportSection,
    ResultReport,
    TableBlock,
    Text,
    origin_section,
)
from catseye.gateways.writers.report_parts import Axis, Chart, ReportTable, number, text, uncertainty
from catseye.records.night.campaign import Campaign
from catseye.reduction.budget.explanation import Explanation
from catseye.reduction.budget.scene import Assumptions

MARK = "<title>catseye: shot "  # identifies a page of catseye
MOST_DRAWS = 20_000  # in the histogram


def explanation_report(explanation: Explanation, campaign: Campaign, made_at: datetime) -> ResultReport:
    """Report of a shot.

    campaign   of the shot
    made_at    UTC
    """
    name = campaign.site.campaign.name
    assumed = explanation.scene.assumptions if explanation.scene is not None else Assumptions()
    facts = {f"assumed {key}": f"{value:g}" for key, value in vars(assumed).items()}
    sections = (
        [] if explanation.budget is None else [_budget(explanation), _scattered(explanation), _references(explanation)]
    )
    return ResultReport(
        title=f"Shot {explanation.shot} of {name}",
        subtitle=(
            f"{explanation.ranger} on {explanation.target}, {when(explanation)}; explained by catseye on "
            f"{made_at:%Y-%m-%d %H:%M} UTC; u = standard uncertainty, 1σ"
        ),
        verdict=explanation.verdict,
        cards=_cards(explanation),
        passages=explanation_passages(explanation),
        sections=[*sections, origin_section(made_at, campaign.hashes, facts)],
        label=f"catseye: shot {explanation.shot} of {name}",
    )


def _cards(explanation: Explanation) -> list[Card]:
    budget, cycles = explanation.budget, explanation.cycles
    cards = [Card("Status", explanation.status, explanation.reason or "no objection to this shot")]
    if budget is None or cycles is None:
        return cards
    biggest = explanation.items[int(np.argmax(np.abs(budget.share)))].given.name
    return [
        *cards,
        Card("Range", metres(budget.value), "before any adjustment, scan point to reference point"),
        Card("Standard uncertainty", micrometres(budget.u), f"largest part: {biggest}"),
        Card(
            f"{100.0 * budget.probability:g} % interval",
            f"± {micrometres(budget.expanded)}",
            f"coverage factor {budget.coverage_factor:.2f}",
        ),
    ]


def _budget(explanation: Explanation) -> ReportSection:
    budget = explanation.budget
    assert budget is not None
    order = np.argsort(-np.abs(budget.share), kind="stable").tolist()
    items = [explanation.items[k] for k in order]
    share, contribution = 100.0 * budget.share[order], budget.contribution[order] / MICROMETRE
    drawn = [k for k in range(len(order)) if abs(share[k]) >= 100.0 * SMALLEST_SHARE]
    names = ["together", *(items[k].given.name for k in drawn)]
    chart = Chart(
        "bars",
        Axis("input", "", list(range(len(names))), names, digits=0),
        Axis(
            "contribution to the standard uncertainty",
            "µm",
            [budget.u / MICROMETRE, *np.abs(contribution[drawn])],
            digits=3,
        ),
        names=names,
    )
    table = ReportTable(
        (
            text("input", "input", [item.given.name for item in items]),
            number("value", "value", [item.given.value for item in items]),
            uncertainty("u", "u", [item.given.u for item in items]),
            text("unit", "unit", [item.unit for item in items]),
            text("distribution", "distribution", [distribution(item.given) for item in items]),
            number("slope", "mm per unit", [item.slope / MILLIMETRE for item in items]),
            number("contribution", "contribution", contribution, "µm", 2),
            number("share", "share", share, "%", 2),
            text("source", "source", [item.source for item in items], kind="long"),
        ),
        "input",
    )
    remark = (
        "Contribution: slope times u, with its sign. A share of zero is a second-order effect, or one for which this "
        "head's sheet has no coupling."
    )
    caption = "Contribution of each input to the standard uncertainty of this range."
    blocks: list[Block | None] = [
        ChartBlock("contributions", chart, caption),
        TableBlock("budget", table),
        Text(remark, faint=True),
    ]
    return ReportSection("budget", "Budget", blocks)


def _scattered(explanation: Explanation) -> ReportSection | None:
    """Draws of the range; None without a Monte Carlo."""
    budget, scattered = explanation.budget, explanation.scattered
    if budget is None or scattered is None:
        return None
    off = (scattered.values[:MOST_DRAWS] - budget.value) / MICROMETRE
    ends = [(end - budget.value) / MICROMETRE for end in (scattered.low, scattered.high)]
    x = Axis(f"range less {metres(budget.value)}", "µm", off, digits=1)
    some = (
        f" (the first {MOST_DRAWS} of {len(scattered.values)} are drawn)" if len(scattered.values) > MOST_DRAWS else ""
    )
    adjusted = ""
    if explanation.adjusted is not None:
        d = explanation.adjusted.distance - budget.value
        adjusted = f" The adjusted distance is {micrometres(d)} off, u {micrometres(explanation.adjusted.u_distance)}."
    caption = (
        f"Draws of the range{some} against the normal distribution; dashed: the interval of "
        f"{100.0 * scattered.probability:g} % of the draws. The budget's u is {micrometres(budget.u)}.{adjusted}"
    )
    lead = (
        "Every input drawn from its distribution and propagated through the chain, not linearised: noise on "
        "the phasors, a path of the drifting electronics, the air along the path, the glass and its tilt."
    )
    chart = ChartBlock("histogram", Chart("histogram", x, limits=ends), caption)
    return ReportSection("monte-carlo", "Monte Carlo", [Text(lead), chart])


def _references(explanation: Explanation) -> ReportSection:
    lead = "Their weighted mean is the phase of the electronics at this shot; the weights follow from the walk."
    table = ReportTable.of_rows(
        explanation.references,
        number("shot", "shot", digits=0),
        number("after", "after this one", unit="s", digits=0),
        number("weight", "weight", digits=4),
        name="shot",
    )
    blocks: list[Block | None] = [Text(lead), TableBlock("references", table)]
    return ReportSection("references", "Reference shots", blocks)
