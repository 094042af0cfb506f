"""Options that the commands of a living site share, and what they are checked for before anything is started."""

import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from catseye.cli.terminal import say
from catseye.cli.vocabularies import CONDITIONS, FILTERS, MODES, one_of
from catseye.errors import CatseyeError

if TYPE_CHECKING:
    from catseye.records.site.folder import SiteFolder
    from catseye.service.coordinator import Orders
    from catseye.service.running import LiveRun

MOTION = "track 145.3 45"
PORT_BASE = 24_100  # as in catseye.ranger.addresses


def within(low: float, high: float, unit: str) -> Callable[[float | None], float | None]:
    """A check of an option's number."""

    def check(value: float | None) -> float | None:
        if value is not None and not (math.isfinite(value) and low <= value <= high):
            raise typer.BadParameter(f"{value:g} is not {low:g} to {high:g}{unit}.")
        return value

    return check


def time_of(text: str | None) -> str | None:
    """Validate a time; returns it unchanged."""
    if text is not None:
        from catseye.geometry.sky.time_tag import mjd_of

        try:
            mjd = mjd_of(text)
        except CatseyeError as problem:
            raise typer.BadParameter(f"{problem}.") from problem
        if not 0.0 <= mjd < 1e6:
            raise typer.BadParameter(f"{text} is not an MJD of 0 to 1000000.")
    return text


def motion_of(text: str | None) -> str | None:
    """Validate a motion; returns it unchanged. A table is read when it is needed."""
    if text is not None and not text.startswith("table "):
        from catseye.simulator.twin.motion import AxisMotion

        try:
            AxisMotion.parse(text)
        except CatseyeError as problem:
            raise typer.BadParameter(f"{problem}.") from problem
    return text


def faults_of(texts: list[str] | None) -> list[str]:
    """Validate faults; returns them unchanged."""
    from catseye.simulator.twin.faults import Fault

    for text in texts or []:
        try:
            Fault.parse(text)
        except CatseyeError as problem:
            raise typer.BadParameter(f"{problem}.") from problem
    return list(texts or [])


Site = Annotated[str, typer.Argument(metavar="SITE", help="Folder of a site's records, or a bundled site: gbt.")]
Seed = Annotated[int, typer.Option("--seed", help="Of every draw of the twin.", callback=within(0, 2**31, ""))]
MotionText = Annotated[
    str,
    typer.Option(
        "--motion",
        metavar="MOTION",
        callback=motion_of,
        help="fixed AZ EL, track AZ EL, slew AZ0 EL0 AZ1 EL1, scan AZ EL WIDTH RATE (degrees), or table FILE.",
    ),
]
Start = Annotated[
    str | None,
    typer.Option("--start", metavar="TIME", callback=time_of, help="UTC or MJD that it is at the twin's start."),
]
Conditions = Annotated[
    str, typer.Option("--conditions", metavar=CONDITIONS, callback=one_of(CONDITIONS), help="The twin's weather.")
]
Faults = Annotated[
    list[str] | None,
    typer.Option(
        "--fault",
        metavar='"KIND WHOM [START [END [SIZE]]]"',
        callback=faults_of,
        help="What goes wrong on the twin, s since its start; may repeat. docs/living.md has the kinds.",
    ),
]
PortBase = Annotated[
    int,
    typer.Option(
        "--port-base",
        metavar="PORT",
        callback=within(0, 65_000, ""),
        help="Feed at PORT, ranger k at PORT + 10 k and the next; 0: any free ports.",
    ),
]
JournalPlace = Annotated[
    str | None,
    typer.Option("--journal", metavar="FILE|URL", help="Where all that happens is kept: SQLite, or postgresql://..."),
]
KeepBuffers = Annotated[
    bool, typer.Option("--keep-buffers/--no-buffers", help="Samples too, without which no replay is exact.")
]
RotateGb = Annotated[
    float,
    typer.Option(
        "--rotate-gb",
        callback=within(0, 1e6, " GB"),
        help="The journal goes on in another file from this size on (site-2.db, ...); 0: never.",
    ),
]
RotateNight = Annotated[bool, typer.Option("--rotate-night", help="The same at noon UTC.")]
Mode = Annotated[str, typer.Option("--mode", metavar=MODES, callback=one_of(MODES), help="Fires, listens, or rests.")]
Drop = Annotated[list[str] | None, typer.Option("--drop", metavar="RANGER", help="Leave a ranger out; may repeat.")]
RoundS = Annotated[float, typer.Option("--round-s", callback=within(2, 600, " s"), help="Of a round, s.")]
FilterName = Annotated[
    str, typer.Option("--filter", metavar=FILTERS, callback=one_of(FILTERS), help="From epoch to epoch.")
]
Port = Annotated[
    int | None,
    typer.Option("--port", callback=within(0, 65_535, ""), help="Of the coordinator's own clients.  [default: 5260]"),
]
KeepOutFile = Annotated[
    Path | None, typer.Option("--keep-out", metavar="BOXES.toml", help="Boxes that no beam may enter.")
]
InterlocksFile = Annotated[
    Path | None, typer.Option("--interlocks", metavar="FILE.toml", help="When who may not shine or move.")
]
SolidsFile = Annotated[Path | None, typer.Option("--solids", metavar="SOLIDS.toml", help="What stands in the way.")]


def site_of(name: str) -> "SiteFolder":
    """A site's records, by its bundled name or folder."""
    from catseye.gateways.examples import located
    from catseye.records.site.folder import read_site

    return read_site(located(name))


def mjd_start(text: str | None, usual: float | None = None, *, offset: float = 0.0) -> float:
    """MJD of --start; without it the usual one, or now by a clock that is `offset` s from this machine's."""
    from catseye.geometry.sky.time_tag import mjd_of

    if text is not None:
        return mjd_of(text)
    if usual is not None:
        return usual
    from catseye.clock import SystemClock
    from catseye.geometry.sky.time_tag import PER_DAY

    return SystemClock(offset).now_ns() / PER_DAY


def orders_of(*, drop: list[str] | None, **given: Any) -> "Orders":
    """Orders of a coordinator from its options; those missing have the defaults of `Orders`."""
    from catseye.ranger.door import key_of
    from catseye.ranger.network import TlsFiles
    from catseye.service.coordinator import Orders

    names = tuple(name.upper() for name in drop or ())
    return Orders(
        drop=names, key=key_of(), tls=TlsFiles.of(), **{key: value for key, value in given.items() if value is not None}
    )


def leave(run: "LiveRun[Any]", *, terminated: int = 143) -> None:
    """After a signal: 130 for Ctrl-C, and what a command's termination means. Returns where there was none.

    All is closed by then: the interpreter's own end, a second on a busy machine, is left out.
    """
    import os
    import signal
    from contextlib import suppress

    if run.signal:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError, AttributeError):
                stream.flush()
        os._exit(130 if run.signal == signal.SIGINT else terminated)


def say_now(text: str) -> None:
    """A line that is read while the command goes on."""
    say(text)


def tell_people(text: str) -> None:
    """A line of the log on stderr, where a reader who has left is no failure."""
    try:
        sys.stderr.write(text + "\n")
        sys.stderr.flush()
    except (OSError, ValueError, AttributeError):
        return
