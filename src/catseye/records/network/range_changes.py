"""Two tables of ranges over the same lines, and a table of approximate coordinates: changes of range.

    points.csv              point,x,y,z and optionally u_x,u_y,u_z: approximate, with their standard uncertainties
    before.csv, after.csv   from,to,distance and sigma, or a claim for those without

What a range has in both epochs alike, such as the zero of its ranger, cancels in its change, and need not be known.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from catseye.errors import InputError
from catseye.records.files.columns import columns_of
from catseye.records.files.reading import Folder
from catseye.records.files.refusal import shown
from catseye.records.network.claim import NO_CLAIM, RangeClaim
from catseye.records.network.folder import RANGE_COLUMNS, numbered
from catseye.records.network.ranged_targets import read_stations, sigmas_of


class RangeChanges(NamedTuple):
    """Changes of the ranges from s stations to n points.

    stations, points   names
    x_stations         (s, 3) m, approximate
    x                  (n, 3) m, approximate
    u_stations, u      (s, 3), (n, 3) m, their standard uncertainties
    change             (n, s) m, after less before; nan where a range lacks in either
    u_change           (n, s) m
    distance           (n, s) m, before
    alone              names of the lines of one epoch only, station to point
    """

    stations: tuple[str, ...]
    points: tuple[str, ...]
    x_stations: np.ndarray
    x: np.ndarray
    u_stations: np.ndarray
    u: np.ndarray
    change: np.ndarray
    u_change: np.ndarray
    distance: np.ndarray
    alone: tuple[str, ...]


def read_range_changes(before: Path, after: Path, points: Path, claim: RangeClaim = NO_CLAIM) -> RangeChanges:
    """Changes of range of two tables.

    claim   standard uncertainty of a range whose sigma is blank or missing

    Raises InputError for a name that is not in the table of points, a point that is station and target, a pair that
    occurs twice, and tables without a common line.
    """
    names, x, u = read_stations(points)
    listed = list(names)
    epochs = []
    for path in (before, after):
        table = columns_of(Folder(path.parent).text(path.name), path.name, RANGE_COLUMNS, optional=("sigma",))
        at = np.stack([numbered(table, end, names, points.name) for end in ("from", "to")], axis=1)
        distance = table.numbers("distance")
        table.check("distance", distance > 0.0, "above 0 m")
        sigma = sigmas_of(table, distance, claim)
        lines: dict[tuple[int, int], tuple[float, float]] = {}
        for row, (i, j) in enumerate(at.tolist()):
            if (i, j) in lines:
                raise table.refuse(row, f"{shown(listed[i])} to {shown(listed[j])} occurs twice (expected each once)")
            lines[i, j] = (float(distance[row]), float(sigma[row]))
        epochs.append(lines)
    first, second = epochs
    common = [pair for pair in first if pair in second]
    if not common:
        raise InputError(
            f"{before.name} and {after.name} have no line in common (expected the same stations and points)"
        )
    stations, targets = (sorted({pair[k] for pair in common}) for k in (0, 1))
    for both in set(stations) & set(targets):
        raise InputError(
            f"{shown(listed[both])} is both station and target (expected stations that do not move: where stations "
            "move, adjust both epochs as networks)"
        )
    change, u_change, distance = np.full((3, len(targets), len(stations)), np.nan)
    for i, j in common:
        place = (targets.index(j), stations.index(i))
        change[place] = second[i, j][0] - first[i, j][0]
        u_change[place] = np.hypot(first[i, j][1], second[i, j][1])
        distance[place] = first[i, j][0]
    alone = tuple(f"{listed[i]} to {listed[j]}" for i, j in sorted(set(first) ^ set(second)))
    return RangeChanges(
        stations=tuple(listed[k] for k in stations),
        points=tuple(listed[k] for k in targets),
        x_stations=x[stations],
        x=x[targets],
        u_stations=u[stations],
        u=u[targets],
        change=change,
        u_change=u_change,
        distance=distance,
        alone=alone,
    )
