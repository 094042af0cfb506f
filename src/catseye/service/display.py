"""Display that a command wants: the screen, lines, or nothing."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

from catseye.service.views import LinesView, SilentView, View


def view_of(*, screen: bool, tell: Callable[[str], None] | None) -> View:
    """The screen, or lines, or nothing."""
    if screen:
        from catseye.service.screen.view import ScreenView

        return ScreenView()
    return SilentView() if tell is None else LinesView(tell)


@dataclass(frozen=True)
class LogOptions:
    """Display of a running site on stderr.

    tell     takes each line of the log; None: no log
    json     True for a JSON object a line
    screen   True for a screen instead of the log, where stderr is a terminal
    """

    tell: Callable[[str], None] | None = None
    json: bool = False
    screen: bool = False

    @property
    def terminal(self) -> bool:
        """True if stderr is a terminal."""
        return sys.stderr is not None and sys.stderr.isatty()

    @property
    def shown(self) -> bool:
        """True if there is a screen."""
        return self.screen and self.terminal and not self.json

    @cached_property
    def view(self) -> View:
        """View that is wanted: the screen, or nothing."""
        return view_of(screen=self.shown, tell=None)
