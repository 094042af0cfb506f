"""`catseye reduce` of several nights, as a person and a program meet it."""

import json
import os
import pty
import select
import signal
import sys
import time

import pytest

from catseye.reduction.night.digest import digest
from command_scene import command_line
from repository import ROOT
from service.many.night_scene import nights_of, small_night


@pytest.fixture
def command(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return command_line(capsys)


@pytest.fixture(scope="module")
def nights(tmp_path_factory):
    place = tmp_path_factory.mktemp("nights")
    return nights_of(small_night(place / "simulated"), place, 4)


def test_several_nights_answer_with_a_list_and_folders(command, nights, tmp_path):
    status, said, complaint = command("reduce", *nights[:2], "--out", "out", "--processes", "2", "--json")
    assert (status, complaint) == (0, "")
    answer = json.loads(said, parse_constant=pytest.fail)
    assert [(each["name"], each["state"], each["why"]) for each in answer] == [
        ("night-00", "done", ""),
        ("night-01", "done", ""),
    ]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["ledger", "night-00", "night-01"]
    status, said, complaint = command("reduce", *nights[:3], "--out", "out", "--processes", "1", "--resume")
    assert (status, complaint) == (0, "")
    assert "3 of 3 nights done, 2 of them in an earlier run" in said
    assert "out/NAME/ for each night" in said


def test_one_night_answers_as_it_did(command, nights):
    status, said, _ = command("reduce", nights[0], "--json")
    assert status == 0
    assert "variance_factor" in json.loads(said)


def test_a_failed_night_is_listed_and_the_status_is_1(command, nights, tmp_path):
    status, said, complaint = command("reduce", nights[0], tmp_path / "missing", "--out", "out", "--processes", "1")
    assert status == 1
    assert "Failed missing: " in " ".join(said.split())
    assert complaint.startswith("catseye: 1 of 2 nights failed: missing: ")
    assert complaint.count("\n") == 1
    status, said, complaint = command(
        "reduce", nights[0], tmp_path / "missing", "--out", "out", "--processes", "1", "--json", "--resume"
    )
    assert status == 1
    assert [each["state"] for each in json.loads(said)] == ["resumed", "failed"]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["a", "b"], "is needed for several nights"),
        (["a", "b", "--out", "x", "--threads", "2"], "is for one night"),
        (["a", "--out", "x", "--processes", "2"], "is for several nights"),
        (["a", "--out", "x", "--resume"], "is for several nights"),
        (["a", "--out", "x", "--cluster", "local"], "is for several nights"),
        (["a", "b", "--out", "x", "--processes", "0"], "greater than or equal to 1"),
        (["a", "b", "--out", "x", "--processes", "9999"], "--processes = 9999 (expected 1 to 4096)"),
        (["p/a", "q/a", "--out", "x"], "two nights are named a: "),
    ],
)
def test_wrong_usage_is_2(command, words, complaint, tmp_path):
    status, said, complained = command("reduce", *words)
    assert status == 2
    assert complaint in said + complained
    assert not [path for path in tmp_path.iterdir() if path.name != "x"]


def in_terminal(words, place, until):
    """The program in a terminal, with Ctrl-C when a text has come: status, text, s from the key to its end."""
    pid, terminal = pty.fork()
    if not pid:
        os.chdir(place)
        os.environ["PYTHONPATH"] = str(ROOT / "src")
        os.execv(sys.executable, [sys.executable, "-m", "catseye", *map(str, words)])
    text, pressed, start = b"", 0.0, time.monotonic()
    try:
        while time.monotonic() - start < 120.0:
            if select.select([terminal], [], [], 1.0)[0]:
                try:
                    text += os.read(terminal, 65_536)
                except OSError:  # its end has left
                    break
            if not pressed and until in text:
                pressed = time.monotonic()
                os.write(terminal, b"\x03")
    finally:
        ended = time.monotonic()
        os.kill(pid, signal.SIGCONT)
        _, status = os.waitpid(pid, 0)
        os.close(terminal)
    return os.waitstatus_to_exitcode(status), text.decode(), ended - pressed


def test_ctrl_c_says_how_far_it_came_and_resume_continues(command, nights, tmp_path):
    words = ["reduce", *nights, "--out", "out", "--processes", "1"]
    status, text, seconds = in_terminal(words, tmp_path, b" 2/4")
    assert status == 130
    assert seconds < 5.0
    assert "catseye: 2 of 4 nights were done; the same command with --resume continues from there" in text
    assert "catseye: interrupted by Ctrl-C; nothing half-written is left" in text
    assert "Traceback" not in text
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["ledger", "night-00", "night-01"]
    status, said, _ = command(*words, "--resume", "--json")
    assert status == 0
    answer = json.loads(said)
    assert [each["state"] for each in answer] == ["resumed", "resumed", "done", "done"]
    import catseye

    assert answer[2]["digest"] == digest(catseye.reduce(nights[2]).reduction)
