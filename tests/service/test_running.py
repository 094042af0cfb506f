"""The loop of a living command: results, signals, virtual time."""

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


def test_what_the_coroutine_gives_is_the_result_and_the_handlers_are_as_before():
    before = handlers()

    async def work():
        assert handlers() != before
        return 7

    run = LiveRun(work)
    assert run.result() == 7
    assert (run.signal, handlers()) == (0, before)


@pytest.mark.parametrize("number", NUMBERS)
def test_a_signal_cancels_once_and_what_ends_in_order_has_its_time(number):
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


def test_what_goes_wrong_is_raised_and_the_handlers_are_as_before():
    before = handlers()

    async def work():
        raise ValueError("ours")

    with pytest.raises(ValueError, match="ours"):
        LiveRun(work).result()
    assert handlers() == before


def test_an_hour_of_virtual_time_takes_none_and_threads_may_have_worked():
    async def work():
        await asyncio.sleep(3600.0)
        return await asyncio.to_thread(lambda: 3), asyncio.get_running_loop().time()

    assert LiveRun(work, loop_factory=FastLoop).result() == (3, 3600.0)


def test_all_that_ends_in_order_does_so_before_force_and_force_within_five_seconds():
    """Each wait of a command's end has its share: rangers, the journal's thread, the child."""
    order = ZiySettings().leave + 0.2 + LONGEST_LEAVE
    assert order + 0.8 <= LONGEST_END
    assert LONGEST_END + 1.0 <= 5.0
