"""The entry point: signals first, then the commands; every failure becomes one line and a status."""

import os
import signal
import sys
from types import FrameType

LIVING = ("zy", "ziy", "simulate", "serve", "view", "help")  # which end in an order of their own, or their pager's
WORDS = {signal.SIGINT: b"interrupted by Ctrl-C", signal.SIGTERM: b"terminated"}


def run() -> None:
    """`catseye`: exits with 0 done, 1 could not, 2 wrong usage, 130 on Ctrl-C, 143 when terminated."""
    for number in WORDS:  # nothing to undo yet; what knows how to is imported next
        signal.signal(number, stopped)
    from catseye.interruption import exit_on_signals, ignore_signals

    if sys.argv[1:2] and sys.argv[1] not in LIVING and not sys.argv[1].startswith("-") and hasattr(os, "fork"):
        from catseye.cli.supervisor import work_in_child

        work_in_child(stopped)
    exit_on_signals()
    from catseye.cli.terminal import finish

    status = finish(_main)
    ignore_signals()
    sys.exit(status)


def stopped(number: int, frame: FrameType | None = None) -> None:
    """Say in one line which signal ended the program, and leave."""
    clear = b"\r\x1b[K" if os.isatty(2) else b""  # of a progress line
    try:
        os.write(2, b"%scatseye: %s; nothing half-written is left\n" % (clear, WORDS[signal.Signals(number)]))
    finally:
        os._exit(128 + number)


def _main() -> None:
    from catseye.cli.commands import main  # under `finish`: what fails while it is imported is one line, too
    from catseye.memory import reserve_workspace

    if sys.argv[1:2] and not sys.argv[1].startswith("-"):
        reserve_workspace()
    main()
