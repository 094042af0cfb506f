"""Queues of commands, one a connection: a long answer, or a wait, of one connection keeps no other waiting.

Of commands that change the ranger one runs at a time, whosever it is; questions of other connections pass it by.
"""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from catseye.ranger.commands import COMMANDS
from catseye.ranger.line import Request
from catseye.ranger.state import Work

SCHEDULE = -1  # the lane of scheduled commands


@dataclass
class Running:
    """A command under way: of a connection, and when what it waits for is asked again (None: soon).

    acts   it is more than a question
    more   a slice of its answer is out, and the next can come at once
    """

    client: int
    request: Request
    work: Work
    acts: bool
    ask_at: int | None = None
    more: bool = False


@dataclass
class Lane:
    """Commands of one connection in the order received."""

    client: int
    waiting: deque[Request] = field(default_factory=deque)
    running: Running | None = None


def acts(request: Request) -> bool:
    """True for a request that changes the ranger: those need the lease, and run one at a time.

    >>> acts(Request("ACP", ("0",))), acts(Request("CIL", ("1",))), acts(Request("BYE")), acts(Request("XYZ"))
    (False, True, False, False)
    """
    row = COMMANDS.get(request.command)
    return request.command == "AT" or (row is not None and request.command != "BYE" and not row.only_asks(request))


class Lanes:
    """The lanes of a ranger's connections, and that of what was scheduled."""

    def __init__(self) -> None:
        self._lanes: dict[int, Lane] = {SCHEDULE: Lane(SCHEDULE)}

    def of(self, client: int) -> Lane:
        """The lane of one connection."""
        return self._lanes.setdefault(client, Lane(client))

    def drop(self, client: int) -> None:
        """Forget a connection's commands."""
        self._lanes.pop(client, None)
        scheduled = self._lanes[SCHEDULE]
        if scheduled.running is not None and scheduled.running.client == client:
            scheduled.running = None

    def in_turn(self, first: int | None) -> Iterator[Lane]:
        """All lanes, `first` before the others."""
        yield from (lane for _, lane in sorted(self._lanes.items(), key=lambda item: item[0] != first))

    @property
    def acting(self) -> Running | None:
        """The command under way that changes the ranger."""
        return next((lane.running for lane in self._lanes.values() if lane.running and lane.running.acts), None)

    def can_begin(self, lane: Lane) -> bool:
        """True where a lane's next command can begin now."""
        return bool(lane.waiting) and lane.running is None and (self.acting is None or not acts(lane.waiting[0]))

    @property
    def busy(self) -> bool:
        """True while a command runs or waits."""
        return any(lane.running is not None or lane.waiting for lane in self._lanes.values())

    @property
    def running(self) -> list[Running]:
        """Commands under way, of all lanes."""
        return [lane.running for lane in self._lanes.values() if lane.running is not None]

    def take_out(
        self, which: Callable[[Request], bool], client: int | None = None, *, running: bool = False
    ) -> list[tuple[int, Request]]:
        """Take commands out of the lanes: whose they were, and what.

        which     of those that wait
        client    of this connection only; None: of all
        running   what runs and changes the ranger, too
        """
        out: list[tuple[int, Request]] = []
        for number, lane in self._lanes.items():
            under_way = lane.running
            whose = number if under_way is None else under_way.client
            if client is not None and whose != client:
                continue
            if running and under_way is not None and under_way.acts:
                under_way.work.close()
                lane.running = None
                out.append((under_way.client, under_way.request))
            out += [(number, request) for request in lane.waiting if which(request)]
            lane.waiting = deque(request for request in lane.waiting if not which(request))
        return out
