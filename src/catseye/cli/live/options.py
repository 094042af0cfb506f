"""Options that the commands of a living site share, their ranges, and the exit after a signal."""

import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.terminal import say
from catseye.cli.vocabularies import CONDITIONS, FILTERS, MODES, one_of

MOTION = "track 145.3 45"
PORT_BASE = 24_100  # as in catseye.ranger.addresses


def within(low: float, high: float, unit: str) -> Callable[[float | None], float | None]:
    """A check of an option's number."""

    def check(value: float | None) -> float | None:
        if value is not None and not (math.isfinite(value) and low <= value <= high):
            raise typer.BadParameter(f"{value:g} is not {low:g} to {high:g}{unit}.")
        return value

    return check


Site = Annotated[str, typer.Argument(metavar="SITE", help="Folder of a site's records, or a bundled site: gbt.")]
Seed = Annotated[int, typer.Option("--seed", help="Seed of every draw of the twin.", callback=within(0, 2**31, ""))]
MotionText = Annotated[
    str,
    typer.Option(
        "--motion",
        metavar="MOTION",
        help="Motion of the telescope: fixed AZ EL, track AZ EL, slew AZ0 EL0 AZ1 EL1, scan AZ EL WIDTH RATE "
        "(degrees), or table FILE.",
    ),
]
Start = Annotated[
    str | None,
    typer.Option("--start", metavar="TIME", help="UTC or MJD at the twin's start."),
]
Conditions = Annotated[
    str, typer.Option("--conditions", metavar=CONDITIONS, callback=one_of(CONDITIONS), help="The twin's weather.")
]
Faults = Annotated[
    list[str] | None,
    typer.Option(
        "--fault",
        metavar='"KIND WHOM [START [END [SIZE]]]"',
        help="Fault of the twin, s since its start; may repeat. catseye help living has the kinds.",
    ),
]
Structure = Annotated[
    Path | None,
    typer.Option(
        "--structure",
        metavar="MODEL.toml",
        help="Structural model by which the telescope bends.  [default: the site's own structural-model.toml]",
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
    typer.Option(
        "--journal", metavar="FILE|URL", help="Place of the journal of all events: an SQLite file, or postgresql://..."
    ),
]
KeepBuffers = Annotated[
    bool, typer.Option("--keep-buffers/--no-buffers", help="Store raw samples, too: an exact replay needs them.")
]
RotateGb = Annotated[
    float,
    typer.Option(
        "--rotate-gb",
        callback=within(0, 1e6, " GB"),
        help="Size at which the journal continues in a new file (site-2.db, ...), GB; 0: never.",
    ),
]
RotateNight = Annotated[bool, typer.Option("--rotate-night", help="Continue the journal in a new file at noon UTC.")]
Mode = Annotated[
    str,
    typer.Option(
        "--mode", metavar=MODES, callback=one_of(MODES), help="active measures, passive only listens, hold stays idle."
    ),
]
Drop = Annotated[list[str] | None, typer.Option("--drop", metavar="RANGER", help="Leave a ranger out; may repeat.")]
RoundS = Annotated[float, typer.Option("--round-s", callback=within(2, 600, " s"), help="Length of a round, s.")]
FilterName = Annotated[
    str, typer.Option("--filter", metavar=FILTERS, callback=one_of(FILTERS), help="Motion model from epoch to epoch.")
]
Port = Annotated[
    int | None,
    typer.Option("--port", callback=within(0, 65_535, ""), help="Port for clients.  [default: 5260]"),
]
KeepOutFile = Annotated[
    Path | None, typer.Option("--keep-out", metavar="BOXES.toml", help="Boxes that no beam may enter.")
]
InterlocksFile = Annotated[
    Path | None, typer.Option("--interlocks", metavar="FILE.toml", help="Times at which rangers may not emit or move.")
]
ArchiveDirectory = Annotated[
    Path | None,
    typer.Option("--archive-samplers", metavar="DIR", help="Directory for FITS files of all samplers, while it runs."),
]
ArchiveEveryS = Annotated[
    float,
    typer.Option("--archive-every-s", callback=within(5, 3600, " s"), help="Span of such a file, s."),
]
SolidsFile = Annotated[Path | None, typer.Option("--solids", metavar="SOLIDS.toml", help="Solids that obstruct beams.")]


def leave(number: int, *, terminated: int = 143) -> None:
    """Exit after a signal: 130 for Ctrl-C, and what a command's termination means. Returns where there was none.

    number   of the signal; 0 for none

    All is closed by then: the interpreter's own end, a second on a busy machine, is left out.
    """
    import os
    import signal
    from contextlib import suppress

    if number:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError, AttributeError):
                stream.flush()
        os._exit(130 if number == signal.SIGINT else terminated)


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
