"""Recipe of an archive's trends: bodies, instruments, calibrations, and the alarms that follow."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase

import numpy as np

from catseye.aliases import Progress
from catseye.errors import ArgumentError, EstimationError, InputError
from catseye.records.archive.reading import ArchiveFolder
from catseye.reduction.structure.group import Nominal
from catseye.reduction.trends.alarms import (
    Severity,
    TrendAlarm,
    TrendQuantity,
    body_alarms,
    calibration_alarms,
    certificate_alarms,
    in_order,
    instrument_alarms,
    motion_alarms,
    night_alarms,
)
from catseye.reduction.trends.bodies import (
    BodyTrend,
    MotionTrend,
    TrendSettings,
    bodies_in_frames,
    fit_body,
    fit_motion,
)
from catseye.reduction.trends.functions import TrendFunctions, separated_functions
from catseye.reduction.trends.instruments import InstrumentTrend, drift_probability, fit_instruments, ground_scale
from catseye.reduction.trends.tables import (
    ArchivedNights,
    PoseReadings,
    SingleSeries,
    StationReadings,
    beside_others,
    body_names,
    read_body,
    read_certificates,
    read_nights,
    read_poses,
    read_thermometers,
    read_zeros,
)
from catseye.verdict import Verdict

FEWEST_NIGHTS = 2
POSE_LENGTH = 10.0  # m, at which turns of a pose count as shifts
FAMILIES = 2  # steps and drifts share the false alarms


@dataclass(frozen=True, eq=False)
class PoseTrend:
    """Model of a body's pose.

    poses       through the nights
    functions   of the model
    motion      shift and turn
    """

    poses: PoseReadings
    functions: TrendFunctions
    motion: MotionTrend


@dataclass(frozen=True, eq=False)
class TrendFindings:
    """Trends of an archive.

    nights         that count
    bodies         models of the points, by body
    poses          models of the poses
    instruments    zeros, thermometers, the ground's scale, each with its quantity
    alarms         in order, the worst first
    false_alarm    probability of any step or drift without cause
    series         number of series that were tested
    notes          for the reader
    """

    nights: ArchivedNights
    bodies: tuple[BodyTrend, ...]
    poses: tuple[PoseTrend, ...]
    instruments: tuple[tuple[TrendQuantity, InstrumentTrend], ...]
    alarms: tuple[TrendAlarm, ...]
    false_alarm: float
    series: int
    notes: tuple[str, ...]

    def count(self, severity: Severity) -> int:
        """Number of alarms of a severity."""
        return sum(alarm.severity is severity for alarm in self.alarms)

    @property
    def verdict(self) -> Verdict:
        """Good without alarms and warnings; failed where nothing could be modelled."""
        if not (self.bodies or self.poses or self.instruments):
            return Verdict("failed", "no series has enough nights for a model")
        first = next(iter(self.alarms), None)
        if first is None or first.severity is Severity.NOTE:
            return Verdict("good", f"no step, drift or aged calibration in {len(self.nights)} nights")
        counts = [(self.count(s), s.value) for s in (Severity.ALARM, Severity.WARNING)]
        listed = " and ".join(f"{n} {word}{'s' if n > 1 else ''}" for n, word in counts if n)
        return Verdict("doubtful", f"{listed}, first {first.subject}: {first.kind.value}")


@dataclass(frozen=True)
class TrendRequest:
    """Part of an archive that is looked at, and the models.

    bodies        kinds of points, or bodies with a pose, or patterns; None for all
    since, until  MJD, the last excluded; None for no limit
    harmonics     of elevation, 1 or 2
    annual        True for an annual wave beside temperature
    false_alarm   probability that an archive without a change raises a step or a drift at all
    nominal       rigid telescope
    """

    bodies: Sequence[str] | None = None
    since: float | None = None
    until: float | None = None
    harmonics: int = 1
    annual: bool = True
    false_alarm: float = 0.01
    nominal: Nominal = field(default_factory=Nominal)


def find_trends(
    archive: ArchiveFolder, request: TrendRequest | None = None, *, progress: Progress | None = None
) -> TrendFindings:
    """Trends of an archive.

    archive    to read
    request    part of it, and the models; None for the defaults
    progress   called with (what, done, of how many)

    Raises InputError for an archive without two nights, an unknown body, a damaged file.
    """
    what = request or TrendRequest()
    nights = read_nights(archive, what.since, what.until)
    if len(nights) < FEWEST_NIGHTS:
        raise InputError(
            f"{archive.directory}: one night, {nights.night[0]} (expected {FEWEST_NIGHTS} nights or more for a trend)"
        )
    kinds, posed = body_names(archive, nights)
    chosen = _chosen(what.bodies, (*kinds, *posed))
    zeros = read_zeros(archive, nights)
    readings = read_thermometers(archive, nights)
    poses = read_poses(archive, [body for body in posed if body in chosen], nights)
    names = [kind for kind in kinds if kind in chosen]
    singles = [one for one in (*zeros, *readings.by_ranges) if len(one.mjd) >= FEWEST_NIGHTS]
    series = sum(kinds[name] + 2 for name in names) + len(poses) + len(singles) + len(readings.stations)
    limit = what.false_alarm / FAMILIES / max(series, 1)
    settings = TrendSettings(harmonics=what.harmonics, annual=what.annual, probability=limit)
    alarms = night_alarms(nights)
    notes: list[str] = []
    modelled, scales = _bodies(archive, nights, names, settings, what.nominal, notes, progress)
    for body in modelled:
        alarms += body_alarms(body, series, limit)
    posed_trends = [_pose(one, settings) for one in poses if len(one.mjd) >= FEWEST_NIGHTS]
    for pose in posed_trends:
        alarms += motion_alarms(
            pose.poses.body, pose.motion, pose.poses.mjd, pose.functions, POSE_LENGTH, series, limit
        )
    instruments = _instruments(zeros, readings, nights, scales, settings, notes)
    certificates = read_certificates(archive, nights)
    for quantity, trend in instruments:
        alarms += instrument_alarms(trend, quantity, series, limit)
        if quantity in (TrendQuantity.ZERO, TrendQuantity.PARAMETER):
            alarms += calibration_alarms(trend, certificates, limit)
    alarms += certificate_alarms(certificates, nights)
    if not len(certificates["mjd"]):
        notes.append("No certificate is in the archive: their ends were not looked at.")
    return TrendFindings(
        nights=nights,
        bodies=tuple(modelled),
        poses=tuple(posed_trends),
        instruments=tuple(instruments),
        alarms=in_order(alarms),
        false_alarm=what.false_alarm,
        series=series,
        notes=tuple(notes),
    )


def _chosen(bodies: Sequence[str] | None, names: Sequence[str]) -> set[str]:
    """Names that are wanted; InputError for a pattern that none has."""
    if bodies is None:
        return set(names)
    for pattern in bodies:
        if not any(fnmatchcase(name, pattern) for name in names):
            listed = ", ".join(dict.fromkeys(names)) or "none"
            raise ArgumentError(f"bodies = {pattern!r}: not in the archive (expected one of {listed})", "bodies")
    return {name for name in names if any(fnmatchcase(name, pattern) for pattern in bodies)}


def _bodies(
    archive: ArchiveFolder,
    nights: ArchivedNights,
    names: Sequence[str],
    settings: TrendSettings,
    nominal: Nominal,
    notes: list[str],
    progress: Progress | None,
) -> tuple[list[BodyTrend], list[SingleSeries]]:
    """Models of the points, body by body, and scales of the ground."""
    series_of, scales = [], []
    for name in names:
        points, stride = read_body(archive, name, nights, progress)
        if stride > 1:
            notes.append(f"{name}: one night of {stride} was taken, as its readings are too many for memory.")
        if not points.names:
            notes.append(f"{name}: no night has a usable covariance; no model.")
            continue
        for frame, part in bodies_in_frames(points, nominal):
            if progress is not None:
                progress(f"modelling {part.name}", 0, 0)
            try:
                body = fit_body(part, frame, settings, nominal)
            except (InputError, EstimationError) as problem:
                notes.append(f"{problem}; no model.")
                continue
            series_of.append(body)
            notes.extend(_body_notes(body))
            scale = ground_scale(body, nights)
            if scale is not None:
                scales.append(scale)
    return series_of, scales


def _body_notes(body: BodyTrend) -> list[str]:
    """Notes on what a body's nights do not separate."""
    notes = []
    if body.functions.omitted:
        notes.append(
            f"{body.name}: its nights do not separate {', '.join(body.functions.omitted)}; the model is without."
        )
    if body.motion is None:
        notes.append(f"{body.name}: too few points for a motion of the body; each point was modelled by itself.")
    weak = int(np.sum(~np.isfinite(body.own.fit.coefficients).all(axis=(1, 2))))
    if weak:
        notes.append(f"{body.name}: {weak} of {len(body.points.names)} points have too few nights for the model.")
    return notes


def _pose(poses: PoseReadings, settings: TrendSettings) -> PoseTrend:
    functions = separated_functions(
        poses.elevation, poses.temperature_c, poses.mjd, harmonics=settings.harmonics, annual=settings.annual
    )
    rows = functions.rows(np.nan_to_num(poses.elevation), np.nan_to_num(poses.temperature_c), poses.mjd)
    return PoseTrend(poses, functions, fit_motion(poses.mjd, poses.six, poses.covariance, rows, settings))


def _instruments(
    zeros: list[SingleSeries],
    readings: StationReadings,
    nights: ArchivedNights,
    scales: list[SingleSeries],
    settings: TrendSettings,
    notes: list[str],
) -> list[tuple[TrendQuantity, InstrumentTrend]]:
    """Models of zeros, thermometers and scales."""
    groups: list[tuple[TrendQuantity, list[SingleSeries]]] = []
    for parameter in sorted({one.parameter for one in zeros}, key=lambda p: (p != "zero", p)):
        quantity = TrendQuantity.ZERO if parameter == "zero" else TrendQuantity.PARAMETER
        groups.append((quantity, [one for one in zeros if one.parameter == parameter]))
    groups += [(TrendQuantity.THERMOMETER, list(readings.by_ranges)), (TrendQuantity.SCALE, scales)]
    if not zeros:
        notes.append("No night estimates a ranger's zero: zeros were not looked at.")
    series_of = [(quantity, trend) for quantity, one in groups if (trend := fit_instruments(one, settings)) is not None]
    if not readings.by_ranges:
        notes.append("No night estimates an error of a thermometer: thermometers were compared with each other alone.")
        beside = _beside_others(readings, nights, settings)
        series_of += [] if beside is None else [(TrendQuantity.STATION, beside)]
    return series_of


def _beside_others(
    readings: StationReadings, nights: ArchivedNights, settings: TrendSettings
) -> InstrumentTrend | None:
    """Stations against each other: the one that changed most is taken out of the others' comparison, and so on."""
    doubted: frozenset[str] = frozenset()
    while True:
        trend = fit_instruments(beside_others(readings, nights, doubted), settings)
        if trend is None or len(readings.stations) - len(doubted) <= FEWEST_NIGHTS:
            return trend
        probability = drift_probability(trend.found.fit, trend.functions)[2]
        for step in trend.found.steps:
            probability[step.series] = min(probability[step.series], step.probability)
        order = np.argsort(probability)
        worst = next((i for i in order if trend.subjects[i] not in doubted), None)
        if worst is None or probability[worst] >= settings.probability:
            return trend
        doubted |= {trend.subjects[worst]}
