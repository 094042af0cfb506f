"""The command that shows a result or a journal in a browser."""

from typing import Annotated

import typer

from catseye.cli.commands import Quiet, app
from catseye.cli.live.groups import PageOptions, arguments
from catseye.cli.live.options import leave, say_now, tell_people
from catseye.cli.option_groups import grouped


@app.command(epilog="\b\nExample: catseye view night-01-report\nA journal: catseye view site.db --no-browser")
@grouped
def view(
    *,
    source: Annotated[
        str,
        typer.Argument(metavar="RESULT|JOURNAL", help="Directory or report of a result, or a journal."),
    ],
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="A browser window, where this machine has one.")
    ] = True,
    page: PageOptions,
    quiet: Quiet = False,
) -> None:
    """A result or a journal in a browser, until Ctrl-C."""
    from catseye.api.live.view import view as run

    number = run(
        source,
        browser=browser,
        **arguments(page),
        announce=lambda line: say_now(line),
        warn=lambda line: None if quiet else tell_people(f"page: {line}"),
    )
    leave(number)
