"""Replay of runs: numbers bit for bit, texts separately."""

from dataclasses import dataclass, replace
from functools import partial
from types import SimpleNamespace

import numpy as np

from catseye.coordinator.journal.entries import CLOCK_CORRECTED, EPOCH_START, AnsweredShot, Document, EpochSolution
from catseye.coordinator.journal.reader import JournalReader
from catseye.coordinator.journal.replay import replay
from catseye.coordinator.journal.sameness import Sameness
from catseye.coordinator.journal.writer import Journal
from catseye.errors import InputError
from catseye.records.night.live import Happening, LivePosture, LiveWeather
from catseye.simulator.clock.world_clock import ManualClock
from journal_scene import MOST_WAIT, START, scene_run, scene_shot
from repository import TESTS


@dataclass(frozen=True)
class Verdict:
    status: str
    range_: float
    text: str = ""
    u_range: float = float("nan")
    misfit: float = 0.0


@dataclass(frozen=True, eq=False)
class Epoch:
    points: dict
    covariance: np.ndarray
    shots: int


class OrderedLive:
    """A reduction whose every answer depends on all it was fed before, and on the order."""

    def __init__(self, site, gain):
        self.state, self.shots, self.gain = float(len(site.rangers)), 0, gain

    def _fed(self, value):
        self.state = np.sin(self.gain * self.state + value)

    def weather(self, read):
        self._fed(read.temperature_c)

    def posture(self, read):
        self._fed(read.azimuth)

    def shot(self, shot):
        self._fed(float(shot.samples.astype(float) @ np.arange(len(shot.samples))) * shot.volts_per_code)
        self.shots += 1
        return Verdict("used", self.state)

    def solve(self, ticks):
        if not self.shots:
            return None
        root = np.outer([self.state, 1.0, ticks % 7], [0.1, self.state, 0.3])
        answer = Epoch({"ZEG": np.array([self.state, float("nan")])}, root + root.T, self.shots)
        self.shots = 0
        return answer

    failed = ""

    def begin(self, ticks):
        return SimpleNamespace(solve=partial(self.solve, ticks))

    def accept(self, job, found):
        return found

    def place(self, name, mjd):
        return np.zeros((len(mjd), 3))


def recorded(path, solves=6, gain=1.1):
    """A run as the coordinator makes one: what the reduction is fed is what is journalled."""
    live = OrderedLive(scene_run().site, gain)
    with Journal.open(path, run=scene_run(seed=5), clock=ManualClock(START / 1e8)) as journal:
        for k in range(7 * solves):
            when = START + 200 * k
            if k % 3 == 0:
                read = LivePosture(when, 0.1 * k, 0.5)
                live.posture(read)
                journal.append(read)
            if k % 4 == 0:
                read = LiveWeather("WX1", when, 10.0 + 1 / (k + 1), 930.0, 50.0)
                live.weather(read)
                journal.append(read)
            shot = scene_shot(k)
            journal.append(AnsweredShot.of(shot, live.shot(shot)), Happening(when, "ZY105", "x", "y"))
            if k % 7 == 6:
                journal.append(Document(when, EPOCH_START, ""), EpochSolution.of(when, live.solve(when)))
        journal.append().result(MOST_WAIT)
    return path


def again(path, gain=1.1, **more):
    with JournalReader(path) as reader:
        return list(replay(reader, 1, lambda site, run: OrderedLive(site, gain), **more))


def test_same_reduction_gives_the_same_bits(tmp_path):
    found = again(recorded(tmp_path / "j.db"))
    assert [replayed.sameness for replayed in found] == [Sameness.IDENTICAL] * 6
    assert [replayed.shots.count for replayed in found] == [7] * 6
    assert all(replayed.shots.differing == replayed.shots.reworded == [] for replayed in found)
    states = [replayed.new.answer["points"]["ZEG"][0] for replayed in found]
    assert len(set(states)) == 6


def test_differing_shots_of_another_reduction_are_reported(tmp_path):
    found = again(recorded(tmp_path / "j.db"), gain=1.1 + 1e-12)
    assert not found[0].same
    assert found[0].shots.differing
    assert found[0].stored.answer["points"] != found[0].new.answer["points"]


def test_reduction_without_solution_is_reported(tmp_path):
    class Mute(OrderedLive):
        def solve(self, ticks):
            return None

    with JournalReader(recorded(tmp_path / "j.db")) as reader:
        found = list(replay(reader, 1, lambda site, run: Mute(site, 1.1)))
    assert [(replayed.new.answer, replayed.same) for replayed in found] == [({}, False)] * 6


def test_failed_solution_is_replayed_too(tmp_path):
    """It used up its shots: without it all that follows would differ."""

    class Failing(OrderedLive):
        def solve(self, ticks):
            answer = super().solve(ticks)
            if answer is not None and self.state < 0.0:
                self.state = 0.25
                return None
            return answer

        def shot(self, shot):
            verdict = super().shot(shot)
            if shot.number % 5 == 0:
                raise InputError("no such ranger")
            return verdict

    live = Failing(scene_run().site, 1.1)
    with Journal.open(tmp_path / "j.db", run=scene_run(), clock=ManualClock(START / 1e8)) as journal:
        for k in range(40):
            shot = scene_shot(k)
            try:
                journal.append(AnsweredShot.of(shot, live.shot(shot)))
            except InputError as problem:
                journal.append(AnsweredShot(shot, "refused", str(problem)))
            if k % 3 == 2:
                begun = Document(shot.ticks, EPOCH_START, "")
                journal.append(begun, EpochSolution.of(shot.ticks, live.solve(shot.ticks)))
    with JournalReader(tmp_path / "j.db") as reader:
        found = list(replay(reader, 1, lambda site, run: Failing(site, 1.1)))
    *found, rest = found
    assert len(found) == 13
    assert (rest.stored, rest.new, rest.shots.count, rest.same) == (None, None, 1, True)
    assert all(replayed.same for replayed in found)
    assert {bool(replayed.new.answer) for replayed in found} == {True, False}


def test_replay_ends_at_the_given_event(tmp_path):
    path = recorded(tmp_path / "j.db")
    whole = again(path)
    for until in (whole[2].seq, whole[3].seq - 1):
        found = [replayed.seq for replayed in again(path, until=until) if replayed.stored is not None]
        assert found == [replayed.seq for replayed in whole[:3]]


def test_factory_gets_the_runs_site_and_settings(tmp_path):
    def made(site, run):
        assert (len(site.rangers), run.settings["solve_every"], run.seed) == (18, 0.5, 5)
        return OrderedLive(site, 1.1)

    with JournalReader(recorded(tmp_path / "j.db", solves=1)) as reader:
        assert len(list(replay(reader, 1, made))) == 1


def test_shots_during_a_solution_belong_to_the_next_epoch(tmp_path):
    """An epoch is taken out, solved beside the loop, and taken in: what is fed between changes neither."""

    class Beside(OrderedLive):
        def begin(self, ticks):
            taken, self.shots = self.shots, 0
            return SimpleNamespace(solve=lambda: (ticks, taken))

        def accept(self, job, found):
            _, taken = found
            self.state = np.sin(self.state + taken)
            return Epoch({"ZEG": np.array([self.state])}, np.eye(2) * self.state, taken)

    live = Beside(scene_run().site, 1.1)
    with Journal.open(tmp_path / "j.db", run=scene_run(), clock=ManualClock(START / 1e8)) as journal:
        for k in range(30):
            shot = scene_shot(k)
            if k % 10 == 5:
                job = live.begin(shot.ticks)
                journal.append(Document(shot.ticks, EPOCH_START, ""))
            journal.append(AnsweredShot.of(shot, live.shot(shot)))
            if k % 10 == 8:
                journal.append(EpochSolution.of(shot.ticks, live.accept(job, job.solve())))
    with JournalReader(tmp_path / "j.db") as reader:
        found = list(replay(reader, 1, lambda site, run: Beside(site, 1.1)))
    *found, rest = found
    assert [replayed.same for replayed in found] == [True] * 3
    assert (rest.shots.count, rest.same) == (1, True)
    assert [replayed.new.answer["shots"] for replayed in found] == [5, 10, 10]


def test_clock_correction_is_replayed_and_discards_the_epoch_under_way(tmp_path):
    class Set(OrderedLive):
        def clock_corrected(self, ticks):
            self._fed(float(ticks % 1000))

    live = Set(scene_run().site, 1.1)
    with Journal.open(tmp_path / "j.db", run=scene_run(), clock=ManualClock(START / 1e8)) as journal:
        for k in range(30):
            shot = scene_shot(k)
            journal.append(AnsweredShot.of(shot, live.shot(shot)))
            if k in (6, 16, 26):
                journal.append(Document(shot.ticks, EPOCH_START, ""))
                if k == 16:  # corrected while it is solved: what it found was not taken in
                    live.clock_corrected(shot.ticks)
                    journal.append(Document(shot.ticks, CLOCK_CORRECTED, '{"gained_s": 3600.0}'))
                    journal.append(EpochSolution.of(shot.ticks, None))
                else:
                    journal.append(EpochSolution.of(shot.ticks, live.solve(shot.ticks)))
    with JournalReader(tmp_path / "j.db") as reader:
        found = list(replay(reader, 1, lambda site, run: Set(site, 1.1)))
    assert [replayed.sameness for replayed in found] == [Sameness.IDENTICAL] * 4
    assert found[1].new.answer == {}


def test_shots_after_the_last_epoch_are_compared_and_unanswered_ones_counted(tmp_path):
    live = OrderedLive(scene_run().site, 1.1)
    with Journal.open(tmp_path / "j.db", run=scene_run(), clock=ManualClock(START / 1e8)) as journal:
        for k in range(6):
            answered = AnsweredShot.of(scene_shot(k), live.shot(scene_shot(k)))
            if k == 4:
                answered = AnsweredShot(scene_shot(k))  # nothing was said of it
            if k == 5:
                answered = AnsweredShot(scene_shot(k), "used", "", 1.0)  # not what is said now
            journal.append(answered)
            if k == 2:
                journal.append(Document(1, EPOCH_START, ""), EpochSolution.of(1, live.solve(1)))
    first, rest = again(tmp_path / "j.db")
    assert first.same
    assert (rest.stored, rest.shots.count, rest.shots.differing, rest.shots.unasked) == (None, 3, [8], [7])
    move = rest.shots.moves[-1]  # new less stored, in the stored u
    assert (move.ranger, move.target, move.change) == ("ZY105", "ZEG41040L", live.state - 1.0)
    assert [each.change for each in (*first.shots.moves, *rest.shots.moves[:-1])] == [0.0] * 4
    assert not rest.same


def test_reworded_answers_have_the_same_numbers(tmp_path):
    class Wordy(OrderedLive):
        def shot(self, shot):
            return replace(super().shot(shot), text="in other words")

    with JournalReader(recorded(tmp_path / "j.db")) as reader:
        found = list(replay(reader, 1, lambda site, run: Wordy(site, 1.1)))
    assert {replayed.sameness for replayed in found} == {Sameness.TEXTS}
    assert [len(replayed.shots.reworded) for replayed in found] == [7] * 6
    assert all(replayed.same and not replayed.shots.differing for replayed in found)


def test_journal_of_version_1_is_replayed():
    """Its twelve shots were answered by hand and differ; its solutions have no beginning: none is lost."""
    with JournalReader(TESTS / "vectors" / "formats" / "journal-1.db") as reader:
        found = list(replay(reader, 1, lambda site, run: OrderedLive(site, 1.1)))
    epochs = [replayed for replayed in found if replayed.stored is not None]
    assert [replayed.solution.parts for replayed in epochs] == [("solved or not",)] * len(epochs)
    assert len(epochs) == 4
    assert sum(len(replayed.shots.differing) for replayed in found) == 12
