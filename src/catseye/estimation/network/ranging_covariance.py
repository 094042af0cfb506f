"""Covariance of a ranging solution over the parameter vector of its network."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csc_array, sparray

from catseye.estimation.network.multilateration.solution import Mapped, RangingSolution

ROWS = 5_000  # observations per batch


@dataclass(frozen=True, eq=False)
class RangingCovariance:
    """Covariance (see `covariance.Covariance`) with dense stations and targets that follow them.

    solution          of the ranging network
    station, target   (points,) index among its stations, or targets; -1
    zero, scale       (stations,) parameter index, counted after the points; -1
    """

    solution: RangingSolution
    station: np.ndarray
    target: np.ndarray
    zero: np.ndarray
    scale: np.ndarray

    @cached_property
    def _station_columns(self) -> np.ndarray:
        """Index (N,) of each parameter among the stations' parameters.

        -1 for targets.
        """
        count, width = len(self.station), self.solution.width
        used = sum(int(np.sum(c >= 0)) for c in (self.zero, self.scale))
        place = np.full(3 * count + used, -1)
        at = np.flatnonzero(self.station >= 0)
        place[3 * at[:, None] + np.arange(3)] = self.station[at][:, None] * width + np.arange(3)
        for k, columns in ((3, self.zero), (4, self.scale)):
            stations = np.flatnonzero(columns >= 0)
            place[3 * count + columns[stations]] = stations * width + k
        return place

    @cached_property
    def _all(self) -> Mapped:
        station_columns, n = self._station_columns, len(self.solution.covariance)
        maps, target = np.zeros((len(station_columns), n)), np.full(len(station_columns), -1)
        at_station, late = np.flatnonzero(station_columns >= 0), np.flatnonzero(station_columns < 0)
        maps[at_station, station_columns[at_station]] = 1.0
        target[late] = self.target[late // 3]
        maps[late] = self.solution.following(np.arange(len(self.solution.targets)))[target[late], late % 3]
        return Mapped(maps, target, np.arange(len(station_columns)) % 3)

    def matrix(self) -> np.ndarray:
        return self.solution.joined(self._all, self._all)

    def across(self, columns: np.ndarray) -> np.ndarray:
        return self.solution.joined(self._all, self._all[columns])

    def within(self, columns: np.ndarray) -> np.ndarray:
        chosen = self._all[columns]
        return self.solution.joined(chosen, chosen)

    def products(self, columns: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Products for rows of the stations' parameters and of one target's coordinates."""
        at, a, everything = np.maximum(columns, 0), np.where(columns < 0, 0.0, a), self._all
        result = np.empty(at.shape)
        for low in range(0, len(at), ROWS):
            part = slice(low, low + ROWS)
            result[part] = self.solution.products(everything[at[part]], a[part])
        return result

    def solve(self, b: np.ndarray) -> np.ndarray:
        met = np.flatnonzero(np.any(b.reshape(len(b), -1) != 0.0, axis=1))
        return np.asarray(self.across(met) @ b[met])

    def carried(self, matrix: sparray, other_matrix: sparray | None = None) -> np.ndarray:
        pair = [csc_array(item) for item in ((matrix,) if other_matrix is None else (matrix, other_matrix))]
        met = np.flatnonzero(sum(np.diff(item.indptr) for item in pair))
        return np.asarray(pair[0][:, met] @ (pair[-1][:, met] @ self.within(met)).T)

    def blocks(self, first: np.ndarray) -> np.ndarray:
        result = np.empty((len(self.station), 3, 3))
        result[self.station >= 0] = self.solution.covariance_stations
        result[self.target >= 0] = self.solution.covariance_targets
        return result[first // 3]

    def diagonal(self) -> np.ndarray:
        station_columns = self._station_columns
        result = np.empty(len(station_columns))
        late = np.flatnonzero(station_columns < 0)
        result[station_columns >= 0] = np.diag(self.solution.covariance)[station_columns[station_columns >= 0]]
        result[late] = self.solution.covariance_targets[self.target[late // 3], late % 3, late % 3]
        return result
