"""Authentication of connections to a port, before they get its place.

Pending connections are few, are sent nothing but a nonce, and are closed after a while. A wrong key is answered late,
and wrong ones are counted in the log once a minute.
"""

import asyncio
import hmac
import logging
import secrets
from collections import Counter
from collections.abc import Callable, Collection

from catseye.errors import InputError
from catseye.ranger.door import Door, answer_to
from catseye.ranger.first_line import BLANK, opening_of, peer_of
from catseye.ranger.line import Reply, Request, parse_request

PATIENCE = 10.0  # s within which the key must arrive
SLOWED = 1.0  # s until a wrong key is answered
MOST_PENDING = 16  # pending connections; the oldest of the address with most of them makes room
COUNTED = 60.0  # s between two lines of the log about wrong keys
NONCE_BYTES = 16
LOG = logging.getLogger(__name__)


class Doorway:
    """Pending connections of one port, and wrong keys.

    name    of the port, for the log: "ZY101: port 5240"
    door    its access policy
    words   allowed first words
    clock   s, monotonic
    """

    def __init__(self, name: Callable[[], str], door: Door, words: Collection[str], clock: Callable[[], float]):
        self.name, self.door, self.words, self.clock = name, door, words, clock
        self._pending: dict[Entrance, float] = {}  # time of closing, in order of arrival
        self._wrong, self._last_wrong = 0, ""
        self._counted = float("-inf")

    def wait_for(self, entrance: "Entrance", seconds: float) -> None:
        """Add a pending connection; it is closed after so many seconds."""
        self._pending[entrance] = self.clock() + seconds
        if len(self._pending) > MOST_PENDING:
            hosts = Counter(each.host for each in self._pending)  # who opens many makes room for who opens one
            first = min(self._pending, key=lambda each: (not each.judged, -hosts[each.host], self._pending[each]))
            self.forget(first)
            first.close()

    def forget(self, entrance: "Entrance") -> None:
        """Remove a connection that is admitted or closed."""
        self._pending.pop(entrance, None)

    def wrong_key(self, peer: str) -> None:
        """Count a wrong key; the first is logged at once."""
        self._wrong, self._last_wrong = self._wrong + 1, peer
        self.check()

    def check(self) -> None:
        """Close late connections, answer wrong keys, log; call it repeatedly."""
        time_s = self.clock()
        for entrance, due in list(self._pending.items()):
            if time_s >= due:
                self.forget(entrance)
                entrance.refuse()
        if self._wrong and time_s - self._counted >= COUNTED:
            LOG.warning("%s: wrong keys: %d, the last of %s", self.name(), self._wrong, self._last_wrong)
            self._wrong, self._counted = 0, time_s


class Entrance:
    """Authentication of one connection.

    say   sends it a reply, which still needs a stamp
    """

    def __init__(self, gate: Doorway, transport: asyncio.Transport, say: Callable[[Reply], None]):
        self._gate, self._transport, self._say = gate, transport, say
        self._nonce = ""
        self._unread = bytearray()
        self._open = False  # the first line was read
        self.admitted = gate.door.key is None
        self.judged = False  # a wrong key was given
        self.host = peer_of(transport).partition(" port ")[0]

    def begin(self) -> None:
        """Send a nonce, if a key is required."""
        if not self.admitted:
            self._nonce = secrets.token_hex(NONCE_BYTES)
            self._gate.wait_for(self, PATIENCE)
            self._say(Reply("NONCE", True, (self._nonce,)))

    def take(self, data: bytes) -> bytes | None:
        """Bytes after the first line; None if it is incomplete or refused."""
        if self._open:
            return data
        if self.judged or self._transport.is_closing():
            return None  # refused: the rest of its input is ignored
        self._unread += data
        opening, problem = opening_of(bytes(self._unread), self._gate.words)
        if opening == "waiting":
            self._unread = self._unread.lstrip(BLANK)
            return None
        if opening != "read":
            self._turned_away(problem, answered=opening == "unreadable")
            return None
        opening_bytes, self._unread = bytes(self._unread), bytearray()
        if self.admitted:
            self._open = True
            return opening_bytes
        line, _, remainder = opening_bytes.lstrip(BLANK).partition(b"\n")
        return remainder if self._unlocked(line.decode("ascii", "replace").removesuffix("\r")) else None

    def over(self) -> None:
        """Forget a closed connection."""
        self._gate.forget(self)

    def refuse(self) -> None:
        """Close: the key is late, or was wrong."""
        self._refuse(f"the site's key is expected first: KEY and the HMAC-SHA256 of the nonce within {PATIENCE:g} s")

    def close(self) -> None:
        """Close the connection without a message."""
        self._transport.abort()

    def _unlocked(self, line: str) -> bool:
        """Check the first line, which must be KEY and the proof."""
        request = _request(line)
        if request is None or request.command != "KEY" or len(request.parameters) != 1:
            self._gate.forget(self)
            LOG.warning("%s: %s does not give the site's key: closed", self._gate.name(), peer_of(self._transport))
            self.judged = True
            self.refuse()
            return False
        proof = answer_to(self._nonce, self._gate.door.key or "")
        if not hmac.compare_digest(request.parameters[0].lower().encode(), proof.encode()):
            self.judged = True
            self._gate.wait_for(self, SLOWED)
            self._gate.wrong_key(peer_of(self._transport))
            return False
        self._gate.forget(self)
        self.admitted = self._open = True
        self._say(Reply("KEY", True))
        return True

    def _turned_away(self, problem: str, *, answered: bool) -> None:
        text = "".join(c if " " <= c <= "~" else "?" for c in problem)[:500]
        LOG.warning("%s: %s %s: closed", self._gate.name(), peer_of(self._transport), text)
        self._gate.forget(self)
        self._unread.clear()
        self.judged = True
        if answered:
            self._refuse(text)
        else:
            self._transport.abort()

    def _refuse(self, text: str) -> None:
        if not self._transport.is_closing():
            self._say(Reply("LINE", False, (text,)))
            self._transport.close()


def _request(line: str) -> Request | None:
    try:
        return parse_request(line)
    except InputError:
        return None
