"""State, epochs and events of a site from its journal, at any time."""

import json
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from sqlalchemy import Connection, text

from catseye.coordinator.condition import NO_SHOT
from catseye.coordinator.journal.entries import EpochSolution
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
    epoch_summary,
    mjd_of,
    numbers,
    words,
)
from catseye.service.watch.index import JournalIndex, Stretch, ends_of, first_seq, limits
from catseye.service.watch.site_map import SiteMap

SEVERITIES = ("debug", "note", "warning", "alarm")
MOST_ROWS = 20_000  # of any answer
MOST_SUMMARIES = 20_000  # epochs remembered, 1 kB each
LOOKED_BACK = 3000  # events searched for the mode at a time
WORDS = {"good": "well", "doubtful": "impaired", "failed": "alarm"}  # site's word by the epoch's verdict
SOLUTIONS = text(
    "SELECT seq, ticks, answer FROM solutions WHERE run = :run AND seq >= :low AND seq < :high "
    "ORDER BY seq DESC LIMIT :limit"
)
ONE_SOLUTION = text("SELECT ticks, answer FROM solutions WHERE run = :run AND seq = :seq")
SEQS = text("SELECT seq FROM solutions WHERE run = :run AND seq >= :low AND seq < :high ORDER BY seq")
PIECE = text(
    "SELECT size, substr(covariance, 1 + 8 * (size * :row + :row), 8 * (2 * size + 3)) AS part FROM solutions "
    "WHERE run = :run AND seq = :seq"
)
SOLUTION = text("SELECT ticks, answer, size, covariance FROM solutions WHERE run = :run AND seq = :seq")
EVENTS = "SELECT ticks, severity, who, kind, text FROM happenings WHERE run = :run AND seq >= :low AND seq < :high "
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


PointRow = tuple[float, Sequence[float], Sequence[Any], Sequence[Any], int]


class History:
    """Answers from a journal.

    Raises InputError: no journal there, or an unreadable one.
    """

    def __init__(self, place: str):
        self.index = JournalIndex(place)
        self._summaries: OrderedDict[tuple[int, int], Object | None] = OrderedDict()

    def site(self) -> SiteFolder:
        """Records of the last run."""
        return self.index.site()

    def runs(self) -> list[Object]:
        """Runs with their times."""
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
        return {"epochs": list(reversed(list(self.latest_epochs(since, until, require_limit(limit)))))}

    def latest_epochs(self, since: float | None, until: float | None, limit: int) -> Iterator[Object]:
        """Summaries of solved epochs, the latest first."""
        low, high = limits(since, until)
        count = 0
        for stretch in self.index.stretches("solutions", since, until):
            for seq, ticks, answer in self._solutions(stretch, limit + 50):
                if not low <= ticks <= high:
                    continue
                summary = self._summary(stretch.run, seq, ticks, answer)
                if summary is not None and count < limit:
                    count += 1
                    yield summary
            if count >= limit:
                return

    def _solutions(self, stretch: Stretch, limit: int) -> list[Sequence[Any]]:
        span = {"run": stretch.run, "low": stretch.low, "high": stretch.high, "limit": limit}
        with stretch.part.reading() as connection:
            return list(connection.execute(SOLUTIONS, span))

    def _summary(self, run: int, seq: int, ticks: int, answer: Any) -> Object | None:
        """Summary of a solution, None where nothing was solved."""
        key = run, seq
        if key not in self._summaries:
            solution = EpochSolution(ticks, answer_of(answer))
            self._summaries[key] = (epoch_summary(solution) | {"run": run, "seq": seq}) if solution.answer else None
            if len(self._summaries) > MOST_SUMMARIES:
                self._summaries.popitem(last=False)
        return self._summaries[key]

    def spread_epochs(
        self, since: float | None, until: float | None, most: int
    ) -> Iterator[tuple[Object, Callable[[], Any]]]:
        """Epochs of a span, oldest first: summary, and its answer when called; at even distances if there are more."""
        low, high = limits(since, until)
        for connection, run, seq in self._spread(since, until, most):
            row = connection.execute(ONE_SOLUTION, {"run": run, "seq": seq}).first()
            if row is None or not low <= row.ticks <= high:
                continue
            summary = self._summary(run, seq, row.ticks, row.answer)
            if summary is not None:
                yield summary, partial(answer_of, row.answer)

    def _spread(self, since: float | None, until: float | None, most: int) -> Iterator[tuple[Connection, int, int]]:
        """Connection, run and seq of solutions, oldest first; at even distances if there are more than `most`."""
        seqs: list[tuple[Stretch, list[int]]] = []
        for stretch in reversed(list(self.index.stretches("solutions", since, until))):
            with stretch.part.reading() as connection:
                span = {"run": stretch.run, "low": stretch.low, "high": stretch.high}
                seqs.append((stretch, [int(row[0]) for row in connection.execute(SEQS, span)]))
        step = max(1, -(-sum(len(each) for _, each in seqs) // most))
        for stretch, each in seqs:
            with stretch.part.reading() as connection:
                for seq in each[::-1][::step][::-1]:
                    yield connection, stretch.run, seq

    def point_rows(self, name: str, since: float | None, until: float | None, most: int) -> Iterator[PointRow]:
        """MJD, place, u and covariance of a point at each epoch that has it, oldest first, and the epoch's number."""
        (low, high) = limits(since, until)
        for connection, run, seq in self._spread(since, until, most):
            row = connection.execute(ONE_SOLUTION, {"run": run, "seq": seq}).first()
            if row is None or not low <= row.ticks <= high:
                continue
            stored = answer_of(row.answer)
            names = stored.get("names") or ()
            if name not in names:
                continue
            at = names.index(name)
            triangle = _triangle(connection.execute(PIECE, {"run": run, "seq": seq, "row": 3 * at}).first())
            u = [None if triangle[k] is None else float(np.sqrt(max(triangle[k], 0.0))) for k in (0, 3, 5)]
            mjd = (stored.get("ticks") or row.ticks) / TICKS_PER_DAY
            yield mjd, stored["x"][at], u, triangle, stored["number"]

    def solution(
        self, number: int, *, run: int | None = None, at: float | None = None
    ) -> tuple[int, int, EpochSolution]:
        """Run, seq and solution of an epoch.

        Raises InputError for an unknown epoch.
        """
        which = self.index.run(run, at).run
        for part in self.index.parts(which):
            with part.reading() as connection:
                seq = self._seq_of_epoch(connection, which, number)
                row = None if seq is None else connection.execute(SOLUTION, {"run": which, "seq": seq}).first()
            if row is not None:
                matrix = None
                if row.covariance is not None and len(row.covariance) == 8 * row.size**2:
                    matrix = np.frombuffer(row.covariance, dtype="<f8").reshape(row.size, row.size)
                return which, int(seq or 0), EpochSolution(row.ticks, answer_of(row.answer), matrix)
        raise InputError(f"epoch {number} is not in run {which} of the journal (expected one of its epochs)")

    def _seq_of_epoch(self, connection: Any, run: int, number: int) -> int | None:
        """Seq of the solution with a number; those without an answer have none."""
        query = text("SELECT seq, ticks, answer FROM solutions WHERE run = :run AND seq >= :seq ORDER BY seq LIMIT 1")
        ends = ends_of(connection, "solutions", run)
        if ends is None:
            return None
        low, high = ends[0], ends[1] + 1
        while low < high:
            middle, row = (low + high) // 2, None
            start = middle
            summary = None
            while summary is None:  # skip those without an answer
                row = connection.execute(query, {"run": run, "seq": start}).first()
                if row is None:
                    break
                summary = self._summary(run, row.seq, row.ticks, row.answer)
                start = row.seq + 1
            if summary is None or row is None or summary["number"] > number:
                high = middle
            elif summary["number"] == number:
                return int(row.seq)
            else:
                low = int(row.seq) + 1
        return None

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
                    posture = (
                        None if row is None else dict(zip(POSTURE, (mjd_of(row[0]), *numbers(row[1:])), strict=True))
                    )
                high = first_seq(connection, "weather", run, ticks + 1)
                for read, station, *values in connection.execute(LAST_WEATHER, {"run": run, "high": high}):
                    name = words(station)
                    row_values = (mjd_of(read), name, *numbers(values))
                    weather.setdefault(name, dict(zip(WEATHER, row_values, strict=True)))
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


def _triangle(piece: Any) -> list[Any]:
    """Covariance of one point from its rows of a matrix: six numbers, None where there is none."""
    if piece is not None and piece.size and piece.part is not None:
        cells = np.frombuffer(bytes(piece.part), dtype="<f8")
        if len(cells) == 2 * piece.size + 3:
            return [float(cells[i * piece.size + j]) for i in range(3) for j in range(i, 3)]
    return [None] * 6


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
    return dict(zip(SHOT, (count, mjd_of(ticks), *map(words, (ranger, target, status)), *numbers(values)), strict=True))


def answer_of(cell: Any) -> Any:
    """JSON object of a cell; empty where it is damaged."""
    try:
        answer = json.loads(words(cell))
    except (ValueError, RecursionError):
        return {}
    return answer if isinstance(answer, dict) else {}


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
