"""Solutions of a journal, found without searching their rows.

A row is about a megabyte, its covariance, and a search in SQLite reads whole rows to compare their keys. So the keys
are read once, in order, and the answers of many epochs in one pass that skips what nobody asked for.
"""

import json
import threading
from bisect import bisect_left, bisect_right
from collections import OrderedDict
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import text

from catseye.coordinator.journal.entries import EpochSolution
from catseye.coordinator.journal.reader import JournalReader
from catseye.errors import InputError
from catseye.service.watch.entries import Object, epoch_summary, words
from catseye.service.watch.index import JournalIndex, limits

MOST_SUMMARIES = 20_000  # epochs remembered, 1 kB each
TOGETHER = 250  # answers of one pass: a parameter each
MOST_PROBES = 40  # of the search for an epoch's number
KEYS = text("SELECT seq, ticks FROM solutions WHERE run = :run AND seq > :seq ORDER BY seq")
ANSWER = text("SELECT ticks, answer FROM solutions WHERE run = :run AND seq = :seq")
MATRIX = text("SELECT size, covariance FROM solutions WHERE run = :run AND seq = :seq")


class Key(NamedTuple):
    """Place of a solution: file, run, seq, and the ticks it is of."""

    part: JournalReader
    run: int
    seq: int
    ticks: int


class Solutions:
    """All solutions of a journal."""

    def __init__(self, index: JournalIndex):
        self._index = index
        self._lock = threading.Lock()
        self._keys: dict[tuple[str, int], list[Key]] = {}
        self._summaries: OrderedDict[tuple[int, int], Object | None] = OrderedDict()

    def keys(self, since: float | None = None, until: float | None = None, run: int | None = None) -> list[Key]:
        """Solutions of a span of MJD, oldest first."""
        low, high = limits(since, until)
        runs = self._index.runs_between(since, until) if run is None else [self._index.run(run)]
        chosen: list[Key] = []
        for each in runs:
            for part in self._index.parts(each.run):
                keys = self._of_file(part, each.run)
                first = bisect_left(keys, low, key=_ticks)
                chosen += keys[first : bisect_right(keys, high, lo=first, key=_ticks)]
        return chosen

    def _of_file(self, part: JournalReader, run: int) -> list[Key]:
        """Solutions of a run in one file, in order; only new ones are read."""
        with self._lock:
            keys = self._keys.setdefault((str(part.place), run), [])
            last = keys[-1].seq if keys else 0
            with part.reading() as connection:
                rows = connection.execute(KEYS, {"run": run, "seq": last}).all()
            keys += [Key(part, run, int(seq), int(ticks)) for seq, ticks in rows]
            return list(keys)

    def answers(self, keys: Sequence[Key]) -> Iterator[tuple[Key, Any]]:
        """Stored answers of some solutions, in their order; {} where nothing was solved."""
        for group in _groups(keys):
            first, last = group[0], group[-1]
            chosen = {f"s{k}": key.seq for k, key in enumerate(group)}
            query = text(
                f"SELECT seq, CASE WHEN seq IN ({_places(chosen)}) THEN answer END FROM solutions "
                "WHERE run = :run AND seq >= :low AND seq <= :high ORDER BY seq"
            )
            span = {"run": first.run, "low": first.seq, "high": last.seq}
            with first.part.reading() as connection:
                cells = {int(seq): cell for seq, cell in connection.execute(query, span | chosen) if cell is not None}
            for key in group:
                yield key, answer_of(cells.get(key.seq, ""))

    def summaries(self, keys: Sequence[Key]) -> list[Object]:
        """Summaries of solved epochs, in their order."""
        unread = [key for key in keys if (key.run, key.seq) not in self._summaries]
        for key, answer in self.answers(unread):
            summary = None
            if answer:
                place = {"run": key.run, "seq": key.seq}
                summary = epoch_summary(EpochSolution(key.ticks, answer)) | place
            self._summaries[key.run, key.seq] = summary
        rows = [self._summaries.get((key.run, key.seq)) for key in keys]
        while len(self._summaries) > MOST_SUMMARIES:
            self._summaries.popitem(last=False)
        return [row for row in rows if row is not None]

    def triangles(self, rows: Sequence[tuple[Key, int]]) -> Iterator[list[Any]]:
        """Covariance of one point in each of some solutions: six numbers, None where there is none.

        rows   solution, and row of the point in it
        """
        at = {(key.run, key.seq): row for key, row in rows}
        for group in _groups([key for key, _ in rows]):
            first, last = group[0], group[-1]
            chosen = {f"s{k}": key.seq for k, key in enumerate(group)}
            offsets = {f"o{k}": 3 * at[key.run, key.seq] for k, key in enumerate(group)}
            row = " ".join(f"WHEN :s{k} THEN :o{k}" for k in range(len(group)))
            at_byte = f"CAST(1 + 8 * (size + 1) * (CASE seq {row} END) AS INTEGER)"
            query = text(
                f"SELECT seq, size, CASE WHEN seq IN ({_places(chosen)}) THEN substr(covariance, {at_byte}, "
                "CAST(8 * (2 * size + 3) AS INTEGER)) END FROM solutions "
                "WHERE run = :run AND seq >= :low AND seq <= :high ORDER BY seq"
            )
            span = {"run": first.run, "low": first.seq, "high": last.seq}
            with first.part.reading() as connection:
                found = {int(s): (n, piece) for s, n, piece in connection.execute(query, span | chosen | offsets)}
            for key in group:
                yield _triangle(*found.get(key.seq, (0, None)))

    def solution(self, number: int, *, run: int | None = None, at: float | None = None) -> tuple[Key, EpochSolution]:
        """Solution of an epoch without its covariance, and its place.

        Raises InputError for an unknown epoch.
        """
        which = self._index.run(run, at).run
        key = self._key_of(self.keys(run=which), number)
        if key is None:
            raise InputError(f"epoch {number} is not in run {which} of the journal (expected one of its epochs)")
        with key.part.reading() as connection:
            row = connection.execute(ANSWER, {"run": key.run, "seq": key.seq}).one()
        return key, EpochSolution(row.ticks, answer_of(row.answer))

    def covariance(self, key: Key) -> NDArray[np.float64] | None:
        """Covariance (3n, 3n) m^2 of a solution; None where none is stored."""
        with key.part.reading() as connection:
            row = connection.execute(MATRIX, {"run": key.run, "seq": key.seq}).one()
        if row.covariance is None or len(row.covariance) != 8 * row.size**2:
            return None
        return np.frombuffer(row.covariance, dtype="<f8").reshape(row.size, row.size)

    def _key_of(self, keys: Sequence[Key], number: int) -> Key | None:
        """Place of an epoch's number: the k-th solution has at most k, less by those without an answer before it."""
        at = number - 1
        for _ in range(MOST_PROBES):
            if not 0 <= at < len(keys):
                return None
            behind = next((row for k in range(at, len(keys)) for row in self.summaries([keys[k]])), None)
            if behind is None or behind["number"] > number:
                return None
            at = next(k for k in range(at, len(keys)) if keys[k].seq == behind["seq"])
            if behind["number"] == number:
                return keys[at]
            at += number - behind["number"]
        return None


def spread(keys: Sequence[Key], most: int) -> list[Key]:
    """Keys at even distances, the last among them, at most so many."""
    step = max(1, -(-len(keys) // most))
    return list(keys[::-1][::step][::-1])


def answer_of(cell: Any) -> Any:
    """JSON object of a cell; empty where it is damaged."""
    try:
        answer = json.loads(words(cell))
    except (ValueError, RecursionError):
        return {}
    return answer if isinstance(answer, dict) else {}


def _ticks(key: Key) -> int:
    return key.ticks


def _groups(keys: Sequence[Key]) -> Iterator[list[Key]]:
    """Neighbours in one run and file, a few hundred together."""
    group: list[Key] = []
    for key in keys:
        if group and (key.part is not group[0].part or key.run != group[0].run or len(group) == TOGETHER):
            yield group
            group = []
        group.append(key)
    if group:
        yield group


def _places(chosen: Object) -> str:
    return ", ".join(f":{name}" for name in chosen)


def _triangle(size: Any, piece: Any) -> list[Any]:
    """Covariance of one point from its rows of a matrix."""
    cells = np.frombuffer(bytes(piece or b""), dtype="<f8") if len(piece or b"") % 8 == 0 else np.empty(0)
    if size and len(cells) == 2 * size + 3:
        return [float(cells[i * size + j]) for i in range(3) for j in range(i, 3)]
    return [None] * 6
