"""The command of a site that runs for ever: coordinator, log, and a twin beside it where there is no hardware."""

from typing import Annotated

import typer

from catseye.cli.commands import Quiet, app
from catseye.cli.live.groups import CoordinatorOptions, PageOptions, TwinOptions, arguments
from catseye.cli.live.options import Site, Structure, say_now, tell_people
from catseye.cli.live.ziy import LogJson, Screen, finish_site
from catseye.cli.option_groups import grouped


@app.command(epilog="\b\nExample: catseye serve gbt --twin --journal site.db\nAs a service: examples/systemd")
@grouped
def serve(  # noqa: PLR0913 - its options are its command line
    *,
    site: Site,
    twin: Annotated[
        bool, typer.Option("--twin", help="Simulated rangers, in a process that is restarted if it dies.")
    ] = False,
    simulated: TwinOptions,
    coordinator: CoordinatorOptions,
    structure: Structure = None,
    page: Annotated[
        bool, typer.Option("--page/--no-page", help="A page for browsers, in a process that is restarted if it dies.")
    ] = True,
    browsers: PageOptions,
    log_json: LogJson = False,
    screen: Screen = False,
    quiet: Quiet = False,
) -> None:
    """Run a site until stopped (SIGTERM exits 0); restart its processes, log everything."""
    from catseye.api.live.serving import serve as run

    end = run(
        site,
        twin=twin,
        **arguments(simulated),
        **arguments(coordinator),
        structure=structure,
        page=page,
        **arguments(browsers),
        log_json=log_json,
        screen=screen and not quiet,
        tell=None if quiet else tell_people,
        announce=lambda line: None if quiet else say_now(line),
    )
    finish_site(end, quiet=quiet)
