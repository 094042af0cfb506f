"""Comparison of ratios with the committed baseline: a row fails when one of its ratios falls by a third.

A ratio is an alternative's seconds over ours, or the share of the machine's limit that ours reaches; it falls when ours
got slower. Both sides come from the same run, so the machine's speed cancels. Only what both have is compared: an
alternative that is not installed, or a row that quick mode leaves out, is counted as not compared.
"""

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from harness import Row

BASELINE = Path(__file__).parent / "baseline.json"
FORMAT = "catseye-benchmarks-1"
FALL = 2.0 / 3.0  # of the baseline's ratio
TRIES = 3  # of a row before it fails, the first included
Ratios = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class Fall:
    """A ratio below two thirds of the baseline's."""

    key: str
    name: str
    now: float
    before: float

    def __str__(self) -> str:
        return (
            f"{self.key}, beside {self.name}: ratio {self.now:.3g}, baseline {self.before:.3g} "
            f"({100.0 * self.now / self.before:.0f} %, limit {100.0 * FALL:.0f} %)"
        )


@dataclass(frozen=True)
class Judgement:
    """Outcome of a guard: `falls` that stayed after retries, counts of ratios compared and without a baseline."""

    falls: tuple[Fall, ...]
    compared: int
    uncompared: int


def ratios_of(rows: Iterable[Row]) -> dict[str, dict[str, float]]:
    """Ratios by row and alternative, four digits."""
    return {row.key: {name: float(f"{ratio:.4g}") for name, ratio in row.ratios().items()} for row in rows}


def falls(now: Ratios, baseline: Ratios) -> list[Fall]:
    """Ratios of `now` that are below two thirds of the baseline's.

    >>> [str(fall) for fall in falls({"a": {"numpy": 3.0}}, {"a": {"numpy": 5.0}})]
    ['a, beside numpy: ratio 3, baseline 5 (60 %, limit 67 %)']
    """
    return [
        Fall(key, name, ratio, baseline[key][name])
        for key, ratios in now.items()
        for name, ratio in ratios.items()
        if name in baseline.get(key, {}) and ratio < FALL * baseline[key][name]
    ]


def judge(now: Ratios, baseline: Ratios, again: Callable[[set[str]], Ratios]) -> Judgement:
    """Judgement of one run; rows that fall are measured again, and a ratio counts by its best try.

    again   keys of rows to their ratios, measured anew; others may come along
    """
    best = {key: dict(ratios) for key, ratios in now.items()}
    fallen = falls(best, baseline)
    for _ in range(TRIES - 1):
        if not fallen:
            break
        anew = again({fall.key for fall in fallen})
        for fall in fallen:
            ratio = anew.get(fall.key, {}).get(fall.name, 0.0)
            best[fall.key][fall.name] = max(ratio, best[fall.key][fall.name])
        fallen = falls(best, baseline)
    known = [name in baseline.get(key, {}) for key, ratios in now.items() for name in ratios]
    return Judgement(tuple(fallen), sum(known), len(known) - sum(known))


def read_baseline(path: Path | None = None) -> dict[str, dict[str, float]]:
    """Ratios of a baseline, None the committed one; raises SystemExit with one line for another file."""
    path = path or BASELINE
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise SystemExit(f"{path}: not readable as a baseline ({error}); `make bench` writes it") from None
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise SystemExit(f"{path}: not of format {FORMAT}; `make bench` writes it")
    return content["ratios"]


def written_baseline(rows: Iterable[Row]) -> str:
    """Text of the baseline's file."""
    return json.dumps({"format": FORMAT, "ratios": ratios_of(rows)}, indent=1, ensure_ascii=False) + "\n"
