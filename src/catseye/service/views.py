"""Views of a running site: full screen, plain lines, or nothing; imported before anything heavy."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from catseye.service.book import RunSummary
    from catseye.service.coordinator import LiveCoordinator

SHOWN_SEVERITIES = ("warning", "alarm")


@dataclass(frozen=True)
class RunControls:
    """Actions of a person at the screen, and the time of the run.

    stop         ends the run in order
    span         seconds so far, and to come; None: without end
    may_pause    False in virtual time, where a pause would change what is computed
    is_service   True for a site that runs for ever: ending it is asked for twice
    starting     True while the rangers' own process starts, before anything can be said of the site
    """

    stop: Callable[[], None]
    span: Callable[[], tuple[float, float | None]]
    may_pause: bool = True
    is_service: bool = False
    starting: Callable[[], bool] = lambda: False


class View(Protocol):
    """Display of a run, from its start to its end."""

    def open(self, name: str) -> None:
        """Show that a site starts; called in its loop."""
        ...

    def tell(self, text: str) -> None:
        """Show a message during the start."""
        ...

    def progress(self, what: str, done: int, total: int) -> None:
        """Show how far the start is."""
        ...

    def begin(self, book: "RunSummary", running: "LiveCoordinator", controls: RunControls) -> None:
        """Begin to show a coordinator."""
        ...

    def entry(self, entry: Any) -> None:
        """Show a durable entry that the book has."""
        ...

    def end(self) -> None:
        """Stop, at any time, also twice: no more entries will come."""
        ...


class SilentView:
    """A view that shows nothing."""

    def open(self, name: str) -> None:
        """Do nothing: there is no screen."""

    def tell(self, text: str) -> None:
        """Do nothing: there is no screen."""

    def progress(self, what: str, done: int, total: int) -> None:
        """Do nothing: there is no screen."""

    def begin(self, book: "RunSummary", running: "LiveCoordinator", controls: RunControls) -> None:
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
        self._say(" ".join(text.split()))

    def begin(self, book: "RunSummary", running: "LiveCoordinator", controls: RunControls) -> None:
        self._book = book

    def entry(self, entry: Any) -> None:
        from catseye.coordinator.journal.entries import EpochSolution
        from catseye.records.night.live import Happening
        from catseye.service.logs import one_line, time_text
        from catseye.service.objects import epoch_line

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
