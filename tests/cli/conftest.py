"""The command line in this process."""

import pytest
import typer

from catseye.cli.commands import app, join_commands
from catseye.cli.terminal import attempt

join_commands()


@pytest.fixture
def catseye(capsys):
    """A command run in this process: exit status, what it said, what it complained of."""

    def run(*arguments):
        command = typer.main.get_command(app)
        status = attempt(lambda: command.main([str(a) for a in arguments], prog_name="catseye"))
        said = capsys.readouterr()
        return status, said.out, said.err

    return run
