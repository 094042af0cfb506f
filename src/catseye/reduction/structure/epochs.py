"""Epochs of a structure from reductions or a list of them."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from catseye.constants import DEGREE
from catseye.errors import InputError
from catseye.records.files.columns import columns_of
from catseye.records.files.reading import Folder
from catseye.records.files.verdicts import PROVENANCE
from catseye.records.network.solved_points import FILE, SolvedPoints, read_points, read_solved_points
from catseye.records.network.written_pose import FILE as POSE_FILE
from catseye.reduction.structure.group import PlacesEpoch
from catseye.verdict import Verdict

REQUIRED = ("reduction", "azimuth_deg", "elevation_deg")
OPTIONAL = ("temperature_c", "mjd_utc")
TABLE = ".csv"  # of points, as docs/formats/surface.md has it


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


def read_epochs(sources: Sequence[Path | SolvedPoints], listed: Path | None = None) -> ReadEpochs:
    """Read epochs of reductions.

    sources   output directories of `catseye reduce`, or directories of these; coordinates.json files; solved points
    listed    CSV with the columns reduction, azimuth_deg, elevation_deg and optionally temperature_c and mjd_utc: a
              directory or file (also a CSV table of points), relative to it, and the telescope's position; it
              overrides the files'

    Raises InputError for a file that is missing, not a reduction, or without posture.
    """
    inputs: dict[str, str] = {}
    epochs: list[PlacesEpoch] = []
    for source in sources:
        if isinstance(source, SolvedPoints):
            epochs.append(_epoch_of(source, source.campaign or source.file, {}))
            inputs |= {f"{epochs[-1].label}/{name}": digest for name, digest in source.hashes.items()}
        else:
            epochs += [_epoch(place, {}, inputs) for place in _results(source)]
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
        raise InputError("no epoch found (expected directories of `catseye reduce`, or a list of them)")
    return ReadEpochs(tuple(epochs), inputs)


def _results(source: Path) -> list[Path]:
    """Paths of the coordinates.json for a source."""
    if source.is_file():
        return [source]
    if (source / FILE).is_file():
        return [source / FILE]
    places = sorted(source.glob(f"*/{FILE}")) if source.is_dir() else []
    if not places:
        what = "holds no coordinates.json, nor do its directories" if source.is_dir() else "missing"
        raise InputError(f"{source}: {what} (expected the output of `catseye reduce`)")
    return places


def _epoch(place: Path, numbers: Mapping[str, float], inputs: dict[str, str], label: str = "") -> PlacesEpoch:
    """Epoch of one reduction's file, with its posture."""
    numbers = dict(numbers)
    try:
        table = place.suffix.lower() == TABLE
        solved = read_points(place) if table else read_solved_points(place, averaged=False)
        if table and not np.any(solved.block(solved.names)):
            raise InputError(f"{place.name}: its points have no uncertainty (expected u_mm, or u_x_mm, u_y_mm, u_z_mm)")
        hashes = dict(solved.hashes)
        if "azimuth_deg" in numbers:
            hashes.pop(POSE_FILE, None)  # the list's posture counts
        if np.isnan(numbers.get("mjd_utc", np.nan)):
            folder = Folder(place.parent)
            numbers["mjd_utc"] = _start_mjd(folder)
            hashes |= folder.hashes
        inputs |= {f"{place.parent.name}/{name}": digest for name, digest in hashes.items()}
        return _epoch_of(solved, label or place.parent.name, numbers)
    except InputError as problem:
        raise InputError(f"{place.parent}: {problem}") from problem


def _epoch_of(solved: SolvedPoints, label: str, numbers: Mapping[str, float]) -> PlacesEpoch:
    """Epoch of solved points; a list's numbers count before their own posture."""
    posture = solved.posture
    if "azimuth_deg" in numbers:
        posture = numbers["azimuth_deg"] * DEGREE, numbers["elevation_deg"] * DEGREE
    if posture is None:
        raise InputError(f"{label}: its posture is unknown (expected {POSE_FILE} with one, or a list of epochs)")
    covariance = solved.block(solved.names)
    if not np.isfinite(covariance).all():
        raise InputError(f"{label}: has a covariance that is not a number (expected m^2)")
    return PlacesEpoch(
        label=label,
        mjd=numbers.get("mjd_utc", float("nan")),
        azimuth=posture[0],
        elevation=posture[1],
        temperature_c=numbers.get("temperature_c", float("nan")),
        names=solved.names,
        coordinates=solved.x,
        covariance=covariance,
        verdict=solved.verdict,
    )


def _start_mjd(folder: Folder) -> float:
    """Start of a reduction's campaign, MJD in UTC; nan where its provenance does not say it."""
    if not (folder.directory / PROVENANCE).is_file():
        return float("nan")
    try:
        campaign = json.loads(folder.text(PROVENANCE)).get("campaign")
    except (ValueError, RecursionError, AttributeError) as problem:
        raise InputError(f"{PROVENANCE}: is no JSON object: {problem}") from problem
    start = campaign.get("start_mjd_utc") if isinstance(campaign, dict) else None
    return start if isinstance(start, float) else float("nan")
