"""Epochs of a structure and ranges at full rate from a journal."""

from collections.abc import Sequence
from dataclasses import replace
from fnmatch import fnmatchcase

import numpy as np

from catseye.aliases import Array
from catseye.constants import SECONDS_PER_DAY
from catseye.coordinator.journal.entries import EpochSolution
from catseye.coordinator.journal.reader import JournalReader
from catseye.errors import InputError
from catseye.records.night.live import TICKS_PER_DAY, LiveWeather
from catseye.reduction.structure.epochs import ReadEpochs
from catseye.reduction.structure.group import PlacesEpoch
from catseye.reduction.structure.vibration import RangeSeries

RECENT = 1800.0 / SECONDS_PER_DAY  # d, largest time between weather and epoch
CORRELATED = (
    "A journal's solutions build on each other: they are not independent, and the model's claimed uncertainty is too "
    "small; the epochs left out show by how much. Take one every few minutes (every_s)."
)
AIR = "Temperatures are those of the air at the weather stations; the steel lags behind."


def read_journal_epochs(journal: str, *, run: int | str | None = None, every_s: float = 0.0) -> ReadEpochs:
    """Solutions of a run as epochs, with the mean of the stations' temperatures around them.

    journal   file or URL
    run       number or beginning of its uuid; None for the last
    every_s   s, least time between two epochs; 0 takes all

    Raises InputError for an unknown run, or if no solution has points with a covariance.
    """
    with JournalReader(journal) as reader:
        number = reader.run(run).run
        weather: list[tuple[float, float]] = []
        epochs: list[PlacesEpoch] = []
        without = 0
        for _, entry in reader.events(number, kinds=["solutions", "weather"], buffers=False):
            if isinstance(entry, LiveWeather) and np.isfinite(entry.temperature_c):
                weather.append((entry.ticks / TICKS_PER_DAY, entry.temperature_c))
            elif isinstance(entry, EpochSolution):
                mjd = entry.ticks / TICKS_PER_DAY
                if epochs and (mjd - epochs[-1].mjd) * SECONDS_PER_DAY < every_s:
                    continue
                solved = _solved(entry, mjd)
                without += solved is None
                epochs += [solved] if solved is not None else []
        hashes = {f"run {number}: {path}": digest for path, digest in reader.run(number).hashes.items()}
    if not epochs:
        raise InputError(f"journal {journal}: run {number} has no solution with points and their covariance")
    notes = [AIR]
    if without:
        notes.append(f"{without} solutions gave no points and were left out.")
    times, warm = (np.array(v) for v in zip(*weather, strict=True)) if weather else (np.zeros(0), np.zeros(0))
    return ReadEpochs(tuple(_warmed(epoch, times, warm) for epoch in epochs), hashes, tuple(notes), (CORRELATED,))


def _solved(entry: EpochSolution, mjd: float) -> PlacesEpoch | None:
    answer, q = entry.answer, entry.covariance
    names, x = answer.get("names"), answer.get("x")
    numbers = (answer.get("azimuth"), answer.get("elevation"))
    if not names or not x or q is None or q.shape != (3 * len(names),) * 2 or None in numbers:
        return None
    places = np.array(x, dtype=float)
    if not np.isfinite(places).all():
        return None
    label = f"epoch {answer.get('number')}"
    azimuth, elevation = (float(v) for v in numbers if v is not None)
    return PlacesEpoch(
        label=label,
        mjd=mjd,
        azimuth=azimuth,
        elevation=elevation,
        temperature_c=float("nan"),
        names=tuple(names),
        coordinates=places,
        covariance=q,
    )


def _warmed(epoch: PlacesEpoch, times: Array, warm: Array) -> PlacesEpoch:
    near = np.abs(times - epoch.mjd) <= RECENT
    return replace(epoch, temperature_c=float(warm[near].mean())) if near.any() else epoch


def read_range_series(
    journal: str, points: Sequence[str], *, run: int | str | None = None, least: int = 64
) -> tuple[tuple[RangeSeries, ...], dict[str, str], float]:
    """Used ranges of a run by ranger and target, hashes of its files, and the MJD of 0 s.

    journal   file or URL
    points    names of targets, or patterns
    run       number or beginning of its uuid; None for the last
    least     smallest number of ranges of a series

    Raises InputError for an unknown run or target.
    """
    with JournalReader(journal) as reader:
        number = reader.run(run).run
        hashes = {f"run {number}: {path}": digest for path, digest in reader.run(number).hashes.items()}
        rows: dict[tuple[str, str], list[tuple[int, float, float, float]]] = {}
        targets: set[str] = set()
        for _, entry in reader.shots(number, buffers=False):
            shot = entry.shot
            targets.add(shot.target)
            if entry.status == "used" and any(fnmatchcase(shot.target, p) for p in points):
                rows.setdefault((shot.ranger, shot.target), []).append(
                    (shot.ticks, 0.5 * shot.duration, entry.range_, entry.u_range)
                )
    long_series = {key: np.array(sorted(ranges)) for key, ranges in rows.items() if len(ranges) >= least}
    if not long_series:
        some = ", ".join(sorted(targets)[:8])
        most = max((len(ranges) for ranges in rows.values()), default=0)
        raise InputError(
            f"journal {journal}: run {number} has no target {', '.join(points)} with {least} used ranges of one ranger "
            f"(the most is {most}; its targets are {some})"
        )
    zero = min(int(ranges[0, 0]) for ranges in long_series.values())
    series = []
    for (ranger, target), ranges in sorted(long_series.items()):
        seconds = (ranges[:, 0] - zero) * (SECONDS_PER_DAY / TICKS_PER_DAY) + ranges[:, 1]
        good = np.isfinite(ranges[:, 2:]).all(axis=1) & np.concatenate([[True], np.diff(seconds) > 0.0])
        window = 2.0 * float(np.median(ranges[:, 1]))
        series.append(
            RangeSeries(
                ranger=ranger,
                target=target,
                seconds=seconds[good],
                ranges=ranges[good, 2],
                u=ranges[good, 3],
                window=window,
            )
        )
    return tuple(series), hashes, zero / TICKS_PER_DAY
