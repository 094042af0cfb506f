"""Access policy of a port: site key, lease, time-outs; for rangers, feed and coordinator.

A port beyond this machine requires the site's key, which is never sent: the server sends NONCE and a random word, and
the first line of a connection is KEY and the HMAC-SHA256 of that word by the key, in hexadecimal; until then the server
sends nothing else.
"""

import asyncio
import hmac
import os
import socket
import stat
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from catseye.errors import InputError
from catseye.ranger.network import NO_TLS, TlsFiles, is_here

KEY, KEY_FILE = "CATSEYE_KEY", "CATSEYE_KEY_FILE"  # in the environment
SHORTEST = 16  # characters
FEWEST_LETTERS = 8  # different ones: fewer are easily guessed
LONGEST_RUN = 7  # consecutive characters as in the alphabet
TYPED = ("password", "changeme", "letmein", "secret", "qwerty", "admin", "default")
PROBES = (
    (socket.TCP_KEEPIDLE, 20),
    (socket.TCP_KEEPINTVL, 5),
    (socket.TCP_KEEPCNT, 3),
)  # s: a lost peer is detected in 35


@dataclass(frozen=True)
class Door:
    """Requirements of a port.

    key        the site's; None: no authentication
    lease      True if commands that move, light or configure need the lease
    dead_man   s of the dead-man switch: without an order of the lease's holder, or without a holder, laser and motors
               go off
    idle       s without a line after which a connection is closed
    tls        files for addresses beyond this machine
    laser_at_boot  True as for the notes' rangers: the laser at boot is as its hardware has it; else off until switched
    on
    """

    key: str | None = None
    lease: bool = True
    dead_man: float = 30.0
    idle: float = 3600.0
    tls: TlsFiles = NO_TLS
    laser_at_boot: bool = False


DEFAULT_ACCESS = Door()


def key_of(environment: Mapping[str, str] = os.environ) -> str | None:
    """The site's key from CATSEYE_KEY or CATSEYE_KEY_FILE; None if unset.

    Raises InputError: a file that is unreadable or readable by others, a key too short, trivial, or not of printable
    ASCII without blanks and commas.
    """
    key = environment.get(KEY)
    if key is None and environment.get(KEY_FILE):
        return key_in(Path(environment[KEY_FILE]), f"{KEY_FILE}={environment[KEY_FILE]}")
    return None if key is None else _checked(key, KEY)


def key_in(path: Path, where: str) -> str:
    """Key in a file of one line that only its owner may read.

    where   name of the file in messages

    Raises InputError: a file that is unreadable or readable by others, and as `key_of`.
    """
    return _checked(_line_of(path, where), where)


def _checked(key: str, where: str) -> str:
    if len(key) < SHORTEST or not all("!" <= c <= "~" and c not in ",;" for c in key):
        raise InputError(
            f"{where}: {len(key)} characters (expected {SHORTEST} or more, printable, no blank, comma or semicolon)"
        )
    problem = triviality(key)
    if problem is not None:
        raise InputError(f"{where}: the key is trivial: {problem} (expected a random one: openssl rand -hex 16)")
    return key


def _line_of(path: Path, where: str) -> str:
    """The line of a key's file.

    Raises InputError if it is unreadable, or readable by others.
    """
    try:
        about = path.stat()
        key = path.read_text("ascii").strip()
    except (OSError, UnicodeDecodeError) as problem:
        raise InputError(f"{where}: cannot be read (expected a file of one line of ASCII)") from problem
    of_root = about.st_uid == about.st_gid == 0  # as systemd's credentials, whose group bits are an ACL mask
    if about.st_mode & (0o037 if of_root else 0o077):
        raise InputError(
            f"{where}: accessible by others, {stat.filemode(about.st_mode)} (expected -rw-------: chmod 600)"
        )
    return key


def triviality(key: str) -> str | None:
    """Weakness of a key in words, None if hard to guess.

    >>> triviality("aaaaaaaaaaaaaaaab"), triviality("f3b0c44298fc1c14")
    ('2 different characters', None)
    """
    if len(set(key)) < FEWEST_LETTERS:
        return f"{len(set(key))} different characters"
    steps = [ord(b) - ord(a) for a, b in pairwise(key)]
    for step in (1, -1):
        if any(all(s == step for s in steps[at : at + LONGEST_RUN]) for at in range(len(steps) - LONGEST_RUN + 1)):
            return "consecutive letters or digits"
    half = len(key) // 2
    if any(key == (key[:n] * (len(key) // n + 1))[: len(key)] for n in range(1, half + 1)):
        return "a repeated part"
    word = next((word for word in TYPED if word in key.lower()), None)
    return None if word is None else f"it contains {word!a}"


def refuse_exposed_port(what: str, host: str, door: Door) -> None:
    """Raise InputError for an exposed port without key or TLS."""
    if is_here(host):
        return
    if door.key is None:
        raise InputError(
            f"{what}: {host} can be reached by other machines (expected the site's key in {KEY} or a file named by "
            f"{KEY_FILE}, or 127.0.0.1)"
        )
    try:
        door.tls.of_server(host)
    except InputError as problem:
        raise InputError(f"{what}: {problem}") from problem


def answer_to(nonce: str, key: str) -> str:
    """Proof of the key: HMAC-SHA256 of a server's nonce, hexadecimal.

    >>> answer_to("00", "Jefe-of-the-site-11")[:16]
    '2dc447d20cdc3ef5'
    """
    return hmac.new(key.encode(), nonce.encode(), "sha256").hexdigest()


def enable_keep_alive_probes(transport: asyncio.BaseTransport) -> None:
    """Enable TCP keep-alive probes, to detect a lost peer."""
    sock = transport.get_extra_info("socket")
    if sock is None or sock.family not in (socket.AF_INET, socket.AF_INET6):
        return
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for option, value in PROBES:
        sock.setsockopt(socket.IPPROTO_TCP, option, value)
