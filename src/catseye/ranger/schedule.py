"""Commands that wait for their time: never early, perhaps late, round robin, no priorities."""

from dataclasses import dataclass

from catseye.errors import InputError
from catseye.geometry.sky.time_tag import PER_SECOND
from catseye.ranger.line import Request

MOST_ENTRIES = 64  # of one connection


@dataclass
class ScheduledCommand:
    """A command of a connection, due at nanoseconds since MJD 0, so many times, so far apart."""

    client: int
    request: Request
    due_ns: int
    repeats: int = 1
    interval_ns: int = 0


class Scheduler:
    """Entries of all connections; the turn goes round."""

    def __init__(self) -> None:
        self.entries: list[ScheduledCommand] = []

    def add(self, client: int, request: Request, due_ns: int, repeats: int = 1, interval: float = 0.0) -> None:
        """Add a command; `interval` in s, between its repeats.

        Raises InputError: the connection has too many.
        """
        if sum(e.client == client for e in self.entries) >= MOST_ENTRIES:
            raise InputError(f"{MOST_ENTRIES} commands wait already (expected fewer: CLR, or let some run)")
        self.entries.append(ScheduledCommand(client, request, due_ns, repeats, round(interval * PER_SECOND)))

    def take(self, now_ns: int) -> ScheduledCommand | None:
        """The next command that is due, which goes to the back of the row; None where none is.

        A repeated command keeps its times: one that comes late does not move those after it.
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
        """When the next command is due, nanoseconds since MJD 0; None without one."""
        return min((e.due_ns for e in self.entries), default=None)

    def clear(self, client: int) -> int:
        """Drop a connection's commands; how many they were."""
        before = len(self.entries)
        self.entries = [e for e in self.entries if e.client != client]
        return before - len(self.entries)
