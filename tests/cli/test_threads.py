"""--threads of the long commands: so many for the whole command, and as before when it is done."""

import os

import pytest

from catseye.errors import InputError
from catseye.processors import VARIABLES, threads
from command_scene import command_line

LONG = ("reduce", "adjust", "plan", "pose", "surface", "structure")


@pytest.fixture
def run(capsys):
    return command_line(capsys)


@pytest.mark.parametrize("command", LONG)
def test_every_long_command_has_it(run, command):
    status, said, _ = run(command, "--help")
    assert status == 0
    assert "--threads N" in said


@pytest.mark.parametrize("count", ["0", "-1", "some", "1.5"])
def test_a_number_that_is_none_is_wrong_usage(run, count):
    status, _, complained = run("reduce", "night-01", "--json", "--threads", count)
    assert status == 2
    assert "--threads" in complained


def test_it_holds_for_the_command_and_no_longer(run, monkeypatch):
    before, seen = {name: os.environ.get(name) for name in VARIABLES}, []

    def reduce(*given, **more):
        seen.append((threads(), [os.environ[name] for name in VARIABLES]))
        raise InputError("enough")

    monkeypatch.setattr("catseye.api.night.reduce", reduce)
    assert run("reduce", "night-01", "--json", "--threads", "3")[0] == 1
    assert seen == [(3, ["3", "3"])]
    assert {name: os.environ.get(name) for name in VARIABLES} == before
