"""Parked beams: time until the Sun or a box comes to them."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from catseye.coordinator.visibility.surroundings import KeepClear, later
from catseye.coordinator.visibility.vantage import Vantage, seconds_between
from catseye.records.night.live import LivePosture

AHEAD = 600.0  # s, prediction time
AHEAD_RIDING = 60.0  # s, of a beam on the telescope: its rates are constant for no longer
FINEST = 2.0  # s


@dataclass(frozen=True)
class Alarm:
    """A hazard that a ranger must avoid in time.

    ranger   name
    within   s from now; 0: overdue
    cause    "sun", "box" or "interlock"
    remedy   "move": take the mirror away; "dark": switch the laser off (PS 0)
    text     one line for people
    """

    ranger: str
    within: float
    cause: Literal["sun", "box", "interlock"]
    remedy: Literal["move", "dark"]
    text: str


def parked_alarms(
    keep_clear: KeepClear, vantage: Vantage, counts: tuple[float, float], *, now_ticks: int, posture: LivePosture | None
) -> list[Alarm]:
    """Alarms of a beam parked at counts, from now (ticks) on.

    None for a ranger on the telescope without a posture.

    posture   of the telescope; its rates are assumed constant
    """
    if vantage.frame == "reflector" and posture is None:
        return []
    alarms: list[Alarm] = []
    end = later(now_ticks, AHEAD if vantage.frame == "ground" else AHEAD_RIDING)
    at = f"at counts {counts[0]:.0f}, {counts[1]:.0f}"
    sun = _comes(keep_clear, vantage, counts, (now_ticks, end), posture=posture, box=False)
    if sun is not None:
        text = f"{vantage.name}: the Sun comes to its beam {at} {in_words(sun[0])}: move it"
        alarms.append(Alarm(vantage.name, sun[0], "sun", "move", text))
    if keep_clear.boxes:
        box = _comes(keep_clear, vantage, counts, (now_ticks, end), posture=posture, box=True)
        if box is not None:
            text = f"{vantage.name}: its beam {at} is on {box[1]} {in_words(box[0])}: move it"
            alarms.append(Alarm(vantage.name, box[0], "box", "move", text))
    return alarms


def in_words(seconds: float) -> str:
    """Time until a hazard, in words."""
    return "now" if seconds <= 0.0 else f"in {seconds:.0f} s"


def _comes(
    keep_clear: KeepClear,
    vantage: Vantage,
    counts: tuple[float, float],
    span: tuple[int, int],
    *,
    posture: LivePosture | None,
    box: bool,
) -> tuple[float, str] | None:
    """Time, s, until the Sun or a box comes to a parked beam, and which.

    Early by 2 s at most; None if not in the span. A span that is free as a whole is skipped; one that is not is halved.
    """
    n: NDArray[np.float64] = np.array(counts)
    spans = [span]
    while spans:
        low, high = spans.pop()
        around = keep_clear.around(vantage, low, high, posture=posture)
        if box:
            name = around.box_in(n, n) if bool(around.near_boxes(n, n)) else None
        else:
            name = "the Sun" if float(around.from_sun(n, n)) <= 0.0 else None
        if name is None:
            continue
        if seconds_between(low, high) <= FINEST or (box and vantage.frame == "ground"):
            return seconds_between(span[0], low), name
        middle = (low + high) // 2
        spans += [(middle, high), (low, middle)]
    return None
