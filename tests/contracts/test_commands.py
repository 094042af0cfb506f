"""The command line keeps its contract: statuses, streams, keys, and an example in every help."""

import inspect
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

import catseye as catseye_package
from catseye import __version__
from catseye.atmosphere.index.air import MODELS
from catseye.cli.commands import app
from catseye.cli.inputs import WRITTEN
from catseye.cli.vocabularies import AIR_MODELS
from command_scene import command_line
from process_scene import ends_with_us
from repository import ROOT

NIGHT = ROOT / "examples" / "night-01"
WEATHER = ["--temperature-c", "20", "--pressure-hpa", "933", "--humidity-percent", "50"]
COMMANDS = sorted(typer.main.get_command(app).commands)


@pytest.fixture
def catseye(capsys, tmp_path, monkeypatch):
    """A command run in this process and an empty directory: exit status, what it said, what it complained of."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("catseye.cli.terminal.FIRST_LINE", float("inf"))  # beside other load any work is long, and told
    return command_line(capsys)


def started(*arguments, cwd=None, **streams):
    """The program as a user starts it: its entry point in a process of its own."""
    code = "from catseye.cli.main import run; run()"
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "preexec_fn": ends_with_us(), **streams}
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)], check=False, text=True, cwd=cwd, timeout=60, **streams
    )


@pytest.fixture(scope="session")
def reduced(tmp_path_factory):
    """One whole `reduce --json --out`, the first on its machine: matplotlib builds its font cache and would say so."""
    out, fresh = tmp_path_factory.mktemp("reduced") / "out", tmp_path_factory.mktemp("home")
    place = {**os.environ, "HOME": str(fresh), "MPLCONFIGDIR": str(fresh)}
    return started("reduce", NIGHT, "--out", out, "--json", env=place), out


def test_reduce_gives_one_object_on_stdout_and_nothing_on_stderr(reduced):
    done, out = reduced
    assert (done.returncode, done.stderr) == (0, "")
    found = json.loads(done.stdout, parse_constant=pytest.fail)
    keys = {
        "points",
        "variance_factor",
        "degrees_of_freedom",
        "rejected",
        "refractivity_ppm",
        "pose",
        "status",
        "notes",
    }
    assert set(found) >= keys | {"ranger_zeros", "air"}
    saved = json.loads((out / "coordinates.json").read_text())
    assert {key: saved[key] for key in found} == found


def test_reduce_writes_every_file_and_leaves_no_neighbour(reduced):
    _, out = reduced
    files = (
        "contradictions.csv coordinates.csv coordinates.json pose.json provenance.json ranges.csv records.csv "
        "report.html results.fits surface.csv"
    )
    assert sorted(path.name for path in out.iterdir()) == files.split()
    assert [path.name for path in out.parent.iterdir()] == ["out"]


def test_reduce_replaces_its_own_output_and_tells_people(catseye, reduced, tmp_path):
    out = shutil.copytree(reduced[1], tmp_path / "out")
    status, said, complaint = catseye("reduce", NIGHT, "--out", out, "--air-model", "ciddor_hill1999")
    assert (status, complaint) == (0, "")
    for word in ("The shots", "The feed arm", "The dish", "The air", "variance factor", "report.html"):
        assert word.lower() in said.lower()
    assert "\x1b" not in said
    assert json.loads((out / "provenance.json").read_text())["settings"]["air_model"] == "ciddor_hill1999"


def test_demo_reports_and_ends_with_the_path(catseye, tmp_path):
    status, said, complaint = catseye("demo")
    assert (status, complaint) == (0, "")
    report = tmp_path / said.strip().splitlines()[-1].removeprefix("Report: ")
    assert report == tmp_path / "demo-night-01" / "report.html"
    assert report.is_file()


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["bogus"],
        ["--bogus"],
        ["air"],
        ["air", *WEATHER, "--bogus"],
        ["air", *WEATHER, "--co2-ppm", "much"],
        ["air", *WEATHER, "--model", "bogus"],
        ["air", *WEATHER, "--u-pressure-hpa", "-1"],
        ["air", *WEATHER, "--u-pressure-hpa", "nan"],
        ["reduce"],
        ["reduce", str(NIGHT)],
        ["reduce", str(NIGHT), "--out", "x", "--air-model", "bogus"],
        ["demo", "a", "b"],
    ],
)
def test_wrong_usage_is_2(catseye, arguments, tmp_path):
    status, said, complaint = catseye(*arguments)
    assert status == 2
    assert "Usage" in said + complaint
    assert "Traceback" not in complaint
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("arguments", [[], ["air", *WEATHER, "--bogus"]])
def test_the_process_of_wrong_usage_ends_with_2(arguments, tmp_path):
    done = started(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert "Usage" in done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["reduce", "missing", "--out", "x"], "missing"),
        (["reduce", "missing", "--json"], "missing"),
        (["reduce", str(ROOT / "pyproject.toml"), "--json"], "is not a directory"),
        (["reduce", str(ROOT / "tests"), "--json"], "site.toml"),
        (["reduce", str(NIGHT), "--out", "no/out"], "no is not a directory"),
        (["reduce", str(NIGHT), "--out", "/proc/out"], "/proc/out"),
        (["air", *WEATHER, "--temperature-c", "300"], "temperature 300 C is outside"),
        (["air", *WEATHER, "--temperature-c", "nan"], "not a number"),
        (["air", *WEATHER, "--wavelength-um", "-1"], "wavelength -1 um is outside"),
    ],
)
def test_what_cannot_be_done_is_1_in_one_line(catseye, arguments, said, tmp_path):
    status, out, complaint = catseye(*arguments)
    assert (status, out) == (1, "")
    assert complaint.startswith("catseye: ")
    assert complaint.count("\n") == 1
    assert said in complaint
    assert not list(tmp_path.iterdir())


def test_the_process_of_what_cannot_be_done_ends_with_1_and_a_name_with_a_line_break_still_makes_one_line():
    done = started("reduce", "no\nsuch\x1b[31m\nplace", "--json")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (1, "", 1)
    assert done.stderr.startswith("catseye: ")
    assert "\x1b" not in done.stderr


def test_a_full_disk_under_stdout_is_1_in_one_line():
    with Path("/dev/full").open("w") as full:
        done = started("air", *WEATHER, "--json", stdout=full)
    assert (done.returncode, done.stderr) == (1, "catseye: standard output: No space left on device\n")


def test_a_reader_who_leaves_early_is_no_failure():
    reading, writing = os.pipe()
    os.close(reading)
    done = started("air", *WEATHER, stdout=writing)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_terminal_that_knows_ascii_only_is_no_failure():
    done = started("air", *WEATHER, env={**os.environ, "PYTHONIOENCODING": "ascii"})
    assert (done.returncode, done.stderr) == (0, "")


def test_a_fault_of_ours_is_one_line_too():
    code = (
        "import catseye.cli.commands as c\n"
        "def broken(): raise ZeroDivisionError('a\\nb')\n"
        "c.main = broken\n"
        "from catseye.cli.main import run; run()"
    )
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert done.returncode == 1
    assert re.fullmatch(r"catseye: internal error, .*ZeroDivisionError: a b \(.*:\d+\)\n", done.stderr)


def test_air_gives_the_keys_of_the_contract():
    found = json.loads(CliRunner().invoke(app, ["air", *WEATHER, "--json"]).stdout)
    keys = {"group_index", "phase_index", "vapour_pressure_hpa", "dew_point_c", "group_wavelength", "sensitivity"}
    assert set(found) >= keys | {"standard_uncertainty", "model", "wavelength_um"}
    assert set(found["sensitivity"]) >= {"temperature_c", "pressure_hpa", "humidity_percent"}


def test_air_agrees_with_the_notes_worked_example():
    """[PARKER04] section 1.4 prints 1.000 253 24 and a modulation of 0.199 811 04 m."""
    found = json.loads(CliRunner().invoke(app, ["air", *WEATHER, "--json", "--model", "rueger1990"]).stdout)
    assert found["group_index"] == pytest.approx(1.00025324, abs=1e-8)
    assert found["group_wavelength"] == pytest.approx(0.19981104, abs=1e-8)


def test_perfectly_dry_air_has_no_dew_point():
    dry = [*WEATHER, "--humidity-percent", "0"]
    assert json.loads(CliRunner().invoke(app, ["air", *dry, "--json"]).stdout)["dew_point_c"] is None
    assert "dew point none" in CliRunner().invoke(app, ["air", *dry]).stdout


def test_the_version_is_said():
    assert CliRunner().invoke(app, ["--version"]).stdout == f"catseye {__version__}\n"


def test_help_names_every_air_model():
    assert AIR_MODELS.split("|") == list(MODELS)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_help_has_an_example_that_parses(command, tmp_path, monkeypatch):
    text = CliRunner().invoke(app, [command, "--help"]).stdout
    example = shlex.split(re.search(r"Examples?: catseye (.+)", text)[1])
    assert example[0] == command
    parser = typer.main.get_command(app).commands[command]
    while hasattr(parser, "commands"):  # a group: the example's next word names the command
        parser, example = parser.commands[example[1]], example[1:]
    with parser.make_context(command, example[1:]) as context:
        assert context.params


@pytest.mark.parametrize("arguments", [["--version"], ["--help"], ["air", *WEATHER]])
def test_quick_answers_spare_the_heavy_imports(arguments):
    code = (
        "import atexit, sys\n"
        "heavy = {'scipy', 'matplotlib', 'catseye.records'}\n"
        "atexit.register(lambda: print(sorted(heavy & set(sys.modules)), file=sys.stderr))\n"
        "from catseye.cli.main import run; run()"
    )
    done = subprocess.run([sys.executable, "-c", code, *arguments], check=True, capture_output=True, text=True)
    assert done.stderr.strip() == "[]"


VERBS = ("plot",)  # groups whose name is the verb
BUILTINS = {"help": "topic"}  # command whose name is one of Python's -> its function
OF_THE_TERMINAL = {"json", "out", "quiet", "strict", "page", "threads"}
OTHER_NAMES = {  # command -> its option: the argument that takes its value
    "point": {"file": "to"},
    "convert": {"point": "points", "file": "points"},
    "track": {"to": "points", "file": "points"},
}
OF_SEVERAL = {  # command that takes one input or several -> function for several
    "reduce": "reduce_nights",
    "replay": "replay_journals",
    "simulate": "simulate_runs",
}
OTHER_DEFAULTS = {
    "simulate": {"fast", "port_base"}
}  # a person watches in real time; a call takes virtual time, any port


def callbacks():
    """Function of each command by its words; of a group's, "group command"."""
    groups = [("", app), *((f"{group.name} ", group.typer_instance) for group in app.registered_groups)]
    return {
        prefix + (command.name or command.callback.__name__.replace("_", "-")): command.callback
        for prefix, instance in groups
        for command in instance.registered_commands
    }


WITHOUT_CALL = {"demo", "serve", "view", "zy", "ziy"}  # the first is `reduce`, `save`; servers end with their process
ONE_CALL = sorted(set(callbacks()) - WITHOUT_CALL)


def python_name(words):
    """Function of catseye that is a command: `pointing fit` is `fit_pointing`, `plot sky` is `plot_sky`."""
    parts = words.split()
    if words in BUILTINS:
        return BUILTINS[words]
    return "_".join(parts if parts[0] in VERBS else reversed(parts)).replace("-", "_")


def signatures(words):
    """Parameters of a command, and of its function; where another does several inputs, of both."""
    names = [OF_SEVERAL[words]] if words in OF_SEVERAL else []
    functions = [getattr(catseye_package, name) for name in (*names, python_name(words))]
    parameters = {key: each for function in functions for key, each in inspect.signature(function).parameters.items()}
    return inspect.signature(callbacks()[words]).parameters, parameters


def test_a_command_of_a_group_has_its_verb_first_in_python():
    assert (python_name("air"), python_name("pointing fit")) == ("air", "fit_pointing")
    assert set(callbacks()) >= WITHOUT_CALL


@pytest.mark.parametrize("words", ONE_CALL)
def test_function_takes_every_option_of_its_command(words):
    options, parameters = signatures(words)
    renamed = OTHER_NAMES.get(words, {})
    assert {renamed.get(option, option) for option in set(options) - OF_THE_TERMINAL - WRITTEN} <= set(parameters)


@pytest.mark.parametrize("words", ONE_CALL)
def test_function_has_the_defaults_of_its_command(words):
    options, parameters = signatures(words)
    both = set(options) & set(parameters) - OF_THE_TERMINAL - OTHER_DEFAULTS.get(words, set())
    scalars = bool | int | float | str
    compared = [key for key in both if all(isinstance(each[key].default, scalars) for each in (options, parameters))]
    assert {key: options[key].default for key in compared} == {key: parameters[key].default for key in compared}
