"""Repeats of a line become one shot before an epoch is solved: a stream gives eight a second, and all say the same.

Phases are turned to the middle repeat's instant by what the predicted distance makes of the time between, as cycles
within a buffer are, and their mean is weighted by noise. Noise averages; what shakes the line counts as for one shot,
since repeats within seconds share it. A repeat that is off the others stays by itself, for the adjustment to judge.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from catseye.constants import MILLIMETRE, SECONDS_PER_DAY, SPEED_OF_LIGHT, TWO_PI
from catseye.records.site.folder import REFERENCE
from catseye.reduction.epoch.ranges import ShotPhase
from catseye.reduction.live.shots import PhasedShot

Array = NDArray[np.float64]
Lengths = Callable[[str, str, Array], Array]  # ranger, target, MJD (m,) to predicted distances (m,), m
RESTING = 10.0  # s from the first to the last repeat of a line whose distance stays
MOVING = 2.0  # s of one whose distance changes
WAY = 5.0 * MILLIMETRE  # that it may change: a place 10 mm wrong makes some micrometres of it
OFF_SIGMAS, OFF_WAY = 6.0, 1.0 * MILLIMETRE  # from the median, both: a repeat that is of something else


def joined_repeats(
    rows: Sequence[PhasedShot], lengths: Lengths, modulation_hz: float, *, index: float
) -> list[PhasedShot]:
    """The rows of an epoch with repeats joined, in order of time; `numbers` says what each stands for.

    rows            of an epoch; those with a reason and reference shots stay as they are
    lengths         predicted distances; NaN where nobody knows
    modulation_hz   Hz
    index           group refractive index, to 1e-4
    """
    lines: dict[tuple[str, str, int, int], list[PhasedShot]] = {}
    left = []
    for row in rows:
        shot = row.shot
        if row.reason or shot.target == REFERENCE:
            left.append(row)
        else:
            lines.setdefault((shot.ranger, shot.target, shot.cycles, shot.samples_per_cycle), []).append(row)
    per_metre = 2.0 * TWO_PI * modulation_hz * index / SPEED_OF_LIGHT
    for (ranger, target, _, _), line in lines.items():
        if len(line) == 1:
            left.append(line[0])
            continue
        way = lengths(ranger, target, np.array([r.mjd for r in line]))
        for group in _groups(line, way):
            left += _joined(line[group], way[group], per_metre)
    return sorted(left, key=lambda r: (r.mjd, r.shot.ranger, r.shot.number))


def _groups(line: Sequence[PhasedShot], way: Array) -> list[slice]:
    """Runs of repeats that belong together."""
    longest = RESTING if np.ptp(way) == 0.0 else MOVING
    groups, first = [], 0
    for k in range(1, len(line) + 1):
        if (
            k == len(line)
            or (line[k].mjd - line[first].mjd) * SECONDS_PER_DAY > longest
            or not abs(way[k] - way[first]) <= WAY
        ):
            groups.append(slice(first, k))
            first = k
    return groups


def _joined(group: Sequence[PhasedShot], way: Array, per_metre: float) -> list[PhasedShot]:
    """One row for repeats that agree, and the others by themselves."""
    if len(group) == 1:
        return list(group)
    turned = np.array([r.phase.phasor for r in group]) * np.exp(1j * per_metre * (way - way[0]))
    typical = complex(np.median(turned.real), np.median(turned.imag))
    across = np.array([r.phase.u_across for r in group])
    off = np.abs(np.angle(turned / typical))
    agree = off <= np.maximum(OFF_SIGMAS * across / abs(typical), OFF_WAY * per_metre)
    if np.count_nonzero(agree) < 2:
        return list(group)
    middle = int(np.flatnonzero(agree)[np.count_nonzero(agree) // 2])
    back = np.exp(-1j * per_metre * (way[middle] - way[0]))
    same = [r for r, on in zip(group, agree, strict=True) if on]
    weight = 1.0 / np.array([r.phase.u_phasor for r in same]) ** 2
    second, third = np.mean([r.phase.harmonics for r in same], axis=0).tolist()
    phase = ShotPhase(
        phasor=complex(back * (weight @ turned[agree]) / weight.sum()),
        u_phasor=float(weight.sum() ** -0.5),
        u_across=float(np.sum(1.0 / across[agree] ** 2) ** -0.5),
        offset=float(np.mean([r.phase.offset for r in same])),
        harmonics=(second, third),
        largest=max(r.phase.largest for r in same),
        reason=None,
    )
    one = replace(group[middle], phase=phase, repeats=tuple(r.shot.number for r in same))
    return [one, *(r for r, on in zip(group, agree, strict=True) if not on)]
