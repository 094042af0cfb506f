"""Rows of the samplers POSE, BEAM and FOCUS: motions of dish and feed since the reference epoch, and the beam."""

from collections.abc import Iterable, Mapping
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.coordinator.condition import verdict_of
from catseye.coordinator.journal.entries import EpochSolution
from catseye.coordinator.samplers.columns import TRIANGLE
from catseye.ranger.line import stamp_text

Row = tuple[str, ...]  # a stamp, then values as sent
Pose = Mapping[str, object]  # as an answer stores it


def number_word(value: object) -> str:
    """A number as sent; `none` for one that is unknown, or none."""
    if isinstance(value, bool) or not isinstance(value, int | float) or value != value or abs(value) == float("inf"):
        return "none"
    return repr(value)


def pose_rows(entry: EpochSolution) -> Iterable[tuple[str, Row]]:
    """Rows by sampler; none before the reference epoch, or without enough points."""
    pose = entry.answer.get("pose")
    if not isinstance(pose, Mapping):
        return
    first = (number_word(entry.answer.get("number")), number_word(entry.answer.get("reference")))
    stamp, verdict = stamp_text(entry.ticks), verdict_of(entry).word
    for body in (pose.get("dish"), pose.get("feed")):
        if isinstance(body, Mapping):
            yield "POSE", (stamp, *first, *_motion(body))
    offset, covariance = offset_of_pose(pose)
    if np.isfinite(offset[:2]).all():
        c = covariance
        values = (*offset[:2].tolist(), *(float(c[i, j]) for i, j in ((0, 0), (0, 1), (1, 1))))
        yield "BEAM", (stamp, *first, *map(number_word, values), verdict)
    if np.isfinite(offset[2]):
        values = (float(offset[2]), float(np.sqrt(covariance[2, 2])))
        yield "FOCUS", (stamp, *first, *map(number_word, values), verdict)


def offset_of_pose(pose: Pose) -> tuple[Array, Array]:
    """Offset (3,) of beam and focus, rad, rad, m, and its covariance (3, 3); NaN where unknown."""
    return _floats(pose.get("offset"), (3,)), _floats(pose.get("covariance"), (3, 3))


def _motion(body: Pose) -> Iterable[str]:
    covariance = _floats(body["covariance"], (6, 6))
    yield str(body["body"])
    for key in ("pivot", "translation", "rotation"):
        yield from map(number_word, _floats(body[key], (3,)).tolist())
    yield from (number_word(float(covariance[i, j])) for i, j in TRIANGLE)


def _floats(value: object, shape: tuple[int, ...]) -> Array:
    """A stored array; NaN where it is unknown or of another shape."""
    unknown = np.full(shape, np.nan)
    array = unknown if value is None else np.array(cast(ArrayLike, value), dtype=float)
    return array if array.shape == shape else unknown
