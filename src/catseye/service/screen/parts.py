"""Parts of the screen: each a few lines of text, or a table."""

import math
from typing import TYPE_CHECKING, Literal

from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from catseye.constants import DEGREE
from catseye.coordinator.condition import SIGNS, SiteCondition
from catseye.coordinator.parts import TICKS_PER_SECOND, ticks_now
from catseye.service.book import GOOD, RunSummary
from catseye.service.logs import one_line, time_text
from catseye.service.objects import beam_lines
from catseye.service.screen.styles import ALARM, FAINT, OF_SEVERITY, WARNING, WORDS, of_ranger
from catseye.service.views import RunControls

if TYPE_CHECKING:
    from catseye.coordinator.ziy import Coordinator

MOST_PROBLEMS = 4
SEVERITIES = ("note", "warning", "alarm")  # least, of the events that are shown
DOUBT = 24  # characters of an epoch's, in a row; the last one stands among the problems


def head_lines(book: RunSummary, ziy: "Coordinator", condition: SiteCondition, controls: RunControls) -> list[Text]:
    """Site, time, telescope, time of the run; then the site's state and the round's time."""
    first = Text(f"{ziy.site.site.campaign.name}", style="bold")
    first.append(f"  {time_text(ticks_now(ziy.clock))[:19]}Z", style="not bold")
    if book.posture is not None:
        azimuth, elevation = book.posture.azimuth / DEGREE, book.posture.elevation / DEGREE
        first.append(f"  telescope {azimuth:.4f}° {elevation:.4f}°", style="not bold")
    passed, left = controls.span()
    first.append(f"  {span_text(passed)}" + ("" if left is None else f", {span_text(left)} left"), style="not bold")
    second = Text(f" {condition.word.upper()} ", style=WORDS[condition.word])
    active = len(ziy.links) - len(ziy.firing.dropped)
    second.append(
        f"  {ziy.mode}, round {ziy.round_number}{_of_round(ziy)}, {condition.measuring} of {active} rangers measure, "
        f"{book.acknowledged} shots",
        style="not bold default on default",
    )
    return [first, second]


def _of_round(ziy: "Coordinator") -> str:
    """Time of the present round; nothing between two."""
    if ziy.round_ticks is None or ziy.mode != "active":
        return ""
    begin, end = ziy.round_ticks
    passed, whole = (ticks_now(ziy.clock) - begin) / TICKS_PER_SECOND, (end - begin) / TICKS_PER_SECOND
    return f" ({passed:.0f} of {whole:.0f} s)" if 0.0 <= passed <= whole else ""


def problem_lines(condition: SiteCondition) -> list[Text]:
    """Problems, alarms first; at most four lines."""
    lines = [
        Text(f"{problem.severity:<8} {one_line(problem.text)}", style=OF_SEVERITY[problem.severity])
        for problem in condition.problems
    ]
    if len(lines) > MOST_PROBLEMS:
        remainder = len(lines) - MOST_PROBLEMS + 1
        lines = [*lines[: MOST_PROBLEMS - 1], Text(f"{'':<8} and {remainder} more (see STATUS)", style=WARNING)]
    return lines or [Text("no problems", style=FAINT)]


def state_lines(condition: SiteCondition, width: int) -> list[Text]:
    """Last epoch; clock, disk, journal and lease."""
    verdict = condition.verdict
    good = verdict is None or verdict.word == "good"
    summary = "none yet" if verdict is None else f"{condition.epoch} {verdict.word}" + f": {verdict.why}" * good
    epoch = Text(f"epoch    {one_line(summary)}", style="" if good else WARNING)
    parts = (("clock", condition.clock), ("disk", condition.disk), ("journal", condition.journal))
    line = Text()
    for name, text in (*parts, ("lease", condition.holder)):
        line.append(f"{name} ", style=FAINT)
        bad = name in ("clock", "journal") and text != "well"
        line.append(f"{one_line(text)[: width // 3]}   ", style=ALARM if bad else "")
    return [epoch, line]


def ranger_lines(condition: SiteCondition, width: int) -> list[Text]:
    """Rangers with a status character each, and a legend."""
    longest = max((len(name) for name in condition.rangers), default=0)
    a_row = max(1, width // (longest + 3))
    lines, names = [], list(condition.rangers)
    for k in range(0, len(names), a_row):
        line = Text()
        for name in names[k : k + a_row]:
            word = condition.rangers[name]
            line.append(f"{name:<{longest}} {SIGNS[word]} ", style=of_ranger(word))
        lines.append(line)
    present = [word for word in SIGNS if word in condition.rangers.values()]
    return [*lines, Text("   ".join(f"{SIGNS[word]} {word}" for word in present), style=FAINT)]


def truth_lines(book: RunSummary) -> list[Text]:
    """The last epoch and beam beside a simulation's truth."""
    latest = book.latest
    if latest is None:
        return []
    low, high = latest.band
    text = (
        f"truth    {latest.points} points, off {latest.rms_mm:.3f} mm rms, u {latest.mean_u_mm:.3f}, "
        f"chi² {latest.chi2:.2f} ({low:.2f}-{high:.2f})"
    )
    return [Text(text, style="" if latest.chi2 <= high else ALARM), *(Text(line) for line in beam_lines(latest))]


def fault_lines(book: RunSummary) -> list[Text]:
    """Injected faults and their detection."""
    return [
        Text(one_line(fault.line(book.ticks)), style="" if fault.by is not None else WARNING) for fault in book.faults
    ]


def trouble_lines(book: RunSummary) -> list[Text]:
    """Kinds of problems so far, the most frequent first: how often, and the last text."""
    return [
        Text(f"{count:>5} x {one_line(book.troubles.texts[key])}") for key, count in book.troubles.counts.most_common()
    ]


def event_lines(book: RunSummary, severity: str = "note") -> list[Text]:
    """Events except routine, of a severity at least."""
    shown = SEVERITIES[SEVERITIES.index(severity) :]
    return [
        Text(f"{time_text(event.ticks)[11:19]} {one_line(event.text)}", style=OF_SEVERITY[event.severity])
        for event in book.events
        if event.severity in shown
    ]


def rangers_table(book: RunSummary, ziy: "Coordinator", condition: SiteCondition) -> Table:
    """A row a ranger: state, last target, range, its u, shots."""
    table = plain_table("ranger", "", "state", "target", ">range (m)", ">u (mm)", ">shots")
    for name, link in ziy.links.items():
        last = book.last.get(name)
        word = condition.rangers[name]
        state = f"{word}: {' '.join(link.troubles)}" if link.troubles else word
        value, u, target, good = "", "", "", True
        if last is not None:
            good = last.status in GOOD
            value = f"{last.range_:.5f}" if math.isfinite(last.range_) else ""
            u = f"{last.u_range * 1e3:.3f}" if math.isfinite(last.u_range) else ""
            target = last.target if good else f"{last.target} {last.status}"
        style = of_ranger(word) if good or word != "measures" else ""
        shown = Text(name, style), Text(SIGNS[word], style), Text(state, style)
        table.add_row(*shown, Text(target, "" if good else WARNING), value, u, str(book.shots[name]))
    return table


def epochs_table(book: RunSummary, count: int) -> Table:
    """A row an epoch, the last ones: beside the truth where there is one."""
    if book.comparisons:
        table = plain_table(">epoch", ">points", ">off rms", "worst", ">off", ">u (mm)", ">chi²", "99 %")
        for comparison in list(book.comparisons.values())[-count:]:
            low, high = comparison.band
            table.add_row(
                str(comparison.number),
                str(comparison.points),
                f"{comparison.rms_mm:.3f}",
                comparison.worst,
                f"{comparison.worst_mm:.2f}",
                f"{comparison.mean_u_mm:.3f}",
                f"{comparison.chi2:.2f}" + ("" if comparison.chi2 <= high else " !"),
                f"{low:.2f}-{high:.2f}",
                style="" if comparison.chi2 <= high else ALARM,
            )
        return table
    table = plain_table(">epoch", f"{'time':<8}", ">points", ">shots", ">not used", "doubt")
    for row in list(book.epochs)[-count:]:
        counts = (str(row[key]) for key in ("names", "used", "rejected"))
        doubt = "" if row["doubt"] is None else one_line(row["doubt"])
        doubt = doubt if len(doubt) <= DOUBT else f"{doubt[: DOUBT - 1]}…"
        style = "" if row["doubt"] is None else WARNING
        table.add_row(str(row["number"]), time_text(row["ticks"])[11:19], *counts, doubt, style=style)
    return table


def plain_table(*columns: str) -> Table:
    """Table of columns; ">" aligns a column right."""
    table = Table(box=SIMPLE_HEAD, padding=(0, 1), pad_edge=False, header_style=FAINT)
    for column in columns:
        name, right = column.removeprefix(">"), column.startswith(">")
        justify: Literal["left", "right"] = "right" if right else "left"
        table.add_column(name, justify=justify, no_wrap=True, overflow="ellipsis", min_width=len(name))
    return table


def span_text(seconds: float) -> str:
    """A duration for people.

    >>> span_text(72.4), span_text(7325.0)
    ('1:12', '2:02:05')
    """
    whole = max(0, int(seconds))
    minutes = f"{whole // 60 % 60:02d}" if whole >= 3600 else f"{whole // 60}"
    return f"{whole // 3600}:{minutes}:{whole % 60:02d}" if whole >= 3600 else f"{minutes}:{whole % 60:02d}"
