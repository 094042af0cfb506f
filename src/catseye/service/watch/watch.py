"""Watch of a site: live state from the coordinator's port, everything else from the journal."""

import asyncio
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from catseye.clock import Clock, SystemClock
from catseye.coordinator.parts import ticks_now
from catseye.errors import InputError
from catseye.ranger.line import Reply
from catseye.ranger.network import ConnectionMaker
from catseye.records.night.live import TICKS_PER_DAY
from catseye.records.site.folder import SiteFolder
from catseye.service.watch.commands import LOOK, CommandDesk, Consoles
from catseye.service.watch.entries import EVENT, SHOT, Object, rows_to_columns
from catseye.service.watch.history import History, least_severities, require_limit
from catseye.service.watch.port import SitePort
from catseye.service.watch.recent_series import recent_dropped, recent_names, recent_series
from catseye.service.watch.samplers import parameters_object, sampler_object, samplers_object
from catseye.service.watch.series import dropped_object, series_names, series_object
from catseye.service.watch.site_map import SiteMap

if TYPE_CHECKING:
    from catseye.service.watch.epochs import EpochRecord
    from catseye.service.watch.journal_samplers import JournalSamplers

Address = tuple[str, int]
Listener = Callable[[str, Object], None]
MOST_BEAMS = 5000
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
        self._past_samplers: JournalSamplers | None = None
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
        self._desk: CommandDesk | None = None  # made on the loop
        self._rooms: Consoles | None = None

    # Running ---------------------------------------------------------------------------------------------------------

    async def run(self) -> None:
        """Watch until cancelled; whatever the site does, it goes on."""
        if self.port is None:
            await self._run_journal()
            return
        tending = asyncio.ensure_future(self._tend())
        try:
            await self.port.run()
        finally:
            tending.cancel()
            await asyncio.gather(tending, return_exceptions=True)
            if self._rooms is not None:
                self._rooms.close()

    async def _run_journal(self) -> None:
        while True:
            with suppress(InputError):
                self._tell("state", await asyncio.to_thread(self.state))
            await asyncio.sleep(HISTORY_PERIOD)

    async def _tend(self) -> None:
        """Give back idle leases, and close idle consoles."""
        while True:
            await asyncio.sleep(LOOK)
            with suppress(InputError, TimeoutError):
                if self._desk is not None:
                    await self._desk.give_back()
            if self._rooms is not None:
                self._rooms.close_idle()

    def _tell(self, kind: str, item: Object) -> None:
        for listener in self.listeners:
            listener(kind, item)

    @property
    def history(self) -> bool:
        """True if a journal is watched."""
        return self._place is not None

    def now(self) -> float:
        """Present time of the watch, MJD."""
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

    # Commands --------------------------------------------------------------------------------------------------------

    async def command(self, name: str, parameters: Sequence[str], who: str) -> Object:
        """Command to the coordinator by a person: its values, when, and from whom the lease was taken.

        Raises InputError with the site's own words if it refuses, or is not connected.
        """
        return await self._commands().command(name, parameters, who)

    async def acknowledge(self, alarm: str, who: str) -> Object:
        """Acknowledge an alarm, as a person."""
        return await self._commands().alarm("ACK", alarm, who)

    async def shelve(self, alarm: str, who: str, minutes: float) -> Object:
        """Shelve an alarm for some minutes."""
        return await self._commands().alarm("SHELVE", alarm, f"{minutes:g}", who)

    async def unshelve(self, alarm: str, who: str) -> Object:
        """End an alarm's shelving."""
        return await self._commands().alarm("UNSHELVE", alarm, who)

    async def console(self, ranger: str, line: str, who: str) -> Object:
        """Replies of a ranger to one line of a person."""
        if self._rooms is None:
            self._rooms = Consoles(self._consoles, self._network, self._key)
        return await self._rooms.say(ranger, line, who)

    async def parameters(self) -> Object:
        """Parameters of the coordinator: value, value that waits, legal values; and their interlocks."""
        return parameters_object(await self._asked("PARAMETERS"), await self._asked("INTERLOCKS"))

    async def samplers(self) -> Object:
        """Samplers of the coordinator: values kept, columns."""
        return samplers_object(await self._asked("SAMPLERS"))

    async def sampler(self, name: str, limit: int = 1, at: float | None = None) -> Object:
        """Last values of a sampler as columns, oldest first; of the journal at an MJD, or without a living site."""
        if at is not None or self.port is None:
            return await asyncio.to_thread(self._past_sampler, name.upper(), limit, at)
        return sampler_object(name.upper(), await self._asked("SAMPLER", name, limit))

    async def _asked(self, command: str, *parameters: object) -> list[Reply]:
        """Replies of the coordinator; raises InputError where only a journal is watched, or it refuses."""
        if self.port is None:
            raise InputError("a journal has no parameters, and its samplers no list (expected a living site)")
        return await self.port.answers(command, *parameters)

    def _past_sampler(self, name: str, limit: int, at: float | None) -> Object:
        """Last values of a sampler by the journal."""
        from catseye.service.watch.journal_samplers import JournalSamplers

        if self._past_samplers is None:
            self._past_samplers = JournalSamplers(self._journal())
        return self._past_samplers.values(name, self._instant(at), limit)

    def _commands(self) -> CommandDesk:
        """Desk for commands; raises InputError where only a journal is watched."""
        if self.port is None:
            raise InputError("a journal takes no commands (expected a living site)")
        if self._desk is None:
            port = self.port
            self._desk = CommandDesk(lambda: port.client, self.clock)
        return self._desk

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
        return self._journal().state(self._instant(at), self.map) | {"received": self.now()}

    def epochs(self, since: float | None = None, until: float | None = None, limit: int = 200) -> Object:
        """Summaries of epochs, oldest first, at most `limit` of the latest."""
        if self._place is not None:
            return self._journal().epochs(since, until, limit)
        return {"epochs": _within(list(self._past.epochs), since, until, limit)}

    def epoch(self, number: int, run: int | None = None, at: float | None = None) -> Object:
        """One epoch: points with covariance, beams, air, zeros, posed structure."""
        if self._place is None:
            return self._live_epoch(number)
        from catseye.service.watch.epochs import epoch_object

        return epoch_object(self._epoch(number, run, at), self.map)

    def residuals(self, number: int, run: int | None = None, at: float | None = None) -> Object:
        """Residual of each shot of an epoch."""
        from catseye.service.watch.epochs import residuals_object

        return residuals_object(self._epoch(number, run, at), self.map)

    def air(self, epoch: int | None = None, run: int | None = None, at: float | None = None) -> Object:
        """Air along the paths of an epoch, the last if None."""
        from catseye.service.watch.epochs import air_object

        history = self._journal()
        record = self._epoch(self._last_epoch(at) if epoch is None else epoch, run, at)
        parts = tuple(reversed(history.index.parts(record.run)))
        return air_object(record, self.map, history.surroundings(record.run, parts, record.solution.ticks)[1])

    def surface(self, epoch: int | None = None, run: int | None = None, at: float | None = None) -> Object:
        """Shape of the dish by the prisms of an epoch, the last if None."""
        from catseye.service.watch.epochs import surface_object

        return surface_object(self._epoch(self._last_epoch(at) if epoch is None else epoch, run, at), self.map)

    def comparison(self, first: int, second: int, run: int | None = None, at: float | None = None) -> Object:
        """Movement of the points that two epochs of a run share."""
        from catseye.service.watch.epochs import comparison_object

        return comparison_object(self._epoch(first, run, at), self._epoch(second, run, at), self.map)

    def series(
        self, names: Sequence[str], since: float | None = None, until: float | None = None, most: int = 2000
    ) -> Object:
        """Series by name, at most `most` values or bins each."""
        if self._place is None:
            return recent_series(self._past, names, since, until, most)
        return series_object(self._journal(), names, since, until, most)

    def series_names(self) -> Object:
        """Names of all series with labels and units."""
        if self._place is None:
            return recent_names(self._past)
        return series_names(self._journal(), self.map)

    def dropped(self, since: float | None = None, until: float | None = None, bins: int = 200) -> Object:
        """Good and failed shots of each ranger in bins of time."""
        if self._place is None:
            return recent_dropped(self._past, self.map, since, until, bins)
        return dropped_object(self._journal(), self.map, since, until, bins)

    def shots(
        self,
        *,
        ranger: str | None = None,
        target: str | None = None,
        epoch: int | None = None,
        status: str | None = None,
        since: float | None = None,
        until: float | None = None,
        limit: int = 500,
    ) -> Object:
        """Columns of shots, oldest first, the latest `limit` that fit."""
        from catseye.service.watch.shots import shots_object

        if self._place is None:
            wanted = {"ranger": ranger, "target": target, "status": status}
            chosen = {key: value for key, value in wanted.items() if value is not None}
            rows = [shot for shot in self._past.shots() if all(shot[key] == value for key, value in chosen.items())]
            return rows_to_columns(SHOT, _within(rows, since, until, require_limit(limit)))
        return shots_object(
            self._journal(),
            ranger=ranger,
            target=target,
            epoch=epoch,
            status=status,
            since=since,
            until=until,
            limit=limit,
        )

    def shot(self, number: int, run: int | None = None, at: float | None = None) -> Object:
        """One shot with the chain of numbers behind its range."""
        from catseye.service.watch.shots import ShotRecord, shot_detail

        return shot_detail(ShotRecord(self._journal(), number, run=run, at=at), self.map)

    def samples(self, number: int, run: int | None = None, at: float | None = None) -> Object:
        """Samples of a shot, spectrum, harmonics, phase of each cycle."""
        from catseye.service.watch.shots import ShotRecord, samples_object

        return samples_object(ShotRecord(self._journal(), number, run=run, at=at))

    def point(self, name: str, since: float | None = None, until: float | None = None) -> Object:
        """One point through the epochs, and its last shots."""
        from catseye.service.watch.points import point_object

        return point_object(self._journal(), self.map, name, since, until)

    def ranger(self, name: str, at: float | None = None) -> Object:
        """One ranger: state, records, certificates, last commands."""
        from catseye.service.watch.points import ranger_object

        history = None if self._place is None else self._journal()
        return ranger_object(history, self.map, name, self.state(at), self._instant(at))

    def calibrations(self, at: float | None = None) -> Object:
        """Certificates of the site's records and their validity."""
        from catseye.service.watch.calibrations import calibrations_object

        return calibrations_object(self.map.site, self._instant(at))

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
        if self._place is not None:
            return self._journal().events(since, until, severity, limit)
        chosen = least_severities(severity)
        rows = [event for event in list(self._past.events) if event["severity"] in chosen]
        return rows_to_columns(EVENT, _within(rows, since, until, limit))

    def _epoch(self, number: int, run: int | None, at: float | None) -> "EpochRecord":
        from catseye.service.watch.epochs import EpochRecord

        return EpochRecord(self._journal(), number, run=run, at=at)

    def _last_epoch(self, at: float | None) -> int:
        """Number of the last epoch at an MJD.

        Raises InputError without any.
        """
        last = next(iter(self._journal().latest_epochs(None, at, 1)), None)
        if last is None:
            raise InputError("no epoch is solved yet (expected one first)")
        return int(last["number"])

    def _instant(self, at: float | None) -> float:
        """MJD asked for; else of the site's live state, or of the journal's end."""
        if at is not None:
            return at
        if self.port is not None:
            return self.port.state()["mjd"] or self.now()
        return self._journal().span()[1] or self.now()

    def _live_epoch(self, number: int) -> Object:
        """The last epoch from the port, where no journal is watched."""
        points = None if self.port is None else self.port.points
        summary = next((e for e in reversed(list(self._past.epochs)) if e["number"] == number), None)
        if points is None or summary is None or points["number"] != number:
            raise InputError(f"epoch {number} is not in memory: only the last is, since no journal is watched")
        columns = points["points"]
        before = [e["mjd"] for e in list(self._past.epochs) if e["mjd"] < summary["mjd"]]
        shots = _within(list(self._past.shots()), max(before, default=None), summary["mjd"], MOST_BEAMS)
        lines = [shot for shot in shots if shot["status"] == "used"]
        nothing: Object = {key: {} for key in ("jitter_mm", "biases")} | {"doubts": [], "notes": [], "rejected": []}
        return (
            summary
            | nothing
            | {
                "points": columns | {"body": [self.map.body(name) for name in columns["name"]]},
                "beams": {
                    **{key: [shot[key] for shot in lines] for key in ("ranger", "target")},
                    "shot": [shot["number"] for shot in lines],
                    "w": [None] * len(lines),
                },
                "structure": self.map.structure(summary["azimuth"], summary["elevation"]),
                "air": {"name": [], "value": [], "u": []},
                "zeros": {"ranger": [], "value": [], "u": []},
                "pose": None,
            }
        )

    @property
    def _past(self) -> Any:
        assert self.port is not None
        return self.port.past


def _within(rows: list[Object], since: float | None, until: float | None, limit: int) -> list[Object]:
    """Rows of a span, at most so many of the latest."""
    rows = [r for r in rows if (since is None or r["mjd"] >= since) and (until is None or r["mjd"] <= until)]
    return rows[-limit:] if limit > 0 else []
