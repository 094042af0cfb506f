"""Many units done by many processes: none lost, none waited for in vain, in an order of its own."""

from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

from catseye.aliases import Progress
from catseye.errors import ArgumentError, CatseyeError
from catseye.interruption import undo_on_interruption
from catseye.memory import available
from catseye.processors import free_cores
from catseye.service.many.ledger import clear_unfinished, opened, read_entry
from catseye.service.many.unit import Death, Unit, UnitOutcome, UnitReport

DEATHS = 3  # of a process with this unit alone, until the unit is to blame
RESERVE = 0.8  # share of the available memory that units may take together
MOST_PROCESSES = 4096


class StoppedError(CatseyeError):
    """Run that ended before its units did.

    done    units that are done
    total   of how many
    """

    def __init__(self, text: str, *, done: int, total: int) -> None:
        super().__init__(text)
        self.done, self.total = done, total


class Workers(Protocol):
    """ProcessWorkers that do units, here or on a cluster."""

    count: int

    def start(self, number: int, unit: Unit) -> None:
        """Start a unit; fewer than `count` may run."""
        ...

    def ended(self, timeout: float | None = None) -> list[tuple[int, UnitReport | Death]]:
        """Units that have ended since, by their numbers; waits for the first, at most for a time, s."""
        ...

    def close(self) -> None:
        """Let the idle processes end."""
        ...

    def kill(self) -> None:
        """End all processes within 3.5 s; from a signal handler, too."""
        ...

    def abandon(self) -> None:
        """Kill the processes and let go of everything."""
        ...


def run_many(
    units: Sequence[Unit],
    *,
    ledger: Path | None = None,
    resume: bool = False,
    processes: int | None = None,
    cluster: str | None = None,
    memory: int | None = None,
    progress: Progress | None = None,
    task: str = "computing",
) -> list[UnitOutcome]:
    """Outcomes of all units, in their order, whatever the order of arrival.

    ledger      folder of what is done, a file a unit; None: nothing stays
    resume      take from the ledger what an earlier run did of the same inputs
    processes   at once; None: as many as free cores and available memory allow
    cluster     "local", or the address or scheduler file of a dask cluster; None: processes of this machine
    memory      bytes that units may take together; None: 80 % of what is available
    progress    called with (task, done, of how many)
    task        what the units are, for `progress`: "reducing nights"

    A unit that raises is a failed outcome. Raises ArgumentError for two units of one name, InputError where the
    ledger cannot be written, StoppedError where the disk is full or the cluster is lost: what is done stays.
    """
    units = tuple(units)
    _refuse(units, processes)
    with opened(ledger):
        run = _Run(units, ledger, memory or int(RESERVE * available()), progress, task)
        run.clear()
        run.resume(resume)
        if run.waiting:
            count = _count(units, processes, run.memory)
            with _workers(run, count, cluster) as workers:
                run.go(workers)
        return run.result()


def _refuse(units: Sequence[Unit], processes: int | None) -> None:
    if processes is not None and not 1 <= processes <= MOST_PROCESSES:
        raise ArgumentError(f"processes = {processes} (expected 1 to {MOST_PROCESSES})", "processes")
    names: set[str] = set()
    for unit in units:
        if not unit.name or unit.name != Path(unit.name).name or unit.name.startswith("."):
            raise ArgumentError(f"name {unit.name!r}: is no file's name (expected one, without a folder)")
        if unit.name in names:
            raise ArgumentError(f"name {unit.name!r}: stands for two of {len(units)} (expected different names)")
        names.add(unit.name)


def _count(units: Sequence[Unit], processes: int | None, memory: int) -> int:
    """ProcessWorkers that are useful: no more than units, and by default than free cores and memory allow."""
    count = processes
    if count is None:
        largest = max(unit.memory for unit in units)
        count = min(free_cores(), max(1, memory // max(1, largest)))
    return min(count, len(units))


@contextmanager
def _workers(run: "_Run", count: int, cluster: str | None) -> Iterator[Workers]:
    """Start the processes, and end them with the block, whatever ends it."""
    with_main = any(unit.work.__module__ == "__main__" for unit in run.units)
    if cluster is None:
        from catseye.service.many.processes import ProcessWorkers

        workers: Workers = ProcessWorkers(count, run.ledger, with_main=with_main)
    else:
        raise ArgumentError(f"cluster = {cluster!r}: there is none", "cluster")

    def undo() -> None:
        workers.kill()
        run.clear()

    with undo_on_interruption(undo):
        try:
            yield workers
        except BaseException as problem:
            workers.abandon()
            run.clear()
            if isinstance(problem, KeyboardInterrupt):
                problem.add_note(run.remaining())
            raise
        workers.close()


class _Run:
    """State of a run: what waits, what runs, what is done."""

    def __init__(self, units: Sequence[Unit], ledger: Path | None, memory: int, progress: Progress | None, task: str):
        self.units, self.ledger, self.memory = units, ledger, memory
        self.waiting = deque(range(len(units)))
        self._alone: deque[int] = deque()  # whose process died beside others
        self._running: set[int] = set()
        self._deaths: dict[int, int] = {}
        self._outcomes: dict[int, UnitOutcome] = {}
        self._progress, self._task, self._resumed = progress, task, 0

    def clear(self) -> None:
        """Remove unfinished output of killed processes beside the outputs of units and in the ledger."""
        places = {unit.output.parent for unit in self.units if unit.output is not None}
        clear_unfinished([*sorted(places), *([self.ledger] if self.ledger is not None else [])])

    def resume(self, wanted: bool) -> None:
        """Take what is done from the ledger, if wanted."""
        if wanted and self.ledger is not None:
            for number in list(self.waiting):
                if (outcome := read_entry(self.ledger, self.units[number])) is not None:
                    self._outcomes[number] = outcome
                    self.waiting.remove(number)
            self._resumed = len(self._outcomes)

    def go(self, workers: Workers) -> None:
        """Do all units that wait, and those whose processes died again."""
        self._tell()
        while self.waiting or self._running or self._alone:
            while self.waiting and len(self._running) < workers.count and self._fits(self.units[self.waiting[0]]):
                self._start(workers, self.waiting.popleft())
            if not self._running:
                self._start(workers, self._alone.popleft())
            for number, answer in workers.ended():
                self._running.discard(number)
                self._take(number, answer)
            self._tell()

    def result(self) -> list[UnitOutcome]:
        """Outcomes in the units' order."""
        return [self._outcomes[number] for number in range(len(self.units))]

    def remaining(self) -> str:
        """Sentence on how far it came."""
        done = sum(outcome.state != "failed" for outcome in self._outcomes.values())
        again = "; resume continues from there" if self.ledger is not None else ""
        return f"{done} of {len(self.units)} are done{again}"

    def stop(self, why: str) -> StoppedError:
        """Error of a run that cannot go on."""
        done = sum(outcome.state != "failed" for outcome in self._outcomes.values())
        return StoppedError(f"{why}; {self.remaining()}", done=done, total=len(self.units))

    def _fits(self, unit: Unit) -> bool:
        """True if the memory is there; what is too large for all of it runs by itself."""
        taken = sum(self.units[number].memory for number in self._running)
        return not self._running or taken + unit.memory <= self.memory

    def _start(self, workers: Workers, number: int) -> None:
        workers.start(number, self.units[number])
        self._running.add(number)

    def _take(self, number: int, answer: UnitReport | Death) -> None:
        unit = self.units[number]
        if isinstance(answer, Death):
            self._deaths[number] = self._deaths.get(number, -1) + 1  # the first time, another unit may be to blame
            if self._deaths[number] < DEATHS:
                self._alone.append(number)
                return
            why = f"its process was {answer.why} {DEATHS + 1} times, most likely out of memory"
            self._outcomes[number] = UnitOutcome(unit.name, "failed", why, None, 0.0)
        elif answer.state == "stopped":
            raise self.stop(f"{unit.name}: {answer.why}")
        else:
            self._outcomes[number] = UnitOutcome(unit.name, answer.state, answer.why, answer.value, answer.seconds)

    def _tell(self) -> None:
        if self._progress is not None:
            failed = sum(outcome.state == "failed" for outcome in self._outcomes.values())
            text = self._task + (f", {failed} failed" if failed else "")
            self._progress(text, len(self._outcomes) - self._resumed, len(self.units) - self._resumed)
