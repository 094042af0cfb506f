"""Pictures on a terminal that may take nothing."""

import io
import os
import pty
import time
import tty

from catseye.service.screen.pane import ENTER, LEAVE, Pane


def test_newest_picture_is_shown_and_the_usual_screen_comes_back():
    file = io.StringIO()
    pane = Pane(file)
    pane.show(["before it is entered"])
    pane.enter()
    pane.show(["one", "two"])
    pane.leave("last\n")
    pane.leave("twice\n")
    text = file.getvalue()
    assert text.startswith(ENTER)
    assert text.endswith(LEAVE + "last\n")
    assert "\x1b[H\x1b[2Kone\n\x1b[2Ktwo\x1b[J" in text


def test_a_terminal_that_takes_nothing_holds_up_nobody():
    """Terminal after Ctrl-S: the kernel's buffer fills, and a write would wait for ever."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    with open(theirs, "w", encoding="utf-8", closefd=False) as file:
        pane = Pane(file)
        pane.enter()
        since = time.monotonic()
        for k in range(50):
            pane.show([f"{k} " + 70 * "x"] * 200)
            time.sleep(0.002)  # a moment for the thread that writes, which is stuck after some of them
        pane.abandon()
        pane.leave("last\n")
        assert time.monotonic() - since < 5.0
        os.close(ours)  # which frees the thread
    os.close(theirs)
