"""A journal's run as tables of an archive: each epoch's results as they were stored."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from catseye.coordinator.journal.check import ChainReport
from catseye.coordinator.journal.entries import EPOCH_RANGES, AnsweredShot, Document, EpochSolution
from catseye.coordinator.journal.reader import JournalReader, Kind, StoredRun
from catseye.gateways.archive.content import Columns, NightContent, NightInputs, broadcast
from catseye.gateways.archive.night import (
    ZERO,
    certificate_rows,
    coordinate_columns,
    pose_columns,
    sample_cycles,
    zero_priors,
)
from catseye.gateways.journal.chain import chain_object
from catseye.records.night.campaign import Campaign
from catseye.records.night.live import TICKS_PER_DAY, LivePosture, LiveWeather
from catseye.records.site.folder import SiteFolder
from catseye.reduction.epoch.reason import ShotStatus
from catseye.reduction.site.places import places_of
from catseye.reduction.site.point_kinds import point_kinds
from catseye.verdict import Verdict

NAN = float("nan")
BODIES = {"dish": "dish", "feed": "feed arm"}  # by the key of an epoch's pose
REFLECTOR = "reflector"  # frame of such motions
NOT_REJECTED = (str(ShotStatus.USED), str(ShotStatus.REFERENCE), "")
KINDS: tuple[Kind, ...] = ("shots", "weather", "postures", "solutions", "documents")
RANGE_COLUMNS = ("u_range", "residual", "w")


@dataclass
class RunEntries:
    """Entries of a journal's run that go into tables.

    ranges   of each shot, by its number: u of the range, residual, w, as its epoch had them
    """

    shots: list[AnsweredShot] = field(default_factory=list)
    weather: list[LiveWeather] = field(default_factory=list)
    postures: list[LivePosture] = field(default_factory=list)
    solutions: list[EpochSolution] = field(default_factory=list)
    ranges: dict[int, tuple[float, ...]] = field(default_factory=dict)

    @staticmethod
    def of(reader: JournalReader, run: int) -> "RunEntries":
        """Entries of a run without samples; InputError for a damaged journal."""
        entries = RunEntries()
        for _, entry in reader.events(run, kinds=KINDS, buffers=False):
            if isinstance(entry, AnsweredShot):
                entries.shots.append(entry)
            elif isinstance(entry, LiveWeather):
                entries.weather.append(entry)
            elif isinstance(entry, LivePosture):
                entries.postures.append(entry)
            elif isinstance(entry, EpochSolution) and entry.answer:
                entries.solutions.append(entry)
            elif isinstance(entry, Document) and entry.name == EPOCH_RANGES:
                columns = json.loads(entry.text)
                rows = zip(*(columns[name] for name in RANGE_COLUMNS), strict=True)
                entries.ranges |= {n: tuple(map(_number, row)) for n, row in zip(columns["shot"], rows, strict=True)}
        return entries

    @property
    def ticks(self) -> list[int]:
        """Times of shots and readings."""
        return [entry.shot.ticks for entry in self.shots] + [read.ticks for read in self.weather]

    def elevation(self, mjd: np.ndarray) -> np.ndarray:
        """Elevation of the telescope at some times, rad, between its reports; NaN without any."""
        if not self.postures:
            return np.full(len(mjd), NAN)
        return np.interp(mjd, _mjd(self.postures), [posture.elevation for posture in self.postures])


def run_content(
    run: StoredRun,
    site: SiteFolder,
    entries: RunEntries,
    *,
    chain: ChainReport,
    verdict: Verdict,
    inputs: NightInputs,
    campaign: Campaign | None,
) -> NightContent:
    """Content of a journal's run for an archive.

    site       of the run
    chain      verification of the run
    verdict    on the run as a whole
    inputs     its shots with samples as a campaign, or its site's files alone
    campaign   read from there; None where there is none
    """
    ticks = entries.ticks
    common = {"night": inputs.night}
    weather = _conditions(entries.weather)
    solutions, judged = entries.solutions, {"verdict": verdict.word, "why": verdict.why}
    tables: dict[str, Columns] = {
        "nights": broadcast(
            {**inputs.row, "name": site.site.campaign.name, **_night(run, entries), **weather, **judged}, 1
        ),
        "points": _points(site, solutions, common, weather),
        "zeros": _zeros(site, solutions, common, weather),
        "weather": _weather(entries, common),
        "residuals": _residuals(entries, common),
        "certificates": certificate_rows(site, {**common, "mjd": _middle(ticks)}),
    }
    poses = [(s, name, motion) for s in solutions for name, motion in _motions(s)]
    if poses:
        tables["poses"] = _poses(poses, common, weather)
    journal = {"uuid": run.uuid, "chain": chain_object(chain), "versions": run.versions, "settings": run.settings}
    return NightContent(
        night=inputs.night,
        first=min(ticks) / TICKS_PER_DAY,
        last=max(ticks) / TICKS_PER_DAY,
        source="journal",
        origin=run.uuid,
        inputs_sha256=inputs.sha256,
        provenance={"journal": journal},
        tables=tables,
        directory=inputs.directory,
        inputs=inputs.files,
        **({} if campaign is None else sample_cycles(campaign)),
    )


def _night(run: StoredRun, entries: RunEntries) -> dict[str, Any]:
    """Sums and means over a run's epochs."""
    answers = [solution.answer for solution in entries.solutions]
    degrees = [_number(answer.get("degrees_of_freedom")) for answer in answers]
    statuses = [entry.status for entry in entries.shots]
    live: Any = run.settings.get("live")
    reduction = live.get("reduction") if isinstance(live, Mapping) else None
    return {
        "mjd": _middle(entries.ticks),
        "source": "journal",
        "digest": _digest(entries.solutions),
        "version": run.versions.get("catseye", ""),
        "air_model": reduction.get("air_model", "") if isinstance(reduction, Mapping) else "",
        "points": len({name for answer in answers for name in answer.get("names") or ()}),
        "shots": len(statuses),
        "rejected": sum(status not in NOT_REJECTED for status in statuses),
        "variance_factor": _mean([_number(answer.get("variance_factor")) for answer in answers], degrees),
        "degrees_of_freedom": float(np.nansum(degrees)) if degrees else NAN,
        "refractivity_ppm": _mean([_number(answer.get("refractivity_ppm")) for answer in answers]),
        "azimuth": _mean([posture.azimuth for posture in entries.postures]),
        "elevation": _mean([posture.elevation for posture in entries.postures]),
    }


def _points(
    site: SiteFolder, solutions: Sequence[EpochSolution], common: Mapping[str, Any], weather: Mapping[str, float]
) -> Columns:
    """A row a point and epoch; covariance NaN for an epoch that has none."""
    solved = [s for s in solutions if s.answer.get("names")]
    names = [s.answer["names"] for s in solved]
    rows = [len(group) for group in names]
    flat = [name for group in names for name in group]
    kinds = point_kinds(site, dict.fromkeys(flat), places_of(site))
    x = np.array([place for s in solved for place in s.answer["x"]], dtype=float).reshape(-1, 3)
    blocks = [_blocks(s.covariance, n) for s, n in zip(solved, rows, strict=True)]
    columns = {
        "point": np.array(flat, np.str_),
        "body": np.array([kinds[name] for name in flat], np.str_),
        **coordinate_columns(x, np.concatenate(blocks) if blocks else np.zeros((0, 3, 3))),
        "shots": np.array([n for s in solved for n in s.answer["shots"]], np.int64),
        **common,
        **{name: np.repeat(values, rows) for name, values in _epochs(solved).items()},
        "temperature_c": weather["temperature_c"],
    }
    return broadcast(columns, len(flat))


def _zeros(
    site: SiteFolder, solutions: Sequence[EpochSolution], common: Mapping[str, Any], weather: Mapping[str, float]
) -> Columns:
    rows = [(s.ticks, name, v, u) for s in solutions for name, (v, u) in (s.answer.get("zeros") or {}).items()]
    u_prior = zero_priors(site, sorted({name for _, name, _, _ in rows}))
    columns = {
        "ranger": np.array([row[1] for row in rows], np.str_),
        "mjd": np.array([row[0] for row in rows], float) / TICKS_PER_DAY,
        "parameter": ZERO,
        "value": np.array([_number(row[2]) for row in rows]),
        "u": np.array([_number(row[3]) for row in rows]),
        "prior": 0.0,
        "u_prior": np.array([u_prior[row[1]] for row in rows]),
        **common,
        "temperature_c": weather["temperature_c"],
    }
    return broadcast(columns, len(rows))


def _motions(solution: EpochSolution) -> list[tuple[str, Any]]:
    """Motions of bodies in an epoch's pose."""
    pose: Any = solution.answer.get("pose") or {}
    return [(name, pose[key]) for key, name in BODIES.items() if pose.get(key)]


def _poses(
    motions: Sequence[tuple[EpochSolution, str, Any]], common: Mapping[str, Any], weather: Mapping[str, float]
) -> Columns:
    """A row a body and epoch: its motion since the run's reference epoch."""
    vectors = {
        key: np.array([motion[key] for _, _, motion in motions], dtype=float).T
        for key in ("pivot", "translation", "rotation")
    }
    covariance = np.array([motion["covariance"] for _, _, motion in motions], dtype=float)
    columns = {
        "body": [name for _, name, _ in motions],
        "frame": REFLECTOR,
        **pose_columns(vectors["pivot"], vectors["translation"], vectors["rotation"], np.moveaxis(covariance, 0, -1)),
        **_epochs([solution for solution, _, _ in motions]),
        **common,
        "temperature_c": weather["temperature_c"],
        "unobserved": "",
    }
    return broadcast(columns, len(motions))


def _weather(entries: RunEntries, common: Mapping[str, Any]) -> Columns:
    """Readings, each with the thermometer's error by the first epoch after it."""
    reads, solutions = entries.weather, entries.solutions
    errors = np.full((len(reads), 2), NAN)
    if solutions:
        at = np.searchsorted([s.ticks for s in solutions], [read.ticks for read in reads])
        for row, (read, k) in enumerate(zip(reads, np.minimum(at, len(solutions) - 1), strict=True)):
            estimate = (solutions[int(k)].answer.get("air") or {}).get(read.station)
            if estimate is not None:
                errors[row] = [_number(value) for value in estimate]
    columns = {
        "station": np.array([read.station for read in reads], np.str_),
        "mjd": _mjd(reads),
        "temperature_c": np.array([read.temperature_c for read in reads], float),
        "pressure_hpa": np.array([read.pressure_hpa for read in reads], float),
        "humidity_percent": np.array([read.humidity_percent for read in reads], float),
        "t_error_c": errors[:, 0],
        "u_t_error_c": errors[:, 1],
        **common,
    }
    return broadcast(columns, len(reads))


def _residuals(entries: RunEntries, common: Mapping[str, Any]) -> Columns:
    """A row a shot; residual and w by its epoch, NaN outside all epochs."""
    shots = entries.shots
    mjd = np.array([entry.shot.ticks for entry in shots], float) / TICKS_PER_DAY
    nothing = (NAN,) * len(RANGE_COLUMNS)
    of_epochs = np.array([entries.ranges.get(entry.shot.number, nothing) for entry in shots]).reshape(-1, 3)
    alone = np.array([entry.u_range for entry in shots], float)
    columns = {
        "shot": np.array([entry.shot.number for entry in shots], np.int64),
        "mjd": mjd,
        "ranger": np.array([entry.shot.ranger for entry in shots], np.str_),
        "target": np.array([entry.shot.target for entry in shots], np.str_),
        "elevation": entries.elevation(mjd),
        "range": np.array([entry.range_ for entry in shots], float),
        "u": np.where(np.isnan(of_epochs[:, 0]), alone, of_epochs[:, 0]),
        "residual": of_epochs[:, 1],
        "w": of_epochs[:, 2],
        "status": np.array([entry.status for entry in shots], np.str_),
        **common,
    }
    return broadcast(columns, len(shots))


def _epochs(solutions: Sequence[EpochSolution]) -> dict[str, np.ndarray]:
    """Time and posture of each epoch."""
    return {
        "mjd": _mjd(solutions),
        "azimuth": np.array([_number(s.answer.get("azimuth")) for s in solutions], float),
        "elevation": np.array([_number(s.answer.get("elevation")) for s in solutions], float),
    }


def _blocks(covariance: np.ndarray | None, points: int) -> np.ndarray:
    """Each point's covariance (points, 3, 3); NaN without the matrix."""
    if covariance is None or covariance.shape != (3 * points, 3 * points):
        return np.full((points, 3, 3), NAN)
    k = np.arange(points)
    return covariance.reshape(points, 3, points, 3)[k, :, k, :]


def _digest(solutions: Sequence[EpochSolution]) -> str:
    """SHA-256 over names, coordinates and covariances of all epochs."""
    digest = hashlib.sha256()
    for solution in solutions:
        digest.update(solution.text.encode())
        if solution.covariance is not None:
            digest.update(np.ascontiguousarray(solution.covariance, "<f8").tobytes())
    return digest.hexdigest()


def _conditions(reads: Sequence[LiveWeather]) -> dict[str, float]:
    """Mean weather over all readings."""
    names = ("temperature_c", "pressure_hpa", "humidity_percent")
    return {name: _mean([getattr(read, name) for read in reads]) for name in names}


def _mean(values: Sequence[float], weights: Sequence[float] | None = None) -> float:
    """Mean of the finite values; NaN without any."""
    array = np.array(values, float)
    w = np.ones(len(array)) if weights is None else np.nan_to_num(np.array(weights, float))
    w = np.where(np.isfinite(array), w, 0.0)
    return float(np.sum(w * np.nan_to_num(array)) / w.sum()) if w.sum() > 0.0 else NAN


def _middle(ticks: Sequence[int]) -> float:
    return 0.5 * (min(ticks) + max(ticks)) / TICKS_PER_DAY


def _mjd(entries: Sequence[Any]) -> np.ndarray:
    return np.array([entry.ticks for entry in entries], float) / TICKS_PER_DAY


def _number(value: Any) -> float:
    return NAN if value is None else float(value)
