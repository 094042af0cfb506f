"""Which reading, or which whole station, does not belong to a profile: named, never dropped here.

With P the inverse covariance of the readings and r their departures from the expectation, an error of the form c has
w = c'P r / sqrt(c'P c), normal with unit variance where nothing is wrong. A single reading has c = (0 .. 1 .. 0), a
lying station ones in all its rows, beyond the offset that its prior allows. Wild readings go first, worst first, so
that they do not accuse their station. Two stations alone accuse each other equally: then only the conflict is named.
"""

from typing import NamedTuple

import numpy as np

from catseye.atmosphere.path.profile import Profile

CRITICAL = 4.5  # |w| of a reading: one good reading in 150 000, a night has thousands
CRITICAL_STATION = 3.5  # |w| of a station: one good station in 2000
DECISIVE = 9.0  # difference of w² of two stations below which neither is believed to be the wrong one


class Suspects(NamedTuple):
    """What a profile's test says.

    readings    (k,) int, rows of wild readings, worst first
    w           (n,) of each reading, all others taken as right but the wild ones; of these, when they were named
    stations    (s,) int, stations that lie, at most one when they are in conflict alone
    w_station   (stations,) of each station; nan where it has no reading
    error       (stations,) by how much it would be wrong if it were the only one, in the quantity's unit
    undecided   (u,) int, stations in a conflict that nothing settles
    """

    readings: np.ndarray
    w: np.ndarray
    stations: np.ndarray
    w_station: np.ndarray
    error: np.ndarray
    undecided: np.ndarray


def suspect_readings(profile: Profile, *, critical=CRITICAL, critical_station=CRITICAL_STATION) -> Suspects:
    """The wild readings and lying stations of a profile.

    profile            as its readings left it
    critical           |w| from which a reading is wild
    critical_station   |w| from which a station lies

    Source: [BAARDA68] (data snooping) with the covariance of the prior; [FOERSTNER16] chapter 4.
    """
    from scipy.linalg import cho_solve

    readings = profile.readings
    n = len(readings.value)
    inverse = cho_solve((profile.factor, True), np.eye(n))
    pull = profile.weights.copy()
    kept, w, wild = np.ones(n, dtype=bool), np.zeros(n), []
    while kept.sum() > 1:
        diagonal = np.diagonal(inverse)
        w[kept] = (pull / np.sqrt(np.where(kept, diagonal, 1.0)))[kept]
        worst = int(np.argmax(np.where(kept, np.abs(w), 0.0)))
        if abs(w[worst]) < critical:
            break
        wild.append(worst)
        kept[worst] = False
        row = inverse[worst] / diagonal[worst]  # the inverse without that row of the covariance
        pull = pull - row * pull[worst]
        inverse = inverse - np.outer(row, inverse[worst])
    stations = np.arange(int(readings.station.max()) + 1)
    member = ((readings.station[:, None] == stations) & kept[:, None]).astype(float)
    weight = np.einsum("is,ij,js->s", member, inverse, member, optimize=True)
    there = member.any(axis=0)
    pulled = member.T @ pull
    w_station = np.where(there, pulled / np.sqrt(np.where(there, weight, 1.0)), np.nan)
    error = np.where(there, pulled / np.where(there, weight, 1.0), np.nan)
    lying, undecided = _named(w_station, critical_station)
    return Suspects(np.array(wild, dtype=int), w, lying, w_station, error, undecided)


def _named(w, critical):
    """Stations that lie, stations that cannot be told apart."""
    none = np.zeros(0, dtype=int)
    size = np.where(np.isnan(w), 0.0, np.abs(w))
    if size.max() < critical:
        return none, none
    close = np.flatnonzero((size.max() ** 2 - size**2 < DECISIVE) & (size > 0.0))
    return (close, none) if len(close) == 1 else (none, close)
