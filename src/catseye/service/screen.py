"""What is seen of a simulated site while it runs: a screen on a terminal, plain lines elsewhere, or nothing."""

import math
import os
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING, Any

from catseye.constants import DEGREE
from catseye.coordinator.firing import OF_THE_LINE
from catseye.coordinator.journal.entries import EpochSolution
from catseye.gateways.writers.interruption import undone_when_interrupted
from catseye.records.night.live import Happening
from catseye.service.book import GOOD, LiveBook
from catseye.service.logs import one_line, time_text
from catseye.service.objects import beam_lines, epoch_line

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.table import Table

    from catseye.service.coordinator import LiveCoordinator

EVERY = 0.25  # s between two pictures
NARROW = 138  # columns: below, the right half goes beneath the left
EPOCHS, EVENTS = 7, 9  # shown
STYLES = {"note": "", "warning": "yellow", "alarm": "bold red"}


class SilentView:
    """A view that shows nothing."""

    def tell(self, text: str) -> None:
        """Tell a person: there is no screen."""

    def begin(self, book: LiveBook, running: "LiveCoordinator") -> None:
        """Begin to show: there is no screen."""

    def entry(self, entry: Any) -> None:
        """Show an entry: there is no screen."""

    def end(self) -> None:
        """End to show: there is no screen."""


class LinesView(SilentView):
    """A line for each epoch, and for each warning that is of more than one shot.

    say   takes a line
    """

    def __init__(self, say: Callable[[str], None]):
        self._say = say
        self._book: LiveBook | None = None
        self._found: set[str] = set()  # faults on command that were told

    def tell(self, text: str) -> None:
        self._say(one_line(text))

    def begin(self, book: LiveBook, running: "LiveCoordinator") -> None:
        self._book = book

    def entry(self, entry: Any) -> None:
        if isinstance(entry, EpochSolution) and self._book is not None:
            latest = self._book.latest
            if latest is not None and latest.number == entry.answer.get("number"):
                self._say(f"{time_text(entry.ticks)}  {epoch_line(latest)}")
        elif isinstance(entry, Happening) and entry.severity != "note" and entry.kind not in OF_THE_LINE:
            self._say(f"{time_text(entry.ticks)}  {entry.severity}: {one_line(entry.text)}")
        for each in self._book.faults if self._book is not None else ():
            if each.by is not None and each.text not in self._found:
                self._found.add(each.text)
                self._say(f"{time_text(each.by.ticks)}  fault {one_line(each.line(each.by.ticks))}")


class ScreenView(SilentView):
    """A picture on the terminal that stderr is, four times a second; the last one stays.

    console   None: a new one on stderr
    """

    def __init__(self, console: "Console | None" = None):
        from rich.console import Console

        self._console = console or Console(stderr=True, highlight=False)
        self._stack = ExitStack()
        self._live: Any = None
        self._book: LiveBook | None = None
        self._running: LiveCoordinator | None = None
        self._next = 0.0

    def tell(self, text: str) -> None:
        if self._live is None:
            self._console.print(one_line(text), style="dim", markup=False)

    def begin(self, book: LiveBook, running: "LiveCoordinator") -> None:
        from rich.live import Live

        self._book, self._running = book, running
        self._live = Live(console=self._console, auto_refresh=False, redirect_stdout=False, redirect_stderr=False)
        self._stack.enter_context(undone_when_interrupted(_show_cursor))
        self._stack.enter_context(self._live)

    def entry(self, entry: Any) -> None:
        now = time.monotonic()
        if self._live is not None and (now >= self._next or isinstance(entry, EpochSolution)):
            self._next = now + EVERY
            self._live.update(self.picture(), refresh=True)

    def end(self) -> None:
        if self._live is not None:
            self._live.update(self.picture(), refresh=True)
        self._stack.close()
        self._live = None

    def picture(self) -> "RenderableType":
        """All of it, for the console's width and height."""
        from rich.console import Group
        from rich.table import Table

        rangers, side = self._rangers(), Group(self._epochs(), self._beam(), self._events())
        if self._console.width < NARROW:
            return Group(self._header(), self._epochs(), self._beam(), rangers)
        both = Table.grid(padding=(0, 2), expand=True)
        both.add_column()
        both.add_column(ratio=1)
        both.add_row(rangers, side)
        return Group(self._header(), both)

    def _header(self) -> "RenderableType":
        from rich.text import Text

        book, ziy = self._book, self._running.ziy if self._running is not None else None
        if book is None or ziy is None:
            return Text("")
        posture = book.posture
        text = Text(f"{ziy.site.site.campaign.name}", style="bold")
        if posture is not None:
            azimuth, elevation = posture.azimuth / DEGREE, posture.elevation / DEGREE
            text.append(
                f"   {time_text(posture.ticks)}   telescope {azimuth:8.4f}° {elevation:7.4f}°", style="not bold"
            )
        ready = sum(link.state == "ready" for link in ziy.links.values())
        asked = len(ziy.links) - len(ziy.firing.dropped)
        text.append(
            f"   {ziy.mode}, round {ziy.round_number}, {ready} of {asked} rangers ready, {book.acknowledged} shots",
            style="not bold",
        )
        return text

    def _rangers(self) -> "Table":
        table = _table("ranger", "state", "target", ">range (m)", ">u (mm)", ">shots")
        book, ziy = self._book, self._running.ziy if self._running is not None else None
        if book is None or ziy is None:
            return table
        for name, link in ziy.links.items():
            last = book.last.get(name)
            state = "dropped" if name in ziy.firing.dropped else " ".join(link.troubles) or link.state
            style = "" if state == "ready" else "yellow"
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
            for each in list(self._book.comparisons.values())[-EPOCHS:]:
                low, high = each.band
                table.add_row(
                    str(each.number),
                    str(each.points),
                    f"{each.rms_mm:.3f}",
                    each.worst,
                    f"{each.worst_mm:.2f}",
                    f"{each.mean_u_mm:.3f}",
                    f"{each.chi2:.2f}",
                    f"{low:.2f}-{high:.2f}",
                    style="" if each.chi2 <= high else "red",
                )
        return table

    def _beam(self) -> "RenderableType":
        from rich.text import Text

        latest = None if self._book is None else self._book.latest
        lines = [] if latest is None else list(beam_lines(latest))
        return Text("\n".join(lines) or "beam: known after the reference epoch", style="" if lines else "dim")

    def _events(self) -> "RenderableType":
        from rich.text import Text

        text = Text("\n", no_wrap=True, overflow="ellipsis")
        for each in self._book.faults if self._book is not None else ():
            line = f"{one_line(each.line(self._book.ticks if self._book is not None else 0))}\n"
            text.append(line, style="" if each.by is not None else "yellow")
        for event in list(self._book.events if self._book is not None else ())[-EVENTS:]:
            line = f"{time_text(event.ticks)[11:19]} {one_line(event.text)}\n"
            text.append(line, style=STYLES[event.severity])
        return text


def _table(*columns: str) -> "Table":
    """With a ">" before those that stand to the right."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD, padding=(0, 1), pad_edge=False, header_style="dim")
    for column in columns:
        table.add_column(column.removeprefix(">"), justify="right" if column.startswith(">") else "left", no_wrap=True)
    return table


def _show_cursor() -> None:
    """Where the picture is cut off by force."""
    with suppress(OSError, ValueError, AttributeError):
        os.write(sys.stderr.fileno(), b"\x1b[?25h")
