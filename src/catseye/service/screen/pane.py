"""A terminal's other screen, on which pictures follow each other.

Pictures are written by a thread, the newest only: a terminal that takes nothing, as after Ctrl-S, holds up no loop.
"""

import os
import select
import threading
from contextlib import suppress
from typing import TextIO

from catseye.service.screen.keys import in_front

ENTER = "\x1b[?1049h\x1b[?25l"  # the other screen; no cursor
LEAVE = "\x1b[0m\x1b[?25h\x1b[?1049l"
PATIENCE = 0.5  # s for the last picture to be written


class Pane:
    """Full-screen pictures on a terminal.

    file   of the terminal
    """

    def __init__(self, file: TextIO):
        self._file = file
        self._changed = threading.Condition()
        self._picture: str | None = None
        self._thread: threading.Thread | None = None
        self._ending = False

    def enter(self) -> None:
        """Go to the other screen, unless another program has the terminal."""
        if self._thread is None and self._in_front():
            self._ending, self._picture = False, ENTER
            self._thread = threading.Thread(target=self._write_pictures, name="catseye-screen", daemon=True)
            self._thread.start()

    def show(self, lines: list[str]) -> None:
        """Show lines from the top; the remainder is blank."""
        text = "\x1b[H" + "\n".join(f"\x1b[2K{line}" for line in lines) + "\x1b[J"
        with self._changed:
            before = ENTER if self._picture is not None and self._picture.startswith(ENTER) else ""
            self._picture = before + text
            self._changed.notify()

    def leave(self, last: str = "") -> None:
        """Go back to the usual screen, and leave a text there."""
        thread, self._thread = self._thread, None
        if thread is None:
            return
        with self._changed:
            self._ending = True
            self._changed.notify()
        thread.join(PATIENCE)
        if not thread.is_alive():
            self._write(LEAVE + last)

    def abandon(self) -> None:
        """Go back at once, before a forced exit, if the terminal takes it."""
        if self._thread is None:
            return
        with suppress(OSError, ValueError):
            descriptor = self._file.fileno()
            if select.select([], [descriptor], [], 0.0)[1]:
                os.write(descriptor, LEAVE.encode("ascii"))

    def _in_front(self) -> bool:
        try:
            return in_front(self._file.fileno())
        except (OSError, ValueError):
            return True

    def _write_pictures(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._picture is not None or self._ending)
                picture, self._picture = self._picture, None
            if picture is None:
                return
            self._write(picture)

    def _write(self, text: str) -> None:
        """Write past the file's own buffer, whose lock a terminal that takes nothing would hold for ever."""
        with suppress(OSError, ValueError):  # the terminal is gone
            try:
                descriptor = self._file.fileno()
            except OSError:  # not of the system: a test's
                self._file.write(text)
                return
            data = text.encode(self._file.encoding or "utf-8", "replace")
            while data:
                data = data[os.write(descriptor, data) :]
