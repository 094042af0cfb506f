"""The command of a site that runs for ever: coordinator, log, and a twin beside it where there is no hardware."""

from typing import Annotated, Any

import typer

from catseye.cli.commands import Quiet, app
from catseye.cli.live.options import (
    MOTION,
    PORT_BASE,
    Conditions,
    Drop,
    Faults,
    FilterName,
    InterlocksFile,
    JournalPlace,
    KeepBuffers,
    KeepOutFile,
    Mode,
    MotionText,
    Port,
    PortBase,
    RoundS,
    Seed,
    Site,
    SolidsFile,
    Start,
    mjd_start,
    orders_of,
    site_of,
)
from catseye.cli.live.ziy import (
    AddressFile,
    FeedPlace,
    Host,
    LogJson,
    Loopback,
    MotionScriptText,
    run_coordinator,
    where_of,
)


@app.command(epilog="\b\nExample: catseye serve gbt --twin --journal site.db\nAs a service: examples/systemd")
def serve(
    site: Site,
    twin: Annotated[bool, typer.Option("--twin", help="With simulated rangers, kept alive beside.")] = False,
    seed: Seed = 1,
    motion: MotionText = MOTION,
    start: Start = None,
    conditions: Conditions = "night",
    fault: Faults = None,
    port_base: PortBase = PORT_BASE,
    loopback: Loopback = False,
    addresses: AddressFile = None,
    feed: FeedPlace = None,
    motion_script: MotionScriptText = None,
    journal: JournalPlace = None,
    keep_buffers: KeepBuffers = True,
    mode: Mode = "active",
    drop: Drop = None,
    round_s: RoundS = 10.0,
    filter_: FilterName = "random_walk",
    keep_out: KeepOutFile = None,
    interlocks: InterlocksFile = None,
    solids: SolidsFile = None,
    host: Host = None,
    port: Port = None,
    log_json: LogJson = False,
    quiet: Quiet = False,
) -> None:
    """Run a site until it is told to end (SIGTERM: status 0): children are started again, everything is logged."""
    records = site_of(site)
    from catseye.service.child import LiveChild
    from catseye.service.simulation import twin_arguments
    from catseye.service.world import TwinWords

    if twin and port_base == 0:
        raise typer.BadParameter("a twin that is started again needs ports that stay.", param_hint="'--port-base'")
    if twin and (loopback or addresses is not None or feed is not None or motion_script is not None):
        raise typer.BadParameter("brings its rangers and its feed.", param_hint="'--twin'")
    words_of = TwinWords.starting_now if start is not None else TwinWords
    world = words_of(mjd_start(start), seed=seed, motion=motion, conditions=conditions, faults=tuple(fault or ()))
    if twin:
        world.twin(records)  # what it cannot be is refused here
    rangers, source = where_of(
        records, port_base=port_base, loopback=loopback, addresses=addresses, feed=feed, motion_script=motion_script
    )
    orders = orders_of(
        mode=mode,
        drop=drop,
        round_s=round_s,
        filter=filter_,
        journal=journal,
        keep_buffers=keep_buffers,
        keep_out=keep_out,
        interlocks=interlocks,
        solids=solids,
        port=port,
        host=host,
    )

    async def children(log: Any) -> None:
        await LiveChild(
            "twin",
            twin_arguments(site, world, port_base),
            said=lambda line: log.tell("twin", "listens", f"{len(rangers)} rangers and the feed listen"),
            warned=lambda line: log.tell("twin", "child", line, "warning"),
        ).keep()

    run_coordinator(
        records,
        orders,
        rangers,
        source,
        offset=world.offset if twin else 0.0,
        seed=seed if twin else None,
        log_json=log_json,
        quiet=quiet,
        beside=children if twin else None,
    )
