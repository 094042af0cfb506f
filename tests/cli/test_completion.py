"""Completion: bash, zsh and fish ask the program, which answers words, examples and files, quickly."""

import os
import subprocess
import sys
from fnmatch import fnmatch

import pytest

from catseye.api.reading import examples
from catseye.cli.commands import app
from catseye.cli.completion import EXAMPLES, names
from catseye.cli.inputs import WRITTEN, paths_of
from catseye.cli.vocabularies import CALIBRATION_KINDS
from command_scene import COMMAND

BASH = """
eval "$(_CATSEYE_COMPLETE=source_bash catseye)"
COMP_WORDS=(catseye "$@")
COMP_CWORD=$#
_catseye_completion catseye
printf '%s\\n' "${COMPREPLY[@]}"
"""
WITHOUT_EXAMPLES = {  # paths that are read and have no bundled example
    *(
        "addresses",
        "against",
        "archive",
        "cmm",
        "earlier",
        "epoch",
        "epochs",
        "file",
        "interlocks",
        "inputs",
        "page_key",
    ),
    *(
        "page_certificate",
        "page_token_file",
        "pose",
        "poses",
        "positions",
        "replaces",
        "sources",
        "survey_left",
        "zy files",
    ),
}


@pytest.fixture
def bash(tmp_path, monkeypatch):
    """Completions of a line in a bash that installed the program's own function, in a folder with files."""
    program = tmp_path / "bin" / "catseye"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m catseye "$@"\n')
    program.chmod(0o755)
    folder = tmp_path / "here"
    (folder / "nights").mkdir(parents=True)
    (folder / "network.toml").touch()
    path = f"{program.parent}{os.pathsep}{os.environ['PATH']}"

    def completions(*words):
        command = ["bash", "--norc", "-c", BASH, "bash", *words]
        done = subprocess.run(
            command, env={**os.environ, "PATH": path}, cwd=folder, capture_output=True, text=True, check=True
        )
        assert done.stderr == ""
        return done.stdout.split()

    return completions


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["adj"], ["adjust"]),
        (["plot", "co"], ["coating"]),
        (["reduce", "--air"], ["--air-model"]),
        (["adjust", "--datum", "f"], ["free", "fixed"]),
        (["refractometer", "--model", "r"], ["rueger1990"]),
        (["calibrate", "height"], ["height-gauge"]),
        (["calibrate", "encoder", "calib"], ["calibrations/encoder-planted.csv", "calibrations/encoder.csv"]),
        (["certificate", "mirror", "mir"], ["mirrors/ZP103.toml", "mirrors/ZP3.toml"]),
        (["reduce", "nigh"], ["night-01", "nights/"]),
        (["simulate", "g"], ["gbt"]),
        (["reduce", "nights"], []),  # no example: bash completes the folder itself
        (["reduce", "--out", "n"], []),  # written
    ],
)
def test_bash_completes(bash, words, expected):
    assert bash(*words) == expected


def test_bash_completes_examples_of_networks_beside_files(bash):
    completions = bash("adjust", "net")
    assert {"network.toml", "networks/feed-arm.toml", "networks/ground-ring"} <= set(completions)


def test_bash_completes_every_kind_of_calibration_and_of_figure(bash):
    assert bash("calibrate", "") == CALIBRATION_KINDS.split("|")
    assert sorted(bash("plot", "")) == sorted(COMMAND.commands["plot"].commands)


@pytest.mark.parametrize(
    ("shell", "line"),
    [("zsh", {"_TYPER_COMPLETE_ARGS": "catseye calibrate enc"}),
     ("fish", {"_TYPER_COMPLETE_ARGS": "catseye calibrate enc", "_TYPER_COMPLETE_FISH_ACTION": "get-args"})],
)  # fmt: skip
def test_other_shells_are_answered_too(shell, line):
    env = {**os.environ, "_CATSEYE_COMPLETE": f"complete_{shell}", **line}
    done = subprocess.run([sys.executable, "-m", "catseye"], env=env, capture_output=True, text=True, check=True)
    assert "encoder" in done.stdout


def test_completion_spares_the_heavy_imports():
    code = (
        "import atexit, sys\n"
        "heavy = {'numpy', 'scipy', 'matplotlib', 'astropy', 'catseye.records.files.record'}\n"
        "atexit.register(lambda: print(sorted(heavy & set(sys.modules)), file=sys.stderr))\n"
        "from catseye.cli.main import run; run()"
    )
    line = {"_CATSEYE_COMPLETE": "complete_bash", "COMP_WORDS": "catseye adjust networks/f", "COMP_CWORD": "2"}
    done = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, **line}, capture_output=True, text=True, check=True
    )
    assert (done.stdout.split(), done.stderr.strip()) == (["networks/feed-arm.toml"], "[]")


def callbacks():
    """Function of each command, by its name without a group's."""
    for group in (app, *(each.typer_instance for each in app.registered_groups)):
        for command in group.registered_commands:
            yield command.name or command.callback.__name__.rstrip("_"), command.callback


def test_every_path_that_is_read_has_examples_or_is_known_to_have_none():
    reading = {(command, name) for command, callback in callbacks() for name in paths_of(callback)}
    listed = WRITTEN | WITHOUT_EXAMPLES | set(EXAMPLES)
    assert [(command, name) for command, name in reading if not {name, f"{command} {name}"} & listed] == []


@pytest.mark.parametrize("key", sorted(EXAMPLES))
def test_every_pattern_has_an_example(key):
    bundled = ["gbt", *examples()]
    kind = {"calibrate": "encoder", "certificate": "mirror"}.get(key.split()[0], "")
    assert all(any(fnmatch(name, pattern.format(kind=kind)) for name in bundled) for pattern in EXAMPLES[key])


def test_an_argument_that_is_missing_matches_anything():
    assert "calibrations/encoder.csv" in names(("calibrations/{kind}.csv",), {}, "calibrations/")
    assert names(("calibrations/{kind}.csv",), {"kind": "leakage"}, "calib") == ["calibrations/leakage.csv"]
    assert names(("networks/*",), {}, "nothing/begins/so") == []
