"""State, epochs and events of a site from its journal, at any time."""

import threading
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from sqlalchemy import Connection, text

from catseye.coordinator.condition import NO_SHOT
from catseye.coordinator.parts import TICKS_PER_SECOND
from catseye.errors import InputError
from catseye.records.night.live import TICKS_PER_DAY
from catseye.records.site.folder import SiteFolder
from catseye.service.watch.entries import (
    EVENT,
    POSTURE,
    SHOT,
    WEATHER,
    Object,
    columns,
    keyed,
    mjd_of,
    numbers,
    words,
)
from catseye.service.watch.index import JournalIndex, first_seq, limits
from catseye.service.watch.site_map import SiteMap
from catseye.service.watch.solutions import Solutions, answer_of, spread

MINUTE_TICKS = TICKS_PER_DAY // 1440  # 0.4 ticks short of a minute
SEVERITIES = ("debug", "note", "warning", "alarm")
MOST_ROWS = 20_000  # of any answer
MOST_UNSOLVED = 50  # solutions without an answer among the latest epochs
LOOKED_BACK = 3000  # events searched for the mode at a time
WORDS = {"good": "well", "doubtful": "impaired", "failed": "alarm"}  # site's word by the epoch's verdict
EVENTS = "SELECT ticks, severity, who, kind, text FROM happenings WHERE run = :run AND seq >= :low AND seq < :high "
SHOT_COUNTS = text(
    "SELECT ranger, (ticks - :since) / :width AS bin, "
    "SUM(CASE WHEN status IN ('used', 'reference') THEN 1 ELSE 0 END), COUNT(*) FROM shots "
    "WHERE run = :run AND seq >= :low AND seq < :high AND ticks >= :since AND ticks < :until GROUP BY ranger, bin"
)
DETAILS = text(
    "SELECT who, kind, details FROM happenings WHERE run = :run AND seq < :high ORDER BY seq DESC LIMIT :limit"
)
LAST_SHOT = text(
    "SELECT number, ticks, ranger, target, status, range_m, u_range_m, misfit_m FROM shots "
    "WHERE run = :run AND ranger = :ranger AND ticks <= :ticks ORDER BY ticks DESC LIMIT 1"
)
LAST_POSTURE = text(
    "SELECT ticks, azimuth_rad, elevation_rad, azimuth_rate_rad_s, elevation_rate_rad_s FROM postures "
    "WHERE run = :run AND seq < :high ORDER BY seq DESC LIMIT 1"
)
LAST_WEATHER = text(
    "SELECT ticks, station, temperature_c, pressure_hpa, humidity_percent FROM weather "
    "WHERE run = :run AND seq < :high ORDER BY seq DESC LIMIT 300"
)


Counts = dict[tuple[str, int], tuple[int, int]]
PointRow = tuple[float, Sequence[float], Sequence[Any], Sequence[Any], int]


class History:
    """Answers from a journal.

    Raises InputError: no journal there, or an unreadable one.
    """

    def __init__(self, place: str):
        self.index = JournalIndex(place)
        self._counting = threading.Lock()
        self._minutes: Counts = {}
        self._counted: dict[tuple[str, int], int] = {}  # seq up to which the shots of a file's run are counted
        self.solutions = Solutions(self.index)

    def site(self) -> SiteFolder:
        """Records of the last run."""
        return self.index.site()

    def runs(self) -> list[Object]:
        """Runs with their starts and ends."""
        return [
            {"run": run.run, "uuid": run.uuid, "started": mjd_of(run.started), "ended": mjd_of(run.ended)}
            for run in self.index.runs()
        ]

    def span(self) -> tuple[float | None, float | None]:
        """MJD of the first run's start and of the last event."""
        runs = self.index.runs()
        last = runs[-1]
        until = last.ended or last.started
        for table in ("postures", "shots"):
            for stretch in self.index.stretches(table, None, None, run=last.run):
                query = text(f"SELECT ticks FROM {table} WHERE run = :run AND seq = :seq")
                with stretch.part.reading() as connection:
                    ticks = connection.execute(query, {"run": last.run, "seq": stretch.high - 1}).scalar()
                until = max(until, int(ticks or 0))
                break
        return mjd_of(runs[0].started), mjd_of(until)

    # Epochs ----------------------------------------------------------------------------------------------------------

    def epochs(self, since: float | None, until: float | None, limit: int) -> Object:
        """Summaries of solved epochs, oldest first."""
        return {"epochs": self.latest_epochs(since, until, require_limit(limit))[::-1]}

    def latest_epochs(self, since: float | None, until: float | None, limit: int) -> list[Object]:
        """Summaries of solved epochs, the latest first."""
        keys = self.solutions.keys(since, until)[-limit - MOST_UNSOLVED :]
        return self.solutions.summaries(keys)[::-1][:limit]

    def spread_epochs(self, since: float | None, until: float | None, most: int) -> list[Object]:
        """Summaries of a span's epochs, oldest first; at even distances if there are more."""
        return self.solutions.summaries(spread(self.solutions.keys(since, until), most))

    def spread_answers(self, since: float | None, until: float | None, most: int) -> Iterator[tuple[float, Any]]:
        """MJD and stored answer of a span's epochs, oldest first; at even distances if there are more."""
        for key, answer in self.solutions.answers(spread(self.solutions.keys(since, until), most)):
            yield (answer.get("ticks") or key.ticks) / TICKS_PER_DAY, answer

    def point_rows(self, name: str, since: float | None, until: float | None, most: int) -> Iterator[PointRow]:
        """MJD, place, u and covariance of a point at each epoch that has it, oldest first, and the epoch's number."""
        rows = []
        for key, answer in self.solutions.answers(spread(self.solutions.keys(since, until), most)):
            names = answer.get("names") or ()
            if name in names:
                at = names.index(name)
                rows.append((key, at, (answer.get("ticks") or key.ticks) / TICKS_PER_DAY, answer["x"][at], answer))
        triangles = self.solutions.triangles([(key, at) for key, at, *_ in rows])
        for (_, _, mjd, place, answer), triangle in zip(rows, triangles, strict=True):
            u = [None if triangle[k] is None else float(np.sqrt(max(triangle[k], 0.0))) for k in (0, 3, 5)]
            yield mjd, place, u, triangle, answer["number"]

    # Counts ----------------------------------------------------------------------------------------------------------

    def counts(self, low: int, high: int, width: int) -> Counts:
        """Good shots and all, by ranger and beginning of a bin, between two ticks."""
        counts: Counts = {}
        for stretch in self.index.stretches("shots", low / TICKS_PER_DAY, high / TICKS_PER_DAY):
            span: Object = {"run": stretch.run, "low": stretch.low, "high": stretch.high}
            with stretch.part.reading() as connection:
                _add(counts, connection, span | {"since": low, "until": high, "width": width})
        return counts

    def minutes(self) -> Counts:
        """Good shots and all of the whole journal, by ranger and minute; each shot is counted once and remembered."""
        with self._counting:
            for stretch in self.index.stretches("shots", None, None):
                place = str(stretch.part.place), stretch.run
                start = max(stretch.low, self._counted.get(place, 0))
                if start < stretch.high:
                    span: Object = {"run": stretch.run, "low": start, "high": stretch.high}
                    with stretch.part.reading() as connection:
                        _add(self._minutes, connection, span | {"since": 0, "until": 2**62, "width": MINUTE_TICKS})
                    self._counted[place] = stretch.high
            return dict(self._minutes)

    # Events ----------------------------------------------------------------------------------------------------------

    def events(self, since: float | None, until: float | None, severity: str | None, limit: int) -> Object:
        """Events as columns, oldest first."""
        chosen, (low, high) = least_severities(severity), limits(since, until)
        limit = require_limit(limit)
        places = ", ".join(f":s{k}" for k in range(len(chosen)))
        query = text(
            f"{EVENTS} AND severity IN ({places}) AND ticks >= :since AND ticks <= :until "
            "ORDER BY seq DESC LIMIT :limit"
        )
        rows: list[Sequence[Any]] = []
        for stretch in self.index.stretches("happenings", since, until):
            values: Object = {"run": stretch.run, "low": stretch.low, "high": stretch.high, "since": low, "until": high}
            values |= {"limit": limit - len(rows)} | {f"s{k}": word for k, word in enumerate(chosen)}
            with stretch.part.reading() as connection:
                rows += connection.execute(query, values)
            if len(rows) >= limit:
                break
        return columns(EVENT, [(mjd_of(ticks), *map(words, others)) for ticks, *others in reversed(rows)])

    # State -----------------------------------------------------------------------------------------------------------

    def state(self, at: float, site: SiteMap) -> Object:
        """State of the site at an MJD, as far as the journal has it."""
        ticks = round(at * TICKS_PER_DAY)
        run = self.index.run(at=at)
        parts = tuple(reversed(self.index.parts(run.run)))
        last = self._last_shots(run.run, parts, site.site.rangers, ticks)
        posture, weather = self.surroundings(run.run, parts, ticks)
        epoch = next(iter(self.latest_epochs(mjd_of(run.started), at, 1)), None)
        mode, holder = self._mode(run.run, parts, ticks)
        newest = max((shot["mjd"] for shot in last.values()), default=None)
        ended = run.ended is not None and run.ended <= ticks
        quiet = newest is None or (at - newest) * TICKS_PER_DAY / TICKS_PER_SECOND > NO_SHOT
        verdict = None if epoch is None else epoch["verdict"]
        word = "stopped" if ended or quiet else WORDS.get(verdict or "", "starting")
        problems = []
        if epoch is not None and verdict != "good":
            severity = "alarm" if verdict == "failed" else "warning"
            unknown = dict.fromkeys(("acknowledged_by", "acknowledged_at", "shelved_by", "shelved_until"))
            words_of_it = f"epoch {epoch['number']} {verdict}: {epoch['verdict_text']}"
            problems.append({"id": "epoch", "severity": severity, "text": words_of_it, "since": epoch["mjd"]} | unknown)
        numbered = max((shot["number"] for shot in last.values()), default=0)
        return {
            "mjd": at,
            "received": None,
            "source": "journal",
            "connected": True,
            "trouble": None,
            "word": word,
            "mode": mode,
            "round": None,
            "shots": {"numbered": numbered, "acknowledged": numbered},
            "telescope": None if posture is None else "known",
            "clock": None,
            "disk": None,
            "journal": "well",
            "lease": holder,
            "problems": problems,
            "verdict": verdict,
            "verdict_text": None if epoch is None else epoch["verdict_text"],
            "epoch": epoch,
            "posture": posture,
            "weather": weather,
            "sun": None,
            "rangers": [_ranger(name, last.get(name), at) for name in site.site.rangers],
        }

    def _last_shots(self, run: int, parts: Sequence[Any], rangers: Sequence[str], ticks: int) -> dict[str, Object]:
        """Last shot of each ranger up to an instant."""
        last: dict[str, Object] = {}
        for part in parts:
            with part.reading() as connection:
                for name in set(rangers) - set(last):
                    row = connection.execute(LAST_SHOT, {"run": run, "ranger": name, "ticks": ticks}).first()
                    if row is not None:
                        last[name] = shot_object(row)
            if len(last) == len(rangers):
                break
        return last

    def surroundings(self, run: int, parts: Sequence[Any], ticks: int) -> tuple[Object | None, list[Object]]:
        """Last posture, and each station's last reading, up to an instant."""
        posture: Object | None = None
        weather: dict[str, Object] = {}
        for part in parts:
            with part.reading() as connection:
                if posture is None:
                    high = first_seq(connection, "postures", run, ticks + 1)
                    row = connection.execute(LAST_POSTURE, {"run": run, "high": high}).first()
                    posture = None if row is None else keyed(POSTURE, (mjd_of(row[0]), *numbers(row[1:])))
                high = first_seq(connection, "weather", run, ticks + 1)
                for read, station, *values in connection.execute(LAST_WEATHER, {"run": run, "high": high}):
                    name = words(station)
                    row_values = (mjd_of(read), name, *numbers(values))
                    weather.setdefault(name, keyed(WEATHER, row_values))
            if posture is not None and weather:
                break
        return posture, [weather[name] for name in sorted(weather)]

    def _mode(self, run: int, parts: Sequence[Any], ticks: int) -> tuple[str | None, str | None]:
        """Mode and holder of the lease by the last events that name them; None if not among the last thousands."""
        mode = holder = None
        with parts[0].reading() as connection:
            high = first_seq(connection, "happenings", run, ticks + 1)
            values = {"run": run, "high": high, "limit": LOOKED_BACK}
            for who, kind, details in connection.execute(DETAILS, values):
                if who != "coordinator" or kind not in ("mode", "started", "stopped", "lease"):
                    continue
                stated = answer_of(details)
                mode = mode or ("stopped" if kind == "stopped" else stated.get("mode"))
                holder = holder or stated.get("holder")
                if kind == "started" or (mode and holder):
                    break
        return mode, None if holder in (None, "nobody") else str(holder)


def _add(counts: Counts, connection: Connection, asked: Object) -> None:
    """Add a stretch's shots to counts by ranger and bin."""
    width = asked["width"]
    for ranger, place, fine, count in connection.execute(SHOT_COUNTS, asked):
        key = words(ranger), asked["since"] + int(place) * width
        before = counts.get(key, (0, 0))
        counts[key] = before[0] + int(fine), before[1] + int(count)


def _ranger(name: str, shot: Object | None, at: float) -> Object:
    """A ranger at an MJD by its last shot."""
    age = None if shot is None else (at - shot["mjd"]) * TICKS_PER_DAY / TICKS_PER_SECOND
    word, sign = "idle", "."
    if shot is not None and age is not None and age <= NO_SHOT:
        good = shot["status"] in ("used", "reference")
        word, sign = ("measures", "+") if good else ("last shot failed", "b")
    unknown = dict.fromkeys(("trouble", "shots", "failures", "stream", "next", "next_mjd"))
    last = None if shot is None else {key: shot[key] for key in SHOT if key not in ("mjd", "ranger")}
    mjd = None if shot is None else shot["mjd"]
    return {"name": name, "mjd": mjd, "state": word, "word": word, "sign": sign, "last": last} | unknown


def shot_object(row: Sequence[Any]) -> Object:
    """Shot of a row in the order of `LAST_SHOT`."""
    count, ticks, ranger, target, status, *values = row
    return keyed(SHOT, (count, mjd_of(ticks), *map(words, (ranger, target, status)), *numbers(values)))


def least_severities(severity: str | None) -> tuple[str, ...]:
    """Severities from one on; all but debug if None.

    Raises InputError for another word.
    """
    if severity is None:
        return SEVERITIES[1:]
    if severity not in SEVERITIES:
        raise InputError(f"severity = {severity[:20]!r} (expected {', '.join(SEVERITIES)})")
    return SEVERITIES[SEVERITIES.index(severity) :]


def require_limit(limit: int) -> int:
    """Limit of rows.

    Raises InputError outside 1 to 20 000.
    """
    if not 1 <= limit <= MOST_ROWS:
        raise InputError(f"limit = {limit} (expected 1 to {MOST_ROWS})")
    return limit
