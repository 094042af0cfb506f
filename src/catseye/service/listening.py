"""Addresses of served rangers, and the lines by which a child process tells of its start.

Standard output of `catseye zy ... --json --leave-with-stdin`, an object a line:

    {"bound": {"rangers": {...}, "feed": [...]}}   ports are taken; nobody can connect yet
    {"ready": 7, "of": 18}                         rangers that are made ready, as it goes
    {"rangers": {...}, "feed": [...]}              they answer
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from catseye.errors import InputError

if TYPE_CHECKING:
    from catseye.ranger.addresses import Address

STEP_NAME = "rangers ready"  # of progress


@dataclass(frozen=True)
class Listening:
    """Addresses of what is served.

    Host and both ports of each ranger; host and port of the feed, if any.
    """

    rangers: "Mapping[str, Address]"
    feed: tuple[str, int] | None = None

    def plain(self) -> dict[str, Any]:
        """Addresses of rangers and feed as an object for JSON."""
        return {
            "rangers": {name: list(at) for name, at in self.rangers.items()},
            "feed": None if self.feed is None else list(self.feed),
        }


@dataclass(frozen=True)
class StartLine:
    """A line of a child that starts.

    at      addresses, once its ports are bound
    up      True if they answer
    ready   rangers that are ready, of `count`
    """

    at: Listening | None = None
    up: bool = False
    ready: int = 0
    count: int = 0


def start_line_of(line: str) -> StartLine:
    """A child's line, parsed.

    Raises InputError for any other line.
    """
    try:
        stored = json.loads(line)
        if "ready" in stored:
            return StartLine(ready=int(stored["ready"]), count=int(stored["of"]))
        return StartLine(at=_listening(stored.get("bound", stored)), up="bound" not in stored)
    except (ValueError, KeyError, TypeError, AttributeError) as problem:
        raise InputError(f"the twin printed {line[:80]!a} (expected its addresses)") from problem


def _listening(stored: Mapping[str, Any]) -> Listening:
    rangers = {str(name): (str(host), int(a), int(b)) for name, (host, a, b) in stored["rangers"].items()}
    feed = None if stored["feed"] is None else (str(stored["feed"][0]), int(stored["feed"][1]))
    return Listening(rangers, feed)
