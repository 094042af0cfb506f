"""Progress is for terminals, complaints are one line."""

import io
import threading

import pytest
import typer

from catseye.cli import terminal
from catseye.cli.inputs import prepare
from catseye.cli.terminal import ProgressLine, attempt, complain, wrapped
from catseye.errors import InputError


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_progress_is_one_line_that_is_wiped_at_the_end(monkeypatch):
    stream = Terminal()
    monkeypatch.setattr("sys.stderr", stream)
    progress = ProgressLine(quiet=False)
    progress("samples to phases", 5, 10)
    progress("adjustment", 0, 6)
    progress.clear()
    assert "samples to phases 5/10" in stream.getvalue()
    assert "adjustment 0/6" in stream.getvalue()
    assert "\n" not in stream.getvalue()
    assert stream.getvalue().endswith("\r\x1b[K")


class Listener(io.StringIO):
    """A stream that says when a text has come."""

    def __init__(self, wanted, terminal):
        super().__init__()
        self.wanted, self.terminal, self.heard = wanted, terminal, threading.Event()

    def isatty(self):
        return self.terminal

    def write(self, text):
        count = super().write(text)
        if self.wanted in self.getvalue():
            self.heard.set()
        return count


@pytest.mark.parametrize(("shown", "wanted"), [(True, "report.html 5/6, for "), (False, "report.html 5 of 6, for ")])
def test_a_step_that_says_nothing_is_named_again_with_its_time(monkeypatch, shown, wanted):
    """The page is the longest step, and one call: whoever waits reads what for and how long already."""
    stream = Listener(wanted, shown)
    monkeypatch.setattr("sys.stderr", stream)
    for name, seconds in (("BEAT", 0.001), ("SURE", 0.01), ("FIRST_LINE", 0.02), ("BETWEEN_LINES", 0.02)):
        monkeypatch.setattr(terminal, name, seconds)
    progress = ProgressLine(quiet=False)
    progress("writing report.html", 5, 6)
    assert stream.heard.wait(20.0)
    progress.clear()
    assert not [thread for thread in threading.enumerate() if thread.name == "catseye-progress"]  # none to say more


@pytest.mark.parametrize(("stream", "quiet"), [(io.StringIO(), False), (Terminal(), True)])
def test_progress_is_silent_elsewhere_or_when_asked(monkeypatch, stream, quiet):
    monkeypatch.setattr("sys.stderr", stream)
    progress = ProgressLine(quiet=quiet)
    progress("adjustment", 0, 6)
    progress.clear()
    assert stream.getvalue() == ""


@pytest.mark.parametrize("json", [True, False])
def test_no_plain_line_of_progress_with_json_of_the_running_command(monkeypatch, json):
    """The command's own option counts, not the process's words."""
    stream, app = io.StringIO(), typer.Typer()
    monkeypatch.setattr("sys.stderr", stream)
    monkeypatch.setattr("sys.argv", ["catseye", "--json"])
    monkeypatch.setattr(terminal, "FIRST_LINE", 0.0)

    @app.command()
    def work(*, json: bool = False) -> None:
        progress = ProgressLine(quiet=False)
        progress("adjustment", 1, 6)
        progress.clear()

    prepare(app)
    typer.main.get_command(app).main(["--json"] * json, standalone_mode=False)
    assert stream.getvalue() == "" if json else "adjustment 1 of 6\n"


@pytest.mark.parametrize("shown", [True, False])
def test_json_silences_plain_lines_and_no_terminal(monkeypatch, shown):
    stream = Terminal() if shown else io.StringIO()
    monkeypatch.setattr("sys.stderr", stream)
    monkeypatch.setattr(terminal, "FIRST_LINE", 0.0)
    progress = ProgressLine(quiet=False, json=True)
    progress("adjustment", 1, 6)
    progress.clear()
    assert ("adjustment 1/6" in stream.getvalue()) == shown


def test_a_complaint_is_one_printable_line(capsys):
    complain("a\nb\x1b[0m\tc")
    assert capsys.readouterr().err == "catseye: a b [0m c\n"


def test_each_outcome_has_its_status(capsys):
    def leave(status):
        raise SystemExit(status)

    def fail(problem):
        raise problem

    assert attempt(lambda: None) == 0
    assert attempt(lambda: leave(2)) == 2
    assert attempt(lambda: fail(InputError("site.toml: bad"))) == 1
    assert attempt(lambda: fail(PermissionError(13, "Permission denied", "x.csv"))) == 1
    assert capsys.readouterr().err == "catseye: site.toml: bad\ncatseye: x.csv: Permission denied\n"


def test_a_passage_hangs_under_its_title():
    lines = wrapped("The air", "word " * 60).splitlines()
    assert lines[0].startswith("The air       word")
    assert all(line.startswith(" " * 14 + "word") for line in lines[1:])
    assert max(map(len, lines)) <= 100


def test_a_step_of_slow_parts_keeps_its_estimate_between_them(monkeypatch):
    """Nights take a minute each: whoever waits for the third of twelve wants to know until when."""
    clock = [100.0]
    monkeypatch.setattr(terminal.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr("sys.stderr", io.StringIO())
    progress = ProgressLine(quiet=False)
    monkeypatch.setattr(progress, "_beat", threading.Thread())  # none
    progress("reducing nights", 0, 12)
    for done, now in ((1, 160.0), (2, 220.0)):
        clock[0] = now
        progress("reducing nights", done, 12)
    assert progress._left(220.0, 2, 12) == ", 2 min 0 s, some 10 min 0 s left"
    assert progress._left(250.0, 2, 12) == ", 2 min 30 s, some 9 min 30 s left"
    assert progress._left(401.0, 2, 12) == ", for 3 min 1 s"  # thrice as long as one took
    assert progress.counts == (2, 12)
