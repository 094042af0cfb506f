"""Scheduled commands."""

import pytest

from catseye.errors import InputError
from catseye.ranger.line import Request
from catseye.ranger.schedule import MOST_ENTRIES, Scheduler

SECOND = 10**9


def test_repeated_command_keeps_its_times_when_late():
    waiting = Scheduler()
    waiting.add(1, Request("CMEAS"), 10 * SECOND, repeats=4, interval=2.0)
    assert waiting.take(10 * SECOND - 1) is None  # never early
    due = []
    for late in (0.0, 0.7, 1.9, 0.3):
        due.append(waiting.due_ns / SECOND)
        assert waiting.take(waiting.due_ns + round(late * SECOND)).request.command == "CMEAS"
    assert due == [10.0, 12.0, 14.0, 16.0]
    assert waiting.due_ns is None


def test_served_client_moves_to_end_of_queue():
    waiting = Scheduler()
    for client in (1, 2):
        waiting.add(client, Request("CMEAS"), SECOND, repeats=2, interval=0.0)
    assert [waiting.take(SECOND).client for _ in range(4)] == [1, 2, 1, 2]


def test_each_connection_has_its_own_limit_and_is_cleared_separately():
    waiting = Scheduler()
    for k in range(MOST_ENTRIES):
        waiting.add(1, Request("CMEAS"), k)
    with pytest.raises(InputError, match=f"^{MOST_ENTRIES} commands are scheduled already"):
        waiting.add(1, Request("CMEAS"), 0)
    waiting.add(2, Request("BUF"), 5)
    assert waiting.clear(1) == MOST_ENTRIES
    assert [entry.client for entry in waiting.entries] == [2]
