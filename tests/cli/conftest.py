"""The command line in this process."""

import pytest
import typer

from catseye.cli import air, baseline, calibrate, certificate, explain, link, networks, plot, point  # noqa: F401  their commands join the app
from catseye.cli.commands import app
from catseye.cli.terminal import attempt


@pytest.fixture
def catseye(capsys):
    """A command run in this process: exit status, what it said, what it complained of."""

    def run(*arguments):
        command = typer.main.get_command(app)
        status = attempt(lambda: command.main([str(a) for a in arguments], prog_name="catseye"))
        said = capsys.readouterr()
        return status, said.out, said.err

    return run
