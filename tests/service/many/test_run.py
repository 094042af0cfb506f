"""Many units: each has its outcome, in order, whatever becomes of the processes."""

import json
import multiprocessing
import os
import subprocess
import sys
import threading

import pytest

from catseye.errors import ArgumentError, InputError
from catseye.service.many.ledger import opened
from catseye.service.many.run import StoppedError, run_many
from catseye.service.many.unit import Unit
from process_scene import ends_with_us
from repository import ROOT
from service.many.many_scene import (
    backwards,
    broken,
    full,
    killed,
    killed_once,
    noted,
    process_of,
    refused,
    span,
    square,
    units,
    unsendable,
)


def states(outcomes):
    return [outcome.state for outcome in outcomes]


def test_outcomes_are_in_the_units_order_whatever_the_order_of_arrival():
    found = run_many(units(backwards, 4, 4), processes=4)
    assert [outcome.value["number"] for outcome in found] == [0, 1, 2, 3]
    assert states(found) == ["done"] * 4
    assert found[0].seconds > found[3].seconds


def test_each_process_has_one_thread_of_linear_algebra_and_the_caller_its_own(monkeypatch):
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    (found,) = run_many(units(square, 1), processes=1)
    assert found.value == {"square": 0, "third": 0.0, "threads": "1"}
    assert os.environ["OPENBLAS_NUM_THREADS"] == "2"


def test_a_process_takes_one_unit_after_another_and_no_more_than_asked_for():
    found = run_many(units(process_of, 6), processes=2)
    assert 1 <= len({outcome.value["pid"] for outcome in found}) <= 2
    assert not any(outcome.value["scipy"] for outcome in found)  # a process loads what its units need


def test_a_unit_that_raises_fails_with_its_reason_and_the_others_go_on():
    found = run_many([*units(refused, 2), *units(broken, 1), *units(square, 2)], processes=2)
    assert states(found) == ["failed", "failed", "failed", "done", "done"]
    assert found[1].why == "shots.csv: row 1, range = -1 (expected 0 or more)"
    assert found[2].why == "IndexError: list index out of range"
    assert found[0].value is None


def test_a_unit_whose_process_is_killed_once_is_done_again(tmp_path):
    found = run_many([*units(killed_once, 1, str(tmp_path)), *units(square, 3)], processes=2)
    assert states(found) == ["done"] * 4


def test_a_unit_that_always_kills_its_process_fails_and_the_others_do_not():
    found = run_many([*units(killed, 1), *units(square, 3)], processes=2)
    assert states(found) == ["failed", "done", "done", "done"]
    assert found[0].why == "its process was killed by SIGKILL 4 times, most likely out of memory"


def test_what_cannot_be_sent_to_a_process_fails_by_itself():
    found = run_many([Unit("local", lambda: {"x": 1}), Unit("answer", unsendable), *units(square, 1)], processes=1)
    assert states(found) == ["failed", "failed", "done"]
    assert "pickle" in found[0].why
    assert "pickle" in found[1].why


def test_units_share_the_memory_and_too_large_a_one_runs_by_itself():
    parts = units(span, 3, 0.3, "", memory=600)
    large = Unit("large", span, (3, 0.3, ""), memory=5000)
    found = run_many([*parts, large], processes=4, memory=1300)
    spans = [(outcome.value["start"], outcome.value["end"]) for outcome in found]
    most = max(sum(start <= at < end for start, end in spans) for at, _ in spans)
    assert most <= 2
    begin, end = spans[3]
    assert not any(other_begin < end and begin < other_end for other_begin, other_end in spans[:3])


def test_progress_counts_what_is_done_and_names_failures():
    calls = []
    run_many(
        [*units(square, 2), *units(refused, 1)], processes=1, progress=lambda *call: calls.append(call), task="x y"
    )
    assert calls[0] == ("x y", 0, 3)
    assert calls[-1] == ("x y, 1 failed", 3, 3)


def test_a_full_disk_ends_the_run_with_what_is_done(tmp_path):
    said = "full-0: --out 0: cannot be written: No space left on device; 2 of 4 are done; resume continues from there"
    with pytest.raises(StoppedError, match=said) as told:
        run_many([*units(square, 2), *units(full, 2)], processes=1, ledger=tmp_path / "ledger")
    assert (told.value.done, told.value.total) == (2, 4)


@pytest.mark.parametrize("name", ["", "a/b", "..", ".hidden"])
def test_a_name_that_is_no_files_is_refused(name):
    with pytest.raises(ArgumentError, match="is no file's name"):
        run_many([Unit(name, square, (1,))])


def test_two_units_of_one_name_are_refused():
    with pytest.raises(ArgumentError, match="stands for two of 2"):
        run_many([Unit("a", square, (1,)), Unit("a", square, (2,))])


@pytest.mark.parametrize("processes", [0, -1, 100_000])
def test_a_number_of_processes_that_cannot_be_is_refused(processes):
    with pytest.raises(ArgumentError, match=r"processes = .* \(expected 1 to 4096"):
        run_many(units(square, 1), processes=processes)


def test_no_unit_is_no_work():
    assert run_many([]) == []


def test_a_run_resumes_what_the_ledger_has(tmp_path):
    work, ledger = units(noted, 3, str(tmp_path), key="a"), tmp_path / "ledger"
    run_many(work[:2], ledger=ledger, processes=1)
    found = run_many(work, ledger=ledger, resume=True, processes=1)
    assert states(found) == ["resumed", "resumed", "done"]
    assert [outcome.value for outcome in found] == [{"number": k} for k in range(3)]
    assert [(tmp_path / f"{k}.trace").read_text() for k in range(3)] == ["done\n"] * 3
    run_many(work, ledger=ledger, processes=1)  # without resume all is done again
    assert [(tmp_path / f"{k}.trace").read_text() for k in range(3)] == ["done\ndone\n"] * 3


def test_values_are_equal_whether_done_or_resumed(tmp_path):
    first = run_many(units(square, 2), ledger=tmp_path / "ledger", processes=1)
    second = run_many(units(square, 2), ledger=tmp_path / "ledger", resume=True)
    assert [outcome.value for outcome in first] == [outcome.value for outcome in second]
    assert first[1].value["third"] == 1.0 / 3.0


def test_a_failed_unit_is_not_resumed(tmp_path):
    run_many(units(refused, 1), ledger=tmp_path / "ledger", processes=1)
    assert states(run_many(units(refused, 1), ledger=tmp_path / "ledger", resume=True, processes=1)) == ["failed"]


def test_a_ledger_has_one_run_at_a_time(tmp_path):
    with opened(tmp_path / "ledger"), pytest.raises(InputError, match="another run writes there"):
        run_many(units(square, 1), ledger=tmp_path / "ledger", processes=1)


def test_unfinished_output_of_killed_processes_is_removed_beside_outputs(tmp_path):
    (tmp_path / ".catseye-0123456789ab").mkdir()
    (tmp_path / ".catseye-0123456789ab" / "part").touch()
    (tmp_path / ".catseye-mine").touch()
    run_many(units(square, 1, output=tmp_path / "out"), processes=1)
    assert sorted(path.name for path in tmp_path.iterdir()) == [".catseye-mine"]


def test_a_run_in_a_thread_is_a_run():
    found = []
    thread = threading.Thread(target=lambda: found.extend(run_many(units(square, 2), processes=2)))
    thread.start()
    thread.join(60.0)
    assert states(found) == ["done", "done"]


def test_the_ledger_holds_one_whole_file_a_unit(tmp_path):
    run_many(units(square, 2), ledger=tmp_path / "ledger", processes=2)
    names = sorted(path.name for path in (tmp_path / "ledger").iterdir())
    assert names == ["ledger.json", "square-0.json", "square-1.json"]
    assert json.loads((tmp_path / "ledger" / "square-1.json").read_text())["entry"]["value"]["square"] == 1


def test_an_interrupted_call_ends_its_processes_and_notes_what_is_done(tmp_path):
    def interrupt(task, done, total):
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as told:
        run_many(units(square, 4), processes=1, ledger=tmp_path / "ledger", progress=interrupt)
    assert told.value.__notes__ == ["2 of 4 are done; resume continues from there"]
    for child in multiprocessing.active_children():
        child.join(5.0)  # its files are closed before it is gone: within the contract's time of an interruption
        assert not child.is_alive()
    states_then = states(run_many(units(square, 4), processes=1, ledger=tmp_path / "ledger", resume=True))
    assert states_then == ["resumed", "resumed", "done", "done"]


SCRIPT = """
from catseye.service.many.run import run_many
from service.many.many_scene import square, units
print([each.value["square"] for each in run_many(units(square, 3), processes=2)])
"""
OWN = """
from catseye.service.many.run import run_many
from catseye.service.many.unit import Unit
def own(number):
    return {"cube": number**3}
if __name__ == "__main__":
    print([each.value["cube"] for each in run_many([Unit(str(k), own, (k,)) for k in range(3)], processes=2)])
"""


@pytest.mark.parametrize(("text", "said"), [(SCRIPT, "[0, 1, 4]"), (OWN, "[0, 1, 8]")])
def test_a_script_needs_no_guard_unless_it_defines_the_work(tmp_path, text, said):
    script = tmp_path / "script.py"
    script.write_text(text)
    place = {**os.environ, "PYTHONPATH": f"{ROOT / 'src'}:{ROOT / 'tests'}"}
    done = subprocess.run(
        [sys.executable, script], check=False, capture_output=True, text=True, env=place, preexec_fn=ends_with_us()
    )
    assert (done.stdout.strip(), done.stderr, done.returncode) == (said, "", 0)
