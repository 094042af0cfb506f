"""Scheduled commands: never early, perhaps late, round robin, no priorities."""

from dataclasses import dataclass

from catseye.errors import InputError
from catseye.geometry.sky.time_tag import PER_SECOND
from catseye.ranger.line import Request

MOST_ENTRIES = 64  # of one connection


@dataclass
class ScheduledCommand:
    """A scheduled command of a connection.

    due_ns in nanoseconds since MJD 0, repeated so many times, so far apart.
    """

    client: int
    request: Request
    due_ns: int
    repeats: int = 1
    interval_ns: int = 0


class Scheduler:
    """Scheduled commands of all connections, served round robin."""

    def __init__(self) -> None:
        self.entries: list[ScheduledCommand] = []

    def add(self, client: int, request: Request, due_ns: int, repeats: int = 1, interval: float = 0.0) -> None:
        """Schedule a command; `interval` in s, between its repeats.

        Raises InputError: the connection has too many.
        """
        if sum(e.client == client for e in self.entries) >= MOST_ENTRIES:
            raise InputError(f"{MOST_ENTRIES} commands are scheduled already (use CLR, or let some run)")
        self.entries.append(ScheduledCommand(client, request, due_ns, repeats, round(interval * PER_SECOND)))

    def take(self, now_ns: int) -> ScheduledCommand | None:
        """Next due command, moved to the end of the queue; None if none.

        A repeated command keeps its times: a late one does not move those after it.
        """
        for at, entry in enumerate(self.entries):
            if entry.due_ns > now_ns:
                continue
            del self.entries[at]
            if entry.repeats > 1:
                later = entry.due_ns + entry.interval_ns
                self.entries.append(
                    ScheduledCommand(entry.client, entry.request, later, entry.repeats - 1, entry.interval_ns)
                )
            return entry
        return None

    @property
    def due_ns(self) -> int | None:
        """Time of the next command, ns since MJD 0; None without one."""
        return min((e.due_ns for e in self.entries), default=None)

    def clear(self, client: int) -> int:
        """Drop a connection's commands; their number."""
        before = len(self.entries)
        self.entries = [e for e in self.entries if e.client != client]
        return before - len(self.entries)
