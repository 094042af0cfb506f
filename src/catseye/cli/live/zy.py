"""The command of a ranger server."""

from pathlib import Path
from typing import Annotated, Any

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.live.groups import TwinOptions, arguments
from catseye.cli.live.options import PORT_BASE, PortBase, Site, Structure, leave, say_now, tell_people, within
from catseye.cli.option_groups import grouped
from catseye.cli.terminal import ProgressLine


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
    "By hand: nc 127.0.0.1 24110\n"
    "A real one: catseye zy sites/ours ZY101 --head our.heads:card --host 0.0.0.0 --ports 5240,5241"
)
@grouped
def zy(  # noqa: PLR0913 - its options are its command line
    *,
    site: Site,
    rangers: Annotated[list[str] | None, typer.Argument(metavar="[RANGER ...]", help="Rangers; all if none.")] = None,
    twin: Annotated[bool, typer.Option("--twin", help="Rangers of the site's twin, with its feed.")] = False,
    head: Annotated[
        str | None,
        typer.Option("--head", metavar="PACKAGE.MODULE:FACTORY", help="A real head: called with the ranger's name."),
    ] = None,
    simulated: TwinOptions,
    structure: Structure = None,
    clock_offset_s: Annotated[
        float | None,
        typer.Option(
            "--clock-offset-s",
            callback=within(-1e11, 1e11, " s"),
            help="Offset of the twin's time from this machine's UTC.  [default: so that it is --start now]",
        ),
    ] = None,
    cold: Annotated[bool, typer.Option("--cold", help="Start the twin's rangers from power-on.")] = False,
    laser_at_boot: Annotated[
        bool, typer.Option("--laser-at-boot", help="Switch the laser on at power-up, as the notes' rangers do.")
    ] = False,
    host: Annotated[
        str | None, typer.Option("--host", help="Address to listen at, or unix:DIR.  [default: 127.0.0.1]")
    ] = None,
    port_base: PortBase = PORT_BASE,
    ports: Annotated[
        str | None, typer.Option("--ports", metavar="A,B", callback=_ports, help="Ports, where one ranger is served.")
    ] = None,
    loopback: Annotated[
        bool, typer.Option("--loopback", help="Ranger k at 127.0.8.k, ports 5240 and 5241, as real ones.")
    ] = False,
    files: Annotated[
        Path | None, typer.Option("--files", metavar="DIR", help="Folder of the rangers' initialisation files.")
    ] = None,
    leave_with_stdin: Annotated[bool, typer.Option("--leave-with-stdin", hidden=True)] = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Serve one ranger, some, or all of a site's, until Ctrl-C: simulated ones, or real ones behind a head."""
    from catseye.api.live.serving import zy as served

    shown = ProgressLine(quiet, json)

    def listening(at: dict[str, Any]) -> None:
        shown.clear()
        _say(at, json, quiet)

    try:
        end = served(
            site,
            rangers or (),
            twin=twin,
            head=head,
            **arguments(simulated),
            structure=structure,
            clock_offset_s=clock_offset_s,
            cold=cold,
            laser_at_boot=laser_at_boot,
            host=host,
            port_base=port_base,
            ports=None if ports is None else _pair(ports),
            loopback=loopback,
            files=files,
            leave_with_stdin=leave_with_stdin,
            listening=listening,
            bound=(lambda at: _say_json({"bound": at})) if leave_with_stdin else (lambda at: None),
            progress=_tell_parent if leave_with_stdin else shown,
            tell=tell_people,
        )
    finally:
        shown.clear()
    leave(end.signal, terminated=0)


def _say_json(what: dict[str, Any]) -> None:
    from catseye.api.result import json_text

    say_now(json_text(what))


def _tell_parent(what: str, done: int, total: int) -> None:
    """Progress for the process that has started this one."""
    _say_json({"ready": done, "of": total})


def _say(at: dict[str, Any], json: bool, quiet: bool) -> None:
    if json:
        _say_json(at)
    elif not quiet:
        for name, (host, first, second) in at["rangers"].items():
            say_now(f"{name:<8} listens at {host} port {first} and port {second}")
        if at["feed"] is not None:
            host, port = at["feed"]
            say_now(f"feed     listens at {host} port {port}")
