"""Epochs solved in another process: the same bits, even if it dies."""

import asyncio
import os
import signal
import time
from dataclasses import replace

import numpy as np
import pytest

from catseye.service.solver import SolverProcess, dumped, loaded
from live_scene import begun


@pytest.fixture(scope="module")
def live():
    night, live = begun()
    live.night = night
    night.round(0, rangers=("ZY101", "ZY103", "ZY105", "ZY107", "ZY109", "ZY111", "ZY115")).into(live)
    return live


@pytest.fixture(scope="module")
def job(live):
    return live.begin(live.night.ticks(0))


@pytest.fixture(scope="module")
def here(job):
    return job.solve()


def gone(pid):
    for _ in range(100):
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    return False


def same(found, expected):
    np.testing.assert_array_equal(found.coordinates.x, expected.coordinates.x)
    np.testing.assert_array_equal(found.state.covariance, expected.state.covariance)
    assert found.state.names == expected.state.names
    assert [row.numbers for row in found.rows] == [row.numbers for row in expected.rows]


def test_process_gives_the_local_result_and_survives_an_error(live, job, here):
    async def story():
        solver = SolverProcess(live.site)
        solver.start()
        pid = solver.pid
        try:
            with pytest.raises(AttributeError, match="NoneType"):  # a mistake of ours is raised here
                await solver.solve(replace(job, motion=None))
            same(await solver.solve(job), here)
            assert solver.pid == pid
        finally:
            solver.stop()
        assert solver.pid is None
        assert gone(pid)

    asyncio.run(story())


def test_killed_process_is_replaced_and_the_epoch_solved_locally(live, job, here):
    async def story():
        solver = SolverProcess(live.site)
        solver.start()
        first = solver.pid
        os.kill(first, signal.SIGKILL)
        try:
            same(await solver.solve(job), here)
            assert solver.pid not in (None, first)
        finally:
            solver.stop()

    asyncio.run(story())


def test_process_exits_when_its_pipe_ends(live):
    solver = SolverProcess(live.site)
    solver.start()
    solver._process.stdin.close()  # as the kernel does for a coordinator that is killed
    assert solver._process.wait(timeout=20.0) == 0
    solver.stop()


def test_site_is_not_sent_and_is_the_same_object(live, job):
    message = dumped(job, live.site)
    assert b"SiteFolder" not in message
    assert b"SiteFolder" in dumped(live.site, None)
    assert loaded(message, live.site).motion.site is live.site
    with pytest.raises(Exception, match="message refers to a site before one was sent"):
        loaded(message, None)
