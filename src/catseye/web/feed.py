"""Events to browsers: each is encoded once, and a slow client loses events instead of slowing anybody.

Events of 50 ms are one batch. A client's queue holds 20 batches; when it is full the oldest goes and is counted, and
the client gets the counts: {"kind": "lag", "data": {"dropped": {kind: n}}}.
"""

import asyncio
import json
from collections import Counter, deque
from collections.abc import Iterable
from typing import Any, NamedTuple

MOST_BATCHES = 20  # in a client's queue
MOST_CLIENTS = 128
BATCH_SECONDS = 0.05  # s of events that go together
KINDS = ("state", "shot", "epoch", "event", "posture", "weather")


class LiveEvent(NamedTuple):
    """Event as all clients get it: its kind and its JSON."""

    kind: str
    text: str


Batch = tuple[LiveEvent, ...]


def encoded(kind: str, data: Any) -> LiveEvent:
    """Event with its JSON text; NaN is refused, as browsers refuse it."""
    return LiveEvent(kind, json.dumps({"kind": kind, "data": data}, allow_nan=False, separators=(",", ":")))


class LiveClient:
    """Queue of one client.

    kinds   of events that it wants
    """

    def __init__(self, kinds: Iterable[str]):
        self.kinds = frozenset(kinds)
        self._queue: deque[Batch] = deque()
        self._dropped: Counter[str] = Counter()
        self._ready = asyncio.Event()

    def put(self, batch: Batch) -> Counter[str]:
        """Append the events of a batch that it wants; counts of those that went for lack of room."""
        wanted = batch if self.kinds.issuperset(KINDS) else tuple(e for e in batch if e.kind in self.kinds)
        if not wanted:
            return Counter()
        lost = Counter(event.kind for event in self._queue.popleft()) if len(self._queue) >= MOST_BATCHES else Counter()
        self._dropped.update(lost)
        self._queue.append(wanted)
        self._ready.set()
        return lost

    async def take(self) -> list[str]:
        """Texts to send next, the first with the counts of what was lost before."""
        await self._ready.wait()
        batch = self._queue.popleft()
        if not self._queue:
            self._ready.clear()
        texts = [event.text for event in batch]
        if self._dropped:
            texts.insert(0, encoded("lag", {"dropped": dict(self._dropped)}).text)
            self._dropped.clear()
        return texts


class LiveFeed:
    """Distributor of a site's events; `publish` is a listener of a `SiteWatch`.

    events    number by kind
    dropped   number by kind, of all clients
    """

    def __init__(self) -> None:
        self.clients: set[LiveClient] = set()
        self.events: Counter[str] = Counter()
        self.dropped: Counter[str] = Counter()
        self._batch: list[LiveEvent] = []

    def publish(self, kind: str, data: dict[str, Any]) -> None:
        """Give an event to all clients within 50 ms."""
        self.events[kind] += 1
        if not self.clients:
            return
        if not self._batch:
            asyncio.get_running_loop().call_later(BATCH_SECONDS, self._flush)
        self._batch.append(encoded(kind, data))

    def _flush(self) -> None:
        batch, self._batch = tuple(self._batch), []
        for client in self.clients:
            self.dropped.update(client.put(batch))
