"""Check of a connection's first line, to turn browsers away.

A page in a browser can make it send bytes to any port of the machine: a request's body would be lines of this language.
It always begins with a request line, a TLS hello or binary (WebRTC's STUN), which no line of the language does.
"""

import re
import socket
import struct
from collections.abc import Collection
from typing import Literal

from catseye.errors import InputError
from catseye.ranger.line import LONGEST_REQUEST, parse_request

HTTP = re.compile(rb"[A-Z]{3,16} +(/|\*|[a-z][a-z0-9+.-]*:)|[ -~]* HTTP/[0-9]|Host *:", re.IGNORECASE)
TLS_HELLO = b"\x16\x03"
BLANK = b"\r\n\t "  # lines of only these are ignored
LOGGED = 40  # bytes in the log
CREDENTIALS = struct.Struct("3i")  # process, user and group at the other end of a Unix socket
Opening = Literal["waiting", "foreign", "unreadable", "read"]


def opening_of(data: bytes, words: Collection[str] | None = None) -> tuple[Opening, str]:
    """Classification of a connection's first bytes, and their problem.

    data    all received so far
    words   allowed commands of a first line; None: any

    "waiting"     no complete line yet but empty ones, which are ignored
    "foreign"     HTTP, TLS or binary: close at once, with no answer
    "unreadable"  not a line of the language, or an unknown command: answer, then close
    "read"        a line of the language

    >>> opening_of(b"POST / HTTP/1.1\\r\\n")
    ('foreign', "begins with b'POST / HTTP/1.1', which is HTTP")
    >>> opening_of(b"1000\\tVER\\n", {"VER"})
    ('read', '')
    >>> opening_of(b"EHLO mail\\n", {"VER"})
    ('unreadable', "begins with 'EHLO', an unknown command")
    """
    if data.startswith(TLS_HELLO):
        return "foreign", "begins with a TLS hello"
    stripped = data.lstrip(BLANK)
    if stripped and not 0x20 <= stripped[0] <= 0x7E:
        return "foreign", f"begins with byte 0x{stripped[0]:02x}, which is no printable ASCII"
    line, end, _ = stripped.partition(b"\n")
    line = line.removesuffix(b"\r")
    if HTTP.match(line):
        return "foreign", f"begins with {line[:LOGGED]!r}, which is HTTP"
    if not end:
        if len(stripped) > LONGEST_REQUEST + 2:
            return "unreadable", f"line is longer than {LONGEST_REQUEST} bytes"
        return "waiting", ""
    if len(line) > LONGEST_REQUEST:
        return "unreadable", f"line is longer than {LONGEST_REQUEST} bytes"
    try:
        request = parse_request(line.decode("ascii", "replace"))
    except InputError as problem:
        return "unreadable", str(problem)
    if words is not None and request is not None and request.command not in words:
        return "unreadable", f"begins with {request.command!r}, an unknown command"
    return "read", ""


def peer_of(transport: object) -> str:
    """The peer in words, for a log; "a peer" if unknown."""
    about = getattr(transport, "get_extra_info", None)
    if about is None:
        return "a peer"
    peer = about("peername")
    if isinstance(peer, tuple) and len(peer) >= 2:
        return f"{peer[0]} port {peer[1]}"
    sock = about("socket")
    if sock is None or sock.family != socket.AF_UNIX:
        return "a peer"
    process, user, _ = CREDENTIALS.unpack(sock.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, CREDENTIALS.size))
    return f"process {process} of user {user}"
