"""The twin's own process: its start line by line, its failures, its end."""

import asyncio
import json
import sys

import pytest

from catseye.errors import InputError
from catseye.service import twin_process
from catseye.service.child import LiveChild
from catseye.service.listening import Listening, StartLine, start_line_of
from catseye.service.twin_process import TwinProcess

AT = {"rangers": {"ZY101": ["127.0.0.1", 5240, 5241]}, "feed": ["127.0.0.1", 5250]}
WHERE = Listening({"ZY101": ("127.0.0.1", 5240, 5241)}, ("127.0.0.1", 5250))
LINES = (json.dumps({"bound": AT}), '{"ready": 0, "of": 2}', '{"ready": 2, "of": 2}', json.dumps(AT))
FAILS = "import sys; sys.stderr.write('catseye: port 5240 is taken\\n'); sys.exit(1)"


def says(*lines):
    return f"import sys\nfor line in {lines!r}: print(line, flush=True)\nsys.stdin.read()"


@pytest.fixture
def program(monkeypatch):
    """Sets what is run in place of catseye."""

    def put(text):
        def child(*words, **more):
            return LiveChild(*words, **more, program=(sys.executable, "-c", text))

        monkeypatch.setattr(twin_process, "LiveChild", child)

    return put


def run(story):
    asyncio.run(asyncio.wait_for(story(), 60.0))


def test_lines_of_a_start_are_parsed_and_others_refused():
    assert start_line_of(LINES[0]) == StartLine(at=WHERE)
    assert start_line_of(LINES[1]) == StartLine(ready=0, count=2)
    assert start_line_of(LINES[3]) == StartLine(at=WHERE, up=True)
    assert start_line_of(json.dumps({"rangers": {}, "feed": None})) == StartLine(at=Listening({}, None), up=True)
    assert json.loads(json.dumps(WHERE.plain())) == AT
    for line in ("hello", "{}", "[]", '{"ready": 1}', '{"rangers": {"ZY101": 5}, "feed": null}'):
        with pytest.raises(InputError, match="expected its addresses"):
            start_line_of(line)


def test_addresses_come_before_the_rangers_are_ready_and_messages_wait_for_a_listener(program):
    program(says(*LINES))

    async def story():
        steps, heard = [], []
        async with TwinProcess([], progress=lambda *step: steps.append(step)) as twin:
            assert await twin.bound() == WHERE
            await twin.settled()
            assert not twin.starting
            assert steps == [("rangers ready", 0, 2), ("rangers ready", 2, 2)]
            twin.report(listens=lambda: heard.append("up"), warned=heard.append)
            assert heard == ["up"]
            assert not twin.task.done()
        assert twin.task.done()

    run(story)


def test_a_start_that_fails_is_waited_for_no_longer(program, monkeypatch):
    """The coordinator of a service begins then: its ports answer, and it says what is wrong."""
    monkeypatch.setattr("catseye.service.child.FIRST_WAIT", 0.05)
    program(FAILS)

    async def story():
        heard = []
        async with TwinProcess([], patient=True) as twin:
            twin.report(warned=heard.append)
            assert twin.starting
            await twin.settled()
            assert "catseye: port 5240 is taken" in heard
            assert not twin.task.done()

    run(story)


def test_a_start_that_fails_ends_a_simulation_with_its_message(program):
    program(FAILS)

    async def story():
        async with TwinProcess([]) as twin:
            with pytest.raises(InputError, match=r"^twin: port 5240 is taken$"):
                await twin.task

    run(story)


def test_a_line_that_is_none_is_told(program):
    program(says("hello", *LINES))

    async def story():
        heard = []
        async with TwinProcess([]) as twin:
            twin.report(warned=heard.append)
            await twin.settled()
        assert heard == ["the twin printed 'hello' (expected its addresses)"]

    run(story)
