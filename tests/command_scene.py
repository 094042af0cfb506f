"""The command line in this process: what it does, says and complains of, without the seconds that a start takes."""

import typer

from catseye.cli.commands import app, join_commands
from catseye.cli.terminal import attempt

join_commands()
COMMAND = typer.main.get_command(app)  # made once: it takes 20 ms


def command_line(capsys):
    """Function (*arguments) -> exit status, what was said, what was complained of."""

    def run(*arguments):
        status = attempt(lambda: COMMAND.main([str(a) for a in arguments], prog_name="catseye"))
        said = capsys.readouterr()
        return status, said.out, said.err

    return run
