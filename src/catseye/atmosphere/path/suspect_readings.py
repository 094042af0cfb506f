"""Outlier tests of a profile: name wild readings or biased stations.

Nothing is removed here.

With P the inverse covariance of the readings and r their departures from the expectation, an error of the form c has
w = c'P r / sqrt(c'P c), normal with unit variance where nothing is wrong. A single reading has c = (0 .. 1 .. 0), a
biased station ones in all its rows, beyond the offset that its prior allows. Wild readings are removed first, worst
first, so that they do not implicate their station. Two stations alone implicate each other equally: then only the
conflict is named.
"""

from typing import NamedTuple

import numpy as np

from catseye.atmosphere.path.profile import Profile

CRITICAL = 4.5  # |w| of a reading: one good reading in 150 000, a night has thousands
CRITICAL_STATION = 3.5  # |w| of a station: one good station in 2000
DECISIVE = 9.0  # difference of w² of two stations below which neither is identified as wrong


class Suspects(NamedTuple):
    """Result of a profile's outlier test.

    readings    (k,) int, rows of wild readings, worst first
    w           (n,) of each reading, the wild ones excluded; of a wild one, when it was named
    stations    (s,) int, biased stations
    w_station   (stations,) of each station; nan where it has no reading
    error       (stations,) estimated bias if it is the only biased station, in the quantity's unit
    undecided   (u,) int, stations in an unresolved conflict
    """

    readings: np.ndarray
    w: np.ndarray
    stations: np.ndarray
    w_station: np.ndarray
    error: np.ndarray
    undecided: np.ndarray


def suspect_readings(profile: Profile, *, critical=CRITICAL, critical_station=CRITICAL_STATION) -> Suspects:
    """Find the wild readings and biased stations of a profile.

    profile            the profile to test
    critical           |w| from which a reading is wild
    critical_station   |w| from which a station is biased

    Source: [BAARDA68] (data snooping) with the covariance of the prior; [FOERSTNER16] chapter 4.
    """
    from scipy.linalg import cho_solve

    readings = profile.readings
    n = len(readings.value)
    inverse = cho_solve((profile.factor, True), np.eye(n))
    pull = profile.weights.copy()
    retained, w, wild = np.ones(n, dtype=bool), np.zeros(n), []
    while retained.sum() > 1:
        diagonal = np.diagonal(inverse)
        w[retained] = (pull / np.sqrt(np.where(retained, diagonal, 1.0)))[retained]
        worst = int(np.argmax(np.where(retained, np.abs(w), 0.0)))
        if abs(w[worst]) < critical:
            break
        wild.append(worst)
        retained[worst] = False
        row = inverse[worst] / diagonal[worst]  # the inverse without that row of the covariance
        pull = pull - row * pull[worst]
        inverse = inverse - np.outer(row, inverse[worst])
    stations = np.arange(int(readings.station.max()) + 1)
    member = ((readings.station[:, None] == stations) & retained[:, None]).astype(float)
    weight = np.einsum("is,ij,js->s", member, inverse, member, optimize=True)
    present = member.any(axis=0)
    pulled = member.T @ pull
    w_station = np.where(present, pulled / np.sqrt(np.where(present, weight, 1.0)), np.nan)
    error = np.where(present, pulled / np.where(present, weight, 1.0), np.nan)
    lying, undecided = _named(w_station, critical_station)
    return Suspects(np.array(wild, dtype=int), w, lying, w_station, error, undecided)


def _named(w, critical):
    """Biased stations, and stations in an unresolved conflict."""
    empty = np.zeros(0, dtype=int)
    size = np.where(np.isnan(w), 0.0, np.abs(w))
    if size.max() < critical:
        return empty, empty
    close = np.flatnonzero((size.max() ** 2 - size**2 < DECISIVE) & (size > 0.0))
    return (close, empty) if len(close) == 1 else (empty, close)
