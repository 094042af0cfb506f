"""postures.csv: positions of a telescope that moved during a night."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np

from catseye.constants import DEGREE
from catseye.records.files.record import Mjd, Record, Within
from catseye.records.files.refusal import in_row
from catseye.records.night.live import TICKS_PER_DAY, LivePosture
from catseye.records.night.shot import ShotRow

POSTURES = "postures.csv"  # optional
NEAREST = 2.0 / 86_400.0  # days, longest extrapolation of rates from a posture to a shot


class PostureRow(Record):
    """Row of postures.csv.

    mjd_utc           time
    azimuth_deg       encoder, clockwise from north
    elevation_deg     encoder
    azimuth_rate_deg_s, elevation_rate_deg_s   rates at that time
    """

    mjd_utc: Mjd
    azimuth_deg: Annotated[float, Within(-720, 720)]
    elevation_deg: Annotated[float, Within(-10, 100)]
    azimuth_rate_deg_s: Annotated[float, Within(-10, 10)]
    elevation_rate_deg_s: Annotated[float, Within(-10, 10)]


def postures_of(rows: Sequence[PostureRow], shots: Sequence[ShotRow]) -> tuple[LivePosture, ...]:
    """Postures in time order.

    Raises InputError for a row not after the last, or a shot without a posture within 2 s.
    """
    for number, (row, last) in enumerate(zip(rows[1:], rows, strict=False), start=2):
        if row.mjd_utc <= last.mjd_utc:
            before = f"mjd_utc = {row.mjd_utc!r} is not after {last.mjd_utc!r}"
            raise in_row(POSTURES, number, f"{before} (expected in order of time)")
    if rows:
        times = np.array([row.mjd_utc for row in rows])
        for number, shot in enumerate(shots, start=1):
            at = int(np.searchsorted(times, shot.mjd_utc))
            if np.min(np.abs(times[max(at - 1, 0) : at + 1] - shot.mjd_utc)) > NEAREST:
                raise in_row("shots.csv", number, f"mjd_utc = {shot.mjd_utc!r} has no row of {POSTURES} within 2 s")
    return tuple(
        LivePosture(
            round(row.mjd_utc * TICKS_PER_DAY),
            row.azimuth_deg * DEGREE,
            row.elevation_deg * DEGREE,
            row.azimuth_rate_deg_s * DEGREE,
            row.elevation_rate_deg_s * DEGREE,
        )
        for row in rows
    )
