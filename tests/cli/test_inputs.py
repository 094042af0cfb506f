"""Features of all commands: names of examples, help by subject, progress, and `python -m catseye`."""

import json
import subprocess
import sys
from typing import Annotated

import pytest
import typer

from catseye.cli import terminal
from catseye.cli.commands import SUBJECTS, app
from catseye.cli.inputs import OUTPUTS, WRITTEN, paths_of, prepare
from catseye.cli.terminal import ProgressLine, attempt
from catseye.errors import ArgumentError
from catseye.gateways.plots import plot_passages
from command_scene import COMMAND, command_line


@pytest.fixture
def catseye(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return command_line(capsys)


def callbacks():
    for group in (app, *(each.typer_instance for each in app.registered_groups)):
        for command in group.registered_commands:
            yield command.callback


READ = [
    *("addresses", "after", "against", "angles", "archive", "as_left", "before", "buffer"),
    *("calibrations", "campaign", "cmm", "constraints", "earlier", "epoch", "epochs"),
    *("file", "files", "heights", "inputs", "instrument", "interlocks", "job", "keep_out"),
    *("laboratory", "later", "mirror", "model", "monument", "mount", "moves", "network", "nodes"),
    *("observations", "page_certificate", "page_key", "page_token_file"),
    *("points", "pose", "poses", "positions", "ranges", "readings", "record", "replaces"),
    *("result", "scans", "series", "sheet", "site", "solids", "sources", "stations"),
    *("structure", "survey", "survey_left", "table", "targets", "tilts", "times", "train"),
    "weather",
]


def test_every_path_is_known_to_be_read_or_written():
    """A new option that is a path is put into one of the lists, or an example could stand where a file is written."""
    named = {name for callback in callbacks() for name in paths_of(callback)}
    assert named >= WRITTEN | OUTPUTS
    assert sorted(named - WRITTEN) == READ


def test_an_example_s_name_stands_for_its_path(catseye, tmp_path):
    status, said, complaint = catseye("adjust", "networks/ground-ring", "--json")
    assert (status, complaint) == (0, "")
    assert json.loads(said)["verdict"]["word"] == "good"
    status, said, _ = catseye("reduce", "night-01", "--out", "night-01", "--quiet")  # an output may have that name
    assert status == 0
    assert (tmp_path / "night-01" / "report.html").exists()
    status, said, _ = catseye("pose", "night-01", "--site", "examples/night-01", "--json")
    assert status == 0
    assert json.loads(said)["group"] == "dish"


def test_what_is_written_is_never_an_example(catseye, tmp_path):
    (tmp_path / "networks").mkdir()
    status, _, _ = catseye("adjust", "--template", "networks/template")
    assert status == 0
    assert sorted(path.name for path in (tmp_path / "networks" / "template").iterdir()) == [
        "README.md",
        "points.csv",
        "ranges.csv",
    ]
    status, _, complaint = catseye("adjust", "--template", "networks/template")
    assert status == 1
    assert "exists and is not empty" in complaint
    assert catseye("adjust", "networks/template", "--strict", "--quiet")[0] == 0


def test_examples_are_listed_and_written(catseye, tmp_path):
    status, said, _ = catseye("examples")
    assert status == 0
    assert "feed-arm.toml" in said
    assert not [line for line in said.splitlines() if line.endswith("-")], "a name is broken at a hyphen"
    status, said, _ = catseye("examples", "mine", "--json")
    assert status == 0
    assert json.loads(said)["written"] == "mine"
    assert (tmp_path / "mine" / "night-01" / "frames.npy").exists()


def test_help_has_every_command_under_one_subject(catseye):
    _, said, _ = catseye("--help")
    named = [name for names in SUBJECTS.values() for name in names]
    assert sorted(named) == sorted(COMMAND.commands)
    assert "More:" not in said
    assert all(f"{subject}:" in said for subject in SUBJECTS)


def test_strict_stops_after_writing_where_the_verdict_is_not_good(catseye, tmp_path):
    catseye("adjust", "--template", "net")
    ranges = tmp_path / "net" / "ranges.csv"
    lines = ranges.read_text().splitlines()
    cells = lines[3].split(",")
    cells[2] = f"{float(cells[2]) + 0.01:.5f}"
    ranges.write_text("\n".join([*lines[:3], ",".join(cells), *lines[4:]]))
    status, said, complaint = catseye("adjust", "net", "--out", "report", "--strict")
    assert status == 1
    assert complaint.startswith("catseye: Doubtful: ")
    assert said.startswith("Verdict       Doubtful: ")
    assert 'class="verdict doubtful"' in (tmp_path / "report" / "report.html").read_text()
    assert catseye("adjust", "net", "--json")[0] == 0


def test_python_m_catseye_is_catseye():
    done = subprocess.run([sys.executable, "-m", "catseye", "air"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "catseye air" in done.stderr


def test_a_refusal_names_the_options_as_the_command_spells_them(capsys):
    """Parameters whose option has another name, and an argument by its name in the help."""
    app = typer.Typer()

    @app.command()
    def work(
        table: Annotated[str, typer.Argument(metavar="TABLE.csv")],
        since: Annotated[float, typer.Option("--from")],
        u_range_mm: Annotated[float, typer.Option()] = 1.0,
    ) -> None:
        raise ArgumentError("table, since and u_range_mm do not fit", "table", "since", "u_range_mm")

    prepare(app)
    command = typer.main.get_command(app)
    assert attempt(lambda: command.main(["a", "--from", "1"], standalone_mode=False)) == 2
    assert capsys.readouterr().err == "catseye: TABLE.csv, --from and --u-range-mm do not fit\n"


class Clock:
    def __init__(self, monkeypatch):
        self.now = 0.0
        monkeypatch.setattr(terminal.time, "monotonic", lambda: self.now)


def progress(monkeypatch, capsys, json=False):
    """What 100 steps of half a second each say on a stderr that is no terminal."""
    clock = Clock(monkeypatch)
    line = ProgressLine(quiet=False, json=json)
    for k in range(100):
        clock.now = 0.5 * k
        line("measuring on paper", k, 100)
    line.clear()
    return capsys.readouterr().err.splitlines()


def test_long_work_says_plain_lines_with_an_end_where_stderr_is_no_terminal(monkeypatch, capsys):
    said = progress(monkeypatch, capsys)
    assert said == [
        "measuring on paper 20 of 100, 10 s, some 40 s left",
        "measuring on paper 40 of 100, 20 s, some 30 s left",
        "measuring on paper 60 of 100, 30 s, some 20 s left",
        "measuring on paper 80 of 100, 40 s, some 10 s left",
    ]


def test_a_program_that_reads_json_hears_nothing(monkeypatch, capsys):
    assert progress(monkeypatch, capsys, json=True) == []


def test_a_terminal_sees_one_line_with_the_end_foretold(monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    said = "".join(progress(monkeypatch, capsys))
    assert "50/100, 25 s, some 25 s left" in said
    assert said.endswith("\x1b[K")


@pytest.mark.parametrize("kind", ["servo", "air", "polarization", "return"])
def test_plots_are_told_in_sentences(catseye, kind):
    status, said, _ = catseye("plot", kind, "--out", "f.svg")
    assert status == 0
    assert "{" not in said
    assert "Written to    f.svg" in said
    status, told, _ = catseye("plot", kind, "--out", "f.svg", "--json")
    summary = json.loads(told)
    assert summary["verdict"]["word"] == "good"
    assert plot_passages(kind, summary)


def test_a_number_without_sentences_of_its_kind_is_still_told():
    assert [tuple(p) for p in plot_passages("new", {"a_b": 1.5, "of": {"x_y": [1, 2.25]}, "none": None})] == [
        ("a b", "1.5"),
        ("of", "x y 1, 2.25"),
    ]


@pytest.mark.parametrize(
    "line",
    [
        "locate positions/stations.csv positions/ranges.csv",
        "movements movements/before.csv movements/after.csv --points movements/points.csv",
        "path weather/stations.csv --start=0,0,3 --end=100,0,40",
        "weather weather/valley.csv",
        "phase buffers/clipped.csv",
        "model displace structural-model/telescope.toml --posture 145,45",
        "convert --point 0,0,60 --from-frame reflector --to-frame ground --posture 145,30",
        "triplets bound",
        "scan compare scans/incidence.csv scans/rotation.csv",
        "scan fit scans/azimuth.csv scans/elevation.csv --mirror night-01/mirrors/ZP103.toml",
        "follow vibration/quadrant.csv --slope-mm 10 --u-signal 0.002 --modes 2",
        "cycles cycles/three-frequencies.csv --group-index 1.000253",
        "servo identify servo/moves.csv",
        "frequencies --disturbance 0.001",
        "acoustic-field acoustic/array-stations.csv acoustic/array-times.csv --sheet acoustic/array-times.toml",
    ],
    ids=lambda line: " ".join(line.split()[:2]),
)
def test_an_earlier_output_is_replaced(catseye, line):
    for _ in range(2):
        status, _, complaint = catseye(*line.split(), "--out", "made")
        assert (status, complaint) == (0, "")
