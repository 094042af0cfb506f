"""Spikes and stuck sensors in a series of readings.

Pure functions of arrays. Air is never as still as a sensor that has stopped, and never moves as fast as a wrong digit;
between the two a series is left alone. A logger that rounds to 0.1 °C repeats its reading for hours on a calm night: a
coarse series counts as stuck only where another station shows that the air has changed.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

SIDE, NEAR = 5, 3  # readings on each side that a spike is compared with, and that give a level
FEWEST_NEAR = 2  # of them, that agree with each other
WILD = 10.0  # standard deviations of the series' own scatter that a spike exceeds
LEAST_READINGS, LEAST_S = 10, 600.0  # of a stuck run: calm air repeats a rounded reading for minutes
BLOCK, LEAST_STEPS = 10, 5  # steps in which the calmest part of the series is looked for
SMOOTH = 0.7  # share of repeats from which the series says nothing about its own noise
CHANCE = 1e-6  # of as many repeats, by the calmest other part of the series
CROSSING_S = 900.0  # in which a front reaches all stations of a site: 0.5 m/s over 450 m
CAUGHT_UP = (0.5, 1.5)  # share of the others' change that a released sensor makes good in one step


@dataclass(frozen=True)
class Sensor:
    """Behaviour of readings of one quantity.

    key      column of weather.csv
    name     of the quantity, for people
    instrument   that reads it
    unit     of it
    least    smallest spike: no faster change in one reading is known
    rate     additional allowance a second between readings
    fine     resolution up to which outdoor air never repeats its reading for long
    change   of another station, from which a coarse series must have moved too
    """

    key: str
    name: str
    instrument: str
    unit: str
    least: float
    rate: float
    fine: float
    change: float


# A spike: gusts and plumes make 1 °C in a screened thermometer, and a foehn that breaks through makes 5 °C in some
# minutes; a gust front 3 hPa; eddies 10 %. Fine: turbulence and pressure waves exceed 0.02 °C, 0.02 hPa within minutes.
TEMPERATURE = Sensor("temperature_c", "temperature", "thermometer", "°C", 2.0, 0.01, 0.02, 1.5)
PRESSURE = Sensor("pressure_mb", "pressure", "barometer", "hPa", 3.0, 0.01, 0.02, 1.0)
HUMIDITY = Sensor("humidity_pct", "humidity", "hygrometer", "%", 25.0, 0.05, 0.1, 30.0)


@dataclass(frozen=True)
class ConstantRun:
    """Run of equal readings, both ends included."""

    first: int
    last: int


def spikes(seconds: np.ndarray, values: np.ndarray, sensor: Sensor) -> np.ndarray:
    """Rows of readings that stand apart from both sides.

    seconds, values   (n,) of one station

    Up to three in a row. A front is no spike: after it the readings stay. Neither is a reading at an end of the series.

    >>> spikes(np.arange(9) * 30.0, np.array([11.0, 11.1, 11.0, 11.2, 41.1, 11.1, 11.0, 11.1, 11.2]), TEMPERATURE)
    array([4])
    """
    n = len(values)
    if n < 2 * FEWEST_NEAR + 1:
        return np.zeros(0, dtype=int)
    scatter = 1.4826 * float(np.median(np.abs(np.diff(values) - np.median(np.diff(values)))))
    sides = np.median(sliding_window_view(np.pad(values, SIDE, mode="edge"), SIDE), axis=1)
    rows = np.arange(FEWEST_NEAR, n - FEWEST_NEAR)
    before, after, value = sides[rows], sides[rows + SIDE + 1], values[rows]
    apart = np.minimum(np.abs(value - before), np.abs(value - after))
    step = np.maximum(seconds[rows] - seconds[rows - 1], seconds[rows + 1] - seconds[rows])
    one_side = (value - before) * (value - after) > 0.0
    limit = np.maximum(sensor.least + sensor.rate * step, WILD * scatter)
    apart_rows: np.ndarray = rows[one_side & (apart > limit) & (np.abs(after - before) < 0.5 * apart)]
    return apart_rows


def stuck(
    seconds: np.ndarray, values: np.ndarray, sensor: Sensor, references: Sequence[tuple[np.ndarray, np.ndarray]] = ()
) -> list[ConstantRun]:
    """Runs of equal readings that the series' own scatter excludes.

    seconds, values   (n,) of one station
    others            the same of each other station

    A fine series is stuck where its calmest other part makes so many repeats a chance of 1e-6. A coarse one, and
    one that never changes, is stuck only where another station changed meanwhile and this one made that good in one
    step when it moved again.
    """
    result = []
    for run in _equal(seconds, values):
        repeats = _repeats_elsewhere(values, run)
        length = run.last - run.first
        rare = repeats is not None and repeats < SMOOTH and repeats**length * len(values) < CHANCE
        if (rare and resolution_of(values) <= sensor.fine) or any(
            _left_behind(seconds, values, run, reference=reference, sensor=sensor) for reference in references
        ):
            result.append(run)
    return result


def _equal(seconds: np.ndarray, values: np.ndarray) -> list[ConstantRun]:
    """Runs of equal readings, long enough to be looked at."""
    edges = np.flatnonzero(np.diff(values) != 0.0)
    starts, ends = np.concatenate([[0], edges + 1]), np.concatenate([edges, [len(values) - 1]])
    return [
        ConstantRun(int(i), int(j))
        for i, j in zip(starts, ends, strict=True)
        if j - i + 1 >= LEAST_READINGS and seconds[j] - seconds[i] >= LEAST_S
    ]


def resolution_of(values: np.ndarray) -> float:
    """Smallest difference of two different readings; infinite of equal ones."""
    steps = np.diff(np.unique(np.round(values, 6)))
    return round(float(steps.min()), 6) if len(steps) else np.inf


def _repeats_elsewhere(values: np.ndarray, run: ConstantRun) -> float | None:
    """Largest share of repeated readings in ten steps outside a run.

    By Laplace's rule, (r + 1) / (n + 2); None with fewer than five steps.
    """
    repeated = np.diff(values) == 0.0
    shares = []
    for part in (repeated[: max(run.first - 1, 0)], repeated[run.last + 1 :]):
        if len(part) >= LEAST_STEPS:
            width = min(BLOCK, len(part))
            shares.append((int(sliding_window_view(part, width).sum(axis=1).max()) + 1) / (width + 2))
    return max(shares, default=None)


def _left_behind(
    seconds: np.ndarray,
    values: np.ndarray,
    run: ConstantRun,
    *,
    reference: tuple[np.ndarray, np.ndarray],
    sensor: Sensor,
) -> bool:
    """True if the air changed meanwhile and the sensor caught up at once."""
    when, level = reference
    first, last = seconds[run.first], seconds[run.last]
    after = slice(run.last + 1, run.last + 1 + NEAR)
    if not len(values[after]) or last - first < 2.0 * CROSSING_S or not (when[0] <= first and when[-1] >= last):
        return False

    def near(at: float) -> float:
        """Median of the other's readings about a time."""
        return float(np.median(level[np.argsort(np.abs(when - at))[: 2 * NEAR - 1]]))

    early, late = near(first), near(last - CROSSING_S)  # a front that comes later may not have arrived here
    step = float(np.median(values[after]) - values[run.last])
    meanwhile = near(float(np.median(seconds[after]))) - near(last)  # the other's own step then
    change = near(last) - early
    limit = max(sensor.change, 5.0 * min(resolution_of(values), resolution_of(level)))
    return bool(
        min(abs(late - early), abs(change)) >= limit
        and CAUGHT_UP[0] <= step / change <= CAUGHT_UP[1]
        and abs(meanwhile) < 0.5 * abs(change)
    )
