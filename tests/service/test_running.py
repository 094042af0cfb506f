"""Event loop of a running command: results, signals, virtual time."""

import asyncio
import os
import signal
import threading

import pytest

from catseye.coordinator.ziy import ZiySettings
from catseye.service.child import LONGEST_LEAVE
from catseye.service.running import LONGEST_END, NUMBERS, FastLoop, LiveRun


def handlers():
    return [signal.getsignal(number) for number in NUMBERS]


def test_result_is_returned_and_handlers_are_restored():
    before = handlers()

    async def work():
        assert handlers() != before
        return 7

    run = LiveRun(work)
    assert run.result() == 7
    assert (run.signal, handlers()) == (0, before)


@pytest.mark.parametrize("number", NUMBERS)
def test_signal_cancels_once_and_allows_orderly_exit(number):
    ended = []

    async def work():
        try:
            os.kill(os.getpid(), number)
            await asyncio.sleep(60.0)
        finally:
            await asyncio.sleep(0.01)
            ended.append(True)

    before, threads = handlers(), threading.active_count()
    run = LiveRun(work)
    assert run.result() is None
    assert (run.signal, ended, handlers()) == (number, [True], before)
    assert threading.active_count() == threads  # the alarm that would leave by force is gone


def test_exceptions_are_raised_and_handlers_are_restored():
    before = handlers()

    async def work():
        raise ValueError("ours")

    with pytest.raises(ValueError, match="ours"):
        LiveRun(work).result()
    assert handlers() == before


def test_virtual_hour_takes_no_time_and_allows_threads():
    async def work():
        await asyncio.sleep(3600.0)
        return await asyncio.to_thread(lambda: 3), asyncio.get_running_loop().time()

    assert LiveRun(work, loop_factory=FastLoop).result() == (3, 3600.0)


def test_orderly_exit_comes_before_a_forced_one_within_five_seconds():
    """Each wait of a command's end has its share: rangers, the journal's thread, the child."""
    order = ZiySettings().leave + 0.2 + LONGEST_LEAVE
    assert order + 0.8 <= LONGEST_END
    assert LONGEST_END + 1.0 <= 5.0
