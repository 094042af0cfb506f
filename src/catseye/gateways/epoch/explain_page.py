"""Explanation of a shot on one self-contained page: budget, Monte Carlo, inputs and sources."""

from datetime import datetime
from html import escape

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
from catseye.gateways.writers.drawing import BAD, FAINT, INK, SERIES, Figure, mpl, styled, svgs
from catseye.gateways.writers.objects import versions
from catseye.gateways.writers.page import card, folded, page, paragraph, picture, section, table
from catseye.gateways.writers.verdict import verdict_line
from catseye.records.night.campaign import Campaign
from catseye.reduction.budget.explanation import Explanation
from catseye.reduction.budget.scene import Assumptions

MARK = "<title>catseye: shot "  # identifies a page of catseye
WIDE = 4.5  # standard uncertainties on either side in the histogram
GROUPS = (
    ("the samples", SERIES[0], ("noise", "amplitude", "steps")),
    ("the electronics", SERIES[1], ("reference", "references", "walk")),
    ("the head", SERIES[3], ("leakage", "d0", "axes", "coupling", "cyclic", "frequency")),
    (
        "the air",
        SERIES[2],
        ("thermometer", "profile", "sound", "pressure", "humidity", "formula", "unread", "fluctuation"),
    ),
    ("the glass", SERIES[4], ("height", "ratio", "r1", "r2", "incidence", "across")),
)


def explanation_page(explanation: Explanation, campaign: Campaign, made_at: datetime) -> str:
    """HTML page.

    campaign   of the shot
    made_at    UTC
    """
    name = campaign.site.campaign.name
    header = (
        f"<header><h1>Shot {explanation.shot} of {escape(name)}</h1>"
        f'<div class="faint">{escape(explanation.ranger)} on {escape(explanation.target)}, {when(explanation)}; '
        f"explained by catseye on {made_at:%Y-%m-%d %H:%M} UTC; u = standard uncertainty, 1σ</div></header>"
    )
    words = "".join(f"<dt>{escape(p.title)}</dt><dd>{escape(p.text)}</dd>" for p in explanation_passages(explanation))
    body = [header, verdict_line(explanation.verdict), _cards(explanation), f"<dl>{words}</dl>"]
    if explanation.budget is not None:
        drawn = svgs(figures(explanation))
        body += [
            _budget(explanation, drawn["contributions"]),
            _scattered(drawn.get("histogram")),
            _references(explanation),
        ]
    body.append(_provenance(explanation, campaign, made_at))
    return page(f"catseye: shot {explanation.shot} of {name}", "\n".join(part for part in body if part))


def figures(explanation: Explanation) -> dict[str, Figure]:
    """Contributions of the budget and, after a Monte Carlo, its histogram."""
    with styled():
        drawn = {"contributions": _contributions(explanation)}
        if explanation.scattered is not None:
            drawn["histogram"] = _histogram(explanation)
        return drawn


def _colour(key: str) -> str:
    first = key.partition(" ")[0]
    return next(colour for _, colour, keys in GROUPS if first in keys)


def _contributions(explanation: Explanation) -> Figure:
    budget = explanation.budget
    assert budget is not None
    order = [k for k in np.argsort(-np.abs(budget.share), kind="stable") if abs(budget.share[k]) >= SMALLEST_SHARE]
    size = np.abs(budget.contribution[order]) / MICROMETRE
    figure = Figure(figsize=(9.4, 1.2 + 0.27 * (len(order) + 1)), layout="constrained")
    ax = figure.add_subplot()
    where = np.arange(len(order)) + 1
    ax.barh(0, budget.u / MICROMETRE, color=INK, height=0.62)
    ax.barh(where, size, color=[_colour(explanation.items[k].key) for k in order], height=0.62)
    ax.text(budget.u / MICROMETRE, 0, f"  u {micrometres(budget.u)}", va="center", color=INK, fontweight="bold")
    for y, k, length in zip(where, order, size, strict=True):
        share = 100.0 * budget.share[k]
        ax.text(
            float(length),
            float(y),
            f"  {share:.0f} %" if abs(share) >= 1.0 else f"  {share:.2f} %",
            va="center",
            color=FAINT,
        )
    ax.set_yticks([0, *where], ["together", *(explanation.items[k].given.name for k in order)])
    ax.invert_yaxis()
    ax.set_xlim(0.0, 1.16 * max(budget.u / MICROMETRE, float(size.max(initial=0.0))))
    ax.grid(axis="y", visible=False)
    ax.set_xlabel("contribution to the standard uncertainty, µm (right: share of variance)")
    used = {_colour(explanation.items[k].key) for k in order}
    handles = [mpl.patches.Patch(color=colour, label=name) for name, colour, _ in GROUPS if colour in used]
    ax.legend(handles=handles, loc="lower right")
    return figure


def _histogram(explanation: Explanation) -> Figure:
    budget, scattered = explanation.budget, explanation.scattered
    assert budget is not None
    assert scattered is not None
    figure = Figure(figsize=(9.4, 3.4), layout="constrained")
    ax = figure.add_subplot()
    off = (scattered.values - budget.value) / MICROMETRE
    u = budget.u / MICROMETRE
    edges = np.linspace(-WIDE * u, WIDE * u, 91)
    counts, _ = np.histogram(off, edges)
    density = counts / len(off) / np.diff(edges)
    ax.stairs(density, edges, fill=True, color=SERIES[0] + "40", label=f"{len(off)} draws")
    x = np.linspace(-WIDE * u, WIDE * u, 400)
    ax.plot(x, np.exp(-0.5 * (x / u) ** 2) / (u * np.sqrt(2.0 * np.pi)), color=INK, lw=1.2, label="budget, normal")
    for k, end in enumerate((scattered.low, scattered.high)):
        label = f"{100.0 * scattered.probability:g} % of the draws" if not k else None
        ax.axvline((end - budget.value) / MICROMETRE, color=SERIES[1], lw=1.1, ls="--", label=label)
    if explanation.adjusted is not None:
        d = (explanation.adjusted.distance - budget.value) / MICROMETRE
        if abs(d) < WIDE * u:
            wide = explanation.adjusted.u_distance / MICROMETRE
            ax.axvspan(d - wide, d + wide, color=SERIES[2] + "22", lw=0)
            ax.axvline(d, color=SERIES[2], lw=1.4, label="adjusted distance, ± u")
        else:
            ax.plot([], [], color=BAD, label=f"adjusted distance {micrometres(d * MICROMETRE)} off, outside the figure")
    ax.set_xlim(-WIDE * u, WIDE * u)
    ax.set_ylim(0.0, None)
    ax.set_yticks([])
    ax.grid(axis="y", visible=False)
    ax.set_xlabel(f"range less {metres(budget.value)}, µm")
    ax.legend(loc="upper right", frameon=True, facecolor="white", edgecolor="none", framealpha=0.9)
    return figure


def _cards(explanation: Explanation) -> str:
    budget, cycles = explanation.budget, explanation.cycles
    cards = [card("Status", explanation.status, explanation.reason or "no objection to this shot")]
    if budget is not None and cycles is not None:
        biggest = explanation.items[int(np.argmax(np.abs(budget.share)))].given.name
        cards += [
            card("Range", metres(budget.value), "before any adjustment, scan point to reference point"),
            card("Standard uncertainty", micrometres(budget.u), f"largest part: {biggest}"),
            card(
                f"{100.0 * budget.probability:g} % interval",
                f"± {micrometres(budget.expanded)}",
                f"coverage factor {budget.coverage_factor:.2f}",
            ),
        ]
    return f'<div class="cards">{"".join(cards)}</div>'


def _budget(explanation: Explanation, drawn: str) -> str:
    budget = explanation.budget
    assert budget is not None
    rows = []
    for k in np.argsort(-np.abs(budget.share), kind="stable"):
        item, quantity = explanation.items[k], explanation.items[k].given
        rows.append(
            (
                quantity.name,
                f"{quantity.value:.7g} {item.unit}",
                f"{quantity.u:.2g}",
                distribution(quantity),
                f"{item.slope / MILLIMETRE:.4g}",
                f"{budget.contribution[k] / MICROMETRE:+.2f}",
                f"{100.0 * budget.share[k]:.2f}",
                item.source,
            )
        )
    columns = ("input", "value", "u", "distribution", "mm per unit", "µm", "share, %", "source")
    return section(
        "budget",
        "Budget",
        picture(drawn, "Contribution of each input to the standard uncertainty of this range."),
        table(columns, rows, "tnntnnnw"),
        paragraph(
            "µm: slope times u, with its sign. A share of zero is a second-order effect, or one for which this head's "
            "sheet has no coupling.",
            "faint",
        ),
    )


def _scattered(drawn: str | None) -> str:
    if drawn is None:
        return ""
    return section(
        "monte-carlo",
        "Monte Carlo",
        paragraph(
            "Every input drawn from its distribution and propagated through the chain, not linearised: noise on "
            "the phasors, a path of the drifting electronics, the air along the path, the glass and its tilt."
        ),
        picture(drawn, "Draws of the range against the budget's normal distribution."),
    )


def _references(explanation: Explanation) -> str:
    rows = [(str(shot), f"{after:+.0f}", f"{weight:+.4f}") for shot, after, weight in explanation.references]
    return section(
        "references",
        "Reference shots",
        paragraph(
            "Their weighted mean is the phase of the electronics at this shot; the weights follow from the walk."
        ),
        table(("shot", "seconds after this one", "weight"), rows, "nnn"),
    )


def _provenance(explanation: Explanation, campaign: Campaign, made_at: datetime) -> str:
    assumed = explanation.scene.assumptions if explanation.scene is not None else Assumptions()
    rows = {"made at": f"{made_at:%Y-%m-%d %H:%M:%S} UTC", **versions()}
    rows |= {f"assumed {key}": f"{value:g}" for key, value in vars(assumed).items()}
    return section(
        "provenance",
        "Provenance",
        folded("Versions and assumptions", table(("item", "value"), rows.items(), "tt")),
        folded("SHA-256 of the files read", table(("file", "SHA-256"), campaign.hashes.items(), "th")),
    )
