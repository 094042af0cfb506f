"""What people see on a terminal: answers on stdout, progress and one line about a failure on stderr."""

import os
import sys
import textwrap
import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType

from catseye.errors import CatseyeError

WIDTH = 100  # columns; longer lines are hard to read
INTERVAL = 0.1  # s between two refreshes of the progress line


def finish(command: Callable[[], None]) -> int:
    """Run a command and flush what it said; the exit status of this process."""
    sys.excepthook = _unexpected
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.reconfigure(errors="replace")  # type: ignore[union-attr]
    if not sys.warnoptions:
        warnings.simplefilter("ignore")  # stderr is for people and one-line failures; tests make warnings errors
    return attempt(command) or attempt(lambda: say(""))


def attempt(command: Callable[[], None]) -> int:
    """Run a command; what it cannot do becomes one line on stderr. The exit status."""
    try:
        command()
    except SystemExit as leaving:
        return leaving.code if isinstance(leaving.code, int) else 0
    except CatseyeError as problem:
        complain(str(problem))
        return 1
    except OSError as problem:
        complain(f"{problem.filename or 'input or output'}: {problem.strerror or problem}")
        return 1
    return 0


def say(text: str) -> None:
    """Print for whoever reads stdout; a reader who has left had enough, which is no failure."""
    if sys.stdout is None:
        return
    try:
        if text:
            sys.stdout.write(text + "\n")
        sys.stdout.flush()
    except BrokenPipeError:
        _silence_stdout()
    except OSError as problem:
        _silence_stdout()
        problem.filename = "standard output"
        raise


def complain(text: str) -> None:
    """One line on stderr, whatever the text holds."""
    line = "".join(c if c.isprintable() else " " for c in f"catseye: {text}")
    with suppress(OSError, AttributeError):
        sys.stderr.write(" ".join(line.split()) + "\n")
        sys.stderr.flush()


def wrapped(title: str, text: str) -> str:
    """A paragraph under its title, indented, for a terminal."""
    width = WIDTH if not sys.stdout or not sys.stdout.isatty() else min(WIDTH, os.get_terminal_size().columns)
    return textwrap.fill(text, max(width, 40), initial_indent=f"{title:<14}", subsequent_indent=" " * 14)


class ProgressLine:
    """One line on stderr that says what is being done, when stderr is a terminal; nothing otherwise."""

    def __init__(self, quiet: bool) -> None:
        self._shown = not quiet and sys.stderr is not None and sys.stderr.isatty()
        self._last = ""
        self._next = 0.0

    def __call__(self, what: str, done: int, total: int) -> None:
        now = time.monotonic()
        if not self._shown or (what == self._last and now < self._next):
            return
        self._last, self._next = what, now + INTERVAL
        bar = "█" * (20 * done // total if total else done % 21)  # without a known end it fills again and again
        self._write(f"{bar:·<20} {what} {done}{f'/{total}' if total else ''}")

    def clear(self) -> None:
        if self._shown:
            self._write("")

    def _write(self, text: str) -> None:
        with suppress(OSError):
            sys.stderr.write(f"\r\x1b[K{text}")
            sys.stderr.flush()


def _silence_stdout() -> None:
    """What is still buffered goes nowhere, so that the interpreter's own flush at its end cannot fail."""
    with suppress(OSError, ValueError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, sys.stdout.fileno())
        os.close(null)


def _unexpected(kind: type[BaseException], problem: BaseException, trace: TracebackType | None) -> None:
    """A fault of ours: one line with the place, for the report that we ask for."""
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    place = f" ({os.path.basename(trace.tb_frame.f_code.co_filename)}:{trace.tb_lineno})" if trace is not None else ""
    complain(f"internal error, please report it: {kind.__name__}: {problem}{place}")
