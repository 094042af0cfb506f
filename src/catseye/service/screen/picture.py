"""The whole picture: state and problems first, then the part that was chosen, then the keys."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rich.console import Console, Group, RenderableType
from rich.table import Table
from rich.text import Text

from catseye.coordinator.condition import SiteCondition
from catseye.service.book import RunSummary
from catseye.service.objects import beam_lines
from catseye.service.screen import parts
from catseye.service.screen.starting import start_line
from catseye.service.screen.styles import CHOSEN, FAINT, WARNING
from catseye.service.views import RunControls

if TYPE_CHECKING:
    from catseye.coordinator.ziy import Coordinator

NARROW = 138  # columns: in a narrower console the parts are stacked
TALL = 34  # lines that the wide layout needs
LEAST_WIDTH, LEAST_HEIGHT = 60, 20
LAST_EVENTS = 5
EPOCHS, EVENTS = 7, 9  # shown beside other parts
HELP_WIDTH = 104  # columns, from which the parts are named in full
PARTS = {"o": "overview", "r": "rangers", "e": "epochs", "v": "events", "f": "faults"}  # by key
HELP = (
    ("q", "end the run: shots come to their end, lasers go off, the journal is closed"),
    ("p", "pause measuring, and resume: mode hold, lasers off; not while another holds the lease"),
    ("o r e v f", "overview, rangers, epochs, events, faults and troubles; or left and right"),
    ("up down", "scroll, also by page"),
    ("s", "severity from which events are shown: note, warning, alarm"),
    ("space", "freeze what is below the problems; the lines above go on"),
    ("?", "this help; Ctrl-C ends at once with status 130, Ctrl-Z suspends"),
)


@dataclass
class Chosen:
    """A person's choices.

    part       one of `PARTS`
    severity   least, of events
    scroll     lines from the end of events, from the beginning of anything else
    help       True for the keys in words
    keys       True if keys are read
    notice     text in place of the keys
    """

    part: str = "overview"
    severity: str = "note"
    scroll: int = 0
    help: bool = False
    keys: bool = False
    notice: str = ""


class Picture:
    """Picture of a coordinator.

    console   whose width and height count
    """

    def __init__(self, console: Console, book: RunSummary, ziy: "Coordinator", controls: RunControls):
        self._console, self._book, self._ziy, self._controls = console, book, ziy, controls
        self._frozen: list[str] | None = None
        self.frozen_at = ""

    def freeze(self, at: str) -> None:
        """Keep the chosen part as it stands, or let it go on: then `at` is empty."""
        self.frozen_at, self._frozen = at, None

    def lines(self, chosen: Chosen) -> list[str]:
        """Lines for the console, with their colours."""
        width, height = max(self._console.width, LEAST_WIDTH), max(self._console.height, LEAST_HEIGHT)
        condition = self._ziy.condition.now()
        top = [
            *parts.head_lines(self._book, self._ziy, condition, self._controls),
            *_starting(condition),
            *parts.problem_lines(condition),
            *parts.state_lines(condition, width),
        ]
        bottom = [self._bottom(chosen, width)] if chosen.keys or chosen.notice else []
        room = height - len(top) - len(bottom)
        body = self._frozen if self._frozen is not None else self._body(chosen, condition, width, room)
        if self.frozen_at and self._frozen is None:
            self._frozen = body
        shown = [*self._printed([*_cut(top, width)], width), *body[:room]]
        blank = [""] * (room - len(body)) if bottom else []
        return [*shown, *blank, *self._printed(_cut(bottom, width), width)]

    def _printed(self, renderables: "Sequence[RenderableType]", width: int) -> list[str]:
        if not renderables:
            return []
        with self._console.capture() as capture:
            self._console.print(Group(*renderables), width=width, overflow="ellipsis", no_wrap=True, crop=True)
        return capture.get().removesuffix("\n").split("\n")

    def _body(self, chosen: Chosen, condition: SiteCondition, width: int, room: int) -> list[str]:
        """The chosen part, within its room."""
        if chosen.help:
            return self._printed([Text(f"{key:<10} {text}") for key, text in HELP], width)
        if chosen.part == "overview":
            return self._overview(condition, width, room, chosen.severity)
        if chosen.part == "events":
            lines = parts.event_lines(self._book, chosen.severity)
            chosen.scroll = max(0, min(chosen.scroll, len(lines) - room))
            end = len(lines) - chosen.scroll
            none = [Text(f"no event of severity {chosen.severity} or above", style=FAINT)]
            return self._printed(_cut(lines[max(0, end - room) : end], width) or none, width)
        whole: list[RenderableType]
        if chosen.part == "rangers":
            whole = [parts.rangers_table(self._book, self._ziy, condition)]
        elif chosen.part == "epochs":
            whole = [parts.epochs_table(self._book, max(room - 8, 1)), *_cut(parts.truth_lines(self._book), width)]
        else:
            none = [Text("no faults, no troubles", style=FAINT)]
            lines = [*parts.fault_lines(self._book), *parts.trouble_lines(self._book)]
            whole = [*(_cut(lines, width) or none)]
        printed = self._printed(whole, width)
        chosen.scroll = max(0, min(chosen.scroll, len(printed) - room))
        return printed[chosen.scroll : chosen.scroll + room]

    def _overview(self, condition: SiteCondition, width: int, room: int, severity: str) -> list[str]:
        """All that matters, as far as there is room."""
        book = self._book
        if width >= NARROW and self._console.height >= TALL:
            columns = Table.grid(padding=(0, 2), expand=True)
            columns.add_column()
            columns.add_column(ratio=1)
            faults, latest = parts.fault_lines(book), book.latest
            beam = [] if latest is None else list(beam_lines(latest))
            table = parts.epochs_table(book, EPOCHS)
            taken = table.row_count + 4 + max(len(beam), 1) + 1 + len(faults)
            events = parts.event_lines(book, severity)[-max(EVENTS, room - taken) :]
            right: list[RenderableType] = [
                table,
                Text("\n".join(beam) or "beam: unknown before the reference epoch", style="" if beam else FAINT),
                Text("\n", no_wrap=True, overflow="ellipsis").join([Text(""), *faults, *events]),
            ]
            columns.add_row(parts.rangers_table(book, self._ziy, condition), Group(*right))
            return self._printed([columns], width)
        more = [*parts.truth_lines(book), *parts.fault_lines(book)]
        rows = len(self._ziy.links) + 3
        tall = room >= rows + LAST_EVENTS + len(more)
        lines = [] if tall else parts.ranger_lines(condition, width)
        free = room - len(lines) - rows * tall - LAST_EVENTS
        lines = [*lines, *more[: max(free, 0)]]
        events = parts.event_lines(book, severity)[-(LAST_EVENTS + max(free - len(more), 0)) :]
        rangers = [parts.rangers_table(book, self._ziy, condition)] if tall else []
        return self._printed([*_cut(lines, width), *rangers, *_cut(events, width)], width)

    def _bottom(self, chosen: Chosen, width: int) -> Text:
        """The keys, or what is to be said of one."""
        if chosen.notice:
            return Text(chosen.notice, style=WARNING)
        line = Text()
        for key, text in (("q", "end"), ("p", "resume" if self._ziy.mode == "hold" else "pause")):
            line.append(key, style="bold")
            line.append(f" {text}  ")
        for key, name in PARTS.items():
            style = CHOSEN if name == chosen.part and not chosen.help else ""
            if width >= HELP_WIDTH:
                line.append(f"{key} {name}", style=style)
                line.append("  ")
            else:
                line.append(key, style=style or "bold")
                line.append(" ")
        if width < HELP_WIDTH:
            line.append(f"{chosen.part}  ")
        severity = "" if chosen.severity == "note" else f": {chosen.severity}"
        line.append("s", style="bold").append(f" severity{severity}  ")
        line.append("space", style="bold").append(" ")
        line.append(f"FROZEN {self.frozen_at}" if self.frozen_at else "freeze", style=CHOSEN if self.frozen_at else "")
        return line.append("  ").append("?", style="bold").append(" help")


def _starting(condition: SiteCondition) -> list[Text]:
    """Progress, until the first shot."""
    words = list(condition.rangers.values())
    ready = sum(word not in ("not connected", "not ready") for word in words)
    return [start_line("rangers ready", ready, len(words))] if condition.word == "starting" else []


def _cut(lines: list[Text], width: int) -> list[Text]:
    """Lines truncated to the console's width."""
    for line in lines:
        line.no_wrap, line.overflow = True, "ellipsis"
        line.truncate(width, overflow="ellipsis")
    return lines
