"""Serve a living site until a signal: `zy`, `ziy` and `serve`, which block and are for programs of their own.

They install handlers of SIGINT and SIGTERM, and are not exported from `catseye`.
"""

import asyncio
import os
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypedDict, Unpack

from catseye.aliases import Progress
from catseye.api.journal import mjd_argument
from catseye.api.live.beside import site_page
from catseye.api.live.limits import LAST_PORT, one_of, within
from catseye.api.reading import place_of, with_structure
from catseye.api.units import In, with_units
from catseye.errors import ArgumentError, InputError
from catseye.memory import uncollected

if TYPE_CHECKING:
    from catseye.records.site.folder import SiteFolder
    from catseye.service.coordinator import Orders, Peers
    from catseye.service.display import LogOptions
    from catseye.service.running import SiteEnd
    from catseye.service.serving import ServedSite
    from catseye.service.twin_process import TwinProcess
    from catseye.service.world import TwinWords

    Tell = Callable[[str], None]

Place = str | os.PathLike[str] | None

MOTION = "track 145.3 45"
PORT_BASE = 24_100  # as in catseye.ranger.addresses
LARGEST_SEED = 2**31
MOST_OFFSET_S = 1e11  # s: 3000 years


class OrderOptions(TypedDict, total=False):
    """Options of a coordinator, as `coordinator_orders` takes them."""

    mode: str
    drop: Sequence[str]
    round_s: float
    filter_: str
    journal: Place
    keep_buffers: bool
    rotate_gb: float
    rotate_night: bool
    host: str | None
    port: int | None
    keep_out: Place
    interlocks: Place
    solids: Place
    archive_samplers: Place
    archive_every_s: float


@with_units
def zy(
    site: "str | os.PathLike[str]",
    rangers: Sequence[str] = (),
    *,
    twin: bool = False,
    head: str | None = None,
    seed: Annotated[Any, In("", whole=True)] = 1,
    motion: str = MOTION,
    start_mjd: Annotated[Any, In("mjd", one=True, text=True)] = None,
    conditions: str = "night",
    faults: Sequence[str] = (),
    structure: Place = None,
    clock_offset_s: Annotated[Any, In("s", one=True)] = None,
    cold: bool = False,
    laser_at_boot: bool = False,
    host: str | None = None,
    port_base: Annotated[Any, In("", whole=True)] = PORT_BASE,
    ports: tuple[int, int] | None = None,
    loopback: bool = False,
    files: Place = None,
    leave_with_stdin: bool = False,
    listening: Callable[[dict[str, Any]], None],
    bound: Callable[[dict[str, Any]], None] = lambda at: None,
    progress: Progress = lambda what, done, total: None,
    tell: "Tell" = lambda line: None,
) -> "SiteEnd":
    """Serve one ranger, some, or all of a site's, until a signal.

    site             folder of a site's records, or a bundled site
    rangers          their names; all if none
    twin             True for rangers of the site's twin, with its feed
    head             "package.module:factory" of a real head, called with the ranger's name
    seed, motion, conditions, faults   of the twin, as for `simulate`
    start_mjd        UTC at the twin's start, MJD or text; None for the present by its clock
    structure        structural model that bends the twin's telescope; the site's own structural-model.toml without
    clock_offset_s   s, of the twin's time against this machine's UTC; None: it is `start_mjd` now
    cold             True for rangers just powered on, not ready
    laser_at_boot    True for lasers that shine from power-up on
    host             address to listen at, or unix:DIR; None for 127.0.0.1
    port_base        feed at this port, ranger k at it + 10 k and the next; 0 for any free ports
    ports            of the one ranger
    loopback         True for ranger k at 127.0.8.k, ports 5240 and 5241
    files            folder of initialisation files; None for a temporary one
    leave_with_stdin True to end when standard input does
    listening        called once with the addresses: {"rangers": {name: [host, port, port]}, "feed": [host, port]}
    tell             called with each line for people

    Raises InputError: an unknown site or ranger, a head that cannot be made, a port that is taken; ArgumentError:
    invalid arguments.
    """
    from catseye.clock import SystemClock
    from catseye.ranger.door import Door, key_of
    from catseye.ranger.network import TlsFiles
    from catseye.service.rangers import ListenAddresses, RangersServed, heads_of, serve_rangers

    _refuse_serving(twin, head, loopback, host, ports, port_base, clock_offset_s)
    world = twin_world(start_mjd, clock_offset_s, twin_options(seed, motion, conditions, faults))
    with uncollected():
        records = read_site_of(site, structure)
        names = _named(records, rangers)
        if ports is not None and len(names) != 1:
            raise InputError(f"{len(names)} rangers cannot share two ports (expected one ranger, or a port base)")
        door = Door(key=key_of(), tls=TlsFiles.of(), laser_at_boot=laser_at_boot)
        at = ListenAddresses("loopback" if loopback else port_base, host, ports, door)
        if laser_at_boot:
            tell("warning: lasers shine from power-up on (laser at boot), where nobody has the lease and unhomed")
        where = None if files is None else Path(files)
        if head is not None:
            served = RangersServed(records, heads_of(head, names), clock=SystemClock(), at=at, files=where)
        else:
            from catseye.service.warm import WarmingClock
            from catseye.service.world import twin_heads

            truth, clock = world.twin(records), world.clock()
            warming = None if cold else WarmingClock(clock)
            heads = twin_heads(truth, names, warming or clock)
            served = RangersServed(records, heads, clock=clock, twin=truth, warming=warming, at=at, files=where)
    return serve_rangers(
        served,
        lambda at: listening(at.plain()),
        leave_with_stdin=leave_with_stdin,
        bound=lambda at: bound(at.plain()),
        progress=progress,
    )


@with_units
def ziy(
    site: "str | os.PathLike[str]",
    *,
    port_base: Annotated[Any, In("", whole=True)] = PORT_BASE,
    loopback: bool = False,
    addresses: Place = None,
    feed: str | None = None,
    motion_script: str | None = None,
    structure: Place = None,
    clock_offset_s: Annotated[Any, In("s", one=True)] = 0.0,
    log_json: bool = False,
    screen: bool = False,
    tell: "Tell | None" = None,
    **orders: Unpack["OrderOptions"],
) -> "SiteEnd":
    """Run a site's coordinator until a signal.

    site             folder of a site's records, or a bundled site
    port_base        feed at this port, ranger k at it + 10 k and the next
    loopback         True for rangers at 127.0.8.k, the feed at 127.0.0.1 port 5250
    addresses        TOML file with the address of each ranger and of the feed
    feed             HOST:PORT of weather and telescope
    motion_script    file, or "fixed AZ EL", of a motion known beforehand; no feed
    structure        structural model by which the telescope bends: aims and places are by it, poses beyond it; the
                     site's own structural-model.toml without
    clock_offset_s   s, of its clock against this machine's
    log_json         True for a log of JSON objects
    screen           True for a screen instead of the log
    tell             called with each line of the log; None for no log
    orders           as of `coordinator_orders`

    Raises InputError: an unknown site or file, a port or a journal that is not available; ArgumentError: invalid
    arguments.
    """
    from catseye.service.display import LogOptions

    within("clock_offset_s", clock_offset_s, -MOST_OFFSET_S, MOST_OFFSET_S)

    def assembled() -> "ServedSite":
        from catseye.service.serving import ServedSite

        given = coordinator_orders(**orders)
        records = read_site_of(site, structure)
        peers = _peers(records, port_base, loopback, addresses, feed, motion_script)
        return ServedSite(records, given, peers, offset=clock_offset_s, log_options=options)

    options = LogOptions(tell, log_json, screen)
    return _served(str(site), assembled, options)


@with_units
def serve(
    site: "str | os.PathLike[str]",
    *,
    twin: bool = False,
    seed: Annotated[Any, In("", whole=True)] = 1,
    motion: str = MOTION,
    start_mjd: Annotated[Any, In("mjd", one=True, text=True)] = None,
    conditions: str = "night",
    faults: Sequence[str] = (),
    port_base: Annotated[Any, In("", whole=True)] = PORT_BASE,
    loopback: bool = False,
    addresses: Place = None,
    feed: str | None = None,
    motion_script: str | None = None,
    structure: Place = None,
    page: bool = True,
    page_host: str | None = None,
    page_port: Annotated[Any, In("", whole=True)] = None,
    page_certificate: Place = None,
    page_key: Place = None,
    page_token_file: Place = None,
    page_names: Sequence[str] = (),
    log_json: bool = False,
    screen: bool = False,
    tell: "Tell | None" = None,
    announce: "Tell" = lambda line: None,
    **orders: Unpack["OrderOptions"],
) -> "SiteEnd":
    """Run a site until a signal: coordinator, page, and, where there is no hardware, a twin; children are restarted.

    twin   True for simulated rangers, in a process of their own
    seed, motion, start_mjd, conditions, faults   of the twin, as for `zy`
    page   False for no page; True for one in a process of its own, where the extra `web` is installed
    page_host, page_port   where it listens; None for 127.0.0.1 and 5261, port 0 for any free one
    page_certificate, page_key   PEM files of TLS, needed beyond this machine
    page_token_file   file of the token of its commands; None for a new token
    page_names     further names that the page is called by
    announce       called once with a line on the page: its link with the token, or that there is none
    structure      structural model of the telescope, for the coordinator and for the twin
    others as for `ziy`

    Raises InputError and ArgumentError as `ziy`.
    """
    from catseye.service.display import LogOptions
    from catseye.service.twin_process import TwinProcess, twin_arguments

    if twin and port_base == 0:
        raise ArgumentError("port_base: a twin that is restarted needs ports that stay (expected above 0)", "port_base")
    if twin and (loopback or addresses is not None or feed is not None or motion_script is not None):
        names = ("twin", "loopback", "addresses", "feed", "motion_script")
        raise ArgumentError("twin brings its rangers and its feed: no loopback, addresses, feed, motion_script", *names)
    world = twin_world(start_mjd, 0.0 if start_mjd is None else None, twin_options(seed, motion, conditions, faults))
    if structure is not None:
        world = replace(world, structure=str(place_of(structure)))

    beside = None
    if page:
        beside = site_page(
            host=page_host,
            port=page_port,
            certificate=page_certificate,
            key=page_key,
            token_file=page_token_file,
            names=page_names,
            announce=announce,
            at_once=screen,
        )

    def assembled() -> "ServedSite":
        from catseye.service.serving import ServedSite

        given = coordinator_orders(**orders)
        records = read_site_of(site, structure)
        peers = _peers(records, port_base, loopback, addresses, feed, motion_script)
        if twin:
            world.twin(records)  # an impossible twin is refused here
        return ServedSite(
            records,
            given,
            peers,
            offset=world.offset if twin else 0.0,
            seed=seed if twin else None,
            log_options=options,
            beside=None if beside is None else beside.children(str(site), given, peers),
        )

    options = LogOptions(tell, log_json, screen)
    process = TwinProcess(twin_arguments(str(site), world, port_base), patient=True) if twin else None
    return _served(str(site), assembled, options, process)


def _served(
    name: str, assembled: "Callable[[], ServedSite]", options: "LogOptions", twin: "TwinProcess | None" = None
) -> "SiteEnd":
    """End of a site served until a signal.

    assembled   makes it: what it needs is imported and read meanwhile in a thread
    twin        started before
    """
    from catseye.errors import CatseyeError
    from catseye.service.running import LiveRun, SiteEnd

    made: list[ServedSite] = []

    async def work() -> None:
        options.view.open(name)
        async with twin or nullcontext():
            if twin is not None:
                twin.progress = options.view.progress
            with uncollected():
                made.append(await asyncio.to_thread(assembled))
            await made[0].run(twin)

    run: LiveRun[None] = LiveRun(work)
    try:
        run.result()
    except CatseyeError as problem:
        if not (options.json and made):
            raise
        made[0].log.tell("coordinator", "failed", str(problem), "alarm")
        return SiteEnd(failed=True)
    finally:
        options.view.end()
    return SiteEnd(run.signal, journal=made[0].journal_end if made else None)


def coordinator_orders(
    *,
    mode: str = "active",
    drop: Sequence[str] = (),
    round_s: float = 10.0,
    filter_: str = "random_walk",
    journal: Place = None,
    keep_buffers: bool = True,
    rotate_gb: float = 0.0,
    rotate_night: bool = False,
    host: str | None = None,
    port: int | None = None,
    keep_out: Place = None,
    interlocks: Place = None,
    solids: Place = None,
    archive_samplers: Place = None,
    archive_every_s: float = 60.0,
) -> "Orders":
    """Orders of a coordinator; its key and TLS files are those of the environment.

    mode           "active", "passive" or "hold"
    drop           rangers to leave out
    round_s        s, of a round, 2 to 600
    filter_        "random_walk" or "constant_velocity", from epoch to epoch
    journal        file or URL; None for none
    keep_buffers   False to store no samples: no replay is exact then
    rotate_gb      GB, size at which the journal continues in another file; 0: never
    rotate_night   True to rotate at noon UTC, too
    host, port     of its own clients; None for 127.0.0.1 and 5260, port 0 for any free one
    keep_out, interlocks, solids   files; None for none
    archive_samplers   directory for FITS files of all samplers, written while it runs; None for none
    archive_every_s    s, of a file, 5 to 3600
    """
    from typing import get_args

    from catseye.coordinator.modes import Mode
    from catseye.ranger.door import key_of
    from catseye.ranger.network import TlsFiles
    from catseye.service.coordinator import Filter, Orders

    one_of("mode", mode, get_args(Mode))
    one_of("filter_", filter_, get_args(Filter))
    within("round_s", round_s, 2.0, 600.0, " s")
    within("rotate_gb", rotate_gb, 0.0, 1e6, " GB")
    within("port", port, 0, LAST_PORT)
    within("archive_every_s", archive_every_s, 5.0, 3600.0, " s")
    files = {"keep_out": keep_out, "interlocks": interlocks, "solids": solids}
    named: dict[str, Any] = {name: None if path is None else place_of(path) for name, path in files.items()}
    named["archive_samplers"] = None if archive_samplers is None else place_of(archive_samplers)
    named |= {name: value for name, value in (("host", host), ("port", port)) if value is not None}
    return Orders(
        mode=mode,  # type: ignore[arg-type]  # held to be one above
        drop=tuple(name.upper() for name in drop),
        round_s=round_s,
        filter=filter_,  # type: ignore[arg-type]
        journal=None if journal is None else str(journal),
        keep_buffers=keep_buffers,
        archive_every_s=archive_every_s,
        rotate_gb=rotate_gb,
        rotate_night=rotate_night,
        key=key_of(),
        tls=TlsFiles.of(),
        **named,
    )


def read_site_of(site: "str | os.PathLike[str]", structure: Place = None) -> "SiteFolder":
    """Records of a site, by its folder or its bundled name; with a structural model in place of its own, if any."""
    from catseye.records.site.folder import read_site

    return with_structure(read_site(place_of(site)), structure)


def mjd_start(start_mjd: float | str | None, usual: float | None = None, *, offset: float = 0.0) -> float:
    """MJD of a start: as given, or the usual one, or now by a clock that is `offset` s from this machine's."""
    if start_mjd is not None:
        return mjd_argument("start_mjd", start_mjd)
    if usual is not None:
        return usual
    from catseye.clock import SystemClock
    from catseye.geometry.sky.time_tag import PER_DAY

    return SystemClock(offset).now_ns() / PER_DAY


def twin_options(seed: int, motion: str, conditions: str, faults: Sequence[str]) -> dict[str, Any]:
    """Options of a twin by the names of `TwinWords`; a table of a motion is read when it is needed."""
    from catseye.service.world import CONDITIONS
    from catseye.simulator.twin.faults import Fault
    from catseye.simulator.twin.motion import AxisMotion

    within("seed", seed, 0, LARGEST_SEED)
    one_of("conditions", conditions, tuple(CONDITIONS))
    name = "motion"
    try:
        if not motion.startswith("table "):
            AxisMotion.parse(motion)
        name = "faults"
        for text in faults:
            Fault.parse(text)
    except InputError as problem:
        raise ArgumentError(f"{problem}", name) from problem
    return {"seed": seed, "motion": motion, "conditions": conditions, "faults": tuple(faults)}


def twin_world(start_mjd: float | str | None, offset: float | None, options: dict[str, Any]) -> "TwinWords":
    """Options of a twin whose time is `offset` s from this machine's; None: it is its start now.

    Without a start its seconds begin now by its own time: a fault 30 s after the start comes in 30 s.

    options   from `twin_options`
    """
    from catseye.service.world import TwinWords

    begins = mjd_start(start_mjd, offset=offset or 0.0)
    return TwinWords.starting_now(begins, **options) if offset is None else TwinWords(begins, offset=offset, **options)


def _refuse_serving(
    twin: bool,
    head: str | None,
    loopback: bool,
    host: str | None,
    ports: tuple[int, int] | None,
    port_base: int,
    clock_offset_s: float | None,
) -> None:
    """Refuse arguments of `zy` that do not fit together or are out of range."""
    if twin == (head is not None):
        raise ArgumentError("expected one of twin and head", "twin", "head")
    if loopback and (host is not None or ports is not None):
        raise ArgumentError("loopback says where; host and ports say otherwise", "loopback", "host", "ports")
    within("port_base", port_base, 0, 65_000)
    within("clock_offset_s", clock_offset_s, -MOST_OFFSET_S, MOST_OFFSET_S, " s")
    for port in ports or ():
        within("ports", port, 0, LAST_PORT)


def _peers(
    site: "SiteFolder",
    port_base: int,
    loopback: bool,
    addresses: Place,
    feed: str | None,
    motion_script: str | None,
) -> "Peers":
    """Rangers and feed that a coordinator connects to."""
    within("port_base", port_base, 0, 65_000)
    if addresses is not None and loopback:
        raise ArgumentError("addresses says where; loopback says otherwise", "addresses", "loopback")
    if feed is not None and motion_script is not None:
        raise ArgumentError("motion_script is a known motion; feed says otherwise", "motion_script", "feed")
    place = None if feed is None else _host_port(feed)
    from catseye.coordinator.feed import MotionScript
    from catseye.coordinator.link.settings import Address
    from catseye.ranger.addresses import Addresses, feed_address, ranger_addresses
    from catseye.service.addresses import read_addresses
    from catseye.service.coordinator import Peers

    usual: Addresses = "loopback" if loopback else port_base
    at: tuple[str, int] | None
    if addresses is not None:
        rangers, at = read_addresses(place_of(addresses), site)
    else:
        rangers = {n: Address(h, (a, b)) for n, (h, a, b) in ranger_addresses(site, usual).items()}
        at = feed_address(usual)
    if motion_script is not None:
        return Peers(rangers, MotionScript.parse(motion_script))
    return Peers(rangers, place if place is not None else at)


def _host_port(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    if not host or not port.isdecimal() or not 1 <= int(port) <= LAST_PORT:
        raise ArgumentError(f"feed: {text!r} is not HOST:PORT", "feed")
    return host.strip("[]"), int(port)


def _named(site: "SiteFolder", rangers: Sequence[str]) -> tuple[str, ...]:
    """Rangers by name, in the site's order; all if none is named."""
    wanted = [name.upper() for name in rangers]
    unknown = [name for name in wanted if name not in site.rangers]
    if unknown:
        raise InputError(f"{unknown[0]} is no ranger of the site (expected one of {', '.join(site.rangers)})")
    return tuple(name for name in site.rangers if name in wanted) if wanted else site.rangers
