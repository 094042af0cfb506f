"""What a connection begins with: a browser, or what is no line, is turned away before a second line is looked at.

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
BLANK = b"\r\n\t "  # lines of nothing else ask nothing
SHOWN = 40  # bytes in the log
CREDENTIALS = struct.Struct("3i")  # process, user and group at the other end of a Unix socket
Opening = Literal["waiting", "foreign", "unreadable", "read"]


def opening_of(data: bytes, words: Collection[str] | None = None) -> tuple[Opening, str]:
    """How a connection's first bytes stand, and what is wrong with them.

    data    all that came so far
    words   commands that a first line may give; None: any

    "waiting"     no whole line yet but empty ones, which ask nothing
    "foreign"     HTTP, TLS or binary: close at once, with no answer
    "unreadable"  no line of the language, or an unknown command: answer, then close
    "read"        a line of the language, whatever it asks

    >>> opening_of(b"POST / HTTP/1.1\\r\\n")
    ('foreign', "begins with b'POST / HTTP/1.1', which is HTTP")
    >>> opening_of(b"1000\\tVER\\n", {"VER"})
    ('read', '')
    >>> opening_of(b"EHLO mail\\n", {"VER"})
    ('unreadable', "begins with 'EHLO', an unknown command")
    """
    if data.startswith(TLS_HELLO):
        return "foreign", "begins with a TLS hello"
    begun = data.lstrip(BLANK)
    if begun and not 0x20 <= begun[0] <= 0x7E:
        return "foreign", f"begins with byte 0x{begun[0]:02x}, which is no printable ASCII"
    line, end, _ = begun.partition(b"\n")
    line = line.removesuffix(b"\r")
    if HTTP.match(line):
        return "foreign", f"begins with {line[:SHOWN]!r}, which is HTTP"
    if not end:
        if len(begun) > LONGEST_REQUEST + 2:
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
    """Who is at the other end, for a log; "a peer" where that is not known."""
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
