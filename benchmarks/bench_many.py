"""Cost of many nights: processes and a local cluster of dask beside one worker and beside a loop of commands.

python benchmarks/bench_many.py [--quick]
python benchmarks/bench_many.py --nights   100 nights of 60 prisms and 12 of 2209: digests, speed-up, memory, an hour

Nights are one simulated night whose samples are changed by -2 to 2 codes each time, so that no two give the same. Each
worker has one thread of linear algebra. With --nights CATSEYE_NIGHTS is a folder with 25 GB of room (default: the
temporary one); CATSEYE_NIGHT_2209 names a night of 2209 prisms, which is simulated without.
"""

import os
import resource
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from shutil import rmtree

import numpy as np

import catseye
from catseye.reduction.night.digest import digest
from harness import LIMIT, Contender, Row, main, missing, raced

FEW, CODES = 6, 2
WORKERS = 2
LOOK = 0.2  # s between two looks at the memory
GIB = 2.0**30


def nights_of(night: Path, directory: Path, count: int) -> list[Path]:
    """Copies of a night with other samples."""
    paths, frames = [], np.load(night / "frames.npy", mmap_mode="r")
    limits = np.iinfo(frames.dtype)
    for number in range(count):
        where = directory / f"{night.name}-{number:03d}"
        for file in (each for each in night.rglob("*") if each.is_file()):
            target = where / file.relative_to(night)
            target.parent.mkdir(parents=True, exist_ok=True)
            if file.name != "frames.npy":
                target.write_bytes(file.read_bytes())
        draw = np.random.default_rng(number)
        changed = np.lib.format.open_memmap(where / "frames.npy", "w+", frames.dtype, frames.shape)
        for low in range(0, len(frames), 1000):
            part = slice(low, low + 1000)
            change = draw.integers(-CODES, CODES + 1, frames[part].shape, dtype=frames.dtype)
            changed[part] = np.clip(frames[part], limits.min + CODES, limits.max - CODES) + change
        changed.flush()
        paths.append(where)
    return paths


def rows(quick: bool) -> Iterator[Row]:
    """A few nights of 60 prisms, files and report included."""
    with tempfile.TemporaryDirectory(prefix="catseye-bench-") as folder:
        place = Path(folder)
        nights = nights_of(catseye.night(place / "night60", dish_prisms=60, seed=5), place, FEW)
        digests: set[tuple[str, ...]] = set()

        def reduced(**options: object) -> Callable[[], None]:
            def work() -> None:
                many = catseye.reduce_nights(nights, place / "out", **options)
                digests.add(tuple(outcome.value["digest"] for outcome in many.outcomes))

            return work

        skipped = missing("distributed")
        contenders = {
            f"catseye, {WORKERS} processes": Contender(reduced(processes=WORKERS)),
            "catseye, one process": Contender(reduced(processes=1)),
            "a loop of commands": Contender(lambda: commands(nights[:2], place / "loop"), share=2 / FEW),
        }
        if not skipped:
            contenders[f"catseye, a local cluster of {WORKERS}"] = Contender(
                reduced(processes=WORKERS, cluster="local")
            )
        seconds = alone(nights[:2])
        contenders[LIMIT] = Contender(lambda: seconds * FEW / min(WORKERS, os.cpu_count() or 1), timed=True)
        row = raced(
            "many nights", f"{FEW} nights of 60 prisms, files and report", contenders, quick=quick, skipped=skipped
        )
        assert len(digests) == 1, "the answers depend on who computed them"
        yield row


def alone(nights: Sequence[Path]) -> float:
    """Processor seconds of a night, samples to files, in a process that has loaded everything."""
    with tempfile.TemporaryDirectory(prefix="catseye-bench-") as folder:
        catseye.save(catseye.reduce(nights[0]), Path(folder) / "first")
        begun = time.process_time()
        for number, night in enumerate(nights):
            catseye.save(catseye.reduce(night), Path(folder) / str(number))
        return (time.process_time() - begun) / len(nights)


def commands(nights: Sequence[Path], out: Path) -> None:
    """Commands of a user without it: the command once for each night."""
    for night in nights:
        words = [sys.executable, "-m", "catseye", "reduce", str(night), "--out", str(out), "--quiet"]
        subprocess.run(words, check=True, env={**os.environ, "OPENBLAS_NUM_THREADS": "1"})


class Memory:
    """Largest memory of the processes below this one, bytes, while the block runs: together, and of one."""

    def __init__(self) -> None:
        self.together = self.one = 0
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> "Memory":
        self._thread.start()
        return self

    def __exit__(self, *problem: object) -> None:
        self._over.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._over.wait(LOOK):
            sizes = [anonymous(pid) for pid in below(os.getpid())]
            self.together, self.one = max(self.together, sum(sizes)), max([self.one, *sizes])


def below(parent: int) -> list[int]:
    """Processes below one."""
    children: dict[int, list[int]] = {}
    for entry in Path("/proc").iterdir():
        with suppress(OSError, ValueError, IndexError):
            children.setdefault(int((entry / "stat").read_text().rpartition(")")[2].split()[1]), []).append(
                int(entry.name)
            )
    found = children.get(parent, [])
    return found + [pid for child in found for pid in below(child)]


def anonymous(pid: int) -> int:
    """Memory of a process that no file holds, bytes."""
    with suppress(OSError, StopIteration):
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
        return 1024 * int(next(line for line in lines if line.startswith("RssAnon")).split()[1])
    return 0


def whole() -> None:
    """The nights of the requirement, in words."""
    place = Path(tempfile.mkdtemp(prefix="catseye-bench-", dir=os.environ.get("CATSEYE_NIGHTS")))
    try:
        night = catseye.night(place / "night60", dish_prisms=60, seed=5)
        compared(nights_of(night, place, 100), place, "100 nights of 60 prisms")
        named = os.environ.get("CATSEYE_NIGHT_2209")
        night = Path(named) if named else catseye.night(place / "night2209")
        compared(nights_of(night, place, 12), place, "12 nights of 2209 prisms")
    finally:
        rmtree(place, ignore_errors=True)


def compared(nights: Sequence[Path], place: Path, what: str) -> None:
    """Say wall and processor time, memory and digests of one worker, of two, and of a local cluster of two."""
    say(f"{what}; load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    answers, first = {}, 0.0
    for name, options in (
        ("one worker", {"processes": 1}),
        (f"{WORKERS} processes", {"processes": WORKERS}),
        (f"a local cluster of {WORKERS}", {"processes": WORKERS, "cluster": "local"}),
    ):
        begun, used = time.perf_counter(), children_seconds()
        with Memory() as memory:
            many = catseye.reduce_nights(nights, place / "out", **options)
        wall, cpu = time.perf_counter() - begun, children_seconds() - used
        first = first or wall
        answers[name] = tuple(outcome.value and outcome.value["digest"] for outcome in many.outcomes)
        failed = len(many.failures)
        sizes = f"{memory.together / GIB:.2f} GiB together, {memory.one / GIB:.2f} GiB of one"
        used_by = f"{cpu:.1f} s" if cpu else "uncounted s"
        say(
            f"    {name:<22} {wall:8.1f} s, {first / wall:.2f} times one worker; {used_by} of processors; {sizes}"
            + (f"; {failed} FAILED: {many.failures[0].why}" if failed else "")
        )
        rmtree(place / "out")
    same = len(set(answers.values())) == 1
    single = digest(catseye.reduce(nights[0]).reduction) == answers["one worker"][0]
    say(f"    digests {'identical' if same else 'DIFFERENT'}, {len(set(answers['one worker']))} different nights;")
    say(f"    the first {'equals' if single else 'is NOT'} what catseye.reduce gives in this process")


def children_seconds() -> float:
    """Processor seconds of all processes that this one has waited for."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def say(text: str) -> None:
    """Print a line at once."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    if "--nights" in sys.argv:
        whole()
    else:
        main(rows, flags={"nights": "the nights of the requirement, an hour"})
