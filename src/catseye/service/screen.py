"""Views of a running site: full screen, plain lines, or nothing.

The screen needs a terminal of 80 x 24 or more. It is read at three in the morning: problems come first, all rangers
have at least a character, and ongoing problems are not pushed off by new events.
"""

import asyncio
import math
import os
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING, Any

from catseye.constants import DEGREE
from catseye.coordinator.condition import SIGNS, WRONG, SiteCondition
from catseye.coordinator.journal.entries import EpochSolution
from catseye.coordinator.parts import ticks_now
from catseye.interruption import undo_on_interruption
from catseye.records.night.live import Happening
from catseye.service.book import GOOD, RunSummary
from catseye.service.logs import one_line, time_text
from catseye.service.objects import beam_lines, epoch_line

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.table import Table
    from rich.text import Text

    from catseye.service.coordinator import LiveCoordinator

PERIOD = 0.25  # s between two updates
IDLE_PERIOD = 1.0  # s between two updates without durable entries
NARROW = 138  # columns: in a narrower console the parts are stacked
TALL = 34  # lines that the wide layout needs
LEAST_WIDTH, LEAST_HEIGHT = 60, 20
MOST_PROBLEMS, LAST_EVENTS = 4, 5
WORDS = {
    "starting": "bold",
    "well": "bold green",
    "impaired": "bold yellow",
    "alarm": "bold white on red",
    "stopped": "bold white on red",
}
SHOWN_SEVERITIES = ("warning", "alarm")
EPOCHS, EVENTS = 7, 9  # shown
STYLES = {"debug": "dim", "note": "", "warning": "yellow", "alarm": "bold red"}


class SilentView:
    """A view that shows nothing."""

    def tell(self, text: str) -> None:
        """Do nothing: there is no screen."""

    def begin(self, book: RunSummary, running: "LiveCoordinator") -> None:
        """Do nothing: there is no screen."""

    def entry(self, entry: Any) -> None:
        """Do nothing: there is no screen."""

    def end(self) -> None:
        """Do nothing: there is no screen."""


class LinesView(SilentView):
    """A line per epoch, and per warning of more than one shot.

    say   takes a line
    """

    def __init__(self, say: Callable[[str], None]):
        self._say = say
        self._book: RunSummary | None = None
        self._found: set[str] = set()  # detected faults already shown

    def tell(self, text: str) -> None:
        self._say(one_line(text))

    def begin(self, book: RunSummary, running: "LiveCoordinator") -> None:
        self._book = book

    def entry(self, entry: Any) -> None:
        if isinstance(entry, EpochSolution) and self._book is not None:
            latest = self._book.latest
            if latest is not None and latest.number == entry.answer.get("number"):
                self._say(f"{time_text(entry.ticks)}  {epoch_line(latest)}")
        elif isinstance(entry, Happening) and entry.severity in SHOWN_SEVERITIES:
            self._say(f"{time_text(entry.ticks)}  {entry.severity}: {one_line(entry.text)}")
        for fault in self._book.faults if self._book is not None else ():
            if fault.by is not None and fault.text not in self._found:
                self._found.add(fault.text)
                self._say(f"{time_text(fault.by.ticks)}  fault {one_line(fault.line(fault.by.ticks))}")


class ScreenView(SilentView):
    """A full-screen view on stderr, updated four times a second.

    The last picture stays.

    console   None: a new one on stderr
    """

    def __init__(self, console: "Console | None" = None):
        from rich.console import Console

        self._console = console or Console(stderr=True, highlight=False)
        self._stack = ExitStack()
        self._live: Any = None
        self._book: RunSummary | None = None
        self._running: LiveCoordinator | None = None
        self._next = 0.0
        self._timer: asyncio.TimerHandle | None = None

    def tell(self, text: str) -> None:
        if self._live is None:
            self._console.print(one_line(text), style="dim", markup=False)

    def begin(self, book: RunSummary, running: "LiveCoordinator") -> None:
        from rich.live import Live

        self._book, self._running = book, running
        self._live = Live(console=self._console, auto_refresh=False, redirect_stdout=False, redirect_stderr=False)
        self._stack.enter_context(undo_on_interruption(_show_cursor))
        self._stack.enter_context(self._live)
        self._timer = asyncio.get_running_loop().call_later(IDLE_PERIOD, self._tick)

    def _tick(self) -> None:
        """Redraw even without new entries, to show that none come."""
        self.entry(None)
        self._timer = asyncio.get_running_loop().call_later(IDLE_PERIOD, self._tick)

    def entry(self, entry: Any) -> None:
        time_s = time.monotonic()
        if self._live is not None and (time_s >= self._next or isinstance(entry, EpochSolution)):
            self._next = time_s + PERIOD
            self._live.update(self.picture(), refresh=True)

    def end(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        if self._live is not None:
            self._live.update(self.picture(), refresh=True)
        self._stack.close()
        self._live = None

    def picture(self) -> "RenderableType":
        """The whole picture, for the console's width and height."""
        from rich.console import Group
        from rich.table import Table
        from rich.text import Text

        if self._book is None or self._running is None:
            return Text("")
        condition = self._running.ziy.condition.now()
        width = max(self._console.width, LEAST_WIDTH)
        height = max(self._console.height, LEAST_HEIGHT) - 1  # the cursor's line
        top = [*self._head(condition), *_problem_lines(condition), *self._state_lines(condition, width)]
        if width >= NARROW and height >= TALL:
            columns = Table.grid(padding=(0, 2), expand=True)
            columns.add_column()
            columns.add_column(ratio=1)
            columns.add_row(self._rangers(condition), Group(self._epochs(), self._beam(), self._events(EVENTS)))
            return Group(*_cut(top, width), columns)
        more, table = [*self._truth_lines(), *self._fault_lines()], len(self._running.ziy.links) + 3
        tall = height >= len(top) + table + LAST_EVENTS + len(more)
        lines = top if tall else [*top, *ranger_lines(condition, width)]
        free = height - len(lines) - table * tall - LAST_EVENTS
        lines = [*lines, *more[: max(free, 0)]]
        events = self._event_lines(LAST_EVENTS + max(min(free - len(more), EVENTS - LAST_EVENTS), 0))
        parts: list[RenderableType] = [*_cut(lines, width)]
        return Group(*parts, *([self._rangers(condition)] if tall else []), *_cut(events, width))

    def _head(self, condition: SiteCondition) -> "list[Text]":
        """Site, time, telescope; then the site's state."""
        from rich.text import Text

        assert self._book is not None
        assert self._running is not None
        book, ziy = self._book, self._running.ziy
        first = Text(f"{ziy.site.site.campaign.name}", style="bold")
        first.append(f"  {time_text(ticks_now(ziy.clock))[:19]}Z", style="not bold")
        if book.posture is not None:
            azimuth, elevation = book.posture.azimuth / DEGREE, book.posture.elevation / DEGREE
            first.append(f"  telescope {azimuth:.4f}° {elevation:.4f}°", style="not bold")
        second = Text(f" {condition.word.upper()} ", style=WORDS[condition.word])
        active = len(ziy.links) - len(ziy.firing.dropped)
        second.append(
            f"  {ziy.mode}, round {ziy.round_number}, {condition.measuring} of {active} rangers measure, "
            f"{book.acknowledged} shots",
            style="not bold default on default",
        )
        return [first, second]

    def _state_lines(self, condition: SiteCondition, width: int) -> "list[Text]":
        """Last epoch; clock, disk, journal and lease."""
        from rich.text import Text

        verdict = condition.verdict
        good = verdict is None or verdict.word == "good"
        summary = "none yet" if verdict is None else f"{condition.epoch} {verdict.word}" + f": {verdict.why}" * good
        epoch = Text(f"epoch    {one_line(summary)}", style="" if good else "yellow")
        parts = (("clock", condition.clock), ("disk", condition.disk), ("journal", condition.journal))
        line = Text()
        for name, text in (*parts, ("lease", condition.holder)):
            line.append(f"{name} ", style="dim")
            bad = name in ("clock", "journal") and text != "well"
            line.append(f"{one_line(text)[: width // 3]}   ", style="bold red" if bad else "")
        return [epoch, line]

    def _truth_lines(self) -> "list[Text]":
        """The last epoch and beam beside a simulation's truth."""
        from rich.text import Text

        latest = None if self._book is None else self._book.latest
        if latest is None:
            return []
        low, high = latest.band
        text = (
            f"truth    {latest.points} points, off {latest.rms_mm:.3f} mm rms, u {latest.mean_u_mm:.3f}, "
            f"chi² {latest.chi2:.2f} ({low:.2f}-{high:.2f})"
        )
        return [Text(text, style="" if latest.chi2 <= high else "red"), *(Text(line) for line in beam_lines(latest))]

    def _fault_lines(self) -> "list[Text]":
        """Injected faults and their detection."""
        from rich.text import Text

        if self._book is None:
            return []
        ticks = self._book.ticks
        return [
            Text(one_line(fault.line(ticks)), style="" if fault.by is not None else "yellow")
            for fault in self._book.faults
        ]

    def _event_lines(self, count: int) -> "list[Text]":
        """The last events except routine."""
        from rich.text import Text

        return [
            Text(f"{time_text(event.ticks)[11:19]} {one_line(event.text)}", style=STYLES[event.severity])
            for event in list(self._book.events if self._book is not None else ())[-count:]
        ]

    def _rangers(self, condition: SiteCondition) -> "Table":
        table = _table("ranger", "state", "target", ">range (m)", ">u (mm)", ">shots")
        book, ziy = self._book, self._running.ziy if self._running is not None else None
        if book is None or ziy is None:
            return table
        for name, link in ziy.links.items():
            last = book.last.get(name)
            word = condition.rangers[name]
            state = f"{word}: {' '.join(link.troubles)}" if link.troubles else word
            style = "" if word not in WRONG else ("bold red" if WRONG[word] == "alarm" else "yellow")
            if last is None:
                table.add_row(name, state, "", "", "", str(book.shots[name]), style=style)
                continue
            good = last.status in GOOD
            value = f"{last.range_:.5f}" if math.isfinite(last.range_) else ""
            u = f"{last.u_range * 1e3:.3f}" if math.isfinite(last.u_range) else ""
            target = last.target if good else f"{last.target} {last.status}"
            table.add_row(name, state, target, value, u, str(book.shots[name]), style=style or ("" if good else "red"))
        return table

    def _epochs(self) -> "Table":
        table = _table(">epoch", ">points", ">off rms", "worst", ">off", ">u (mm)", ">chi²", "99 %")
        if self._book is not None:
            for comparison in list(self._book.comparisons.values())[-EPOCHS:]:
                low, high = comparison.band
                table.add_row(
                    str(comparison.number),
                    str(comparison.points),
                    f"{comparison.rms_mm:.3f}",
                    comparison.worst,
                    f"{comparison.worst_mm:.2f}",
                    f"{comparison.mean_u_mm:.3f}",
                    f"{comparison.chi2:.2f}",
                    f"{low:.2f}-{high:.2f}",
                    style="" if comparison.chi2 <= high else "red",
                )
        return table

    def _beam(self) -> "RenderableType":
        from rich.text import Text

        latest = None if self._book is None else self._book.latest
        lines = [] if latest is None else list(beam_lines(latest))
        return Text("\n".join(lines) or "beam: unknown before the reference epoch", style="" if lines else "dim")

    def _events(self, count: int) -> "RenderableType":
        from rich.text import Text

        lines = [*self._fault_lines(), *self._event_lines(count)]
        return Text("\n", no_wrap=True, overflow="ellipsis").join([Text(""), *lines])


def _problem_lines(condition: SiteCondition) -> "list[Text]":
    """Problems, alarms first; at most four lines."""
    from rich.text import Text

    lines = [
        Text(f"{problem.severity:<8} {one_line(problem.text)}", style=STYLES[problem.severity])
        for problem in condition.problems
    ]
    if len(lines) > MOST_PROBLEMS:
        remainder = len(lines) - MOST_PROBLEMS + 1
        lines = [*lines[: MOST_PROBLEMS - 1], Text(f"{'':<8} and {remainder} more (see STATUS)", style="yellow")]
    return lines or [Text("no problems", style="dim")]


def ranger_lines(condition: SiteCondition, width: int) -> "list[Text]":
    """Rangers with a status character each, and a legend."""
    from rich.text import Text

    longest = max((len(name) for name in condition.rangers), default=0)
    a_row = max(1, width // (longest + 3))
    lines, names = [], list(condition.rangers)
    for k in range(0, len(names), a_row):
        line = Text()
        for name in names[k : k + a_row]:
            word = condition.rangers[name]
            style = "" if word not in WRONG else ("bold red" if WRONG[word] == "alarm" else "yellow")
            line.append(f"{name:<{longest}} {SIGNS[word]} ", style=style)
        lines.append(line)
    present = [word for word in SIGNS if word in condition.rangers.values()]
    return [*lines, Text("   ".join(f"{SIGNS[word]} {word}" for word in present), style="dim")]


def _cut(lines: "list[Text]", width: int) -> "list[Text]":
    """Lines truncated to the console's width."""
    for line in lines:
        line.no_wrap, line.overflow = True, "ellipsis"
        line.truncate(width, overflow="ellipsis")
    return lines


def _table(*columns: str) -> "Table":
    """Table of columns; ">" aligns a column right."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD, padding=(0, 1), pad_edge=False, header_style="dim")
    for column in columns:
        table.add_column(column.removeprefix(">"), justify="right" if column.startswith(">") else "left", no_wrap=True)
    return table


def _show_cursor() -> None:
    """Show the cursor again after a forced exit."""
    with suppress(OSError, ValueError, AttributeError):
        os.write(sys.stderr.fileno(), b"\x1b[?25h")
