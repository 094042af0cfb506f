"""Reduce hostile nights and print how each row fares.

PYTHONPATH=src:tests python tests/hostile/run.py            one night of each row and size
    --rows monument certificate honest                       rows whose names contain one of these
    --seeds 4                                                nights of each row and size; --first 7001
    --cycle                                                  sizes by turns: as many nights as seeds
    --jobs 2                                                 processes
    --say                                                    what was named, accused and far, night by night
    --json FILE                                              the rows as data
    --list                                                   names of rows and their sizes
"""

import argparse
import json
import multiprocessing
import os
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from hostile.outcome import OUTCOMES, Outcome, outcome
from hostile.rows import FIRST_SEED, HONEST, NAMES, Case, case, sizes_of


def cases(names: Iterable[str], seeds: Iterable[int], *, cycle: bool = False) -> list[Case]:
    """Nights of some rows: every size with every seed, or sizes by turns."""
    result = []
    for name in names:
        sizes = sizes_of(name)
        for k, seed in enumerate(seeds):
            result += [case(name, seed, size) for size in ((sizes[k % len(sizes)],) if cycle else sizes)]
    return result


def outcomes(some: list[Case], jobs: int = 1) -> Iterable[Outcome]:
    """Outcome of each night, in order, as they come."""
    if jobs == 1:
        yield from map(outcome, some)
        return
    with multiprocessing.get_context("spawn").Pool(jobs) as pool:
        yield from pool.imap(outcome, some)


def row_of(name: str, found: list[Outcome]) -> dict:
    """Counts and errors of a row's nights.

    mean_square   of the worst class, over the nights that were reduced and are not named; without listed points where
                  the list is the answer
    worst_class   that class
    """
    reduced = [o for o in found if o.errors is not None]
    unnamed = [o for o in reduced if o.word != "named"]
    claims = [o.claimed.mean for o in unnamed]
    classes = {kind for mean in claims for kind in mean}
    means = {kind: float(np.mean([mean[kind] for mean in claims if kind in mean])) for kind in classes}
    worst = max(means, key=means.__getitem__, default="")
    listed, places = sum(len(o.listed) for o in found), sum(o.places for o in found)
    return {
        "row": name,
        "nights": len(found),
        **{word: sum(o.word == word for o in found) for word in OUTCOMES},
        "accused": sum(bool(o.accused) for o in found),
        "refused": sum(bool(o.refused) for o in found),
        "alarmed": sum(bool(o.alarms) for o in found),
        "mean_square": means.get(worst),
        "worst_class": worst,
        "named_mean_square": float(np.mean([max(o.errors.mean.values()) for o in reduced])) if reduced else None,
        "listed_share": listed / places if places else 0.0,
        "slowest_s": max(o.seconds for o in found),
    }


def line_of(row: dict) -> str:
    """Line of the table."""
    square = "" if row["mean_square"] is None else f"{row['mean_square']:8.1f} {row['worst_class']}"
    counts = "".join(f"{row[word]:>10}" for word in ("nights", *OUTCOMES, "accused", "refused", "alarmed"))
    return f"{row['row']:36}{counts}{100 * row['listed_share']:8.1f} %{row['slowest_s']:7.1f} s {square}"


HEAD = f"{'row':36}" + "".join(f"{w:>10}" for w in ("nights", *OUTCOMES, "accused", "refused", "alarmed"))
HEAD += "    listed  slowest  worst class of nights that are not named"


def write(line: str) -> None:
    """Print a line at once."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def say(found: Outcome) -> None:
    """Print one night."""
    write(f"  {found.case.seed} {', '.join(found.case.lies) or 'honest'}: {found.word.upper()} ({found.verdict})")
    if found.errors is not None:
        far = [
            f"{n} {np.sqrt(found.errors.points[n]):.0f}" if n in found.errors.points else n for n in found.errors.far
        ]
        means = ", ".join(f"{kind} {value:.1f}" for kind, value in found.errors.mean.items())
        write(f"      mean squares: {means}; far (in u): {', '.join(far[:8]) or 'none'}")
    for text in found.accused:
        write(f"      ACCUSED: {text}")
    for text in found.alarms:
        write(f"      alarm: {text}")


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--rows", nargs="+", default=[""], help="parts of the names of rows")
    parser.add_argument("--seeds", type=int, default=1, help="nights of each row and size")
    parser.add_argument("--first", type=int, default=FIRST_SEED, help="first seed")
    parser.add_argument("--cycle", action="store_true", help="sizes by turns")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--say", action="store_true", help="print every night")
    parser.add_argument("--json", type=Path, help="file of the rows as data")
    parser.add_argument("--list", action="store_true", help="print the rows' names")
    options = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    names = [name for name in NAMES if any(part in name for part in options.rows)]
    if options.list or not names:
        write("\n".join(f"{name}: {', '.join(f'{size:g}' for size in sizes_of(name))}" for name in NAMES))
        return 0 if options.list else 2
    write(HEAD)
    some = cases(names, range(options.first, options.first + options.seeds), cycle=options.cycle)
    rows, found = [], []
    left = len(some)
    for each in outcomes(some, options.jobs):
        left -= 1
        if options.say:
            say(each)
        found.append(each)
        if left == 0 or some[-left].row != each.case.row:
            rows.append(row_of(each.case.row, found))
            write(line_of(rows[-1]))
            found = []
    hostile = [row for row in rows if row["row"] != HONEST]
    if len(hostile) > 1:
        write(line_of(total(hostile)))
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return 0


def total(rows: list[dict]) -> dict:
    """Sum of rows."""
    counts = {key: sum(row[key] for row in rows) for key in ("nights", *OUTCOMES, "accused", "refused", "alarmed")}
    return {
        "row": "all hostile",
        **counts,
        "mean_square": None,
        "listed_share": float(np.mean([row["listed_share"] for row in rows])),
        "slowest_s": max(row["slowest_s"] for row in rows),
    }


if __name__ == "__main__":
    sys.exit(main())
