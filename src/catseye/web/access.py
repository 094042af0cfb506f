"""Access to the service: names it is called by, origins, token."""

import hmac
from dataclasses import dataclass, field
from typing import Any, NamedTuple

LOOPBACK_NAMES = frozenset({"127.0.0.1", "localhost", "::1"})
OTHER_SITES = (b"cross-site", b"same-site")
OPEN = ("/api/", "/metrics")  # beginnings of paths that say something of the site
BEARER = b"bearer "


class Refusal(NamedTuple):
    """Refusal of a request: status, reason for the metrics, text."""

    status: int
    reason: str
    text: str


@dataclass(frozen=True)
class AccessPolicy:
    """Requirements of a request.

    token        of commands, and of all where `exposed`; None: no commands
    names        names and addresses that the service is called by
    exposed      True beyond loopback: reading needs the token, too
    commanding   True for a site; a journal and a result take no commands
    secure       True with TLS
    """

    names: frozenset[str]
    token: str | None = field(default=None, repr=False)
    exposed: bool = False
    commanding: bool = False
    secure: bool = False

    def refusal(self, scope: Any) -> Refusal | None:
        """Refusal of a request by its headers; None if it may go on.

        A WebSocket shows its token in its first message.
        """
        headers = dict(reversed(scope["headers"]))  # the first of a name counts
        host = headers.get(b"host", b"").decode("latin-1").lower()
        if host_name(host) not in self.names:
            return Refusal(403, "host", f"Host {host!a} is not a name of this service")
        origin = headers.get(b"origin")
        if origin is not None and origin.decode("latin-1").lower() != f"{'https' if self.secure else 'http'}://{host}":
            return Refusal(403, "origin", f"Origin {origin!a} is not this service")
        if not scope["path"].startswith(OPEN):
            return None
        if headers.get(b"sec-fetch-site") in OTHER_SITES:
            return Refusal(403, "origin", "the request comes from another site's page")
        if scope["type"] == "websocket":
            return None
        command = scope["method"] not in ("GET", "HEAD", "OPTIONS")
        if command and (self.token is None or not self.commanding):
            return Refusal(403, "command", "this service takes no commands")
        if (command or self.exposed) and not self.accepts(bearer(headers.get(b"authorization", b""))):
            return Refusal(401, "token", "the token is missing or wrong (expected Authorization: Bearer TOKEN)")
        return None

    def accepts(self, token: bytes | None) -> bool:
        """True for the token, compared in constant time."""
        expected = (self.token or "").encode()
        return hmac.compare_digest(expected, token or b"") and bool(expected)


def bearer(authorization: bytes) -> bytes | None:
    """Token of an Authorization header; None if there is none.

    >>> bearer(b"Bearer abc"), bearer(b"Basic abc")
    (b'abc', None)
    """
    return authorization[len(BEARER) :].strip() if authorization[: len(BEARER)].lower() == BEARER else None


def host_name(host: str) -> str:
    """Name or address of a Host header without its port.

    >>> host_name("localhost:5261"), host_name("[::1]:5261"), host_name("127.0.0.1"), host_name("a@b:c")
    ('localhost', '::1', '127.0.0.1', '')
    """
    if host.startswith("["):
        name, bracket, port = host[1:].partition("]")
        valid = bool(bracket) and (not port or (port[0] == ":" and port[1:].isdecimal()))
        return name if valid else ""
    name, colon, port = host.partition(":")
    return name.removesuffix(".") if not colon or port.isdecimal() else ""
