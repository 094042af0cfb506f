"""All benchmarks in one run and one table.

python benchmarks/run.py            every row, on the terminal
python benchmarks/run.py --write    make bench: docs/benchmarks.md, its figure and benchmarks/baseline.json, too
python benchmarks/run.py --guard    make bench-guard: quick rows against the baseline

Each script runs in a process of its own, one after another, BLAS on one thread. One that fails is named with its last
line; then the others' rows are shown, nothing is written, and the status is 1.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import guard
import limits
import table
from harness import Curve, Row, in_words, read_lines

HERE = Path(__file__).parent
LONGEST_S = 900.0  # of one script
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


@dataclass(frozen=True)
class Findings:
    """Rows and curves of a script, its wall and processor time in s; `why` is empty, or why it failed."""

    script: str
    rows: tuple[Row, ...]
    curves: tuple[Curve, ...]
    seconds: float
    processor: float
    why: str = ""


def scripts(only: Sequence[str] = ()) -> list[Path]:
    """Scripts by name; `only` are names without `bench_` and suffix, and unknown ones end the program."""
    known = {path.stem.removeprefix("bench_"): path for path in sorted(HERE.glob("bench_*.py"))}
    if unknown := [name for name in only if name not in known]:
        raise SystemExit(f"unknown benchmark {', '.join(unknown)} (expected {', '.join(known)})")
    return [known[name] for name in (only or known)]


def run(script: Path, *, quick: bool, longest: float = LONGEST_S) -> Findings:
    """Findings of one script, in a process of its own; its curves too, unless quick."""
    begun, before = time.perf_counter(), children_processor()
    with tempfile.TemporaryDirectory() as folder:
        lines = Path(folder) / "lines"
        command = [sys.executable, str(script), "--lines", str(lines), "--quick" if quick else "--curves"]
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, check=False, timeout=longest, env=os.environ | ONE_THREAD
            )
        except subprocess.TimeoutExpired:
            why = f"still running after {longest:.0f} s"
        else:
            output = (done.stderr or done.stdout).strip().splitlines()
            why = f"status {done.returncode}: {output[-1] if output else 'no output'}" if done.returncode else ""
        rows, curves = read_lines(lines)
    return Findings(
        script=script.name,
        rows=tuple(rows),
        curves=tuple(curves),
        seconds=time.perf_counter() - begun,
        processor=children_processor() - before,
        why=why,
    )


def children_processor() -> float:
    """Processor s of the processes that this one started and that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def say(line: str) -> None:
    """Write a line at once."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def run_all(paths: Sequence[Path], *, quick: bool) -> list[Findings]:
    """Findings of all scripts, shown as they come."""
    found = []
    for path in paths:
        found.append(run(path, quick=quick))
        for result in (*found[-1].rows, *found[-1].curves):
            say(in_words(result))
        one = found[-1]
        why = f", FAILED: {one.why}" if one.why else ""
        say(f"-- {one.script}: {one.seconds:.0f} s, {one.processor:.0f} s of processors{why}\n")
    return found


def guarded(found: Sequence[Findings]) -> int:
    """Status of a guard: 1 where a ratio stays low in every try, or a script fails."""
    source = {row.key: one.script for one in found for row in one.rows}

    def again(keys: set[str]) -> dict[str, dict[str, float]]:
        names = sorted({source[key] for key in keys})
        say(f"measured again: {', '.join(names)}")
        return guard.ratios_of(row for name in names for row in run(HERE / name, quick=True).rows)

    judgement = guard.judge(guard.ratios_of(row for one in found for row in one.rows), guard.read_baseline(), again)
    for fall in judgement.falls:
        say(f"FALLEN: {fall}")
    say(
        f"{judgement.compared} ratios compared with {guard.BASELINE.name}, {len(judgement.falls)} fallen by a third or "
        f"more in {guard.TRIES} tries; {judgement.uncompared} without a baseline"
    )
    return 1 if judgement.falls else 0


def write(found: Sequence[Findings], measured: dict[str, float], load: float, took: float) -> None:
    """Write the page, its figure and the baseline."""
    rows = [row for one in found for row in one.rows]
    curves = [curve for one in found for curve in one.curves]
    text = table.page(rows, curves, limits=measured, load=load, took=took, date=table.today())
    table.PAGE.write_text(text, encoding="utf-8")
    guard.BASELINE.write_text(guard.written_baseline(rows), encoding="utf-8")
    if curves:
        table.draw(curves, table.FIGURE)
    say(f"written: {table.PAGE}, {guard.BASELINE}" + (f", {table.FIGURE}" if curves else ""))


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("only", nargs="*", metavar="NAME", help="scripts, such as phase or network; all by default")
    parser.add_argument("--quick", action="store_true", help="fewer rounds, no slow alternatives, no curves")
    parser.add_argument("--guard", action="store_true", help="quick, and compared with the baseline")
    parser.add_argument("--write", action="store_true", help="write docs/benchmarks.md, its figure and the baseline")
    options = parser.parse_args()
    if options.write and (options.quick or options.guard or options.only):
        parser.error("--write takes all rows of a whole run, without --quick, --guard and names")
    begun, load = time.perf_counter(), os.getloadavg()[0]
    paths = scripts(options.only)
    if options.guard:
        guard.read_baseline()  # before minutes are spent
    measured = limits.measured()
    say(table.machine(measured, load) + "\n")
    found = run_all(paths, quick=options.quick or options.guard)
    failed = [one for one in found if one.why]
    took = time.perf_counter() - begun
    say(f"{sum(len(one.rows) for one in found)} rows in {took:.0f} s")
    for one in failed:
        say(f"FAILED: {one.script}: {one.why}")
    if options.guard:
        return max(guarded(found), 1 if failed else 0)
    if options.write and not failed:
        write(found, measured, load, took)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
