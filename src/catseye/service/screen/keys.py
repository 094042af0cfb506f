"""Keys of a terminal without waiting for the end of a line, and its settings as they were afterwards."""

import asyncio
import os
import re
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

try:
    import termios
    import tty
except ImportError:  # a system without terminals of this kind has no keys
    termios = tty = None  # type: ignore[assignment]

SEQUENCE = re.compile(r"\x1b\[[0-9;]*[A-Za-z~]|\x1bO[A-Z]|.", re.DOTALL)
ARROWS = {"A": "up", "B": "down", "C": "right", "D": "left"}
NAMES = {  # of keys that send more than a character, with and without "application" mode
    **{f"\x1b{form}{letter}": name for form in "[O" for letter, name in ARROWS.items()},
    "\x1b[5~": "page up",
    "\x1b[6~": "page down",
    "\x1b": "escape",
    "\t": "right",
    "\x1b[Z": "left",
}
LONGEST = 256  # bytes read at once


def keys_of(data: bytes) -> list[str]:
    """Keys in what a terminal sent: characters, and names of the others.

    >>> keys_of(b"q\\x1b[A\\x1b")
    ['q', 'up', 'escape']
    """
    pressed = SEQUENCE.findall(data.decode("utf-8", "ignore"))
    return [NAMES.get(key, key) for key in pressed if key in NAMES or len(key) == 1]


class Keyboard:
    """Keys of standard input, where it is a terminal and this process in its foreground.

    press   called on the loop with each key

    Ctrl-C and Ctrl-Z stay signals. `close` gives the terminal its former settings back; it may be called at any time,
    from any thread, also twice.
    """

    def __init__(self, press: Callable[[str], None], descriptor: int | None = None):
        self._press = press
        self._descriptor = _standard_input() if descriptor is None else descriptor
        self._former: list[Any] | None = None
        self._loop: asyncio.AbstractEventLoop | None = None

    @property
    def is_open(self) -> bool:
        """True if keys are read now."""
        return self._former is not None

    def open(self) -> None:
        """Read keys from now on, if there is a terminal."""
        fd = self._descriptor
        if self.is_open or termios is None or fd is None or not (os.isatty(fd) and in_front(fd)):
            return
        with suppress(OSError, termios.error, ValueError):
            former = termios.tcgetattr(fd)
            self._loop = asyncio.get_running_loop()
            self._loop.add_reader(fd, self._readable)
            self._former = former
            tty.setcbreak(fd, termios.TCSANOW)

    def reopen(self) -> None:
        """Read keys again after this process was stopped, with the settings that the terminal has now."""
        if self._descriptor is not None and in_front(self._descriptor):
            self.close()
            self.open()

    def close(self) -> None:
        """Restore the terminal's settings."""
        former, self._former = self._former, None
        if former is None or self._descriptor is None:
            return
        with _in_background(), suppress(OSError, termios.error):
            termios.tcsetattr(self._descriptor, termios.TCSANOW, former)
        self._stop_reading()

    def _stop_reading(self) -> None:
        if self._loop is not None and self._descriptor is not None:
            with suppress(RuntimeError, OSError, ValueError):
                self._loop.remove_reader(self._descriptor)

    def _readable(self) -> None:
        assert self._descriptor is not None
        if not in_front(self._descriptor):  # reading would stop this process
            self._former = None
            self._stop_reading()
            return
        try:
            data = os.read(self._descriptor, LONGEST)
        except (BlockingIOError, InterruptedError):
            return
        except OSError:
            data = b""
        if not data:  # the terminal is gone
            self.close()
        for key in keys_of(data):
            self._press(key)


def in_front(descriptor: int) -> bool:
    """True unless another group of processes has the terminal."""
    try:
        return os.tcgetpgrp(descriptor) == os.getpgrp()
    except OSError:  # no terminal of ours
        return True


@contextmanager
def _in_background() -> Iterator[None]:
    """Set a terminal also from the background, without being stopped."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTTOU})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _standard_input() -> int | None:
    with suppress(OSError, ValueError, AttributeError):
        return sys.stdin.fileno()
    return None
