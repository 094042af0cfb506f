"""The command of a ranger server."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.live.groups import TwinOptions
from catseye.cli.live.options import (
    PORT_BASE,
    PortBase,
    Site,
    leave,
    say_now,
    site_of,
    tell_people,
    within,
)
from catseye.cli.option_groups import grouped
from catseye.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from catseye.records.site.folder import SiteFolder
    from catseye.service.rangers import Listening, RangersServed


def _ports(text: str | None) -> str | None:
    if text is not None:
        _pair(text)
    return text


def _pair(text: str) -> tuple[int, int]:
    try:
        first, second = (int(part) for part in text.split(","))
    except ValueError:
        first = second = -1
    if not (0 <= first <= 65_535 and 0 <= second <= 65_535):
        raise typer.BadParameter(f"{text!r} is not two ports, such as 5240,5241.")
    return first, second


@app.command(
    epilog="\b\nExample: catseye zy gbt ZY101 --twin\n"
    "A person at it: nc 127.0.0.1 24110\n"
    "A real one: catseye zy sites/ours ZY101 --head our.heads:card --host 0.0.0.0 --ports 5240,5241"
)
@grouped
def zy(  # noqa: PLR0913 - its options are its command line
    *,
    site: Site,
    rangers: Annotated[list[str] | None, typer.Argument(metavar="[RANGER ...]", help="Which; all if none.")] = None,
    twin: Annotated[bool, typer.Option("--twin", help="Rangers of the site's twin, with its feed.")] = False,
    head: Annotated[
        str | None,
        typer.Option("--head", metavar="PACKAGE.MODULE:FACTORY", help="A real head: called with the ranger's name."),
    ] = None,
    simulated: TwinOptions,
    clock_offset_s: Annotated[
        float | None,
        typer.Option(
            "--clock-offset-s",
            callback=within(-1e11, 1e11, " s"),
            help="Of the twin's time against this machine's UTC.  [default: so that it is --start now]",
        ),
    ] = None,
    cold: Annotated[bool, typer.Option("--cold", help="The twin's rangers are just powered on, not ready.")] = False,
    laser_at_boot: Annotated[
        bool, typer.Option("--laser-at-boot", help="As the notes' rangers: it shines as soon as its hardware does.")
    ] = False,
    host: Annotated[
        str | None, typer.Option("--host", help="Address to listen at, or unix:DIR.  [default: 127.0.0.1]")
    ] = None,
    port_base: PortBase = PORT_BASE,
    ports: Annotated[
        str | None, typer.Option("--ports", metavar="A,B", callback=_ports, help="Of the one ranger.")
    ] = None,
    loopback: Annotated[
        bool, typer.Option("--loopback", help="Ranger k at 127.0.8.k, ports 5240 and 5241, as real ones.")
    ] = False,
    files: Annotated[
        Path | None, typer.Option("--files", metavar="DIR", help="Where rangers keep their initialisation files.")
    ] = None,
    leave_with_stdin: Annotated[bool, typer.Option("--leave-with-stdin", hidden=True)] = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Serve one ranger, some, or all of a site's, until Ctrl-C: simulated ones, or real ones behind a head."""
    if twin == (head is not None):
        raise typer.BadParameter("expected one of --twin and --head.", param_hint="'--twin' / '--head'")
    if loopback and (host is not None or ports is not None):
        raise typer.BadParameter("says where; --host and --ports say otherwise.", param_hint="'--loopback'")
    records = site_of(site)
    names = _named(records, rangers or [])
    if ports is not None and len(names) != 1:
        raise InputError(f"--ports: {len(names)} rangers cannot share two ports (expected one ranger, or --port-base)")
    from catseye.clock import SystemClock
    from catseye.ranger.door import Door, key_of
    from catseye.ranger.network import TlsFiles
    from catseye.service.rangers import ListenAddresses, RangersServed, heads_of
    from catseye.service.running import LiveRun

    door = Door(key=key_of(), tls=TlsFiles.of(), laser_at_boot=laser_at_boot)
    at = ListenAddresses("loopback" if loopback else port_base, host, None if ports is None else _pair(ports), door)
    if laser_at_boot:
        tell_people("warning: --laser-at-boot: lasers shine from power-up on, where nobody has the lease and unhomed")
    if head is not None:
        served = RangersServed(records, heads_of(head, names), clock=SystemClock(), at=at, files=files)
    else:
        from catseye.service.warm import WarmingClock
        from catseye.service.world import twin_heads

        world = simulated.world(clock_offset_s)
        truth, clock = world.twin(records), world.clock()
        warming = None if cold else WarmingClock(clock)
        heads = twin_heads(truth, names, warming or clock)
        served = RangersServed(records, heads, clock=clock, twin=truth, warming=warming, at=at, files=files)
    run = LiveRun(lambda: _served(served, lambda at: _say(at, json, quiet), leave_with_stdin))
    run.result()
    leave(run, terminated=0)


def _named(site: "SiteFolder", asked: list[str]) -> tuple[str, ...]:
    """The rangers that are meant, in the site's order."""
    wanted = [name.upper() for name in asked]
    strange = [name for name in wanted if name not in site.rangers]
    if strange:
        raise InputError(f"{strange[0]} is no ranger of the site (expected one of {', '.join(site.rangers)})")
    return tuple(name for name in site.rangers if name in wanted) if wanted else site.rangers


def _say(at: "Listening", json: bool, quiet: bool) -> None:
    if json:
        from catseye.gateways.writers.objects import json_line

        say_now(json_line(at.plain()))
    elif not quiet:
        for name, (host, first, second) in at.rangers.items():
            say_now(f"{name:<8} listens at {host} port {first} and port {second}")
        if at.feed is not None:
            say_now(f"feed     listens at {at.feed[0]} port {at.feed[1]}")


async def _served(served: "RangersServed", listening: "Callable[[Listening], None]", with_stdin: bool) -> None:
    import asyncio
    import os

    from catseye.service.watchdog import live

    work = asyncio.ensure_future(served.serve(listening))
    living = None if with_stdin else asyncio.ensure_future(live())  # who keeps a child speaks for it
    if with_stdin:
        loop = asyncio.get_running_loop()

        def heard() -> None:
            if not os.read(sys.stdin.fileno(), 4096):
                loop.remove_reader(sys.stdin)
                work.cancel()

        loop.add_reader(sys.stdin, heard)
    try:
        await work
    except asyncio.CancelledError:
        work.cancel()
        if living is not None:
            living.cancel()
        await asyncio.gather(work, return_exceptions=True)
        task = asyncio.current_task()
        if task is not None and task.cancelling():
            raise
