"""Threads of linear algebra: the user's word, else what is free of the cores that we may use."""

import os

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from catseye import processors
from catseye.processors import Load, at_most, free_threads, idle_of, one_thread, said, threads


def pool():
    assert np.__version__  # its library is loaded
    return max(each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas")


@pytest.fixture(autouse=True)
def nothing_said(monkeypatch):
    for name in processors.VARIABLES:
        monkeypatch.delenv(name, raising=False)


class Busy(Load):
    """A machine of so many cores: what they were idle and what this process used, s in 10 s."""

    def __init__(self, cores, idle, own, share=None):
        self.cores, self.share, self.passed = set(range(cores)), float(cores if share is None else share), 0.0
        self.idle, self.own = idle / 10.0, own / 10.0
        super().__init__()
        self.passed = 10.0

    def _now(self):
        return self.passed, self.passed * self.idle, self.passed * self.own


@pytest.mark.parametrize(
    ("cores", "idle", "own", "share", "wanted"),
    [
        (2, 10.0, 10.0, None, 2),  # alone on two
        (2, 9.7, 10.0, None, 2),  # but for the system's own ticks
        (2, 0.0, 10.0, None, 1),  # one other works all the time
        (2, 0.0, 2.0, None, 1),  # load 10: a fifth of a core is ours
        (2, 0.0, 13.3, None, 1),  # our two threads and one other share two cores
        (16, 70.0, 10.0, None, 8),  # eight others
        (16, 150.0, 10.0, 4.0, 4),  # a container with four
        (16, 150.0, 10.0, 0.5, 1),
    ],
)
def test_the_pool_follows_what_others_leave(monkeypatch, cores, idle, own, share, wanted):
    load = Busy(cores, idle, own, share)
    monkeypatch.setattr(processors, "LOAD", load)
    monkeypatch.setattr(processors, "allowed", lambda: (load.cores, load.share))
    assert threads() == wanted


def test_before_anything_is_measured_the_load_of_the_last_minute_counts(monkeypatch):
    """A process that may use 4 of 16 cores gets one at load 12; zero elapsed time is handled."""
    load = Busy(4, 0.0, 0.0)
    load.passed = 0.0
    monkeypatch.setattr(processors, "allowed", lambda: (load.cores, load.share))
    monkeypatch.setattr(os, "cpu_count", lambda: 16)
    monkeypatch.setattr(os, "getloadavg", lambda: (12.0, 0.0, 0.0))
    assert load.free() == 1.0


def test_the_system_s_own_count_is_read():
    """Idle time goes on with time, of no more cores than there are."""
    cores, share = processors.allowed()
    assert 0.0 < share <= len(cores) <= os.cpu_count()
    now = Load._now()
    if now is not None:
        assert 0.0 <= now[1] <= now[0] * os.cpu_count() + 1e6
    assert idle_of("cpu 0 0 0 7 0\ncpu1 1 2 3 400 50 6\ncpu12 0 0 0 1000 0\n", {1, 2}) * os.sysconf("SC_CLK_TCK") == 450


@pytest.mark.parametrize(
    ("environment", "count"),
    [
        ({"OPENBLAS_NUM_THREADS": "3"}, 3),
        ({"OMP_NUM_THREADS": "1"}, 1),
        ({"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "4"}, 4),
        ({"OPENBLAS_NUM_THREADS": "0", "OMP_NUM_THREADS": "2"}, 2),
        ({"OPENBLAS_NUM_THREADS": "many"}, None),
        ({}, None),
    ],
)
def test_user_setting_is_obeyed(monkeypatch, environment, count):
    assert said(environment) == count
    monkeypatch.setattr(processors, "LOAD", Busy(1, 0.0, 10.0))
    monkeypatch.setattr(processors, "allowed", lambda: ({0}, 1.0))
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert threads() == (count or 1)


def test_the_option_goes_before_the_environment_and_leaves_no_trace(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    before = pool()
    with at_most(2):
        assert (threads(), pool(), os.environ["OPENBLAS_NUM_THREADS"], os.environ["OMP_NUM_THREADS"]) == (
            2,
            2,
            "2",
            "2",
        )
        with one_thread():
            assert (threads(), pool()) == (2, 1)
    assert (threads(), pool(), os.environ.get("OPENBLAS_NUM_THREADS")) == (3, before, None)
    assert os.environ["OMP_NUM_THREADS"] == "3"


def test_a_pool_that_the_caller_made_smaller_stays_so(monkeypatch):
    monkeypatch.setattr(processors, "LOAD", Busy(8, 70.0, 10.0))
    monkeypatch.setattr(processors, "allowed", lambda: (set(range(8)), 8.0))
    with threadpool_limits(limits=1, user_api="blas"):
        with one_thread():
            assert threads() == 1
        with free_threads():
            assert pool() == 1
    with threadpool_limits(limits=2, user_api="blas"), one_thread(), one_thread():
        assert (threads(), pool()) == (2, 1)


@pytest.mark.parametrize(("cores", "idle", "wanted"), [(8, 60.0, 6), (8, 0.0, 1), (2, 17.0, 2), (2, 16.0, 1)])
def test_processes_of_one_thread_are_as_many_as_free_cores(monkeypatch, cores, idle, wanted):
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "1")  # of one process, whatever the number of processes
    load = Busy(cores, idle, 0.0)
    monkeypatch.setattr(processors, "LOAD", load)
    monkeypatch.setattr(processors, "allowed", lambda: (load.cores, load.share))
    assert processors.free_cores() == wanted
