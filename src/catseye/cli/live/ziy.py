"""The command of the coordinator."""

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from catseye.cli.commands import Quiet, app
from catseye.cli.live.options import (
    PORT_BASE,
    Drop,
    FilterName,
    InterlocksFile,
    JournalPlace,
    KeepBuffers,
    KeepOutFile,
    Mode,
    Port,
    PortBase,
    RoundS,
    Site,
    SolidsFile,
    leave,
    orders_of,
    site_of,
    tell_people,
    within,
)


def _feed(text: str | None) -> str | None:
    if text is not None:
        _host_port(text)
    return text


def _host_port(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    if not host or not port.isdecimal() or not 1 <= int(port) <= 65_535:
        raise typer.BadParameter(f"{text!r} is not HOST:PORT.")
    return host.strip("[]"), int(port)


LogJson = Annotated[bool, typer.Option("--log-json", help="The log as one JSON object a line.")]
Loopback = Annotated[bool, typer.Option("--loopback", help="Rangers at 127.0.8.k, the feed at 127.0.0.1 port 5250.")]
AddressFile = Annotated[
    Path | None, typer.Option("--addresses", metavar="FILE.toml", help="Where each ranger and the feed is.")
]
FeedPlace = Annotated[
    str | None, typer.Option("--feed", metavar="HOST:PORT", callback=_feed, help="Weather and telescope.")
]
MotionScriptText = Annotated[
    str | None,
    typer.Option("--motion-script", metavar='FILE|"fixed AZ EL"', help="A motion known beforehand; no feed."),
]
Host = Annotated[str | None, typer.Option("--host", help="Address of its own port.  [default: 127.0.0.1]")]


@app.command(
    epilog="\b\nExample: catseye ziy gbt --journal night.db\n"
    "Its rangers: catseye zy gbt --twin\n"
    "Then ask it: nc 127.0.0.1 5260"
)
def ziy(
    site: Site,
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
    clock_offset_s: Annotated[
        float, typer.Option("--clock-offset-s", callback=within(-1e11, 1e11, " s"), help="As the twin's.")
    ] = 0.0,
    log_json: LogJson = False,
    quiet: Quiet = False,
) -> None:
    """Run a site's coordinator until Ctrl-C: plan, shoot, reduce, keep a journal, tell whoever asks."""
    records = site_of(site)
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
    run_coordinator(records, orders, rangers, source, offset=clock_offset_s, log_json=log_json, quiet=quiet)


def where_of(
    site: Any,
    *,
    port_base: int,
    loopback: bool,
    addresses: Path | None,
    feed: str | None,
    motion_script: str | None,
) -> tuple[Any, Any]:
    """Addresses of the rangers, and where weather and telescope are known from, by the options."""
    if addresses is not None and loopback:
        raise typer.BadParameter("says where; --loopback says otherwise.", param_hint="'--addresses'")
    if feed is not None and motion_script is not None:
        raise typer.BadParameter("is a known motion; --feed says otherwise.", param_hint="'--motion-script'")
    from catseye.coordinator.feed import MotionScript
    from catseye.coordinator.link.settings import Address
    from catseye.ranger.addresses import Addresses, feed_address, ranger_addresses
    from catseye.service.addresses import read_addresses

    where: Addresses = "loopback" if loopback else port_base
    if addresses is not None:
        rangers, at = read_addresses(addresses, site)
    else:
        rangers = {n: Address(h, (a, b)) for n, (h, a, b) in ranger_addresses(site, where).items()}
        at = feed_address(where)
    if motion_script is not None:
        return rangers, MotionScript.parse(motion_script)
    return rangers, _host_port(feed) if feed is not None else at


def run_coordinator(
    site: Any,
    orders: Any,
    rangers: Any,
    feed: Any,
    *,
    offset: float = 0.0,
    seed: int | None = None,
    log_json: bool = False,
    quiet: bool = False,
    beside: Any = None,
) -> None:
    """A coordinator with its log on stderr, until a signal.

    beside   a coroutine function that runs beside it, told the log: its children
    """
    from catseye.service.coordinator import LiveCoordinator
    from catseye.service.logs import LiveLog
    from catseye.service.running import LiveRun
    from catseye.simulator.clock.world_clock import SystemClock

    clock = SystemClock(offset)
    coloured = not log_json and sys.stderr is not None and sys.stderr.isatty()
    log = LiveLog(lambda line: None if quiet else tell_people(line), clock=clock, json=log_json, colour=coloured)

    async def work() -> None:
        import asyncio

        running = LiveCoordinator(
            site,
            orders,
            addresses=rangers,
            feed=feed,
            clock=clock,
            seed=seed,
            tell=lambda text, alarm: log.tell("journal", "journal", text, "alarm" if alarm else "note"),
        )
        running.ziy.listeners.append(log.entry)

        def started() -> None:
            log.tell("coordinator", "listens", f"its clients connect to {orders.host} port {running.server.port}")

        parts = [asyncio.ensure_future(running.run(started))]
        if beside is not None:
            parts.append(asyncio.ensure_future(beside(log)))
        try:
            done, _ = await asyncio.wait(parts, return_when=asyncio.FIRST_COMPLETED)
            for part in done:
                part.result()
        finally:
            for part in parts:  # the coordinator first: it switches lasers off at rangers that are there still
                part.cancel()
                await asyncio.gather(part, return_exceptions=True)

    run: LiveRun[None] = LiveRun(work)
    run.result()
    leave(run, terminated=0)
