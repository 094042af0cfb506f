"""Join repeats of a line into one shot before solving.

A stream gives eight repeats a second. Phases are referred to the middle repeat's instant by the change of the predicted
distance, as cycles within a buffer are, and averaged with weights by noise. Noise averages; jitter of the line counts
as for one shot, since repeats within seconds share it. An outlying repeat stays separate, for the adjustment to judge.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from catseye.aliases import Array
from catseye.constants import MILLIMETRE, SECONDS_PER_DAY, SPEED_OF_LIGHT, TWO_PI
from catseye.records.site.folder import REFERENCE
from catseye.reduction.epoch.ranges import ShotPhase
from catseye.reduction.live.shots import PhasedShot

Lengths = Callable[[str, str, Array], Array]  # ranger, target, MJD (m,) to predicted distances (m,), m
RESTING = 10.0  # s from the first to the last repeat of a line of constant distance
MOVING = 2.0  # s, of a line of changing distance
LONGEST_CHANGE = 5.0 * MILLIMETRE  # largest change of distance: a position 10 mm wrong makes some micrometres of it
OUTLIER_SIGMAS, OUTLIER_DISTANCE = (
    6.0,
    1.0 * MILLIMETRE,
)  # from the median, both: a repeat outside is no repeat of the same target


def joined_repeats(
    rows: Sequence[PhasedShot], lengths: Lengths, modulation_hz: float, *, index: float
) -> list[PhasedShot]:
    """Rows by time, repeats joined; `numbers` lists the shots of each.

    rows            of an epoch; rejected ones and reference shots are unchanged
    lengths         predicted distances; NaN where unknown
    modulation_hz   Hz
    index           group refractive index, to 1e-4
    """
    lines: dict[tuple[str, str, int, int], list[PhasedShot]] = {}
    joined = []
    for row in rows:
        shot = row.shot
        if row.reason or shot.target == REFERENCE:
            joined.append(row)
        else:
            lines.setdefault((shot.ranger, shot.target, shot.cycles, shot.samples_per_cycle), []).append(row)
    per_metre = 2.0 * TWO_PI * modulation_hz * index / SPEED_OF_LIGHT
    for (ranger, target, _, _), line in lines.items():
        if len(line) == 1:
            joined.append(line[0])
            continue
        distances = lengths(ranger, target, np.array([r.mjd for r in line]))
        for group in _groups(line, distances):
            joined += _joined(line[group], distances[group], per_metre)
    return sorted(joined, key=lambda r: (r.mjd, r.shot.ranger, r.shot.number))


def _groups(line: Sequence[PhasedShot], distances: Array) -> list[slice]:
    """Runs of repeats to be joined."""
    longest = RESTING if np.ptp(distances) == 0.0 else MOVING
    groups, first = [], 0
    for k in range(1, len(line) + 1):
        if (
            k == len(line)
            or (line[k].mjd - line[first].mjd) * SECONDS_PER_DAY > longest
            or not abs(distances[k] - distances[first]) <= LONGEST_CHANGE
        ):
            groups.append(slice(first, k))
            first = k
    return groups


def _joined(group: Sequence[PhasedShot], distances: Array, per_metre: float) -> list[PhasedShot]:
    """One row for repeats that agree, and the outliers."""
    if len(group) == 1:
        return list(group)
    turned = np.array([r.phase.phasor for r in group]) * np.exp(1j * per_metre * (distances - distances[0]))
    typical = complex(np.median(turned.real), np.median(turned.imag))
    across = np.array([r.phase.u_across for r in group])
    off = np.abs(np.angle(turned / typical))
    agree = off <= np.maximum(OUTLIER_SIGMAS * across / abs(typical), OUTLIER_DISTANCE * per_metre)
    if np.count_nonzero(agree) < 2:
        return list(group)
    middle = int(np.flatnonzero(agree)[np.count_nonzero(agree) // 2])
    back = np.exp(-1j * per_metre * (distances[middle] - distances[0]))
    agreeing = [r for r, on in zip(group, agree, strict=True) if on]
    weight = 1.0 / np.array([r.phase.u_phasor for r in agreeing]) ** 2
    second, third = np.mean([r.phase.harmonics for r in agreeing], axis=0).tolist()
    phase = ShotPhase(
        phasor=complex(back * (weight @ turned[agree]) / weight.sum()),
        u_phasor=float(weight.sum() ** -0.5),
        u_across=float(np.sum(1.0 / across[agree] ** 2) ** -0.5),
        offset=float(np.mean([r.phase.offset for r in agreeing])),
        harmonics=(second, third),
        largest=max(r.phase.largest for r in agreeing),
        reason=None,
    )
    one = replace(group[middle], phase=phase, repeats=tuple(r.shot.number for r in agreeing))
    return [one, *(r for r, on in zip(group, agree, strict=True) if not on)]
