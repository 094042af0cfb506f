"""The view on a pseudo-terminal: its keys, its messages, its end."""

import asyncio
import os
import pty
import re
import termios
import threading
from contextlib import contextmanager
from dataclasses import replace

from rich.console import Console

from catseye.service.screen.keys import Keyboard
from catseye.service.screen.view import ScreenView
from catseye.service.views import RunControls
from coordinator.condition_scene import ScenedSite

CONTROL = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


class Person:
    """Who sits at a terminal: what it has shown, and keys."""

    def __init__(self, ours):
        self._ours, self.shown = ours, ""
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self):
        while True:
            try:
                data = os.read(self._ours, 65_536)
            except OSError:
                return
            self.shown += data.decode("utf-8", "replace")

    def go(self):
        """Read to the end: the next terminal may get the same descriptor, and this reader would take its text."""
        self._thread.join(30.0)
        assert not self._thread.is_alive()

    def press(self, keys):
        os.write(self._ours, keys.encode())

    @property
    def picture(self):
        """The last picture, without colours."""
        return CONTROL.sub("", self.shown.rpartition("\x1b[H")[2])

    @property
    def left(self):
        """The text after the end of the view, without colours; empty before it."""
        _, end, text = self.shown.rpartition("\x1b[?1049l")
        return CONTROL.sub("", text) if end else ""

    async def sees(self, text):
        async with asyncio.timeout(30.0):
            while text not in self.picture:
                await asyncio.sleep(0.01)


class CommandedSite(ScenedSite):
    """A site whose mode can be set."""

    def set_mode(self, mode):
        self.mode = mode


@contextmanager
def seated(site, **more):
    """A view of a site on a terminal, and the person before it."""
    ours, theirs = pty.openpty()
    former, ended = termios.tcgetattr(theirs), []
    controls = RunControls(stop=lambda: ended.append(True), span=lambda: (3.0, 57.0), **more)
    with open(theirs, "w", encoding="utf-8", closefd=False) as file:
        console = Console(file=file, width=80, height=24, force_terminal=True, color_system="256", highlight=False)
        view = ScreenView(console, lambda press: Keyboard(press, theirs))
        try:
            person = Person(ours)
            yield view, person, controls, ended
            assert termios.tcgetattr(theirs) == former
        finally:
            view.end()
    os.close(theirs)
    person.go()
    os.close(ours)


def story_of(site, steps, **more):
    async def story():
        with seated(site, **more) as (view, person, controls, ended):
            view.open("gbt")
            view.begin(site.book, site.running, controls)
            await person.sees("? help")
            await steps(view, person, ended)
            view.end()

    asyncio.run(story())


def test_start_is_shown_with_progress_and_messages():
    async def story():
        site = CommandedSite()
        with seated(site) as (view, person, controls, ended):
            view.open("gbt")
            view.tell("starting the twin")
            view.progress("rangers ready", 7, 18)
            await person.sees("7 of 18 rangers ready")
            assert "gbt  starting, 0 s" in person.picture
            assert "starting the twin" in person.picture
            starting = [True]
            view.begin(site.book, site.running, replace(controls, starting=lambda: starting[0]))
            view.progress("rangers ready", 8, 18)
            await person.sees("8 of 18 rangers ready")
            assert "? help" not in person.picture
            person.press("rq")
            async with asyncio.timeout(30.0):
                while not ended:
                    await asyncio.sleep(0.01)
            starting.clear()
            starting.append(False)
            await person.sees("? help")
            assert "overview" in person.picture
            view.end()
            view.end()

    asyncio.run(story())


def test_keys_choose_what_is_shown():
    async def steps(view, person, ended):
        person.press("r")
        await person.sees("range (m)")
        person.press("\x1b[C")
        await person.sees("not used")
        person.press("v")
        await person.sees("event 0")
        person.press("s")
        await person.sees("no event of severity warning or above")
        person.press("?")
        await person.sees("end the run")
        person.press("\x1b")
        await person.sees("no event of severity")
        person.press("f")
        await person.sees("no faults, no troubles")
        person.press(" ")
        await person.sees("FROZEN")
        person.press("o")
        await person.sees("+ measures")
        assert "FROZEN" not in person.picture
        assert ended == []

    site = CommandedSite()
    site.event("ZY101", "ready", "event 0")
    story_of(site, steps)


def test_pause_is_for_whom_nobody_else_commands():
    site = CommandedSite()

    async def steps(view, person, ended):
        person.press("p")
        await person.sees("paused: no shots are taken")
        assert site.mode == "hold"
        assert "mode hold: no shots are taken" in person.picture
        person.press("p")
        await person.sees("measuring resumes")
        assert site.mode == "active"
        site.condition.holder = "anna"
        person.press("p")
        await person.sees("anna holds the lease")
        assert site.mode == "active"
        site.condition.holder = "nobody"
        site.mode = "hold"
        person.press("p")
        await person.sees("mode hold was not set here")
        assert site.mode == "hold"

    story_of(site, steps)


def test_virtual_time_has_no_pause():
    site = CommandedSite()

    async def steps(view, person, ended):
        person.press("p")
        await person.sees("no pause in virtual time")
        assert site.mode == "active"

    story_of(site, steps, may_pause=False)


def test_a_simulation_ends_at_once_and_a_service_asks():
    async def once(view, person, ended):
        person.press("q")
        await person.sees("ending")
        assert ended == [True]

    async def twice(view, person, ended):
        person.press("q")
        await person.sees("q again ends the site")
        assert ended == []
        person.press("q")
        await person.sees("ending")
        assert ended == [True]

    story_of(CommandedSite(), once)
    story_of(CommandedSite(), twice, is_service=True)


def test_picture_is_renewed_without_durable_entries():
    """The journal is away, so nothing is published: the picture is renewed all the same."""

    async def steps(view, person, ended):
        site.intake.trouble = "the disk is full"
        site.clock.advance(60.0)
        await person.sees("journal: the disk is full")
        assert "STOPPED" in person.picture

    site = CommandedSite()
    site.round()
    story_of(site, steps)


def test_last_picture_stays_without_the_keys():
    site = CommandedSite()
    site.round()

    async def steps(view, person, ended):
        person.press("v")
        await person.sees("events  s severity")
        view.end()
        async with asyncio.timeout(30.0):  # a terminal hands the text on in pieces: its last line comes last
            while "ZY118 +" not in person.left:
                await asyncio.sleep(0.01)
        assert "18 of 18 rangers measure" in person.left
        assert "q end" not in person.left

    story_of(site, steps)
