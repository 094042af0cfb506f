"""Samplers of a journal at any time: the rows that the coordinator held then, but HEALTH, which no journal has."""

from bisect import bisect_right
from collections import OrderedDict
from collections.abc import Iterator
from itertools import islice

from sqlalchemy import text

from catseye.coordinator.journal.entries import AnsweredShot, Entry, EpochSolution
from catseye.coordinator.journal.reader import Kind
from catseye.coordinator.parts import TICKS_PER_SECOND
from catseye.coordinator.samplers.columns import COLUMNS
from catseye.coordinator.samplers.corrections import CorrectionOutput
from catseye.coordinator.samplers.pose_rows import Row
from catseye.coordinator.samplers.rings import MOVED, PARAMETERS_ACTIVE, RING_LENGTH, points_of, rows_of
from catseye.coordinator.samplers.surface import FEWEST, surface_row
from catseye.errors import InputError
from catseye.records.night.live import TICKS_PER_DAY, Happening
from catseye.reduction.surface.epoch_surface import dish_rows
from catseye.service.watch.entries import Object, words
from catseye.service.watch.history import History
from catseye.service.watch.index import first_seq
from catseye.service.watch.samplers import rows_object
from catseye.service.watch.solutions import Key, answer_of

TABLES: dict[str, Kind] = {
    "RANGES": "shots",
    "POSTURE": "postures",
    "WEATHER": "weather",
    "EVENTS": "happenings",
    "MOVES": "happenings",
}
MOST_SHAPES = 60  # surfaces of an answer, the latest: each is a fit
SHAPES_KEPT = 2000
PIECE = 4000  # events looked through at a time
CHANGES = text(
    "SELECT seq, ticks, who, kind, details FROM happenings "
    "WHERE run = :run AND seq < :high AND kind IN (:moved, :active) ORDER BY seq"
)


class JournalSamplers:
    """Samplers of a journal's runs.

    history   answers from the journal
    """

    def __init__(self, history: History):
        self._history = history
        self._shapes: OrderedDict[tuple[int, int], Row | None] = OrderedDict()

    def values(self, name: str, at: float, limit: int) -> Object:
        """Last values of a sampler at an MJD as columns, oldest first.

        Raises InputError: an unknown sampler, one that no journal has, a limit outside 1 to 4096.
        """
        if name not in COLUMNS:
            raise InputError(f"{name[:20]!a} is not a sampler (expected one of {' '.join(COLUMNS)})")
        if name == "HEALTH":
            raise InputError("HEALTH is not in a journal (expected another sampler, or a living site)")
        if not 1 <= limit <= RING_LENGTH:
            raise InputError(f"n '{limit}' is not 1 to {RING_LENGTH}")
        rows = self._table_rows(name, at) if name in TABLES else self._solution_rows(name, at, limit)
        return rows_object(name, list(islice(rows, limit))[::-1])

    def _table_rows(self, name: str, at: float) -> Iterator[Row]:
        """Rows of the entries of one table, the latest first."""
        run, ticks = self._history.index.run(at=at).run, round(at * TICKS_PER_DAY)
        for stretch in self._history.index.stretches(TABLES[name], None, at, run=run):
            high = stretch.high
            while high > stretch.low:
                low = max(stretch.low, high - PIECE)
                events = stretch.part.events(run, low - 1, until=high - 1, kinds=[TABLES[name]], buffers=False)
                entries = [entry for _, entry in events if _ticks_of(entry) <= ticks]
                for entry in reversed(entries):
                    yield from (row for sampler, row in rows_of(entry) if sampler == name)
                high = low

    def _solution_rows(self, name: str, at: float, limit: int) -> Iterator[Row]:
        """Rows of the epochs, the latest first."""
        run = self._history.index.run(at=at)
        keys = self._history.solutions.keys(run.started / TICKS_PER_DAY, at, run.run)[-limit:]
        if name == "CORRECTIONS":
            yield from reversed(self._corrections(keys, at))
        elif name == "SURFACE":
            shapes = (self._shape(key) for key in keys[-MOST_SHAPES:][::-1])
            yield from (row for row in shapes if row is not None)
        elif name == "POINTS":
            for key in reversed(keys):
                for solution in self._solved([key]):
                    whole = EpochSolution(key.ticks, solution.answer, self._history.solutions.covariance(key))
                    yield from (point.row() for point in reversed(list(points_of(whole))))
        else:
            for solution in reversed(list(self._solved(keys))):
                yield from (row for sampler, row in reversed(list(rows_of(solution))) if sampler == name)

    def _solved(self, keys: list[Key]) -> Iterator[EpochSolution]:
        """Solutions with an answer, without covariance, in the order of the keys."""
        for key, answer in self._history.solutions.answers(keys):
            if answer:
                yield EpochSolution(key.ticks, answer)

    def _shape(self, key: Key) -> Row | None:
        """Row of SURFACE of one epoch, fitted once; None with too few prisms."""
        place = (key.run, key.seq)
        if place not in self._shapes:
            self._shapes[place] = None
            site = self._history.index.site(key.run)
            for solution in self._solved([key]):
                covariance = self._history.solutions.covariance(key)
                if covariance is not None and len(dish_rows(solution.answer.get("names") or (), site)) >= FEWEST:
                    self._shapes[place] = surface_row(EpochSolution(key.ticks, solution.answer, covariance), site)
            while len(self._shapes) > SHAPES_KEPT:
                self._shapes.popitem(last=False)
        return self._shapes.get(place)

    def _corrections(self, keys: list[Key], at: float) -> list[Row]:
        """Rows of CORRECTIONS of some epochs: their zero, the moves since, and the parameter as it was then."""
        if not keys:
            return []
        run = keys[0].run
        changes = list(self._changes(run, at))
        switches = [(seq, change.details["corrections"]) for seq, change in changes if "corrections" in change.details]
        state = {"given": True}
        output = CorrectionOutput(lambda: state["given"])
        rows: list[Row] = []
        for key, answer in self._history.solutions.answers(keys):
            if not answer:
                continue
            if not rows:
                self._begin(output, run, answer.get("reference", 0))
            while changes and changes[0][0] < key.seq:
                output.row(changes.pop(0)[1])
            before = bisect_right(switches, key.seq, key=lambda switch: switch[0])
            state["given"] = before == 0 or switches[before - 1][1] == "on"
            row = output.row(EpochSolution(key.ticks, answer))
            rows += [] if row is None else [row]
        return rows

    def _begin(self, output: CorrectionOutput, run: int, reference: int) -> None:
        """Let the output see the reference epoch, as the coordinator's did."""
        if reference > 0:
            output.row(self._history.solutions.solution(reference, run=run)[1])

    def _changes(self, run: int, at: float) -> Iterator[tuple[int, Happening]]:
        """Moves of other actuators, and sets of parameters from which on they were in force, with their seq."""
        for part in self._history.index.parts(run):
            with part.reading() as connection:
                high = first_seq(connection, "happenings", run, round(at * TICKS_PER_DAY + TICKS_PER_SECOND))
                asked = {"run": run, "high": high, "moved": MOVED, "active": PARAMETERS_ACTIVE}
                for seq, ticks, who, kind, details in connection.execute(CHANGES, asked):
                    yield int(seq), Happening(int(ticks), words(who), words(kind), "", details=answer_of(details))


def _ticks_of(entry: Entry) -> int:
    """Instant of an entry of a table of samplers."""
    return entry.shot.ticks if isinstance(entry, AnsweredShot) else entry.ticks
