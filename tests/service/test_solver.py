"""Epochs solved in a process beside: the same to the last bit, whatever becomes of the process."""

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
    np.testing.assert_array_equal(found.carried.covariance, expected.carried.covariance)
    assert found.carried.names == expected.carried.names
    assert [row.numbers for row in found.rows] == [row.numbers for row in expected.rows]


def test_the_process_gives_what_solving_here_gives_and_survives_a_mistake(live, job, here):
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


def test_killed_the_epoch_is_solved_here_and_a_new_process_begun(live, job, here):
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


def test_the_process_leaves_when_its_pipe_ends(live):
    solver = SolverProcess(live.site)
    solver.start()
    solver._process.stdin.close()  # as the kernel does for a coordinator that is killed
    assert solver._process.wait(timeout=20.0) == 0
    solver.stop()


def test_the_site_does_not_travel_and_is_the_very_same_there(live, job):
    message = dumped(job, live.site)
    assert b"SiteFolder" not in message
    assert b"SiteFolder" in dumped(live.site, None)
    assert loaded(message, live.site).motion.site is live.site
    with pytest.raises(Exception, match="a site is meant that nobody gave"):
        loaded(message, None)
