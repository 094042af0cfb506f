"""The view itself: pictures four times a second, and a person's keys."""

import asyncio
import os
import signal
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING, Any, TextIO, cast

from rich.console import Console

from catseye.interruption import undo_on_interruption
from catseye.service.screen.keys import Keyboard
from catseye.service.screen.pane import Pane
from catseye.service.screen.starting import start_picture
from catseye.service.views import RunControls, SilentView

if TYPE_CHECKING:
    from catseye.coordinator.modes import Mode
    from catseye.service.book import RunSummary
    from catseye.service.coordinator import LiveCoordinator
    from catseye.service.screen.picture import Chosen, Picture

PERIOD = 0.25  # s between two updates
IDLE_PERIOD = 1.0  # s between two updates without durable entries
NOTICE = 4.0  # s that an answer to a key stays
PAGE = 10  # lines


class ScreenView(SilentView):
    """A full-screen view on stderr, updated four times a second; keys from standard input.

    The last picture stays.

    console    None: a new one on stderr
    keyboard   of a terminal; None: standard input
    """

    def __init__(
        self, console: Console | None = None, keyboard: "Callable[[Callable[[str], None]], Keyboard]" = Keyboard
    ):
        self._console = console or Console(stderr=True, highlight=False, _environ=_without_size(os.environ))
        self._pane = Pane(cast("TextIO", self._console.file))
        self._keyboard = keyboard(self._press)
        self._stack = ExitStack()
        self._signals: list[int] = []
        self._picture: Picture | None = None
        self._chosen: Chosen | None = None
        self._running: LiveCoordinator | None = None
        self._controls: RunControls | None = None
        self._name, self._messages = "", list[str]()
        self._start: tuple[str, int, int] | None = None
        self._began = self._next = self._asked = self._noticed = 0.0
        self._paused_from: Mode | None = None  # mode before a pause made here
        self._timer: asyncio.TimerHandle | None = None

    # The view's life -------------------------------------------------------------------------------------------------

    def open(self, name: str) -> None:
        self._name, self._began = name, time.monotonic()
        self._stack.enter_context(undo_on_interruption(self._undo))
        self._pane.enter()
        self._keyboard.open()
        for number, act in (
            (signal.SIGTSTP, self._suspend),
            (signal.SIGCONT, self._resume),
            (signal.SIGWINCH, self._redraw),
        ):
            self._on(number, act)
        self._tick()

    def tell(self, text: str) -> None:
        self._messages.append(" ".join(text.split()))
        self._redraw()

    def progress(self, what: str, done: int, total: int) -> None:
        self._start = what, done, total
        self._redraw()

    def begin(self, book: "RunSummary", running: "LiveCoordinator", controls: RunControls) -> None:
        from catseye.service.screen.picture import Chosen, Picture

        self._running, self._controls = running, controls
        self._chosen = Chosen(keys=self._keyboard.is_open)
        self._picture = Picture(self._console, book, running.ziy, controls)
        self._redraw()

    def entry(self, entry: Any) -> None:
        if time.monotonic() >= self._next:
            self._redraw()

    def end(self) -> None:
        if self._timer is None:
            return
        self._timer.cancel()
        self._timer = None
        self._keyboard.close()
        for number in self._signals:
            with suppress(RuntimeError, ValueError):
                asyncio.get_running_loop().remove_signal_handler(number)
        self._signals.clear()
        last = ""
        if self._picture is not None and self._chosen is not None:
            self._thaw()
            self._chosen.part, self._chosen.keys, self._chosen.notice, self._chosen.help = "overview", False, "", False
            last = "\n".join(self._picture.lines(self._chosen)) + "\n"
        self._pane.leave(last)
        self._stack.close()

    def _undo(self) -> None:
        """Restore the terminal before a forced exit."""
        self._pane.abandon()
        self._keyboard.close()

    def _tick(self) -> None:
        """Redraw even without new entries, to show that none come."""
        self._redraw()
        self._timer = asyncio.get_running_loop().call_later(IDLE_PERIOD, self._tick)

    def _redraw(self) -> None:
        self._next = time.monotonic() + PERIOD
        if self._picture is None or self._chosen is None or self._starting:
            self._pane.show(self._start_lines())
            return
        if time.monotonic() > self._noticed + NOTICE:
            self._chosen.notice = ""
        self._pane.show(self._picture.lines(self._chosen))

    @property
    def _starting(self) -> bool:
        return self._controls is not None and self._controls.starting()

    def _start_lines(self) -> list[str]:
        """Picture of the start, before there is anything to measure with."""
        passed = time.monotonic() - self._began
        return start_picture(self._console, self._name, passed, self._start, self._messages)

    # Signals ---------------------------------------------------------------------------------------------------------

    def _on(self, number: int, act: Callable[[], None]) -> None:
        """Act on a signal, where this is the main thread's loop."""
        with suppress(RuntimeError, ValueError, NotImplementedError):
            asyncio.get_running_loop().add_signal_handler(number, act)
            self._signals.append(number)

    def _suspend(self) -> None:
        """Give the terminal back, and stop as Ctrl-Z asks."""
        self._keyboard.close()
        self._pane.leave()
        asyncio.get_running_loop().remove_signal_handler(signal.SIGTSTP)
        os.kill(os.getpid(), signal.SIGTSTP)  # goes on here after SIGCONT
        asyncio.get_running_loop().add_signal_handler(signal.SIGTSTP, self._suspend)
        self._resume()

    def _resume(self) -> None:
        self._pane.enter()
        self._keyboard.reopen()
        self._redraw()

    # Keys ------------------------------------------------------------------------------------------------------------

    def _press(self, key: str) -> None:
        from catseye.service.screen.picture import PARTS

        if self._chosen is None or self._controls is None or self._picture is None:
            if key == "q":
                signal.raise_signal(signal.SIGINT)
            return
        if self._starting:
            if key == "q":
                self._controls.stop()
            return
        chosen, names = self._chosen, list(PARTS.values())
        if key in PARTS:
            self._choose(PARTS[key])
        elif key in ("left", "right"):
            self._choose(names[(names.index(chosen.part) + (1 if key == "right" else -1)) % len(names)])
        elif key in ("up", "down", "page up", "page down"):
            step = (PAGE if key.startswith("page") else 1) * (1 if key.endswith("down") else -1)
            chosen.scroll = max(0, chosen.scroll + (-step if chosen.part == "events" else step))
        elif key == "s":
            from catseye.service.screen.parts import SEVERITIES

            chosen.severity = SEVERITIES[(SEVERITIES.index(chosen.severity) + 1) % len(SEVERITIES)]
            self._thaw()
        elif key == " ":
            self._freeze()
        elif key in ("?", "h", "escape"):
            chosen.help = key != "escape" and not chosen.help
            self._thaw()
        elif key == "p":
            self._pause()
        elif key == "q":
            self._quit()
        self._redraw()

    def _choose(self, part: str) -> None:
        assert self._chosen is not None
        self._chosen.part, self._chosen.scroll, self._chosen.help = part, 0, False
        self._thaw()

    def _thaw(self) -> None:
        assert self._picture is not None
        self._picture.freeze("")

    def _freeze(self) -> None:
        from catseye.coordinator.parts import ticks_now
        from catseye.service.logs import time_text

        assert self._picture is not None
        assert self._running is not None
        self._picture.freeze("" if self._picture.frozen_at else time_text(ticks_now(self._running.ziy.clock))[11:19])

    def _say(self, text: str) -> None:
        assert self._chosen is not None
        self._chosen.notice, self._noticed = text, time.monotonic()

    def _quit(self) -> None:
        """End the run; a service only when asked again."""
        assert self._controls is not None
        now = time.monotonic()
        if self._controls.is_service and now > self._asked + NOTICE:
            self._asked = now
            self._say("q again ends the site: measuring stops, lasers go off")
            return
        self._say("ending")
        self._controls.stop()

    def _pause(self) -> None:
        """Pause measuring, or resume what was paused here, where nobody else commands."""
        assert self._controls is not None
        assert self._running is not None
        ziy = self._running.ziy
        if not self._controls.may_pause:
            self._say("no pause in virtual time")
        elif ziy.condition.holder != "nobody":
            self._say(f"{ziy.condition.holder} holds the lease and alone changes the mode (expected LEASE none first)")
        elif ziy.mode != "hold":
            self._paused_from = ziy.mode
            ziy.set_mode("hold")
            self._say("paused: no shots are taken; p resumes")
        elif self._paused_from is None:
            self._say("mode hold was not set here (expected MODE active at the coordinator's port)")
        else:
            ziy.set_mode(self._paused_from)
            self._paused_from = None
            self._say("measuring resumes")


def _without_size(environment: Mapping[str, str]) -> dict[str, str]:
    """Environment without a terminal's size at some earlier time, which would hold after it is resized."""
    return {name: value for name, value in environment.items() if name not in ("COLUMNS", "LINES")}
