"""Groups of options that the commands of a living site share: the twin, and the coordinator."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

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
    RotateGb,
    RotateNight,
    RoundS,
    Seed,
    SolidsFile,
    Start,
    mjd_start,
    orders_of,
)

if TYPE_CHECKING:
    from catseye.records.site.folder import SiteFolder
    from catseye.service.coordinator import Orders, Peers
    from catseye.service.world import TwinWords


def _feed(text: str | None) -> str | None:
    if text is not None:
        _host_port(text)
    return text


def _host_port(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    if not host or not port.isdecimal() or not 1 <= int(port) <= 65_535:
        raise typer.BadParameter(f"{text!r} is not HOST:PORT.")
    return host.strip("[]"), int(port)


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
Host = Annotated[str | None, typer.Option("--host", help="Address of its own port, or unix:DIR.  [default: 127.0.0.1]")]


class TwinOptions(NamedTuple):
    """The twin that `catseye zy` and `catseye serve` are asked for; each field is the option of its name."""

    seed: Seed = 1
    motion: MotionText = MOTION
    start: Start = None
    conditions: Conditions = "night"
    fault: Faults = None

    def world(self, offset: float | None) -> "TwinWords":
        """The twin in words, its time `offset` s from this machine's; None: it is --start now.

        Without --start its seconds begin now by its own time: a fault 30 s after the start comes in 30 s.
        """
        from catseye.service.world import TwinWords

        words: dict[str, Any] = {
            "seed": self.seed,
            "motion": self.motion,
            "conditions": self.conditions,
            "faults": tuple(self.fault or ()),
        }
        begins = mjd_start(self.start, offset=offset or 0.0)
        return TwinWords.starting_now(begins, **words) if offset is None else TwinWords(begins, offset=offset, **words)


class CoordinatorOptions(NamedTuple):
    """The coordinator that `catseye ziy` and `catseye serve` are asked for; each field is the option of its name."""

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
    host: Host = None
    port: Port = None

    @property
    def elsewhere(self) -> bool:
        """True if rangers or feed are given without a twin on this machine."""
        return self.loopback or self.addresses is not None or self.feed is not None or self.motion_script is not None

    def orders(self) -> "Orders":
        """Orders of the coordinator."""
        return orders_of(
            mode=self.mode,
            drop=self.drop,
            round_s=self.round_s,
            filter=self.filter_,
            journal=self.journal,
            keep_buffers=self.keep_buffers,
            rotate_gb=self.rotate_gb,
            rotate_night=self.rotate_night,
            keep_out=self.keep_out,
            interlocks=self.interlocks,
            solids=self.solids,
            port=self.port,
            host=self.host,
        )

    def peers(self, site: "SiteFolder") -> "Peers":
        """Rangers and feed that the coordinator connects to."""
        if self.addresses is not None and self.loopback:
            raise typer.BadParameter("says where; --loopback says otherwise.", param_hint="'--addresses'")
        if self.feed is not None and self.motion_script is not None:
            raise typer.BadParameter("is a known motion; --feed says otherwise.", param_hint="'--motion-script'")
        from catseye.coordinator.feed import MotionScript
        from catseye.coordinator.link.settings import Address
        from catseye.ranger.addresses import Addresses, feed_address, ranger_addresses
        from catseye.service.addresses import read_addresses
        from catseye.service.coordinator import Peers

        usual: Addresses = "loopback" if self.loopback else self.port_base
        at: tuple[str, int] | None
        if self.addresses is not None:
            rangers, at = read_addresses(self.addresses, site)
        else:
            rangers = {n: Address(h, (a, b)) for n, (h, a, b) in ranger_addresses(site, usual).items()}
            at = feed_address(usual)
        if self.motion_script is not None:
            return Peers(rangers, MotionScript.parse(self.motion_script))
        return Peers(rangers, _host_port(self.feed) if self.feed is not None else at)
