"""Log of a running site: a line per event and epoch."""

import json
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from catseye.coordinator.journal.entries import EpochSolution
from catseye.coordinator.parts import Clock, ticks_now
from catseye.gateways.writers.objects import plain
from catseye.geometry.sky.time_tag import MJD_EPOCH
from catseye.records.night.live import TICK_SECONDS, TICKS_PER_DAY, Happening

COLOURS = {"debug": "", "note": "", "warning": "\x1b[33m", "alarm": "\x1b[1;31m"}
PLAIN = "\x1b[0m"


class LiveLog:
    """Log lines of events, for people or programs.

    write    takes a line without its end
    json     one JSON object per line: time_utc, mjd, severity, who, kind, text, details; otherwise routine is omitted
    colour   warnings yellow, alarms red
    clock    for messages without a time
    """

    def __init__(self, write: Callable[[str], None], *, clock: Clock, json: bool = False, colour: bool = False):
        self._write, self._clock, self._json, self._colour = write, clock, json, colour

    def entry(self, entry: Any) -> None:
        """Log a durable entry, if it is an event or a solution."""
        if isinstance(entry, Happening):
            self.happened(entry)
        elif isinstance(entry, EpochSolution):
            self.happened(epoch_of(entry))

    def tell(self, who: str, kind: str, text: str, severity: Any = "note") -> None:
        """Log a message with the present time."""
        self.happened(Happening(ticks_now(self._clock), who, kind, text, severity))

    def happened(self, what: Happening) -> None:
        """Log one event as a line; routine only in JSON."""
        if self._json:
            row = {
                "time_utc": time_text(what.ticks),
                "mjd": what.ticks / TICKS_PER_DAY,
                "severity": what.severity,
                "who": what.who,
                "kind": what.kind,
                "text": one_line(what.text),
                "details": plain(what.details),
            }
            self._write(json.dumps(row, allow_nan=False, ensure_ascii=True))
            return
        if what.severity == "debug":
            return
        colour = COLOURS[what.severity] if self._colour else ""
        line = f"{time_text(what.ticks)}  {what.severity:<7}  {what.who:<11}  {one_line(what.text)}"
        self._write(f"{colour}{line}{PLAIN}" if colour else line)


def epoch_of(solution: EpochSolution) -> Happening:
    """An epoch's solution as an event."""
    answer = solution.answer
    if not answer:
        return Happening(solution.ticks, "reduction", "epoch-empty", "no solution", "warning")
    text = (
        f"epoch {answer.get('number')}: {len(answer.get('names', ()))} points from {len(answer.get('used', ()))} shots"
        f", {len(answer.get('rejected', ()))} not used"
    )
    factor, doubts = answer.get("variance_factor"), answer.get("doubts")
    text = text if factor is None else f"{text}, variance factor {factor:.2f}"
    text = f"{text}; doubtful: {doubts[0]}" if doubts else text  # "epoch-doubtful" warns of it, once
    return Happening(solution.ticks, "reduction", "epoch", text)


class LogHandler(logging.Handler):
    """Route Python's logging to a site's log."""

    def __init__(self, log: LiveLog):
        super().__init__()
        self._log = log

    def emit(self, record: logging.LogRecord) -> None:
        severity = "alarm" if record.levelno >= logging.ERROR else "warning"
        severity = severity if record.levelno >= logging.WARNING else "debug"
        who = record.name.rpartition(".")[2] or "python"
        text = self.format(record) if record.exc_info else record.getMessage()
        self._log.tell(who, "log", text, severity)


@contextmanager
def logging_to(log: LiveLog) -> Iterator[None]:
    """Redirect Python's logging and warnings to a log."""
    handler, root = LogHandler(log), logging.getLogger()
    root.addHandler(handler)
    logging.captureWarnings(True)
    try:
        yield
    finally:
        logging.captureWarnings(False)
        root.removeHandler(handler)


def time_text(ticks: int) -> str:
    """UTC to a hundredth of a second, truncated.

    >>> time_text(5288963344910)
    '2003-09-07T15:12:10.00Z'
    """
    from datetime import timedelta

    when = MJD_EPOCH + timedelta(days=ticks // TICKS_PER_DAY, seconds=(ticks % TICKS_PER_DAY) * TICK_SECONDS)
    return f"{when:%Y-%m-%dT%H:%M:%S}.{when.microsecond // 10_000:02d}Z"


def one_line(text: str) -> str:
    """The text on one line, without control characters."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
