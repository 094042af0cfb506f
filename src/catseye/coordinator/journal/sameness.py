"""Comparison of a stored answer with a new one: numbers, codes, statuses.

Texts for people are separate: another wording of a reason is not another answer.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from catseye.coordinator.journal.entries import AnsweredShot, EpochSolution
from catseye.reduction.epoch.reason import status_of

NOTES, REJECTED, POSE, MISSING = "notes", "rejected", "pose", "missing"  # keys of a stored answer, and of its pose
DOUBTS, RETURNED = "doubts", "returned"  # sentences
SOLVED = "solved or not"  # parts that are not keys of the answer
TICKS = "ticks asked for"
COVARIANCE = "covariance"


class Sameness(StrEnum):
    """Likeness of a repeated answer to the stored one; the value is the text for people."""

    IDENTICAL = "identical to the last bit, texts included"
    TEXTS = "same numbers, texts of another version"
    DIFFERENT = "different numbers"  # or another reason code or status


ORDER = tuple(Sameness)  # from best to worst


def least_same(values: Iterable[Sameness]) -> Sameness:
    """The worst of several; identical if none.

    >>> least_same([Sameness.TEXTS, Sameness.IDENTICAL]).name
    'TEXTS'
    """
    return max(values, key=ORDER.index, default=Sameness.IDENTICAL)


@dataclass(frozen=True)
class SolutionComparison:
    """A new solution of an epoch compared with the stored one.

    sameness   of the two
    parts      keys of the answer whose numbers, reason codes or statuses differ
    unstored   keys that only the new answer has, since an older version did not store them: not compared
    """

    sameness: Sameness
    parts: tuple[str, ...] = ()
    unstored: tuple[str, ...] = ()


def compare_solutions(stored: EpochSolution, new: EpochSolution) -> SolutionComparison:
    """Differences between a stored solution and a new one."""
    bits = _bits_of(stored.covariance) == _bits_of(new.covariance)
    if bits and stored.ticks == new.ticks and stored.text == new.text:
        return SolutionComparison(Sameness.IDENTICAL)
    if bool(stored.answer) != bool(new.answer):
        return SolutionComparison(Sameness.DIFFERENT, (SOLVED,))
    before, after = _without_texts(stored.answer), _without_texts(new.answer)
    parts = [part for part in before if part not in after or _differ(before[part], after[part], part)]
    parts += [TICKS] * (stored.ticks != new.ticks) + [COVARIANCE] * (not bits)
    unstored = sorted(set(after) - set(before))
    if POSE in before and POSE in after:
        unstored += _only_in(after[POSE], before[POSE], POSE)
    return SolutionComparison(Sameness.DIFFERENT if parts else Sameness.TEXTS, tuple(parts), tuple(unstored))


def compare_shots(stored: AnsweredShot, new: AnsweredShot) -> Sameness:
    """Sameness of a shot's new answer, by status and numbers.

    NaN equals NaN.
    """
    if (stored.status, *_numbers(stored)) != (new.status, *_numbers(new)):
        return Sameness.DIFFERENT
    return Sameness.IDENTICAL if stored.text == new.text else Sameness.TEXTS


def _numbers(shot: AnsweredShot) -> tuple[str, ...]:
    """Numbers of a shot as text, to the last bit."""
    return tuple(repr(float(value)) for value in (shot.range_, shot.u_range, shot.misfit))


def _without_texts(answer: Mapping[str, object]) -> dict[str, object]:
    """An answer with reason codes instead of texts, and without notes."""
    comparable = {key: value for key, value in answer.items() if key not in (NOTES, DOUBTS, RETURNED)}
    rejected, pose = comparable.get(REJECTED), comparable.get(POSE)
    if isinstance(rejected, Mapping):
        comparable[REJECTED] = {number: _code(line) for number, line in rejected.items()}
    if isinstance(pose, Mapping):
        comparable[POSE] = {key: value for key, value in pose.items() if key != MISSING}
    return comparable


def _code(line: object) -> object:
    """Status of a reason's line, or the line if it has none.

    So different lines are never taken for the same.
    """
    return status_of(line) or line if isinstance(line, str) else line


def _differ(before: object, after: object, part: str) -> bool:
    if part == POSE:
        after = _as_stored(before, after)
    return _bits(before) != _bits(after)


def _bits(value: object) -> str:
    """A JSON value as text to the last bit, keys sorted."""
    return json.dumps(value, sort_keys=True, allow_nan=False, ensure_ascii=False)


def _as_stored(before: object, after: object) -> object:
    """A record with only the keys of the stored one."""
    if isinstance(before, Mapping) and isinstance(after, Mapping):
        return {key: _as_stored(before[key], value) for key, value in after.items() if key in before}
    return after


def _only_in(after: object, before: object, place: str) -> list[str]:
    """Names of keys that the stored record lacks, "pose.dish.bending"."""
    if not (isinstance(before, Mapping) and isinstance(after, Mapping)):
        return []
    names: list[str] = []
    for key, value in after.items():
        names += _only_in(value, before[key], f"{place}.{key}") if key in before else [f"{place}.{key}"]
    return names


def _bits_of(matrix: NDArray[np.float64] | None) -> tuple[tuple[int, ...], bytes] | None:
    if matrix is None:
        return None
    contiguous = np.ascontiguousarray(matrix, dtype="<f8")
    return contiguous.shape, contiguous.tobytes()
