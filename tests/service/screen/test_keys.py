"""Keys of a pseudo-terminal, and its settings afterwards."""

import asyncio
import os
import pty
import termios
from contextlib import contextmanager

from catseye.service.screen.keys import Keyboard, keys_of


@contextmanager
def terminal():
    """Both ends of a pseudo-terminal that is not this process's own."""
    ours, theirs = pty.openpty()
    try:
        yield ours, theirs
    finally:
        os.close(ours)
        os.close(theirs)


def test_arrows_and_other_keys_have_names():
    assert keys_of(b"q \x1b[A\x1bOB\x1b[C\x1b[D\x1b[5~\x1b[6~?\x1b") == [
        *("q", " ", "up", "down", "right", "left", "page up", "page down", "?", "escape")
    ]
    assert keys_of("é\x1b[15~".encode()) == ["é"]


def test_keys_act_without_a_line_s_end_and_settings_come_back():
    async def story(ours, theirs):
        pressed = asyncio.Queue()
        keyboard = Keyboard(pressed.put_nowait, theirs)
        former = termios.tcgetattr(theirs)
        keyboard.open()
        assert keyboard.is_open
        local = termios.tcgetattr(theirs)[3]
        assert not local & (termios.ICANON | termios.ECHO)
        assert local & termios.ISIG, "Ctrl-C stays a signal"
        os.write(ours, b"p\x1b[B")
        async with asyncio.timeout(10.0):
            assert [await pressed.get(), await pressed.get()] == ["p", "down"]
        keyboard.close()
        keyboard.close()
        assert termios.tcgetattr(theirs) == former
        assert not keyboard.is_open
        os.write(ours, b"q\n")
        await asyncio.sleep(0.05)
        assert pressed.empty(), "nobody reads"

    with terminal() as ends:
        asyncio.run(story(*ends))


def test_a_pipe_has_no_keys():
    async def story(reading):
        keyboard = Keyboard(lambda key: None, reading)
        keyboard.open()
        assert not keyboard.is_open

    reading, writing = os.pipe()
    try:
        asyncio.run(story(reading))
    finally:
        os.close(reading)
        os.close(writing)


def test_a_terminal_that_goes_away_ends_the_keys():
    async def story():
        ours, theirs = pty.openpty()
        keyboard = Keyboard(lambda key: None, theirs)
        keyboard.open()
        os.close(ours)
        async with asyncio.timeout(10.0):
            while keyboard.is_open:
                await asyncio.sleep(0.01)
        os.close(theirs)

    asyncio.run(story())
