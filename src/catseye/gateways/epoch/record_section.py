"""Sections of a reduction's report on its records, and on the points that nothing checks."""

from collections import Counter
from itertools import islice

import numpy as np
from scipy.special import ndtr

from catseye.constants import MILLIMETRE
from catseye.gateways.epoch.record_tests import by_group, explanation_rows, listed_tests, name_of, some, stated_u
from catseye.gateways.epoch.tables import kinds_of
from catseye.gateways.writers.report import (
    Block,
    ChartBlock,
    Heading,
    Items,
    ReportSection,
    TableBlock,
    Text,
)
from catseye.gateways.writers.report_parts import Axis, Chart, ReportColumn, ReportTable, number, text, uncertainty
from catseye.reduction.epoch.coordinates import AdjustedCoordinates
from catseye.reduction.epoch.epoch import Reduction

WORST = 6  # rows of each group in the table
DRAWN = 100  # marks of each group in the chart
EDGE = 12.0  # |w| at which larger ones are drawn
SPREAD = 0.7  # width of a group's column of marks, of the distance between two groups
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)  # its multiples spread evenly between 0 and 1
MANY = 10  # lines of a point from which their number says nothing more
SMALL = 0.001  # probability below which digits say nothing more


def records_section(reduction: Reduction) -> ReportSection:
    """Contradictions, groups of records, and each record's own test."""
    coordinates = reduction.coordinates
    if not coordinates.records:
        untested = Text("No record of this night was tested.")
        return ReportSection("records", "Records", [*_implausible(reduction), untested])
    lead = (
        "Each number of each record is tested: its error is the record less what all ranges and all other records say, "
        "positive where the record states too much; w is the error over its own standard uncertainty. Where nothing "
        "else says anything of a number, it is not tested, and the result rests on it."
    )
    return ReportSection(
        "records",
        "Records",
        [
            Text(lead),
            *_implausible(reduction),
            *_contradictions(reduction),
            TableBlock("record-groups", _groups(reduction), "Records by group, with the largest |w| of each."),
            ChartBlock("record-tests", _chart(reduction), _caption(reduction)),
            TableBlock(
                "record-tests",
                _worst(coordinates),
                f"The {WORST} largest |w| of each group. All numbers are in records.csv.",
                folded="Records with the largest w",
            ),
        ],
    )


def _implausible(reduction: Reduction) -> list[Block]:
    if not reduction.implausible:
        return []
    return [Heading("Records that no site has"), Items([f"{record.note}." for record in reduction.implausible])]


def _contradictions(reduction: Reduction) -> list[Block]:
    contradictions = reduction.coordinates.contradictions
    if not contradictions:
        return [Text("The ranges contradict no record.")]
    rows = [
        (
            row.contradiction,
            row.explanation.record,
            row.explanation.parts[row.part],
            row.explanation.errors[row.part],
            row.explanation.u[row.part],
            row.explanation.unit,
            row.explanation.gain,
            row.explanation.where,
        )
        for row in explanation_rows(contradictions)
    ]
    table = ReportTable.of_rows(
        rows,
        number("contradiction", "no.", digits=0),
        text("record", "record that would be wrong"),
        text("part", "part"),
        number("error", "error", u="u_error"),
        uncertainty("u_error", "u"),
        text("unit", "unit"),
        number("gain", "gain", digits=1),
        text("where", "file and key", kind="long"),
    )
    caption = (
        "Gain: decrease of the weighted sum of squared residuals if that record is wrong by that error. Several rows "
        "with one number and different records explain the same contradiction about as well: only one of them is wrong."
    )
    return [
        Heading("Contradictions"),
        Items([f"{contradiction.text}." for contradiction in contradictions]),
        TableBlock("contradictions", table, caption),
    ]


def _groups(reduction: Reduction) -> ReportTable:
    tested = {test.group: test for test in reduction.coordinates.groups}
    rows = []
    for group, tests in by_group(listed_tests(reduction.coordinates)).items():
        together, worst = tested.get(group), tests[0]
        rows.append(
            (
                str(group),
                worst.w if np.isfinite(worst.w) else None,
                name_of(worst) if np.isfinite(worst.w) else "",
                len({test.record for test in tests}),
                len(tests),
                sum(not np.isfinite(test.w) for test in tests),
                f"{together.statistic:.1f} of {together.degrees}" if together and together.degrees else "",
                _probability(together.probability) if together and together.degrees else "",
            )
        )
    return ReportTable.of_rows(
        rows,
        text("group", "group"),
        number("w", "largest w", digits=1),
        text("worst", "of"),
        number("records", "records", digits=0),
        number("numbers", "numbers", digits=0),
        number("untested", "not tested", digits=0),
        text("chi_squared", "χ², of degrees of freedom"),
        text("probability", "probability by chance"),
    )


def _probability(value: float) -> str:
    return f"{value:.3f}" if value >= SMALL else f"below {SMALL:g}"


def _worst(coordinates: AdjustedCoordinates) -> ReportTable:
    tests = [
        test
        for group in by_group(listed_tests(coordinates)).values()
        for test in islice((t for t in group if np.isfinite(t.w)), WORST)
    ]
    return ReportTable(
        (
            text("record", "record", [name_of(test) for test in tests]),
            text("group", "group", [str(test.group) for test in tests]),
            number("error", "error", [test.error for test in tests], u="u_error"),
            uncertainty("u_error", "u", [test.u_error for test in tests]),
            _by_itself("u_record", "u of the record", [stated_u(test) for test in tests]),
            text("unit", "unit", [test.unit for test in tests]),
            number("w", "w", [test.w for test in tests], digits=2),
            text("where", "file and key", [test.where for test in tests], kind="long"),
        ),
        "record",
    )


def _by_itself(key: str, label: str, values: list[float]) -> ReportColumn:
    """Column of standard uncertainties, each shown to its own two digits."""
    return ReportColumn(key=key, label=label, values=values, kind="number", significant=4, u=key)


def _chart(reduction: Reduction) -> Chart:
    """w of the records, a column of marks for each group."""
    groups = by_group(listed_tests(reduction.coordinates))
    blamed = {e.record for c in reduction.coordinates.contradictions for e in c.explanations}
    names: list[str] = []
    x: list[float] = []
    w: list[float] = []
    mark: list[int] = []
    for column, tests in enumerate(groups.values()):
        for k, test in enumerate(islice((t for t in tests if np.isfinite(t.w)), DRAWN)):
            names.append(name_of(test))
            x.append(column + SPREAD * (((k + 0.5) * GOLDEN) % 1.0 - 0.5))
            w.append(float(np.clip(test.w, -EDGE, EDGE)))
            mark.append(1 if test.record in blamed else 0)
    return Chart(
        "scatter",
        Axis("group of records", "", x, tuple(map(str, groups)), digits=2),
        Axis("w", "", w, digits=3),
        names=names,
        group=mark,
        groups=("not contradicted", "could explain a contradiction") if any(mark) else ("not contradicted",),
        limits=(-reduction.settings.critical, reduction.settings.critical),
    )


def _caption(reduction: Reduction) -> str:
    limit = reduction.settings.critical
    tests = [test for test in listed_tests(reduction.coordinates) if np.isfinite(test.w)]
    clipped = sum(abs(test.w) > EDGE for test in tests)
    crowd = max(map(len, by_group(tests).values()), default=0) > DRAWN
    chance = 2.0 * float(ndtr(-limit)) * len(tests)
    return (
        f"w of each number of a record. Dashed: ±{limit:g}; by chance, {chance:.1f} of {len(tests)} lie beyond."
        + (f" {clipped} with |w| above {EDGE:g} are drawn at the edge." if clipped else "")
        + (f" Of a group of more than {DRAWN}, those with the largest |w|." if crowd else "")
    )


def scatter_blocks(reduction: Reduction) -> list[Block]:
    """Scatter of the shots by class of points, against their claim."""
    scatter = reduction.coordinates.scatter
    if not scatter:
        return []
    table = ReportTable.of_rows(
        [(s.name, s.shots, s.factor, s.sway_m / MILLIMETRE if s.sway_m else None) for s in scatter],
        text("class", "class of points"),
        number("shots", "shots", digits=0),
        number("variance_factor", "variance factor", digits=2),
        number("sway", "sway included", unit="mm", digits=3),
    )
    caption = (
        "Scatter by class of points, expected 1. Sway: standard deviation of a displacement from shot to shot that the "
        "uncertainties include, as the scatter shows it; unknown where they include none."
    )
    return [TableBlock("scatter", table, caption)]


def checks_section(reduction: Reduction) -> ReportSection:
    """Points by number of independent lines; those that nothing checks; those that were not measured."""
    coordinates = reduction.coordinates
    lead = (
        "A line is one ranger and one target, whatever the number of shots on it: shots on one line agree with each "
        "other whatever is wrong with it, so lines check each other, and repeated shots do not. An error of "
        "one line, or of a monument's survey in a direction that no line tests, could move an unchecked point unseen; "
        "pose and surface leave such points out where enough others remain."
    )
    blocks: list[Block] = [Text(lead), TableBlock("lines", _lines(reduction))]
    if coordinates.unchecked:
        caption = "Unchecked points: do not rely on them before other lines check them."
        blocks.append(TableBlock("unchecked", _unchecked(reduction), caption))
    if coordinates.unmeasured:
        caption = "Targets and rangers without a usable shot. They have no coordinates."
        blocks.append(TableBlock("unmeasured", _unmeasured(reduction), caption))
    return ReportSection("checks", "Independent lines", blocks)


def _lines(reduction: Reduction) -> ReportTable:
    """Points by number of lines, without fixed points, to which none leads."""
    coordinates, kinds = reduction.coordinates, list(kinds_of(reduction).values())
    unchecked = set(coordinates.unchecked)
    lines = np.minimum(coordinates.lines, MANY)
    ranged = np.array([kind != "fixed point" for kind in kinds])
    rows = []
    for count in np.unique(lines[ranged]).tolist():
        at = np.flatnonzero(ranged & (lines == count)).tolist()
        of_kind = Counter(kinds[row] for row in at)
        names = [coordinates.points[row] for row in at if coordinates.points[row] in unchecked]
        title = f"{count} or more" if count == MANY else f"{count}"
        rows.append((title, len(at), len(names), some(names), "; ".join(f"{k} {n}" for k, n in of_kind.most_common())))
    return ReportTable.of_rows(
        rows,
        text("lines", "lines"),
        number("points", "points", digits=0),
        number("unchecked", "unchecked", digits=0),
        text("names", "unchecked points", kind="long"),
        text("kinds", "kinds of points", kind="long"),
    )


def _unchecked(reduction: Reduction) -> ReportTable:
    coordinates, kinds = reduction.coordinates, kinds_of(reduction)
    rows = coordinates.rows(coordinates.unchecked)
    u = np.max(coordinates.u[rows], axis=1) / MILLIMETRE
    return ReportTable(
        (
            text("point", "point", coordinates.unchecked),
            text("kind", "kind", [kinds[name] for name in coordinates.unchecked]),
            number("lines", "lines", coordinates.lines[rows], digits=0),
            number("shots", "shots", coordinates.shots[rows], digits=0),
            uncertainty("u", "largest u", u, "mm", 3),
        ),
        "point",
    )


def _unmeasured(reduction: Reduction) -> ReportTable:
    """Unmeasured targets and rangers with the statuses of their shots."""
    shots = reduction.campaign.shots
    status: dict[str, Counter[str]] = {name: Counter() for name in reduction.coordinates.unmeasured}
    for ranger, target, word in zip(shots.ranger, shots.target, reduction.status, strict=True):
        for name in {ranger, target} & status.keys():
            status[name][str(word)] += 1
    return ReportTable.of_rows(
        [
            (name, count.total(), ", ".join(f"{n} {word}" for word, n in count.most_common()) or "no shot")
            for name, count in status.items()
        ],
        text("point", "point"),
        number("shots", "shots", digits=0),
        text("reasons", "statuses of its shots", kind="long"),
        name="point",
    )
