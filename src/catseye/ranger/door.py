"""Who may come in at a port, and for how long a silent connection keeps its place: at rangers, feed and coordinator.

A port beyond this machine asks for the site's key: the first line of a connection is KEY and the key, in clear; until
then nothing is told. Where that travels over what others can read, a tunnel belongs around it.
"""

import asyncio
import hmac
import ipaddress
import os
import socket
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from catseye.errors import InputError
from catseye.ranger.line import parse_request

KEY, KEY_FILE = "CATSEYE_KEY", "CATSEYE_KEY_FILE"  # in the environment
SHORTEST = 16  # characters
PROBES = ((socket.TCP_KEEPIDLE, 20), (socket.TCP_KEEPINTVL, 5), (socket.TCP_KEEPCNT, 3))  # s: gone is noticed in 35


@dataclass(frozen=True)
class Door:
    """What a port asks of those who come.

    key        the site's; None: whoever reaches the port comes in
    lease      commands that move, light or configure need the lease
    dead_man   s without a line of who has the lease, or without one who has it, until laser and motors go off
    idle       s without a line after which a connection is closed
    """

    key: str | None = None
    lease: bool = True
    dead_man: float = 30.0
    idle: float = 3600.0


USUAL_DOOR = Door()


def key_of(environment: Mapping[str, str] = os.environ) -> str | None:
    """The site's key, of CATSEYE_KEY or the file that CATSEYE_KEY_FILE names; None where neither is set.

    Raises InputError: a file that cannot be read, a key too short or not of printable ASCII without blanks and commas.
    """
    key, where = environment.get(KEY), KEY
    if key is None and environment.get(KEY_FILE):
        where = f"{KEY_FILE}={environment[KEY_FILE]}"
        try:
            key = Path(environment[KEY_FILE]).read_text("ascii").strip()
        except (OSError, UnicodeDecodeError) as problem:
            raise InputError(f"{where}: cannot be read (expected a file of one line of ASCII)") from problem
    if key is None:
        return None
    if len(key) < SHORTEST or not all("!" <= c <= "~" and c not in ",;" for c in key):
        raise InputError(
            f"{where}: {len(key)} characters (expected {SHORTEST} or more, printable, no blank, comma or semicolon)"
        )
    return key


def refuse_open(what: str, host: str, key: str | None) -> None:
    """Raises InputError where a port would be open to others without a key."""
    if key is None and not is_here(host):
        raise InputError(
            f"{what}: {host} can be reached by other machines (expected the site's key in {KEY} or a file named by "
            f"{KEY_FILE}, or 127.0.0.1)"
        )


def is_here(host: str) -> bool:
    """Whether only this machine reaches an address.

    >>> is_here("127.0.8.3"), is_here("::1"), is_here("localhost"), is_here("0.0.0.0"), is_here("")
    (True, True, True, False, False)
    """
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def opens(line: bytes, key: str) -> bool:
    """Whether a connection's first line is the key."""
    try:
        request = parse_request(line.decode("ascii", "replace").removesuffix("\r"))
    except InputError:
        return False
    if request is None or request.command != "KEY" or len(request.parameters) != 1:
        return False
    return hmac.compare_digest(request.parameters[0].encode(), key.encode())


def notice_death(transport: asyncio.BaseTransport) -> None:
    """Have the system ask a silent peer whether it is there still."""
    sock = transport.get_extra_info("socket")
    if sock is None or sock.family not in (socket.AF_INET, socket.AF_INET6):
        return
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for option, value in PROBES:
        sock.setsockopt(socket.IPPROTO_TCP, option, value)
