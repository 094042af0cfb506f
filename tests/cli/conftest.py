"""The command line in this process."""

import pytest

from command_scene import command_line


@pytest.fixture
def catseye(capsys, monkeypatch):
    """A command run in this process: exit status, what it said, what it complained of; progress is not told."""
    monkeypatch.setattr("catseye.cli.terminal.FIRST_LINE", float("inf"))  # beside other load any work is long
    return command_line(capsys)
