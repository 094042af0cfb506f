"""The command line in this process: what it does, says and complains of, without the seconds that a start takes."""

import math
from unittest.mock import patch

import typer

from catseye.cli.commands import app, join_commands
from catseye.cli.terminal import attempt

join_commands()
COMMAND = typer.main.get_command(app)  # made once: it takes 20 ms


def command_line(capsys):
    """Function (*arguments) -> exit status, what was said, what was complained of."""

    def run(*arguments):
        with patch("catseye.cli.terminal.FIRST_LINE", math.inf):  # beside other load any work is long, and told
            status = attempt(lambda: COMMAND.main([str(a) for a in arguments], prog_name="catseye"))
        said = capsys.readouterr()
        return status, said.out, said.err

    return run
