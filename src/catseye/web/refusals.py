"""Log of what the service refuses: a line each at a bounded rate, and counts of all."""

import asyncio
import sys
from collections import Counter
from collections.abc import Callable
from typing import Any

PERIOD = 10.0  # s
MOST_LINES = 5  # in a period; the others are counted
LONGEST_PATH = 80  # characters


class RefusalLog:
    """Lines about refusals, and their number by reason.

    write   takes a line
    """

    def __init__(self, write: "Callable[[str], None] | None" = None):
        self._write = write_line if write is None else write
        self.counts: Counter[str] = Counter()
        self._lines, self._unsaid = 0, 0
        self._timer: asyncio.TimerHandle | None = None

    def refused(self, reason: str, client: Any, text: str, *, what: str = "connection") -> None:
        """Count a refusal, and say it unless five were said in these 10 s.

        reason   a word, for the metrics
        client   address of the client, (host, port) or None
        what     method and path, without the query
        """
        self.counts[reason] += 1
        self.say(f"refused {what} from {client[0] if client else 'a socket'}: {text}")

    def say(self, text: str) -> None:
        """Write a line unless five were written in these 10 s."""
        if self._lines >= MOST_LINES:
            self._unsaid += 1
            return
        self._lines += 1
        self._write(printable(text))
        if self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(PERIOD, self._again)

    def _again(self) -> None:
        unsaid, self._lines, self._unsaid, self._timer = self._unsaid, 0, 0, None
        if unsaid:
            self.say(f"{unsaid} more lines like these in {PERIOD:g} s were not written")


def request_words(scope: Any) -> str:
    """Method and path of a request for a log, without its query.

    >>> request_words({"method": "GET", "path": "/api/state", "query_string": b"token=secret"})
    'GET /api/state'
    """
    path = str(scope.get("path", ""))
    return f"{scope.get('method', 'WebSocket')} {path if len(path) <= LONGEST_PATH else path[:LONGEST_PATH] + '...'}"


def printable(text: str) -> str:
    """The text on one line of printable characters."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def write_line(text: str) -> None:
    """Write a line to standard error, where a reader who has left is no failure."""
    try:
        sys.stderr.write(text + "\n")
        sys.stderr.flush()
    except (OSError, ValueError, AttributeError):
        return
