"""Terminal output: answers on stdout, progress and one line about a failure on stderr."""

import os
import re
import sys
import textwrap
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from types import MappingProxyType, TracebackType

from catseye.errors import ArgumentError, CatseyeError

WIDTH = 100  # columns; longer lines are hard to read
INTERVAL = 0.1  # s between two refreshes of the progress line
FIRST_LINE, BETWEEN_LINES = 10.0, 10.0  # s until progress is told where stderr is no terminal, and between its lines
BEAT = 1.0  # s between two looks at a step that is silent
SURE = 2.0  # s of a step before its end is predicted
SLOW = 3.0  # times the mean of its parts, for which a step may be silent

_for_programs: ContextVar[bool] = ContextVar("for_programs", default=False)  # the running command has `--json`


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
    except ArgumentError as problem:
        complain(by_options(str(problem), problem.names))
        return 2
    except CatseyeError as problem:
        complain(str(problem))
        return 1
    except (MemoryError, ImportError, OSError) as problem:
        from catseye.memory import is_memory_error, out_of_memory

        if is_memory_error(problem):
            complain(out_of_memory(problem))
        elif isinstance(problem, OSError):
            complain(f"{problem.filename or 'input or output'}: {problem.strerror or problem}")
        else:
            raise
        return 1
    return 0


def by_options(text: str, names: Iterable[str], options: Mapping[str, str] = MappingProxyType({})) -> str:
    """A text with the options of a command in place of the arguments of its call.

    names     arguments that the text names
    options   their spellings, where an option is not spelled as its argument

    >>> by_options("give pressure_hpa or barometer_mmhg", ["pressure_hpa", "barometer_mmhg"])
    'give --pressure-hpa or --barometer-mmhg'
    >>> by_options("since 3 is not before until 2", ["since", "until"], {"since": "--from"})
    '--from 3 is not before --until 2'
    """
    if not (pattern := "|".join(re.escape(name) for name in names)):
        return text
    return re.sub(
        rf"(?<!-)\b({pattern})\b", lambda found: options.get(found[0], f"--{found[0].replace('_', '-')}"), text
    )


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
    return textwrap.fill(
        text, max(width, 40), break_on_hyphens=False, initial_indent=f"{title:<13} ", subsequent_indent=" " * 14
    )


@contextmanager
def for_programs(json: bool) -> Iterator[None]:
    """Run a command that answers programs, or people: what `ProgressLine` goes by."""
    before = _for_programs.set(json)
    try:
        yield
    finally:
        _for_programs.reset(before)


class ProgressLine:
    """Progress on stderr, with an estimate of the remaining time.

    On a terminal one line that changes; elsewhere plain lines, few and only of long work, and none at all with
    `--json`, whose reader expects stderr empty unless something is wrong. A step that says nothing for long, as the
    page of a report, is named again with how long it has taken.
    """

    def __init__(self, quiet: bool, json: bool | None = None) -> None:
        """quiet: nothing at all; json: no plain lines; None: as the running command says."""
        here = sys.stderr is not None
        silent = _for_programs.get() if json is None else json
        self._shown = not quiet and here and sys.stderr.isatty()
        self._plain = not quiet and here and not self._shown and not silent
        self._last = ""
        self._start = self._next = time.monotonic()
        self._next_line = self._start + FIRST_LINE
        self._since, self._counts = self._start, (0, 0)
        self._lock, self._over = threading.Lock(), threading.Event()
        self._beat: threading.Thread | None = None

    def __call__(self, what: str, done: int, total: int) -> None:
        with self._lock:
            now = time.monotonic()
            if what.partition(" ")[0] != self._last.partition(" ")[0]:
                self._start = now  # of this step: files that are written one by one are one
            if (changed := what != self._last) or (done, total) != self._counts:
                self._since = now
            self._last, self._counts = what, (done, total)
            self._tell(now, changed)
        if self._beat is None and (self._shown or self._plain):
            self._over.clear()
            self._beat = threading.Thread(target=self._repeat, name="catseye-progress", daemon=True)
            self._beat.start()

    @property
    def counts(self) -> tuple[int, int]:
        """Done, and of how many, as it was last said."""
        return self._counts

    def clear(self) -> None:
        """Wipe the line; nothing more is said until there is more progress."""
        if self._beat is not None:
            self._over.set()
            self._beat.join()
            self._beat = None
        if self._shown:
            self._write("\r\x1b[K")

    def _repeat(self) -> None:
        """Say a step again that is silent, each second on a terminal, in its turn elsewhere."""
        while not self._over.wait(BEAT):
            with self._lock:
                if (now := time.monotonic()) - self._since >= SURE:
                    self._tell(now, False)

    def _tell(self, now: float, changed: bool) -> None:
        what, (done, total) = self._last, self._counts
        if self._shown and (changed or now >= self._next):
            self._next = now + INTERVAL
            bar = "█" * (20 * done // total if total else done % 21)  # without a known end it fills again and again
            self._write(f"\r\x1b[K{bar:·<20} {what} {done}{f'/{total}' if total else ''}{self._left(now, done, total)}")
        elif self._plain and now >= self._next_line:
            self._next_line = now + BETWEEN_LINES
            self._write(f"{what} {done}{f' of {total}' if total else ''}{self._left(now, done, total)}\n")

    def _left(self, now: float, done: int, total: int) -> str:
        """Time that the step has taken and may still take; of a silent step, the time since it began.

        A step that is silent for no longer than its parts take is as far as its last part says.
        """
        passed, silent = now - self._start, now - self._since
        each = (self._since - self._start) / done if done else 0.0
        if silent >= max(SURE, SLOW * each):
            return f", for {duration(silent)}"
        if not 0 < done < total or passed < SURE:
            return ""
        return f", {duration(passed)}, some {duration(max(each * (total - done) - silent, 0.0))} left"

    def _write(self, text: str) -> None:
        with suppress(OSError):
            sys.stderr.write(text)
            sys.stderr.flush()


def duration(seconds: float) -> str:
    """A time for people.

    >>> duration(4.2), duration(75), duration(7300)
    ('4 s', '1 min 15 s', '2 h 1 min')
    """
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"


def _silence_stdout() -> None:
    """Discard buffered output, so that the interpreter's own flush at exit cannot fail."""
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
