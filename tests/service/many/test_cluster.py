"""A cluster of dask gives what processes give; one that is not there is refused in one line."""

import os
import sys

import pytest

from catseye.errors import ArgumentError, InputError
from catseye.service.many import cluster as dask
from catseye.service.many.run import run_many
from catseye.service.many.unit import Unit
from service.many.many_scene import killed, refused, square, units


def test_a_cluster_needs_dask(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    text = (
        r"cluster needs dask.distributed \(expected catseye installed with its extra: pip install 'catseye\[scale\]'\)"
    )
    with pytest.raises(InputError, match=text):
        run_many(units(square, 1), cluster="local")


@pytest.mark.parametrize("address", ["here", "localhost:8786", "/nowhere/scheduler.json"])
def test_what_is_no_address_is_refused(address):
    pytest.importorskip("distributed")
    with pytest.raises(ArgumentError, match="is no address and no file") as told:
        run_many(units(square, 1), cluster=address)
    assert told.value.names == ("cluster",)


def test_a_scheduler_that_does_not_answer_is_one_line(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(dask, "CONNECT", 0.5)
    with pytest.raises(InputError, match=r"cluster tcp://127\.0\.0\.1:9: no worker answers") as told:
        run_many(units(square, 1), cluster="tcp://127.0.0.1:9")
    assert "\n" not in str(told.value)


def test_a_local_cluster_gives_what_processes_give():
    pytest.importorskip("distributed")
    before = dict(os.environ), sys.modules["__main__"]
    work = [*units(square, 3), *units(refused, 1)]
    of_cluster, of_processes = run_many(work, processes=2, cluster="local"), run_many(work, processes=2)
    assert [(each.state, each.why, each.value) for each in of_cluster] == [
        (each.state, each.why, each.value) for each in of_processes
    ]
    assert of_cluster[0].value["threads"] == "1"
    assert before == (dict(os.environ), sys.modules["__main__"])


@pytest.mark.slow
def test_a_unit_that_kills_its_workers_fails_and_the_others_do_not():
    found = run_many([*units(killed, 1), *units(square, 2)], processes=2, cluster="local")
    assert [outcome.state for outcome in found] == ["failed", "done", "done"]
    assert found[0].why == "its worker was killed 4 times, most likely out of memory"


def test_a_worker_of_another_version_stops_the_run(tmp_path):
    report = dask.perform_remotely(Unit("a", square, (1,)), None, "0.0.1")
    assert report.state == "stopped"
    assert "and the run 0.0.1 (expected the same)" in report.why


def test_a_worker_that_does_not_see_the_ledger_stops_the_run(tmp_path):
    from catseye.service.many.work import perform

    report = perform(Unit("a", square, (1,)), tmp_path / "elsewhere")
    assert report.state == "stopped"
    assert report.why.endswith("elsewhere: a worker does not see it (expected a folder that all machines share)")
