"""What a connection begins with: a browser, or what is no line, is turned away before a second line is looked at.

A page in a browser can make it send bytes to any port of the machine: a request's body would be lines of this language.
It always begins with a request line or a TLS hello, which no line of the language is.
"""

import re
from typing import Literal

from catseye.errors import InputError
from catseye.ranger.line import LONGEST_REQUEST, parse_request

HTTP = re.compile(rb"[A-Z]{3,16} +(/|\*|[a-z][a-z0-9+.-]*:)|[ -~]* HTTP/[0-9]|Host *:", re.IGNORECASE)
TLS_HELLO = b"\x16\x03"
BLANK = b"\r\n\t "  # lines of nothing else ask nothing
SHOWN = 40  # bytes in the log
Opening = Literal["waiting", "foreign", "unreadable", "read"]


def opening_of(data: bytes) -> tuple[Opening, str]:
    """How a connection's first bytes stand, and what is wrong with them.

    data   all that came so far

    "waiting"     no whole line yet but empty ones, which ask nothing
    "foreign"     HTTP or TLS: close at once, with no answer
    "unreadable"  no line of the language: answer, then close
    "read"        a line of the language, whatever it asks

    >>> opening_of(b"POST / HTTP/1.1\\r\\n")
    ('foreign', "begins with b'POST / HTTP/1.1', which is HTTP")
    >>> opening_of(b"1000\\tVER\\n")
    ('read', '')
    """
    if data.startswith(TLS_HELLO):
        return "foreign", "begins with a TLS hello"
    begun = data.lstrip(BLANK)
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
        parse_request(line.decode("ascii", "replace"))
    except InputError as problem:
        return "unreadable", str(problem)
    return "read", ""


def peer_of(transport: object) -> str:
    """Who is at the other end, for a log; "a peer" where that is not known."""
    about = getattr(transport, "get_extra_info", None)
    peer = about("peername") if about is not None else None
    return f"{peer[0]} port {peer[1]}" if isinstance(peer, tuple) and len(peer) >= 2 else "a peer"
