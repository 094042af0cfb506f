"""Report of the deformation between two epochs."""

from collections.abc import Mapping
from datetime import datetime

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.gateways.network.comparison import comparison_passages
from catseye.gateways.network.report import network_cards, provenance_section
from catseye.gateways.network.report_charts import displacement_chart, displacement_view, lengthening
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.report import Block, Card, Heading, ReportSection, ResultReport, TableBlock, Text
from catseye.gateways.writers.report_parts import ReportTable, number, text, uncertainty
from catseye.reduction.network.comparison import ComparedEpochs
from catseye.reduction.network.words import quantity


def comparison_report(compared: ComparedEpochs, when: datetime, inputs: Mapping[str, str]) -> ResultReport:
    """Report of two epochs.

    compared   two epochs
    when       UTC
    inputs     SHA-256 of each input file, by name
    """
    first, second = (epoch.network.source or word for epoch, word in ((compared.first, "A"), (compared.second, "B")))
    d = compared.deformation
    settings = {"level of the tests": f"{d.level:g}", "power": f"{d.power:g}", "datums may differ by": d.datum}
    return ResultReport(
        title=f"{second} against {first}: deformation",
        subtitle=(
            f"{len(d.names)} common points, compared by catseye on {when:%Y-%m-%d %H:%M} UTC; displacements are the "
            f"second epoch minus the first, in the axes of {first}, u = standard uncertainty, 1σ"
        ),
        verdict=compared.verdict,
        cards=_cards(compared),
        passages=[
            Passage("Movements", _status(compared)),
            *(p for p in comparison_passages(compared) if p.title == "Assumed"),
        ],
        sections=[_displacements(compared), _epochs(compared), provenance_section(when, inputs, settings)],
        label=f"catseye: {second} against {first}",
    )


def _cards(compared: ComparedEpochs) -> list[Card]:
    d = compared.deformation
    moved = [i for i, word in enumerate(compared.verdicts) if word == "moved"]
    cards = [Card("Moved", f"{len(moved)} of {len(d.names)}", ", ".join(d.names[i] for i in moved[:6]) or "no point")]
    if moved:
        far = max(moved, key=lambda i: compared.length[i])
        cards.append(Card("Farthest", quantity(float(compared.length[far]), "m"), d.names[far]))
    if np.isfinite(d.before.p):
        cards.append(Card("All points congruent", f"p = {d.before.p:.2g}", _chance(d.before.p, d.level)))
    if np.isfinite(d.after.p):
        cards.append(Card("Stable points congruent", f"p = {d.after.p:.2g}", _chance(d.after.p, d.level)))
    factor = compared.variance_factor
    factor_origin = (
        "taken as known"
        if np.isinf(factor.degrees_of_freedom)
        else f"{factor.degrees_of_freedom:.0f} degrees of freedom"
    )
    return [*cards, Card("Variance factor", f"{factor.value:.3f}", f"of both epochs, {factor_origin}")]


def _chance(p: float, level: float) -> str:
    return "significant" if p < level else "not significant"


def _status(compared: ComparedEpochs) -> str:
    """Status of the comparison, and the smallest displacement that its test detects."""
    d = compared.deformation
    detectable = d.detectable[np.isfinite(d.detectable)]
    words = f"{d.status[0].upper()}{d.status[1:]}."
    if not len(detectable):
        return words
    return (
        f"{words} The test of all points detects a displacement of a median point above "
        f"{quantity(float(np.median(detectable)), 'm')}, in the least observable direction, with probability "
        f"{d.power:g}."
    )


def _displacements(compared: ComparedEpochs) -> ReportSection:
    d, axes = compared.deformation, compared.first.network.axis_names
    order = np.argsort(np.nan_to_num(d.p, nan=2.0), kind="stable")
    shift, u, plain = (v[order] / MILLIMETRE for v in (compared.displacement, compared.u, compared.difference[0]))
    keys = [(k, "xyz"[k], name) for k, name in enumerate(axes)]
    table = ReportTable(
        (
            text("point", "point", [d.names[i] for i in order]),
            text("verdict", "verdict", [compared.verdicts[i] for i in order]),
            *(number(f"d{key}", f"d{name}", shift[:, k], "mm", 3, u=f"u_d{key}") for k, key, name in keys),
            number("length", "length", compared.length[order] / MILLIMETRE, "mm", 3),
            *(uncertainty(f"u_d{key}", f"u d{name}", u[:, k], "mm", 3) for k, key, name in keys),
            *(number(f"plain_d{key}", f"plain d{name}", plain[:, k], "mm", 3) for k, key, name in keys),
            number("statistic", "statistic", d.statistic[order], digits=2),
            number("p", "p", d.p[order]),
            number("p_adjusted", "p of all", d.p_adjusted[order]),
            number("detectable", "detectable", d.detectable[order] / MILLIMETRE, "mm", 3),
        ),
        "point",
    )
    lead = (
        "Most significant first. p is the probability of such a displacement or a larger one for a point that did "
        "not move; p of all is corrected for the number of points; the last column is the smallest displacement "
        "that the test of all points detects. Displacements are the best estimate if the stable points did not "
        "move; the plain difference is that of the coordinates."
    )
    scene = displacement_view(compared, lengthening(compared))
    blocks = [scene, displacement_chart(compared), Text(lead), TableBlock("displacements", table)]
    return ReportSection("displacements", "Displacements", blocks)


def _epochs(compared: ComparedEpochs) -> ReportSection:
    blocks: list[Block] = []
    for k, (title, epoch) in enumerate((("First epoch", compared.first), ("Second epoch", compared.second)), start=1):
        heads = (text("quantity", "quantity"), text("value", "value"), text("remark", "remark"))
        blocks += [
            Heading(f"{title}: {epoch.network.source}"),
            Text(epoch.verdict.text),
            Text(f"Datum: {epoch.solution.datum}."),
            TableBlock(f"epoch-{k}", ReportTable.of_rows(network_cards(epoch), *heads)),
        ]
    return ReportSection("epochs", "Epochs", blocks)
