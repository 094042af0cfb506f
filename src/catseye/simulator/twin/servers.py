"""Servers of a site's rangers in one process, with files and network faults.

A dead ranger comes back as after a power cut: cold, not initialised, not homed. A hung one continues in its state,
without the lines received meanwhile. A disconnected one continues without its clients.
"""

import asyncio
import logging
import os
import tempfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from catseye.errors import InputError
from catseye.ranger.addresses import PORT_BASE, Address, Addresses, ranger_addresses
from catseye.ranger.door import DEFAULT_ACCESS, Door
from catseye.ranger.handlers.table import file_names, replace_file
from catseye.ranger.head import RangerHead
from catseye.ranger.initialisation import SiteCommands
from catseye.ranger.network import ConnectionMaker, Sockets
from catseye.ranger.ranger import Ranger
from catseye.ranger.server import LOOPBACK, ZyServer
from catseye.ranger.sun_watch import OwnSun, sun_of_site
from catseye.records.site.folder import SiteFolder
from catseye.simulator.twin.faults import FaultBoard
from catseye.simulator.twin.faulty_network import FaultyNetwork, Gate

LOG = logging.getLogger(__name__)
SUPERVISED = 0.05  # s between two checks of the faults


@dataclass
class Served:
    """One ranger: its server, present network faults, and task."""

    server: ZyServer
    head: RangerHead
    gate: Gate = field(default_factory=Gate)
    dead: bool = False
    shut: bool = False
    task: asyncio.Task[None] | None = None


class TwinSite:
    """Servers of a site's rangers.

    site           its records
    heads          by ranger; only these are served
    world_faults   whose network faults are applied: dead-ranger, hung-ranger, network-cut, network-slow
    seconds        present time, s since the twin's start
    addresses      "loopback" or a port base; 0: any free ports, which `addresses` says after `start`
    files          folder in which each ranger has a folder of initialisation files; existing files are kept.
                   None: a temporary one
    network        sockets by default
    door           access policy of the rangers' ports
    """

    def __init__(
        self,
        site: SiteFolder,
        heads: Mapping[str, RangerHead],
        *,
        world_faults: FaultBoard,
        seconds: Callable[[], float],
        addresses: Addresses = PORT_BASE,
        files: Path | None = None,
        network: ConnectionMaker | None = None,
        door: Door = DEFAULT_ACCESS,
    ):
        unknown = sorted(set(heads) - set(site.rangers))
        if unknown:
            raise InputError(f"{unknown[0]} is not a ranger of the site (expected one of {', '.join(site.rangers)})")
        self.site, self.faults, self.seconds = site, world_faults, seconds
        self._heads, self._network = dict(heads), network or Sockets(door.tls)
        self.addresses: dict[str, Address] = (
            dict.fromkeys(heads, (LOOPBACK, 0, 0))
            if addresses == 0
            else {name: at for name, at in ranger_addresses(site, addresses).items() if name in heads}
        )
        self._folder, self._door = files, door
        self._temporary: tempfile.TemporaryDirectory[str] | None = None
        self._sun: OwnSun = sun_of_site(site.site.site)
        self.served: dict[str, Served] = {}

    @property
    def rangers(self) -> dict[str, Ranger]:
        """Rangers by name, once started."""
        return {name: one.server.ranger for name, one in self.served.items()}

    async def start(self) -> None:
        """Write the files and listen. Raises InputError on failure.

        A port that is not available, or a folder that cannot be written.
        """
        if self._folder is None:
            self._temporary = tempfile.TemporaryDirectory(prefix=f"catseye-{os.getpid()}-")
            self._folder = Path(self._temporary.name)
        clock = asyncio.get_running_loop().time
        commands, valid = SiteCommands(self.site), set[str]()
        try:
            for name, head in self._heads.items():
                host, *ports = self.addresses[name]
                gate = Gate()
                ranger = self._ranger(name, head)
                self._write_files(ranger, commands, valid)
                network = FaultyNetwork(self._network, gate)
                server = ZyServer(ranger, host, (ports[0], ports[1]), door=self._door, clock=clock, network=network)
                await server.start()
                self.served[name] = Served(server, head, gate)
                self.addresses[name] = (host, *server.ports)
        except InputError:
            await self.stop()
            raise

    def rearm(self) -> None:
        """Restart every dead-man timer: the rangers are ready for commands."""
        for one in self.served.values():
            one.server.rearm()

    async def serve(self) -> None:
        """Run the rangers and apply the faults until cancelled; `start` first."""
        for one in self.served.values():
            one.task = asyncio.create_task(one.server.serve())
        try:
            while True:
                await self._supervise()
                await asyncio.sleep(SUPERVISED)
        finally:
            for one in self.served.values():
                await _halt(one)

    async def stop(self) -> None:
        """Close all connections, stop listening, remove temporary files."""
        for one in self.served.values():
            await _halt(one)
            one.gate.cut()
            await one.server.stop()
        await asyncio.sleep(0)  # in which connections that broke close their sockets
        self.served.clear()
        if self._temporary is not None:
            self._temporary.cleanup()
            self._temporary, self._folder = None, None

    def _ranger(self, name: str, head: RangerHead) -> Ranger:
        mirror = self.site.mirror_of(name)
        aboard = name not in self.site.monuments
        return Ranger(
            name,
            head,
            limits=(mirror.az_low_limit, mirror.az_high_limit),
            files=None if self._folder is None else self._folder / name,
            mirror=mirror.zp,
            sun=None if aboard else self._sun,
            turning=aboard,
            laser_at_boot=self._door.laser_at_boot,
        )

    def _write_files(self, ranger: Ranger, commands: SiteCommands, valid: set[str]) -> None:
        if ranger.files is None:
            return
        try:
            ranger.files.mkdir(parents=True, exist_ok=True)
        except OSError as problem:
            raise InputError(
                f"{ranger.files} cannot be made: {problem.strerror} (expected a writable folder)"
            ) from problem
        if all((ranger.files / name).exists() for name in file_names(ranger)):
            return
        for name, text in commands.files(ranger.name).items():
            if not (ranger.files / name).exists():
                replace_file(ranger.files, name, text, valid)

    async def _supervise(self) -> None:
        instant = self.seconds()
        for name, one in self.served.items():
            dead, hung, cut, slow = (
                self.faults.active(kind, name, at=instant) if self.faults.faults else None
                for kind in ("dead-ranger", "hung-ranger", "network-cut", "network-slow")
            )
            if one.dead and dead is None:
                one.head.reset()
                one.server.ranger = self._ranger(name, one.head)
            one.dead = dead is not None
            one.gate.hung = hung is not None
            one.gate.delay = 0.0 if slow is None else slow.size
            await self._shut(one, dead is not None or cut is not None)
            if one.dead or one.gate.hung:
                await _halt(one)
            elif one.task is None:
                one.task = asyncio.create_task(one.server.serve())
            elif one.task.done():
                one.task.result()  # it ends only by a program error: report it

    async def _shut(self, one: Served, shut: bool) -> None:
        if shut and not one.shut:
            one.gate.cut()
            await one.server.stop()
        elif one.shut and not shut:
            try:
                await one.server.start()
            except InputError as problem:
                LOG.warning("%s: retrying every %g s", problem, SUPERVISED)
                return
        one.shut = shut


async def _halt(one: Served) -> None:
    """End the tasks of all rangers."""
    task, one.task = one.task, None
    if task is not None:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task
