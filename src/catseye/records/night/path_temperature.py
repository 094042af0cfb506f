"""path_temperatures.csv: acoustic air temperatures along lines of a campaign."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from catseye.records.files.reading import column
from catseye.records.files.record import Mjd, Name, Record, Within


class PathTemperature(Record):
    """Row of path_temperatures.csv.

    mjd_utc           middle of the measurement
    ranger, target    ends of the line, as in shots.csv
    temperature_c     mean along the straight line between them
    u_temperature_c   of one row, including what all rows of the line share (acoustic length, delay)
    """

    mjd_utc: Mjd
    ranger: Name
    target: Name
    temperature_c: Annotated[float, Within(-60, 60)]
    u_temperature_c: Annotated[float, Within(0, 10, above=True)]


@dataclass(frozen=True, eq=False)
class PathTemperatureTable:
    """All rows in file order, as read-only columns."""

    mjd_utc: np.ndarray
    ranger: tuple[str, ...]
    target: tuple[str, ...]
    temperature_c: np.ndarray
    u_temperature_c: np.ndarray

    def __len__(self) -> int:
        return len(self.ranger)


def path_temperature_columns(rows: Sequence[PathTemperature]) -> PathTemperatureTable:
    return PathTemperatureTable(
        mjd_utc=column([row.mjd_utc for row in rows], np.float64),
        ranger=tuple(row.ranger for row in rows),
        target=tuple(row.target for row in rows),
        temperature_c=column([row.temperature_c for row in rows], np.float64),
        u_temperature_c=column([row.u_temperature_c for row in rows], np.float64),
    )
