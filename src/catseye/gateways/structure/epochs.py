"""Epochs of a structure from reductions, a list, or a journal; ranges at full rate."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np

from catseye.constants import DEGREE, SECONDS_PER_DAY
from catseye.coordinator.journal.entries import EpochSolution
from catseye.coordinator.journal.reader import JournalReader
from catseye.errors import InputError
from catseye.records.files.columns import columns_of
from catseye.records.files.covariance_file import stored_covariance
from catseye.records.files.verdicts import stored_verdict
from catseye.records.night.live import TICKS_PER_DAY, LiveWeather
from catseye.reduction.structure.group import PlacesEpoch
from catseye.reduction.structure.vibration import RangeSeries
from catseye.verdict import Verdict

RESULT, POSE = "coordinates.json", "pose.json"
REQUIRED = ("reduction", "azimuth_deg", "elevation_deg")
OPTIONAL = ("temperature_c", "mjd_utc")
RECENT = 1800.0 / SECONDS_PER_DAY  # d, largest time between weather and epoch
CORRELATED = (
    "A journal's solutions build on each other: they are not independent, and the model's claimed uncertainty is too "
    "small; the epochs left out show by how much. Take one every few minutes with --every-s."
)
AIR = "Temperatures are those of the air at the weather stations; the steel lags behind."


@dataclass(frozen=True, eq=False)
class ReadEpochs:
    """Epochs with their sources, notes and doubts.

    inputs   SHA-256 of each input file, by name
    notes    for the reader
    doubts   notes on epochs that make a model's uncertainty too small
    """

    epochs: tuple[PlacesEpoch, ...]
    inputs: dict[str, str]
    notes: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()

    @property
    def sources(self) -> dict[str, Verdict | None]:
        """Verdict of each epoch, by its label."""
        return {epoch.label: epoch.verdict for epoch in self.epochs}


def read_epochs(sources: Sequence[Path], listed: Path | None = None) -> ReadEpochs:
    """Read epochs of reductions.

    sources   output directories of `catseye reduce`, or directories of these; coordinates.json files
    listed    CSV with the columns reduction, azimuth_deg, elevation_deg and optionally temperature_c and mjd_utc: a
              directory or file, relative to it, and the telescope's position; it overrides the files'

    Raises InputError for a file that is missing, not a reduction, or without posture.
    """
    inputs: dict[str, str] = {}
    epochs = [_epoch(place, {}, inputs) for source in sources for place in _results(source)]
    if listed is not None:
        try:
            raw = listed.read_bytes()
            table = columns_of(raw.decode("utf-8"), str(listed), REQUIRED, optional=OPTIONAL)
        except OSError as problem:
            raise InputError(f"{listed}: {problem.strerror or problem}") from problem
        except UnicodeDecodeError as problem:
            raise InputError(f"{listed}: is no UTF-8 text (expected a CSV table)") from problem
        inputs[listed.name] = hashlib.sha256(raw).hexdigest()
        columns = {name: table.numbers(name) for name in REQUIRED[1:]}
        for name, (low, high) in (("azimuth_deg", (-540.0, 540.0)), ("elevation_deg", (-5.0, 95.0))):
            table.check(name, (columns[name] >= low) & (columns[name] <= high), f"{low:g} to {high:g}")
        columns |= {name: table.numbers(name, float("nan")) for name in OPTIONAL if name in table.cells}
        for row, name in enumerate(table.cells["reduction"]):
            (place,) = _results(listed.parent / name)[:1] or [listed.parent / name]
            epochs.append(_epoch(place, {key: float(v[row]) for key, v in columns.items()}, inputs, name))
    if not epochs:
        raise InputError("no epoch found (expected directories of `catseye reduce`, or --epochs LIST.csv)")
    return ReadEpochs(tuple(epochs), inputs)


def _results(source: Path) -> list[Path]:
    """Paths of the coordinates.json for a source."""
    if source.is_file():
        return [source]
    if (source / RESULT).is_file():
        return [source / RESULT]
    places = sorted(source.glob(f"*/{RESULT}")) if source.is_dir() else []
    if not places:
        what = "holds no coordinates.json, nor do its directories" if source.is_dir() else "missing"
        raise InputError(f"{source}: {what} (expected the output of `catseye reduce`)")
    return places


def _epoch(place: Path, numbers: Mapping[str, float], inputs: dict[str, str], label: str = "") -> PlacesEpoch:
    """Epoch of one reduction, with its posture."""
    document = _object(place, inputs)
    posture = dict(numbers)
    pose = place.parent / POSE
    if "azimuth_deg" not in posture:
        if not pose.is_file():
            raise InputError(f"{place}: no {POSE} with the posture beside it (expected one, or --epochs LIST.csv)")
        nominal = _object(pose, inputs).get("nominal_posture")
        if not isinstance(nominal, dict) or not {"azimuth_deg", "elevation_deg"} <= set(nominal):
            raise InputError(f"{pose}: nominal_posture is missing (expected azimuth_deg and elevation_deg)")
        posture |= {key: float(nominal[key]) for key in ("azimuth_deg", "elevation_deg")}
    provenance = place.parent / "provenance.json"
    if np.isnan(posture.get("mjd_utc", np.nan)) and provenance.is_file():
        campaign = _object(provenance, inputs).get("campaign")
        if isinstance(campaign, dict) and isinstance(campaign.get("start_mjd_utc"), float):
            posture["mjd_utc"] = campaign["start_mjd_utc"]
    names, x, covariance = _places(document, place)
    return PlacesEpoch(
        label or place.parent.name,
        posture.get("mjd_utc", float("nan")),
        posture["azimuth_deg"] * DEGREE,
        posture["elevation_deg"] * DEGREE,
        posture.get("temperature_c", float("nan")),
        names,
        x,
        covariance,
        stored_verdict(str(place), document),
    )


def _object(place: Path, inputs: dict[str, str]) -> dict[str, Any]:
    try:
        raw = place.read_bytes()
        stored = json.loads(raw)
    except OSError as problem:
        raise InputError(f"{place}: {problem.strerror or problem}") from problem
    except (ValueError, RecursionError) as problem:
        raise InputError(f"{place}: is no JSON: {problem}") from problem
    if not isinstance(stored, dict):
        raise InputError(f"{place}: holds no JSON object (expected one)")
    inputs[f"{place.parent.name}/{place.name}"] = hashlib.sha256(raw).hexdigest()
    return stored


def _places(document: Mapping[str, Any], place: Path) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
    """Names, coordinates and covariance of a coordinates.json."""
    points, order = document.get("points"), document.get("covariance_order")
    covariance = stored_covariance(document, place.parent, len(order) if isinstance(order, list) else 0)
    if not isinstance(points, dict) or not isinstance(order, list) or covariance is None:
        raise InputError(f"{place}: points, covariance_order or covariance is missing (expected `catseye reduce`'s)")
    names = tuple(points)
    try:
        x = np.array([[points[name][axis] for axis in "xyz"] for name in names], dtype=float)
        matrix = covariance if isinstance(covariance, np.ndarray) else np.array(covariance, dtype=float)
        at = [order.index(f"{name} {axis}") for name in names for axis in "xyz"]
    except (KeyError, TypeError, ValueError) as problem:
        raise InputError(f"{place}: points and covariance do not fit: {problem} (expected three each)") from problem
    if matrix.shape != (len(order), len(order)) or not np.isfinite(matrix).all() or not np.isfinite(x).all():
        raise InputError(f"{place}: covariance {matrix.shape} of {len(order)} rows (expected a finite square)")
    return names, x, np.array(matrix[np.ix_(at, at)], dtype=float)


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
    return PlacesEpoch(label, mjd, azimuth, elevation, float("nan"), tuple(names), places, q)


def _warmed(epoch: PlacesEpoch, times: np.ndarray, warm: np.ndarray) -> PlacesEpoch:
    from dataclasses import replace

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
        series.append(RangeSeries(ranger, target, seconds[good], ranges[good, 2], ranges[good, 3], window))
    return tuple(series), hashes, zero / TICKS_PER_DAY
