"""The screen in processes of their own: whatever ends them, the terminal is as it was."""

import fcntl
import json
import os
import pty
import re
import signal
import struct
import subprocess
import sys
import termios
import threading
import time
from contextlib import contextmanager

import pytest

from cli.living_scene import PATIENCE, RUN, SOON, smallest_site
from process_scene import ends_with_us

CONTROL = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
ENTER, LEAVE = "\x1b[?1049h", "\x1b[?1049l"
SHELL = """
import json, os, signal, sys, termios

def tell(**what):
    print(json.dumps(what | {"local": termios.tcgetattr(0)[3]}), flush=True)

signal.signal(signal.SIGTTOU, signal.SIG_IGN)
job = os.fork()
if job == 0:
    os.setpgid(0, 0)
    os.tcsetpgrp(0, os.getpgrp())
    signal.signal(signal.SIGTTOU, signal.SIG_DFL)
    os.dup2(2, 1)
    os.execv(sys.argv[1], sys.argv[1:])
try:
    os.setpgid(job, job)
except PermissionError:
    pass  # it runs the command already, in the group that it made itself
while True:
    _, status = os.waitpid(job, os.WUNTRACED)
    os.tcsetpgrp(0, os.getpgrp())
    if not os.WIFSTOPPED(status):
        break
    tell(stopped=True)
    sys.stdin.readline()  # a person's fg
    os.tcsetpgrp(0, job)
    os.kill(-job, signal.SIGCONT)
tell(status=os.waitstatus_to_exitcode(status))
"""


class Terminal:
    """A pseudo-terminal of 80 x 24, all that was shown on it, and a person's keys."""

    def __init__(self):
        self.ours, self.theirs = pty.openpty()
        self.resize(80, 24)
        self.former = termios.tcgetattr(self.theirs)
        self.shown, self.pid = "", 0
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        while True:
            try:
                self.shown += os.read(self.ours, 65_536).decode("utf-8", "replace")
            except OSError:
                return

    def resize(self, width, height):
        fcntl.ioctl(self.ours, termios.TIOCSWINSZ, struct.pack("HHHH", height, width, 0, 0))

    def press(self, keys):
        os.write(self.ours, keys.encode())

    @property
    def picture(self):
        """The last whole picture, line by line."""
        return CONTROL.sub("", self.shown.rpartition("\x1b[J")[0].rpartition("\x1b[H")[2]).split("\r\n")

    def sees(self, text):
        """Wait until a picture holds a text."""
        end = time.monotonic() + PATIENCE
        while not any(text in line for line in self.picture):
            assert time.monotonic() < end, f"{text!r} is not in {self.picture}"
            time.sleep(0.02)

    def becomes_as_before(self):
        """True once settings and screen are as before; what is still under way arrives by then."""
        end = time.monotonic() + SOON
        while not self._is_as_before() and time.monotonic() < end:
            time.sleep(0.02)
        return self._is_as_before()

    def _is_as_before(self):
        return termios.tcgetattr(self.theirs) == self.former and self.shown.count(ENTER) == self.shown.count(LEAVE)


@contextmanager
def shown(*words):
    """A command on a terminal of its own; its process, and the terminal."""
    terminal = Terminal()

    die_with_us = ends_with_us()

    def take_terminal():
        die_with_us()
        os.setsid()
        fcntl.ioctl(0, termios.TIOCSCTTY, 0)

    size = {"COLUMNS": "80", "LINES": "24"}  # as some shells export it; the terminal's own counts
    environment = {**os.environ, **size, "OPENBLAS_NUM_THREADS": "1", "TERM": "xterm-256color"}
    process = subprocess.Popen(
        [str(word) for word in words],
        stdin=terminal.theirs,
        stdout=subprocess.PIPE,
        stderr=terminal.theirs,
        text=True,
        env=environment,
        preexec_fn=take_terminal,
    )
    try:
        yield process, terminal
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()
        os.close(terminal.theirs)
        os.close(terminal.ours)


def simulation():
    return [*RUN, "simulate", smallest_site(), "--minutes", "0", "--port-base", "0"]


@pytest.mark.parametrize(
    ("how", "status"),
    [
        ("\x03", 130),
        pytest.param(signal.SIGTERM, 143, marks=pytest.mark.slow),
        pytest.param("\x03\x03", 130, marks=pytest.mark.slow),
        ("q", 0),
    ],
)
def test_terminal_is_as_before_however_a_run_ends(how, status):
    with shown(*simulation()) as (process, terminal):
        terminal.sees("? help")
        assert not termios.tcgetattr(terminal.theirs)[3] & termios.ICANON
        since = time.monotonic()
        if isinstance(how, str):
            for key in how:
                terminal.press(key)
                time.sleep(0.1)
        else:
            process.send_signal(how)
        assert process.wait(SOON) == status
        assert time.monotonic() - since < SOON
        assert terminal.becomes_as_before()


def test_terminal_is_as_before_after_an_end_while_it_starts():
    with shown(*simulation()) as (process, terminal):
        terminal.sees("starting")
        terminal.press("\x03")
        assert process.wait(2.0 * SOON) == 130
        assert terminal.becomes_as_before()


def test_wrong_site_is_told_on_the_usual_screen():
    words = [*RUN, "simulate", smallest_site(), "--fault", "dead-ranger ZY999", "--port-base", "0"]
    with shown(*words) as (process, terminal):
        assert process.wait(PATIENCE) == 1
        assert terminal.becomes_as_before()
        assert "unknown ranger ZY999" in terminal.shown.rpartition(LEAVE)[2]


def test_suspended_and_resumed_resized_and_keys_still_act():
    """A shell with job control: Ctrl-Z, a command there, fg."""
    with shown(sys.executable, "-c", SHELL, *simulation()) as (process, terminal):
        terminal.sees("? help")
        terminal.press("\x1a")
        told = json.loads(process.stdout.readline())
        assert told["stopped"]
        assert told["local"] == terminal.former[3]
        assert terminal.becomes_as_before()
        terminal.press("fg\n")
        end = time.monotonic() + PATIENCE
        while terminal.shown.count(ENTER) < 2:
            assert time.monotonic() < end
            time.sleep(0.02)
        terminal.press("r")
        terminal.sees("range (m)")
        for width, height in ((200, 60), (60, 20), (100, 30)):
            terminal.resize(width, height)
            end = time.monotonic() + PATIENCE
            while len(terminal.picture) != height:
                assert time.monotonic() < end, f"not {height} lines: {terminal.shown[-8000:]!r}"
                time.sleep(0.02)
            assert max(map(len, terminal.picture)) <= width
        terminal.press("\x03")
        assert json.loads(process.stdout.readline()) == {"status": 130, "local": terminal.former[3]}
        assert terminal.becomes_as_before()


@pytest.mark.slow
def test_a_service_is_ended_by_a_key_pressed_twice():
    base = 32_000 + 200 * (os.getpid() % 60)
    words = ["serve", smallest_site(), "--twin", "--port-base", base, "--port", "0", "--start", "60635.125", "--screen"]
    with shown(*RUN, *words) as (process, terminal):
        terminal.sees("? help")
        terminal.press("q")
        terminal.sees("q again ends the site")
        terminal.press("q")
        assert process.wait(SOON) == 0
        assert terminal.becomes_as_before()
