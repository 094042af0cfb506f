"""Groups of options that the commands of a living site share: the twin, and the coordinator."""

from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from catseye.cli.live.options import (
    MOTION,
    PORT_BASE,
    ArchiveDirectory,
    ArchiveEveryS,
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
    RotateGb,
    RotateNight,
    RoundS,
    Seed,
    SolidsFile,
    Start,
    within,
)

Loopback = Annotated[bool, typer.Option("--loopback", help="Rangers at 127.0.8.k, the feed at 127.0.0.1 port 5250.")]
AddressFile = Annotated[
    Path | None, typer.Option("--addresses", metavar="FILE.toml", help="Addresses of rangers and feed.")
]
FeedPlace = Annotated[str | None, typer.Option("--feed", metavar="HOST:PORT", help="Address of weather and telescope.")]
MotionScriptText = Annotated[
    str | None,
    typer.Option("--motion-script", metavar='FILE|"fixed AZ EL"', help="Motion known beforehand; no feed."),
]
PageHost = Annotated[
    str | None, typer.Option("--page-host", help="Address that browsers connect to.  [default: 127.0.0.1]")
]
PagePort = Annotated[
    int | None,
    typer.Option(
        "--page-port",
        callback=within(0, 65_535, ""),
        help="Port that browsers connect to; 0: any free one.  [default: 5261 beside a site, else 0]",
    ),
]
PageCertificate = Annotated[
    Path | None, typer.Option("--page-certificate", metavar="FILE.pem", help="Certificate of TLS, for other machines.")
]
PageKey = Annotated[Path | None, typer.Option("--page-key", metavar="FILE.pem", help="Key of that certificate.")]
PageTokenFile = Annotated[
    Path | None,
    typer.Option("--page-token-file", metavar="FILE", help="File of the page's token.  [default: a new token]"),
]
PageNames = Annotated[
    list[str] | None,
    typer.Option("--page-name", metavar="NAME", help="Further name that browsers call the page by; may repeat."),
]
Host = Annotated[
    str | None, typer.Option("--host", help="Address to listen at for clients, or unix:DIR.  [default: 127.0.0.1]")
]


def arguments(group: NamedTuple) -> dict[str, Any]:
    """Arguments of a call from a group of options; a list that was not given is empty."""
    named = group._asdict()
    return named | {name: named[name] or () for name in ("faults", "drop", "page_names") if name in named}


class TwinOptions(NamedTuple):
    """The twin of `catseye zy` and `catseye serve`; each field is an option."""

    seed: Seed = 1
    motion: MotionText = MOTION
    start_mjd: Start = None
    conditions: Conditions = "night"
    faults: Faults = None


class CoordinatorOptions(NamedTuple):
    """The coordinator of `catseye ziy` and `catseye serve`; each field is an option."""

    port_base: PortBase = PORT_BASE
    loopback: Loopback = False
    addresses: AddressFile = None
    feed: FeedPlace = None
    motion_script: MotionScriptText = None
    journal: JournalPlace = None
    keep_buffers: KeepBuffers = True
    rotate_gb: RotateGb = 0.0
    rotate_night: RotateNight = False
    mode: Mode = "active"
    drop: Drop = None
    round_s: RoundS = 10.0
    filter_: FilterName = "random_walk"
    keep_out: KeepOutFile = None
    interlocks: InterlocksFile = None
    solids: SolidsFile = None
    archive_samplers: ArchiveDirectory = None
    archive_every_s: ArchiveEveryS = 60.0
    host: Host = None
    port: Port = None


class PageOptions(NamedTuple):
    """The page of `catseye serve` and `catseye view`; each field is an option."""

    page_host: PageHost = None
    page_port: PagePort = None
    page_certificate: PageCertificate = None
    page_key: PageKey = None
    page_token_file: PageTokenFile = None
    page_names: PageNames = None
