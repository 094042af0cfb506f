"""Watch of a site: live state from the coordinator's port, everything else from the journal."""

import asyncio
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

from catseye.clock import Clock, SystemClock
from catseye.coordinator.parts import ticks_now
from catseye.errors import InputError
from catseye.ranger.network import ConnectionMaker
from catseye.records.night.live import TICKS_PER_DAY
from catseye.records.site.folder import SiteFolder
from catseye.service.watch.entries import Object
from catseye.service.watch.history import History
from catseye.service.watch.port import SitePort
from catseye.service.watch.site_map import SiteMap

Address = tuple[str, int]
Listener = Callable[[str, Object], None]
HISTORY_PERIOD = 1.0  # s between two states of a journal that is watched without a port


class SiteWatch:
    """A site as people see it, in JSON-ready objects; SI units, MJD.

    records       of the site; None: those of the journal's run
    coordinator   host and port; None: the journal alone
    rangers       host and port of each ranger's console
    journal       place of the journal; None: the last hour, in memory
    network, key  of all connections; sockets and none by default

    `listeners` are called on the loop of `run` with kind and object.
    """

    def __init__(
        self,
        records: SiteFolder | None,
        *,
        coordinator: Address | None = None,
        rangers: Mapping[str, Address] | None = None,
        journal: str | None = None,
        network: ConnectionMaker | None = None,
        key: str | None = None,
        clock: Clock | None = None,
    ):
        self.clock = clock or SystemClock()
        self.listeners: list[Listener] = []
        self._place = journal
        self._opened: History | None = None
        self._consoles = dict(rangers or {})
        self._network, self._key = network, key
        if records is None:
            records = self._journal().site()
        self.map = SiteMap(records)
        self.port: SitePort | None = None
        if coordinator is not None:
            self.port = SitePort(
                coordinator,
                rangers=records.rangers,
                clock=self.clock,
                tell=self._tell,
                network=network,
                key=key,
            )
            self.port.keeps_points = journal is None

    # Running ---------------------------------------------------------------------------------------------------------

    async def run(self) -> None:
        """Watch until cancelled; whatever the site does, it goes on."""
        if self.port is not None:
            await self.port.run()
            return
        while True:
            with suppress(InputError):
                self._tell("state", await asyncio.to_thread(self.state))
            await asyncio.sleep(HISTORY_PERIOD)

    def _tell(self, kind: str, item: Object) -> None:
        for listener in self.listeners:
            listener(kind, item)

    @property
    def history(self) -> bool:
        """True if a journal is watched."""
        return self._place is not None

    def now(self) -> float:
        """Present MJD."""
        return ticks_now(self.clock) / TICKS_PER_DAY

    def _journal(self) -> History:
        """The journal, opened when it is first needed.

        Raises InputError without one, or while it cannot be opened.
        """
        if self._place is None:
            raise InputError("there is no history: no journal is watched (expected --journal)")
        if self._opened is None:
            self._opened = History(self._place)
        return self._opened

    # Answers ---------------------------------------------------------------------------------------------------------

    def site(self) -> Object:
        """Map of the site, its runs, and the span of its history."""
        runs: list[Object] = []
        since = until = None
        if self._place is not None:
            with suppress(InputError):
                runs = self._journal().runs()
                since, until = self._journal().span()
        return self.map.to_object() | {"runs": runs, "since": since, "until": until}

    def state(self, at: float | None = None) -> Object:
        """State of the site: live, or of the journal at an MJD."""
        if at is None and self.port is not None:
            return self.port.state()
        return self._journal().state(self.now() if at is None else at, self.map) | {"received": self.now()}

    def epochs(self, since: float | None = None, until: float | None = None, limit: int = 200) -> Object:
        """Summaries of epochs, oldest first, at most `limit` of the latest."""
        if self._place is not None:
            return self._journal().epochs(since, until, limit)
        return {"epochs": _within(list(self._past.epochs), since, until, limit)}

    def events(
        self,
        since: float | None = None,
        until: float | None = None,
        severity: str | None = None,
        limit: int = 500,
    ) -> Object:
        """Events as columns, oldest first, at most `limit` of the latest.

        severity   the least: debug, note, warning or alarm
        """
        from catseye.service.watch.entries import rows_to_columns
        from catseye.service.watch.history import EVENT, least_severities

        if self._place is not None:
            return self._journal().events(since, until, severity, limit)
        chosen = least_severities(severity)
        rows = [event for event in self._past.events if event["severity"] in chosen]
        return rows_to_columns(EVENT, _within(rows, since, until, limit))

    @property
    def _past(self) -> Any:
        assert self.port is not None
        return self.port.past


def _within(rows: list[Object], since: float | None, until: float | None, limit: int) -> list[Object]:
    """Rows of a span, at most so many of the latest."""
    rows = [r for r in rows if (since is None or r["mjd"] >= since) and (until is None or r["mjd"] <= until)]
    return rows[-limit:] if limit > 0 else []
