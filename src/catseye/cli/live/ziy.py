"""The command of the coordinator."""

from typing import TYPE_CHECKING, Annotated

import typer

from catseye.cli.commands import Quiet, app
from catseye.cli.live.groups import CoordinatorOptions, arguments
from catseye.cli.live.options import Site, Structure, leave, say_now, tell_people, within
from catseye.cli.option_groups import grouped

if TYPE_CHECKING:
    from catseye.api.live.serving import SiteEnd

LogJson = Annotated[bool, typer.Option("--log-json", help="The log as one JSON object a line.")]
Screen = Annotated[bool, typer.Option("--screen", help="A screen for an operator instead of the log; 80 x 24 or more.")]


@app.command(
    epilog="\b\nExample: catseye ziy gbt --journal night.db\n"
    "Its rangers: catseye zy gbt --twin\n"
    "Then ask it: nc 127.0.0.1 5260"
)
@grouped
def ziy(
    *,
    site: Site,
    coordinator: CoordinatorOptions,
    structure: Structure = None,
    clock_offset_s: Annotated[
        float,
        typer.Option(
            "--clock-offset-s",
            callback=within(-1e11, 1e11, " s"),
            help="Offset of its clock, as the twin's.",
        ),
    ] = 0.0,
    log_json: LogJson = False,
    screen: Screen = False,
    quiet: Quiet = False,
) -> None:
    """Run a site's coordinator until Ctrl-C: plan, shoot, reduce, keep a journal, answer clients."""
    from catseye.api.live.serving import ziy as run

    end = run(
        site,
        **arguments(coordinator),
        structure=structure,
        clock_offset_s=clock_offset_s,
        log_json=log_json,
        screen=screen and not quiet,
        tell=None if quiet else tell_people,
    )
    finish_site(end, quiet=quiet)


def finish_site(end: "SiteEnd", *, quiet: bool) -> None:
    """Say the last head of the journal's chain, and exit as the site ended."""
    if end.failed:
        raise SystemExit(1)
    if end.journal is not None and not quiet:
        say_now(end.journal)
    leave(end.signal, terminated=0)
