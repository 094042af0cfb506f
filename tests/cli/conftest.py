"""The command line in this process."""

import pytest

from command_scene import command_line


@pytest.fixture
def catseye(capsys):
    """A command run in this process: exit status, what it said, what it complained of."""
    return command_line(capsys)
