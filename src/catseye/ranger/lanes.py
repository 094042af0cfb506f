"""Command queues, one per connection, so that none blocks another.

Of commands that change the ranger one runs at a time, whosever it is; queries of other connections pass it.
"""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from catseye.ranger.commands import COMMANDS
from catseye.ranger.line import Request
from catseye.ranger.state import Work

SCHEDULE = -1  # the queue of scheduled commands


@dataclass
class Running:
    """A command under way, and when to poll it (None: soon).

    acts   True if it is more than a query
    more   True if a part of its answer is sent, and the next can follow at once
    """

    client: int
    request: Request
    work: Work
    acts: bool
    ask_at: int | None = None
    more: bool = False


@dataclass
class Lane:
    """Queue of one connection, in order of arrival."""

    client: int
    waiting: deque[Request] = field(default_factory=deque)
    running: Running | None = None


def acts(request: Request) -> bool:
    """True for a request that changes the ranger.

    Those need the lease, and run one at a time.

    >>> acts(Request("ACP", ("0",))), acts(Request("CIL", ("1",))), acts(Request("BYE")), acts(Request("XYZ"))
    (False, True, False, False)
    """
    row = COMMANDS.get(request.command)
    return request.command == "AT" or (row is not None and request.command != "BYE" and not row.only_asks(request))


class Lanes:
    """Queues of a ranger's connections, and of scheduled commands."""

    def __init__(self) -> None:
        self._lanes: dict[int, Lane] = {SCHEDULE: Lane(SCHEDULE)}

    def of(self, client: int) -> Lane:
        """Queue of one connection."""
        return self._lanes.setdefault(client, Lane(client))

    def drop(self, client: int) -> None:
        """Drop a connection's commands."""
        self._lanes.pop(client, None)
        scheduled = self._lanes[SCHEDULE]
        if scheduled.running is not None and scheduled.running.client == client:
            scheduled.running = None

    def in_turn(self, first: int | None) -> Iterator[Lane]:
        """All queues, `first` before the others."""
        yield from (lane for _, lane in sorted(self._lanes.items(), key=lambda item: item[0] != first))

    @property
    def acting(self) -> Running | None:
        """The command under way that changes the ranger."""
        return next((lane.running for lane in self._lanes.values() if lane.running and lane.running.acts), None)

    def can_begin(self, lane: Lane) -> bool:
        """True if a queue's next command can start now."""
        return bool(lane.waiting) and lane.running is None and (self.acting is None or not acts(lane.waiting[0]))

    @property
    def busy(self) -> bool:
        """True while a command runs or waits."""
        return any(lane.running is not None or lane.waiting for lane in self._lanes.values())

    @property
    def running(self) -> list[Running]:
        """Commands under way, of all queues."""
        return [lane.running for lane in self._lanes.values() if lane.running is not None]

    def take_out(
        self, which: Callable[[Request], bool], client: int | None = None, *, running: bool = False
    ) -> list[tuple[int, Request]]:
        """Remove commands from the queues: client and request of each.

        which     True for waiting requests to remove
        client    of this connection only; None: of all
        running   True to remove also what runs and changes the ranger
        """
        out: list[tuple[int, Request]] = []
        for number, lane in self._lanes.items():
            current = lane.running
            whose = number if current is None else current.client
            if client is not None and whose != client:
                continue
            if running and current is not None and current.acts:
                current.work.close()
                lane.running = None
                out.append((current.client, current.request))
            out += [(number, request) for request in lane.waiting if which(request)]
            lane.waiting = deque(request for request in lane.waiting if not which(request))
        return out
