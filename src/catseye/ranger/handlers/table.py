"""Table of handlers, by ZY command.

A handler returns the values of its reply, or is a generator: `None` or a time yields control, values are one more
reply, its return value is the last (None: there is none). Refusals are raised, with the state unchanged.
"""

import hmac
import secrets
from pathlib import Path

import numpy as np

from catseye.errors import CatseyeError, InputError
from catseye.ranger.commands import COMMANDS
from catseye.ranger.handlers.axes import AXES, Handler
from catseye.ranger.handlers.cubes import CUBES
from catseye.ranger.handlers.shots import SHOTS, scan_rounds, stream_shots
from catseye.ranger.handlers.sun import SUN, watch_sun
from catseye.ranger.line import Reply, Request, commands_of_file, nanoseconds_to_ticks, tag_of
from catseye.ranger.line import stamp_text as stamp
from catseye.ranger.state import VERSION, Lease, RangerState, Values, Work
from catseye.ranger.status import word_text

__all__ = [
    "HANDLERS",
    "file_names",
    "holder_of",
    "latch_of",
    "replace_file",
    "scan_rounds",
    "stream_shots",
    "watch_sun",
]

NOT_OF_A_FILE = ("INITZY", "RST", "BYE", "PS", "LEASE", "STOP", "UNLATCH")
TOKEN_BYTES = 16


def _sti(z: RangerState, _: int, ticks: int | None = None) -> Values:
    if ticks is not None:
        z.head.set_clock(tag_of(ticks))
    return (stamp(z.now_ticks()),)


def _ps(z: RangerState, _: int, on: int | None = None) -> Values:
    if on and z.in_sun:
        raise InputError("the beam looks into the Sun (expected a move away first)")
    if on and not z.homed and not z.laser_at_boot:
        raise InputError("not homed: the beam's direction is unknown (expected FHM 0 and FHM 1 first)")
    if on is not None:
        z.switch_laser(bool(on))
    return str(int(z.head.laser_on())), *(f"{k} {v:.2f}" for k, v in sorted(z.head.supplies().items()))


def _entemp(z: RangerState, _: int) -> Values:
    temperature = z.head.enclosure_temperature_c()
    if not np.isfinite(temperature):
        raise InputError("the enclosure's temperature is unknown")
    return (f"{temperature:.2f}",)


def _rst(z: RangerState, _: int) -> Values:
    z.reset()
    return ()


def _lst(z: RangerState, client: int) -> Values:
    entries = [e for e in z.scheduler.entries if e.client == client]
    return str(len(entries)), *(
        f"{stamp(nanoseconds_to_ticks(e.due_ns))} {e.repeats} {e.request.command}" for e in entries[:24]
    )


def _lease(z: RangerState, client: int, name: str | None = None, token: str | None = None) -> Values:
    if name is None:
        return holder_of(z)
    if token is not None:
        return _renewed(z, client, name, token)
    if name.lower() != "none":
        z.lease = Lease(client, name, secrets.token_hex(TOKEN_BYTES), z.peer(client))
        return *holder_of(z), z.lease.token
    if z.lease is None or z.lease.client != client:
        raise InputError(f"the lease is {'free' if z.lease is None else z.lease.name + chr(39) + 's'} (expected yours)")
    z.lease = None
    return holder_of(z)


def _renewed(z: RangerState, client: int, name: str, token: str) -> Values:
    """Renew the lease by its token, perhaps from another connection."""
    lease = z.lease
    if lease is None or not hmac.compare_digest(token.encode(), lease.token.encode()):
        raise InputError("invalid token of the lease (expected LEASE and a name to take it)")
    if (lease.client, lease.name) != (client, name):
        z.lease = Lease(client, name, token, z.peer(client))
    return holder_of(z)


def holder_of(z: RangerState) -> Values:
    """Name, connection (1 or 2) and address of the lease's holder, or `none`."""
    return ("none",) if z.lease is None else (z.lease.name, str(z.lease.client + 1), z.lease.peer)


def latch_of(z: RangerState) -> Values:
    """Latched stop order: extent and sender; `none` without one."""
    return ("none",) if z.latch is None else (z.latch.extent, _commas(z.latch.order))


def _unlatch(z: RangerState, client: int, name: str) -> Values:
    if z.guarded and z.lease is not None and z.lease.client == client:
        raise InputError("the holder of the lease cannot clear it (expected another connection, or LEASE none first)")
    z.set_latch(None)
    z.cleared_by = f"{name} at {z.peer(client)}"
    return latch_of(z)


def _clr(z: RangerState, client: int) -> Values:
    return (str(z.scheduler.clear(client)),)


def _hlp(z: RangerState, _: int, name: str | None = None) -> Values | Work:
    if name is None:
        return (" ".join(["AT", *sorted(COMMANDS)]),)
    if name.upper() not in COMMANDS:
        raise InputError(f"unknown command {name} (expected one listed by HLP)")
    row = COMMANDS[name.upper()]
    return (_commas(row.help), _commas(row.usage))


def _commas(text: str) -> str:
    """Text without commas, as values of a reply need."""
    return text.replace(",", ";")


def _initzy(z: RangerState, client: int) -> Work:
    """Run CUBES.INI, ZYnnn.INI and the head's file until a command fails."""
    if z.files is None:
        raise InputError("this ranger has no initialisation files (expected their folder at its start)")
    commands = [(name, *numbered) for name in file_names(z) for numbered in _commands(z.files / name)]
    for name, line, request in commands:
        where = f"{name} line {line}"
        if request.command not in COMMANDS or request.command in NOT_OF_A_FILE:
            raise InputError(f"{where}: {request.command} is not allowed in an initialisation file")
        try:
            answer = z.work_of(client, request)
            if isinstance(answer, tuple):
                yield Reply(request.command, True, answer)
            else:
                last = yield from _replies(request.command, answer)
                if last is not None:
                    yield Reply(request.command, True, last)
        except CatseyeError as problem:
            raise InputError(f"{where}: {problem}") from problem
    return ()


def _replies(command: str, work: Work) -> Work:
    """Replies of another command, each with its name."""
    while True:
        try:
            values = next(work)
        except StopIteration as end:
            return end.value
        yield Reply(command, True, values) if isinstance(values, tuple) else values


def file_names(z: RangerState) -> tuple[str, str, str]:
    """Initialisation files in their order: cubes, monument, head."""
    return "CUBES.INI", f"{z.name.upper()}.INI", f"{z.mirror.lower()}.INI"


def _commands(path: Path) -> list[tuple[int, Request]]:
    try:
        return commands_of_file(path.read_text("ascii"), path.name)
    except (OSError, UnicodeDecodeError) as problem:
        raise InputError(f"{path.name} cannot be read (expected an ASCII file)") from problem


def replace_file(folder: Path, name: str, text: str, valid: set[str] | None = None) -> None:
    """Replace an initialisation file, if valid; the old one becomes NAME.BAK.

    folder   of the ranger's files
    name     one of `file_names`
    text     commands, ASCII, with comments after ;
    valid    lines known to be valid, to which this file's are added: rangers of a site have most of them in common

    Raises InputError: an invalid command, or the file cannot be written.
    """
    for line, request in commands_of_file(text, name, valid or ()):
        try:
            if request.command not in COMMANDS:
                raise InputError(f"unknown command {request.command}")
            COMMANDS[request.command].read(request)
        except InputError as problem:
            raise InputError(f"{name} line {line}: {problem}") from problem
    if valid is not None:
        valid.update(text.splitlines())
    path, new = folder / name, folder / f".{name}.new"
    try:
        new.write_text(text, "ascii")
        if path.exists():
            path.replace(path.with_suffix(".BAK"))
        new.replace(path)
    except (OSError, UnicodeEncodeError) as problem:
        new.unlink(missing_ok=True)
        raise InputError(f"{name} cannot be written (expected ASCII and space in its folder)") from problem


HANDLERS: dict[str, Handler] = {
    **AXES,
    **CUBES,
    **SHOTS,
    **SUN,
    "STW": lambda z, _: (word_text(z.status()),),
    "VER": lambda z, _: (z.name, VERSION),
    "STI": _sti,
    "PS": _ps,
    "ENTEMP": _entemp,
    "RST": _rst,
    "LST": _lst,
    "CLR": _clr,
    "LEASE": _lease,
    "LATCH": lambda z, _: latch_of(z),
    "UNLATCH": _unlatch,
    "STOP": lambda z, _: (),  # the ranger itself has stopped everything before
    "HLP": _hlp,
    "HELP": _hlp,
    "INITZY": _initzy,
    "BYE": lambda z, _: ("Closing Connection",),  # the server prepends the port
}
