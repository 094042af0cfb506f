"""The command of a site that runs for ever: coordinator, log, and a twin beside it where there is no hardware."""

from typing import TYPE_CHECKING, Annotated

import typer

from catseye.cli.commands import Quiet, app
from catseye.cli.live.groups import CoordinatorOptions, TwinOptions
from catseye.cli.live.options import Site, site_of
from catseye.cli.live.ziy import LogJson, Screen, Told, run_coordinator
from catseye.cli.option_groups import grouped

if TYPE_CHECKING:
    from catseye.service.logs import LiveLog


@app.command(epilog="\b\nExample: catseye serve gbt --twin --journal site.db\nAs a service: examples/systemd")
@grouped
def serve(
    *,
    site: Site,
    twin: Annotated[bool, typer.Option("--twin", help="With simulated rangers, kept alive beside.")] = False,
    simulated: TwinOptions,
    asked: CoordinatorOptions,
    log_json: LogJson = False,
    screen: Screen = False,
    quiet: Quiet = False,
) -> None:
    """Run a site until it is told to end (SIGTERM: status 0): children are started again, everything is logged."""
    records = site_of(site)
    from catseye.service.child import LiveChild
    from catseye.service.simulation import twin_arguments

    if twin and asked.port_base == 0:
        raise typer.BadParameter("a twin that is started again needs ports that stay.", param_hint="'--port-base'")
    if twin and asked.elsewhere:
        raise typer.BadParameter("brings its rangers and its feed.", param_hint="'--twin'")
    world = simulated.world(offset=0.0 if simulated.start is None else None)
    if twin:
        world.twin(records)  # what it cannot be is refused here
    peers = asked.peers(records)

    async def children(log: "LiveLog") -> None:
        await LiveChild(
            "twin",
            twin_arguments(site, world, asked.port_base),
            said=lambda line: log.tell("twin", "listens", f"{len(peers.rangers)} rangers and the feed listen"),
            warned=lambda line: log.tell("twin", "child", line, "warning"),
        ).keep(patient=True)

    run_coordinator(
        records,
        asked.orders(),
        peers,
        offset=world.offset if twin else 0.0,
        seed=simulated.seed if twin else None,
        told=Told(log_json, screen, quiet),
        beside=children if twin else None,
    )
