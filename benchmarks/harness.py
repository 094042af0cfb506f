"""Rows of the benchmarks' table: catseye beside alternatives and the machine's limit, timed in interleaved rounds.

A script `bench_*.py` has `rows(quick)`, a generator of `Row`, and ends in `main(rows)`; `run.py` runs every
script, each in a process of its own, and makes of all rows one table. A row measures the same work in quick mode and in
the whole run, as `bench-guard` compares the ratios of both: quick means fewer rounds and no slow alternatives. Work of
another size has another `what`.
"""

import argparse
import importlib.util
import json
import math
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

ROUNDS, QUICK_ROUNDS = 7, 3
SHORTEST, SLOW = 0.02, 1.0  # s: a timing lasts at least so long; beyond this, quick mode's rounds do
LIMIT = "limit"  # the contender that does what the machine needs at least


@dataclass(frozen=True)
class Row:
    """One hot path beside its alternatives: seconds, all for the same work.

    path      name of the hot path, unique together with `what`
    what      the work and its size
    ours_s    s, median
    beside    s of each alternative, by name, medians
    limit_s   s that this machine needs at least; None: nothing bounds it simply
    spread    quartile distance of the rounds' ratios over their median
    note      accuracy, agreement and the like, in a few words
    skipped   alternatives that were not measured, by name, and the reason
    """

    path: str
    what: str
    ours_s: float
    beside: dict[str, float]
    limit_s: float | None
    spread: float
    note: str = ""
    skipped: dict[str, str] = field(default_factory=dict)

    @property
    def key(self) -> str:
        """Name in the guard's baseline."""
        return f"{self.path}: {self.what}"

    def ratios(self) -> dict[str, float]:
        """Times that each alternative takes of ours, and the share of the limit that ours reaches: larger is better."""
        bound = {} if self.limit_s is None else {LIMIT: self.limit_s / self.ours_s}
        return {name: seconds / self.ours_s for name, seconds in self.beside.items()} | bound


@dataclass(frozen=True)
class Curve:
    """Time or memory against size of one hot path.

    variable   what grows, as the axis is labelled
    sizes      (n,)
    values     (n,), medians, in `unit`
    """

    path: str
    what: str
    variable: str
    sizes: tuple[float, ...]
    values: tuple[float, ...]
    unit: str = "s"

    def last_exponent(self) -> float:
        """Slope between the two largest sizes."""
        (a, b), (u, v) = np.log(self.sizes[-2:]), np.log(self.values[-2:])
        return round(float((v - u) / (b - a)), 3) + 0.0

    def text(self, value: float) -> str:
        """Value with its unit."""
        return duration(value) if self.unit == "s" else f"{value:.3g} {self.unit}"

    def exponent(self) -> tuple[float, float]:
        """Slope of log value against log size, and its standard uncertainty from the residuals.

        >>> Curve("a", "b", "n", (1.0, 10.0, 100.0), (2.0, 200.0, 20000.0)).exponent()
        (2.0, 0.0)
        """
        x, y = np.log(self.sizes), np.log(self.values)
        dx = x - x.mean()
        slope = float(dx @ y / (dx @ dx))
        off = y - y.mean() - slope * dx
        return round(slope, 3) + 0.0, round(math.sqrt(float(off @ off) / max(len(x) - 2, 1) / float(dx @ dx)), 3)


@dataclass(frozen=True)
class Contender:
    """Work to be timed.

    share   part of the row's work that one call does
    timed   the call answers with its own seconds, as a program does that prepares first
    """

    work: Callable[[], Any]
    share: float = 1.0
    timed: bool = False


def race(
    contenders: Mapping[str, Contender], *, quick: bool, clock: Callable[[], float] = time.perf_counter
) -> dict[str, np.ndarray]:
    """Seconds of each contender for the row's work, a round each, NaN where a slow one did not run.

    quick   three rounds, and one of an alternative that takes seconds; the first contender is ours
    clock   `time.perf_counter`; `time.process_time` where all contenders compute on one thread of this process: the
            same on an idle machine, and steadier beside other programs

    BLAS takes one thread. The first call of each is not counted: it compiles, loads and touches memory.
    """
    rounds = QUICK_ROUNDS if quick else ROUNDS
    calls, most, taken = {}, {}, {}
    with threadpool_limits(limits=1):
        for name, contender in contenders.items():
            contender.work()
            alone = _seconds(contender, 1, clock)
            calls[name] = 1 if contender.timed else max(1, min(1000, math.ceil(SHORTEST / max(alone, 1e-9))))
            most[name] = min(rounds, QUICK_ROUNDS) if alone > SLOW else rounds
            taken[name] = np.full(rounds, np.nan)
            if quick and alone > 3.0 * SLOW and name != next(iter(contenders)):
                most[name], taken[name][0] = 0, alone
        for turn in range(rounds):
            for name, contender in contenders.items():
                if turn < most[name]:
                    taken[name][turn] = _seconds(contender, calls[name], clock)
    return {name: seconds / contenders[name].share for name, seconds in taken.items()}


def _seconds(contender: Contender, calls: int, clock: Callable[[], float]) -> float:
    """Seconds of one call, mean of so many in a loop."""
    if contender.timed:
        return float(contender.work())
    begun = clock()
    for _ in range(calls):
        contender.work()
    return (clock() - begun) / calls


def raced(
    path: str,
    what: str,
    contenders: Mapping[str, Contender],
    *,
    quick: bool,
    clock: Callable[[], float] = time.perf_counter,
    note: str = "",
    skipped: Mapping[str, str] | None = None,
) -> Row:
    """Row of a race: the first contender is ours, one named `limit` is the machine's limit, the others are beside."""
    seconds = race(contenders, quick=quick, clock=clock)
    median = {name: float(np.nanmedian(values)) for name, values in seconds.items()}
    ours, *others = contenders
    beside = {name: median[name] for name in others if name != LIMIT}
    often = max(others, key=lambda name: int(np.isfinite(seconds[name]).sum()), default=None)  # ran in most rounds
    return Row(
        path=path,
        what=what,
        ours_s=median[ours],
        beside=beside,
        limit_s=median.get(LIMIT),
        spread=spread(seconds[ours], None if often is None else seconds[often]),
        note=note,
        skipped=dict(skipped or {}),
    )


def spread(ours: np.ndarray, other: np.ndarray | None = None) -> float:
    """Quartile distance over median of the rounds' ratios other / ours, or of our own seconds."""
    values = np.asarray(ours if other is None else other / ours, dtype=float)
    values = values[np.isfinite(values)]
    if not len(values):
        return 0.0
    low, middle, high = np.percentile(values, [25, 50, 75])
    return float((high - low) / middle)


def missing(*modules: str) -> dict[str, str]:
    """Python packages of the list that are not installed, with the reason as `Row.skipped` wants it."""
    return {name: "not installed" for name in modules if importlib.util.find_spec(name) is None}


def main(
    rows: Callable[[bool], Iterator[Row]],
    curves: Callable[[bool], Iterator[Curve]] | None = None,
    *,
    flags: Mapping[str, str] | None = None,
) -> None:
    """Command line of one script: its rows as text, and as JSON lines in a file for `run.py`.

    flags   further options without a value, which the script reads itself, and their help
    """
    parser = argparse.ArgumentParser(description=(sys.modules["__main__"].__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="fewer rounds, no slow alternatives")
    parser.add_argument("--curves", action="store_true", help="scaling curves too")
    parser.add_argument("--lines", type=Path, metavar="FILE", help="results as JSON lines, too")
    for flag, text in (flags or {}).items():
        parser.add_argument(f"--{flag.lstrip('-')}", action="store_true", help=text)
    options = parser.parse_args()
    produced = [("row", rows)] + ([("curve", curves)] if curves and options.curves else [])
    for kind, generator in produced:
        for result in generator(options.quick):
            sys.stdout.write(in_words(result) + "\n")
            sys.stdout.flush()
            if options.lines:
                with options.lines.open("a", encoding="utf-8") as file:
                    file.write(json.dumps({kind: asdict(result)}) + "\n")


def read_lines(path: Path) -> tuple[list[Row], list[Curve]]:
    """Rows and curves of a script's file of JSON lines; none where there is no file."""
    lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()] if path.exists() else []
    rows = [Row(**line["row"]) for line in lines if "row" in line]
    curves = [
        Curve(**{k: tuple(v) if isinstance(v, list) else v for k, v in line["curve"].items()})
        for line in lines
        if "curve" in line
    ]
    return rows, curves


def in_words(result: Row | Curve) -> str:
    """Lines of text for a terminal."""
    if isinstance(result, Curve):
        slope, u = result.exponent()
        pairs = ", ".join(f"{n:g}: {result.text(v)}" for n, v in zip(result.sizes, result.values, strict=True))
        return f"{result.path}, {result.what}: {result.variable}^{slope:.2f} (u {u:.2f}); {pairs}"
    lines = [f"{result.path}: {result.what}: {duration(result.ours_s)}, spread {100 * result.spread:.0f} %"]
    for name, ratio in result.ratios().items():
        said = f"{ratio:.2g} of it" if name == LIMIT else f"{ratio:.3g} x"
        lines.append(f"    {name:<60} {said}")
    lines += [f"    {name:<60} skipped: {why}" for name, why in result.skipped.items()]
    return "\n".join([*lines, *([f"    {result.note}"] if result.note else [])])


def duration(seconds: float) -> str:
    """Seconds with three digits and a unit.

    >>> duration(0.00312), duration(123.4), duration(4.2e-8)
    ('3.12 ms', '123 s', '42 ns')
    """
    for unit, scale in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= scale:
            return f"{seconds / scale:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"
